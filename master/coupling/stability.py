"""Static stability of a converged coupled equilibrium, from the coupled map alone."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from master.coupling.equilibrium import TIGHTEST, Coupling
from master.coupling.pseudo_time import BLOCK
from master.coupling.spectrum import Eigenvalue, rightmost_eigenvalue

# Perturbation of the interface, m (2-norm over all nodes): small against any wrinkle of the map, and 1e4 times what the
# structural tolerance leaves open.
STEP = 1e-4
# Part of the largest displacement below which one is rounding.
ROUNDING = 1e-9
# How close to 1 the eigenvalue of a neutral mode comes out: accuracy of the Arnoldi iteration.
NEUTRAL = 2e-3


@dataclass(frozen=True)
class Stability:
    """`statically_stable` (None where it could not be decided), the real part of the rightmost eigenvalue of G', how
    many evaluations of G that took, `symmetric_only` where only mirror-symmetric motions were tested, and the reason.
    """

    statically_stable: bool | None
    eigenvalue: float
    evaluations: int
    symmetric_only: bool
    message: str


def static_stability(coupling: Coupling, x: np.ndarray) -> Stability:
    """Whether the equilibrium with interface displacement x (n,3) m is statically stable.

    The coupled tangent is K - F' = K (I - G'). Where the structural tangent K is positive, it has a negative eigenvalue
    where G' has a real one above 1, and is singular (neutral) where one equals 1. Both participants return to their
    states. While both solve mirrored halves, the search stays within symmetric motions: it starts from the way that the
    nodes have come from where the kite starts, each shortened to its square root, which keeps the symmetry in whatever
    plane and has a part in every mode. (What a solve has moved would not do: from a warm start that is rounding, which
    is lopsided.)
    """
    if BLOCK in coupling.structural.blocks and float(coupling.structural.get(BLOCK)) > 0.0:
        text = "the coupled map jumps; steps in pseudo-time have come to rest here, which they do where it is stable"
        return Stability(None, float("nan"), 0, False, text)
    participants = (coupling.structural, coupling.aero)
    symmetric = all("symmetry_used" in p.blocks and bool(p.get("symmetry_used")) for p in participants)
    seed = _symmetric_seed(x, coupling.start) if symmetric else None
    evaluations = coupling.evaluations
    states: dict[str, Any] = {}
    try:
        states = coupling.save()
        coupling.set_tolerance(TIGHTEST)
        found = rightmost_eigenvalue(coupling, x, step=STEP, start=seed)
    except ArithmeticError as error:
        return Stability(None, float("nan"), coupling.evaluations - evaluations, symmetric, str(error))
    finally:
        try:
            coupling.restore(states)
        finally:
            coupling.free(states)
    unstable_modes = 0
    if "unstable_modes" in coupling.structural.blocks:
        unstable_modes = int(coupling.structural.get("unstable_modes"))
    return _judged(found, unstable_modes, symmetric)


def _symmetric_seed(x: np.ndarray, start: np.ndarray) -> np.ndarray | None:
    """A direction (n,3) as symmetric as the displacements x and `start` (n,3) m are; None where they are the same."""
    moved = x - start
    way = np.linalg.norm(moved, axis=-1, keepdims=True)
    if not way.max() > ROUNDING * max(np.abs(x).max(), np.abs(start).max()):
        return None
    return np.where(way > ROUNDING * way.max(), moved / np.sqrt(np.where(way > 0.0, way, 1.0)), 0.0)


def _judged(found: Eigenvalue, unstable_modes: int, symmetric: bool) -> Stability:
    """The verdict from the spectrum found and the number of unstable directions of the structure by itself."""
    if not np.isfinite(found.value):
        return Stability(None, float("nan"), found.evaluations, symmetric, found.message)
    real = found.ritz_values[np.abs(np.imag(found.ritz_values)) <= NEUTRAL].real
    above = int(np.count_nonzero(real > 1.0 - NEUTRAL)) if found.settled else 0
    value = float(real.max()) if above and found.settled else found.value
    if unstable_modes:
        # Signs of det K and det(I - G'): an odd sum is a coupled tangent with an odd number of negative eigenvalues.
        stable = False if found.settled and (unstable_modes + above) % 2 else None
        text = f"the structure alone has {unstable_modes} unstable directions under these loads"
        return Stability(stable, value, found.evaluations, symmetric, text)
    if above:
        text = f"the coupled map has the eigenvalue {value:.3f}, and above 1 a small disturbance grows"
        text += " (here neutral within the accuracy of the search)" if value < 1.0 + NEUTRAL else ""
        return Stability(False, value, found.evaluations, symmetric, text)
    return Stability(True if found.settled else None, value, found.evaluations, symmetric, found.message)
