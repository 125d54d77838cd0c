"""The mesh of a rectangular strip: finer where rollers will be."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import MeshLine, MeshQuad

from anmstrip.arrays import Array
from anmstrip.fem.strip import grid, line
from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.string_path import NoTangentError, NotTouchedError, supported_catenary
from anmstrip.scene.checks import PARALLEL_COSINE
from anmstrip.scene.schema import SceneSpec
from anmstrip.scene.tables import ENDS, THREADING, StageSpec
from anmstrip.simulation.defaults import (
    EdgeCurl,
    bending_stiffness,
    boundary_layer,
    coefficient_on,
    distributed_load,
    edge_curl,
    edge_pulls,
    first_yield,
    follows_rollers,
    largest_force,
    open_stages,
    stage_speeds,
    thermal_growth,
)
from anmstrip.simulation.threading import Interval, Thread

if TYPE_CHECKING:
    from anmstrip.mechanics.laws import ContactLaw

MAX_ELEMENTS = 250_000
"""Of a strip; the tangent of a shell of so many takes tens of gigabytes."""

BYTES_PER_UNKNOWN = 4e4
"""Of a shell whose tangent is described, not solved: 452 000 take 18 GB, 94 000 2.5 GB."""

LAYER_SHARE = 0.25
"""Share of the boundary layer √(D/T) that an element over a roller may cover."""

FINE_LAYERS = 2.0
"""Boundary layers on both sides of a place where a strip lifts on or off that are fine."""

HINGE_SHARE = 0.2
"""Share of the length over which the moment falls that a plastic hinge takes.

Before a leveller of nine rollers 30 mm apart, with 0.2 and 0.4, the tension is off by 1.0 % and
1.7 % of itself, and the curl behind it by 0.2 % and 4 %; with elements of r/8 by 12 % and 26 %."""

LENGTH_GROWTH = 0.15
"""Growth of the element length per length of strip beyond.  With 0.15 the difference of tensions
over a roller is within 0.1 % of that on an evenly fine mesh, with 0.3 within 0.3 %, with 0.6 within
1 %; with twice ``FINE_LAYERS`` it changes by 0.02 %."""

MIN_NODE_DISTANCE = 0.01
"""Least distance of two marks that become nodes, in elements.  With 0.5, which joins both ends of
the arcs of a leveller, the curl behind it is wrong by 5 %."""

LOOP_STRETCH = 0.01
"""Share of T/(E t) by which an element that bends along a loop may be stretched.

4.55 m of strip between nips 4 m apart bear 105.8 N/m at the bottom with it, as heavy elastica do,
and 0.4 N/m on straight runs of elements, of which meshes twice as fine find no such state."""

ARC_ELEMENT = 0.05
"""Longest element inside an arc, over the radius.  The tension of a strip that
sticks is off by 7e-5 of itself with 0.1, by 1e-6 with 0.05: a cubic stretches on a circle."""

MIN_LIFT_ELEMENT, MAX_LIFT_ELEMENT = 1.0 / 64.0, 1.0 / 8.0
"""Shares of a roller's radius between which elements are by default where the strip lifts off.

On foil in full slip over half a turn, with √(D/T) a 440th of the radius, the ratio of tensions is
off by 5e-5, 1e-5 and 2e-5 of itself with a 64th, a 32nd and a 16th."""

NIP_PARTS = 4.0
"""Parts of a usual element where rollers nip the strip: their force is then that of the law, not
1.8 times as much because a point is in the middle."""

HINGE_PARTS = 2.0
"""Parts of a usual element where strip yields in hinges.  The drives of a leveller of seven rollers
give 366 W with one, 513 W with two and 473 W with four; it yields by 500 W."""

NIP_ELEMENT = 1.0 / 12.0
"""The same at most of rollers that nip the strip.  Of 21 pinch rolls that close by up to 0.05 mm
more than the strip is thick, at seven places between its nodes, an eighth of the radius stops 15
when they begin to turn, a twelfth none."""

FORCE_PARTS = 2.0
"""The same of sections where rollers press with given forces: with one part paper that is drawn by
1 200 N/m between nips gets 7 % less, with two 2 %.  A shell at a tolerance
of 1e-5 takes 95 tangents with one and more than 300 with two, as slip comes to each point in turn.
"""

FORCE_ONSET = 0.05
"""Largest onset of contact, over the thickness, that spreads given forces of nips over an element.
Paper that is drawn by 600 and by 1 200 N/m between two nips, or gathers there, takes 35, 137 and
432 tangents with 0.02 and 29, 92 and 292 with 0.05.  With the usual onset it takes 44, with 247 N/m
for 600, comes to no end, and takes 949."""

SETTLING_DEPTH = 0.0125
"""Depth by which one roller may bear deeper than others, over that which takes all its load off it.

Loads of 24 plates of 4 to 60 mm on three to seven rollers are off by 2 % of their mean at most,
half of them by 0.4 %; with 0.015 by 2.3 %, with 0.01 by 1.5 %, but a plate that is carried takes a
sixth more tangents."""

MAX_CONTACT_PARTS = 32
"""Parts of an element with their own points of contact.  With 16 the loads of a plate of 50 mm on
rollers of 0.3 m are off by 2.3 %, with 32 by less than 2 %."""

MIN_FALL_DEPTH = 0.1
"""Least depth over the gap to a roller at the beginning.  Of eight plates that fall by 20 to 2 800
times the onset four do not arrive, of eight that fall by 10 to 170 times all do."""

MAX_LYING_TURN = 0.1
"""Angle (rad) by which a taut string turns at most on the rollers that strip only lies on."""

CURL_SHARE = 0.35
"""Share of a roller's friction, under the largest tension, that edges which curl off it may need.

Between two bridle rolls at one speed the tension is higher by 0.3 % with 0.29 (by 0.9 % where the
second is about to slide) and by 3 % with 0.45."""

CURL_ARC = 4.0
"""Length of an arc, over the width on which edges curl, from which on they do so in full."""

CURL_WIDTH = 5.0
"""Width of strip, over that on which an edge curls, up to which all of it does: with 4.4 the
tension between two bridle rolls is that before them to 0.2 %."""

CURL_LINES = 0.8, 2.0
"""Distances of lines of nodes from a free edge, over the width on which it curls: between two
bridle rolls the tension is within 0.3 % of that on elements 1.5 to 2 times shorter."""

NIP_RANGE = 80.0
"""Onsets of contact over which the pressure of a nip is summed up."""

NIP_GAP = 1.0 + 1e-6
"""Gap, in thicknesses of the strip, up to which facing rollers nip it: round-off of centres."""

MIN_ELEMENTS = 20
"""Least number of elements along a strip by default."""

DEFAULT_UNKNOWNS, UNKNOWNS_PER_ROLLER = 12_000, 300
"""Of a mesh by default: at most so many, or so many for each roller.

With 75 for each, 161 rollers are threaded in 108 tangents instead of 16."""

CORNER_SHARE, MAX_CORNERS_ACROSS = 0.05, 8
"""A change of slope across is a corner from this share of the largest on; more are a curve."""

FOLLOWED_DRIFT = 0.25
"""Way of labels over their rollers, over the boundary layer √(D/T), from which on they follow: as
much as the finest elements are long, so that less hardly matters to the mesh."""

FOLLOWED_PULL = 1e-4
"""Change of tension by drift over lines of contact, over the tension, from which on labels follow.

