"""How an equilibrium moves when its loads change a little: the tangent at the solution, factorised once."""

from dataclasses import replace

import numpy as np

from .linear import ACCURATE_PIVOT, factorised, shifted
from .singular import Singular

# Shift relative to each unknown's own stiffness where the tangent is exactly singular.
SHIFT = 1e-12


class LoadSensitivity:
    """Derivative of the positions of an equilibrium with respect to its loads.

    r(q, f) = f_int(q) - f_ext(q, f) = 0 at every load, so that K dq = (df_ext/df) df with the consistent tangent K of
    elements, links and follower loads. `x` (n,3) m and `rotations` (r,3,3) are the equilibrium, found by
    `equilibrium`; `reaction` (r,3) N m are the moments that hold clamped frames, which stiffen their other axes.
    No shift, softening or damping is in it, but where K is exactly singular: directions without any stiffness then
    get (nearly) no displacement, as in the steps of the solver.
    """

    def __init__(self, assembly, loads, x, groups=None, rotations=None, reaction=None):
        self._assembly, self._x, self._rotations = assembly, x, rotations
        if reaction is not None:
            loads = replace(loads, moment=reaction if loads.moment is None else loads.moment + reaction)
        prepared = assembly.prepare(loads, groups)
        _, k, _ = assembly.residual_and_tangent(assembly.unknowns.restrict(x), prepared, rotations)
        self._factors = None
        if not k.shape[0]:
            return
        try:
            self._factors = factorised(k, ACCURATE_PIVOT)
        except Singular:
            diagonal = np.abs(k.data[assembly.diagonal])
            shift = SHIFT * np.maximum(diagonal, diagonal.mean() or 1.0)
            self._factors = factorised(shifted(k, assembly.diagonal, shift), ACCURATE_PIVOT)

    def __call__(self, change):
        """Displacements (n,3) m of the nodes for a small change of the loads, a `Loads` of these changes.

        Where the assembly solves one half, the change has to be mirror-symmetric.
        """
        if self._factors is None:
            return np.zeros_like(self._x)
        force = self._assembly.load_forces(self._x, change, self._rotations)
        return self._assembly.moves(self._factors.solve(force), self._rotations)
