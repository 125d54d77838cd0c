"""Where compiled kernels cannot be kept, one line says so, and the numbers are the same."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

from anmstrip.taylor.compiled import directories

KERNEL = """
import sys
import numpy as np
from anmstrip.taylor.compiled import addresses, script, table_of
from anmstrip.taylor.tape import LIFT
starts, columns = np.array([0, 2, 3], dtype=np.int32), np.array([0, 1, 1], dtype=np.int32)
places, x, found = np.array([1, 0], dtype=np.int32), np.array([5.0, 7.0]), np.zeros(2)
arrays = starts, columns, np.array([1.0, 2.0, 3.0]), places, x, found
script(table_of([[LIFT, *addresses(*arrays), 2, 1, 1]]))(0)
print(found.tolist(), "numba" in sys.modules)
"""

PRODUCT = [3.0 * 7.0, 1.0 * 5.0 + 2.0 * 7.0]
"""((1, 2), (0, 3)) times (5, 7), the rows in reverse."""

NOWHERE = "compiled.directories = lambda: []\n"

FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"


def ran(directory: Path, before: str = "") -> tuple[list[str], list[str]]:
    """Lines of output and of errors of a process that calls a kernel."""
    ended = subprocess.run(
        [sys.executable, "-c", f"from anmstrip.taylor import compiled\n{before}{KERNEL}"],
        env={**os.environ, "NUMBA_CACHE_DIR": str(directory)},
        capture_output=True,
        text=True,
        check=True,
    )
    return ended.stdout.splitlines(), ended.stderr.splitlines()


SAVE = """
read = compiled.machine_code
def saved(*given):
    open({0!r}, "wb").write(code := read(*given))
    return code
compiled.machine_code = saved
"""
"""Saves the code that is used."""

MADE = "compiled.portable_code = lambda machine: print('made') or open({0!r}, 'rb').read()\n"
"""Has such code in the place of compiling, and says so."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What takes the place of compiling, by code that was compiled for all tests."""
    code = str(tmp_path_factory.mktemp("kernels") / "code")
    (line,), _ = ran(directories()[0], SAVE.format(code))
    assert line.startswith(str(PRODUCT))
    return MADE.format(code)


@pytest.mark.slow
def test_kernels_are_compiled_once(tmp_path: Path) -> None:
    """Only then is numba imported."""
    assert ran(tmp_path) == ([f"{PRODUCT} True"], [])
    assert ran(tmp_path) == ([f"{PRODUCT} False"], [])


@pytest.mark.parametrize("before", [NOWHERE, FULL], ids=["frozen", "full"])
def test_a_frozen_home_or_a_full_disk_takes_no_kernels(
    tmp_path: Path, made: str, before: str
) -> None:
    lines, errors = ran(tmp_path, made + before)
    assert lines == ["made", f"{PRODUCT} False"]
    assert len(errors) == 1
    assert errors[0].startswith("Compiled kernels cannot be kept")
    assert "NUMBA_CACHE_DIR" in errors[0]
    assert not list(tmp_path.rglob("*.o"))


def test_damaged_and_lost_files_are_made_again(tmp_path: Path, made: str) -> None:
    """Only then."""
    fresh, kept = ["made", f"{PRODUCT} False"], [f"{PRODUCT} False"]
    assert ran(tmp_path, made) == (fresh, [])
    assert ran(tmp_path, made) == (kept, [])
    (file,) = tmp_path.rglob("*.o")
    file.write_bytes(file.read_bytes()[:40])
    assert ran(tmp_path, made) == (fresh, [])
    assert ran(tmp_path, made) == (kept, [])
    file.unlink()
    assert ran(tmp_path, made) == (fresh, [])
