"""Random steady lines settle where statics and the theory of creep say."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from random_lines import drawn, ending_of, varied


@pytest.mark.parametrize("seed", range(6))
def test_random_line_settles_by_statics_and_creep(seed: int) -> None:
    """Every tension to 0.5 % of the largest."""
    ending = ending_of(drawn(seed))
    assert ending.kind == "right", ending


@pytest.mark.slow
def test_five_hundred_random_lines_settle() -> None:
    """At least 99.5 % end right; the rest with a sentence."""
    endings = [ending_of(drawn(seed)) for seed in range(500)]
    kinds = Counter(ending.kind for ending in endings)
    assert kinds["right"] >= 498, [(s, e) for s, e in enumerate(endings) if e.kind != "right"]
    assert kinds["wrong"] == 0
    assert all(ending.words for ending in endings if ending.kind in ("refused", "stopped"))


@pytest.mark.parametrize("seed", [0, 4, 8, 10, 11, 25])
def test_varied_line_settles_by_statics_and_creep(seed: int, tmp_path: Path) -> None:
    """Idlers, given tensions, any contact, far origins, strip that is bent: to 2 %."""
    ending = ending_of(varied(seed, tmp_path))
    assert ending.kind == "right", ending


@pytest.mark.slow
def test_forty_varied_lines_settle(tmp_path: Path) -> None:
    """Shells and triangles among them."""
    lines = [varied(seed, tmp_path) for seed in range(40)]
    levels = Counter("mesh" in line.tables["strip"] for line in lines)
    assert levels[True] >= 2
    endings = [ending_of(line) for line in lines]
    wrong = [(seed, ending) for seed, ending in enumerate(endings) if ending.kind != "right"]
    assert not wrong


@pytest.mark.slow
def test_a_line_of_slack_edges_is_done_with_the_tensions_that_are_told() -> None:
    """On a coarse mesh, under half of its tension: pressed before a roller, it stops."""
    tables = varied(30547, Path()).tables
    tables["strip"]["finer"] = 0.4
    tables["threading"]["tension"] *= 0.5
    tables["stages"][0]["entry"]["tension"] *= 0.5
    endings, settings = [], list[str]()
    for _ in range(2):
        run = Run(Scene.from_tables(tables, "line.toml", settings))
        for _ in run:
            pass
        endings.append(run)
        settings = re.findall(r"--set (\S+)", run.message)
    assert "The strip is pressed at" in endings[0].message
    assert endings[1].outcome.done, endings[1].message
