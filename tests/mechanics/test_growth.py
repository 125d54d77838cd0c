"""Labels that hold more strip, or less, than in the reference."""

import numpy as np
import pytest

from anmstrip.fem.operators import Pattern
from anmstrip.fem.sampling import quadrature_points
from anmstrip.fem.strip import Strip, grid, line
from anmstrip.mechanics.effects import Controls, RecordedLaws, add_force
from anmstrip.mechanics.loads import GrownWeight, weight
from anmstrip.mechanics.shell import KirchhoffLove, Membrane
from anmstrip.mechanics.transport import transport_velocity
from anmstrip.results.wrinkles import compressive_stiffness
from levels import (
    XS,
    YS,
    free_equations,
    interpolated_orders,
    random_unknowns,
    residual_orders,
    strip_of,
)

TIMES = 2.5
"""Unstressed strip at a label, over the reference."""

EFFECTS = {"membrane": Membrane, "bending": KirchhoffLove, "weight": GrownWeight}
GRAVITY = np.array([1.0, 0.5, -9.81])


def longer(strip: Strip) -> Strip:
    """The strip itself, in the unstressed length that its labels hold."""
    level, ys = strip.kinematics, YS
    mesh = line(TIMES * XS) if level.directions == 1 else grid(TIMES * XS, ys)
    return Strip(mesh, strip.thickness, strip.material, level, strip.width)


def by_labels(strip: Strip, full: np.ndarray, *, whole: bool) -> np.ndarray:
    """Unknowns by labels of a displacement by unstressed length, or of its change.

    r(X) = X + u_X(X) = S + u_S(S) with S = g X.
    """
    own, names = strip.nodal(full).copy(), [n for n in strip.basis.elem.dofnames if "x" in n]
    for name in names:
        own[strip.dofs(name)] *= TIMES
    if whole:
        own[strip.node_values, 0] += (TIMES - 1.0) * strip.nodes[0]
        own[strip.dofs("u_x"), 0] += TIMES - 1.0
    return own.ravel()


@pytest.mark.parametrize("level", ["section", "shell"])
@pytest.mark.parametrize("name", EFFECTS)
def test_labels_that_hold_more_strip_feel_what_it_feels(level, name):
    """The virtual work of any change is that of the strip itself."""
    strip = strip_of(level)
    material = longer(strip)
    points = len(quadrature_points(strip)[0])
    growth = {"strip.growth": np.full(points, TIMES), "gravity": GRAVITY}
    full, change = (5e-3 * random_unknowns(material, seed) for seed in (3, 4))
    effect = EFFECTS[name](strip)
    own = weight(material) if name == "weight" else EFFECTS[name](material)
    forces = []
    for each, at, values in (
        (effect, by_labels(strip, full, whole=True), growth),
        (own, full, {"gravity": GRAVITY}),
    ):
        laws = RecordedLaws(len(full))
        total = laws.begin(at, None)
        add_force(each, (at, None, 0.0), values, Controls(values), laws)
        forces.append(total)
    work = forces[0] @ by_labels(strip, change, whole=False)
    assert work == pytest.approx(forces[1] @ change, rel=1e-9)
    assert abs(work) > 1e-6 * np.linalg.norm(forces[1]) * np.linalg.norm(change)


def test_compression_of_labels_that_hold_more_is_that_of_the_strip():
    strip = strip_of("shell")
    material = longer(strip)
    growth = np.full(len(quadrature_points(strip)[0]), TIMES)
    full, change = (5e-3 * random_unknowns(material, seed) for seed in (14, 15))
    found = []
    for each, at, moved, held in (
        (
            strip,
            *(by_labels(strip, u, whole=w) for u, w in ((full, True), (change, False))),
            growth,
        ),
        (material, full, change, 1.0),
    ):
        membrane, pattern = Membrane(each), Pattern(each)
        controls = {"strip.growth": held} if np.ndim(held) else {}
        blocks = compressive_stiffness(membrane, membrane.at(at, controls), pattern, growth=held)
        matrix = pattern.restricted(np.arange(each.unknowns)).matrix(blocks)
        found.append(moved @ (matrix @ moved))
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert found[1] > 0.0


@pytest.mark.parametrize("level", ["section", "shell"])
@pytest.mark.parametrize("name", EFFECTS)
def test_orders_while_labels_come_to_hold_more(level, name):
    strip = strip_of(level)
    x = quadrature_points(strip)[0]
    start = {"strip.growth": 1.0 + 0.3 * np.cos(3.0 * x), "gravity": GRAVITY}
    controls = Controls(start, {"strip.growth": 0.4 + 0.2 * x})
    equations = free_equations(strip, [EFFECTS[name](strip)], controls)
    u, direction = (5e-3 * random_unknowns(strip, seed) for seed in (5, 6))
    weights = random_unknowns(strip, 7)
    found = residual_orders(equations, u, direction, 0.1, 6) @ weights
    expected = interpolated_orders(equations, u, direction, 0.1, 6, weights, 0.1)
    scale = 0.1 ** np.arange(6)  # within the radius of the interpolant
    tolerance = 1e-7 * np.abs(scale * expected).max()
    assert scale * found == pytest.approx(scale * expected, rel=1e-6, abs=tolerance)


@pytest.mark.parametrize("level", ["section", "shell"])
def test_change_of_membrane_forces_where_labels_hold_more(level):
    strip = strip_of(level)
    growth = {"strip.growth": 1.0 + 0.3 * np.cos(3.0 * quadrature_points(strip)[0])}
    membrane, step = Membrane(strip), 1e-6
    full, change = (5e-3 * random_unknowns(strip, seed) for seed in (8, 9))
    ends = [membrane.at(full + sign * step * change, growth) for sign in (1.0, -1.0)]
    expected = (ends[0] - ends[1]) / (2.0 * step)
    found = membrane.change(full, change, growth)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8 * np.abs(expected).max())


def test_material_passes_labels_that_hold_more_of_it_more_slowly():
    """v = (c − ∂S/∂t)/g ∂r/∂X of a straight strip in which g is linear."""
    strip = strip_of("section")
    x = quadrature_points(strip)[0]
    speed = (1.0 - 0.2 * x) / (1.0 + 0.5 * x)
    found = transport_velocity(strip, Pattern(strip), np.zeros(strip.unknowns), speed)
    at_nodes = strip.nodal(found)[strip.node_values, 0]
    expected = (1.0 - 0.2 * strip.nodes[0]) / (1.0 + 0.5 * strip.nodes[0])
    assert at_nodes == pytest.approx(expected, abs=2e-4)
