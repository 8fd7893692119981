"""How loads change when the shape changes a little: derivatives along directions, exact to rounding.

The functions from nodes to loads are analytic, so they are evaluated at x + i h v with a complex i and a tiny h: the
imaginary part is h times the derivative along v, the error is of order h^2 and nothing is subtracted (complex step;
Squire and Trapp 1998). Only the solve for the circulation is not repeated: the implicit function theorem replaces it.
"""

from dataclasses import replace

import numpy as np

from aero.complex_steps import STEP, moved

from .circulation import Circulation


class WingSensitivity:
    """Derivative of a wing's pressures and shears with respect to its nodes, at a solved shape.

    The imbalance of the circulation stays zero, F(gamma, x) = 0, so that for nodes moving along v

        dgamma = -(dF/dgamma)^-1 (dF/dx) v,   dp = (dp/dgamma) dgamma + (dp/dx) v,

    with the Jacobian of `SectionFlow`, inverted once. All else moves with v: strips, influence, camber, artificial
    viscosity, panels. `wing` is a `VortexStep`, `circulation` (n,) m^2/s the solution on `nodes` (s,3) m in the `wind`
    (3,) m/s, which contains the artificial `viscosity`; `symmetric` as in `VortexStep.loads`. numpy.linalg.LinAlgError
    where the Jacobian is singular.
    """

    def __init__(self, wing, nodes, wind, circulation, viscosity=0.0, symmetric=False):
        self._wing, self._nodes, self._wind, self._symmetric = wing, nodes, wind, symmetric
        self._viscosity = viscosity
        at = wing.placed(nodes, wind, symmetric)
        self._gamma = circulation[at.rows]
        flow = at.flow.with_viscosity(viscosity)
        self._inverse = np.linalg.inv(flow.jacobian(flow.imbalance(self._gamma)[1]))

    def __call__(self, direction):
        """Derivatives of pressure (p,) Pa and shear (p,3) Pa, or None, for nodes moving along `direction` (s,3) m; a
        mirror-symmetric one on a symmetric wing.
        """
        stepped, size = moved(self._nodes, direction)
        at = self._wing.placed(stepped, self._wind, self._symmetric)
        flow = at.flow.with_viscosity(self._viscosity)
        gamma = self._gamma - 1j * (self._inverse @ flow.imbalance(self._gamma)[0].imag)
        _, (_, _, _, speed, alpha, _, _, outside) = flow.imbalance(gamma)
        circulation = Circulation(gamma, alpha, speed, outside, True, 0, 0.0, self._viscosity)
        loads = self._wing.loaded(replace(at, flow=flow), circulation)
        return tuple(None if a is None else a.imag / STEP * size for a in (loads.pressure, loads.shear))
