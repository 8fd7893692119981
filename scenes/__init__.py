"""Scenes: what is simulated, read from folders of tables, and the solver cores that are made of it.

Reading (`readers`) loads when a scene is read: FMUs carry scenes that were.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from interface import StepFailed, Variable

from .scene import Scene
from .schema import SceneError, Setting

__all__ = ["Scene", "SceneError", "Setting", "StepFailed", "Variable", "available", "load", "name_of", "settings_of"]


def load(scene: str | Path, settings: Mapping[str, Any] | None = None) -> Scene:
    """The scene with this name or in this folder; raises `SceneError` with one sentence where anything is wrong."""
    from .readers.scene import load as read

    return read(scene, settings)


def settings_of(scene: str | Path) -> dict[str, Setting]:
    """The settings that a scene offers, by name; of the scene, no table is read."""
    from .readers.scene import settings_of as offered

    return offered(scene)


def name_of(scene: str | Path) -> str:
    """The name of a scene given by its name or folder; no file is read."""
    from .readers.scene import name_of as name

    return name(scene)


def available() -> list[str]:
    """Names of the built-in scenes."""
    from .readers.scene import available as built_in

    return built_in()
