"""Tables that need another one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from anmstrip.scene.errors import Mistake
from anmstrip.scene.wording import missing

if TYPE_CHECKING:
    from anmstrip.scene.stage_tables import StageSpec
    from anmstrip.scene.tables import ContactSpec, FrictionSpec, MaterialSpec, RollerSpec

CONTACT = "[contact]\nstiffness = 1.0e10\neta = 10.0\ndelta = 1.0e-3"
"""What to type for contact."""


def gravity_has_density(material: MaterialSpec, stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield a density that gravity lacks."""
    weighing = [stage.name for stage in stages if stage.gravity is not None]
    if weighing and material.density is None:
        mistake = replace(missing(type(material), "density"), key="material.density")
        expected = f"{mistake.expected}, since stage {weighing[0]} has gravity"
        yield replace(mistake, expected=expected)


def friction_has_contact(
    friction: FrictionSpec | None, contact: ContactSpec | None
) -> Iterator[Mistake]:
    """Yield the contact that friction lacks."""
    if friction is not None and contact is None:
        yield Mistake("", "contact", None, "a table, since there is [friction]", CONTACT)


def rollers_have_friction(
    friction: FrictionSpec | None, rollers: tuple[RollerSpec, ...]
) -> Iterator[Mistake]:
    """Yield rollers with a coefficient of their own in a scene without friction."""
    for roller in rollers:
        if friction is None and roller.friction is not None:
            expected = "a table [friction] as well, for the law and its speed"
            hint = f"[friction]\ncoefficient = {roller.friction:g}\nspeed = 1.0e-4"
            yield Mistake("", f"rollers.{roller.name}.friction", roller.friction, expected, hint)


def stages_have_friction(
    friction: FrictionSpec | None, stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    """Yield stages that ask for friction in a scene without."""
    for stage in stages:
        if friction is None and stage.friction and "friction" in stage.model_fields_set:
            key = f"stages.{stage.name}.friction"
            expected = "false, since the scene has no [friction]"
            hint = "friction = false, or a table [friction] with coefficient and speed"
            yield Mistake("", key, True, expected, hint)
