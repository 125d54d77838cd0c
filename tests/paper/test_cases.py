"""The paper's three cases end to end: what it reports, the references, the files."""

import json
import runpy
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from anmstrip.continuation.path import Cost
from anmstrip.errors import InputError
from anmstrip.mechanics.laws import NortonHoff, Tanh, cone_speed, corner_speed
from anmstrip.paper.cases import (
    CASE_COLUMNS,
    PAPER_STEPS,
    events_of,
    explicit_scheme,
    run_case,
    solve_case,
)
from anmstrip.paper.mass_spring import (
    CASES,
    Parameters,
    RotatingCircle,
    coulomb,
    reference_solution,
)
from anmstrip.results import files as history

EXAMPLES = Path(__file__).parents[2] / "examples"
PICTURES = {
    "pressed-plane": ["displacement", "friction-law-omega", "friction-law-q"],
    "moving-plane": ["displacement"],
    "rotating-circle": ["displacement", "reactions", "trajectory"],
}


@cache
def reference(name):
    return reference_solution(CASES[name]())


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """What the examples return, each run once."""

    @cache
    def report(name):
        main = runpy.run_path(str(EXAMPLES / f"{name.replace('-', '_')}.py"))["main"]
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(tmp_path_factory.mktemp(name))
            found = main()
            return replace(found, files=tuple(file.resolve() for file in found.files))

    return report


@pytest.mark.parametrize("name", CASES)
def test_steps_are_close_to_the_papers(reports, name):
    report = reports(name)
    assert report.steps == pytest.approx(PAPER_STEPS[name], rel=0.15)
    assert report.tangents == report.steps
    assert report.done
    assert report.message == "reached the end"


@pytest.mark.parametrize("name", CASES)
def test_the_error_is_below_the_tolerance(reports, name):
    """At equal times the snap of the circle, at 1e7 m/s, may be a little late."""
    report = reports(name)
    assert report.error <= 1e-4
    assert report.error_at_equal_times <= (2e-4 if name == "rotating-circle" else 1e-4)
    assert report.solution.error / 10 < report.error < 10 * report.solution.error


SLOW = 1e3
"""Speed (m/s) below which the last digit of the time is worth less than 1e-12 m."""


def largest_distance(name, found, case, knots_of=np.inf):
    exact = reference(name)
    knots = [t for t in found.path.knots if np.linalg.norm(found.path(t)[1]) < knots_of]
    times = np.union1d(np.linspace(0.0, case.parameters.t_end, 201), knots)
    return max(exact.distance(t, found.path(t)[0], 1.0) for t in times)


@pytest.mark.parametrize(
    "name",
    [n if n != "rotating-circle" else pytest.param(n, marks=pytest.mark.slow) for n in CASES],
)
def test_eight_digits(name):
    case = CASES[name]()
    found = solve_case(case, "taylor", order=19, tolerance=1e-8)
    assert found.stopped is None
    assert largest_distance(name, found, case, knots_of=SLOW) <= 1e-8
    # in the snap, at 5e7 m/s, the last digit of the time is worth 1e-8 m
    assert largest_distance(name, found, case) <= 2e-8
    assert found.error <= 1e-8
    assert len(found.path.errors) <= 160


IMPLICIT = [("pressed-plane", 950), pytest.param("moving-plane", 1600, marks=pytest.mark.slow)]
IMPLICIT_SNAP = pytest.param("rotating-circle", 20_000, marks=pytest.mark.slow)


@pytest.mark.parametrize(("name", "steps"), [*IMPLICIT, IMPLICIT_SNAP])
def test_the_implicit_scheme_keeps_the_tolerance_too(name, steps):
    case = CASES[name]()
    found = solve_case(case, "implicit", order=19, tolerance=1e-4)
    assert found.stopped is None
    assert largest_distance(name, found, case) <= 1e-4
    assert found.error <= 1e-4
    assert len(found.path.errors) <= steps
    assert found.cost.factorisations <= 1.1 * len(found.path.errors) + 10


@pytest.mark.slow
@pytest.mark.parametrize("order", [8, 12, 25])
@pytest.mark.parametrize("name", CASES)
def test_the_tolerance_is_kept_at_other_orders(name, order):
    case = CASES[name]()
    found = solve_case(case, "taylor", order=order, tolerance=1e-5)
    assert largest_distance(name, found, case) <= 1e-5


