"""Meshes from files: axis-aligned quadrilaterals with named edges."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from skfem import MeshQuad

from anmstrip.mechanics.strip import renumbered
from anmstrip.scene.errors import InputError, Mistake
from anmstrip.scene.wording import nearest

if TYPE_CHECKING:
    from anmstrip.scene.schema import Scene


def read_mesh(scene: Scene) -> MeshQuad:
    """Mesh of a scene's file, nodes numbered along the strip.

    Raises
    ------
    InputError
        Unreadable, no quadrilaterals, not axis-aligned, or edges of the scene missing.
    """
    path = scene.strip.mesh
    file = str(scene.source or "scene")

    def refuse(expected: str, hint: str) -> InputError:
        return InputError([Mistake(file, "strip.mesh", str(path), expected, hint)])

    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            mesh = MeshQuad.load(str(path))
    except (Exception, SystemExit) as error:
        raise refuse(
            f"a mesh of quadrilaterals that meshio reads ({str(error) or type(error).__name__})",
            "see meshes/README.md for the command that makes one",
        ) from error
    if not isinstance(mesh, MeshQuad) or len(mesh.t) != 4 or mesh.t.size == 0:
        raise refuse("quadrilaterals, at least one", "see meshes/README.md")
    if not _axis_aligned(mesh):
        raise refuse(
            "rectangles with sides along x and y", "see meshes/README.md for one that is right"
        )
    mistakes = list(_unknown_edges(scene, mesh, file))
    if mistakes:
        raise InputError(mistakes)
    return renumbered(mesh)


def _axis_aligned(mesh: MeshQuad) -> bool:
    corners = mesh.p[:, mesh.t]
    low, high = corners.min(axis=1), corners.max(axis=1)
    size = high - low
    at_corner = (np.abs(corners - low[:, None]) < 1e-6 * size[:, None]) | (
        np.abs(corners - high[:, None]) < 1e-6 * size[:, None]
    )
    return bool(at_corner.all() and (size > 0.0).all())


def _unknown_edges(scene: Scene, mesh: MeshQuad, file: str) -> Iterator[Mistake]:
    known = sorted(mesh.boundaries or {})
    wanted = [(f"edges.{name}", name) for name in scene.edges]
    wanted += [(f"stages.{s.name}.{name}", name) for s in scene.stages for name in s.edges]
    for key, name in wanted:
        if name not in known:
            yield Mistake(file, key, name, "an edge that the mesh names", nearest(name, known))
    for name in ("entry", "exit"):
        if name not in known:
            yield Mistake(
                file, "strip.mesh", name, "edges named entry and exit", "name them in the mesh"
            )
