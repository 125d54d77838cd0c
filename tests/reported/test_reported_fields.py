"""Fields of the written states, against geometry and mechanics of the written points."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista
import reported_scenes as scenes
from reported_files import Results, Surface, ran
from reported_rollers import Look
from reported_states import looks_at

ROUNDOFF = 1e-7
"""Of second derivatives of positions of some metres within elements of some centimetres."""

E, NU = 2.0e11, 0.3
RUNS = ("turning", "shell", "fed", "pressed")


def thickness_and_poisson(name: str) -> tuple[float, float]:
    return 1e-3, 0.0 if name == "pressed" else NU


def close(found: np.ndarray, expected: np.ndarray, share: float = ROUNDOFF) -> None:
    """Compare fields; tolerances are shares of the largest value."""
    assert found.shape == expected.shape
    assert np.abs(expected).max() > 0.0
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=share * np.abs(expected).max())


@pytest.fixture(params=RUNS)
def state(request: pytest.FixtureRequest) -> tuple[str, Surface]:
    """The last state of a run, with the name of the run."""
    results: Results = request.getfixturevalue(request.param)
    return request.param, results.last


def test_points_are_the_flat_strip_and_its_displacement(turning: Results, shell: Results) -> None:
    """What is left of the positions without displacement is the rectangle of the scene."""
    for surface, length, width in ((turning.last, 4.0, 0.8), (shell.last, None, 0.6)):
        flat = surface.reference
        assert np.abs(flat[..., 2]).max() < 1e-12
        assert np.ptp(flat[..., 1]) == pytest.approx(width, rel=1e-12)
        if length is not None:
            assert (flat[..., 0].min(), flat[..., 0].max()) == pytest.approx((-2.0, 2.0))
        hx, hy = surface.sizes
        assert (hx * hy).sum() == pytest.approx(surface.length * width, rel=1e-12)
        grid = np.stack(np.meshgrid(np.arange(4) / 3.0, np.arange(4) / 3.0), axis=-1)
        inside = flat - flat[:, :1, :1]
        place = inside[..., :2] / np.stack([hx, hy], axis=-1)[:, None, None]
        np.testing.assert_allclose(place, np.broadcast_to(grid, place.shape), atol=1e-9)


def test_membrane_forces_are_recovered_from_those_of_the_strains(
    state: tuple[str, Surface],
) -> None:
    """Recovered from N = E t/(1 − ν²) [(1 − ν) E + ν tr E 1] of Green's strains; E t E_xx else.

    The mean of N_xx over the width is that in equilibrium, see the profiles.
    The natural shape of the imperfect strip is half a wave, to 1e-3 of its share of 10 N/m.  The
    quadratic part across of squares of cubics is of degree 8, one more than the four points of
    Gauss of a run sum up without an error.
    """
    name, surface = state
    expected = surface.recovered(forces_of(name, surface))
    found = surface.fields["membrane_force"]
    bound = {"pressed": 2e-4, "shell": 1e-4}.get(name, 1e-6) * np.abs(expected).max()
    np.testing.assert_allclose(found[:, 1:], expected[:, 1:], rtol=0.0, atol=bound)
    uneven = (beside_the_mean(surface, values[:, 0]) for values in (found, expected))
    np.testing.assert_allclose(*uneven, rtol=0.0, atol=bound)


def beside_the_mean(surface: Surface, values: np.ndarray) -> np.ndarray:
    """What values, (points,), differ by from their means over the width, on all patches."""
    weights = surface.sizes[1][:, None, None] * np.array([[1.0], [3.0], [3.0], [1.0]]) / 8.0
    own = values[surface.cells]
    x = np.round(surface.reference[..., 0], 8)
    station = np.unique(x, return_inverse=True)[1].ravel()
    weights = np.broadcast_to(weights, own.shape).ravel()
    means = np.bincount(station, weights * own.ravel()) / np.bincount(station, weights)
    return np.asarray(own - means[station].reshape(own.shape))


def forces_of(name: str, surface: Surface) -> np.ndarray:
    """Membrane forces (xx, yy, xy) of the strains at the points of Gauss."""
    t, nu = thickness_and_poisson(name)
    xx, yy, xy = np.moveaxis(stretched(name, surface), -1, 0)
    c = E * t / (1.0 - nu**2)
    forces = [c * (xx + nu * yy), c * (yy + nu * xx), c * (1.0 - nu) * xy]
    if name in ("turning", "fed"):
        forces = [E * t * xx, 0.0 * xx, 0.0 * xx]
    return np.stack(forces, axis=-1)


def stretched(name: str, surface: Surface) -> np.ndarray:
    """Strain from the natural shape: that of the imperfection, half a wave of its amplitude."""
    if name != "pressed":
        return surface.strain
    x = surface.at_gauss(surface.reference[..., 0])
    slope = 1e-4 * np.pi * np.sin(np.pi * x)
    natural = np.zeros_like(surface.strain)
    natural[..., 0] = 0.5 * slope**2
    return np.asarray(surface.strain - natural)


def test_tension_is_the_force_along_the_strip(state: tuple[str, Surface]) -> None:
    """The recovered N_xx times the stretch √(1 + 2 E_xx), and M κ over it."""
    name, surface = state
    stretch = np.linalg.norm(surface.tangents[0], axis=-1)
    found = surface.patch("membrane_force")[..., 0] * stretch
    if name != "plate":
        work = moments_of(name, surface) * surface.curvature
        found += (work[..., 0] + work[..., 2]) / stretch
    close(
        surface.fields["tension"], surface.averaged(found), 1e-4 if name == "pressed" else ROUNDOFF
    )


def test_arc_length_begins_at_the_entry(state: tuple[str, Surface]) -> None:
    x = state[1].reference[..., 0]
    np.testing.assert_allclose(state[1].patch("arc_length"), x - x.min(), atol=1e-12)


def test_normals_point_to_the_upper_side_as_cells_do(state: tuple[str, Surface]) -> None:
    """The mean of the patches' normals; every cell of the file is counter-clockwise from there."""
    surface = state[1]
    n = np.cross(*surface.tangents)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    np.testing.assert_allclose(surface.fields["normal"], surface.averaged(n), atol=1e-7)
    corners = surface.drawn[:, :4]
    flat = (surface.points - surface.fields["displacement"])[corners]
    diagonals = flat[:, 2] - flat[:, 0], flat[:, 3] - flat[:, 1]
    assert np.cross(*diagonals)[:, 2].min() > 0.0