One at δ beside the top of a roller of radius r bears its force P aslant, by P δ/r: on thirty hearth
rolls the tension was off by 1 %."""

HEAT_PLACES = 1000
"""Places along the way at which it is summed up by how much heat lengthens the strip."""

MAX_FINER = 64.0
"""Largest ``strip.finer``."""

MAX_FINER_STEP = 1.5
"""Factor by which elements are shortened at once where the least ``strip.finer`` is looked for."""

MAX_SAMPLES = 1_000_000
"""Most places at which the length of elements is looked at."""


def fits_into_memory(scene: SceneSpec, unknowns: int) -> None:
    """Refuse a shell that this machine would give up while it is described."""
    needed, there = BYTES_PER_UNKNOWN * unknowns, memory_of_machine()
    if needed > there:
        spec = scene.strip
        finer = mesh_density(scene) * np.sqrt(0.5 * there / needed)
        given = {"finer": spec.finer, "refined": spec.refined, "cells": spec.cells}
        key = next((key for key, value in given.items() if value is not None), "finer")
        expected = (
            f"a mesh that fits into the {there / 1e9:.0f} GB of this machine: {unknowns} unknowns "
            f"take {needed / 1e9:.0f} GB"
        )
        hint = f"finer = {finer:.2g}" if key == "finer" else f"finer = {finer:.2g}, and no {key}"
        raise scene.refused(f"strip.{key}", given[key], expected, hint)


def memory_of_machine() -> float:
    """Bytes of memory; infinite where the system does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, OSError, ValueError):
        return np.inf


@dataclass(frozen=True)
class Zone:
    """A stretch of strip, in the reference, that is to have elements of a length."""

    first: float  # m
    last: float  # m
    size: float  # m


class Refinement(NamedTuple):
    """A mesh by default that is finer by a factor."""

    finer: float
    unknowns: int
    elements: int


