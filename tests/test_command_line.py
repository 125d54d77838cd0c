"""The command line: exit statuses, sentences, and what it asks of the rest."""

from __future__ import annotations

import ctypes
import io
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner, Result

from anmstrip.cli import THREAD_VARIABLES, describe_step, main, show_progress
from anmstrip.errors import InputError, Mistake

CAPSTAN = str(Path(__file__).parent / "scene" / "capstan.toml")
MISTAKE = InputError([Mistake("strip.msh", "edges.entry", None, "a named edge", "one of: exit")])


class FakeReport(str):
    """Stands in for the report of a case that ended as asked for."""

    done = True


class StoppedReport(FakeReport):
    """One that stopped early."""

    done = False


@dataclass
class FakeRun:
    """Stands in for a run: three steps, then an end as asked for."""

    scene: Any
    directory: Path
    resume: bool = False
    end: BaseException | None = None
    signal: int | None = None
    done: bool = True
    message: str = "Reached the end."
    warnings: tuple[str, ...] = ("The strip is compressed.",)
    forewarned: tuple[str, ...] = ()
    early: bool = False  # whether it is interrupted before it has begun
    reported: None = None
    saved: list[bool] = field(default_factory=list)

    @property
    def outcome(self) -> SimpleNamespace:
        return SimpleNamespace(done=self.done)

    def forewarnings(self) -> tuple[str, ...]:
        if self.early:
            raise KeyboardInterrupt
        return self.forewarned

    def interrupted(self) -> None:
        self.saved.append(True)

    def __iter__(self) -> Iterator[SimpleNamespace]:
        for step in (1, 2, 3):
            if step == 2 and self.signal is not None:
                try:
                    os.kill(os.getpid(), self.signal)
                except KeyboardInterrupt:
                    if self.end is not None:
                        raise self.end from None
            yield step_at(step)
        if self.end is not None:
            raise self.end


def step_at(step: int, ratio: float | None = 1.25) -> SimpleNamespace:
    return SimpleNamespace(
        stage="turn",
        time=step / 5,
        end_time=0.6,
        fraction=step / 3,
        step=step,
        tangents=2 * step,
        tension_ratio=ratio,
    )


