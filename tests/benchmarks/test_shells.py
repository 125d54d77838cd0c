"""Benchmarks of shells: work and errors bounded, limit points dated, roofs that lean."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from anmstrip.continuation.bifurcations import Kind
from anmstrip.continuation.path import PathStopped
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.results.vtk import read_surface
from harness import run
from newton_methods import RiksSettings, arc_steps
from shell_problems import (
    Benchmark,
    end_moment,
    end_shear,
    followed,
    hinged_roof,
    iterated,
    miss,
    published,
    settings,
    slit_plate,
)
from shells import study

EXAMPLES = Path(__file__).parents[2] / "examples"

ELASTICA = 10.0 * np.array([0.32894124, 0.66996418])
"""−U, W of the inextensible elastica at P L²/EI = 4, by elliptic integrals."""


def roof_of(thickness: float) -> Benchmark:
    return hinged_roof(thickness, 5)


@pytest.mark.parametrize(
    ("make", "most", "error"),
    [
        (end_shear, 3, 8e-4),
        (end_moment, 6, 8e-4),
        (lambda: slit_plate((3, 24)), 12, 1e-2),
        (lambda: roof_of(12.7), 15, 7e-3),
        (lambda: roof_of(6.35), 15, 1e-2),
    ],
    ids=["shear", "moment", "slit", "thick roof", "thin roof"],
)
def test_few_tangents_along_the_published_path(make, most, error):
    """The last three tables have shear under the force, and are 0.3 to 0.8 % off themselves."""
    found = followed(make(), settings())
    assert found.tangents == len(found.steps) <= most
    assert all(step.imbalance <= 1e-4 for step in found.steps)
    table = found.benchmark.published
    assert len(table) > 20
    assert miss(found, table) < error


@pytest.mark.slow
def test_converged_values():
    """On the meshes of the report: within 0.3 % of twice the elements; the plate's work."""
    pairs = [(slit_plate(), slit_plate((8, 64)))]
    pairs += [(hinged_roof(t), hinged_roof(t, 14)) for t in (12.7, 6.35)]
    for coarse, fine in pairs:
        found, expected = followed(coarse, settings()), followed(fine, settings(tolerance=1e-6))
        assert found.tangents <= (12 if "plate" in coarse.name else 15)
        inside = expected.curve[expected.curve[:, 0] <= coarse.target]
        assert miss(found, inside if coarse.snaps else expected.at(inside[1:, 0])) < 3e-3


@pytest.mark.parametrize("curved", [True, False])
def test_tip_of_the_elastica(curved):
    """Order of the element, on the way to the elastica but for its stretch."""
    tips = []
    for cells in (8, 16, 64):
        benchmark = end_shear(cells, curved=curved)
        last = followed(benchmark, settings(tolerance=1e-7)).steps[-1].branch.end[0]
        tips.append(benchmark.reading(last))
    errors = [np.abs(tip - tips[-1]).max() for tip in tips[:2]]
    assert errors[0] / errors[1] > 2.0**4
    np.testing.assert_allclose(tips[-1], ELASTICA, rtol=5e-5)


def test_both_bendings_differ_by_less_than_the_membrane_strain():
    shares = []
    for thickness in (0.4, 0.2):
        tips = []
        for curved in (True, False):
            benchmark = end_shear(32, curved=curved, thickness=thickness)
            last = followed(benchmark, settings(tolerance=1e-7)).steps[-1]
            tips.append(benchmark.reading(last.branch.end[0]))
        strain = 4.0 * thickness**2 / 1200.0
        shares.append(np.abs(tips[0] - tips[1]).max() / 10.0 / strain)
    assert 0.0 < shares[1] < 0.6 * shares[0] < 0.1


@pytest.mark.parametrize(("thickness", "limits"), [(12.7, (0.742, 0.170)), (6.35, (0.195, -0.129))])
def test_limit_points_are_dated_to_1e_6(claim, thickness, limits):
    """On a coarse path of quotients against a fine path of series."""
    roof = roof_of(thickness)
    found = followed(roof, settings(), watch=True)
    fine = followed(roof, settings(30, 1e-9, rational=False))
    assert [p.kind for p in found.points] == [Kind.LIMIT, Kind.LIMIT]
    assert [(p.before, p.after) for p in found.points] == [(0, 1), (1, 0)]
    loads = [p.control for p in found.points]
    for number, (load, fold) in enumerate(zip(loads, fine.folds, strict=True), 1):
        quantity = f"limit point {number} of a roof of {thickness:g} mm, share of the load"
        claim(quantity, load, fold, 1e-8, "fine path of series on the same mesh")
    assert loads == pytest.approx(fine.folds, abs=1e-9)
    assert loads == pytest.approx(limits, abs=1e-3)
    for point in found.points:
        residual = roof.equations.residual(point.u, point.control)
        assert roof.equations.imbalance(residual) < 1e-8