@dataclass(frozen=True)
class Layout:
    """Rollers and the way of the strip past them, by which its elements are as long as they are.

    Attributes
    ----------
    scene : SceneSpec
    rollers : sequence of Roller
    thread : Thread or None
        The way of a threaded strip.
    """

    scene: SceneSpec
    rollers: Sequence[Roller]
    thread: Thread | None

    @cached_property
    def half(self) -> float:
        """Half the length of the strip (m)."""
        length = self.scene.strip.length if self.thread is None else self.thread.length
        assert length is not None
        return length / 2.0

    @property
    def mesh(self) -> MeshQuad | MeshLine:
        """Rectangles, or lines of a section, finer over and near the rollers.

        Without ``strip.cells`` see :meth:`default_zones`.  With it, the fine part covers a quarter
        of each roller's circumference on both sides of its axis, or the arc on which a threaded
        strip touches it, and the stretch that is carried over it.  A mesh that stands still, as
        that of a strip that is fed, is fine where the strip lifts on and off alone, and there it
        has nodes: a string has corners of its curvature there.  ``strip.finer`` multiplies the
        numbers of elements.
        """
        scene, spec, across = self.scene, self.scene.strip, self.lines_across
        assert spec.width is not None
        section = spec.kinematics == "section"
        xs = self.by_default() if spec.cells is None else self.chosen(spec.cells)
        count = (len(xs) - 1) * (1 if section else len(across) - 1)
        if spec.finer is not None and count > MAX_ELEMENTS:
            expected = f"at most {MAX_ELEMENTS} elements; there would be {count}"
            raise scene.refused("strip.finer", spec.finer, expected, "finer = 1.0")
        if spec.kinematics == "shell":
            fits_into_memory(scene, unknowns_per_line(scene, len(across) - 1) * len(xs))
        return line(xs) if section else grid(xs, across * spec.width)

    @property
    def lines_across(self) -> Array:
        """Lines of nodes along (y / width), closer beside edges that curl, see :attr:`curled`."""
        spec = self.scene.strip
        shares = [curl.width / (spec.width or 1.0) for curl, _ in self.curled.values()]
        if spec.cells is not None or not shares:
            return lines_across(self.scene)
        return lines_across(self.scene, [at * max(shares) for at in CURL_LINES])

    @property
    def curled(self) -> dict[str, tuple[EdgeCurl, float]]:
        """Return those of :attr:`curling` on which the middle of the strip stays flat across."""
        width, found = self.scene.strip.width or 0.0, self.curling.items()
        return {name: each for name, each in found if CURL_WIDTH * each[0].width < width}

    @cached_property
    def curling(self) -> dict[str, tuple[EdgeCurl, float]]:
        """Rollers of one drive that free edges curl off, and the friction (N) on each of them.

        What stretches these edges friction has to bring up where strip comes on, and to take back
        where it leaves.  Where that is no longer a small share, less is left for the tension
        between two rollers whose speeds share it out.
        """
        scene, thread, found = self.scene, self.thread, dict[str, tuple[EdgeCurl, float]]()
        width = scene.strip.width or 0.0
        sides = {*scene.edges, *(name for stage in scene.stages for name in stage.edges)} - {*ENDS}
        led = {spec.name: spec for spec in scene.rollers if spec.drive == "speed"}
        if thread is None or not scene.strip.bending or sides or len(led) < 2:
            return found
        for roller, turn in zip(thread.rollers, thread.middle.arcs.turn[:, 0], strict=True):
            if (spec := led.get(roller.name)) is None:
                continue
            curl = edge_curl(scene, roller.radius)
            friction = coefficient_on(scene, spec) * largest_force(scene) * turn * width
            full = roller.radius * turn > CURL_ARC * curl.width
            if full and 2.0 * curl.force > CURL_SHARE * friction > 0.0:
                found[roller.name] = curl, friction
        return found

    @property
    def lifts(self) -> list[float]:
        """Labels at which a strip lifts on and off for good (m)."""
        if self.thread is None or not contact_stands(self.scene):
            return []
        return sorted(x for arc in self.thread.arcs.values() for x in arc)

    @property
    def corners(self) -> list[float]:
        """Labels at which heat or flatness has corners along (m), as the stretch then has."""
        given = [value for shape in self.scene.shapes for value in shape.natural.values()]
        places = sorted({at for value in given for at, _ in getattr(value, "along", ())})
        return [at - self.half for at in places if 0.0 < at < 2.0 * self.half]

    def by_default(self) -> Array:
        """Coordinates of nodes of a scene without ``strip.cells``, see :meth:`default_zones`.

        All are longer by one factor where there would be more than :func:`most_unknowns`, beside
        what edges that curl take.
        """
        scene, coarse = self.scene, 2.0 * self.half / MIN_ELEMENTS
        across = len(lines_across(scene)) - 1
        per_line = unknowns_per_line(scene, round(across / mesh_density(scene)))
        most = most_unknowns(len(self.rollers)) // per_line - 1
        zones, marks = self.default_zones(), sorted([*self.lifts, *self.corners])
        return graded_nodes(self.half, zones, coarse, marks, most, mesh_density(scene))

    def default_zones(self) -> list[Zone]:
        """Stretches where the strip lifts on and off its rollers, and their arcs.

        Where it lifts on and off, elements have a quarter of the boundary layer √(D/T), over all
        labels that will pass; on arcs in between they have twice as much.
        """
        scene, thread, zones = self.scene, self.thread, list[Zone]()
        back, ahead = (0.0, 0.0) if contact_stands(scene) else self.travel
        pairs = zip(self.rollers, self.wanted_sizes, strict=True)
        for roller, size in pairs if scene.contact is not None else ():
            margin = fine_beside(self.bending_layer, size)
            lifts = np.array([arc[roller.name] for arc in self.arcs if roller.name in arc])
            if not len(lifts):  # anywhere near where the strip passes the roller
                moves = [stage.moves.get(roller.name) for stage in scene.stages]
                ways = [(0.0, 0.0, 0.0), *filter(None, moves)]
                places = axis_crossing(roller) + np.array(ways)[:, [0, 2]]
                x = places[:, 0] if thread is None else [thread.passing(p)[0] for p in places]
                reach = 0.5 * np.pi * roller.radius
                lifts, margin = np.array([[min(x) - reach, max(x) + reach]] * 2).T, 0.0
            first, last = lifts.min(axis=0) - ahead - margin, lifts.max(axis=0) + back + margin
            zones += [Zone(float(lo), float(hi), size) for lo, hi in zip(first, last, strict=True)]
            arc = min(2.0 * size, max(size, ARC_ELEMENT * roller.radius))
            zones.append(Zone(float(lifts.min()), float(lifts.max()), arc))
        zones += self._loops()
        ends = curved_ends(scene)
        if ends and (layer := boundary_layer(scene)):
            size = scene.strip.element_length or 0.5 * LAYER_SHARE * layer
            if scene.strip.element_length is None and not curved_all_over(scene):
                least = min((roller.radius for roller in self.rollers), default=0.0)
                size = max(size, MIN_LIFT_ELEMENT * least)  # as over them
            near = fine_beside(layer, size) - self.half
            sides = {"entry": Zone(-self.half, near, size), "exit": Zone(-near, self.half, size)}
            zones += [sides[name] for name in ends]
        return zones

    def _loops(self) -> Iterator[Zone]:
        """Runs that hang through, at their least tension in a stage.

        An element of length h along a curvature κ is stretched by (κ h)⁴/720, as a cubic is, which
        is a share of T/(E t); κ = q/T with the weight q across the run.
        """
        thread, scene = self.thread, self.scene
        if thread is None or not any(stage.gravity for stage in scene.stages):
            return
        spans = np.diff([-self.half, *np.ravel([*thread.arcs.values()]), self.half])[::2]
        begins = [-self.half, *(last for _, last in thread.arcs.values())]
        sizes = np.full(len(begins), np.inf)
        path = thread.middle
        x, z = path.at(path.starts[1::2, 0], 0)[0] - path.points[:, ::2, 0]
        level = np.abs(x) / np.maximum(np.hypot(x, z), np.finfo(float).tiny)
        for stage, loads in zip(scene.stages, loads_in_stages(scene), strict=True):
            weights = loads.weight * level
            pulls = pulls_of_runs(thread, loads) * np.cos(hanging_runs(thread, loads)[:, 2])
            sags = np.sqrt(0.375 * spans * self.gathered[stage.name][0])
            loops = np.divide(weights * spans**2, 8.0 * sags, out=pulls, where=sags > 0.0)
            loose = np.maximum(loops, 0.125 * weights * spans)
            strain = 720.0 * LOOP_STRETCH * loose / loads.stiffness
            size = np.divide(strain**0.25 * loose, weights, out=sizes.copy(), where=weights > 0.0)
            sizes = np.fmin(sizes, size)
        for begin, span, size in zip(begins, spans, sizes, strict=True):
            yield Zone(float(begin), float(begin + span), float(size))

    def chosen(self, cells: tuple[int, int]) -> Array:
        """Coordinates of nodes with the number of elements of ``strip.cells``, and finer ones."""
        scene, spec, half, thread = self.scene, self.scene.strip, self.half, self.thread
        coarse = 2.0 * half / cells[0]
        fine = spec.element_length or LAYER_SHARE * boundary_layer(scene) or np.inf
        zones = list[Interval]()
        if scene.contact is not None and fine < coarse:
            zones = self.fine_zones(self.rollers)
        graded = list[Zone]()
        if zones and thread is not None and self.lifts:
            near = FINE_LAYERS * max(boundary_layer(scene), fine / LAYER_SHARE)
            others = [r for r in self.rollers if r.name not in thread.arcs]  # they may touch it
            zones = [(x - near, x + near) for x in self.lifts]
            zones += self.fine_zones(others)
            graded = [Zone(*zone, fine) for zone in zones]
            graded += [Zone(*thread.arcs[r.name], ARC_ELEMENT * r.radius) for r in thread.rollers]
        self._refuse_more(cells, zones, fine)
        if graded:
            return graded_nodes(half, graded, coarse, self.lifts, finer=mesh_density(scene))
        return lines_of_nodes(half, zones, fine / mesh_density(scene), coarse / mesh_density(scene))

    def _refuse_more(self, cells: tuple[int, int], zones: list[Interval], fine: float) -> None:
        """Refuse more elements than fit into a computer, before they are made."""
        scene, half = self.scene, self.half
        across = 1 if scene.strip.kinematics == "section" else cells[1]
        along = cells[0] + sum(hi - lo for lo, hi in zones) / fine
        if not along * across <= MAX_ELEMENTS:
            key, now = ("refined", fine) if zones else ("cells", list(cells))
            finest = 2.0 * half * across / (0.5 * MAX_ELEMENTS)
            expected = (
                f"at most {MAX_ELEMENTS} elements; {along * across:.3g} would come from elements "
                f"of {fine if zones else 2.0 * half / along:.3g} m"
            )
            hint = f"refined = {finest:.1g}" if zones else "cells = [16, 2]"
            raise scene.refused(f"strip.{key}", now, expected, hint)

    def refined(self, longest: float) -> Refinement:
        """Return a ``strip.finer``, of two digits, with which the shortest elements are that long.

        Meshes are looked at until one does, since elements do not shrink in proportion: marks are
        nodes, and numbers across are whole.  It is at least what was typed and the usual 1, and at
        most :data:`MAX_FINER`.
        """
        scene, factor = self.scene, max(1.0, mesh_density(self.scene))
        while True:
            layout = replace(self, scene=scene.with_values(strip={"finer": factor}))
            xs, across = layout.by_default(), len(layout.lines_across) - 1
            shortest = float(np.diff(xs).min())
            if shortest <= longest or factor >= MAX_FINER:
                across = 1 if scene.strip.kinematics == "section" else across
                unknowns = len(xs) * unknowns_per_line(scene, across)
                return Refinement(factor, unknowns, (len(xs) - 1) * across)
            step = 10.0 ** (np.floor(np.log10(factor)) - 1.0)
            wanted = factor * min(shortest / longest, MAX_FINER_STEP)
            factor = float(step * np.ceil(max(wanted, factor + step) / step - 1e-9))
            factor = min(round(factor, 9), MAX_FINER)

    @property
    def contact_parts(self) -> int:
        """Number of parts along with contact points of their own that an element has.

        Of a section as many as bear on a roller no deeper than asked for between two points of
        contact, see :attr:`deepest_bearing`: stiff strip bends little within an element, whose load
        on a roller must be known all the same.  So must its moment about the roller's axis, which
        is none, where strip yields along the line on which it touches, and the force of a nip.
        """
        spec = self.scene.strip
        typed = spec.cells is not None or spec.element_length is not None
        section = spec.kinematics == "section"
        if spec.mesh is not None or typed or not (section or self.nipping):
            return 1
        hinges, parts = self.bending_layer < boundary_layer(self.scene), [1.0]
        given = {name for nip in self.given_nips for name in nip.names}
        least = NIP_PARTS if self.nipping - given else 1.0
        if section:
            least = max(least, FORCE_PARTS * bool(given))
            bearing = zip(self.deepest_bearing, self.rollers, self.wanted_sizes, strict=True)
            parts += [h / (4.0 * np.sqrt(2.0 * d * r.radius)) for d, r, h in bearing]
            least = max(least, HINGE_PARTS * hinges)
        parts.append(least / mesh_density(self.scene))
        return int(np.clip(np.ceil(max(parts)), 1, MAX_CONTACT_PARTS))

    @cached_property
    def wanted_sizes(self) -> list[float]:
        """Lengths (m) of elements by default over rollers."""
        scene, layer = self.scene, self.bending_layer
        pairs = zip(self.rollers, self.deepest_bearing, strict=True)
        found = [wanted_size(scene, r.radius, layer, d, r.name in self.nipping) for r, d in pairs]
        if scene.strip.element_length is not None:
            return found
        most = 2.0 * FORCE_ONSET * scene.strip.thickness
        for k, roller in enumerate(self.rollers):
            nips = (nip for nip in self.given_nips if roller.name in nip.names)
            found[k] = min([found[k], *(float(np.sqrt(most / nip.curvature)) for nip in nips)])
        return found

    @property
    def given_nips(self) -> list[Nip]:
        """Nips of rollers that are pressed with a given force, in any stage."""
        names = {roller.name for roller in self.scene.rollers if roller.press is not None}
        return [nip for nips in self.nips for nip in nips if names.intersection(nip.names)]

    @property
    def nip_onset(self) -> float:
        """Onset of contact (m) by which given forces of nips press over an element, 0 without any.

        With the default one they press over a third of it, and its strip cannot follow friction
        that comes and goes there.
        """
        sizes = {r.name: size for r, size in zip(self.rollers, self.wanted_sizes, strict=True)}
        shorter = {nip: min(sizes[name] for name in nip.names) for nip in self.given_nips}
        onsets = (0.5 * size**2 * nip.curvature for nip, size in shorter.items())
        return min(max(onsets, default=0.0), FORCE_ONSET * self.scene.strip.thickness)

    @property
    def shortest_wanted(self) -> float:
        """Length (m) of elements by default over the roller where it is shortest."""
        return min(self.wanted_sizes, default=0.0)

    @cached_property
    def deepest_bearing(self) -> Array:
        """Depth (m) by which a flat strip that lies on rollers may bear deeper on each, (rollers,).

        One support of many, a pitch p apart, that sinks by δ loses (15 D/p³ + 4 T/p) δ of its load
        q p.  Infinite where strip is wound round rollers, resists nothing, or nothing lays it on
        them.  Strip that first falls meets a softer contact; one that is threaded lies there.
        """
        scene, thread, sides = self.scene, self.thread, dict[float, list[float]]()
        load = distributed_load(scene)
        for roller in self.rollers:
            sides.setdefault(np.sign(roller.centre[2]), []).append(roller.centre[0])
        pitches = [pitch for xs in sides.values() for pitch in np.diff(np.sort(xs)) if pitch > 0.0]
        wound = thread is not None and thread.middle.arcs.turn.max(initial=0.0) > MAX_LYING_TURN
        if wound or not load or not pitches:
            return np.full(len(self.rollers), np.inf)
        p = min(pitches)
        stiffness = 15.0 * bending_stiffness(scene) / p**3 + 4.0 * largest_force(scene) / p
        falls = np.array([abs(r.centre[2]) - r.radius - r.half for r in self.rollers])
        falls *= thread is None
        lying = SETTLING_DEPTH * load * p / stiffness if stiffness else np.inf
        return np.maximum(lying, MIN_FALL_DEPTH * falls)

    @cached_property
    def bending_layer(self) -> float:
        """Length (m) in which the strip bends onto its rollers: √(D/T), or less where it yields."""
        layer, typed = boundary_layer(self.scene), self.scene.strip.element_length is not None
        return layer if typed or not labels_stay(self.scene) else min(layer, self.hinge_length)

    @cached_property
    def hinge_length(self) -> float:
        """Length (m) of the shortest plastic hinge on a roller, infinite without any.

        The moment falls to zero over L, half the run to the next roller or √(3D/T) if that is less.
        Strip that turns by θ on a roller of radius r begins to yield where the smaller of 3θ/2L and
        1/r is κ_e, and then bends in a plastic hinge, much shorter than L.
        """
        thread, yields = self.thread, first_yield(self.scene)
        shell = self.scene.strip.kinematics != "section"  # whose layers would be too many
        if yields is None or shell:
            return np.inf
        if thread is None:
            return self._pressed_hinge(yields)
        runs, layer = np.diff(thread.middle.starts[:, 0])[::2], boundary_layer(self.scene)
        falls = np.minimum(0.5 * np.minimum(runs[:-1], runs[1:]), np.sqrt(3.0) * layer)
        sharpest = 1.0 / np.array([roller.radius for roller in thread.rollers])
        bends = np.minimum(1.5 * thread.middle.arcs.turn[:, 0] / falls, sharpest)
        return float(np.min(HINGE_SHARE * falls, where=bends > yields, initial=np.inf))

    def _pressed_hinge(self, yields: float) -> float:
        """The same of flat strip that moves d of rollers bend, by 3 d/a² at first.

        The moment falls to zero over the way a to the next roller, and the hinge takes a quarter of
        the usual share: plate of 20 mm that is bent by 30 mm between rollers 0.8 m apart is 23 %
        less curved on elements of a/27 over the rollers, 6 % on those of a/80.
        """
        found, centres = np.inf, np.array([roller.centre[0] for roller in self.rollers])
        for roller in self.rollers:
            moves = (stage.moves.get(roller.name, (0.0,) * 3) for stage in self.scene.stages)
            depth, ways = max(abs(move[2]) for move in moves), abs(centres - roller.centre[0])
            a = float(np.min(ways, where=ways > 0.0, initial=np.inf))
            if min(3.0 * depth / a**2, 1.0 / roller.radius) > yields:
                found = min(found, 0.25 * HINGE_SHARE * a)
        return found

    @cached_property
    def nips(self) -> list[list[Nip]]:
        """Nips at the beginning and at the end of each stage."""
        thread, thickness = self.thread, self.scene.strip.thickness
        found = [nips_of(self.rollers, thread, thickness)]
        for places in rollers_in_stages(self.scene, self.rollers):
            found.append(found[-1] if places is None else nips_of(places, thread, thickness))
        return found

    @cached_property
    def nipping(self) -> set[str]:
        """Names of rollers that nip the strip in any stage."""
        return {name for nips in self.nips for nip in nips for name in nip.names}

    def gathered_in(self, stage: StageSpec) -> tuple[Array, Array]:
        """Unstressed strip (m) that nips have pushed into runs by a stage's end, (rollers + 1,).

        And the part of what comes in the stage that grows with the square of time.  One of a map
        keeps what there is.
        """
        *_, (last, _) = self.gathered.values()
        return self.gathered.get(stage.name, (last, 0.0 * last))

    @cached_property
    def gathered(self) -> dict[str, tuple[Array, Array]]:
        """Stage → what ``gathered_in`` returns.

        Of neighbouring nips the first brings ∫ V dt and the second takes ∫ V' dt away, at speeds
        that are linear in time.  A run cannot give off more than it was given.
        """
        names = [roller.name for roller in self.thread.rollers] if self.thread else []
        speeds = {spec.name: 0.0 for spec in self.scene.rollers if spec.drive == "speed"}
        held, opened = np.zeros(len(names) + 1), open_stages(self.scene)
        found = {THREADING: (held, held)}
        for stage, nips in zip(self.scene.stages, self.nips[1:], strict=True):
            before, held, bent = dict(speeds), held.copy(), 0.0 * held
            given = {r.name: surface_speed(stage, r) for r in self.rollers}
            speeds |= {key: v for key, v in given.items() if key in speeds and v is not None}
            pairs = [pair for nip in nips for pair in (nip.names, nip.names[::-1])]
            brought = {
                one: np.array([before[drive], speeds[drive]])
                for one, other in pairs
                for drive in (other, one)
                if drive in speeds
            }
            in_time = stage in opened and not stage.steady
            for run, (first, second) in enumerate(pairwise(names), 1):
                if in_time and {first, second} <= brought.keys() and (first, second) not in pairs:
                    begun, ended = 0.5 * stage.duration * (brought[first] - brought[second])
                    held[run] = max(0.0, held[run] + begun + ended)
                    bent[run] = (ended - begun) * (held[run] > 0.0)
            found[stage.name] = held, bent
        return found

    @cached_property
    def pressed(self) -> list[LooseRoller]:
        """Rollers without a wrap that moves press into fed strip, in any stage; nips do not."""
        scene, thread, stages = self.scene, self.thread, open_stages(self.scene)
        if thread is None or not stages:
            return []
        loose = {name for stage in stages for name in stage.moves} - set(thread.arcs)
        if not loose or not (loose := loose - self.nipping):
            return []
        found, arcs = list[LooseRoller](), list(thread.arcs.values())
        for roller in self.rollers:
            if roller.name in loose and abs(roller.unit_axis[1]) > 0.1:
                label, sense = thread.passing(axis_crossing(roller))
                if not any(first <= label <= last for first, last in arcs):
                    run = sum(last < label for _, last in arcs)
                    found.append(LooseRoller(roller, run, label, sense))
        reached = set[str]()
        for places in rollers_in_stages(scene, [*thread.rollers, *(each.roller for each in found)]):
            with suppress(NotTouchedError, NoTangentError):
                wide, _ = threaded_around(thread, found, places)
                reached |= {roller.name for roller in wide.rollers}
        return [other for other in found if other.roller.name in reached]

    @cached_property
    def arcs(self) -> list[dict[str, Interval]]:
        """Arcs of a threaded strip at the beginning and, where rollers move or weight acts, later.

        Where labels follow rollers, the middle of an arc stays where it was.
        """
        if (thread := self.thread) is None:
            return []
        arcs, taut, others = [thread.arcs], thread, self.pressed
        here: Sequence[Roller] | None = None
        places = rollers_in_stages(self.scene, [*thread.rollers, *(each.roller for each in others)])
        for rollers, loads in zip(places, loads_in_stages(self.scene), strict=True):
            with suppress(NotTouchedError, NoTangentError):
                if rollers is not None:
                    own, here = rollers[: len(thread.rollers)], rollers
                    taut = replace(thread, rollers=own, given=thread.length)
                wide = threaded_around(thread, others, here)[0] if others else taut
                now = {name: arc for name, arc in wide.arcs.items() if name in thread.arcs}
                if follows_rollers(self.scene) or others:
                    for name, (first, last) in now.items():
                        shift = 0.5 * (sum(thread.arcs[name]) - first - last)
                        now[name] = first + shift, last + shift
                arcs.append(now)
                if (runs := hanging_runs(taut, loads))[:, 1:].any():
                    arcs.append(hanging_arcs(taut, now, runs))
        return arcs

    @property
    def follows(self) -> bool:
        """Whether labels of a fed strip follow their rollers or stay on them.

        They follow rollers that move, also as others are pressed into the strip, and stay where
        weight, tension or heat lengthens it, or strip gathers between nips.
        """
        scene, thread, passes = self.scene, self.thread, open_stages(self.scene)
        if thread is None or not passes:
            return False
        if (
            follows_rollers(scene)
            or self.pressed
            or any(np.any(held) for held, _ in self.gathered.values())
        ):
            return True
        places = np.linspace(0.0, thread.length, HEAT_PLACES)
        layer, turns = boundary_layer(scene), np.abs(thread.middle.arcs.turn[:, 0])
        radii = np.array([roller.radius for roller in thread.rollers])
        for stage, loads in zip(scene.stages, loads_in_stages(scene), strict=True):
            if stage not in passes:
                continue
            drifts = taken_up(thread, loads, lengths_of_runs(thread)).cumsum()
            angles = np.abs(hanging_runs(thread, loads)[:, 1:])
            forces = np.where(turns * radii < layer, turns + angles[1:, 0] + angles[:-1, 1], 0.0)
            if (given := stage.strip.temperature) is not None:
                heat = thermal_growth(scene, given, places).cumsum() * places[1]
                drifts = np.append(drifts, heat)
            drift = float(np.abs(drifts).max())
            if drift > FOLLOWED_DRIFT * layer or drift * np.sum(forces / radii) > FOLLOWED_PULL:
                return True
        return False

    def fine_zones(self, rollers: Sequence[Roller]) -> list[Interval]:
        """Stretches of strip, in the reference, that come to lie on some of the rollers."""
        zones, united = [], list[Interval]()
        half, thread = self.half, self.thread
        threaded = {} if thread is None else thread.arcs
        margin = 4.0 * min(boundary_layer(self.scene), half)
        back, ahead = self.travel
        for roller in rollers:
            reach = 0.5 * np.pi * roller.radius
            middle = roller.centre[0] if thread is None else label_at(roller, thread)
            first, last = middle - reach, middle + reach
            if roller.name in threaded:
                first, last = threaded[roller.name]
                first, last = first - margin, last + margin
            zones.append((max(-half, float(first - ahead)), min(half, float(last + back))))
        for lo, hi in sorted((lo, hi) for lo, hi in zones if lo < hi):
            if united and lo <= united[-1][1]:
                united[-1] = (united[-1][0], max(hi, united[-1][1]))
            else:
                united.append((lo, hi))
        return united

    @property
    def travel(self) -> tuple[float, float]:
        """Largest travel of the strip, backwards and forwards (m).

        That of the edges that stay held, or of any roller's surface where none is held, or one is
        let go and the other stands: a roller that stands does not hold a strip that others carry
        over it.  Where only torques drive the strip, its travel is not known, and all of it may
        pass.  A strip that is fed stays where it is.
        """
        scene = self.scene
        if scene.strip.feed:
            return 0.0, 0.0
        held = {edge for edge, spec in scene.edges.items() if spec.fixed}
        ways = []
        for edge in held - scene.released:
            ways.append(_travel(scene, [s.edge(edge).signed_speed for s in scene.stages]))
        if (not held or scene.released) and not any(map(any, ways)):
            drives = {roller.drive for roller in scene.rollers}
            if "torque" in drives and "speed" not in drives:
                return np.inf, np.inf
            for roller in self.rollers:
                sense = carrying_sense(roller, self.thread) * roller.sense
                own = [surface_speed(stage, roller) for stage in scene.stages]
                ways.append(_travel(scene, [None if s is None else sense * s for s in own]))
        return max((b for b, _ in ways), default=0.0), max((a for _, a in ways), default=0.0)


