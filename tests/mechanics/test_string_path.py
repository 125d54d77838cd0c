"""Taut paths round circles against closed forms and the conditions that define them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anmstrip.mechanics.string_path import (
    FixedEnd,
    NoTangentError,
    NotTouchedError,
    StraightEnd,
    StringPath,
    frame,
    string_path,
)

OVER, UNDER = 1, -1


def single(centres, radii, senses, entry, exit):
    """Path of one fibre."""
    circles = len(centres)
    c = np.asarray(centres, dtype=float).reshape(circles, 2, 1)
    return string_path(c, np.asarray(radii, dtype=float).reshape(circles, 1), senses, entry, exit)


def headings(path):
    """Exact t just after every joint and at the start, in degrees within ±180."""
    u = np.stack([np.cos(path.angles), np.sin(path.angles)])
    return np.degrees(np.arctan2(u[1], u[0]))


SCENES = {
    "straight": ([], [], [], FixedEnd((0.0, 1.0)), FixedEnd((3.0, 2.0))),
    "hill": ([(0, 0)], [1.0], [OVER], FixedEnd((-3, 0)), FixedEnd((3, 0))),
    "flat": (
        [(0, -1), (2, -0.5), (4, -2)],
        [1.0, 0.5, 2.0],
        [OVER] * 3,
        StraightEnd(1),
        StraightEnd(1),
    ),
    "bridle": ([(0, 0), (-2.4, -0.6)], [1, 1], [OVER, UNDER], StraightEnd(2), StraightEnd(5)),
    "tower": (
        [(0, 1), (2, 8), (4, 1), (6, 8), (8, 1)],
        [1.0] * 5,
        [UNDER, OVER, UNDER, OVER, UNDER],
        StraightEnd(3.0),
        StraightEnd(2.0),
    ),
    "climb": (
        [(0, 0), (3, 2)],
        [0.5, 0.7],
        [UNDER, OVER],
        StraightEnd(1.0, -0.3),
        FixedEnd((5, -2)),
    ),
}


def end_directions(path):
    """u at the entry and at the exit, each of shape (2, fibres)."""
    return frame(path.angles[0])[0], frame(path.angles[-1])[0]


@pytest.fixture(params=SCENES)
def scene(request):
    return SCENES[request.param]


def test_one_roller_between_ends_at_its_height():
    """Half the wrap is asin(r/a), the runs are √(a² − r²) long."""
    r, a = 0.7, 2.5
    path = single([(0.3, 0.2)], [r], [OVER], FixedEnd((0.3 - a, 0.2)), FixedEnd((0.3 + a, 0.2)))
    wrap, run = 2.0 * np.arcsin(r / a), np.sqrt(a**2 - r**2)
    np.testing.assert_allclose(path.arcs.turn, [[wrap]], rtol=1e-13)
    np.testing.assert_allclose(path.starts[:, 0], [0, run, run + r * wrap, 2 * run + r * wrap])
    top, level = path.at(0.5 * path.length, 0)
    np.testing.assert_allclose(top, [[0.3], [0.2 + r]], rtol=1e-13)
    np.testing.assert_allclose(level, [[1.0], [0.0]], atol=1e-13)
    entry, exit = end_directions(path)
    np.testing.assert_allclose(np.arctan2(*entry[::-1]), wrap / 2)
    np.testing.assert_allclose(np.arctan2(*exit[::-1]), -wrap / 2)


def test_bridle():
    """Each wrap is the angle of the centre line and asin(2r/D) of the crossing tangent."""
    r, D, beta = 1.0, 2.4, np.radians(165.0)
    centre = (D * np.cos(beta), -D * np.sin(beta))
    path = single([(0, 0), centre], [r, r], [OVER, UNDER], StraightEnd(2.0), StraightEnd(5.0))
    wrap = beta + np.arcsin(2 * r / D)
    assert np.degrees(wrap) > 220.0
    np.testing.assert_allclose(path.arcs.turn[:, 0], [wrap, wrap], rtol=1e-12)
    np.testing.assert_allclose(path.length, 7.0 + 2 * r * wrap + np.sqrt(D**2 - 4 * r**2))
    start, end = (path.at(s, 0)[0] for s in (0.0, path.length[0]))
    np.testing.assert_allclose(start, [-2.0, r], atol=1e-12)
    np.testing.assert_allclose(end, [centre[0] + 5.0, centre[1] - r], atol=1e-12)


def test_tower_runs_straight_up_and_down():
    """90° at the ends, 180° between; runs as long as the tower is high."""
    path = single(*SCENES["tower"])
    np.testing.assert_allclose(
        np.degrees(path.arcs.turn[:, 0]), [90, 180, 180, 180, 90], rtol=1e-12
    )
    np.testing.assert_allclose(np.diff(path.starts[:, 0])[::2], [3, 7, 7, 7, 7, 2], rtol=1e-12)
    np.testing.assert_allclose(headings(path)[2:-2:2, 0], [90, -90, 90, -90], rtol=1e-12)
    np.testing.assert_allclose(path.length, 3 + 4 * 7 + 2 + np.pi * 4, rtol=1e-13)


@pytest.mark.parametrize("degrees", [10, 100, 179, 181, 250, 300])
def test_wraps_up_to_three_hundred_degrees(degrees):
    """A turn is not taken for its complement when a short run keeps the strip off itself."""
    path = single([(0, 0)], [2.0], [OVER], StraightEnd(9.0), StraightEnd(0.9, -np.radians(degrees)))
    np.testing.assert_allclose(np.degrees(path.arcs.turn), [[degrees]], rtol=1e-12)


@pytest.mark.parametrize("sense", [OVER, UNDER])
@pytest.mark.parametrize("degrees", [20, 181, 240, 314, 316, 345, 359.9])
def test_a_string_that_may_cross_itself_wraps_up_to_a_full_turn(degrees, sense):
    """Long runs, which meet behind the circle; between points on its tangents, by hand."""
    turn, r, before, behind = -sense * np.radians(degrees), 0.5, 3.0, 4.0
    heading = 0.4
    u, n = (
        np.array([np.cos(heading), np.sin(heading)]),
        np.array([-np.sin(heading), np.cos(heading)]),
    )
    v = np.array([np.cos(heading + turn), np.sin(heading + turn)])
    m = np.array([-v[1], v[0]])
    centre = np.array([0.3, -0.2])
    ends = centre + sense * r * n - before * u, centre + sense * r * m + behind * v
    path = string_path(
        centre.reshape(1, 2, 1), [[r]], [sense], *(FixedEnd(end) for end in ends), crossing=[True]
    )
    np.testing.assert_allclose(np.degrees(path.arcs.turn), [[degrees]], rtol=1e-12)
    np.testing.assert_allclose(path.length, before + behind + r * np.radians(degrees), rtol=1e-13)
    s = np.linspace(0.0, path.length[0], 20001)
    points, directions = path.at(s, 0)
    np.testing.assert_allclose(points[:, -1], ends[1], atol=1e-12)
    gap = np.linalg.norm(points - centre[:, None], axis=0) - r
    assert gap.min() > -1e-12
    side = directions[1] * (centre[0] - points[0]) - directions[0] * (centre[1] - points[1])
    assert (sense * side).min() > r - 1e-12  # the circle stays on the same side
    if 200 < degrees < 300:
        with pytest.raises(NotTouchedError):
            string_path(centre.reshape(1, 2, 1), [[r]], [sense], *map(FixedEnd, ends))


def test_only_circles_that_are_named_may_be_crossed_at():
    centres = np.reshape([(0.0, 0.0), (3.0, -2.0)], (2, 2, 1))
    ends = FixedEnd((-3.0, 0.5)), FixedEnd((6.0, 0.5))
    arguments = centres, [[0.5], [0.5]], [OVER, OVER], *ends
    path = string_path(*arguments, crossing=[False, True])
    assert np.pi < path.arcs.turn[1, 0] < 2.0 * np.pi
    with pytest.raises(NotTouchedError):
        string_path(*arguments, crossing=[True, False])


def test_level_rollers_are_touched_in_a_line():
    """Rounding does not lift a strip off rollers it lies on."""
    heights = np.array([0.1, 0.7, 0.3, 0.9, 0.2])
    z = 1.0 / 3.0 - heights
    path = single(np.c_[np.arange(5) * 0.7, z], heights, [OVER] * 5, StraightEnd(1), StraightEnd(2))
    assert np.all(path.arcs.turn >= 0.0)
    np.testing.assert_allclose(path.arcs.turn, 0.0, atol=1e-14)
    np.testing.assert_allclose(path.length, 4 * 0.7 + 3.0)
    np.testing.assert_allclose(path.arcs.start[:, 0], 1.0 + 0.7 * np.arange(5))


def test_a_turn_below_rounding_is_none():
    """Joints stay in order when a turn is negative by less than rounding."""
    path = single([(0, 0)], [1.0], [OVER], StraightEnd(1.0), StraightEnd(1.0, 1e-9))
    assert path.arcs.turn[0, 0] == 0.0
    with pytest.raises(NotTouchedError):
        single([(0, 0)], [1.0], [OVER], StraightEnd(1.0), StraightEnd(1.0, 1e-6))


def test_pinch_rollers_meet():
    """Rollers that just touch leave a run of no length between them."""
    path = single([(0, -0.3), (0, 0.1)], [0.3, 0.1], [OVER, UNDER], StraightEnd(1), StraightEnd(1))
    np.testing.assert_allclose(path.starts[:, 0], [0, 1, 1, 1, 1, 2], atol=1e-7)


def test_runs_touch_their_circles_at_right_angles_to_the_radius(scene):
    """Arcs lie at r from the centre, with the circle on the right hand or the left."""
    centres, radii, senses = scene[:3]
    path = single(*scene)
    arcs = path.arcs
    assert arcs.start.shape == (len(centres), 1)
    for i, (c, r, sense) in enumerate(zip(centres, radii, senses, strict=True)):
        x, u = path.at(np.linspace(arcs.start[i, 0], arcs.end[i, 0], 7), 0)
        d = x - np.reshape(c, (2, 1))
        np.testing.assert_allclose(np.hypot(*d), r, rtol=1e-12)
        np.testing.assert_allclose(d, sense * r * np.stack([-u[1], u[0]]), atol=1e-12)


def test_direction_is_the_derivative_everywhere(scene):
    """Unit speed and C1, also across joints and beyond the ends."""
    path = single(*scene)
    s = np.r_[np.linspace(-1.0, path.length[0] + 1.0, 400), path.starts[:, 0]]
    h = 1e-6
    before, after = path.at(s - h, 0), path.at(s + h, 0)
    u = path.at(s, 0)[1]
    np.testing.assert_allclose((after[0] - before[0]) / (2 * h), u, atol=5e-6)
    np.testing.assert_allclose(np.hypot(*u), 1.0, rtol=1e-14)
    assert np.all(np.hypot(*(after[1] - before[1])) <= 2.1 * h * np.abs(path.curvatures).max())


def test_ends_are_where_they_were_asked(scene):
    path = single(*scene)
    sides = zip(scene[3:], (0.0, path.length[0]), end_directions(path), (0, -1), strict=True)
    for end, s, direction, run in sides:
        x, u = path.at(s, 0)
        np.testing.assert_allclose(direction[:, 0], u, atol=1e-13)
        if isinstance(end, FixedEnd):
            np.testing.assert_allclose(x, end.position, atol=1e-12)
        else:
            np.testing.assert_allclose(u, [np.cos(end.angle), np.sin(end.angle)], atol=1e-13)
            np.testing.assert_allclose(np.diff(path.starts[:, 0])[run], end.length, rtol=1e-12)


def test_beyond_its_ends_the_path_goes_straight_on(scene):
    path = single(*scene)
    for s, u, step in zip((0, path.length[0]), end_directions(path), (-2.5, 2.5), strict=True):
        beyond = path.at(s + step, 0)[0] - path.at(s, 0)[0]
        np.testing.assert_allclose(beyond, step * u[:, 0], atol=1e-12)


def test_length_is_that_of_a_fine_polygon(scene):
    path = single(*scene)
    x = path.at(np.linspace(0.0, path.length[0], 20001), 0)[0]
    np.testing.assert_allclose(np.hypot(*np.diff(x)).sum(), path.length[0], rtol=1e-6)


def test_mirrored_rollers_give_the_mirrored_path(scene):
    """z → −z swaps over and under."""
    centres, radii, senses, *ends = scene
    mirror = np.array([1.0, -1.0])
    other = [
        FixedEnd(np.multiply(e.position, mirror))
        if isinstance(e, FixedEnd)
        else replace(e, angle=-e.angle)
        for e in ends
    ]
    path = single(*scene)
    image = single([mirror * c for c in centres], radii, [-s for s in senses], *other)
    s = np.linspace(-1.0, path.length[0] + 1.0, 50)
    for one, two in zip(path.at(s, 0), image.at(s, 0), strict=True):
        np.testing.assert_allclose(two, one * mirror[:, None], atol=1e-12)


def test_fibres_do_not_see_each_other():
    """A crowned, tilted roller after a plain one: every fibre as if it were alone."""
    y = np.linspace(-0.5, 0.5, 6)
    centres = np.zeros((2, 2, 6))
    centres[1] = 2.0 + 0.05 * y, 1.0 - 0.1 * y
    radii = np.stack([np.full(6, 0.3), 0.4 - 0.1 * y**2])
    entry, exit = StraightEnd(1.0 + 0.1 * y), FixedEnd(np.stack([5.0 + y, 0.0 * y]))
    together = string_path(centres, radii, [UNDER, OVER], entry, exit)
    assert np.ptp(together.length) > 0.1
    s = np.linspace(-0.5, 6.0, 30)
    everywhere = together.at(s[:, None], np.arange(6))
    assert everywhere[0].shape == (2, 30, 6)
    for i in range(6):
        ends = StraightEnd(entry.length[i]), FixedEnd(exit.position[:, i])
        alone = single(centres[:, :, i], radii[:, i], [UNDER, OVER], *ends)
        np.testing.assert_allclose(together.starts[:, i], alone.starts[:, 0], rtol=1e-13)
        for many, one in zip(everywhere, alone.at(s, 0), strict=True):
            np.testing.assert_allclose(many[:, :, i], one, rtol=1e-13, atol=1e-13)


def test_one_fibre_serves_many():
    """Ends with fibres broadcast against circles without."""
    path = string_path(
        [[[0.0], [0.0]]], [[1.0]], [OVER], StraightEnd([1.0, 2.0, 4.0]), StraightEnd(1.0)
    )
    np.testing.assert_allclose(path.length, [2.0, 3.0, 5.0])
    ends = FixedEnd([[-2.0, -3.0], [2.0, 2.0]]), FixedEnd((1.0, 2.0))
    straight = string_path(np.zeros((0, 2, 1)), np.zeros((0, 1)), [], *ends)
    np.testing.assert_allclose(straight.at(0.0, [0, 1])[0], [[-2.0, -3.0], [2.0, 2.0]])
    np.testing.assert_allclose(straight.length, [3.0, 4.0])


@pytest.mark.parametrize("lift", [0.05, 1.0, 8.0])
@pytest.mark.parametrize("index", [0, 1, 2, 3, 4])
def test_a_lifted_roller_is_named(index, lift):
    """Though, lifted far enough, it also turns its neighbours the wrong way."""
    centres = np.array([(2.0 * i, 0.0) for i in range(5)])
    senses = np.array([OVER, UNDER, OVER, UNDER, OVER])
    args = [0.6] * 5, senses, FixedEnd((-2, 0)), FixedEnd((10, 0))
    assert isinstance(single(centres, *args), StringPath)
    centres[index, 1] -= senses[index] * (1.2 + lift)
    with pytest.raises(NotTouchedError, match=f"circle {index}:") as caught:
        single(centres, *args)
    assert caught.value.index == index
    assert -np.pi < caught.value.turn < 0.0


def test_a_negative_turn_is_told_from_a_large_wrap():
    """90° the wrong way would be 270° only if the strip passed through itself."""
    with pytest.raises(NotTouchedError) as caught:
        single([(0, 0)], [1.0], [OVER], StraightEnd(3.0, -np.pi / 4), StraightEnd(3.0, np.pi / 4))
    assert caught.value.turn == pytest.approx(-np.pi / 2)


def test_a_short_run_does_not_hide_a_small_negative_turn():
    """Lines that do not get to cross leave only the size of the turn to tell."""
    with pytest.raises(NotTouchedError) as caught:
        single([(0, 0)], [1.0], [OVER], StraightEnd(3.0), StraightEnd(0.1, np.radians(20.0)))
    assert np.degrees(caught.value.turn) == pytest.approx(-20.0)


def test_one_fibre_off_its_roller_is_enough():
    radii = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.49]])
    centres = np.broadcast_to(np.reshape([(0.0, 0.0), (3.0, 0.0)], (2, 2, 1)), (2, 2, 3))
    ends = StraightEnd(1.0), FixedEnd((9.0, 0.5))
    string_path(centres[..., :2], radii[:, :2], [OVER, OVER], *ends)
    with pytest.raises(NotTouchedError) as caught:
        string_path(centres, radii, [OVER, OVER], *ends)
    assert caught.value.index == 1


@pytest.mark.parametrize(
    ("second", "senses", "exit", "index"),
    [
        ((1.5, 0.0), [OVER, UNDER], StraightEnd(1.0), 1),  # overlap where the strip has to cross
        ((0.0, 0.0), [OVER, OVER], StraightEnd(1.0), 1),  # the same place
        ((5.0, 0.0), [OVER, OVER], FixedEnd((5.2, 0.1)), 2),  # an end inside a roller
    ],
)
def test_neighbours_that_overlap_have_no_tangent(second, senses, exit, index):
    with pytest.raises(NoTangentError) as caught:
        single([(0, 0), second], [1.0, 1.0], senses, StraightEnd(1.0), exit)
    assert caught.value.index == index


def test_one_fibre_without_tangent_is_enough():
    centres = np.array([[[0.0, 0.0], [0.0, 0.0]], [[3.0, 1.5], [0.0, 0.0]]])
    with pytest.raises(NoTangentError) as caught:
        string_path(centres, np.ones((2, 1)), [OVER, UNDER], StraightEnd(1.0), StraightEnd(1.0))
    assert caught.value.index == 1


def test_circles_without_a_radius_are_refused():
    with pytest.raises(ValueError, match="positive"):
        single([(0, 0)], [0.0], [OVER], StraightEnd(1.0), StraightEnd(1.0))


@st.composite
def zigzags(draw):
    """Rollers on alternate sides of a line, all pressed into it; small ones, well apart."""
    count = draw(st.integers(2, 6))
    size = st.floats(0.05, 0.9)
    radii = np.array(draw(st.lists(size, min_size=count, max_size=count)))
    depth = np.array(draw(st.lists(st.floats(0.05, 3.0), min_size=count, max_size=count)))
    gaps = draw(st.lists(st.floats(2.0, 5.0), min_size=count, max_size=count))
    senses = draw(st.sampled_from([OVER, UNDER])) * (-1) ** np.arange(count)
    centres = np.c_[np.cumsum(gaps), senses * (depth - radii)]
    ends = StraightEnd(draw(st.floats(0.1, 3.0))), StraightEnd(draw(st.floats(0.1, 3.0)))
    return centres, radii, senses, *ends


@given(zigzags(), st.floats(1e-3, 1e3), st.floats(-3.0, 3.0))
def test_zigzag(scene, scale, angle):
    """A zigzag is a closed balance of turns, at any scale and in any direction."""
    centres, radii, senses, entry, exit = scene
    turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    path = single(*scene)
    ends = (StraightEnd(scale * e.length, angle) for e in (entry, exit))
    image = single(scale * centres @ turned.T, scale * radii, senses, *ends)
    arcs = path.arcs
    assert np.all((arcs.turn > 0.0) & (arcs.turn < np.pi))
    assert abs(senses @ arcs.turn[:, 0]) < 1e-10
    np.testing.assert_allclose(image.starts, scale * path.starts, rtol=1e-9)
    s = np.linspace(-1.0, path.length[0] + 1.0, 40)
    np.testing.assert_allclose(
        image.at(scale * s, 0)[0] / scale, turned @ path.at(s, 0)[0], atol=1e-9
    )
    middle = 0.5 * (arcs.start + arcs.end)[:, 0]
    distance = np.hypot(*(path.at(middle, 0)[0] - centres.T))
    np.testing.assert_allclose(distance, radii, rtol=1e-9)
