"""Scenes: what is simulated, and the loader that makes solver cores of it."""

from interface import StepFailed, Variable

from .scene import Scene, available, load
from .tables import SceneError

__all__ = ["Scene", "SceneError", "StepFailed", "Variable", "available", "load"]