def unknowns_per_line(scene: SceneSpec, across: int) -> int:
    """Return the number of unknowns on a line of nodes with so many elements across."""
    level = scene.strip.kinematics
    return 4 if level == "section" else {"plate": 4, "shell": 12}[level] * (across + 1)


def lines_across(scene: SceneSpec, beside: Sequence[float] = ()) -> Array:
    """Return y / width of the lines of nodes along: as typed, or enough for what varies across.

    Those are equally far apart between corners of heat and flatness, which are nodes, and the
    middle: that of an edge is a node where their number is even.  Further ones are beside both
    edges, at distances over the width.
    """
    usual = 8 if any(roller.profile for roller in scene.rollers) else 4
    count = usual if scene.strip.cells is None else scene.strip.cells[1]
    corners = [] if scene.strip.cells is not None else corners_across(scene)
    near = 0.0 if any(edge.centred for edge in scene.edges.values()) else 0.25 / count
    middle = count % 2 == 0 and all(abs(at) > near for at in corners)
    inner = 0.5 - max(beside, default=0.0)
    edges = [side * (0.5 - at) for at in beside for side in (-1.0, 1.0)]
    marks = np.sort([-0.5, *corners, *edges, *[0.0] * middle, 0.5])
    outside = np.abs(marks[1:] + marks[:-1]) > 2.0 * inner
    counts = np.maximum(np.diff(marks) * count, outside) * mesh_density(scene)
    counts = np.ceil(counts - 1e-9) if corners or edges else np.maximum(np.round(counts), 1.0)
    pieces = zip(pairwise(marks), counts, strict=True)
    parts = [np.linspace(a, b, 1 + int(n)) for (a, b), n in pieces]
    return np.concatenate([[-0.5], *(part[1:] for part in parts)])


