"""Membrane and bending of thin shells, of flat and of curved references."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.fem.geometry import DERIVATIVE_PAIRS, dot, normal_vector, normal_work
from anmstrip.fem.operators import CellOperator, Pattern
from anmstrip.fem.sampling import quadrature_points
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.effects import LawEffect, LinearEffect, Values

FIRST_DERIVATIVES, SECOND_DERIVATIVES = (1, 0), (2, 0, 1)
"""How many times the first derivatives (x, y) and the second ones (xx, yy, xy) go along x."""


def plane_stress(strip: Strip) -> Array:
    """C (N/m) in N = C : E, shape (d, d, d, d) for d directions.

    E t/(1−ν²) [ν δ δ + (1−ν) sym] of a surface.  A section is free to contract across,
    N_yy = 0, which leaves E t.
    """
    if strip.kinematics.directions == 1:
        return np.full((1, 1, 1, 1), strip.tensile_stiffness)
    nu = strip.material.poisson
    d = np.eye(2)
    spherical = np.einsum("ab,cd->abcd", d, d)
    symmetric = 0.5 * (np.einsum("ac,bd->abcd", d, d) + np.einsum("ad,bc->abcd", d, d))
    return strip.membrane_stiffness * (nu * spherical + (1.0 - nu) * symmetric)


def eigenstrain(strip: Strip, controls: Values) -> Any:
    """Return the strain that makes no stress: E⁰ = e + ½ e², e = α ΔT δ + (ε⁰ − κ⁰ y) e_x ⊗ e_x.

    Strip without stress is longer by e, which heat in a furnace makes 0.01: the square, in Green's
    strain, is then as much as the elastic strain.

    Parameters
    ----------
    strip : Strip
    controls : mapping
        ``strip.temperature``, ΔT (K) above that of the stress-free strip; ``strip.flatness``, ε⁰,
        the rolled-in elongation; ``strip.camber``, −κ⁰ y, that of fibres of a strip curved in its
        plane.  Each one is an array or series (points,), and may be missing.

    Returns
    -------
    array or Series, shape (d, d, points), or None
        ``None`` if all are missing.
    """
    every = np.eye(strip.kinematics.directions)
    parts = {"strip.temperature": strip.material.expansion * every}
    parts |= dict.fromkeys(("strip.flatness", "strip.camber"), every * every[0])
    found = [part[..., None] * controls[key] for key, part in parts.items() if key in controls]
    return green_strain(sum(found[1:], found[0])) if found else None


def green_strain(elongation: Any) -> Any:
    """Return Green's strain e + ½ e² of fibres that are longer by a share e."""
    return elongation + elongation * elongation * 0.5


def uneven_tension(strip: Strip, edge: str, controls: Values) -> Array | None:
    """Return what the tension of uneven strip is beyond its mean where it goes on at an edge.

    E t (a + b y − e), with a and b such that it has neither a force nor a moment: fibres that are
    longer by e without stress bear less.

    Parameters
    ----------
    strip : Strip
        On a mesh of rectangles.
    edge : str
        Its name, across the strip.
    controls : mapping
        Those of :func:`eigenstrain` and :func:`weaken`.

    Returns
    -------
    ndarray, shape (points,), or None
        N/m at the quadrature points of the edge; ``None`` where no fibre is longer.
    """
    own = eigenstrain(strip, controls)
    if own is None:
        return None
    x, y, _ = quadrature_points(strip)
    end = strip.nodes[0, strip.edges[edge].nodes].mean()
    near = np.flatnonzero(np.isclose(np.abs(x - end), np.abs(x - end).min()))
    near = near[np.argsort(y[near])]
    basis = strip.edge_basis(edge)
    at, lengths = np.asarray(basis.global_coordinates())[1].ravel(), np.asarray(basis.dx).ravel()
    fields = own[0, 0], weaken(np.ones(len(y)), controls)
    e, share = (np.interp(at, y[near], np.broadcast_to(f, y.shape)[near]) for f in fields)
    even = np.vander(at - at.mean(), 2)
    normal = even.T * (share * lengths)
    excess = even @ np.linalg.solve(normal @ even, normal @ e) - e
    return np.asarray(strip.tensile_stiffness * share * excess)


