"""What tests of stationary states share."""

from __future__ import annotations

from anmstrip.driver.sensitivities import StationaryTangent
from anmstrip.results.state import State


def corrected(state: State) -> State:
    """A stationary state, corrected to round-off by Newton's method."""
    for _ in range(3):
        tangent = StationaryTangent(state)
        full = state.full.copy()
        full[tangent.free] -= tangent.factors.solve(tangent.series.residual)
        state = State(state.plan, state.time, state.control, full, state.plan.transport(full, 1.0))
    return state
