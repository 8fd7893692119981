"""Acceleration schemes for fixed points x = G(x): each is only its update, the iteration loop is in fixed_point.py."""

from master.acceleration.multi_vector import IQNIMVJ
from master.acceleration.newton_krylov import NewtonKrylov
from master.acceleration.quasi_newton import IQNILS
from master.acceleration.relaxation import Aitken, ConstantRelaxation
from master.acceleration.scheme import Field, Scheme

__all__ = ["IQNILS", "IQNIMVJ", "Aitken", "ConstantRelaxation", "Field", "NewtonKrylov", "Scheme"]