@pytest.mark.parametrize("name", ["turning", "shell", "plate"])
def test_status_tells_what_touches_and_slips(name: str, request: pytest.FixtureRequest) -> None:
    """At the nodes: 0 free, 1 in contact, 2 with friction of 95 per cent of the cone or more."""
    results: Results = request.getfixturevalue(name)
    surface = results.last
    expected = np.zeros((len(surface.cells), 3, 3))
    for look in looks_at(results, surface).values():
        size = np.linalg.norm(look.traction, axis=-1)
        slips = (look.shape.friction > 0.0) & (size >= 0.95 * look.shape.friction * look.pressure)
        expected = np.maximum(expected, look.touching * np.where(slips, 2.0, 1.0))
    found = surface.patch("contact_status")
    np.testing.assert_array_equal(found[:, ::3, ::3], expected[:, ::2, ::2])
    assert {0.0} < set(found.ravel()) <= {0.0, 1.0, 2.0}


def test_fields_have_units_and_names_of_components(turning: Results) -> None:
    """As VTK reads them; the normals are what shades a surface."""
    vtk = pytest.importorskip("vtkmodules.vtkCommonCore", exc_type=ImportError)
    xml = pytest.importorskip("vtkmodules.vtkIOXML", exc_type=ImportError)
    units = {
        "displacement": "m", "velocity": "m/s", "normal": "1", "arc_length": "m",
        "tension": "N/m", "normal_pressure": "Pa", "friction_traction": "Pa",
        "slip_velocity": "m/s", "gap": "m", "contact_status": "1", "membrane_force": "N/m",
        "bending_moment": "N", "von_mises": "Pa", "mean_curvature": "1/m",
    }  # fmt: skip
    reader = xml.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(turning.states[-1][1]))
    reader.Update()
    data = reader.GetOutput().GetPointData()
    arrays = [data.GetArray(k) for k in range(data.GetNumberOfArrays())]
    key = vtk.vtkDataArray.UNITS_LABEL()
    assert {a.GetName(): a.GetInformation().Get(key) for a in arrays} == units
    tensors, vectors = ("membrane_force", "bending_moment"), ("velocity", "friction_traction")
    for names, components in ((tensors, ["xx", "yy", "xy"]), (vectors, ["x", "y", "z"])):
        for name in names:
            array = data.GetArray(name)
            assert [array.GetComponentName(k) for k in range(3)] == components
    assert data.GetNormals().GetName() == "normal"


