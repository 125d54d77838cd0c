"""Fields of a state on a surface for pictures: cubic patches, one for each element."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics import bending
from anmstrip.mechanics.membrane import FLAT, Membrane
from anmstrip.mechanics.strip import Strip
from anmstrip.scene.measures import State

Array = NDArray[np.float64]

THIRDS = np.linspace(0.0, 1.0, 4)


class Surface:
    """Points and cells of the output, and the basis functions there.

    Every element becomes a four by four grid of points, shared with its
    neighbours: a bicubic surface is reproduced exactly.

    Attributes
    ----------
    cells : ndarray of int, shape (elements, 16)
        Points of each element, number i + 4 j of its grid.
    reference : ndarray, shape (3, points)
        Reference positions.
    """

    def __init__(self, strip: Strip, membrane: Membrane) -> None:
        self.strip, self.membrane = strip, membrane
        basis = strip.basis
        local = np.stack([x.ravel() for x in np.meshgrid(THIRDS, THIRDS)])
        self._join(basis.mapping.F(local))
        functions = [basis.elem.gbasis(basis.mapping, local, i)[0] for i in range(16)]
        self.value = np.stack([f.value for f in functions])
        self.grad = np.stack([f.grad for f in functions])
        self.hess = np.stack([f.hess for f in functions])
        self.corners = (1.0 - local[0]) * (1.0 - local[1]), local[0] * (1.0 - local[1])
        self.corners += local[0] * local[1], (1.0 - local[0]) * local[1]

    def _join(self, grid: Array) -> None:
        """Number points so that neighbours share them."""
        unit = 1e-6 * self.strip.cell_sizes.min()
        keys = np.round(grid.reshape(2, -1) / unit).astype(np.int64)
        _, first, inverse = np.unique(keys, axis=1, return_index=True, return_inverse=True)
        self.cells = inverse.reshape(-1, 16)
        points = grid.reshape(2, -1)[:, first]
        self.reference = np.vstack([points, np.zeros(points.shape[1])])
        self.shared = np.bincount(self.cells.ravel())

    def _averaged(self, values: Array) -> Array:
        """Mean over the elements that share a point, (..., elements, 16) → (points, ...)."""
        flat = values.reshape(-1, self.cells.size)
        mean = [np.bincount(self.cells.ravel(), v) / self.shared for v in flat]
        return np.stack(mean, axis=-1).reshape(-1, *values.shape[:-2])

    def _interpolated(self, full: Array) -> Array:
        dofs = full.reshape(-1, 3)[self.strip.basis.element_dofs]
        return self._averaged(np.einsum("nep,nec->cep", self.value, dofs))

    def _nodal(self, values: Array) -> Array:
        """Bilinear interpolation of what is known at mesh nodes, (..., nodes) → (points, ...)."""
        at_corners = values[..., self.strip.mesh.t]
        return self._averaged(
            sum(at_corners[..., k, :, None] * self.corners[k] for k in range(4))
        )

    def fields(self, state: State) -> dict[str, Array]:
        """All fields of a state, by name, points first."""
        velocity = np.zeros_like(state.full) if state.velocity is None else state.velocity
        return {
            "displacement": self._interpolated(state.full),
            "velocity": self._interpolated(velocity),
            **self._contact_fields(state),
            **self._stress_fields(state),
        }

    def _contact_fields(self, state: State) -> dict[str, Array]:
        nodes = self.strip.mesh.p.shape[1]
        pressure, gap = np.zeros(nodes), np.full(nodes, np.inf)
        traction, slip = np.zeros((3, nodes)), np.zeros((3, nodes))
        for _, found in state.contacts.values():
            nearest = found.gap < gap
            gap = np.minimum(gap, found.gap)
            pressure += found.pressure
            if found.traction is not None:
                traction += found.traction
                slip = np.where(nearest, found.slip, slip)
        found_gap = gap if np.isfinite(gap).all() else np.zeros(nodes)
        return {
            "normal_pressure": self._nodal(pressure),
            "friction_traction": self._nodal(traction),
            "slip_velocity": self._nodal(slip),
            "gap": self._nodal(found_gap),
        }

    def _stress_fields(self, state: State) -> dict[str, Array]:
        """Membrane forces, moments, von Mises stress of the top surface, mean curvature."""
        dofs = state.full.reshape(-1, 3)[self.strip.basis.element_dofs]
        tangents = np.einsum("naep,nec->caep", self.grad, dofs) + FLAT[..., None]
        forces = self.membrane.forces(tangents)
        curvature = self._curvature(tangents, np.einsum("nabep,nec->cabep", self.hess, dofs))
        moments = np.einsum("xy,yep->xep", self._moduli(), curvature)
        membrane = np.stack([forces[0, 0], forces[1, 1], forces[0, 1]])
        t = self.strip.thickness
        sx, sy, sxy = membrane / t + 6.0 * moments / t**2
        return {
            "membrane_force": self._averaged(membrane),
            "bending_moment": self._averaged(moments),
            "von_mises": self._averaged(np.sqrt(sx**2 - sx * sy + sy**2 + 3.0 * sxy**2)),
            "mean_curvature": self._averaged(0.5 * (curvature[0] + curvature[1])),
        }

    def _moduli(self) -> Array:
        """Moments of (κ_xx, κ_yy, κ_xy)."""
        moduli = bending.stiffness(self.strip)
        moduli[2, 2] *= 0.5
        return moduli

    @staticmethod
    def _curvature(tangents: Array, hessian: Array) -> Array:
        """−n · r,ab as (xx, yy, xy): positive where the top surface is stretched."""
        normal = np.cross(tangents[:, 0], tangents[:, 1], axis=0)
        normal /= np.linalg.norm(normal, axis=0)
        curvature = -np.einsum("cep,cabep->abep", normal, hessian)
        return np.stack([curvature[0, 0], curvature[1, 1], curvature[0, 1]])
