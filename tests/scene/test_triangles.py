"""Strips of triangles: the same mechanics as on rectangles."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from numpy.typing import NDArray
from skfem import FacetBasis, MeshTri

from anmstrip.continuation.path import Outcome
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.fem.elements import facet_normals
from anmstrip.fem.operators import CellOperator, Pattern
from anmstrip.fem.sampling import ContactOperator
from anmstrip.fem.strip import Material, Strip
from anmstrip.mechanics.shell import Membrane, isometric_bending
from anmstrip.results.fields import FieldSampler
from anmstrip.results.state import State
from anmstrip.results.vtk import write_surface
from claims import Claim
from strips import CONTACT, MATERIAL, RADIUS, TENSION, capstan

Array = NDArray[np.float64]

MESHES = Path(__file__).parents[2] / "meshes"
ROLLER = {"name": "r1", "radius": RADIUS, "centre": [0.0, 0.0, -RADIUS - 1e-3]}
PULL = {"name": "pull", "duration": 1.0, "exit": {"force": [TENSION, 0.0, 0.0]}}
GROSS_CONCENTRATION = 3.74
"""Of a hole of 0.4 of the width, in units of the mean far from it (Howland 1930)."""


def distorted() -> MeshTri:
    """Eighteen triangles of any shape on 3 m by 2 m; nodes on the sides stay there."""
    mesh = MeshTri.init_tensor(np.linspace(0.0, 3.0, 4), np.linspace(0.0, 2.0, 4))
    inside = np.setdiff1d(np.arange(mesh.p.shape[1]), mesh.boundary_nodes())
    points = mesh.p.copy()
    points[:, inside] += np.random.default_rng(2).uniform(-0.2, 0.2, (2, len(inside)))
    return MeshTri(points, mesh.t)


@pytest.fixture(scope="module")
def strip() -> Strip:
    return Strip(distorted(), 1e-3, Material(2e11, 0.3))


def unknowns(strip: Strip, value: Any, slopes: Any, curvatures: Any) -> Array:
    """Displacement from fields of position: u, (u_x, u_y), (u_xx, u_xy, u_yy), each (3, ...)."""
    mesh, u = strip.mesh, np.zeros((strip.scalars, 3))
    parts = [value(mesh.p), *slopes(mesh.p), *curvatures]
    for dofs, part in zip(strip.basis.nodal_dofs, parts, strict=True):
        u[dofs] = np.broadcast_to(np.asarray(part), (3, len(dofs))).T
    middles, normals = facet_normals(mesh)
    for k, facets in enumerate(mesh.t2f):
        across = np.einsum("aie,ae->ie", np.stack(slopes(middles[k])), normals[k])
        u[strip.basis.facet_dofs[0][facets]] = across.T
    return u.ravel()


def linear(strip: Strip, gradient: Array) -> Array:
    """Displacement G X of the plane, G of shape (3, 2)."""
    nothing = np.zeros((3, 1))
    return unknowns(
        strip,
        lambda x: gradient @ x,
        lambda x: [np.tile(g[:, None], (1, x.shape[1])) for g in gradient.T],
        [nothing] * 3,
    )


def inner(strip: Strip) -> Array:
    """Degrees of freedom whose functions vanish on the boundary with their slopes."""
    nodes = np.setdiff1d(np.arange(strip.mesh.p.shape[1]), strip.mesh.boundary_nodes())
    facets = np.setdiff1d(np.arange(strip.mesh.facets.shape[1]), strip.mesh.boundary_facets())
    found = [strip.basis.nodal_dofs[:, nodes].ravel(), strip.basis.facet_dofs[0][facets]]
    return np.concatenate(found)


def forces(strip: Strip, full: Array) -> tuple[Array, Array]:
    """Of membrane and bending, each (scalars, 3), in units of values."""
    membrane = Membrane(strip)
    stress = membrane.law(membrane.operator.apply(full), None, {})
    bending = isometric_bending(strip, Pattern(strip)).force(full, None, {})
    units = strip.dof_lengths[:, None]
    own = membrane.operator.gather(stress).reshape(-1, 3)
    return own * units, bending.reshape(-1, 3) * units


def test_rigid_rotation_gives_no_force(strip: Strip) -> None:
    q, _ = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))
    membrane, bending = forces(strip, linear(strip, q[:, :2] - np.eye(3)[:, :2]))
    assert np.abs(membrane).max() < 1e-10 * strip.membrane_stiffness
    assert np.abs(bending).max() < 1e-10 * strip.bending_stiffness


def test_uniform_strain_balances_inside(strip: Strip) -> None:
    """N = C : E everywhere; nothing is left inside."""
    strain = np.array([[1e-3, 4e-4], [4e-4, -5e-4], [0.0, 0.0]])
    full = linear(strip, strain)
    membrane = Membrane(strip)
    found = membrane.forces(membrane.operator.apply(full) + membrane.flat)
    tangents = strain + np.eye(3)[:, :2]
    green = 0.5 * (tangents.T @ tangents - np.eye(2))
    expected = np.einsum("abcd,cd->ab", membrane.stiffness, green)
    np.testing.assert_allclose(found, expected[:, :, None] + 0.0 * found, rtol=1e-8)
    own, bending = forces(strip, full)
    assert np.abs(own).max() > 1e-4 * strip.membrane_stiffness
    assert np.abs(own[inner(strip)]).max() < 1e-10 * np.abs(own).max()
    assert np.abs(bending).max() < 1e-10 * strip.bending_stiffness


def test_uniform_moments_balance_inside(strip: Strip) -> None:
    """z = (a x² + 2 b x y + c y²)/2: energy ½ D [(1−ν)(a² + 2b² + c²) + ν (a + c)²] per area."""
    a, b, c = 0.7, -0.4, 0.3
    up = np.array([[0.0], [0.0], [1.0]])
    full = unknowns(
        strip,
        lambda x: up * (0.5 * a * x[0] ** 2 + b * x[0] * x[1] + 0.5 * c * x[1] ** 2),
        lambda x: [up * (a * x[0] + b * x[1]), up * (b * x[0] + c * x[1])],
        [up * a, up * b, up * c],
    )
    effect = isometric_bending(strip, Pattern(strip))
    force = effect.force(full, None, {})
    d, nu = strip.bending_stiffness, strip.material.poisson
    density = d * ((1.0 - nu) * (a**2 + 2.0 * b**2 + c**2) + nu * (a + c) ** 2)
    assert full @ force == pytest.approx(6.0 * density, rel=1e-9)
    own = np.abs(force.reshape(-1, 3)[:, 2] * strip.dof_lengths)
    assert own[inner(strip)].max() < 1e-9 * own.max()


def test_membrane_of_one_triangle_resists_all_but_rigid_motion() -> None:
    """Three motions of the plane: fewer points than those of degree 8 leave more."""
    strip = Strip(
        MeshTri(np.array([[0.0, 1.0, 0.3], [0.0, 0.1, 0.8]]), np.array([[0], [1], [2]])),
        1e-3,
        Material(2e11, 0.3),
    )
    along, across = CellOperator(strip, [1]).by_point.swapaxes(0, 1)
    nothing = np.zeros_like(along)
    strains = [
        np.hstack([along, nothing]), np.hstack([nothing, across]), np.hstack([across, along]),
    ]  # fmt: skip
    assert np.linalg.matrix_rank(np.vstack(strains)) == 2 * 21 - 3


def test_contact_points_integrate_quintics(strip: Strip) -> None:
    operator = ContactOperator(strip)
    assert operator.weights.min() > 0.0
    assert operator.points == 16 + 33 + 18 * (1 + 3)
    x, y, _ = operator.reference
    for i, j in np.argwhere(np.add.outer(np.arange(6), np.arange(6)) < 6):
        exact = 3.0 ** (i + 1) / (i + 1) * 2.0 ** (j + 1) / (j + 1)
        assert operator.weights @ (x**i * y**j) == pytest.approx(exact, rel=1e-12)


def test_uniform_pressure_is_the_load_of_every_function(strip: Strip) -> None:
    """Σ w φ = ∫ φ dA: pressures of the elements' own degree do not bend them."""
    operator = ContactOperator(strip)
    gathered = operator.gather(np.ones((3, operator.points))).reshape(-1, 3)
    exact = np.zeros(strip.scalars)
    for dofs, field in zip(strip.basis.element_dofs, strip.basis.basis, strict=True):
        np.add.at(exact, dofs, (np.asarray(field[0]) * strip.basis.dx).sum(axis=1))
    units = strip.dof_lengths
    np.testing.assert_allclose(gathered[:, 2] * units, exact * units, atol=1e-12)
    assert exact.max() > 0.1