def corners_across(scene: SceneSpec) -> list[float]:
    """Return y / width where slopes of heat and flatness change across; none of a curve."""
    found: set[float] = set()
    for shape in scene.shapes:
        for given in shape.natural.values():
            if len(places := getattr(given, "table", ())) < 3:
                continue
            eta, values = np.transpose(places)
            turns = np.abs(np.diff(np.diff(values) / np.diff(eta)))
            found |= set(eta[1:-1][turns > CORNER_SHARE * turns.max()].tolist())
    return sorted(found) if len(found) <= MAX_CORNERS_ACROSS else []


def mesh_density(scene: SceneSpec) -> float:
    """Return how many times shorter than usual elements are."""
    return scene.strip.finer or 1.0


def most_unknowns(rollers: int) -> int:
    """Return how many unknowns a mesh has at most by default, on so many rollers."""
    return max(DEFAULT_UNKNOWNS, UNKNOWNS_PER_ROLLER * rollers)


def wanted_size(
    scene: SceneSpec, radius: float, layer: float, deepest: float = np.inf, nips: bool = False
) -> float:
    """Length (m) of elements where the strip lifts off a roller.

    A quarter of the layer in which it bends, but no finer than a share of the radius from which on
    the strip is as good as a string, and no longer than it takes to follow the roller, to bear on
    it no deeper than asked for between two points of contact, or to be held by one that nips it.
    """
    if (typed := scene.strip.element_length) is not None:
        return typed
    if scene.strip.kinematics == "section":
        deepest = np.inf  # see contact_parts
    longest = min(NIP_ELEMENT if nips else MAX_LIFT_ELEMENT, 4.0 * np.sqrt(2.0 * deepest / radius))
    return radius * float(np.clip(LAYER_SHARE * layer / radius, MIN_LIFT_ELEMENT, longest))


