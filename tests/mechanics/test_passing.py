"""Rollers that points cross between the ends of a way."""

import numpy as np  # noqa: I001
import pytest

from anmstrip.fem.sampling import ContactOperator
from anmstrip.fem.strip import Material, Strip, grid
from anmstrip.mechanics.contact import Contact, MAX_CHECKS, Neighbours, deepest_place
from anmstrip.mechanics.laws import GradedSignorini
from anmstrip.mechanics.roller import Roller, combine
from anmstrip.taylor.program import COMPILED

LAW = GradedSignorini(pressure=2e4, width=1e-4)
RADIUS = 0.25


@pytest.fixture(scope="module")
def operator():
    xs, ys = np.linspace(-0.1, 0.1, 3), np.array([-0.1, 0.1])
    return ContactOperator(Strip(grid(xs, ys), 1e-3, Material(2e9, 0.3, 1000.0)))


def contact_of(operator, *rollers):
    count = operator.points
    points = np.tile(np.arange(count), len(rollers))
    return Contact(
        combine(rollers, np.repeat(np.arange(len(rollers)), count)),
        LAW,
        operator.restricted(points),
    )


def way(contact, start, end, sag=0.0):
    """The whole strip moved from one height to another, straight but for a sag in the middle."""
    names = [roller.name for roller in contact.roller.members]
    here = {f"rollers.{name}.centre": np.zeros(3) for name in names}

    def places(shares):
        moved = [start + s * (end - start) - 4.0 * s * (1.0 - s) * sag for s in shares]
        shift = [np.array([0.0, 0.0, z])[:, None] * np.ones(contact.operator.points) for z in moved]
        return np.array([contact.position(x, here) for x in shift])

    return places


def test_what_ends_on_the_other_side_has_crossed(operator):
    contact = contact_of(operator, Roller("r", RADIUS, (0.0, 0.0, 0.0)))
    assert deepest_place(contact, way(contact, 0.3, -0.5)) == pytest.approx(0.3 / 0.8, abs=1e-12)


def test_what_comes_to_rest_on_it_has_not(operator):
    contact = contact_of(operator, Roller("r", RADIUS, (0.0, 0.0, 0.0)))
    assert deepest_place(contact, way(contact, 0.3, RADIUS)) is None
    assert deepest_place(contact, way(contact, RADIUS, 0.3)) is None


@pytest.mark.parametrize(("sag", "found"), [(0.5e-4, False), (2e-4, True)])
def test_a_dip_counts_from_the_width_of_the_onset_on(operator, sag, found):
    contact = contact_of(operator, Roller("r", RADIUS, (0.0, 0.0, 0.0)))
    share = deepest_place(contact, way(contact, RADIUS, RADIUS, sag))
    assert share == (0.5 if found else None)


def test_a_small_roller_on_a_long_way_is_seen(operator):
    small = Roller("r", 0.01, (0.0, 0.0, 0.0))
    contact = contact_of(operator, small)
    share = deepest_place(contact, way(contact, 0.7, -1.9))
    assert share == pytest.approx(0.7 / 2.6, abs=1.0 / MAX_CHECKS)


def test_every_roller_is_looked_at(operator):
    rollers = [Roller("a", 0.2, (0.0, 0.0, 9.0)), Roller("b", 0.2, (0.0, 0.0, 0.0))]
    contact = contact_of(operator, *rollers)

    def places(shares):
        here = {"rollers.a.centre": np.array([0.0, 0.0, 9.0]), "rollers.b.centre": np.zeros(3)}
        shift = [np.array([0.0, 0.0, 0.3 - s])[:, None] + np.zeros(operator.points) for s in shares]
        return np.array([contact.position(np.tile(x, 2), here) for x in shift])

    assert deepest_place(contact, places) == pytest.approx(0.3, abs=1e-12)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("points", [0, 1, 3, 20])
