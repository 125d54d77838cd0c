"""Fields of a state: on a surface for pictures, and in profiles along the strip."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from anmstrip.arrays import Array, Index
from anmstrip.fem import sampling
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.shell import eigencurvature, moduli
from anmstrip.results.strip_state import StripState
from anmstrip.results.vtk import FIELDS, TRIANGLE_LATTICE, facing

OUTPUT_POINTS = {
    "line": sampling.unit_grid(4),
    "quad": sampling.unit_grid(4, 4),
    "triangle": TRIANGLE_LATTICE / 5,
}
"""Points of the output on each kind of element: cubic patches, quintic triangles."""


class FieldSampler:
    """Points and cells of the output, and the fields of states there.

    Every quadrilateral becomes a four by four grid of points, every triangle a lattice of
    21, shared with its neighbours: the surface is reproduced exactly.  A section is drawn as
    wide as it stands for, with four points across.

    Parameters
    ----------
    strip : Strip
    local : ndarray, shape (dimensions, points of one), optional
        Other points of the reference element; of a section then along one line only.

    Attributes
    ----------
    cells : ndarray of int, shape (elements, points of one)
        Points of each element, counter-clockwise seen from above the flat strip.
    reference : ndarray, shape (3, points)
        Reference positions.
    nearest : ndarray of int, shape (points of one,)
        Contact point of an element nearest to each of its points.
    """

    def __init__(self, strip: Strip, local: Array | None = None) -> None:
        self.strip = strip
        self.kind, self.kinematics = sampling.shape_of(strip), strip.kinematics
        self.local = OUTPUT_POINTS[self.kind] if local is None else local
        self.lines = 4 if self.kind == "line" and local is None else 1
        patch = sampling.patches(strip, self.local)
        self.own = patch.cells
        flat, count = self.own.ravel(), np.bincount(self.own.ravel())
        self.mean = csr_matrix((1.0 / count[flat], (flat, np.arange(len(flat)))))
        parts = [(np.asarray(f), f.grad, f.hess) for f in patch.functions]
        self.value, self.grad, self.hess = (
            np.ascontiguousarray(np.moveaxis(np.stack(part), (-2, 0), (0, -1)))
            for part in zip(*parts, strict=True)
        )  # elements first, basis functions last
        self.cells, self.reference = patch.cells, patch.reference
        if self.lines > 1:
            # the points across follow each other: their equal values are compressed to a third
            across, count = np.arange(self.lines), self.reference.shape[1]
            self.cells = (self.lines * self.own[:, None, :] + across[:, None]).reshape(-1, 16)
            self.reference = np.repeat(self.reference, self.lines, axis=1)
            self.reference[1] = np.tile((across / 3.0 - 0.5) * strip.width, count)
        if local is None:
            self.cells = facing(self.reference, self.cells)
        apart = self.local[:, :, None] - sampling.contact_points(strip)[:, None]
        self.nearest = (apart**2).sum(axis=0).argmin(axis=1)

    def sample(self, state: StripState) -> dict[str, Array]:
        """All fields of a state by name, points first; see :data:`~anmstrip.results.vtk.FIELDS`."""
        return {
            "displacement": self.interpolate(state.full),
            "velocity": self.interpolate(state.material_velocity),
            "arc_length": state.unstressed_length(self.reference[0]),
            **self.contact_fields(state),
            **self.stress_fields(state),
        }

    def interpolate(self, full: Array) -> Array:
        """Vectors in space of all unknowns, shape (points, 3)."""
        own = self._average(self._at_points(self.value, full))
        return self.kinematics.embed(own.T).T

    def curvature(self, state: StripState) -> Array:
        """Curvatures (xx, yy, xy) (1/m), positive where the top is stretched, (points, 3)."""
        return self._average(self._geometry(state.full, self._growth(state))[2])

    def _growth(self, state: StripState) -> Any:
        """Unstressed length at a label over that of the reference, 1 or (elements, points)."""
        growth = state.controls.get("strip.growth")
        return 1.0 if growth is None else self._recovered(growth[None])[0]

    def _average(self, values: Array) -> Array:
        """Mean over the elements that share a point, (..., elements, 16) → (points, ...)."""
        mean = self.mean @ values.reshape(-1, self.own.size).T
        return np.repeat(mean.reshape(-1, *values.shape[:-2]), self.lines, axis=0)

    def _at_points(self, table: Array, full: Array) -> Array:
        """Sum of the basis functions in a table, shape (components, ..., elements, points)."""
        dofs = self.strip.nodal(full)[self.strip.basis.element_dofs.T]
        found = table.reshape(len(table), -1, table.shape[-1]) @ dofs
        return np.moveaxis(found.reshape(*table.shape[:-1], -1), (-1, 0), (0, -2))

    @cached_property
    def from_contact(self) -> tuple[Array, Array]:
        """Matrices from the contact points of an element to its points of output.

        Linear interpolation, and means around the points of output, by which what acts on the
        strip per area keeps its integral; shapes (points of output, contact points).
        """
        own = sampling.contact_points(self.strip)
        around = self._hats(self.local, own).T * sampling.contact_shares(self.strip)
        return self._hats(own, self.local), around / around.sum(axis=1)[:, None]

    def _hats(self, nodes: Array, points: Array) -> Array:
        """Functions linear between the nodes of an element, at points, (points, nodes)."""
        if self.kind == "triangle":
            from scipy.interpolate import LinearNDInterpolator

            return np.asarray(LinearNDInterpolator(nodes.T, np.eye(nodes.shape[1]))(points.T))
        found = np.ones((1, 1))
        for known, at in zip(map(np.unique, nodes), map(np.unique, points), strict=True):
            hats = np.transpose([np.interp(at, known, row) for row in np.eye(len(known))])
            found = np.kron(hats, found)  # the first coordinate runs fastest
        return found

    def contact_fields(self, state: StripState) -> dict[str, Array]:
        """Sums over the rollers of what they do; gap and slip of the nearest one."""
        found = list(state.contacts.values())
        if not found:
            nothing = np.zeros(self.reference.shape[1])
            scalars = dict.fromkeys(("normal_pressure", "gap", "contact_status"), nothing)
            vectors = "friction_traction", "slip_velocity"
            return scalars | dict.fromkeys(vectors, np.zeros((len(nothing), 3)))
        operator, gap = found[0].contact.sampling.whole, state.gaps
        points = operator.points
        pressure, found_status = np.zeros((2, points))
        traction, slip = np.zeros((2, 3, points))
        for f in found:
            chosen = f.contact.sampling.chosen
            pressure[chosen] += f.pressure
            traction[:, chosen] += f.traction
            found_status[chosen] = np.maximum(found_status[chosen], f.status)
            nearest = f.gap <= gap[chosen]
            slip[:, chosen[nearest]] = f.slip[:, nearest]
        cells, status = operator.cells, np.zeros(self.mean.shape[0])
        between, around = self.from_contact
        fields = {
            name: self._average(values[..., cells] @ matrix.T)
            for name, values, matrix in (
                ("normal_pressure", pressure, around),
                ("friction_traction", traction, around),
                ("slip_velocity", slip, between),
                ("gap", gap, between),
            )
        }
        np.maximum.at(status, self.own, found_status[cells[:, self.nearest]])
        return {**fields, "contact_status": np.repeat(status, self.lines)}

    def stress_fields(self, state: StripState) -> dict[str, Array]:
        """Membrane forces, moments, von Mises stress of the top surface, curvature, normal."""
        tangents, normal, curvature = self._geometry(state.full, self._growth(state))
        bending, sheet = curvature, state.membrane
        if sheet is not None and sheet.imperfection is not None:
            bending = curvature - self._geometry(sheet.imperfection)[2]
        if (own := eigencurvature(state.controls)) is not None:
            bending = bending - own[:, :, None]
        layers = self.layer_fields(state)
        membrane = layers["force"] if layers else self.membrane_forces(state)
        stiffness = moduli(self.strip) if state.bends else np.zeros((3, 3))
        moments = np.einsum("xy,yep->xep", stiffness, bending)
        if (loss := state.controls.get("strip.softening")) is not None:
            moments = moments * (1.0 - self._recovered(loss[None]))
        moments = layers.get("moment", moments)
        tension = membrane[0]
        if sheet is not None:  # the work of M on κ = −n · r,ab is also one on the stretch
            stretch = np.linalg.norm(tangents[:, 0], axis=0)
            bent = moments[0] * curvature[0] + moments[2] * curvature[2]
            tension = membrane[0] * stretch + bent / stretch
            if (found := state.tension_profile) is not None:  # means across in equilibrium
                places, number, mean = self.stations
                missing = np.interp(places, *found) - mean @ tension.ravel()
                correction = missing[number].reshape(tension.shape)
                tension, membrane[0] = tension + correction, membrane[0] + correction / stretch
        t = self.strip.thickness
        sx, sy, sxy = membrane / t + 6.0 * moments / t**2
        mises = layers.get("equivalent", np.sqrt(sx**2 - sx * sy + sy**2 + 3.0 * sxy**2))
        values = {name: each for name, each in layers.items() if name in FIELDS}
        values |= {"tension": tension, "membrane_force": membrane, "bending_moment": moments}
        mean_curvature = 0.5 * (curvature[0] + curvature[1])
        values |= {"von_mises": mises, "mean_curvature": mean_curvature, "normal": normal}
        return {name: self._average(each) for name, each in values.items()}

    @cached_property
    def stations(self) -> tuple[Array, Index, csr_matrix]:
        """Reference x (m) of the lines of points across, that of every point of every element.

        And the matrix of means over the width, (lines, elements · points).
        """
        x, *y = self.strip.basis.mapping.F(self.local)
        sizes, weights = self.strip.cell_sizes, np.ones(x.size)
        places, number = sampling.stations(self.strip, x.ravel())
        if self.kind == "quad":  # those that integrate polynomials across an element
            inside = (y[0] - y[0].min(axis=1, keepdims=True)) / sizes[1][:, None]
            across, line = np.unique(np.round(inside.ravel(), 6), return_inverse=True)
            powers = np.arange(len(across))
            shares = np.linalg.solve(across ** powers[:, None], 1.0 / (powers + 1.0))
            weights = np.repeat(sizes[1], x.shape[1]) * shares[line]
        weights /= np.bincount(number, weights)[number]
        return places, number, csr_matrix((weights, (number, np.arange(x.size))))

    def layer_fields(self, state: StripState) -> dict[str, Array]:
        """Return N and M (xx, yy, xy), and what else is read off the layers of yielding strip.

        As a whole: in a hinge those of the strains and those that plastic strains add are many
        times as large, and jump where strip comes to lie on a roller.
        """
        if state.plasticity is None:
            return {}
        from anmstrip.results.plastic import YieldedStrip

        layers = YieldedStrip(state, state.plasticity)
        d = len(layers.curvature)
        parts = [layers.plastic_share, layers.face_strain, layers.flow.mises(layers.stress[:, -1])]
        values = np.vstack([layers.force, layers.moment, layers.residual_curvature, *parts])
        found = self._recovered(values, layered=True)
        force, moment, left = (np.zeros((3, *found.shape[1:])) for _ in range(3))
        force[:d], moment[:d], left[:d] = found[:d], found[d : 2 * d], found[2 * d : 3 * d]
        if d == 1:
            moment[1] = self.strip.material.poisson * moment[0]
        names = "plastic_share", "plastic_strain", "equivalent"
        scalars = dict(zip(names, found[3 * d :], strict=True))
        return {"force": force, "moment": moment, "residual_curvature": left, **scalars}

    def membrane_forces(self, state: StripState) -> Array:
        """Membrane forces (xx, yy, xy) (N/m), recovered, shape (3, elements, points).

        Within an element on a roller those of the strains swing about the force that is in
        equilibrium, by 11 per cent of it where a cubic has to follow an arc of five degrees.  What
        they are on the whole and from end to end is right: they are projected on the linear
        functions of the element (least squares over its area), the values at a node are averaged
        over its elements, and interpolated between the nodes (Zienkiewicz and Zhu, Int. J. Numer.
        Meth. Engng. 24, 1987).  Across a rectangle, where no arc makes them swing, the functions
        are quadratic, as the profiles of rolled strip are.
        """
        shape = (3, *self.own.shape)
        if state.membrane is None:
            pull = state.controls.get("exit.force", np.zeros(3))[0]
            return np.multiply.outer([pull, 0.0, 0.0], np.ones(shape[1:]))
        return self._recovered(_components(state.membrane.at(state.full, state.controls)))

    def _recovered(self, values: Array, layered: bool = False) -> Array:
        """Values at quadrature points (m, points) as recovered, shape (m, elements, points).

        Of strip with layers that yield, which makes kinks across, by functions linear across too,
        and within what is found in the elements there.
        """
        from_quadrature, to_points, places = self.recovery[layered]
        inside = values.reshape(len(values), len(self.own), -1)
        ends, count = inside @ from_quadrature.T, np.bincount(places.ravel())
        means = np.array([np.bincount(places.ravel(), component.ravel()) for component in ends])
        means /= count
        if layered:
            low, high = (np.full(means.T.shape, bound) for bound in (np.inf, -np.inf))
            for column in places.T:
                np.minimum.at(low, column, inside.min(axis=2).T)
                np.maximum.at(high, column, inside.max(axis=2).T)
            means = np.clip(means, low.T, high.T)
        return np.asarray(means[:, places] @ to_points.T)

    @cached_property
    def recovery(self) -> list[tuple[Array, Array, Index]]:
        """Matrices that recover values, without layers and with them.

        They lead from quadrature points to places of an element, its corners and the middles of
        its sides across, and from these to its points; and numbers of the places.
        """
        basis, found = self.strip.basis, []
        root, corners = np.sqrt(basis.W), self.strip.mesh.refdom.p
        for highest in (2, 1) if self.kind == "quad" else (0, 0):
            middles = [[0.5, 0.5], [0.0, 1.0]] if highest == 2 else np.zeros((len(corners), 0))
            places = np.hstack([corners, middles])
            at, there, to = (_monomials(p, highest) for p in (basis.X, places, self.local))
            coefficients = np.linalg.lstsq(root[:, None] * at, np.diag(root), rcond=None)[0]
            numbers, _ = sampling.join_points(basis.mapping.F(places), self.strip)
            found.append((there @ coefficients, to @ np.linalg.inv(there), numbers))
        return found

    def _geometry(self, full: Array, growth: Any = 1.0) -> tuple[Array, Array, Array]:
        """Tangent vectors r,a, normal n, and curvature −n · r,ab, positive with a stretched top.

        Shapes (components, directions, elements, points) and twice (3, elements, points).
        Derivatives are by unstressed length along the strip.
        """
        level = self.kinematics
        tangents = level.flat[..., None] + self._at_points(self.grad, full)
        in_space = np.zeros((3, 2, *tangents.shape[2:]))
        in_space[0, 0] = in_space[1, 1] = 1.0
        in_space[list(level.components), : level.directions] = tangents
        normal = np.cross(in_space[:, 0], in_space[:, 1], axis=0)
        normal /= np.linalg.norm(normal, axis=0)
        hessian = level.embed(self._at_points(self.hess, full))
        curvature = _components(-np.einsum("cep,cabep->abep", normal, hessian))
        tangents[:, 0] /= growth
        curvature[0] /= growth**2
        curvature[2] /= growth
        return tangents, normal, curvature


def _monomials(points: Array, highest: int) -> Array:
    """1, ξ, η of points (d, n), on squares 1, η times powers of ξ up to the highest, (n, m)."""
    if not highest:
        return np.stack([np.ones(points.shape[1]), *points], axis=-1)
    across, along = points  # as grids have it
    return np.stack([f * across**k for k in range(highest + 1) for f in (1.0, along)], axis=-1)


def _components(tensor: Array) -> Array:
    """Components (xx, yy, xy) of symmetric tensors (d, d, ...); a section has xx alone."""
    found = np.zeros((3, *tensor.shape[2:]))
    found[0] = tensor[0, 0]
    if len(tensor) == 2:
        found[1], found[2] = tensor[1, 1], tensor[0, 1]
    return found


PROFILE_COLUMNS = (
    *("time", "arc_length", "x", "y", "z", "tension", "tension_min", "tension_max", "pressure"),
    *("line_load", "slip", "cone_share", "curvature", "moment"),
)


class Profile:
    """Means over the width at every line of contact points across the strip.

    On triangles, whose points do not stand in lines, means over pieces as long as an element.

    Parameters
    ----------
    strip : Strip
    """

    def __init__(self, strip: Strip) -> None:
        self.fields = FieldSampler(strip, sampling.contact_points(strip))
        self.areas = sampling.ContactOperator(strip).weights
        x = self.fields.reference[0]
        _, self.station = sampling.stations(strip, x - x.min())

    def columns(self, state: StripState) -> dict[str, Array]:
        """Return the columns of the table, with a value for every station from the entry on.

        What belongs to contact is NaN where no point of the station touches a roller.
        """
        fields, flat = self.fields.sample(state), self.fields.reference
        yielded: dict[str, Array] = {}
        if state.plasticity is not None:
            from anmstrip.results.plastic import YieldedStrip

            yielded = YieldedStrip(state, state.plasticity).columns(fields["arc_length"])
        position = flat.T + fields["displacement"] + self.fields.strip.origin
        low, high = (np.full(self.station.max() + 1, end) for end in (np.inf, -np.inf))
        np.minimum.at(low, self.station, fields["tension"])
        np.maximum.at(high, self.station, fields["tension"])
        values = {name: position[:, k] for k, name in enumerate("xyz")}
        values |= {"arc_length": fields["arc_length"], "tension": fields["tension"]}
        values |= {"pressure": fields["normal_pressure"], "moment": fields["bending_moment"][:, 0]}
        values |= {"curvature": self.fields.curvature(state)[:, 0], **yielded}
        columns = {name: self._mean(each) for name, each in values.items()}
        columns |= {"tension_min": low, "tension_max": high}
        columns |= self.friction_columns(state, fields["normal"])
        loads = np.full(len(columns["x"]), np.nan)
        for name, reading in state.rollers.items():
            contact, ends = state.contacts[name], (reading.line_load_in, reading.line_load_out)
            for x, load in zip(contact.arc, ends, strict=True):
                place = self.station[np.abs(flat[0] - x).argmin()]
                if load is not None:
                    loads[place] = np.nan_to_num(loads[place]) + load
        table = {"time": np.full(len(loads), state.time), **columns, "line_load": loads}
        return {name: table[name] for name in dict.fromkeys((*PROFILE_COLUMNS, *yielded))}

    def _mean(self, values: Array, weights: Array | None = None) -> Array:
        """Mean over each station; NaN where there is no weight."""
        weights = self.areas if weights is None else weights
        total = np.bincount(self.station, weights * values)
        with np.errstate(invalid="ignore"):
            return np.asarray(total / np.bincount(self.station, weights))

    def friction_columns(self, state: StripState, normal: Array) -> dict[str, Array]:
        """Slip along the strip, positive where it runs ahead of the roller, and share of the cone.

        Of the points in contact; the share is that of all forces of a station.
        """
        along = np.cross([0.0, 1.0, 0.0], normal).T
        along /= np.linalg.norm(along, axis=0)
        slip, rub, cone, touching = np.zeros((4, len(self.areas)))
        for contact in state.contacts.values():
            near = contact.contact.sampling.chosen
            slip[near] += (contact.slip * along[:, near]).sum(axis=0) * contact.touching
            rub[near] += np.linalg.norm(contact.traction, axis=0) * contact.touching
            cone[near] += (contact.coefficient or 0.0) * contact.pressure * contact.touching
            touching[near] += contact.touching
        shares = np.divide(rub, cone, out=np.zeros_like(rub), where=cone > 0.0)
        return {
            "slip": self._mean(slip, touching * self.areas),
            "cone_share": self._mean(shares, cone * self.areas),
        }