@dataclass(frozen=True)
class Nip:
    """Parallel rollers on both sides of the strip, no farther apart than it is thick."""

    first: Roller
    second: Roller
    gap: float  # m

    @property
    def names(self) -> tuple[str, str]:
        """Names of both."""
        return self.first.name, self.second.name

    @property
    def squeeze(self) -> float:
        """Way (m) by which both are closer than they may be without pressing the strip."""
        return float(self.first.half + self.second.half) - self.gap

    @property
    def curvature(self) -> float:
        """Mean curvature (1/m) of both, by which the gaps beside the nip grow."""
        return 0.5 / self.first.radius + 0.5 / self.second.radius

    def line_load(self, law: ContactLaw) -> float:
        """Force on straight strip by a law of contact, per width (N/m)."""
        from scipy.integrate import trapezoid  # slow to import

        curvature = self.curvature
        reach = np.sqrt((max(self.squeeze, 0.0) + NIP_RANGE * law.width) / curvature)
        x = np.linspace(-reach, reach, 2001)
        with np.errstate(over="ignore"):
            return float(trapezoid(law(0.5 * (curvature * x**2 - self.squeeze)), x))

    def pressed(self, force: float, law: ContactLaw, width: float) -> Nip:
        """Return the same, as close as straight strip of a width (m) bears a force (N)."""
        from scipy.optimize import brentq  # slow to import

        def nip(squeeze: float) -> Nip:
            return replace(self, gap=self.gap + self.squeeze - squeeze)

        def missing(squeeze: float) -> float:
            return nip(squeeze).line_load(law) * width - force

        least, most = -law.width, law.width
        while missing(least) > 0.0:
            least *= 2.0
        while missing(most) < 0.0:
            most *= 2.0
        return nip(float(brentq(missing, least, most, xtol=1e-9 * law.width)))


def nips_of(rollers: Sequence[Roller], thread: Thread | None, thickness: float) -> list[Nip]:
    """Return the rollers that nip a strip, at their centres."""
    if len(rollers) < 2:
        return []
    centres = np.array([roller.centre for roller in rollers])
    axes = np.array([roller.unit_axis for roller in rollers])
    radii = np.array([roller.radius for roller in rollers])
    side = np.array([carrying_sense(r, thread) * np.sign(r.unit_axis[1]) for r in rollers])
    found = []
    for i, first in enumerate(rollers):
        way = centres[i + 1 :] - centres[i]
        across = np.linalg.norm(way - np.outer(way @ axes[i], axes[i]), axis=1)
        gaps = across - radii[i + 1 :] - radii[i]
        parallel = np.abs(axes[i + 1 :] @ axes[i]) > PARALLEL_COSINE
        faced = parallel & (side[i + 1 :] * side[i] < 0.0)
        for j in map(int, np.flatnonzero(faced & (gaps <= NIP_GAP * thickness))):
            found.append(Nip(first, rollers[i + 1 + j], float(gaps[j])))
    return found


def rollers_in_stages(
    scene: SceneSpec, rollers: Sequence[Roller]
) -> Iterator[tuple[Roller, ...] | None]:
    """Yield rollers where they are at the end of each stage; None where it moves none."""
    places = {roller.name: roller for roller in rollers}
    for stage in scene.stages:
        for roller in (roller for roller in rollers if roller.name in stage.moves):
            centre = np.add(roller.centre, stage.moves[roller.name])
            places[roller.name] = replace(roller, centre=tuple(centre))
        yield tuple(places.values()) if stage.moves else None


def curved_all_over(scene: SceneSpec) -> bool:
    """Whether a coil set, a moment or a foundation curves the strip beside its ends."""
    controls = [edge for stage in scene.stages for edge in stage.edges.values()]
    curved = any(shape.coil_set for shape in scene.shapes) or any(edge.moment for edge in controls)
    return curved or scene.strip.foundation is not None