def moments_of(name: str, surface: Surface) -> np.ndarray:
    """M = D [(1 − ν) κ + ν tr κ 1] on the patches; a section cannot bend across."""
    t, nu = thickness_and_poisson(name)
    bent = surface.curvature.copy()
    if name == "pressed":
        bent[..., 0] -= natural_curvature(surface)
    xx, yy, xy = np.moveaxis(bent, -1, 0)
    d = E * t**3 / 12.0 / (1.0 - nu**2)
    return np.stack([d * (xx + nu * yy), d * (yy + nu * xx), d * (1.0 - nu) * xy], axis=-1)


def natural_curvature(surface: Surface) -> np.ndarray:
    """Curvature of half a wave, upwards as the strip lies."""
    x = surface.reference[..., 0]
    sense = np.sign(surface.positions[..., 2].sum())
    return np.asarray(sense * 1e-4 * np.pi**2 * np.cos(np.pi * x))


def test_moments_are_those_of_the_curvatures(state: tuple[str, Surface]) -> None:
    """The shape of the imperfection is a wave to 2 per cent on eight elements; else round-off."""
    name, surface = state
    share = 0.03 if name == "pressed" else ROUNDOFF
    close(surface.fields["bending_moment"], surface.averaged(moments_of(name, surface)), share)


def test_mean_curvature_is_half_the_trace(state: tuple[str, Surface]) -> None:
    surface = state[1]
    trace = surface.curvature[..., 0] + surface.curvature[..., 1]
    close(surface.fields["mean_curvature"], surface.averaged(0.5 * trace))


def test_von_mises_is_that_of_the_upper_side(state: tuple[str, Surface]) -> None:
    """√(s₁² − s₁ s₂ + s₂²) of the principal stresses N/t + 6 M/t², inside the patches."""
    name, surface = state
    t, _ = thickness_and_poisson(name)
    stress = surface.patch("membrane_force") / t + 6.0 * surface.patch("bending_moment") / t**2
    xx, yy, xy = np.moveaxis(stress, -1, 0)
    middle, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    one, two = middle + radius, middle - radius
    expected = np.sqrt(one**2 - one * two + two**2)
    inside = (slice(None), slice(1, 3), slice(1, 3))
    if name in ("turning", "fed"):
        inside = (slice(None), slice(None), slice(1, 3))
    close(surface.patch("von_mises")[inside], expected[inside], 1e-12)


def test_a_strip_on_a_roller_has_its_curvature(turning: Results) -> None:
    """In the middle of the arc 1/r across nothing, so 1/(2 r); bent with the upper side outside.

    The elements are longer than the boundary layer, so that the curvature oscillates about it.
    """
    surface = turning.last
    look = looks_at(turning, surface)["r1"]
    places = surface.at_contact(surface.reference)[..., 0][look.touching]
    x = surface.reference[..., 0]
    over = (x > places.min()) & (x < places.max())
    mean = surface.patch("mean_curvature")[over].mean()
    assert mean == pytest.approx(0.5 / 0.5, rel=0.05)
    moment = surface.patch("bending_moment")[over].mean(axis=0)
    d = E * 1e-9 / 12.0 / (1.0 - NU**2)
    assert moment[0] == pytest.approx(2.0 * d, rel=0.05)
    assert moment[1] == pytest.approx(NU * moment[0], rel=1e-9)


