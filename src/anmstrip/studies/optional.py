"""Other people's programs, which a study uses where they are installed."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec


def installed(module: str) -> bool:
    """Whether a module can be imported."""
    return find_spec(module) is not None


def left_out(modules: Iterable[str]) -> str:
    """One line about those that are not installed, empty if all are."""
    missing = ", ".join(module for module in modules if not installed(module))
    return f"Left out, not installed: {missing} (pip install 'anmstrip[peers]')." if missing else ""