def curved_ends(scene: SceneSpec) -> tuple[str, ...]:
    """Return the ends beside which strip curves within its boundary layer.

    Both by a coil set, a moment or a foundation; those between jaws by what bends the strip.
    """
    if curved_all_over(scene):
        return ENDS
    controls = [edge for stage in scene.stages for edge in stage.edges.values()]
    across = any(
        way[2] for edge in controls for way in (edge.move, edge.force, edge.velocity) if way
    )
    loaded = any(stage.pressure or stage.gravity for stage in scene.stages)
    if not (scene.rollers or across or loaded):
        return ()
    return tuple(name for name in ENDS if name in scene.clamped)


def fine_beside(layer: float, size: float) -> float:
    """Length (m) of strip with elements of a size on both sides of a place where it lifts off."""
    return float(np.clip(FINE_LAYERS * layer, 2.0 * size, 16.0 * size))


class LooseRoller(NamedTuple):
    """A roller without a wrap that stages press into a run of threaded strip."""

    roller: Roller
    run: int  # number of the rollers before it that the strip is wrapped around
    label: float  # where the strip passes it at the beginning (m)
    sense: float  # +1 if it passes over it or on its left, −1 under or on its right


def threaded_around(
    thread: Thread, others: Sequence[LooseRoller], places: Sequence[Roller] | None = None
) -> tuple[Thread, NDArray[np.bool_]]:
    """Return the way round the thread's rollers and those of others that are pressed into it.

    With which of its rollers are the thread's.

    Parameters
    ----------
    thread : Thread
    others : sequence of LooseRoller
    places : sequence of Roller, optional
        The thread's rollers and the others where they have come to.

    Raises
    ------
    NotTouchedError, NoTangentError
        A taut strip does not touch one of the thread's rollers, or two of them overlap.
    """
    at, count = {roller.name: roller for roller in places or ()}, len(thread.rollers)
    rollers = [*thread.rollers, *(other.roller for other in others)]
    every = replace(
        thread,
        rollers=[at.get(roller.name, roller) for roller in rollers],
        senses=np.append(thread.senses, [other.sense for other in others]),
        crossing=np.append(thread.crossing, np.zeros(len(others), dtype=bool)),
        depths=np.append(thread.depths, np.zeros(len(others))),
        given=thread.given if places is None else thread.length,
    )
    way = [*((k + 0.5, 0.0) for k in range(count)), *((each.run, each.label) for each in others)]
    kept = sorted(range(len(way)), key=way.__getitem__)
    while True:
        now = every.chosen(kept)
        try:
            now.string_path(np.zeros(1))
        except NotTouchedError as error:
            if kept[error.index] < count:
                raise
            del kept[error.index]
        else:
            return now, np.array(kept) < count


def hanging_arcs(thread: Thread, arcs: dict[str, Interval], runs: Array) -> dict[str, Interval]:
    """Return arcs between runs that hang: longer where these are over their roller."""
    forth = np.sign(np.cos(thread.middle.angles[::2, 0]))
    found = {}
    for k, (roller, sense) in enumerate(zip(thread.rollers, thread.senses, strict=True)):
        on = sense * forth[k] * roller.radius * runs[k, 2]
        off = sense * forth[k + 1] * roller.radius * runs[k + 1, 1]
        first, last = arcs[roller.name]
        first, last = first - on, last + off
        found[roller.name] = (first, last) if first < last else (0.5 * (first + last),) * 2
    return found


@dataclass(frozen=True)
class Loads:
    """The loads with which a stage pulls a strip, and how much its rollers add.

    Attributes
    ----------
    stiffness : float
        E t of the strip (N/m).
    weight : float
        Of the strip, downwards (N/m²).
    exit, entry : float or None
        Tensions (N/m); None of an entry whose tension follows.
    gains : mapping
        Roller → what the tension gains over it (N/m); those that are driven by speed have none.
    """

    stiffness: float
    weight: float
    exit: float
    entry: float | None
    gains: dict[str, float]


def loads_in_stages(scene: SceneSpec, *after: StageSpec) -> Iterator[Loads]:
    """Yield the loads at the end of each stage of a threaded strip, as far as they are given.

    Also of stages after those of the scene, as of a map.
    """
    assert scene.threading is not None and scene.strip.width is not None
    pulls: dict[str, float | None] = {"exit": scene.threading.tension, "entry": None}
    mass = (scene.material.density or 0.0) * scene.strip.thickness
    stiffness = scene.material.young * scene.strip.thickness
    free, width = [r for r in scene.rollers if r.drive != "speed"], scene.strip.width
    weight, torques = 0.0, dict[str, float]()
    for stage in (*scene.stages, *after):
        if stage.gravity is not None:
            weight = -mass * stage.gravity[2]
        pulls |= {name: pull for name, pull in edge_pulls(stage) if name in pulls}
        torques |= {n: c.torque for n, c in stage.rollers.items() if c.torque is not None}
        gains = {r.name: (r.bearing - torques.get(r.name, 0.0)) / (r.radius * width) for r in free}
        yield Loads(stiffness, weight, pulls["exit"] or 0.0, pulls["entry"], gains)


def pulls_of_runs(thread: Thread, loads: Loads) -> Array:
    """Tensions at the ends of runs (N/m), (rollers + 1,).

    They are those of the ends, with the weight of what is between; beyond rollers that are driven
    by speed they are known from the other end, or taken to be the same.
    """
    path, n = thread.middle, len(thread.rollers)
    starts, ends = path.points[1, ::2, 0], path.at(path.starts[1::2, 0], 0)[0][1]
    gains = [loads.gains.get(roller.name) for roller in thread.rollers]
    level, known = loads.exit - loads.weight * ends[-1], list[float]()
    if loads.entry is not None:  # tensions less weight times height, up to the first drive
        first = gains.index(None) if None in gains else n
        known = list(loads.entry - loads.weight * starts[0] + np.cumsum([0.0, *gains[:first]]))
    levels = np.zeros(n + 1)
    for k in reversed(range(n + 1)):
        if k < n and (gain := gains[k]) is not None:
            level -= gain
        elif k < len(known):
            level = known[k]
        levels[k] = level
    return levels + loads.weight * ends


def hanging_runs(thread: Thread, loads: Loads) -> Array:
    """Lengths of the runs beyond their chords (m) and their angles to these, (rollers + 1, 3)."""
    path, found = thread.middle, np.zeros((len(thread.rollers) + 1, 3))
    if loads.weight <= 0.0:
        return found
    starts, ends = path.points[:, ::2, 0], path.at(path.starts[1::2, 0], 0)[0]
    pulls = pulls_of_runs(thread, loads)
    for k in np.flatnonzero(pulls > 0.0).tolist():
        run = starts[:, k], ends[:, k]
        found[k] = supported_catenary(*run, loads.weight, pulls[k], thread.supports)
        layer = thread.layer * np.sqrt(thread.tension / pulls[k])
        found[k, 0] = max(0.0, found[k, 0] - _rounded_off(thread, layer, k, *found[k, 1:]))
    return found


def taken_up(thread: Thread, loads: Loads, runs: Array) -> Array:
    """Strip that runs of given lengths (m) take up by hanging and stretching, (rollers + 1,).

    More tension than that of the threaded strip stretches what they hold.
    """
    more = pulls_of_runs(thread, loads) - thread.tension
    return hanging_runs(thread, loads)[:, 0] - runs * more / loads.stiffness