def test_whole_roof_buckles_to_one_side(tmp_path):
    """The first bifurcation is before the limit point; its mode is odd, and is written."""
    roof = hinged_roof(6.35, 4, whole=True)
    found = followed(roof, settings(tolerance=1e-6), watch=True)
    first, second = found.points[:2]
    assert (first.kind, second.kind) == (Kind.BIFURCATION, Kind.LIMIT)
    assert first.control < second.control
    strip, supports = roof.equations.model.strip, roof.equations.supports
    mode = supports.change(first.mode, 0.0).reshape(-1, 3)[strip.node_values, 2]
    odd = min(
        np.abs(
            mode + mode[np.abs(strip.mesh.p[:, :, None] - image[:, None]).sum(0).argmin(1)]
        ).max()
        for image in (strip.mesh.p * [[1.0], [-1.0]], strip.mesh.p * [[-1.0], [1.0]])
    )
    assert odd < 1e-6 * np.abs(mode).max()
    write_shape = runpy.run_path(str(EXAMPLES / "roofs.py"))["write_shape"]
    write_shape(tmp_path / "mode.vtu", roof.equations, first.u, first.mode)
    surface = read_surface(tmp_path / "mode.vtu")
    assert surface.points[:, 2].max() < 2540.0
    written = surface.fields["mode"]
    assert np.abs(written[:, 2]).max() == pytest.approx(np.abs(mode).max(), rel=0.2)


def test_newton_along_the_arc_needs_several_times_the_tangents():
    roof = roof_of(12.7)
    newton, series = iterated(roof), followed(roof, settings())
    assert newton.tangents > 5 * series.tangents
    assert newton.steps[-1].control >= roof.target
    assert all(step.imbalance <= 1e-4 for step in newton.steps)
    rows = np.array([[s.control, *roof.reading(s.u)] for s in newton.steps])
    assert miss(series, rows[rows[:, 0] < roof.target]) < 1e-3


def test_newton_along_the_arc_does_not_leap():
    """On this mesh it would, from one side of the snap to the other."""
    roof = hinged_roof(12.7, 4)
    newton = iterated(roof)
    assert newton.steps[-1].control >= roof.target
    assert min(step.control for step in newton.steps) > 0.0


def test_newton_along_the_arc_gives_up_with_a_name():
    roof = roof_of(12.7)
    for choices in (RiksSettings(max_steps=3), RiksSettings(most=0)):
        with pytest.raises(PathStopped):
            list(arc_steps(roof.equations, roof.start, solver=SparseSolver(), settings=choices))


def test_tables_name_their_source():
    folder = EXAMPLES / "benchmarks" / "tables"
    tables = sorted(folder.glob("*.csv"))
    assert len(tables) == 5
    for table in tables:
        assert "Sze" in table.read_text(encoding="utf-8").splitlines()[0]
        assert published(table.stem).shape[0] > 20


@pytest.mark.slow
def test_study_writes_its_report(tmp_path):
    run(study, quick=True, directory=tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["shells.csv", "shells.md", "shells.png"]
    report = (tmp_path / "shells.md").read_text(encoding="utf-8")
    assert report.count("\n## ") == 7
    assert (tmp_path / "shells.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["roll_up", "slit_plate"])
def test_examples(name, capsys):
    cells = {"roll_up": (8,), "slit_plate": ((3, 24), 8e-3)}[name]
    runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"](*cells)
    assert "tangents" in capsys.readouterr().out


@pytest.mark.slow
def test_example_of_the_roofs(tmp_path, capsys):
    runpy.run_path(str(EXAMPLES / "roofs.py"))["main"](5, 6, tmp_path)
    assert capsys.readouterr().out.count("limit point") >= 6
    assert len(list(tmp_path.glob("*.vtu"))) == 5
