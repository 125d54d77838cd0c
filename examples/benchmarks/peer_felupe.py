"""The capstan by FElupe: 160 quadratic solids in plane strain, one through the thickness.

Newton's method with increments that are cut back and grow; contact by penalty with Coulomb's
friction.  FElupe's rigid cylinder does not turn, so the strip is drawn over it by its entry,
which brings it into the same full slip.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from peer_capstan import (
    COEFFICIENT,
    DOWN,
    LENGTH,
    POISSON,
    PULL,
    RADIUS,
    THICKNESS,
    YOUNG,
    Answer,
    answer,
    timed,
)
from strips import CONTACT, TENSION

CELLS = 160

SUBSTEPS = (4, 40, 20)
"""Of tension, wrapping and slip, before they are cut back."""

TOLERANCE = 1e-6
"""Of the residual over the reactions; round-off is at 1e-8."""

SLACK = 0.01
"""Stiffness of sticking over that of contact."""

DRAWN = 2e-3
"""m, far more than friction takes to be in full slip."""


def solved(stiffer: float) -> Answer:
    """Build, solve, read."""
    fem = import_module("felupe")
    field, strip, contact = _model(fem, stiffer * CONTACT["stiffness"])
    steps, entry = _steps(fem, field, strip, contact)
    tangents = []

    def counted(matrix: Any, right: Any) -> Any:
        tangents.append(1)
        return spsolve(matrix.tocsr(), right)

    cut = fem.CutbackPlugin(max_cutbacks=14)
    job = fem.Job(steps, plugins=[cut])
    seconds = timed(lambda: job.evaluate(verbose=0, solver=counted, tol=TOLERANCE))
    forces = strip.assemble.vector().toarray().reshape(-1, 2)
    taken = sum(len(factors) for factors in cut.load_factors)
    counts = (taken, len(tangents), forces.size)
    return answer((forces[entry].sum(axis=0), [TENSION, PULL]), COEFFICIENT, seconds, counts)


def _model(fem: Any, stiffness: float) -> tuple[Any, Any, Any]:
    """Return strip and roller; the roller's centre is the last point of the mesh."""
    corners = (-0.5 * LENGTH, 0.0), (0.5 * LENGTH, THICKNESS)
    mesh = fem.Rectangle(a=corners[0], b=corners[1], n=(CELLS + 1, 2))
    mesh = fem.Mesh(*fem.mesh.add_midpoints_edges(mesh.points, mesh.cells, mesh.cell_type))
    mesh.update(points=np.vstack([mesh.points, [0.0, -RADIUS - 1e-3]]))
    field = fem.FieldContainer([fem.FieldPlaneStrain(fem.RegionQuadraticQuad(mesh), dim=2)])
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    lame = 2.0 * shear * POISSON / (1.0 - 2.0 * POISSON)
    strip = fem.SolidBody(fem.NeoHookeCompressible(mu=shear, lmbda=lame), field)
    near = (mesh.points[:, 1] == 0.0) & (np.abs(mesh.points[:, 0]) < 2.0 * RADIUS)
    part = 0.5 * LENGTH / CELLS
    contact = fem.ContactRigidCylinder(
        field,
        np.flatnonzero(near),
        len(mesh.points) - 1,
        RADIUS,
        friction=COEFFICIENT,
        multiplier=stiffness * part,
        multiplier_tangential=SLACK * CONTACT["stiffness"] * part,
    )
    return field, strip, contact


def _steps(fem: Any, field: Any, strip: Any, contact: Any) -> tuple[list[Any], NDArray[np.intp]]:
    """Return the steps of tension, wrapping and slip, and the points of the entry."""
    points = field.region.mesh.points
    middle = np.isclose(points[:, 1], 0.5 * THICKNESS)
    entry = np.flatnonzero((points[:, 0] == -0.5 * LENGTH) & middle)
    end = np.flatnonzero(points[:, 0] == 0.5 * LENGTH)
    shares = np.where(middle[end], 4.0, 1.0)[:, None] / 6.0
    load = fem.PointLoad(field, end, values=0.0 * shares * [1.0, 1.0])

    def held(which: Any, skip: tuple[int, int]) -> Any:
        return fem.Boundary(field[0], mask=np.isin(np.arange(len(points)), which), skip=skip)

    x, y = held(entry, (0, 1)), held(entry, (1, 0))
    boundaries = {"roller": held([len(points) - 1], (0, 0)), "x": x, "y": y}
    along = DRAWN * np.array([TENSION, PULL]) / np.hypot(TENSION, PULL)
    along[0] *= -1.0
    stations = (
        (np.array([0.0, 0.0]), np.array([0.0, 0.0])),
        (np.array([TENSION, 0.0]), np.array([0.0, 0.0])),
        (np.array([TENSION, PULL]), np.array([0.0, DOWN])),
        (np.array([TENSION, PULL]), np.array([0.0, DOWN]) + along),
    )
    steps = []
    for number, (force, place), (next_force, next_place) in zip(
        SUBSTEPS, stations[:-1], stations[1:], strict=True
    ):
        rise = np.linspace(0.0, 1.0, number + 1)[1:]
        pulls = [shares * (force + a * (next_force - force)) for a in rise]
        places = np.array([place + a * (next_place - place) for a in rise])
        ramp = {load: pulls, x: places[:, 0], y: places[:, 1]}
        steps.append(fem.Step([strip, contact, load], boundaries=boundaries, ramp=ramp))
    return steps, entry