def weaken(values: Any, controls: Values, loss: str = "strip.softening") -> Any:
    """Return stresses or moments of a strip that is warm, E(T)/E of what they are with E.

    Parameters
    ----------
    values : array or Series, shape (..., points)
    controls : mapping
        ``strip.softening``, 1 − E(T)/E, (points,); without it nothing changes.
    loss : str, optional
        Another one, ``strip.weakening``, 1 − σ_y(T)/σ_y.
    """
    return values * (1.0 - controls[loss]) if loss in controls else values


def material_derivatives(derivatives: Any, controls: Values, powers: Sequence[int]) -> Any:
    """Return derivatives along unstressed strip, from those along labels that hold more of it.

    Parameters
    ----------
    derivatives : array or Series, shape (components, derivatives, points)
    controls : mapping
        ``strip.growth``, g = ∂S/∂X, the unstressed length at a label over that of the reference,
        (points,); without it labels are material.
    powers : sequence of int
        How many times each one is a derivative along X.
    """
    if "strip.growth" not in controls:
        return derivatives
    factor = 1.0 / controls["strip.growth"]
    factors = (1.0, factor, factor * factor)
    parts = [derivatives[:, k] * factors[power] for k, power in enumerate(powers)]
    return np.stack(parts, axis=1)


def label_forces(forces: Any, controls: Values, powers: Sequence[int]) -> Any:
    """Return what does work with the derivatives along labels, see :func:`material_derivatives`.

    Per area of the reference, g times what it is per area of unstressed strip.
    """
    if "strip.growth" not in controls:
        return forces
    return material_derivatives(forces * controls["strip.growth"], controls, powers)


class Membrane(LawEffect):
    """Membrane forces of a strip.

    With the tangent vectors r,a (columns of an array): E = ½ (r,a · r,b − δ_ab),
    N = C : (E − E⁰) with E⁰ of :func:`eigenstrain`, and the first Piola stress is r,a N_ab.
    Derivatives are those of :mod:`anmstrip.fem.geometry`, along orthonormal frames of the
    reference.

    Parameters
    ----------
    strip : Strip
    imperfection : ndarray, shape (unknowns,), optional
        Displacement of the reference that makes no stress.
    """

    name = "membrane"
    operator: CellOperator

    def __init__(self, strip: Strip, imperfection: Array | None = None) -> None:
        self.strip, self.operator = strip, CellOperator(strip, [1], symmetric=True)
        self.stiffness = plane_stress(strip)
        self.flat = strip.frames().tangents
        self.metric = np.eye(strip.kinematics.directions)[:, :, None]
        self.powers = FIRST_DERIVATIVES[: strip.kinematics.directions]
        self.imperfection = imperfection
        if imperfection is not None:
            natural = self.flat + self.operator.apply(imperfection)
            self.metric = np.einsum("iap,ibp->abp", natural, natural)

    def strain(self, tangents: Any, controls: Mapping[str, Any] = {}) -> Any:
        """Return E − E⁰, (d, d, points), from tangent vectors (components, d, points)."""
        strain = (np.einsum("ia...,ib...->ab...", tangents, tangents) - self.metric) * 0.5
        own = eigenstrain(self.strip, controls)
        return strain if own is None else strain - own

    def forces(self, tangents: Any, controls: Mapping[str, Any] = {}) -> Any:
        """N (N/m), shape (d, d, points), from tangent vectors (components, d, points)."""
        forces = np.einsum("abcd,cd...->ab...", self.stiffness, self.strain(tangents, controls))
        return weaken(forces, controls)

    def at(self, full: Array, controls: Mapping[str, Any] = {}) -> Array:
        """N (N/m) of a state at the quadrature points, shape (d, d, points)."""
        tangents = self.tangents(self.operator.apply(full), controls)
        return np.asarray(self.forces(tangents, controls))

    def tangents(self, x: Any, controls: Values) -> Any:
        """Tangent vectors along unstressed strip, (components, d, points)."""
        return material_derivatives(x + self.flat, controls, self.powers)

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """First Piola stress (N/m) from the displacement gradient, (components, d, points)."""
        tangents = self.tangents(x, controls)
        stress = np.einsum("ia...,ab...->ib...", tangents, self.forces(tangents, controls))
        return label_forces(stress, controls, self.powers)

    def change(self, full: Array, change: Array, controls: Mapping[str, Any] = {}) -> Array:
        """Membrane forces that a small change of state makes, shape (d, d, points)."""
        tangents = self.tangents(self.operator.apply(full), controls)
        moved = material_derivatives(self.operator.apply(change), controls, self.powers)
        product = np.einsum("ia...,ib...->ab...", tangents, moved)
        forces = np.einsum("abcd,cd...->ab...", self.stiffness, product)
        return np.asarray(weaken(forces, controls))


