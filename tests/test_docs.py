"""What the documentation says can be typed: links, commands, scenes and Python."""

from __future__ import annotations

import ast
import doctest
import json
import re
import shlex
import sys
import tomllib
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, get_args
from urllib.parse import quote

import numpy as np
import pytest
from click.testing import CliRunner
from pydantic import BaseModel

from anmstrip import Scene
from anmstrip.cli import main
from anmstrip.scene.schema import SceneSpec
from browser import shown

ROOT = Path(__file__).parent.parent
TUTORIAL = sorted((ROOT / "docs" / "tutorial").glob("*.md"))
STUDIES = sorted((ROOT / "docs" / "studies").glob("*.md"))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(language: str) -> Iterator[Any]:
    """Yield the fenced blocks of all pages in a language, with their places as names."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for found in FENCE.finditer(text):
            if found[1] == language:
                line = text.count("\n", 0, found.start()) + 1
                yield pytest.param(found[2], id=f"{page.name}:{line}")


def without_blocks(text: str) -> str:
    """Return a page without its fenced blocks."""
    return FENCE.sub("", text)


def merged(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables with the keys of others put in, table by table."""
    both = {k: merged(base[k], v) for k, v in change.items() if isinstance(base.get(k), dict)}
    return {**base, **change, **both}


