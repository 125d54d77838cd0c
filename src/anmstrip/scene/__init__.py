"""Scenes: from a TOML file to a validated scene, and to a run of it."""

from anmstrip.scene.errors import InputError
from anmstrip.scene.schema import Scene

__all__ = ["InputError", "Scene"]
