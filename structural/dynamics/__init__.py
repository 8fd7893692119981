"""Particle systems in time: equations of motion, integration schemes, the time loop, form finding."""

from .form_finding import METHODS, Form, form_finding
from .integration import Balance, Integration, integrate
from .motion import Motion, State
from .schemes import BDF2, SCHEMES, GeneralisedAlpha, ImplicitEuler, Scheme

__all__ = [
    "BDF2",
    "METHODS",
    "SCHEMES",
    "Balance",
    "Form",
    "GeneralisedAlpha",
    "ImplicitEuler",
    "Integration",
    "Motion",
    "Scheme",
    "State",
    "form_finding",
    "integrate",
]
