"""Pictures show the strip, its field and the rollers, with and without OpenGL."""

import logging
import shutil
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image
from PIL.ImageSequence import Iterator

from anmstrip.errors import InputError
from anmstrip.pictures import render as pictures
from anmstrip.pictures.render import HEAD_SHARE, Eye, render, title, widen_scale
from anmstrip.results.vtk import FIELDS, Collection, read_surface, subdivide, write_surface
from wrapped_strip import lattice, tensor_grids, wrapped, write_state

PROBE = "import pyvista; pyvista.Sphere().plot(off_screen=True, screenshot='probe.png')"
RED, GREY = "#8c1c2b", "#8d9197"


@pytest.fixture
def without_opengl(monkeypatch):
    monkeypatch.setenv("ANMSTRIP_RENDERER", "matplotlib")


@pytest.fixture(scope="module")
def opengl(tmp_path_factory):
    folder = tmp_path_factory.mktemp("probe")
    command = [sys.executable, "-c", PROBE]
    probe = subprocess.run(command, cwd=folder, capture_output=True, check=False)
    return probe.returncode == 0 and (folder / "probe.png").exists()


@pytest.fixture
def with_opengl(monkeypatch, opengl):
    if not opengl:
        pytest.skip("VTK cannot draw here: no OpenGL library")
    monkeypatch.delenv("ANMSTRIP_RENDERER", raising=False)


@pytest.fixture(params=["with_opengl", "without_opengl"])
def any_renderer(request):
    request.getfixturevalue(request.param)


def pixels(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"), dtype=float) / 255.0


def share_of(image, colour):
    """Share of the pixels of about a colour, the strip with the scale left out."""
    below = image[image.shape[0] // 5 :]
    return np.mean(np.abs(below - to_rgb(colour)).max(axis=-1) < 0.16)


def test_the_last_state_is_drawn_with_its_rollers(any_renderer, run, caplog):
    still, side = render(run)
    assert (still, side) == (run / "picture.png", run / "picture_side.png")
    assert not caplog.records
    for picture in (still, side):
        image = pixels(picture)
        assert image.shape == (800, 1400, 3)
        np.testing.assert_array_equal(image[[0, 0, -1, -1], [0, -1, 0, -1]], 1.0)
        assert share_of(image, GREY) > 0.02
        assert 0.0 < share_of(image, RED) < 0.2
        assert 0.4 < share_of(image, "white") < 0.95


def test_both_renderers_show_the_same_view(with_opengl, run, monkeypatch):
    first = pixels(render(run)[0]).min(axis=-1) < 0.97
    monkeypatch.setenv("ANMSTRIP_RENDERER", "matplotlib")
    second = pixels(render(run)[0]).min(axis=-1) < 0.97
    first, second = first[160:], second[160:]
    assert first.mean() > 0.15
    assert np.mean(first != second) < 0.01


def test_a_movie_has_all_states(any_renderer, run):
    *_, movie = render(run, "displacement", movie=True)
    assert movie == run / "movie.gif"
    with Image.open(movie) as image:
        assert image.n_frames == 3
        frames = [np.asarray(frame.convert("RGB"), dtype=int) for frame in Iterator(image)]
    assert all(np.mean(np.abs(after - before)) > 1.0 for before, after in pairwise(frames))


@pytest.mark.parametrize(
    "program",
    [
        "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
        "raise ImportError('libGL.so.1: cannot open shared object file')",
        "pass",
    ],
)
def test_where_vtk_crashes_one_line_says_what_helps(run, monkeypatch, caplog, program):
    monkeypatch.delenv("ANMSTRIP_RENDERER", raising=False)
    monkeypatch.setattr(pictures, "DRAW_COMMAND", (sys.executable, "-c", program))
    with caplog.at_level(logging.WARNING):
        still, _ = render(run)
    assert share_of(pixels(still), GREY) > 0.02
    (record,) = caplog.records
    assert "apt install libegl1 libgl1-mesa-dri" in record.getMessage()
    assert "\n" not in record.getMessage()
    assert any(word in record.getMessage() for word in ("SIGSEGV", "libGL.so.1", "no picture"))


def test_drawing_without_opengl_does_not_import_vtk(run):
    code = (
        "import sys; from anmstrip.pictures.render import render; render(sys.argv[1]);"
        "assert not {'vtk', 'vtkmodules', 'pyvista', 'meshio'} & set(sys.modules)"
    )
    environment = {"ANMSTRIP_RENDERER": "matplotlib"}
    subprocess.run([sys.executable, "-c", code, str(run)], env=environment, check=True)


def test_the_other_modules_import_neither_vtk_nor_matplotlib():
    code = (
        "import sys; from anmstrip.results import files, vtk;"
        "assert not {'vtk', 'vtkmodules', 'pyvista', 'matplotlib'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_component_can_be_drawn(without_opengl, run):
    image = pixels(render(run, "membrane_force.xy")[0])
    assert share_of(image, "#2a5d9f") > 0.001
    assert share_of(image, "#b0303a") > 0.001


def test_a_strip_without_rollers_and_of_plain_cells_is_drawn(any_renderer, tmp_path):
    s, y = lattice(10, 1, (-2.0, 2.0), (-0.5, 0.5))
    x, z = wrapped(s)
    cells = subdivide(tensor_grids(10, 1))
    write_surface(tmp_path / "strip_0.vtu", np.column_stack([x, y, z]), cells, {"gap": s * np.nan})
    Collection(tmp_path / "strip.pvd").add(0.0, "strip_0.vtu")
    for picture in render(tmp_path):
        assert 0.001 < np.mean(pixels(picture).min(axis=-1) < 0.9) < 0.5


def test_triangles_are_drawn_as_quadrilaterals_are(any_renderer, run):
    before = [pixels(picture) for picture in render(run)]
    write_state(run, 2, 1.0, triangles=True)
    assert read_surface(run / "strip_2.vtu").cells.shape == (80, 21)
    for first, second in zip(before, map(pixels, render(run)), strict=True):
        assert np.mean(first.min(axis=-1) < 0.9) > 0.1
        assert np.mean(np.abs(first - second).max(axis=-1) > 0.1) < 0.01
        left = np.s_[350:, :540]  # no seams between elements in the flat part
        assert np.mean(np.abs(first[left] - second[left]).max(axis=-1) > 0.1) < 2e-4


def test_a_flat_strip_is_drawn(without_opengl, tmp_path):
    s, y = lattice(4, 1, (-2.0, 2.0), (-0.5, 0.5))
    points = np.column_stack([s, y, 0.0 * s])
    write_surface(
        tmp_path / "strip_0.vtu", points, tensor_grids(4, 1), {"displacement": 0 * points}
    )
    Collection(tmp_path / "strip.pvd").add(0.0, "strip_0.vtu")
    for picture in render(tmp_path):
        assert np.mean(pixels(picture).min(axis=-1) < 0.9) > 0.001


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([0.0, 2.0, np.nan], (0.0, 2.0)),
        ([-0.01, 2.0], (0.0, 2.0)),
        ([-3.0, 2.0], (-3.0, 3.0)),
        ([-3.0, 0.0], (-3.0, 0.0)),
        ([9.0, 10.0], (9.0, 10.0)),
        ([10.0, 10.0], (9.9, 10.1)),
        ([0.0, 0.0], (0.0, 1.0)),
        ([np.nan], (0.0, 1.0)),
    ],
)
def test_the_scale_starts_at_zero_or_is_even_about_it(values, expected):
    assert pictures.scale_limits(np.array(values)) == pytest.approx(expected)


def test_the_eye_sees_the_whole_box_below_the_scale_and_fills_the_picture():
    low, high = np.array([-2.0, -0.6, -1.0]), np.array([2.0, 0.6, 0.0])
    eye = Eye.seeing(low, high, (1400, 800))
    np.testing.assert_allclose(eye.axes @ eye.axes.T, np.eye(3), atol=1e-14)
    corners = np.array([[x, y, z] for x in (-2.0, 2.0) for y in (-0.6, 0.6) for z in (-1.0, 0.0)])
    right, up, _ = eye.projected(corners).T / eye.half_height
    assert max(np.ptp(right) / 3.5, np.ptp(up) / (2.0 - 2.0 * HEAD_SHARE)) == pytest.approx(
        1.0 / 1.06
    )
    assert right.max() == pytest.approx(-right.min())
    assert -1.0 < up.min() < up.max() < 1.0 - 2.0 * HEAD_SHARE


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ((0.0, 47.5), (0.0, 50.0, 6)),
        ((0.0, 50.0), (0.0, 50.0, 6)),
        ((-3.0, 3.0), (-3.0, 3.0, 7)),
        ((9.9, 10.1), (9.9, 10.1, 5)),
        ((0.0, 1.18e-3), (0.0, 1.2e-3, 7)),
        ((-713.0, 0.0), (-800.0, 0.0, 5)),
    ],
)
def test_scales_have_round_labels(limits, expected):
    assert widen_scale(*limits) == pytest.approx(expected)


