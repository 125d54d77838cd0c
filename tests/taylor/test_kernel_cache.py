"""Where compiled kernels cannot be kept, one line says so, and the numbers are the same."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

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

NOWHERE = "from anmstrip.taylor import compiled; compiled.directories = lambda: []\n"

FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"


def ran(directory: Path, before: str = "") -> tuple[list[str], list[str]]:
    """Lines of output and of errors of a process that calls a kernel."""
    ended = subprocess.run(
        [sys.executable, "-c", before + KERNEL],
        env={**os.environ, "NUMBA_CACHE_DIR": str(directory)},
        capture_output=True,
        text=True,
        check=True,
    )
    return ended.stdout.splitlines(), ended.stderr.splitlines()


@pytest.mark.parametrize("before", [NOWHERE, FULL])
def test_a_frozen_home_or_a_full_disk_takes_no_kernels(tmp_path: Path, before: str) -> None:
    lines, errors = ran(tmp_path, before)
    assert lines == [f"{PRODUCT} True"]
    assert len(errors) == 1
    assert errors[0].startswith("Compiled kernels cannot be kept")
    assert "NUMBA_CACHE_DIR" in errors[0]
    assert not list(tmp_path.rglob("*.o"))


def test_damaged_and_lost_files_are_made_again(tmp_path: Path) -> None:
    """Only then is numba imported."""
    assert ran(tmp_path) == ([f"{PRODUCT} True"], [])
    assert ran(tmp_path) == ([f"{PRODUCT} False"], [])
    (kept,) = tmp_path.rglob("*.o")
    kept.write_bytes(kept.read_bytes()[:40])
    assert ran(tmp_path) == ([f"{PRODUCT} True"], [])
    assert ran(tmp_path) == ([f"{PRODUCT} False"], [])
    kept.unlink()
    assert ran(tmp_path) == ([f"{PRODUCT} True"], [])
