"""Dead loads: forces on edges, and weight."""

from __future__ import annotations

import numpy as np

from .effects import LoadEffect
from .strip import Edge, Strip


def edge_force(edge: Edge) -> LoadEffect:
    """Force per length of an edge (N/m), scaled by the control ``NAME.force``."""
    return LoadEffect(f"force on {edge.name}", f"{edge.name}.force", edge.load)


def weight(strip: Strip) -> LoadEffect:
    """Weight ρ t per area, scaled by the control ``gravity`` (m/s²)."""
    basis = strip.basis
    density = strip.material.density * strip.thickness
    load = np.zeros(strip.scalars)
    for dofs, field in zip(basis.element_dofs, basis.basis, strict=True):
        np.add.at(load, dofs, density * (np.asarray(field[0]) * basis.dx).sum(axis=1))
    return LoadEffect("weight", "gravity", load)