@pytest.mark.slow
@pytest.mark.parametrize("page", TUTORIAL, ids=lambda page: page.stem)
def test_tutorial_runs_as_printed(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files are saved under the names that the text says before them; all else is typed."""
    monkeypatch.chdir(tmp_path)
    for other in TUTORIAL[: TUTORIAL.index(page) + 1]:
        text = other.read_text(encoding="utf-8")
        for found in FENCE.finditer(text):
            if found[1] == "toml":
                name = re.findall(r"`(\w+\.toml)`", text[: found.start()])[-1]
                Path(name).write_text(found[2], encoding="utf-8")
    for found in FENCE.finditer(page.read_text(encoding="utf-8")):
        if found[1] == "console":
            for line in found[2].splitlines():
                done = CliRunner().invoke(main, shlex.split(line)[1:])
                assert done.exit_code == 0, (line, done.output)
        elif found[1] == "python":
            exec(compile(found[2], page.name, "exec"), {"__name__": "tutorial"})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["README.md", "docs/quickstart.md", "docs/howto.md"])
def test_first_pages_run_as_printed(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their Python, and the commands of a scene of one's own; CI pastes the installation."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.setattr(
        "matplotlib.pyplot.plot", lambda x, y: np.testing.assert_equal(len(x), len(y))
    )
    if name == "docs/howto.md":  # has run what the quickstart says
        coarse = ["strip.refined=0.1", 'strip.kinematics="section"']
        for _ in Scene.load("examples/capstan.toml", coarse).run("results/capstan"):
            pass
    for language, text in FENCE.findall((ROOT / name).read_text(encoding="utf-8")):
        typed = text.partition("activate\n")[2] if language == "console" else ""
        for line in typed.splitlines():
            done = CliRunner().invoke(main, shlex.split(line)[1:])
            assert done.exit_code == 0, (line, done.output)
        if language == "python":
            exec(compile(text, name, "exec"), {"__name__": "first"})


@pytest.mark.slow
def test_the_table_of_rollers_is_printed_as_on_the_page_of_results(tmp_path: Path) -> None:
    """To the last digit but one, which the machine may change."""
    done = CliRunner().invoke(
        main, ["run", str(ROOT / "examples/capstan.toml"), "-o", str(tmp_path)]
    )
    page = (ROOT / "docs/results.md").read_text(encoding="utf-8")
    (shown,) = (text for _, text in FENCE.findall(page) if text.startswith("Rollers at"))
    printed = done.output[done.output.index("Rollers at") :].splitlines()
    for line, given in zip(shown.splitlines(), printed, strict=False):
        for word, other in zip(line.split(), given.split(), strict=True):
            number = re.fullmatch(r"-?[\d.]+", word)
            assert float(other) == pytest.approx(float(word), rel=2e-3) if number else other == word


CLAIM = re.compile(r"^def (test_\w+)\([^)]*\bclaim\b", re.MULTILINE)


def test_every_claim_has_its_row() -> None:
    """Tests that claim, and those named in docs/claims.jsonl, are the same."""
    claiming = {
        f"{path.relative_to(ROOT).as_posix()}::{name}"
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in CLAIM.findall(path.read_text(encoding="utf-8"))
    }
    lines = (ROOT / "docs" / "claims.jsonl").read_text(encoding="utf-8").splitlines()
    written = [json.loads(line) for line in lines]
    assert {claim["test"].partition("[")[0] for claim in written} == claiming
    for claim in written:
        assert 0.0 <= claim["error"] <= claim["bound"], claim


FIGURES = re.compile(
    r"`((?:python|pytest) [^`]*?(?:\.py|tests/[\w/]+)|anmstrip case [a-z-]+)(?=[ `])"
)
"""Commands beside figures; of a pytest of several files the first."""


def figures(page: Path) -> set[str]:
    """Return the commands that stand beside the figures of a page."""
    found = FIGURES.findall(without_blocks(page.read_text(encoding="utf-8")))
    return {command for command in found if "NAME" not in command and "/all.py" not in command}


@pytest.mark.parametrize("page", [*PAGES, *TUTORIAL], ids=lambda page: page.name)
def test_figures_have_their_rows(page: Path) -> None:
    """What stands beside a figure on any page is named on the page of verification."""
    rows = {command.split()[-1] for command in figures(ROOT / "docs" / "verification.md")}
    assert {command.split()[-1] for command in figures(page)} <= rows
    assert page != ROOT / "README.md" or len(figures(page)) >= 4


TABLE = re.compile(r"^\|(.*\| *command) *\|\n\|[-|]+\|\n((?:\|.*\|\n)+)", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_rows_of_figures_have_their_commands(page: Path) -> None:
    """In tables whose last column is the command: each row has one, and the test that it names."""
    for _, rows in TABLE.findall(without_blocks(page.read_text(encoding="utf-8"))):
        for row in rows.splitlines():
            (command,) = FIGURES.findall(row.rpartition(" | ")[2])
            path = ROOT / command.split()[-1]
            if command.startswith("pytest") and path.is_file():
                marked = "mark.slow" in path.read_text(encoding="utf-8")
                assert marked or "-m slow" not in command, row


@pytest.mark.parametrize("page", [*PAGES, *TUTORIAL], ids=lambda page: page.name)
def test_figures_have_their_tests(page: Path) -> None:
    """The command beside them is a test, or a script or case that a test runs."""
    tests = [path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py")]
    for command in figures(page):
        named = command.split()[-1]
        assert command.startswith("anmstrip") or (ROOT / named).exists(), command
        word = re.compile(rf"\b{Path(named).stem}\b")
        assert command.startswith("pytest") or any(map(word.search, tests)), command


def slugs(page: Path) -> set[str]:
    """Return the names under which the headings of a page can be linked to."""
    heads = re.findall(r"^#+ (.*)$", without_blocks(page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", head).strip().lower().replace(" ", "-") for head in heads}


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


@pytest.mark.parametrize("page", [*PAGES, *TUTORIAL, *STUDIES], ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    """Relative links, their headings, and files that are named in code spans with a directory."""
    text = without_blocks(page.read_text(encoding="utf-8"))
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        file, _, head = link.partition("#")
        if "://" not in link:
            assert (target := page.parent / file if file else page).exists(), link
            assert not head or head in slugs(target), link
    for name in re.findall(r"\b((?:examples|tests|src|meshes|docs)/[\w./-]*\.\w+)", text):
        assert "NAME" in name or (ROOT / name).exists(), name


BASE = """
[strip]
kinematics = "shell"
width = 1.0
thickness = 1.0e-3
cells = [40, 2]
[material]
young = 2.0e11
poisson = 0.3
density = 7850.0
[contact]
[friction]
coefficient = 0.3
speed = 1.0
[threading]
tension = 1.0e4
entry = [-2.0, 0.0, -1.0]
exit = [2.0, 0.0, -1.0]
[[rollers]]
radius = 0.5
centre = [0.0, 0.0, -0.5]
wrap = "over"
[edges.entry]
fixed = ["x", "z"]
[[stages]]
duration = 1.0
"""
"""A scene that a part of one, shown alone, is put into."""


@pytest.mark.parametrize("text", [*blocks("toml")])
def test_scene_is_accepted(text: str) -> None:
    """Whole scenes as they stand; parts of one within another scene."""
    tables = tomllib.loads(text)
    if not {"strip", "material", "stages"} <= tables.keys():
        tables = merged(tomllib.loads(BASE), tables)
    Scene.from_tables(tables, ROOT / "examples" / "scene.toml")


@pytest.mark.parametrize("text", [*blocks("python")])
def test_python_runs(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Imports are there; a block that asserts what comes out is run."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("anmstrip"):
            source = import_module(str(node.module))
            for alias in node.names:
                assert hasattr(source, alias.name), f"{node.module}.{alias.name}"
    if any(isinstance(node, ast.Assert) for node in ast.walk(tree)):
        monkeypatch.chdir(tmp_path)
        module = ModuleType("documentation")  # dataclasses look their module up
        monkeypatch.setitem(sys.modules, module.__name__, module)
        exec(compile(tree, "<documentation>", "exec"), module.__dict__)


@pytest.mark.parametrize("page", [*PAGES, *TUTORIAL], ids=lambda page: page.name)
def test_commands_exist(page: Path) -> None:
    """Commands of the program, and the options that follow them in the same span of code."""
    for command, rest in re.findall(r"anmstrip ([a-z]+)\b([^`\n]*)", page.read_text("utf-8")):
        if command not in main.commands:
            assert not rest.lstrip().startswith(("-", "[", "SCENE")), f"anmstrip {command}"
            continue
        known = {name for option in main.commands[command].params for name in option.opts}
        for option in re.findall(r"(?<![\w-])(--?[a-z][a-z-]*)", rest):
            assert option in known, f"anmstrip {command} {option}"


def test_every_command_and_option_is_in_the_readme() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for name, command in main.commands.items():
        (row,) = re.findall(rf"^\| `anmstrip {name}[ `].*$", text, re.MULTILINE)
        for parameter in command.params:
            if parameter.param_type_name == "option":
                assert any(option in row for option in parameter.opts), (name, parameter.opts)


def tables_of(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """Yield a model and those of the tables in it."""
    yield model
    for field in model.model_fields.values():
        for part in (field.annotation, *get_args(field.annotation)):
            for inner in (part, *get_args(part)):
                if isinstance(inner, type) and issubclass(inner, BaseModel):
                    yield from tables_of(inner)


DOCTESTED = [
    ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
    for path in sorted((ROOT / "src").rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]
"""Modules with examples in their docstrings."""


@pytest.mark.parametrize("name", DOCTESTED)
def test_examples_in_docstrings_hold(name: str) -> None:
    tried = doctest.testmod(import_module(name))
    assert tried.attempted
    assert not tried.failed


def test_every_key_of_a_scene_is_described() -> None:
    text = without_blocks((ROOT / "docs" / "scenes.md").read_text(encoding="utf-8"))
    words = set(re.findall(r"[a-z_]+", " ".join(re.findall(r"`([^`]+)`", text))))
    keys = {key for model in tables_of(SceneSpec) for key in model.model_fields}
    assert {"stiffness", "rounding", "release", "times"} <= keys
    assert keys <= words, keys - words


def test_files_beside_the_package_say_the_same_as_it() -> None:
    """The version in all of them, and the packages that conda installs."""
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project, backend = config["project"], config["build-system"]["requires"]
    recipe = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    assert f'version: "{project["version"]}"' in recipe
    assert f"version: {project['version']}\n" in (ROOT / "CITATION.cff").read_text("utf-8")
    ((command, function),) = project["scripts"].items()
    assert f"- {command} = {function}\n" in recipe
    needed = f"python{project['requires-python']}"
    for table, names in (("host", [*backend, "pip"]), ("run", project["dependencies"])):
        listed = re.search(rf"  {table}:\n((?:    - .*\n)+)", recipe)
        assert listed is not None
        conda = re.findall(r"- (.*)", listed[1].replace("matplotlib-base", "matplotlib"))
        assert sorted(conda) == sorted(name.replace(">=", " >=") for name in [needed, *names])


@pytest.mark.slow
def test_conda_recipe_renders() -> None:
    """By rattler-build itself, which refuses what its schema does not know; nothing is built."""
    rattler_build = pytest.importorskip("rattler_build")
    recipe = rattler_build.Stage0Recipe.from_file(str(ROOT / "conda" / "recipe.yaml"))
    (rendered,) = recipe.render()
    found = rendered.recipe.to_dict()
    assert found["package"]["name"] == "anmstrip"
    assert found["build"]["noarch"] == "python"
    source = ROOT / "conda" / found["source"][0]["path"]
    assert (source / found["about"]["license_file"][0]).is_file()


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted((ROOT / "examples" / "notebooks").glob("*.ipynb")), ids=str)
def test_notebooks_run(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All cells in turn; a notebook is kept without what its cells printed."""
    monkeypatch.chdir(path.parent)
    monkeypatch.setattr(sys, "path", [*sys.path])
    module = ModuleType("notebook")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    cells = [c for c in json.loads(path.read_text("utf-8"))["cells"] if c["cell_type"] == "code"]
    assert any("assert " in "".join(cell["source"]) for cell in cells)
    for cell in cells:
        assert cell["outputs"] == []
        exec(compile("".join(cell["source"]), path.name, "exec"), module.__dict__)


QUESTIONS = {
    "yawed roller": ("howto", "Set a roller out of line"),
    "tension along the strip": ("howto", "Read the tension along the strip"),
    "history plot": ("howto", "Plot a history"),
    "tolerance": ("faq", "What is the tolerance?"),
    "own mesh": ("howto", "Use a mesh of your own"),
    "own law": ("howto", "Use a law of your own"),
    "signs": ("faq", "Which way is positive?"),
    "units": ("faq", "Which units?"),
    "converged?": ("faq", "Has it converged?"),
    "cite": ("faq", "How do I cite it?"),
}


@pytest.mark.parametrize("question", QUESTIONS)
def test_question_is_answered_a_click_from_the_first_page(question: str) -> None:
    page, head = QUESTIONS[question]
    assert f"({page}.md)" in (ROOT / "docs" / "index.md").read_text("utf-8")
    assert head in (ROOT / "docs" / f"{page}.md").read_text("utf-8")


@pytest.mark.parametrize("question", QUESTIONS)
def test_answer_has_the_words_of_the_question(question: str) -> None:
    """The search of the site returns the pages on which all words stand; so does the reader's."""
    page, head = QUESTIONS[question]
    text = without_blocks((ROOT / "docs" / f"{page}.md").read_text("utf-8"))
    answer = head + re.split(r"\n\n(?=## |\*\*)", text.partition(head)[2])[0]
    for word in re.findall(r"\w+", question):
        assert word == "the" or re.search(rf"\b{word}\b", answer, re.IGNORECASE), word


SEARCH = ROOT / "build" / "site" / "search.html"
"""Of the site as it was last built; CI builds it before the slow tests."""


@pytest.mark.slow
@pytest.mark.skipif(not SEARCH.is_file(), reason="sphinx-build -b html docs build/site comes first")
@pytest.mark.parametrize("question", QUESTIONS)
def test_question_is_answered_by_the_search_of_the_site(question: str, tmp_path: Path) -> None:
    page = shown(f"{SEARCH.as_uri()}?q={quote(question)}", tmp_path)
    results = page.partition(' class="search">')[2].partition("</ul>")[0]
    assert f'href="{QUESTIONS[question][0]}.html' in results