def uniaxial_stretches(
    tension: float, tensile_stiffness: Any, poisson: float, eigen: tuple[Any, Any] = (0.0, 0.0)
) -> tuple[Any, Any]:
    """Return the stretches along and across a strip under tension.

    The strain E along solves T = √(1 + 2E) E_young t (E − E⁰) with the eigenstrains E⁰ along and
    across; the strip contracts across by ν (E − E⁰), to half its width at most.  Numbers, or arrays
    of them.
    """
    along, across = eigen
    strain = along + tension / tensile_stiffness
    for _ in range(30):
        stretch, elastic = np.sqrt(1.0 + 2.0 * strain), strain - along
        slope = tensile_stiffness * (stretch + elastic / stretch)
        strain -= (tensile_stiffness * elastic * stretch - tension) / slope
    narrow = across - poisson * (strain - along)
    return np.sqrt(1.0 + 2.0 * strain), np.sqrt(np.maximum(1.0 + 2.0 * narrow, 0.25))


def principal_forces(forces: Array) -> tuple[Array, Array]:
    """Principal membrane forces (N/m), ascending, (points, d), and directions (points, d, d).

    Parameters
    ----------
    forces : ndarray, shape (d, d, points)
    """
    found = np.linalg.eigh(np.moveaxis(forces, -1, 0))
    return found.eigenvalues, found.eigenvectors


def principal_values(forces: Array) -> Array:
    """Principal membrane forces alone (N/m), ascending, (points, d), of (d, d, points)."""
    if len(forces) == 1:
        return forces[0].T
    mean, half = 0.5 * (forces[0, 0] + forces[1, 1]), 0.5 * (forces[0, 0] - forces[1, 1])
    radius = np.hypot(half, forces[0, 1])
    return np.stack([mean - radius, mean + radius], axis=-1)


FLAT_CURVATURE = 1e-10
"""Curvature times thickness that is round-off."""


def isometric_bending(strip: Strip, pattern: Pattern) -> LinearEffect:
    """Bending as a constant matrix.

    Parameters
    ----------
    strip : Strip
    pattern : Pattern

    Returns
    -------
    LinearEffect

    Raises
    ------
    ValueError
        If the reference is curved.
    """
    if np.abs(strip.frames().seconds).max() * strip.thickness > FLAT_CURVATURE:
        raise ValueError("isometric bending is for flat references; take KirchhoffLove")
    operator = CellOperator(strip, [2])
    block = np.zeros(pattern.couplings)
    operator.add_bilinear(stiffness(strip), pattern, block)
    return LinearEffect("bending", operator.points, block, pattern)