def _rounded_off(thread: Thread, layer: float, run: int, first: float, last: float) -> float:
    """Return by how much stiff strip between rollers hangs through less than a string does (m).

    Where a string turns by β on either side of a line of contact, the slope of stiff strip is
    β (1 − e^(−s/λ)), λ = √(D/T), and ½ ∫ of its square less by ¾ β² λ.  On an arc that is longer
    than 2λ the run lifts off elsewhere, but in the same way.
    """
    lost, turns = 0.0, thread.middle.arcs.turn[:, 0]
    for roller, angle in ((run - 1, first), (run, last)):
        if 0 <= roller < len(thread.rollers):
            room = layer / thread.rollers[roller].radius - 0.5 * abs(float(turns[roller]))
            lost += 0.75 * layer * min(abs(angle), max(0.0, room)) ** 2
    return lost


def lengths_of_runs(thread: Thread, own: NDArray[np.bool_] | None = None) -> Array:
    """Lengths of the path (m) between the middles of its arcs, and from and to its ends.

    Between those of some of its rollers, if these are given.
    """
    arcs = thread.middle.arcs
    middles = 0.5 * (arcs.start[:, 0] + arcs.end[:, 0])
    middles = middles if own is None else middles[own]
    return np.diff([0.0, *middles, float(thread.middle.length[0])])


def lines_of_nodes(half: float, zones: list[Interval], fine: float, coarse: float) -> Array:
    """Coordinates from −half to half, at most fine apart in the zones and coarse elsewhere."""
    marks = sorted({-half, half, *(x for zone in zones for x in zone)})
    xs = [np.array([-half])]
    for a, b in pairwise(marks):
        inside = any(lo <= a and b <= hi for lo, hi in zones)
        count = max(1, int(np.ceil((b - a) / (fine if inside else coarse) - 1e-9)))
        xs.append(np.linspace(a, b, count + 1)[1:])
    return np.concatenate(xs)


def contact_stands(scene: SceneSpec) -> bool:
    """Whether the strip lifts on and off at the same labels throughout, as nothing moves."""
    moved = any(edge.move for stage in scene.stages for edge in stage.edges.values())
    moved |= not follows_rollers(scene) and any(stage.moves for stage in scene.stages)
    return labels_stay(scene) and not moved


def labels_stay(scene: SceneSpec) -> bool:
    """Whether material passes the labels of the strip wherever it runs."""
    return bool(scene.strip.feed or not passes_in_time(scene))


def passes_in_time(scene: SceneSpec) -> bool:
    """Whether strip may run over rollers in a stage in time; labels of a steady one stay.

    A stage in time before or after a steady one counts if something turns in it.
    """
    speeds, steady = dict[str, float](), any(stage.steady for stage in scene.stages)
    for stage in scene.stages:
        before = any(speeds.values())
        speeds |= {"strip": stage.strip.speed or speeds.get("strip", 0.0)}
        speeds |= dict(stage_speeds(scene, stage))
        speeds |= {f"{n}.torque": c.torque for n, c in stage.rollers.items() if c.torque}
        runs = before or any(speeds.values()) or not steady
        if stage.friction and not stage.steady and runs:
            return True
    return False


def graded_nodes(
    half: float,
    zones: Sequence[Zone],
    coarse: float,
    marks: Sequence[float] = (),
    most: float = np.inf,
    finer: float = 1.0,
) -> Array:
    """Coordinates from −half to half, fine in the zones and growing away from them.

    The length of the elements is at most that of a zone inside it, grows by ``LENGTH_GROWTH`` per
    length beyond, up to ``coarse``.  All are longer by one factor where there would be more than
    ``most``, and then ``finer`` times shorter.  The marks become nodes, but for those that are next
    to another one, as on a roller that a string only grazes.
    """
    finest = min([coarse, *(zone.size for zone in zones)])
    x = np.linspace(-half, half, 1 + min(int(np.ceil(8.0 * half / finest)), MAX_SAMPLES))
    sizes = np.full_like(x, coarse)
    edges = sorted((zone.first, zone.last) for zone in zones)
    begins = np.array([*(first for first, _ in edges), half])
    ends = np.maximum.accumulate([-half, *(last for _, last in edges)])
    widest = float(np.max(begins - ends, initial=0.0))
    largest = max((zone.size for zone in zones), default=coarse) + LENGTH_GROWTH * widest
    for zone in zones:  # farther away another one asks for less
        within = (min(coarse, largest) - zone.size) / LENGTH_GROWTH
        here = slice(*np.searchsorted(x, [zone.first - within, zone.last + within]))
        away = np.maximum(np.maximum(zone.first - x[here], x[here] - zone.last), 0.0)
        sizes[here] = np.minimum(sizes[here], zone.size + LENGTH_GROWTH * away)
    passed = np.cumsum(np.append(0.0, 0.5 * np.diff(x) * (1.0 / sizes[1:] + 1.0 / sizes[:-1])))
    passed *= finer * min(1.0, most / passed[-1])
    xs, places = [np.array([-half])], [0.0]
    for place in np.interp(marks, x, passed):
        if min(place - places[-1], passed[-1] - place) > MIN_NODE_DISTANCE:
            places.append(float(place))
    for a, b in pairwise([*places, float(passed[-1])]):
        count = max(1, int(np.ceil(b - a - 1e-9)))
        xs.append(np.interp(np.linspace(a, b, count + 1)[1:], passed, x))
    return np.concatenate(xs)


def axis_crossing(roller: Roller) -> Array:
    """Point (x, z) in which the axis of a roller crosses the plane y = 0, or its centre."""
    centre, axis = np.asarray(roller.centre, dtype=float), roller.unit_axis
    return (centre - axis * (centre[1] / axis[1] if axis[1] else 0.0))[[0, 2]]


def label_at(roller: Roller, thread: Thread) -> float:
    """Label (m) in the middle of the arc on a roller, or next to one that is not wrapped."""
    arc = thread.arcs.get(roller.name)
    return thread.passing(axis_crossing(roller))[0] if arc is None else 0.5 * sum(arc)


def carrying_sense(roller: Roller, thread: Thread | None) -> float:
    """+1 if turning right-handed about its axis a roller carries the strip on, else −1."""
    forwards = np.copysign(1.0, roller.unit_axis[1])
    if thread is None:
        return float(forwards if roller.centre[2] <= 0.0 else -forwards)
    wrapped = dict(zip((r.name for r in thread.rollers), thread.senses, strict=True))
    sense = wrapped.get(roller.name) or thread.passing(axis_crossing(roller))[1]  # +1 or −1
    return float(forwards * sense)


def surface_speed(stage: StageSpec, roller: Roller) -> float | None:
    """Surface speed (m/s, in the roller's sense) that a stage ends with, None if it stays."""
    control = stage.roller(roller.name)
    if control.angular_speed is None:
        return control.surface_speed
    return roller.sense * roller.radius * control.angular_speed


def _travel(scene: SceneSpec, speeds: list[float | None]) -> tuple[float, float]:
    """Farthest backwards and forwards (m), by the speeds at the ends of the stages."""
    speed = travel = lowest = highest = 0.0
    for stage, given in zip(scene.stages, speeds, strict=True):
        new = speed if given is None else given
        travel += 0.0 if stage.steady else 0.5 * (speed + new) * stage.duration
        speed, lowest, highest = new, min(lowest, travel), max(highest, travel)
    return -lowest, highest
