"""Profiles along the strip: what an engineer of a line reads off a state, station by station."""

from __future__ import annotations

import numpy as np

from anmstrip.arrays import Array, Index
from anmstrip.fem.sampling import ContactOperator, contact_points, shape_of
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.shell import Membrane
from anmstrip.results.fields import FieldSampler
from anmstrip.results.plastic import COLUMNS as YIELD_COLUMNS
from anmstrip.results.plastic import YieldedStrip
from anmstrip.results.rollers import Readable

COLUMNS = (
    *("time", "arc_length", "x", "y", "z", "tension", "tension_min", "tension_max", "pressure"),
    *("line_load", "slip", "cone_share", "curvature", "moment"),
)


class Profile:
    """Means over the width at every line of contact points across the strip.

    On triangles, whose points do not stand in lines, means over pieces as long as an element.

    Parameters
    ----------
    strip : Strip
    membrane : Membrane or None
    contact : ContactOperator or None
    bends : bool
    imperfection : ndarray, shape (unknowns,), optional
        All as of :class:`~anmstrip.results.fields.FieldSampler`.
    """

    def __init__(
        self,
        strip: Strip,
        membrane: Membrane | None,
        contact: ContactOperator | None,
        bends: bool = True,
        imperfection: Array | None = None,
    ) -> None:
        kind = shape_of(strip)
        points = contact_points(kind)
        self.fields = FieldSampler(strip, membrane, contact, bends, imperfection, points)
        self.areas = (contact or ContactOperator(strip)).weights
        x, sizes = self.fields.reference[0], strip.cell_sizes[0]
        unit = float(sizes.mean() if kind == "triangle" else 1e-6 * sizes.min())
        places = np.round((x - x.min()) / unit)
        self.station: Index = np.unique(places, return_inverse=True)[1]

    def columns(self, state: Readable) -> dict[str, Array]:
        """Return the columns of the table, with a value for every station from the entry on.

        What belongs to contact is NaN where no point of the station touches a roller.
        """
        fields, flat = self.fields.sample(state), self.fields.reference
        layers = YieldedStrip.of(state)
        yielded = {} if layers is None else layers.columns(fields["arc_length"])
        position = flat.T + fields["displacement"] + self.fields.strip.origin
        columns = {name: self._mean(position[:, k]) for k, name in enumerate("xyz")}
        columns |= {
            "arc_length": self._mean(fields["arc_length"]),
            "tension": self._mean(fields["tension"]),
            "pressure": self._mean(fields["normal_pressure"]),
            "curvature": self._mean(self.fields.curvature(state.full)[:, 0]),
            "moment": self._mean(fields["bending_moment"][:, 0]),
            **{name: self._mean(values) for name, values in yielded.items()},
            **self._extremes(fields["tension"]),
            **self._friction(state, fields["normal"]),
        }
        loads = np.full(len(columns["x"]), np.nan)
        for name, reading in state.rollers.items():
            contact, ends = state.contacts[name], (reading.line_load_in, reading.line_load_out)
            for x, load in zip(contact.arc, ends, strict=True):
                place = self.station[np.abs(flat[0] - x).argmin()]
                if contact.touching.any():
                    loads[place] = np.nan_to_num(loads[place]) + load
        table = {"time": np.full(len(loads), state.time), **columns, "line_load": loads}
        names = COLUMNS if layers is None else (*COLUMNS, *YIELD_COLUMNS)
        return {name: table[name] for name in names}

    def _mean(self, values: Array, weights: Array | None = None) -> Array:
        """Mean over each station; NaN where there is no weight."""
        weights = self.areas if weights is None else weights
        total = np.bincount(self.station, weights * values)
        with np.errstate(invalid="ignore"):
            return np.asarray(total / np.bincount(self.station, weights))

    def _extremes(self, tension: Array) -> dict[str, Array]:
        """Smallest and largest tension of each station."""
        low, high = (np.full(self.station.max() + 1, sign * np.inf) for sign in (1.0, -1.0))
        np.minimum.at(low, self.station, tension)
        np.maximum.at(high, self.station, tension)
        return {"tension_min": low, "tension_max": high}

    def _friction(self, state: Readable, normal: Array) -> dict[str, Array]:
        """Slip along the strip, positive where it runs ahead of the roller, and share of the cone.

        Of the points in contact; the share is that of all forces of a station.
        """
        along = np.cross([0.0, 1.0, 0.0], normal).T
        along /= np.linalg.norm(along, axis=0)
        slip, rub, cone, touching = np.zeros((4, len(self.areas)))
        for contact in state.contacts.values():
            near = contact.contact.operator.chosen
            slip[near] += (contact.slip * along[:, near]).sum(axis=0) * contact.touching
            rub[near] += np.linalg.norm(contact.traction, axis=0) * contact.touching
            cone[near] += (contact.coefficient or 0.0) * contact.pressure * contact.touching
            touching[near] += contact.touching
        shares = np.divide(rub, cone, out=np.zeros_like(rub), where=cone > 0.0)
        return {
            "slip": self._mean(slip, touching * self.areas),
            "cone_share": self._mean(shares, cone * self.areas),
        }
