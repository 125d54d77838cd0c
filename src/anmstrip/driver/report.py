"""What a run says at its end: rollers, ends, estimated errors and warnings."""

from __future__ import annotations

from collections.abc import Mapping
from io import StringIO
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from anmstrip.driver.explain import plain_table
from anmstrip.results.files import error_rows
from anmstrip.results.plastic import RollerBend, YieldedStrip

if TYPE_CHECKING:
    from rich.table import Table

    from anmstrip.driver.run import Run
    from anmstrip.results.state import State


def report(run: Run) -> str:
    """Describe the last state of a run by roller, its ends, what it may be wrong by, and warn."""
    stream = StringIO()
    console = Console(file=stream, width=100, no_color=True, highlight=False)
    state = run.state
    if state is not None:
        if state.rollers:
            console.print(roller_table(state))
            if (layers := YieldedStrip.of(state)) is not None:
                console.print(bend_table(layers.rollers()))
        console.print(tensions(state), markup=False)
        console.print(error_table(run))
    for warning in run.warnings:
        console.print(f"Warning: {warning}", markup=False)
    return stream.getvalue().rstrip()


def roller_table(state: State) -> Table:
    """Return what every roller does, in units that stand in the heads of the columns."""
    heads = ("wrap\n(°)", "T in\n(N/m)", "T out\n(N/m)", "normal\n(N)", "torque\n(N m)")
    more = ("slip\n(m/s)", "friction\nused", "line load\non (N/m)", "and off\n(N/m)")
    table = plain_table(f"Rollers at t = {state.time:.6g} s", "\nroller", *heads, *more)
    for name, r in state.rollers.items():
        used = "–" if r.capacity_used is None else f"{100.0 * r.capacity_used:.3g} %"
        values = (np.degrees(r.wrap), r.tension_in, r.tension_out, r.normal_force, r.torque)
        loads = (f"{load:.3g}" for load in (r.line_load_in, r.line_load_out))
        table.add_row(name, *(f"{v:.4g}" for v in values), f"{r.max_slip:.3g}", used, *loads)
    return table


def bend_table(bends: Mapping[str, RollerBend]) -> Table:
    """Return the sharpest bend at every roller of strip that can yield, and what it leaves."""
    heads = ("curvature\n(1/m)", "moment\n(N)", "plastic\nshare", "left\n(1/m)")
    more = ("elongation\n(1)", "power\n(W)")
    table = plain_table(
        "Bends, and what they leave of strip that is unloaded", "\nroller", *heads, *more
    )
    for name, b in bends.items():
        share, values = f"{100.0 * b.plastic_share:.3g} %", (b.elongation, b.yield_power)
        bent = (f"{v:.4g}" for v in (b.curvature, b.moment))
        table.add_row(
            name, *bent, share, f"{b.residual_curvature:.4g}", *(f"{v:.4g}" for v in values)
        )
    return table


def tensions(state: State) -> str:
    """Return the tensions of both ends in a sentence."""
    ends = [n for n in ("entry", "exit") if n in state.plan.model.strip.edges]
    told = (f"{state.tension(name):.6g} N/m at the {name}" for name in ends)
    return f"Tension {' and '.join(told)}."


def error_table(run: Run) -> Table:
    """Return the estimated errors of the last state, by what makes them."""
    heads = ("tension\n(N/m)", "roller's force\n(N)", "position\n(m)")
    table = plain_table("Estimated errors, the largest of each kind", "\nof", *heads)
    for row in error_rows(run.errors()):
        table.add_row(*row)
    return table
