"""Scenes: what is simulated, and the loader that makes solver cores of it."""

from .scene import Scene, available, load
from .tables import SceneError
from .variables import StepFailed, Variable

__all__ = ["Scene", "SceneError", "StepFailed", "Variable", "available", "load"]
