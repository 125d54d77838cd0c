"""Draw a job with pyvista: `python -m anmstrip.pictures.draw < job.json`."""

from __future__ import annotations

import sys

import numpy as np
import pyvista

from anmstrip.pictures.views import AMBIENT, GREYS, LIGHT, OUTLINE, Frame, Job, title

_IN_FRONT = 0.02
"""How far the strip is shifted to the eye, of half the height seen: a parallel projection stays
the same, and the roller does not shine through where both coincide."""
_JOINED = 1e-6
"""How near, in units of the surface, neighbours' points on a common side are to be one: VTK finds
them in single precision, a triangle's from either end of the side."""


def main() -> None:
    """Read a job from standard input and draw it."""
    draw(Job.from_json(sys.stdin.read()))


def draw(job: Job) -> None:
    """Draw every frame of a job."""
    for frame in job.frames:
        plotter = pyvista.Plotter(off_screen=True, window_size=list(job.size), lighting="none")
        plotter.set_background("white")
        plotter.enable_anti_aliasing("msaa", multi_samples=8)
        _add_strip(plotter, job, frame)
        _add_rollers(plotter, frame)
        place = 24, job.size[1] - 46
        plotter.add_text(f"t = {frame.time:.4g}", position=place, color="black", font_size=11)
        _look(plotter, job)
        plotter.screenshot(frame.picture)
        plotter.close()


def _add_strip(plotter: pyvista.Plotter, job: Job, frame: Frame) -> None:
    _, _, values = frame.strip_coloured(job.field)
    label, factor = title(job.field, max(map(abs, job.limits)))
    grid = pyvista.read(frame.strip)
    grid.clear_data()
    grid[label] = values * factor
    surface = grid.extract_surface(nonlinear_subdivision=3, algorithm="dataset_surface")
    surface = surface.clean(tolerance=_JOINED, absolute=False)
    nearer = _IN_FRONT * job.eye.half_height * job.eye.axes[2]
    surface.translate(nearer, inplace=True)
    plotter.add_mesh(
        surface,
        scalars=label,
        cmap=job.colours,
        clim=[limit * factor for limit in job.limits],
        smooth_shading=True,
        nan_color="#d9d9d9",
        ambient=AMBIENT,
        diffuse=1.0 - AMBIENT,
        specular=0.1,
        scalar_bar_args=_bar(label),
    )
    outline = surface.extract_feature_edges(feature_edges=False, manifold_edges=False)
    outline.translate(0.2 * nearer, inplace=True)
    plotter.add_mesh(outline, color=OUTLINE, line_width=2.0, lighting=False)


def _bar(label: str) -> dict[str, object]:
    return {
        "title": label + "\n",
        "color": "black",
        "vertical": False,
        "width": 0.34,
        "height": 0.11,
        "position_x": 0.62,
        "position_y": 0.84,
        "title_font_size": 22,
        "label_font_size": 18,
        "n_labels": 5,
        "fmt": "%.3g",
    }


def _add_rollers(plotter: pyvista.Plotter, frame: Frame) -> None:
    toned = frame.rollers_toned()
    if toned is None:
        return
    surface, tones = toned
    cells = np.insert(surface.cells, 0, 4, axis=1)
    rollers = pyvista.PolyData(surface.points, cells)
    for tone, grey in enumerate(GREYS):
        sectors = rollers.extract_cells(tones == tone)
        plotter.add_mesh(sectors, color=grey, ambient=AMBIENT, diffuse=1.0 - AMBIENT)


def _look(plotter: pyvista.Plotter, job: Job) -> None:
    eye = job.eye
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


if __name__ == "__main__":
    main()
