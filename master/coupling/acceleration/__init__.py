"""Acceleration schemes for fixed points x = G(x): each is only its update, the iteration loop is in fixed_point.py."""

from master.coupling.acceleration.multi_vector import IQNIMVJ
from master.coupling.acceleration.newton_krylov import NewtonKrylov
from master.coupling.acceleration.quasi_newton import IQNILS
from master.coupling.acceleration.relaxation import Aitken, ConstantRelaxation
from master.coupling.acceleration.scheme import Field, Scheme

__all__ = ["IQNILS", "IQNIMVJ", "Aitken", "ConstantRelaxation", "Field", "NewtonKrylov", "Scheme"]