def test_the_side_view_is_drawn_with_lines_too(run, without_opengl):
    (*_, aside) = render(run, vector="svg")
    text = aside.read_text(encoding="utf-8")
    assert aside.name == "picture_side.svg"
    assert text.count("<path") > 50
    assert not list(run.glob("*.pdf"))


@pytest.mark.parametrize("field", ["normal_presure", "gap", "displacement.w", "von_mises.x"])
def test_an_unknown_field_is_refused_with_those_that_exist(run, field):
    with pytest.raises(InputError) as caught:
        render(run, field)
    for name in ("displacement", "normal_pressure", "von_mises", "membrane_force"):
        assert name in str(caught.value)
    assert not list(run.glob("*.png"))


def test_a_field_written_nearly_right_is_recognised(run):
    with pytest.raises(InputError, match="--field normal_pressure"):
        render(run, "normal_presure")


def test_the_field_chosen_shows_something(without_opengl, run):
    state = read_surface(run / "strip_2.vtu")
    assert pictures.choose_field(state, None) == "normal_pressure"
    state.fields["normal_pressure"][:] = 0.0
    assert pictures.choose_field(state, None) == "von_mises"
    del state.fields["von_mises"]
    assert pictures.choose_field(state, None) == "displacement"


def lose_everything(run):
    shutil.rmtree(run)


def spoil_contents(run):
    (run / "strip.pvd").write_text("<")


def spoil_list(run):
    (run / "strip.pvd").write_text("<VTKFile/>")


def lose_state(run):
    (run / "strip_2.vtu").unlink()


def spoil_state(run):
    (run / "strip_2.vtu").write_text("<VTKFile>")


@pytest.mark.parametrize(
    "spoil", [lose_everything, spoil_contents, spoil_list, lose_state, spoil_state]
)
def test_results_that_are_not_there_are_an_input_error(run, spoil):
    spoil(run)
    with pytest.raises(InputError, match=r"strip[_2]*\.(pvd|vtu)"):
        render(run)


@pytest.mark.parametrize("name", FIELDS)
def test_titles_have_letters_that_vtk_can_draw(name):
    """Its font leaves out what it lacks, as the minus of a raised -3, which was read as 3."""
    for largest in 10.0 ** np.arange(-9.0, 12.0):
        title(name, largest)[0].encode("latin-1")
