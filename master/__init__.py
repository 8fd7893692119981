"""Coupling master: participants, the coupling loop, acceleration, convergence, report and command line."""

from master.acceleration import IQNILS, Aitken, ConstantRelaxation
from master.fixed_point import FixedPointResult, fixed_point

__all__ = ["IQNILS", "Aitken", "ConstantRelaxation", "FixedPointResult", "fixed_point"]
