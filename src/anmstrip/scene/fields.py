"""Fields of a state on a surface for pictures: cubic patches, one for each element."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics import bending
from anmstrip.mechanics.cells import ContactOperator, patches, unit_grid
from anmstrip.mechanics.membrane import FLAT, Membrane
from anmstrip.mechanics.strip import Strip
from anmstrip.scene.measures import State

Array = NDArray[np.float64]

_HATS = np.array(
    [[np.interp(x, [0.0, 0.5, 1.0], row) for row in np.eye(3)] for x in unit_grid(4)[0, :4]]
)
THIRDS_OF_HALVES = np.kron(_HATS, _HATS)
"""Piecewise bilinear interpolation from the 3 × 3 to the 4 × 4 grid of an element."""


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

    def __init__(self, strip: Strip, membrane: Membrane, contact: ContactOperator | None) -> None:
        self.strip, self.membrane, self.contact = strip, membrane, contact
        self.cells, self.reference, functions = patches(strip, 4)
        self.shared = np.bincount(self.cells.ravel())
        self.value = np.stack([np.asarray(f) for f in functions])
        self.grad = np.stack([f.grad for f in functions])
        self.hess = np.stack([f.hess for f in functions])

    def _averaged(self, values: Array) -> Array:
        """Mean over the elements that share a point, (..., elements, 16) → (points, ...)."""
        flat = values.reshape(-1, self.cells.size)
        mean = [np.bincount(self.cells.ravel(), v) / self.shared for v in flat]
        return np.stack(mean, axis=-1).reshape(-1, *values.shape[:-2])

    def _interpolated(self, full: Array) -> Array:
        dofs = full.reshape(-1, 3)[self.strip.basis.element_dofs]
        return self._averaged(np.einsum("nep,nec->cep", self.value, dofs))

    def _from_contact(self, values: Array) -> Array:
        """Linear interpolation of what is known at contact points, (..., points)."""
        assert self.contact is not None
        return self._averaged(values[..., self.contact.cells] @ THIRDS_OF_HALVES.T)

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
        """Sums over the rollers of what they do; gap and slip of the nearest one."""
        if not state.contacts:
            nothing, vector = np.zeros(len(self.shared)), np.zeros((len(self.shared), 3))
            return {
                "normal_pressure": nothing,
                "friction_traction": vector,
                "slip_velocity": vector,
                "gap": nothing,
            }
        found = list(state.contacts.values())
        nearest = np.argmin([f.gap for f in found], axis=0)
        slips = np.stack([f.slip for f in found])[nearest, :, np.arange(len(nearest))].T
        return {
            "normal_pressure": self._from_contact(np.sum([f.pressure for f in found], axis=0)),
            "friction_traction": self._from_contact(np.sum([f.traction for f in found], axis=0)),
            "slip_velocity": self._from_contact(slips),
            "gap": self._from_contact(np.min([f.gap for f in found], axis=0)),
        }

    def _stress_fields(self, state: State) -> dict[str, Array]:
        """Membrane forces, moments, von Mises stress of the top surface, mean curvature."""
        dofs = state.full.reshape(-1, 3)[self.strip.basis.element_dofs]
        tangents = np.einsum("naep,nec->caep", self.grad, dofs) + FLAT[..., None]
        forces = self.membrane.forces(tangents.reshape(3, 2, -1)).reshape(2, 2, *tangents.shape[2:])
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
