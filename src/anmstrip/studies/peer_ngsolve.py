"""Shells bent by NGSolve: a mixed method with moments as unknowns, Newton with load steps.

Displacements are continuous and cubic.  Moments have a continuous normal-normal part, which
hybrid angles on the edges see to; they work on the curvature in each element and on the angles
between elements, measured from a mean normal of the last step.

Source: Neunteufel & Schöberl, *The Hellan–Herrmann–Johnson method for nonlinear shells*, Comput.
Struct. 225 (2019).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from anmstrip.studies.peer_capstan import timed
from anmstrip.studies.peer_ngsolve_arc import snapped
from anmstrip.studies.peer_plates import MOST, TOLERANCE, Bent, Plate, ramped

ORDER = 3

CELLS = {
    "end shear": (1, 8), "end moment": (1, 8), "slit annular plate": (3, 24),
    "hinged roof, t = 12.7": (4, 4), "hinged roof, t = 6.35": (4, 4),
}  # fmt: skip
"""Across and along."""

LOADED = "bottom"


def solved(name: str, plate: Plate) -> Bent:
    """Build, solve, read."""
    ng = import_module("ngsolve")
    ng.SetNumThreads(1)
    if plate.force:
        return snapped(lambda: _built(ng, plate, CELLS[name]), plate)
    found: list[tuple[Shell, tuple[int, int]]] = []

    def work() -> None:
        shell = _built(ng, plate, CELLS[name])
        found.append((shell, ramped(shell.advanced)))

    seconds = timed(work)
    shell, counts = found[0]
    corners = [0, CELLS[name][0]]
    tip = np.array([[part.vec[i] for part in shell.state.components[:3]] for i in corners])
    return Bent(plate.readings(tip).tolist(), *counts, sum(shell.free), seconds)


@dataclass(frozen=True)
class Shell:
    """Energy of a state under a load, without what is eliminated in each element."""

    ng: Any
    state: Any
    energy: Any
    free: Any
    load: Any
    lift: Callable[[], float]  # work of the full load
    average: Callable[[], None]  # edges' mean normals

    def advanced(self, load: float) -> tuple[bool, int]:
        """Go to a share of the load, or stay."""
        before = self.state.vec.CreateVector()
        before.data = self.state.vec
        self.load.Set(load)
        for spent in range(1, MOST + 1):
            decrement = self._iterated()
            if decrement < TOLERANCE**2 * load * self.lift():
                self.average()
                return True, spent
            if not np.isfinite(decrement):
                break
        self.state.vec.data = before
        return False, spent

    def _iterated(self) -> float:
        """One iteration of Newton's method; its work."""
        energy = self.energy
        residual = self.state.vec.CreateVector()
        energy.AssembleLinearization(self.state.vec)
        energy.Apply(self.state.vec, residual)
        change = self.solved(self.inverse(), residual)
        self.state.vec.data -= change
        return abs(float(self.ng.InnerProduct(change, residual)))

    def inverse(self) -> Any:
        """Of the condensed matrix."""
        return self.energy.mat.Inverse(self.free, inverse="sparsecholesky")

    def solved(self, inverse: Any, residual: Any) -> Any:
        """Solution of a linear system, whose right side is condensed in place."""
        energy, change = self.energy, self.state.vec.CreateVector()
        residual.data += energy.harmonic_extension_trans * residual
        change.data = inverse * residual
        change.data += energy.harmonic_extension * change
        change.data += energy.inner_solve * residual
        return change


def _surface(ng: Any, plate: Plate, shape: Any) -> tuple[Any, Any]:
    """Gradient of the position, shape (3, 2), and the normal."""
    angle = ng.y / plate.radius
    unloaded = ng.CF((1, 0, 0, ng.cos(angle), 0, -ng.sin(angle)), dims=(3, 2))
    gradient = unloaded + ng.CF(tuple(ng.grad(part) for part in shape), dims=(3, 2))
    return gradient, ng.Normalize(ng.Cross(gradient[:, 0], gradient[:, 1]))


