"""What all tests share: claims, which are checked and written down for the documentation."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from claims import Claim

os.environ.setdefault("OMP_NUM_THREADS", "1")  # workers have a core each; children inherit it
os.fsync = lambda fd: None  # nothing here cuts the power, and a disk takes milliseconds each time


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that names the file of claims."""
    words = "append the claims that tests check to FILE, a line of JSON for each"
    parser.addoption("--claims", metavar="FILE", type=Path, help=words)


SMOKE = (
    *(
        "test_house.py",
        "driver/test_from_python.py",
        "scene/test_loading.py",
        "taylor/test_series.py",
    ),
    *("mechanics/test_foundation.py", "results/test_summary.py", "test_command_line.py"),
)
"""Files of the tests that ``pytest -m smoke`` runs: a little of everything, in half a minute."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of the files above."""
    for item in items:
        if item.path.as_posix().endswith(tuple(f"/tests/{name}" for name in SMOKE)):
            item.add_marker("smoke")


@pytest.fixture
def claim(request: pytest.FixtureRequest) -> Claim:
    """Check a value against an independent reference; with ``--claims`` also write it down.

    ``claim(quantity, value, expected, bound, reference)`` asserts that `value` differs from
    `expected` by at most the share `bound` of it (of 1 if it is 0).  `reference` says where the
    expected value comes from.  The table on the verification page is made of these lines.
    """
    target, test = request.config.getoption("--claims"), request.node.nodeid

    def check(
        quantity: str, value: float, expected: float, bound: float, reference: str = ""
    ) -> None:
        error = abs(float(value) - expected) / (abs(expected) or 1.0)
        if target is not None:
            told = {"quantity": quantity, "reference": reference, "expected": float(expected)}
            told |= {"value": float(value), "error": error, "bound": bound, "test": test}
            with target.open("a", encoding="utf-8") as file:  # workers append whole lines
                file.write(json.dumps(told, ensure_ascii=False) + "\n")
        assert error <= bound, f"{quantity}: {value} instead of {expected} ({reference})"

    return check