def scene_of(mesh: Path, stages: list[dict[str, Any]], **tables: Any) -> Scene:
    return Scene.model_validate(
        {
            "strip": {"mesh": str(mesh), "thickness": 1e-3},
            "material": MATERIAL,
            "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
            "stages": stages,
            **tables,
        }
    )


def ended(scene: Scene) -> tuple[Run, State]:
    """A run to its end, and its last state."""
    run = scene.run()
    *_, last = run
    assert run.outcome is Outcome.DONE, run.message
    return run, last.state


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fewer than a hundred triangles on 2 m by 0.5 m."""
    path = tmp_path_factory.mktemp("triangles") / "coarse.msh"
    sizes = ["--size", "0.2", "--until", "0.4", "--coarse", "0.25", "--growth", "0.2"]
    command = [sys.executable, str(MESHES / "make_triangles.py"), "--length", "2"]
    subprocess.run([*command, "--width", "0.5", *sizes, "-o", str(path)], check=True)
    return path


def test_pulled_strip_stretches_and_narrows(coarse: Path) -> None:
    """N_xx = 1e4 N/m and N_yy = 0; the second Piola stress is the force over the stretch."""
    run, state = ended(scene_of(coarse, [PULL], solver={"tolerance": 1e-8}))
    membrane = run.assembly.membrane
    assert membrane is not None
    assert 20 < run.assembly.strip.mesh.nelements < 100
    tangents = membrane.operator.apply(state.full) + membrane.flat
    n, stretch = membrane.forces(tangents), tangents[0, 0]
    np.testing.assert_allclose(n[0, 0] * stretch, TENSION, rtol=1e-7)
    assert np.abs(n[1, 1]).max() + np.abs(n[0, 1]).max() < 1e-6 * TENSION
    balance = state.edge_force("entry") + state.edge_force("exit")
    assert np.abs(balance).max() < 1e-6 * TENSION
    assert state.tension("entry") == pytest.approx(TENSION, rel=1e-7)


def test_forces_balance_over_a_roller(coarse: Path) -> None:
    down = {"move": [0.0, 0.0, -0.1]}
    force = [TENSION, 0.0, -1e3]
    press = {"name": "press", "duration": 1.0, "entry": down, "exit": {"force": force}}
    tables = {"contact": CONTACT, "rollers": [ROLLER], "solver": {"tolerance": 1e-6}}
    run, state = ended(scene_of(coarse, [PULL, press], **tables))
    entry, end = state.edge_force("entry"), state.edge_force("exit")
    balance = entry + end + state.rollers["r1"].resultant
    assert np.abs(balance).max() < 1e-6 * TENSION
    np.testing.assert_allclose(end, 0.5 * np.array(force), atol=1e-6 * TENSION)
    assert np.linalg.norm(entry) == pytest.approx(np.linalg.norm(end), rel=1e-3)
    assert state.rollers["r1"].normal_force > 500.0
    sampler, path = FieldSampler(run.assembly.strip), coarse.parent / "pressed.vtu"
    write_surface(path, sampler.reference.T, sampler.cells, sampler.sample(state))
    whole = pyvista.read(path).integrate_data()
    found = float(whole["normal_pressure"][0])  # of a line of single points in contact
    assert found == pytest.approx(state.rollers["r1"].normal_force, rel=0.2)


def test_stress_at_a_hole(claim: Claim) -> None:
    """Force along the rim beside the hole, mean over the sides that end at its crown."""
    run, state = ended(scene_of(MESHES / "strip_hole.msh", [PULL]))
    strip, membrane = run.assembly.strip, run.assembly.membrane
    assert membrane is not None
    rim = FacetBasis(strip.mesh, strip.basis.elem, facets=strip.edges["hole"].facets, intorder=4)
    own = state.full.reshape(-1, 3)[rim.element_dofs]
    fields = np.stack([field[0].grad for field in rim.basis])
    tangents = np.einsum("nec,naeq->caeq", own, fields) + membrane.flat[..., None]
    n = membrane.forces(tangents.reshape(3, 2, -1)).reshape(2, 2, *rim.dx.shape)
    along = np.stack([-rim.normals[1], rim.normals[0]])
    mean = np.average(np.einsum("aeq,abeq,beq->eq", along, n, along), axis=1, weights=rim.dx[0])
    claim(
        "stress concentration at a hole",
        mean.max() / TENSION,
        GROSS_CONCENTRATION,
        0.02,
        "strip with a hole, tabulated",
    )
    height = np.abs(np.asarray(rim.global_coordinates())[1].mean(axis=1))
    assert height[mean.argmax()] == pytest.approx(0.2, abs=2e-3)
    assert mean.min() < -TENSION


@pytest.mark.slow
def test_capstan_is_that_of_rectangles() -> None:
    """Tension ratio within 0.2 %, normal force too, wrap to the distance of points."""
    rectangles = capstan("shell", 2, 0.05, 1e-4)
    tables = rectangles.model_dump(exclude_unset=True)
    mesh = {"mesh": str(MESHES / "strip_triangles.msh"), "thickness": 1e-3}
    triangles = Scene.model_validate({**tables, "strip": mesh})
    (_, expected), (_, found) = ended(rectangles), ended(triangles)
    a, b = expected.rollers["r1"], found.rollers["r1"]
    assert b.tension_ratio == pytest.approx(a.tension_ratio, rel=2e-3)
    assert b.tension_ratio == pytest.approx(1.2506, rel=2e-3)
    assert b.normal_force == pytest.approx(a.normal_force, rel=2e-3)
    assert b.drag == pytest.approx(a.drag, rel=2e-3)
    assert b.wrap == pytest.approx(a.wrap, abs=0.05 / RADIUS)
    balance = found.edge_force("entry") + found.edge_force("exit") + b.resultant
    assert np.abs(balance).max() < 1e-4 * TENSION
