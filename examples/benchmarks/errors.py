"""The error budget of a run beside the truth: what the mesh changes, in eight scenes.

The estimate is that of ``summary.json``; the truth comes from a whole run on elements of a quarter
of the length, with the same laws of contact and friction and strict tolerances.
"""

from __future__ import annotations

from collections.abc import Iterator
from tempfile import TemporaryDirectory

from anmstrip.driver.budget import Halved, Part, largest_differences
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.simulation.march import March
from anmstrip.simulation.problem import Assembly
from harness import ROOT, Cell, Report, Sheet, main

SECTION, COARSE = 'strip.kinematics="section"', "strip.refined=0.1"

SCENES: dict[str, tuple[str, ...]] = {
    "press": (SECTION, COARSE, "solver.tolerance=1e-7"),
    "capstan": (SECTION, COARSE, "contact.stiffness=1e8", "solver.tolerance=1e-5"),
    "bridle": (COARSE, "solver.tolerance=1e-4"),
    "heavy": ("strip.cells=[20, 2]", "solver.tolerance=1e-7"),
    "press, shell": (COARSE, "solver.tolerance=1e-5"),
    "capstan, shell": (COARSE, "contact.stiffness=1e8", "solver.tolerance=1e-5"),
    "crowned, shell": ("strip.cells=[16, 4]", "solver.tolerance=1e-5"),
    "flatness, shell": ("strip.cells=[8, 6]", "solver.tolerance=1e-5"),
}

COLUMNS = ("scene", "of", "estimate", "truth", "estimate / truth")
NOTE = (
    "Largest errors of the final state by the mesh: of tensions (N/m), of rollers' forces (N) and "
    "of positions (m)."
)


def study(quick: bool = False) -> Report:
    """All scenes, or two sections."""
    chosen = dict(list(SCENES.items())[: 2 if quick else None])
    rows = tuple(row for name, settings in chosen.items() for row in compared(name, settings))
    sheet = Sheet("The part of the mesh, estimated and true", COLUMNS, rows, NOTE)
    return Report("errors", "The error budget beside the truth", sheet, (sheet,))


def compared(name: str, settings: tuple[str, ...]) -> Iterator[tuple[Cell, ...]]:
    """Yield the rows of a scene."""
    path = ROOT / "examples" / f"{name.split(',', maxsplit=1)[0]}.toml"
    scene = Scene.load(path, settings)
    with TemporaryDirectory() as directory:
        run = finished(Run(scene, directory))
        estimate = run.errors()["mesh"] or {}
    for kind, truth in true_part(run).items():
        if kind in estimate and truth > 0.0:
            yield name, kind, estimate[kind], truth, estimate[kind] / truth


def true_part(run: Run) -> Part:
    """Return what a mesh four times as fine changes."""
    half = Halved.of(run.assembly)
    quarter = Halved.of(half)
    finer = finished(on_mesh(run, quarter))
    assert run.state is not None and finer.state is not None
    same = quarter.prolonged(half.prolonged(run.state.full))
    return largest_differences(run.state, finer.state, finer.state.full - same)


def on_mesh(run: Run, assembly: Assembly) -> Run:
    """Return a run of the same scene on another mesh."""
    other = Run(run.assembly.scene)
    other.assembly, other.march = assembly, March(assembly)
    return other


def finished(run: Run) -> Run:
    """Return a run at its end.

    Raises
    ------
    RuntimeError
        It stops before.
    """
    for _ in run:
        pass
    if not run.outcome.done:
        raise RuntimeError(run.message)
    return run


if __name__ == "__main__":
    main(study)