def test_pressed_plane_ends_where_friction_balances_the_spring(claim, reports):
    report = reports("pressed-plane")
    p = report.case.parameters
    balance = p.f * (p.V**2 + (p.omega * p.V_c) ** 2) ** ((p.q - 1) / 2) * p.V * p.R_N
    assert balance / (p.k * p.V_c**p.q) == pytest.approx(0.298585, abs=5e-7)
    claim(
        "end of `pressed-plane` (m)", report.end[0], 0.298585, 3e-5, "friction balances the spring"
    )
    assert report.end == pytest.approx([0.298585, 0.0], abs=1e-5)
    assert report.rows[-1, 3] == pytest.approx(0.0, abs=1e-4)


def test_pressed_plane_leaves_coulomb_between_0_1_and_0_3_s(reports):
    report = reports("pressed-plane")
    t = report.rows[:, 0]
    gap = np.abs(report.rows[:, 1] - coulomb(report.case).displacement(t)[:, 0])
    assert 0.1 < t[np.argmax(gap)] <= 0.31
    assert gap.max() == pytest.approx(0.026, abs=2e-3)


def test_moving_plane_touches_at_1_s_and_slides_with_slope_0_29(reports):
    report = reports("moving-plane")
    t, ux, uy = report.rows[:, 0], report.rows[:, 1], report.rows[:, 2]
    sliding = t > 2.0
    assert np.polyfit(t[sliding], ux[sliding], 1)[0] == pytest.approx(0.29, abs=0.005)
    assert (np.diff(ux[t > 1.0]) > 0.0).all()
    assert np.interp(0.9, t, uy) == pytest.approx(-0.9, abs=0.08)
    assert uy[sliding] == pytest.approx(-np.ones(sliding.sum()), abs=0.02)


def test_rotating_circle_leaves_the_cone_snaps_and_comes_back(reports):
    report = reports("rotating-circle")
    t, ux, uy, normal, tangential = report.rows[:, [0, 1, 2, 5, 6]].T
    outside = t[(t > 1.5) & (np.abs(tangential) > 0.3 * normal)]
    assert outside[0] == pytest.approx(1.805, abs=0.02)
    phi = np.arctan2(ux, uy + 1.5)
    assert np.interp([1.80, 1.85], t, phi) == pytest.approx([0.76, 3.02], abs=0.1)
    assert abs(report.end[0]) < 0.3 * 0.12 + 1e-3  # the floor f ζ R_C of friction over k
    assert report.end[1] < -2.0
    (stretch,) = report.unstable
    assert stretch.start == pytest.approx(1.805, abs=0.03)
    assert "the negative pivot" in str(report)
    assert len(report.summary()["unstable"]) == 1


def dates(events):
    """Kind → first time."""
    return {event.kind: event.time for event in reversed(events)}


def test_events_of_the_circle(claim, reports):
    """Coulomb: contact at 1, stick from 1.107 on, no quasi-static solution after 1.8054.

    Stick is dated where sliding at the cone would have to turn round; the creep of the law comes
    to the middle of its corner at 1.1142, and at 1.15 where V_c is sharpened as well.
    """
    report = reports("rotating-circle")
    found = dates(report.events)
    claim(
        "first contact of `rotating-circle` (s)",
        found["contact made"],
        1.0,
        0.01,
        "Coulomb on a rigid circle",
    )
    assert found["stick"] == pytest.approx(1.107, abs=0.01)
    until = coulomb(report.case).until
    claim(
        "loss of equilibrium of `rotating-circle` (s)",
        found["existence lost"],
        until,
        0.0055,
        "Coulomb on a rigid circle",
    )
    kinds = [event.kind for event in report.events]
    assert kinds == [
        *("contact made", "stick", "slip", "cone left", "existence lost", "cone regained"),
        *("stick", "contact lost"),
    ]
    lost = report.events[4]
    assert "no quasi-static solution" in lost.message
    # forwards is where friction gives way, and Coulomb's sliding would go backwards:
    # φ' = −S_t/S_φ with S = |A| (sin φ − f cos φ) − f k r, relative to the circle
    phi, away, p = np.arctan2(lost.ux, lost.uy + 1.5), lost.time - 1.5, report.case.parameters
    rate = -(np.sin(phi) - p.f * np.cos(phi)) / (away * (np.cos(phi) + p.f * np.sin(phi)))
    assert lost.value == pytest.approx(p.r * (rate - p.Omega), rel=0.05)
    table = history.read_history(report.files[2])
    assert table["time"] == pytest.approx([event.time for event in report.events])
    summary = json.loads(report.files[1].read_text())
    assert [event["kind"] for event in summary["events"]] == kinds