def test_an_imperfect_strip_bends_as_a_pressed_column(pressed: Results) -> None:
    """Height a / (1 − N/N_c) with N_c = D π²/L² and ν = 0."""
    euler = np.pi**2 * E * 1e-9 / 12.0
    z = pressed.last.positions[..., 2]
    assert np.abs(z).max() == pytest.approx(1e-4 / (1.0 - 100.0 / euler), rel=0.02)
    middle = np.abs(pressed.last.reference[..., 0]) < 0.2
    forces = pressed.last.patch("membrane_force")[middle]
    assert forces[:, 0].mean() == pytest.approx(-100.0, rel=1e-3)


def test_velocity_is_the_derivative_of_the_positions(turning: Results) -> None:
    """Backward differences of the second order over the last three states, to their own error."""
    one, two, three = turning.surfaces[-3:]
    places = np.array([s.time for s in (one, two, three)]) - three.time
    u = np.stack([s.fields["displacement"] for s in (one, two, three)])
    weights = np.polynomial.polynomial.polyfit(places, np.eye(3), 2)[1]
    expected = np.einsum("k,k...->...", weights, u)
    close(three.fields["velocity"], expected, 0.02)
    still = next(s for s in turning.surfaces if s.time == 2.0)
    assert not still.fields["velocity"].any()


def test_velocity_inside_a_step_is_that_of_its_formula(tmp_path: Path) -> None:
    """Central differences of positions at instants around it, to the error of the formula."""
    h = 1e-5
    times = [2.7 - h, 2.7, 2.7 + h]
    settings = (f"output.times={times}", "output.events=false")
    one, two, three = ran(scenes.TURNING, tmp_path, *settings, options=("--quiet",)).surfaces
    moved = (three.fields["displacement"] - one.fields["displacement"]) / (2.0 * h)
    close(two.fields["velocity"], moved, 1e-3)


