"""Fields of a state on a surface for pictures: one patch for each element."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.patches import patches, shape_of, unit_grid
from anmstrip.output.vtk import triangle_lattice

if TYPE_CHECKING:
    from anmstrip.mechanics.membrane import Membrane
    from anmstrip.mechanics.points import ContactOperator
    from anmstrip.mechanics.strip import Strip
    from anmstrip.scene.measures import State

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_THIRDS = np.linspace(0.0, 1.0, 4)

POINTS = {"line": unit_grid(4, 1), "quad": unit_grid(4), "triangle": triangle_lattice(6)}
"""Points of the output on each kind of element: cubic patches, quintic triangles."""


class Surface:
    """Points and cells of the output, and the basis functions there.

    Every quadrilateral becomes a four by four grid of points, every triangle a lattice of
    21, shared with its neighbours: the surface is reproduced exactly.  A section is drawn as
    wide as it stands for.

    Attributes
    ----------
    cells : ndarray of int, shape (elements, points of one)
        Points of each element.
    reference : ndarray, shape (3, points)
        Reference positions.
    """

    def __init__(
        self,
        strip: Strip,
        membrane: Membrane | None,
        contact: ContactOperator | None,
        bends: bool = True,
        imperfection: Array | None = None,
    ) -> None:
        self.strip, self.membrane, self.contact, self.bends = strip, membrane, contact, bends
        self.imperfection = imperfection
        self.kind, self.kinematics = shape_of(strip), strip.kinematics
        patch = patches(strip, POINTS[self.kind])
        self.own = patch.cells
        self.shared = np.bincount(self.own.ravel())
        self.value = np.stack([np.asarray(f) for f in patch.functions])
        self.grad = np.stack([f.grad for f in patch.functions])
        self.hess = np.stack([f.hess for f in patch.functions])
        self.cells, self.reference = patch.cells, patch.reference
        if self.kind == "line":
            self.cells, self.reference = _widened(patch.cells, patch.reference, strip.width)

    def _averaged(self, values: Array) -> Array:
        """Mean over the elements that share a point, (..., elements, 16) → (points, ...)."""
        flat = values.reshape(-1, self.own.size)
        mean = [np.bincount(self.own.ravel(), v) / self.shared for v in flat]
        points = np.stack(mean, axis=-1).reshape(-1, *values.shape[:-2])
        return np.tile(points, (4,) + (1,) * (points.ndim - 1)) if self.kind == "line" else points

    def _dofs(self, full: Array) -> Array:
        """Values of the elements' own degrees of freedom, (dofs, elements, components)."""
        return full.reshape(-1, self.strip.count)[self.strip.basis.element_dofs]

    def interpolated(self, full: Array) -> Array:
        """Vectors in space, shape (points, 3)."""
        own = self._averaged(np.einsum("nep,nec->cep", self.value, self._dofs(full)))
        return self.kinematics.embed(own.T).T

    @cached_property
    def from_contact(self) -> Array:
        """See :func:`interpolation`."""
        return interpolation(self.kind)

    def _from_contact(self, values: Array) -> Array:
        """Linear interpolation of what is known at contact points, (..., points)."""
        assert self.contact is not None
        return self._averaged(values[..., self.contact.cells] @ self.from_contact.T)

    def fields(self, state: State) -> dict[str, Array]:
        """All fields of a state, by name, points first."""
        velocity = np.zeros_like(state.full) if state.velocity is None else state.velocity
        return {
            "displacement": self.interpolated(state.full),
            "velocity": self.interpolated(velocity),
            **self._contact_fields(state),
            **self._stress_fields(state),
        }

    def _contact_fields(self, state: State) -> dict[str, Array]:
        """Sums over the rollers of what they do; gap and slip of the nearest one."""
        if not state.contacts:
            points = self.reference.shape[1]
            nothing, vector = np.zeros(points), np.zeros((points, 3))
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
        tangents, curvature = self._bent(state.full)
        membrane = self._membrane(tangents, state)
        bending = curvature
        if self.imperfection is not None:
            bending = curvature - self._bent(self.imperfection)[1]
        moments = np.einsum("xy,yep->xep", self._moduli(), bending)
        t = self.strip.thickness
        sx, sy, sxy = membrane / t + 6.0 * moments / t**2
        return {
            "membrane_force": self._averaged(membrane),
            "bending_moment": self._averaged(moments),
            "von_mises": self._averaged(np.sqrt(sx**2 - sx * sy + sy**2 + 3.0 * sxy**2)),
            "mean_curvature": self._averaged(0.5 * (curvature[0] + curvature[1])),
        }

    def _bent(self, full: Array) -> tuple[Array, Array]:
        """Tangent vectors, and curvature as (xx, yy, xy)."""
        dofs = self._dofs(full)
        tangents = self.kinematics.flat[..., None] + np.einsum("naep,nec->caep", self.grad, dofs)
        hessian = np.einsum("nabep,nec->cabep", self.hess, dofs)
        return tangents, _curvature(self._in_space(tangents), self.kinematics.embed(hessian))

    def _membrane(self, tangents: Array, state: State) -> Array:
        """N as (xx, yy, xy); of a plate the tension that it is under."""
        found = np.zeros((3, *tangents.shape[2:]))
        if self.membrane is None:
            found[0] = state.controls.get("exit.force", np.zeros(3))[0]
            return found
        natural = None if self.imperfection is None else self._bent(self.imperfection)[0]
        flat = [t if t is None else t.reshape(*t.shape[:2], -1) for t in (tangents, natural)]
        forces = self.membrane.forces(*flat)
        forces = forces.reshape(*forces.shape[:2], *tangents.shape[2:])
        found[0] = forces[0, 0]
        if len(forces) == 2:
            found[1], found[2] = forces[1, 1], forces[0, 1]
        return found

    def _in_space(self, tangents: Array) -> Array:
        """Both tangent vectors in space, (3, 2, elements, points)."""
        whole = np.zeros((3, 2, *tangents.shape[2:]))
        whole[0, 0] = whole[1, 1] = 1.0
        for place, component in enumerate(self.kinematics.components):
            whole[component, : tangents.shape[1]] = tangents[place]
        return whole

    def _moduli(self) -> Array:
        """Moments of (κ_xx, κ_yy, κ_xy), shape (3, 3); a strip without bending has none."""
        if not self.bends:
            return np.zeros((3, 3))
        from anmstrip.mechanics import bending  # noqa: PLC0415 (only strips that resist it)

        return bending.moduli(self.strip)


