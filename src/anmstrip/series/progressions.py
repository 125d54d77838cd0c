"""Geometric progressions in the orders of a branch, and what is left without them.

Close to a bifurcation the tangent is nearly singular in the direction of the critical mode.
Round-off, and imbalances within the tolerance, are answered by a change with a pole at the
bifurcation, of which the orders u_k ~ c φ / a_c^k outgrow those of the path.  The path itself has
no singularity there: without the progression its series holds on, and goes straight through.
Sixteen digits lengthen a step by 10^(16/N) at most, which is enough to get past.

Source: Cochelin & Médale, *Power series analysis as a major breakthrough to improve the
efficiency of asymptotic numerical method in the vicinity of bifurcations*, J. Comput. Phys. 236
(2013).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .expansion import Equations, inner, size
from .path import Branch

LOOKED_AT = 4
"""Last orders that must be parallel, and in one ratio."""

ALIKE = 1e-3
"""Deviation from a progression, relative, that is allowed."""

FAINT = 1e-5
"""Share of the first order up to which a progression is an answer to round-off."""


def progression(equations: Equations, branch: Branch) -> float | None:
    """Ratio a_c of the last orders, signed, if they are a progression that began faintly."""
    last, count = branch.u[-1], LOOKED_AT
    norm = inner(equations, last, last)
    if branch.order < 2 * count or not 0.0 < norm < np.inf:
        return None
    shares = [inner(equations, u, last) / norm for u in branch.u[-2 : -count - 1 : -1]]
    ratio = shares[0]
    if ratio == 0.0:
        return None
    for j, (share, u) in enumerate(zip(shares, branch.u[-2 : -count - 1 : -1], strict=True)):
        bent = size(equations, u - share * last)
        if bent > ALIKE * size(equations, u) or abs(share / ratio ** (j + 1) - 1.0) > ALIKE:
            return None
    began = np.sqrt(norm) * abs(ratio) ** (branch.order - 1)
    return ratio if began < FAINT * size(equations, branch.u[1]) else None


def cleared(equations: Equations, branch: Branch) -> Branch:
    """The branch without its progression, one order less; itself if there is none."""
    ratio = progression(equations, branch)
    if ratio is None:
        return branch
    n = branch.order
    shares = ratio ** np.arange(n - 1.0, 0.0, -1.0)
    u, control = branch.u[:n].copy(), branch.control[:n].copy()
    u[1:] -= shares[:, None] * branch.u[n]
    control[1:] -= shares * branch.control[n]
    unit = branch.forces[0] / size(equations, branch.u[n - 1])
    forces = (unit * size(equations, u[-2]), unit * size(equations, u[-1]))
    return replace(branch, u=u, control=control, forces=forces)