def _built(ng: Any, plate: Plate, cells: tuple[int, int]) -> Shell:
    """Mesh of curved quadrilaterals, spaces, energy."""
    make = import_module("ngsolve.meshes").MakeStructured2DMesh
    mesh = make(nx=cells[0], ny=cells[1], secondorder=True, mapping=plate.place)
    held = ["|".join(plate.sides(what)) for what in ("x", "y", "z", "XY")]
    places = [ng.H1(mesh, order=ORDER, dirichlet=sides) for sides in held[:3]]
    moments = ng.HDivDiv(mesh, order=ORDER - 1, discontinuous=True)
    angles = ng.NormalFacetFESpace(mesh, order=ORDER - 1, dirichlet=held[3])
    space = ng.FESpace([*places, moments, angles])
    state, load = ng.GridFunction(space), ng.Parameter(0.0)
    mean, average = _normals(ng, plate, mesh, state)
    *shape, moment, turn = space.TrialFunction()
    stretched, bent, hinged = _energies(ng, plate, shape, moment, turn, mean)
    energy = ng.BilinearForm(space, symmetric=True, condense=True)
    energy += ng.Variation((stretched + bent).Compile() * ng.dx)
    energy += ng.Variation(hinged.Compile() * ng.dx(element_boundary=True))
    works = [_work(ng, plate, fields) for fields in ((shape, turn.Trace()), _split(state))]
    energy += ng.Variation(-load * works[0] * ng.ds(LOADED))
    lifted = works[1] * ng.ds(LOADED)
    free = space.FreeDofs(True)
    return Shell(ng, state, energy, free, load, lambda: ng.Integrate(lifted, mesh), average)


def _split(state: Any) -> tuple[Any, Any]:
    """Displacements and angles of a state."""
    *shape, _, turn = state.components
    return shape, turn


def _work(ng: Any, plate: Plate, fields: tuple[Any, Any]) -> Any:
    """Of the full load, per length of the loaded edge."""
    shape, turn = fields
    return plate.pull * shape[2] + plate.moment * turn * ng.specialcf.normal(2)


def _energies(
    ng: Any, plate: Plate, shape: list[Any], moment: Any, turn: Any, mean: Any
) -> tuple[Any, Any, Any]:
    """Of stretch and of moments, per area; of moments on angles, per length of an element's edge.

    E t |½ (Fᵀ F − 1)|² / 2,   M : (n · ∇²r) − 6 |M|² / (E t³),   (turn − angle) Mₙₙ, for ν = 0.
    """
    gradient, normal = _surface(ng, plate, shape)
    strain = 0.5 * (gradient.trans * gradient - ng.Id(2))
    nu, angle = plate.poisson, ng.y / plate.radius
    stiffness = plate.young * plate.thickness / (1.0 - nu**2)
    stretched = 0.5 * stiffness * _isotropic(ng, strain, 1.0 - nu, nu)
    x, y, z = (part.Operator("hesse") for part in shape)
    curvature = normal[0] * x + normal[1] * y + normal[2] * z
    rolled = -(normal[1] * ng.sin(angle) + normal[2] * ng.cos(angle)) + 1.0
    curvature += ng.CF((0, 0, 0, rolled / plate.radius), dims=(2, 2))
    softness = 6.0 / (plate.young * plate.thickness**3)
    bent = ng.InnerProduct(moment, curvature) - softness * _isotropic(ng, moment, 1.0 + nu, -nu)
    out = ng.specialcf.normal(2)
    edge = ng.Normalize(gradient * ng.CF((-out[1], out[0])))
    across = mean - (mean * edge) * edge
    angle = ng.asin(ng.Cross(edge, normal) * ng.Normalize(across))
    return stretched, bent, (turn * out - angle) * ng.InnerProduct(moment * out, out)


def _isotropic(ng: Any, tensor: Any, own: float, trace: float) -> Any:
    """Of a symmetric tensor A: own |A|² + trace (tr A)²."""
    return own * ng.InnerProduct(tensor, tensor) + trace * ng.Trace(tensor) ** 2


def _normals(ng: Any, plate: Plate, mesh: Any, state: Any) -> tuple[Any, Callable[[], None]]:
    """Mean of the normals beside an edge, and what updates it where it is not held."""
    space = ng.FacetFESpace(mesh, order=ORDER - 1) ** 3
    trial, test = (ng.CF(tuple(part)) for part in space.TnT())
    edges = ng.dx(element_boundary=True)
    mass = ng.BilinearForm(trial * test * edges).Assemble()
    _, normal = _surface(ng, plate, state.components[:3])
    form = ng.LinearForm(normal * test * edges).Assemble()
    inverse = mass.mat.Inverse(inverse="sparsecholesky")
    mean = ng.GridFunction(space)
    mean.vec.data = inverse * form.vec
    sides = mesh.Boundaries("|".join(plate.sides("XY")))
    held = np.flatnonzero(list(space.GetDofs(sides)))
    kept = mean.vec.FV().NumPy()[held].copy()

    def average() -> None:
        form.Assemble()
        mean.vec.data = inverse * form.vec
        mean.vec.FV().NumPy()[held] = kept

    return ng.CF(mean.components), average
