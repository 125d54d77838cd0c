"""What tests claim: a value beside an independent reference."""

from __future__ import annotations

from typing import Protocol


class Claim(Protocol):
    """Check a value against a reference to a share of it; see the fixture ``claim``."""

    def __call__(
        self, quantity: str, value: float, expected: float, bound: float, reference: str
    ) -> None: ...