def stiffness(strip: Strip) -> Array:
    """D [(1−ν) A : B + ν tr A tr B] for (xx, yy, xy) of symmetric A, B; shape (3, 3), N m.

    Of a section D alone, shape (1, 1): it does not bend across.
    """
    kept = len(DERIVATIVE_PAIRS[strip.kinematics.directions])
    return (moduli(strip) * np.array([[1.0], [1.0], [2.0]]))[:kept, :kept]


def moduli(strip: Strip) -> Array:
    """Moments (xx, yy, xy) of unit curvatures (κ_xx, κ_yy, κ_xy), shape (3, 3), N m.

    A section carries M_yy = ν M_xx, since it cannot bend across.
    """
    d, nu = strip.bending_stiffness, strip.material.poisson
    return d * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 1.0 - nu]])


def eigencurvature(controls: Values) -> Any:
    """Return the curvature (xx, yy, xy) (1/m) that makes no moment; ``None`` of a flat strip.

    ``strip.coil_set`` along and ``strip.crossbow`` across, positive where the top is the longer
    side, as in results: n · r,ab is minus that.

    Returns
    -------
    array or Series, shape (3, 1), or None
    """
    units = {"strip.coil_set": [[1.0], [0.0], [0.0]], "strip.crossbow": [[0.0], [1.0], [0.0]]}
    found = [np.array(unit) * controls[key] for key, unit in units.items() if key in controls]
    return sum(found[1:], found[0]) if found else None


class KirchhoffLove(LawEffect):
    """Moments of a strip against its change of curvature, less :func:`eigencurvature`.

    Parameters
    ----------
    strip : Strip
        A shell or a section.
    imperfection : ndarray, shape (unknowns,), optional
        Displacement of the reference that makes no moment.
    """

    name = "bending"
    operator: CellOperator

    def __init__(self, strip: Strip, imperfection: Array | None = None) -> None:
        frames = strip.frames()
        self.operator = CellOperator(strip, (1, 2), symmetric=True)
        self.directions = d = strip.kinematics.directions
        self.stiffness = stiffness(strip)
        self.powers = FIRST_DERIVATIVES[:d] + SECOND_DERIVATIVES[: len(self.stiffness)]
        self.reference = np.concatenate([frames.tangents, frames.seconds], axis=1)
        natural = 0.0 if imperfection is None else self.operator.apply(imperfection)
        self.curvature = self.bent(self.reference + natural)

    def bent(self, derivatives: Any) -> Any:
        """b (1/m) as (xx, yy, xy), (pairs, points), from r,a and r,ab."""
        m = normal_vector(derivatives[:, : self.directions])
        second = derivatives[:, self.directions :]
        return np.einsum("ik...,i...->k...", second, m) / np.sqrt(dot(m, m))

    def change(self, derivatives: Any, controls: Values) -> Any:
        """Return n · r,ab less that without moments (1/m), (pairs, points), from r,a and r,ab."""
        change, own = self.bent(derivatives) - self.curvature, eigencurvature(controls)
        return change if own is None else change + own[: len(self.stiffness)]

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Forces against the derivatives, (components, directions + pairs, points)."""
        derivatives = material_derivatives(x + self.reference, controls, self.powers)
        moments = np.einsum("kl,l...->k...", self.stiffness, self.change(derivatives, controls))
        forces = self.work(derivatives, weaken(moments, controls))
        return label_forces(forces, controls, self.powers)

    def work(self, derivatives: Any, moments: Any) -> Any:
        """Forces of moments against δ(n · r,ab), (components, directions + pairs, points).

        With s = Σ M_ab r,ab: M_ab n against δr,ab, and what p = (s − n n · s) / |m| makes with
        δm against δr,a.
        """
        tangents, second = derivatives[:, : self.directions], derivatives[:, self.directions :]
        m = normal_vector(tangents)
        size = np.sqrt(dot(m, m))
        n = m / size
        s = np.einsum("ik...,k...->i...", second, moments)
        p = (s - n * dot(n, s)) / size
        against = [n * moments[k] for k in range(len(self.stiffness))]
        return np.stack([*normal_work(tangents, p), *against], axis=1)