@pytest.mark.parametrize("crown", [(), (0.0, -0.8)])
def test_points_are_seen_alike_with_and_without_machine_code(
    operator, crown, points, compiled, monkeypatch
):
    """Two rollers that move: positions in their frames, and gaps below."""
    monkeypatch.setattr("anmstrip.mechanics.effects.COMPILED", COMPILED and compiled)
    centres = np.array([[-0.1, 0.0, -0.2], [0.1, 0.0, 0.3]])
    rollers = [Roller(f"r{k}", 0.2, tuple(c), crown=crown) for k, c in enumerate(centres)]
    pairs = np.arange(points)
    part = contact_of(operator, *rollers).restricted(pairs)
    rng = np.random.default_rng(3)
    near = Neighbours(part, pairs, np.inf, np.zeros(operator.unknowns), centres)
    for _ in range(3):
        moved = centres + rng.normal(0.0, 0.1, centres.shape)
        controls = {f"rollers.r{k}.centre": c for k, c in enumerate(moved)}
        look = rng.normal(0.0, 1e-2, operator.unknowns), moved
        expected = part.position(part.operator.apply(look[0]), controls)
        seen = [*expected, part.roller.project(expected).gap]
        np.testing.assert_allclose(near.seen(look, controls), seen, rtol=0.0, atol=1e-14)
    compilable = points != 3  # as many as a centre has components
    assert (near.programs[0].compiled is not None) == (COMPILED and compiled and compilable)


@pytest.mark.parametrize("crown", [(), (0.0, -0.8)])
def test_near_points_are_those_of_all_pairs_wherever_the_strip_goes(operator, crown, monkeypatch):
    """Along a random way, points and rollers moving; all pairs are looked at now and then only."""
    monkeypatch.setattr("anmstrip.mechanics.contact.ALWAYS_CHECKED", 0)
    rng = np.random.default_rng(2)
    centres = [np.array([x, 0.0, z]) for x in (-0.3, 0.0, 0.4) for z in (-0.4, 0.5)]
    rollers = [Roller(f"r{k}", 0.05, tuple(c), crown=crown) for k, c in enumerate(centres)]
    contact = contact_of(operator, *rollers)
    contact = Contact(contact.roller, LAW, contact.operator, 0.05)
    full, moves, looks = np.zeros((operator.matrix.shape[1], 3)), np.zeros((6, 3)), 0
    values = np.flatnonzero(operator.matrix.sum(axis=0).A1 > 0.0)
    found = latest = None
    for _ in range(300):
        full[values] += rng.normal(0.0, 2e-3, 3)
        moves += rng.normal(0.0, 5e-4, (6, 3))
        controls = {f"rollers.r{k}.centre": c + moves[k] for k, c in enumerate(centres)}
        found = contact.within_reach(full.ravel(), controls)
        gap = contact.seen(contact.operator.apply(full.ravel()), controls).gap
        np.testing.assert_array_equal(found, np.flatnonzero(gap < 0.05))
        looks += contact.latest["neighbours"] is not latest
        latest = contact.latest["neighbours"]
    assert 1 < looks < 100
    assert len(latest.pairs) < contact.operator.points


@pytest.mark.parametrize("few", [0, 1000])
def test_a_step_that_leaves_the_neighbours_is_looked_at_whole(operator, few, monkeypatch):
    """A long way past a far roller, and back to where it began."""
    monkeypatch.setattr("anmstrip.mechanics.contact.ALWAYS_CHECKED", few)
    rollers = [Roller("a", 0.2, (0.0, 0.0, -3.0)), Roller("b", 0.2, (0.0, 0.0, -0.8))]
    contact = contact_of(operator, *rollers)
    contact = Contact(contact.roller, LAW, contact.operator, 0.1)
    controls = {f"rollers.{r.name}.centre": np.array(r.centre) for r in rollers}
    value = operator.matrix.T @ np.ones(operator.points) != 0.0

    def states(shares):
        for s in shares:
            full = np.zeros((operator.matrix.shape[1], 3))
            full[value, 2] = -16.0 * s * (1.0 - s)
            yield full.ravel(), None, controls

    assert contact.crossing(states) is not None
    quiet = Contact(contact.roller, LAW, contact.operator, 0.1)
    assert quiet.crossing(lambda shares: ((u * 0.01, v, c) for u, v, c in states(shares))) is None
