"""Memory and files of a run grow no faster than its steps."""

from __future__ import annotations

from pathlib import Path

import pytest

from long_run import parts_of


@pytest.mark.slow
def test_a_long_run_takes_no_more_and_more(tmp_path: Path) -> None:
    """Of 100 000 steps: ``python tests/hard/long_run.py --steps 100000``."""
    parts = parts_of(500, tmp_path, every=25)
    assert [part.steps for part in parts] == [50 * k for k in range(1, 11)]
    early, late = parts[3], parts[-1]
    assert late.memory - early.memory < 2.0
    assert late.written == pytest.approx(early.written, rel=0.05)
