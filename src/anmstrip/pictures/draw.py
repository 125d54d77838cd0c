"""Draw a pickled job with pyvista: `python -m anmstrip.pictures.draw < job`."""

from __future__ import annotations

import pickle
import sys

import numpy as np
import pyvista

from anmstrip.pictures.views import AMBIENT, GREYS, LIGHT, NO_VALUE, OUTLINE, Frame, Job

IN_FRONT = 0.02
"""Shift of the strip to the eye, over half the height seen: a parallel projection stays the same,
and the roller does not shine through where both coincide."""
JOINED = 1e-6
"""Largest distance, over the size of the surface, of points of neighbours that are one: VTK finds
them in single precision, a triangle's from either end of the side."""
BAR = {
    "color": "black",
    "vertical": False,
    "width": 0.34,
    "height": 0.11,
    "position_x": 0.62,
    "position_y": 0.84,
    "title_font_size": 22,
    "label_font_size": 18,
    "fmt": "%.3g",
}


def draw(job: Job) -> None:
    """Draw every frame of a job."""
    eye = job.eye
    for frame in job.frames:
        plotter = pyvista.Plotter(off_screen=True, window_size=list(job.size), lighting="none")
        plotter.set_background("white")
        plotter.enable_anti_aliasing("msaa", multi_samples=8)
        add_strip(plotter, job, frame)
        if rollers := frame.read_rollers():
            points, cells, tones = rollers
            surface = pyvista.PolyData(points, np.insert(cells, 0, 4, axis=1))
            for tone, grey in enumerate(GREYS):
                sectors = surface.extract_cells(tones == tone).extract_surface(
                    algorithm="dataset_surface"
                )
                plotter.add_mesh(
                    sectors, color=grey, smooth_shading=True, ambient=AMBIENT, diffuse=1.0 - AMBIENT
                )
        place = 24, job.size[1] - 46
        plotter.add_text(f"t = {frame.time:.4g} s", position=place, color="black", font_size=11)
        camera = plotter.camera
        camera.parallel_projection = True
        camera.focal_point = eye.focus
        camera.position = eye.focus + 10.0 * eye.half_height * eye.axes[2]
        camera.up = eye.axes[1]
        camera.parallel_scale = eye.half_height
        plotter.renderer.reset_camera_clipping_range()
        lamp = pyvista.Light(position=eye.focus + LIGHT @ eye.axes, focal_point=eye.focus)
        lamp.positional = False
        plotter.add_light(lamp)
        plotter.screenshot(frame.picture)
        plotter.close()


def add_strip(plotter: pyvista.Plotter, job: Job, frame: Frame) -> None:
    """Add the strip with its field, its outline and the scale."""
    label, factor, limits = job.scale
    grid = pyvista.read(frame.strip)
    grid.clear_data()
    grid[label] = frame.read_strip(job.field)[2] * factor
    surface = grid.extract_surface(nonlinear_subdivision=3, algorithm="dataset_surface")
    surface = surface.clean(tolerance=JOINED, absolute=False)
    nearer = IN_FRONT * job.eye.half_height * job.eye.axes[2]
    surface.translate(nearer, inplace=True)
    plotter.add_mesh(
        surface,
        scalars=label,
        cmap=job.colours,
        clim=list(limits),
        smooth_shading=True,
        nan_color=NO_VALUE,
        ambient=AMBIENT,
        diffuse=1.0 - AMBIENT,
        specular=0.1,
        scalar_bar_args={"title": label + "\n", "n_labels": job.labels, **BAR},
    )
    outline = surface.extract_feature_edges(feature_edges=False, manifold_edges=False)
    outline.translate(0.2 * nearer, inplace=True)
    plotter.add_mesh(outline, color=OUTLINE, line_width=2.0, lighting=False)


if __name__ == "__main__":
    draw(pickle.load(sys.stdin.buffer))
