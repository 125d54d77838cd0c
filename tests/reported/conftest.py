"""Runs that the tests of reported numbers share; each is made once."""

from __future__ import annotations

from pathlib import Path

import pytest
import reported_scenes as scenes
from reported_files import Results, ran


def made(name: str, factory: pytest.TempPathFactory, *settings: str) -> Results:
    """Run one of the scenes to its end; every step is written unless it has times of its own."""
    directory: Path = factory.mktemp("runs") / name.lower()
    directory.mkdir()
    if name != "LIFTED":
        settings = ("output.every=1", *settings)
    results = ran(getattr(scenes, name), directory, *settings, options=("--quiet",))
    assert results.exit_code == 0, results.printed + results.progress
    return results


@pytest.fixture(scope="session")
def turning(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return made("TURNING", tmp_path_factory)


@pytest.fixture(scope="session")
def shell(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return made("SHELL", tmp_path_factory)


@pytest.fixture(scope="session")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return made("PLATE", tmp_path_factory)


@pytest.fixture(scope="session")
def lifted(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return made("LIFTED", tmp_path_factory)


@pytest.fixture(scope="session")
def fed(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return made("FED", tmp_path_factory)


@pytest.fixture(scope="session")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return made("PRESSED", tmp_path_factory)


@pytest.fixture(scope="session")
def thin(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return made("THIN", tmp_path_factory)