class Fakes:
    """Puts functions where the commands look for them, and keeps what was called."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.monkeypatch = monkeypatch
        self.calls: list[Any] = []

    def put(self, module: str, name: str, result: Any) -> None:
        def fake(*given: Any, **named: Any) -> Any:
            return self._called(result, given, named)

        self.monkeypatch.setattr(f"{module}.{name}", fake)

    def put_run(self, **ending: Any) -> None:
        def made(scene: Any, directory: Path, resume: bool, effects: Any) -> FakeRun:
            assert not effects
            return FakeRun(scene, directory, resume, **ending)

        self.put("anmstrip.driver.scene", "Run", made)
        named = "anmstrip.pictures.report.write_report"
        self.monkeypatch.setattr(named, lambda directory: Path(directory, "report.html"))

    def _called(self, result: Any, given: tuple[Any, ...], named: dict[str, Any]) -> Any:
        if isinstance(result, Exception):
            raise result
        made = result(*given, **named) if callable(result) else result
        self.calls.append((given, named, made))
        return made


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Fakes:
    monkeypatch.chdir(tmp_path)
    return Fakes(monkeypatch)


def typed(*arguments: str) -> Result:
    result = CliRunner().invoke(main, arguments)
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert "Traceback" not in result.output
    return result


def test_run_that_is_done(fakes: Fakes) -> None:
    fakes.put_run()
    result = typed("run", CAPSTAN)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines() == [
        "Reached the end.",
        "Warning: The strip is compressed.",
        "Report in results/capstan/report.html.",
        "Results in results/capstan. Next: anmstrip render results/capstan",
    ]


def test_a_warning_is_told_once(fakes: Fakes) -> None:
    """At the start if it is known there, unless nothing is told before the end."""
    both = "It is wide.", "The strip is compressed."
    fakes.put_run(warnings=both, forewarned=both[:1])
    for quiet in ([], ["--quiet"]):
        result = typed("run", CAPSTAN, *quiet)
        before = [line for line in result.stderr.splitlines() if line.startswith("Warning: ")]
        after = [line for line in result.stdout.splitlines() if line.startswith("Warning: ")]
        assert before == ([] if quiet else ["Warning: It is wide."])
        assert before + after == [f"Warning: {line}" for line in both]


def test_run_is_given_what_was_typed(fakes: Fakes) -> None:
    fakes.put_run()
    result = typed("run", CAPSTAN, "-o", "there", "--set", "rollers.r1.radius=0.3", "--resume")
    ((_, _, run),) = fakes.calls
    assert result.exit_code == 0
    assert (run.directory, run.resume) == (Path("there"), True)
    assert run.scene.rollers[0].radius == 0.3


def test_what_comes_next_is_typed_as_a_shell_takes_it(fakes: Fakes) -> None:
    fakes.put_run()
    assert "render 'my runs/one'" in typed("run", CAPSTAN, "-o", "my runs/one").stdout
    assert "run 'a roller.toml'" in typed("new", "roller", "-o", "a roller.toml").stdout


def test_run_that_stops_early(fakes: Fakes) -> None:
    fakes.put_run(done=False, message="The path turned back at t = 0.4 s.")
    result = typed("run", CAPSTAN, "--quiet")
    assert result.exit_code == 1
    assert "turned back" in result.stdout
    assert "results/capstan" in result.stdout


@pytest.mark.parametrize("ending", [{"end": KeyboardInterrupt()}, {"early": True}])
def test_run_that_is_interrupted(fakes: Fakes, ending: dict[str, Any]) -> None:
    fakes.put_run(**ending)
    result = typed("run", CAPSTAN)
    ((_, _, run),) = fakes.calls
    assert (result.exit_code, run.saved) == (1, [True])
    assert "Interrupted" in result.stdout
    assert "--resume" in result.stdout and "Warning: The strip is compressed." in result.stdout


@pytest.mark.parametrize("end", [None, SystemError("returned a result with an exception set")])
@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM])
def test_run_whose_interruption_is_swallowed_or_becomes_another_error(
    fakes: Fakes, sign: int, end: Exception | None
) -> None:
    """As in compiled code that calls Python."""
    fakes.put_run(signal=sign, end=end)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        result = typed("run", CAPSTAN)
    finally:
        signal.signal(signal.SIGINT, before)
    ((_, _, run),) = fakes.calls
    assert (result.exit_code, run.saved) == (1, [True])
    assert "Interrupted" in result.stdout


def test_run_on_a_full_disk(fakes: Fakes) -> None:
    fakes.put_run(end=OSError(28, "No space left on device", "strip_3.vtu"))
    result = typed("run", CAPSTAN)
    assert result.exit_code == 1
    assert "strip_3.vtu: No space left on device" in result.stderr


def test_run_refused_by_its_mesh(fakes: Fakes) -> None:
    fakes.put("anmstrip.driver.scene", "Run", MISTAKE)
    result = typed("run", CAPSTAN)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == f"{MISTAKE}\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "none.toml"], "none.toml"),
        (["run", CAPSTAN, "--set", "strip.widht=1"], "width (the nearest known one)"),
        (["run", CAPSTAN, "--set", "strip.width=-1", "--set", "x"], "above 0 (m)"),
        (["run", CAPSTAN, "--set", "strip.width=-1", "--set", "x"], "KEY=VALUE"),
        (["run", CAPSTAN, "-o", "a_file"], "a_file"),
        (["run", CAPSTAN, "--fast"], "--fast"),
        (["run"], "SCENE.toml"),
        (["explain", "none.toml"], "none.toml"),
        (["explain", CAPSTAN, "--set", "strip.widht=1"], "width (the nearest known one)"),
        (["case", "pressed-plane", "--set", "f=a", "--set", "q"], "--set f=a"),
        (["case", "pressed-plane", "--set", "f=a", "--set", "q"], "--set q"),
        (["case", "pressed-plane", "--set", "f=nan"], "a finite number"),
        (["case", "pressed-plane", "--order", "1"], "--order"),
        (["case", "pressed-plane", "--scheme", "euler"], "taylor"),
        (["draw"], "draw"),
    ],
)
def test_wrong_input_is_told_and_nothing_is_written(
    fakes: Fakes, tmp_path: Path, arguments: list[str], words: str
) -> None:
    (tmp_path / "a_file").touch()
    fakes.put_run()
    fakes.put("anmstrip.driver.explain", "explain", "")
    fakes.put("anmstrip.paper.cases", "run_case", "")
    result = typed(*arguments)
    assert (result.exit_code, result.stdout, fakes.calls) == (2, "", [])
    assert words in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a_file"]


def test_explain(fakes: Fakes) -> None:
    fakes.put(
        "anmstrip.driver.explain", "explain", lambda scene: f"a strip of {scene.strip.width} m"
    )
    result = typed("explain", CAPSTAN)
    assert (result.exit_code, result.stdout) == (0, "a strip of 1.0 m\n")
    result = typed("explain", CAPSTAN, "--set", "strip.width=0.5")
    assert (result.exit_code, result.stdout) == (0, "a strip of 0.5 m\n")


def test_case(fakes: Fakes) -> None:
    fakes.put("anmstrip.paper.cases", "run_case", FakeReport("a table"))
    result = typed("case", "moving-plane", "--order", "15", "--set", "f=0.4", "--set", "V_c=2")
    assert (result.exit_code, result.stdout) == (0, "a table\n")
    ((given, named, _),) = fakes.calls
    assert given == ("moving-plane",)
    assert named == {
        "order": 15,
        "tolerance": 1e-4,
        "settings": {"f": 0.4, "V_c": 2.0},
        "scheme": "taylor",
        "directory": Path("results/moving-plane"),
    }


def test_case_that_stops_early(fakes: Fakes) -> None:
    fakes.put("anmstrip.paper.cases", "run_case", StoppedReport("half a table"))
    result = typed("case", "moving-plane")
    assert (result.exit_code, result.stdout) == (1, "half a table\n")


def test_unknown_case(fakes: Fakes) -> None:
    fakes.put("anmstrip.paper.cases", "run_case", MISTAKE)
    assert typed("case", "moving-plain").exit_code == 2


def test_render(fakes: Fakes) -> None:
    fakes.put("anmstrip.pictures.render", "render", [Path("a/one.png"), Path("a/two.png")])
    result = typed("render", "a", "--field", "gap", "--movie", "--vector", "svg")
    assert (result.exit_code, result.stdout) == (0, "a/one.png\na/two.png\n")
    ((given, named, _),) = fakes.calls
    assert (given, named) == ((Path("a"),), {"field": "gap", "movie": True, "vector": "svg"})


def test_unknown_field(fakes: Fakes) -> None:
    fakes.put("anmstrip.pictures.render", "render", MISTAKE)
    assert typed("render", "a").exit_code == 2


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    stream = Terminal()
    steps = [step_at(1), step_at(3)]
    assert list(show_progress(steps, describe_step, stream)) == steps
    assert "turn, t = 0.6 of 0.6 s, 6 tangents, tension ratio 1.2500" in stream.getvalue()


def test_progress_elsewhere_is_a_line_now_and_then() -> None:
    stream = io.StringIO()
    steps = [step_at(1), step_at(2, ratio=None), step_at(3)]
    assert list(show_progress(steps, describe_step, stream, interval=0.0)) == steps
    first, second, _ = stream.getvalue().splitlines()
    assert first.startswith("turn, t = 0.2 of 0.6 s, 2 tangents, tension ratio 1.2500, ")
    assert "ratio" not in second
    stream = io.StringIO()
    assert list(show_progress(steps, describe_step, stream, interval=1e9)) == steps
    assert not stream.getvalue()


@pytest.mark.parametrize("stream", [io.StringIO(), Terminal()])
def test_progress_tells_what_else_takes_time(
    stream: io.StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is logged while steps are made, and not afterwards."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    log = logging.getLogger("anmstrip.driver.budget")

    def steps() -> Iterator[Any]:
        yield step_at(1)
        log.info("estimating the errors by the mesh")
        yield step_at(3)

    assert len(list(show_progress(steps(), describe_step, stream, interval=0.0))) == 2
    assert "estimating the errors by the mesh" in stream.getvalue()
    assert not logging.getLogger("anmstrip").handlers
    assert not log.isEnabledFor(logging.INFO)


def test_the_readme_shows_a_scene_that_is_right(tmp_path: Path) -> None:
    readme = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
    path = tmp_path / "scene.toml"
    path.write_text(readme.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    result = typed("explain", str(path))
    assert (result.exit_code, result.stderr) == (0, "")
    assert "Warning" not in result.stdout
    assert "These numbers justify: section, as chosen" in result.stdout


@pytest.mark.parametrize("kinematics", ["section", "plate"])
def test_what_a_level_does_not_have(tmp_path: Path, kinematics: str) -> None:
    """The sides of a section, the tension of a plate: told by run and explain, not raised."""
    lines = {
        "section": '[edges.left]\nfixed = ["z"]\n',
        "plate": '[[stages]]\nname = "pull"\nduration = 1\nexit.tension = 1e4\n',
    }
    tables = "[strip]\nlength = 4.0\nwidth = 1.0\nthickness = 1e-3\ncells = [4, 2]\n"
    tables += f'kinematics = "{kinematics}"\n[material]\nyoung = 2e11\npoisson = 0.3\n'
    tables += '[[stages]]\nname = "rest"\nduration = 1\n'
    path = tmp_path / "scene.toml"
    path.write_text(tables + lines[kinematics], encoding="utf-8")
    for command in (["explain"], ["run", "-o", str(tmp_path / "out")]):
        result = typed(*command, str(path))
        assert result.exit_code == 2
        assert kinematics in result.stderr
    assert not (tmp_path / "out").exists()


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys, anmstrip.cli as c\n"
        "try: c.main(['--help'])\n"
        "except SystemExit as end: assert end.code == 0\n"
        "print('heavy:', sorted({'numpy', 'scipy', 'skfem', 'pyvista'} & set(sys.modules)))"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "case" in ended.stdout
    assert ended.stdout.endswith("heavy: []\n")


@pytest.mark.parametrize("given", [{}, {"OMP_NUM_THREADS": "3"}])
def test_blas_gets_one_thread_unless_told_otherwise(monkeypatch, given: dict[str, str]) -> None:
    environment = dict(given)
    monkeypatch.setattr("os.environ", environment)
    assert CliRunner().invoke(main, ["schema"]).exit_code == 0
    assert environment == (given or dict.fromkeys(THREAD_VARIABLES, "1"))


REPEATED = """
import resource
import numpy as np
from anmstrip.cli import keep_memory

def page_faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        np.ones((2, 2**19)), np.ones(2**20)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

page_faults(), keep_memory(), page_faults()
print(page_faults())
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="another C library")
def test_memory_of_arrays_is_kept_for_the_next_ones() -> None:
    """Every page of arrays of 8 MB would be given back and asked for: 2048 times 20."""
    shown = subprocess.run(
        [sys.executable, "-c", REPEATED], capture_output=True, text=True, check=True
    )
    assert int(shown.stdout) < 1000


def test_python_runs_the_package_as_the_command() -> None:
    asked = [sys.executable, "-m", "anmstrip", "--version"]
    assert "anmstrip" in subprocess.run(asked, capture_output=True, text=True, check=True).stdout
