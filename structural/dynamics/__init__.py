"""Particle systems in time: equations of motion, integration schemes, the time loop, form finding."""

from .integration import Balance, Integration, integrate
from .motion import Motion, State
from .schemes import BDF2, SCHEMES, GeneralisedAlpha, ImplicitEuler, Scheme

__all__ = [
    "BDF2",
    "SCHEMES",
    "Balance",
    "GeneralisedAlpha",
    "ImplicitEuler",
    "Integration",
    "Motion",
    "Scheme",
    "State",
    "integrate",
]