def _curvature(tangents: Array, hessian: Array) -> Array:
    """−n · r,ab as (xx, yy, xy): positive where the top surface is stretched."""
    normal = np.cross(tangents[:, 0], tangents[:, 1], axis=0)
    normal /= np.linalg.norm(normal, axis=0)
    curvature = -np.einsum("cep,cabep->abep", normal, hessian)
    found = np.zeros((3, *curvature.shape[2:]))
    found[0] = curvature[0, 0]
    if len(curvature) == 2:
        found[1], found[2] = curvature[1, 1], curvature[0, 1]
    return found


def interpolation(kind: str) -> Array:
    """From the contact points of an element to its points of output, piecewise linear.

    Returns
    -------
    ndarray, shape (points of output, contact points)
    """
    hats = np.array([[np.interp(x, [0.0, 0.5, 1.0], row) for row in np.eye(3)] for x in _THIRDS])
    if kind != "triangle":
        return hats if kind == "line" else np.kron(hats, hats)
    from scipy.interpolate import LinearNDInterpolator  # noqa: PLC0415 (for triangles alone)

    from anmstrip.mechanics.points import contact_points  # noqa: PLC0415 (only with contact)

    points = contact_points(kind).T
    return np.asarray(LinearNDInterpolator(points, np.eye(len(points)))(POINTS[kind].T))


def _widened(cells: Index, reference: Array, width: float) -> tuple[Index, Array]:
    """Surface of a line, four points across; cells as grids of i + 4 j."""
    levels, count = np.arange(4), reference.shape[1]
    across = np.repeat((levels / 3.0 - 0.5) * width, count)
    wide = np.tile(reference, (1, 4))
    wide[1] = across
    return (cells[:, None, :] + count * levels[:, None]).reshape(len(cells), 16), wide
