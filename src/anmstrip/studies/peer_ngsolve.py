"""Flat shells bent by NGSolve: a mixed method with moments as unknowns, Newton with load steps.

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
from anmstrip.studies.peer_plates import MOST, TOLERANCE, Bent, Plate, ramped

ORDER = 3

CELLS = {"end shear": (1, 8), "slit annular plate": (3, 24)}
"""Across and along."""

PULLED, CLAMPED = "bottom", "top"


def solved(name: str, plate: Plate) -> Bent:
    """Build, solve, read."""
    ng = import_module("ngsolve")
    ng.SetNumThreads(1)
    found: list[tuple[_Shell, tuple[int, int]]] = []

    def work() -> None:
        shell = _built(ng, plate, CELLS[name])
        found.append((shell, ramped(shell.advanced)))

    seconds = timed(work)
    shell, counts = found[0]
    corners = [0, CELLS[name][0]]
    tip = np.array([[part.vec[i] for part in shell.state.components[:3]] for i in corners])
    return Bent(plate.readings(tip).tolist(), *counts, sum(shell.free), seconds)


@dataclass(frozen=True)
class _Shell:
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
        residual, change = (self.state.vec.CreateVector() for _ in range(2))
        energy.AssembleLinearization(self.state.vec)
        energy.Apply(self.state.vec, residual)
        residual.data += energy.harmonic_extension_trans * residual
        change.data = energy.mat.Inverse(self.free, inverse="sparsecholesky") * residual
        change.data += energy.harmonic_extension * change
        change.data += energy.inner_solve * residual
        self.state.vec.data -= change
        return abs(float(self.ng.InnerProduct(change, residual)))


def _surface(ng: Any, shape: Any) -> tuple[Any, Any]:
    """Gradient of the position, shape (3, 2), and the normal."""
    flat = ng.CF((1, 0, 0, 1, 0, 0), dims=(3, 2))
    gradient = flat + ng.CF(tuple(ng.grad(part) for part in shape), dims=(3, 2))
    return gradient, ng.Normalize(ng.Cross(gradient[:, 0], gradient[:, 1]))


def _built(ng: Any, plate: Plate, cells: tuple[int, int]) -> _Shell:
    """Mesh of curved quadrilaterals, spaces, energy."""
    make = import_module("ngsolve.meshes").MakeStructured2DMesh
    mesh = make(nx=cells[0], ny=cells[1], secondorder=True, mapping=plate.place)
    place = ng.H1(mesh, order=ORDER, dirichlet=CLAMPED)
    moments = ng.HDivDiv(mesh, order=ORDER - 1, discontinuous=True)
    angles = ng.NormalFacetFESpace(mesh, order=ORDER - 1, dirichlet=CLAMPED)
    space = place * place * place * moments * angles
    state, load = ng.GridFunction(space), ng.Parameter(0.0)
    mean, average = _normals(ng, mesh, state)
    *shape, moment, turn = space.TrialFunction()
    stretched, bent, hinged = _energies(ng, plate, shape, moment, turn, mean)
    energy = ng.BilinearForm(space, symmetric=True, condense=True)
    energy += ng.Variation((stretched + bent).Compile() * ng.dx)
    energy += ng.Variation(hinged.Compile() * ng.dx(element_boundary=True))
    energy += ng.Variation(-load * plate.pull * shape[2] * ng.ds(PULLED))
    lifted = plate.pull * state.components[2] * ng.ds(PULLED)
    free = space.FreeDofs(True)
    return _Shell(ng, state, energy, free, load, lambda: ng.Integrate(lifted, mesh), average)


def _energies(
    ng: Any, plate: Plate, shape: list[Any], moment: Any, turn: Any, mean: Any
) -> tuple[Any, Any, Any]:
    """Of stretch and of moments, per area; of moments on angles, per length of an element's edge.

    E t |½ (Fᵀ F − 1)|² / 2,   M : (n · ∇²r) − 6 |M|² / (E t³),   (turn − angle) Mₙₙ.
    """
    gradient, normal = _surface(ng, shape)
    strain = 0.5 * (gradient.trans * gradient - ng.Id(2))
    stretched = 0.5 * plate.young * plate.thickness * ng.InnerProduct(strain, strain)
    x, y, z = (part.Operator("hesse") for part in shape)
    curvature = normal[0] * x + normal[1] * y + normal[2] * z
    softness = 6.0 / (plate.young * plate.thickness**3)
    bent = ng.InnerProduct(moment, curvature) - softness * ng.InnerProduct(moment, moment)
    out = ng.specialcf.normal(2)
    edge = ng.Normalize(gradient * ng.CF((-out[1], out[0])))
    across = mean - (mean * edge) * edge
    angle = ng.asin(ng.Cross(edge, normal) * ng.Normalize(across))
    return stretched, bent, (turn * out - angle) * ng.InnerProduct(moment * out, out)


def _normals(ng: Any, mesh: Any, state: Any) -> tuple[Any, Callable[[], None]]:
    """Mean of the normals beside an edge, and what updates it where it is not clamped."""
    space = ng.FacetFESpace(mesh, order=ORDER - 1) ** 3
    trial, test = (ng.CF(tuple(part)) for part in space.TnT())
    edges = ng.dx(element_boundary=True)
    mass = ng.BilinearForm(trial * test * edges).Assemble()
    _, normal = _surface(ng, state.components[:3])
    form = ng.LinearForm(normal * test * edges).Assemble()
    inverse = mass.mat.Inverse(inverse="sparsecholesky")
    mean = ng.GridFunction(space)
    mean.vec.data = inverse * form.vec
    held = np.flatnonzero(list(space.GetDofs(mesh.Boundaries(CLAMPED))))
    kept = mean.vec.FV().NumPy()[held].copy()

    def average() -> None:
        form.Assemble()
        mean.vec.data = inverse * form.vec
        mean.vec.FV().NumPy()[held] = kept

    return ng.CF(mean.components), average