def test_events_of_the_planes(reports):
    """The spring alone resists the vertical motion, so contact is dated exactly."""
    events = reports("moving-plane").events
    assert [event.kind for event in events] == ["contact made"]
    assert events[0].time == pytest.approx(1.0, abs=1e-6)
    (slip,) = reports("pressed-plane").events
    assert slip.kind == "slip"
    assert slip.value == pytest.approx(-corner_speed(Parameters().friction))


def sharper(e):
    """The circle with all regularisations e times as wide, up to its snap."""
    p = Parameters()
    return RotatingCircle(
        replace(p, t_end=1.83, omega=e * p.omega, q=e * p.q, zeta=e * p.zeta, eta=e * e * p.eta,
                K=p.K / e)
    )  # fmt: skip


@pytest.mark.slow
def test_dates_tend_to_coulombs():
    """Contact, stick and loss of existence, with all regularisations sharpened together."""
    errors = []
    for e in (1.0, 0.25):
        path, _ = explicit_scheme(sharper(e), 19, 1e-3, Cost())
        found = dates(events_of(sharper(e), path.polynomials()))
        until = coulomb(sharper(e)).until
        errors.append([found["contact made"] - 1.0, found["existence lost"] - until])
    assert np.abs(errors[0]) == pytest.approx([0.0, 0.0], abs=0.01)
    assert np.abs(errors[1][0]) < 0.3 * np.abs(errors[0][0])
    assert np.abs(errors[1]) == pytest.approx([0.0, 0.0], abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("slower", [False, True])
def test_stick_tends_to_coulombs(slower):
    """1.1071 s: within 0.01 at any sharpness, whether V_c is sharpened with the rest or not."""
    errors = []
    for e in (1.0, 0.5, 0.25) if slower else (1.0, 0.25, 1 / 16):
        p = sharper(e).parameters
        case = RotatingCircle(replace(p, t_end=1.3, V_c=e * p.V_c if slower else p.V_c))
        path = solve_case(case, "implicit", order=19, tolerance=1e-3).path
        errors.append(abs(dates(events_of(case, path.polynomials()))["stick"] - 1.10711))
    assert errors[0] < 0.01
    assert errors[-1] < (0.3 if slower else 0.15) * errors[0]


def test_speeds_that_separate_stick_slip_and_the_cone():
    for law in (NortonHoff(0.3, 0.05, 0.1, 2.0), Tanh(0.2, 0.1, 1e-5)):
        v = corner_speed(law)
        assert 1.0 - law.effective(v) / law.coefficient == pytest.approx(v / law.speed)
    assert NortonHoff(0.3, 0.05, 0.1, 2.0).effective(
        cone_speed(NortonHoff(0.3, 0.05, 0.1, 2.0))
    ) == pytest.approx(0.3)
    assert cone_speed(Tanh(0.2, 0.1, 1e-5)) == np.inf
    sharp = [corner_speed(NortonHoff(0.3, 0.05 * e, 0.1 * e, 1.0)) for e in (1.0, 1e-2, 1e-4)]
    assert sharp[0] > 10.0 * sharp[1] > 100.0 * sharp[2]


@pytest.mark.parametrize("name", ["moving-plane", "rotating-circle"])
def test_before_the_cone_is_left_the_answer_is_coulombs(reports, name):
    report = reports(name)
    exact = coulomb(report.case)
    t = report.rows[:, 0]
    before = t < min(exact.until - 0.01, 10.0)
    gap = report.rows[before, 1:3] - exact.displacement(t[before])
    assert np.abs(gap).max() < 0.12  # √(η δ) = 0.1 m softens the first touch
    assert np.abs(gap[t[before] > 1.5]).max() < 0.03


@pytest.mark.parametrize("name", CASES)
def test_equilibrium_holds_in_every_row(reports, name):
    report = reports(name)
    size = report.case.size
    slow = np.abs(report.rows[:, 3:5]).max(axis=1) < 5.0
    for row in report.rows[slow]:
        residual = report.case.residual(row[1 : 1 + size], row[3 : 3 + size], row[0])
        assert residual == pytest.approx(np.zeros(size), abs=2e-3)


@pytest.mark.parametrize("name", CASES)
def test_files(reports, name):
    report = reports(name)
    directory = report.files[0].parent
    assert directory.parts[-2:] == ("results", f"case-{name}")
    table = np.genfromtxt(directory / "case.csv", delimiter=",", names=True)
    assert table.dtype.names == CASE_COLUMNS
    assert len(table) >= 200
    assert np.diff(table["time"]) == pytest.approx(np.full(len(table) - 1, table["time"][1]))
    assert (table["time"][0], table["time"][-1]) == (0.0, report.case.parameters.t_end)
    assert table["ux"] == pytest.approx(report.rows[:, 1], rel=1e-10, abs=1e-12)
    assert (table["uy"] == 0.0).all() == (name == "pressed-plane")
    summary = json.loads((directory / "case.json").read_text())
    assert {"steps", "tangents", "parameters", "scheme"} <= set(summary)
    assert set(summary["parameters"]) == set(asdict(Parameters()))
    assert sorted(file.stem for file in directory.glob("*.png")) == PICTURES[name]
    assert all(file.stat().st_size > 5000 for file in directory.glob("*.png"))
    assert sorted(directory.iterdir()) == sorted(report.files)
    assert f"(paper: {PAPER_STEPS[name]})" in str(report)


def test_settings_are_used(tmp_path):
    settings = {"f": 0.2, "t_end": 1.0}
    report = run_case("pressed-plane", settings=settings, directory=tmp_path, tolerance=1e-6)
    assert report.rows[-1, 0] == 1.0
    assert report.end[0] == pytest.approx(0.2 / 0.3 * 0.298585, abs=1e-5)


def test_the_sense_of_turning_mirrors_the_path():
    ends = [
        solve_case(
            RotatingCircle(Parameters(t_end=1.2, Omega=sense)), "taylor", order=9, tolerance=1e-3
        )
        for sense in (1.0, -1.0)
    ]
    (right, _), (left, _) = (end.path(1.2)[0] for end in ends)
    assert right == pytest.approx(-left, rel=1e-9)
    assert right > 0.05


def test_what_cannot_be_continued_is_told_and_kept(tmp_path):
    settings = {"q": 0.01, "omega": 0.1, "zeta": 0.3}
    report = run_case(
        "rotating-circle", settings=settings, directory=tmp_path, order=9, tolerance=1e-2
    )
    assert not report.done
    assert report.message.startswith("stopped: ")
    assert report.rows[-1, 0] == pytest.approx(1.805, abs=0.02)
    assert (tmp_path / "case.csv").exists()
    assert json.loads((tmp_path / "case.json").read_text())["message"] == report.message


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"name": "moving-plain"}, ["moving-plane"]),
        ({"scheme": "tailor"}, ["taylor"]),
        ({"settings": {"omga": 0.1, "q": 2.0}}, ["omega", "at most 1"]),
        ({"settings": {"K": -1.0}}, ["above 0"]),
        ({"settings": {"F": float("nan")}}, ["finite"]),
        ({"settings": {"k": 1e308, "R_C": 1e-308}}, ["a factor of 1e+06 of the paper's 1", "R_C"]),
        ({"settings": {"eta": 10.0, "K": 5.0}}, ["below K delta"]),
        ({"order": 1}, ["order"]),
        ({"tolerance": 0.0}, ["above 0"]),
    ],
)
def test_wrong_input_is_told_and_nothing_is_written(tmp_path, given, words):
    with pytest.raises(InputError) as caught:
        run_case(**{"name": "moving-plane", "directory": tmp_path / "out", **given})
    assert all(word in str(caught.value) for word in words)
    assert not list(tmp_path.iterdir())