def contact_fields(results: Results) -> list[tuple[Surface, list[Look]]]:
    """Some of the states with their rollers."""
    chosen = [*results.surfaces[:: max(1, len(results.surfaces) // 6)], results.last]
    return [(s, list(looks_at(results, s).values())) for s in chosen]


@pytest.mark.parametrize("name", ["turning", "shell", "plate", "lifted"])
def test_contact_fields_are_those_of_the_positions(
    name: str, request: pytest.FixtureRequest
) -> None:
    """Gaps by geometry, pressures and tractions by the laws; sums over the rollers.

    A gap is the difference of metres: its last digit is worth 1e-16 m over an onset of 1e-4 m.
    """
    results: Results = request.getfixturevalue(name)
    for surface, looks in contact_fields(results):
        gap = np.min([look.gap for look in looks], axis=0)
        which = np.argmin([look.gap for look in looks], axis=0)
        nearest = np.stack([look.slip for look in looks])
        slip = np.take_along_axis(nearest, which[None, ..., None], axis=0)[0]
        pressure = np.sum([look.pressure for look in looks], axis=0)
        np.testing.assert_allclose(surface.known_at_contact("gap"), gap, atol=1e-11)
        found = surface.known_at_contact("normal_pressure")
        np.testing.assert_allclose(found, pressure, rtol=1e-7, atol=1e-7 * pressure.max() + 1e-12)
        np.testing.assert_allclose(surface.known_at_contact("slip_velocity"), slip, atol=1e-9)
        traction = np.sum([look.traction for look in looks], axis=0)
        found = surface.known_at_contact("friction_traction")
        np.testing.assert_allclose(found, traction, atol=1e-6 * max(pressure.max(), 1.0))


def test_between_contact_points_gaps_are_linear(turning: Results) -> None:
    """A third of the way from a corner: two thirds of the way to the middle."""
    values, at = turning.last.patch("gap"), turning.last.known_at_contact("gap")
    near_first = at[:, 0, 0] / 3.0 + 2.0 * at[:, 0, 1] / 3.0
    near_last = at[:, 0, 2] / 3.0 + 2.0 * at[:, 0, 1] / 3.0
    close(values[:, 0, 1], near_first, 1e-12)
    close(values[:, 0, 2], near_last, 1e-12)


@pytest.mark.parametrize("name", ["turning", "shell", "plate"])
def test_pressures_of_a_file_add_up_to_the_force(name: str, request: pytest.FixtureRequest) -> None:
    """As ParaView integrates them over the deformed strip; also where contact is short."""
    results: Results = request.getfixturevalue(name)
    whole = pyvista.read(results.states[-1][1]).integrate_data()
    force = sum(roller["normal_force"] for roller in results.summary["rollers"].values())
    assert force > 1.0
    assert float(whole["normal_pressure"][0]) == pytest.approx(force, rel=1e-3)


def test_a_plate_has_the_tension_of_its_load(plate: Results) -> None:
    """10 kN/m at the end of the stage and half of it in its middle; moments of small slopes."""
    forces = plate.last.fields["membrane_force"]
    np.testing.assert_allclose(forces[:, 0], 1.0e4, rtol=1e-12)
    assert not forces[:, 1:].any()
    d = E * 1e-9 / 12.0 / (1.0 - NU**2)
    z = plate.last.positions[..., 2]
    xx, yy, xy = (plate.last.derivative(z, *k) for k in ((2, 0), (0, 2), (1, 1)))
    moments = -d * np.stack([xx + NU * yy, yy + NU * xx, (1.0 - NU) * xy], axis=-1)
    # the normal of the deformed plate leans by the slope, of 0.6 degrees: 1 − cos = 6e-5
    close(plate.last.fields["bending_moment"], plate.last.averaged(moments), 1e-3)


def test_times_that_were_asked_for_lie_on_the_way(lifted: Results) -> None:
    """Half way up the roller stands at half its lift; the pull of a slack strip is linear.

    Displacements are, so that the tension is linear but for products of strains, of 5e-5.
    """
    wanted = [0.25, 1.1, 1.2, 1.5, 2.0, 2.75]
    assert [time for time, _ in lifted.states] == wanted
    pulled, free = lifted.surfaces[0], lifted.surfaces[1]
    strain = 0.25 * 1.0e4 / (E * 1e-3)
    assert pulled.fields["membrane_force"][:, 0] == pytest.approx(2500.0, rel=1e-4)
    assert np.ptp(pulled.points[:, 0]) - 2.0 == pytest.approx(2.0 * strain, rel=1e-4)
    assert np.abs(free.points[:, 2]).max() < 2e-4
    for surface, lift in zip(lifted.surfaces[3:], (0.05, 0.1, 0.025), strict=True):
        top = surface.points[:, 2].max()
        assert top == pytest.approx(lift - 0.02, abs=3e-3)


def test_plain_surfaces_have_the_same_area(tmp_path: Path) -> None:
    """``output.smooth = false``: nine plain squares for each patch."""
    settings = ("output.smooth=false", "output.every=1000")
    results = ran(scenes.PLATE, tmp_path, *settings, options=("--quiet",))
    mesh = meshio.vtu.read(results.states[-1][1])
    (block,) = mesh.cells
    assert block.type == "quad"
    corners = mesh.points[block.data] - mesh.point_data["displacement"][block.data]
    diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    areas = 0.5 * np.cross(*diagonals)[:, 2]
    assert np.ptp(np.sign(areas)) == 0.0
    assert np.abs(areas).sum() == pytest.approx(2.0 * 0.4, rel=1e-12)
    assert len(block.data) % 9 == 0
