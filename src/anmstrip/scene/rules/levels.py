"""What a section or a plate cannot see is refused, rather than left out in silence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from anmstrip.scene.errors import Mistake
from anmstrip.scene.rules.edges import nonzero

if TYPE_CHECKING:
    from anmstrip.scene.stage_tables import StageSpec
    from anmstrip.scene.tables import FrictionSpec, RollerSpec, StripSpec, ThreadingSpec

SEEN = {"shell": "xyz", "section": "xz", "plate": "z"}
"""Displacements that a level has; holding another one is harmless, moving or loading it is not."""

WHY = {"section": 'a "section" has no width', "plate": 'a "plate" only moves up and down'}

OTHER = {"section": 'kinematics = "shell"', "plate": 'kinematics = "section"'}
"""The next level, which sees it."""


def plates(
    strip: StripSpec, friction: FrictionSpec | None, threading: ThreadingSpec | None
) -> Iterator[Mistake]:
    """Yield what needs a strip that moves along, or is bent far."""
    if strip.kinematics != "plate":
        return
    key, hint = "strip.kinematics", OTHER["plate"]
    if threading is not None:
        expected = '"shell" or "section": a plate stays nearly flat, so it is not threaded'
        yield Mistake("", key, "plate", expected, hint)
    if friction is not None:
        expected = '"shell" or "section": a plate does not move along, so nothing rubs'
        yield Mistake("", key, "plate", expected, hint)
    if strip.feed:
        yield Mistake("", "strip.feed", True, "false: a plate does not move along", "feed = false")


def rollers_of_a_section(strip: StripSpec, rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    """Yield rollers that are not the same all across."""
    if strip.kinematics != "section":
        return
    for roller in rollers:
        for key, value in roller.profile.items():
            expected = f'no {key}, since "section" has no width'
            yield Mistake("", f"rollers.{roller.name}.{key}", value, expected, OTHER["section"])
        if roller.axis[0] or roller.axis[2]:
            expected = 'an axis along y, since "section" has no width'
            hint = "axis = [0.0, 1.0, 0.0]"
            yield Mistake("", f"rollers.{roller.name}.axis", roller.axis, expected, hint)


def directions(strip: StripSpec, stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield motion, force and gravity along what a level does not have."""
    level = strip.kinematics
    for stage in stages:
        for name, control in stage.edges.items():
            for key in ("move", "velocity", "force"):
                seen = SEEN[level]
                if (level, name, key) == ("plate", "exit", "force"):
                    seen = "xz"  # along x it is the tension of the plate
                place, value = f"{name}.{key}", getattr(control, key)
                yield from _unseen(level, seen, f"stages.{stage.name}.{place}", place, value)
        key = f"stages.{stage.name}.gravity"
        yield from _unseen(level, SEEN[level], key, "gravity", stage.gravity)


def _unseen(
    level: str, seen: str, key: str, short: str, value: tuple[float, float, float] | None
) -> Iterator[Mistake]:
    """A vector with a component that is not seen."""
    unseen = [c for c in nonzero(value) if c not in seen]
    if value is None or not unseen:
        return
    kept = [v if c in seen else 0.0 for c, v in zip("xyz", value, strict=True)]
    expected = f"0 along {' and '.join(unseen)}: {WHY[level]}"
    yield Mistake("", key, value, expected, f"{short} = {kept}, or {OTHER[level]}")


def moments(strip: StripSpec, stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield moments on a strip that does not resist bending, or does not turn far."""
    if strip.bending and strip.kinematics != "plate":
        return
    expected = 'nothing: a strip without bending has no moments, a "plate" takes none'
    hint = OTHER["plate"] if strip.bending else "bending = true"
    for stage in stages:
        for name, control in stage.edges.items():
            if control.moment is not None:
                key = f"stages.{stage.name}.{name}.moment"
                yield Mistake("", key, control.moment, expected, hint)


def tension_of_a_plate(strip: StripSpec, stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield tensions that a plate does not look at: its own is that of exit.force."""
    if strip.kinematics != "plate":
        return
    for stage in stages:
        for name, control in stage.edges.items():
            if control.tension is not None:
                key = f"stages.{stage.name}.{name}.tension"
                expected = 'nothing: the tension of a "plate" is the x of exit.force (N/m)'
                hint = f"exit.force = [{control.tension:g}, 0.0, 0.0]"
                yield Mistake("", key, control.tension, expected, hint)
