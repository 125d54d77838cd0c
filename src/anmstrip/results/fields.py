"""Fields of a state on a surface for pictures: one patch for each element."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from anmstrip.arrays import Array
from anmstrip.fem.sampling import ContactOperator, contact_points, patches, shape_of, unit_grid
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.shell import Membrane, moduli
from anmstrip.results.state import State
from anmstrip.results.vtk import triangle_lattice

POINTS = {"line": unit_grid(4, 1), "quad": unit_grid(4), "triangle": triangle_lattice(6)}
"""Points of the output on each kind of element: cubic patches, quintic triangles."""


class FieldSampler:
    """Points and cells of the output, and the fields of states there.

    Every quadrilateral becomes a four by four grid of points, every triangle a lattice of
    21, shared with its neighbours: the surface is reproduced exactly.  A section is drawn as
    wide as it stands for, with four points across.

    Parameters
    ----------
    strip : Strip
    membrane : Membrane or None
        A plate has none.
    contact : ContactOperator or None
    bends : bool
        Whether the strip resists bending.
    imperfection : ndarray, shape (unknowns,), optional
        Displacement of the reference that makes no stress.

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
            across, count = np.arange(4), self.reference.shape[1]
            self.cells = (self.own[:, None, :] + count * across[:, None]).reshape(-1, 16)
            self.reference = np.tile(self.reference, (1, 4))
            self.reference[1] = np.repeat((across / 3.0 - 0.5) * strip.width, count)

    def sample(self, state: State) -> dict[str, Array]:
        """All fields of a state by name, points first.

        Displacement (m), velocity and slip velocity (m/s), normal pressure and friction traction
        (Pa), gap (m), membrane force (N/m) and bending moment (N) as (xx, yy, xy), von Mises
        stress of the top surface (Pa), and mean curvature (1/m).
        """
        velocity = np.zeros_like(state.full) if state.velocity is None else state.velocity
        return {
            "displacement": self.interpolate(state.full),
            "velocity": self.interpolate(velocity),
            **self._contact(state),
            **self._stress(state),
        }

    def interpolate(self, full: Array) -> Array:
        """Vectors in space of all unknowns, shape (points, 3)."""
        own = self._average(np.einsum("nep,nec->cep", self.value, self._dofs(full)))
        return self.kinematics.embed(own.T).T

    def _average(self, values: Array) -> Array:
        """Mean over the elements that share a point, (..., elements, 16) → (points, ...)."""
        flat = values.reshape(-1, self.own.size)
        mean = [np.bincount(self.own.ravel(), v) / self.shared for v in flat]
        points = np.stack(mean, axis=-1).reshape(-1, *values.shape[:-2])
        return np.tile(points, (4,) + (1,) * (points.ndim - 1)) if self.kind == "line" else points

    def _dofs(self, full: Array) -> Array:
        """Values of the elements' own degrees of freedom, (dofs, elements, components)."""
        return self.strip.nodal(full)[self.strip.basis.element_dofs]

    @cached_property
    def from_contact(self) -> Array:
        """Linear interpolation from the contact points of an element to its points of output.

        Shape (points of output, contact points).
        """
        if self.kind == "triangle":
            from scipy.interpolate import LinearNDInterpolator

            points = contact_points(self.kind).T
            return np.asarray(
                LinearNDInterpolator(points, np.eye(len(points)))(POINTS[self.kind].T)
            )
        hats = [np.interp(POINTS["line"][0], [0.0, 0.5, 1.0], row) for row in np.eye(3)]
        along = np.transpose(hats)
        return along if self.kind == "line" else np.kron(along, along)

    def _contact(self, state: State) -> dict[str, Array]:
        """Sums over the rollers of what they do; gap and slip of the nearest one."""
        found = list(state.contacts.values())
        if not found:
            nothing = np.zeros(self.reference.shape[1])
            vectors = dict.fromkeys(
                ("friction_traction", "slip_velocity"), np.zeros((len(nothing), 3))
            )
            return {"normal_pressure": nothing, **vectors, "gap": nothing}
        assert self.contact is not None
        nearest = np.argmin([f.gap for f in found], axis=0)
        values = {
            "normal_pressure": np.sum([f.pressure for f in found], axis=0),
            "friction_traction": np.sum([f.traction for f in found], axis=0),
            "slip_velocity": np.stack([f.slip for f in found])[
                nearest, :, np.arange(len(nearest))
            ].T,
            "gap": np.min([f.gap for f in found], axis=0),
        }
        cells = self.contact.cells
        return {n: self._average(v[..., cells] @ self.from_contact.T) for n, v in values.items()}

    def _stress(self, state: State) -> dict[str, Array]:
        """Membrane forces, moments, von Mises stress of the top surface, mean curvature."""
        tangents, curvature = self._geometry(state.full)
        bending, natural = curvature, None
        if self.imperfection is not None:
            natural, bent = self._geometry(self.imperfection)
            bending, natural = curvature - bent, natural.reshape(*natural.shape[:2], -1)
        membrane = np.zeros_like(curvature)
        if self.membrane is None:
            membrane[0] = state.controls.get("exit.force", np.zeros(3))[0]
        else:
            flat = tangents.reshape(*tangents.shape[:2], -1)
            forces = self.membrane.forces(flat, natural)
            membrane = _components(forces.reshape(*forces.shape[:2], *tangents.shape[2:]))
        stiffness = moduli(self.strip) if self.bends else np.zeros((3, 3))
        moments = np.einsum("xy,yep->xep", stiffness, bending)
        t = self.strip.thickness
        sx, sy, sxy = membrane / t + 6.0 * moments / t**2
        return {
            "membrane_force": self._average(membrane),
            "bending_moment": self._average(moments),
            "von_mises": self._average(np.sqrt(sx**2 - sx * sy + sy**2 + 3.0 * sxy**2)),
            "mean_curvature": self._average(0.5 * (curvature[0] + curvature[1])),
        }

    def _geometry(self, full: Array) -> tuple[Array, Array]:
        """Tangent vectors r,a and curvature −n · r,ab, positive where the top is stretched.

        Shapes (components, directions, elements, points) and (3, elements, points).
        """
        level, dofs = self.kinematics, self._dofs(full)
        tangents = level.flat[..., None] + np.einsum("naep,nec->caep", self.grad, dofs)
        in_space = np.zeros((3, 2, *tangents.shape[2:]))
        in_space[0, 0] = in_space[1, 1] = 1.0
        in_space[list(level.components), : level.directions] = tangents
        normal = np.cross(in_space[:, 0], in_space[:, 1], axis=0)
        normal /= np.linalg.norm(normal, axis=0)
        hessian = level.embed(np.einsum("nabep,nec->cabep", self.hess, dofs))
        return tangents, _components(-np.einsum("cep,cabep->abep", normal, hessian))


def _components(tensor: Array) -> Array:
    """Components (xx, yy, xy) of symmetric tensors (d, d, ...); a section has xx alone."""
    found = np.zeros((3, *tensor.shape[2:]))
    found[0] = tensor[0, 0]
    if len(tensor) == 2:
        found[1], found[2] = tensor[1, 1], tensor[0, 1]
    return found
