"""Where compiled kernels cannot be kept, one line says so, and the numbers are the same."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

KERNEL = """
import numpy as np
from anmstrip.taylor.kernels import cauchy
c, a = np.zeros(2), np.arange(6.0).reshape(3, 2)
cauchy(c, a, a, 2, 0, 3)
print(c.tolist(), sum(cauchy.stats.cache_hits.values()))
"""

SQUARES = [float(0 * 4 + 2 * 2 + 4 * 0), float(1 * 5 + 3 * 3 + 5 * 1)]
"""Σ a_j a_{2−j} for a = ((0, 1), (2, 3), (4, 5))."""

NOWHERE = "from numba.core import caching; caching.CacheImpl._locator_classes = []\n"

FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"


def ran(directory: Path, before: str = "") -> tuple[list[str], list[str]]:
    """Lines of output and of errors of a process that compiles a kernel."""
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
    assert lines == [f"{SQUARES} 0"]
    assert len(errors) == 1
    assert errors[0].startswith("Compiled kernels cannot be kept")
    assert "NUMBA_CACHE_DIR" in errors[0]


def test_damaged_and_lost_files_are_made_again(tmp_path: Path) -> None:
    assert ran(tmp_path) == ([f"{SQUARES} 0"], [])
    assert ran(tmp_path) == ([f"{SQUARES} 1"], [])
    for suffix in ("nbi", "nbc"):
        for path in tmp_path.rglob(f"*cauchy*.{suffix}"):
            path.write_bytes(path.read_bytes()[:40])
        assert ran(tmp_path) == ([f"{SQUARES} 0"], [])
        assert ran(tmp_path) == ([f"{SQUARES} 1"], [])
    for path in tmp_path.rglob("*cauchy*.nbc"):
        path.unlink()
    assert ran(tmp_path) == ([f"{SQUARES} 0"], [])
