"""Contact that is softened for a first guess, where it is very stiff.

A threaded strip is a guess of positions.  What is a small error of them is a large one of
pressure where contact is stiff; so the guess comes to rest on softer contact first, as stiff as
the strip itself, pulled around its roller, can feel.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from anmstrip.mechanics.contact import Contact
from anmstrip.model import Model

FELT = 25.0
"""Stiffness of contact over E t/R², that of the stretched strip against pressure, above which it
is as good as rigid."""

FACTOR = 100.0
"""From one softened contact to the next: pressed contact is linear, so steps may be large."""


def softened(model: Model, radius: float) -> Iterator[Model]:
    """The same model with softer contact, each stiffer than the one before; nothing if it is soft.

    Parameters
    ----------
    model : Model
    radius : float
        Of the smallest roller (m).
    """
    felt = FELT * model.strip.tensile_stiffness / radius**2
    for effect in model.effects:
        if isinstance(effect, Contact):
            stiffness = felt
            while stiffness < 0.5 * effect.signorini.stiffness:
                yield _with(model, effect, stiffness)
                stiffness *= FACTOR


def _with(model: Model, contact: Contact, stiffness: float) -> Model:
    softer = replace(contact, signorini=replace(contact.signorini, stiffness=stiffness))
    effects = [softer if effect is contact else effect for effect in model.effects]
    return Model(model.strip, model.pattern, effects, model.scales)
