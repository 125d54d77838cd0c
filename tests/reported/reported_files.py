"""Read what a run left in its directory, without any reader of the package."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
from click.testing import CliRunner

from anmstrip.cli import main

NODES = [(0, 0), (3, 0), (3, 3), (0, 3), (1, 0), (2, 0), (3, 1), (3, 2), (1, 3), (2, 3), (0, 1),
         (0, 2), (1, 1), (2, 1), (1, 2), (2, 2)]  # fmt: skip
"""Places (i, j) of the nodes of VTK's cubic quadrilateral: corners, edges, interior."""

THIRDS = np.linspace(0.0, 1.0, 4)
GAUSS, GAUSS_WEIGHTS = (0.5 * v for v in np.polynomial.legendre.leggauss(5))
GAUSS = GAUSS + 0.5
POWERS = np.linalg.inv(np.vander(THIRDS, increasing=True))
"""Coefficients of the cubic through four equidistant values."""


def typed(*arguments: object) -> Any:
    """Type a command of the program; an exception that is no exit fails the test."""
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def typed_apart(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Type a command in a process of its own, which may warn of the machine it is on."""
    code = f"from {main.callback.__module__} import main; main()"
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def rows_of(path: Path) -> list[dict[str, str]]:
    """Read a CSV file as one mapping for each row."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def listed(path: Path) -> list[tuple[float, Path]]:
    """List times and files of a ``.pvd``."""
    sets = ElementTree.parse(path).iter("DataSet")
    return [(float(s.attrib["timestep"]), path.parent / s.attrib["file"]) for s in sets]


@dataclass(frozen=True)
class Results:
    """A finished run: its directory, what it printed, and its exit status."""

    name: str
    directory: Path
    printed: str
    progress: str
    exit_code: int

    @cached_property
    def summary(self) -> dict[str, Any]:
        """``summary.json``."""
        found: dict[str, Any] = json.loads((self.directory / "summary.json").read_text("utf-8"))
        return found

    @cached_property
    def history(self) -> dict[str, Any]:
        """``history.csv`` by columns: floats, and text for the stages."""
        rows = rows_of(self.directory / "history.csv")
        table: dict[str, Any] = {name: [row[name] for row in rows] for name in rows[0]}
        return {n: v if n == "stage" else np.array(v, dtype=float) for n, v in table.items()}

    @cached_property
    def events(self) -> list[dict[str, str]]:
        """``events.csv``."""
        return rows_of(self.directory / "events.csv")

    @cached_property
    def states(self) -> list[tuple[float, Path]]:
        """Times and files of the written states."""
        return listed(self.directory / "strip.pvd")

    @cached_property
    def surfaces(self) -> list[Surface]:
        """All written states."""
        return [Surface(path, time) for time, path in self.states]

    @property
    def last(self) -> Surface:
        """The last written state."""
        return self.surfaces[-1]

    @cached_property
    def drawn(self) -> list[tuple[float, Any]]:
        """Times and meshes of the written rollers."""
        return [(time, meshio.read(path)) for time, path in listed(self.directory / "rollers.pvd")]


class Surface:
    """A state of the strip, seen as bicubic patches with 4 × 4 nodes.

    Arrays over patches have the axes (patch, j, i, ...): j counts across, i along.
    """

    def __init__(self, path: Path, time: float = 0.0) -> None:
        mesh = meshio.vtu.read(path)
        self.time, self.points, self.fields = time, mesh.points, mesh.point_data
        (block,) = mesh.cells
        assert block.type == "VTK_LAGRANGE_QUADRILATERAL"
        self.drawn = block.data
        place = np.array([4 * j + i for i, j in NODES])
        cells = block.data[:, np.argsort(place)].reshape(-1, 4, 4)
        flat = (mesh.points - mesh.point_data["displacement"])[cells]
        turned = np.abs(flat[:, 0, 3, 0] - flat[:, 0, 0, 0]) < 1e-12  # its first axis runs across
        self.cells = np.where(turned[:, None, None], cells.swapaxes(1, 2), cells)

    def patch(self, name: str) -> np.ndarray:
        """A field on the patches."""
        return np.asarray(self.fields[name])[self.cells]

    @cached_property
    def positions(self) -> np.ndarray:
        """Deformed positions on the patches."""
        return self.points[self.cells]

    @cached_property
    def reference(self) -> np.ndarray:
        """Positions on the flat strip on the patches."""
        return self.positions - self.patch("displacement")

    @cached_property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """Lengths and widths of the elements (m)."""
        corner, along, across = (self.reference[:, j, i] for j, i in ((0, 0), (0, 3), (3, 0)))
        return (along - corner)[:, 0], (across - corner)[:, 1]

    @property
    def width(self) -> float:
        """Width of the strip (m)."""
        return float(np.ptp(self.reference[..., 1]))

    @property
    def length(self) -> float:
        """Length of the strip (m)."""
        return float(np.ptp(self.reference[..., 0]))

    def derivative(self, values: np.ndarray, along: int = 0, across: int = 0) -> np.ndarray:
        """Differentiate the cubics through the nodes, with respect to the flat strip."""
        hx, hy = (h.reshape(-1, 1, 1, *(1,) * (values.ndim - 3)) for h in self.sizes)
        d = derivatives(THIRDS, along)
        values = np.einsum("ab,njb...->nja...", d, values)
        d = derivatives(THIRDS, across)
        return np.einsum("ab,nbi...->nai...", d, values) / (hx**along * hy**across)

    def averaged(self, values: np.ndarray) -> np.ndarray:
        """Average patchwise values over the patches that share a point, shape (points, ...)."""
        cells = self.cells.ravel()
        total = np.zeros((len(self.points), *values.shape[3:]))
        np.add.at(total, cells, values.reshape(-1, *values.shape[3:]))
        count = np.bincount(cells)
        return total / count.reshape(-1, *(1,) * (total.ndim - 1))

    @cached_property
    def tangents(self) -> tuple[np.ndarray, np.ndarray]:
        """Both tangent vectors r,1 and r,2."""
        return self.derivative(self.positions, 1), self.derivative(self.positions, 0, 1)

    def derivative_at(
        self, places: np.ndarray, values: np.ndarray, along: int = 0, across: int = 0
    ) -> np.ndarray:
        """Differentiate the cubics at a grid of places, the same along and across."""
        hx, hy = (h.reshape(-1, 1, 1, *(1,) * (values.ndim - 3)) for h in self.sizes)
        one, two = (derivatives(places, order) for order in (along, across))
        found = np.einsum("ai,bj,nji...->nba...", one, two, values)
        return np.asarray(found / (hx**along * hy**across))

    def at_gauss(self, values: np.ndarray, along: int = 0, across: int = 0) -> np.ndarray:
        """Differentiate the cubics at five by five points of Gauss."""
        return self.derivative_at(GAUSS, values, along, across)

    @cached_property
    def strain(self) -> np.ndarray:
        """Green-Lagrange strains (xx, yy, xy) at the points of Gauss."""
        a, b = self.at_gauss(self.positions, 1), self.at_gauss(self.positions, 0, 1)
        dot = [np.einsum("njic,njic->nji", *pair) for pair in ((a, a), (b, b), (a, b))]
        return np.stack([0.5 * (dot[0] - 1.0), 0.5 * (dot[1] - 1.0), 0.5 * dot[2]], axis=-1)

    def recovered(self, values: np.ndarray) -> np.ndarray:
        """What is linear along and quadratic across between means of such parts of patches.

        Means are those at the corners and in the middles of the sides across.

        Parameters
        ----------
        values : array, shape (patch, 5, 5, ...)
            At the points of Gauss.

        Returns
        -------
        array, shape (points, ...)
        """
        x = 2.0 * GAUSS - 1.0
        legendre = np.stack([np.ones(5), x, 1.5 * x**2 - 0.5])  # of norms 1, 1/3 and 1/5
        weighted = legendre * np.array([[1.0], [3.0], [5.0]]) * GAUSS_WEIGHTS
        part = np.einsum("lj,ki,nji...->nlk...", weighted, weighted[:2], values)
        ends = np.array([[1.0, -1.0], [1.0, 1.0]])
        across = np.array([[1.0, -1.0, 1.0], [1.0, 0.0, -0.5], [1.0, 1.0, 1.0]])
        places = np.einsum("jl,ik,nlk...->nji...", across, ends, part)
        corners = self.cells[:, ::3, ::3]
        sides = np.sort(corners, axis=1)  # the middle of a side, by its ends
        middles = np.unique(sides[:, 0] * len(self.points) + sides[:, 1], return_inverse=True)[1]
        middles = len(self.points) + middles.reshape(sides[:, 0].shape)
        ids = np.stack([corners[:, 0], middles, corners[:, 1]], axis=1)
        total = np.zeros((ids.max() + 1, *values.shape[3:]))
        np.add.at(total, ids.ravel(), places.reshape(-1, *values.shape[3:]))
        count = np.bincount(ids.ravel()).clip(1)
        nodes = (total / count.reshape(-1, *(1,) * (total.ndim - 1)))[ids]
        hats = np.stack([1.0 - THIRDS, THIRDS], axis=-1)
        humps = np.stack(
            [
                (1.0 - THIRDS) * (1.0 - 2.0 * THIRDS),
                4.0 * THIRDS * (1.0 - THIRDS),
                THIRDS * (2.0 * THIRDS - 1.0),
            ],
            axis=-1,
        )
        return self.averaged(np.einsum("jl,ik,nlk...->nji...", humps, hats, nodes))

    @cached_property
    def curvature(self) -> np.ndarray:
        """Curvatures (xx, yy, xy), positive where the upper side is stretched."""
        return self.curvature_at(THIRDS)

    def curvature_at(self, places: np.ndarray) -> np.ndarray:
        """Curvatures at a grid of places."""
        first = [self.derivative_at(places, self.positions, *k) for k in ((1, 0), (0, 1))]
        n = np.cross(*first)
        n /= np.linalg.norm(n, axis=-1, keepdims=True)
        orders = ((2, 0), (0, 2), (1, 1))
        second = [self.derivative_at(places, self.positions, *k) for k in orders]
        return np.stack([-np.einsum("njic,njic->nji", n, s) for s in second], axis=-1)

    # where contact is looked at: corners, middles and centres, by Simpson's rule ---------------

    def at_contact(self, values: np.ndarray) -> np.ndarray:
        """Evaluate cubics at 0, 1/2 and 1 along and across, (patch, 3, 3, ...)."""
        m = np.vander([0.0, 0.5, 1.0], 4, increasing=True) @ POWERS
        return np.einsum("aj,bi,nji...->nab...", m, m, values)

    def known_at_contact(self, name: str) -> np.ndarray:
        """Undo what leads from the contact points to the thirds of a patch.

        Linear interpolation; of forces per area the thirds have what the middle has.
        """
        force = name in ("normal_pressure", "friction_traction")
        middle = [0.0, 0.5, 0.5, 0.0] if force else [-0.5, 1.5, 0.0, 0.0]
        undo = np.array([[1.0, 0.0, 0.0, 0.0], middle, [0.0, 0.0, 0.0, 1.0]])
        return np.einsum("aj,bi,nji...->nab...", undo, undo, self.patch(name))

    @cached_property
    def areas(self) -> np.ndarray:
        """Area of every contact point within its patch (m²)."""
        simpson = np.array([1.0, 4.0, 1.0]) / 6.0
        return np.prod(self.sizes, axis=0)[:, None, None] * np.outer(simpson, simpson)

    def integral(self, values: np.ndarray) -> Any:
        """Integrate values at the contact points over the strip."""
        return np.einsum("nab,nab...->...", self.areas, values)

    def edge(self, name: str) -> np.ndarray:
        """Mean unit tangent along the strip at its entry or exit, by the mesh's nodes there."""
        slopes, x = self.tangents[0], self.reference[..., 0]
        end = x.min() if name == "entry" else x.max()
        corners = [(j, i) for j in (0, 3) for i in (0, 3)]
        places = {
            round(float(self.reference[n, j, i, 1]), 9): slopes[n, j, i]
            for n in range(len(x))
            for j, i in corners
            if abs(x[n, j, i] - end) < 1e-9
        }
        mean = np.mean(list(places.values()), axis=0)
        return np.asarray(mean / np.linalg.norm(mean))


def derivatives(places: np.ndarray, order: int) -> np.ndarray:
    """Matrix from the values of a cubic at 0, 1/3, 2/3 and 1 to its derivative at places."""
    polynomials = [np.polynomial.Polynomial(c).deriv(order) for c in POWERS.T]
    return np.stack([p(np.asarray(places)) for p in polynomials], axis=-1)


def ran(text: str, directory: Path, *settings: str, options: tuple[str, ...] = ()) -> Results:
    """Run a scene by the command and collect what it leaves."""
    scene = directory / "scene.toml"
    scene.write_text(text, encoding="utf-8")
    where = directory / "results"
    more = [part for setting in settings for part in ("--set", setting)]
    ended = typed("run", scene, "-o", where, *more, *options)
    return Results(directory.name, where, ended.stdout, ended.stderr, ended.exit_code)


def explained(text: str, directory: Path, *settings: str) -> str:
    """Say what a run of a scene would do, with every paragraph on a line of its own."""
    scene = directory / "scene.toml"
    scene.write_text(text, encoding="utf-8")
    more = [part for setting in settings for part in ("--set", setting)]
    ended = typed("explain", scene, *more)
    assert ended.exit_code == 0, ended.output
    return str(ended.stdout)
