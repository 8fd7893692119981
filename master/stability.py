"""Static stability of a converged coupled equilibrium, from the coupled map alone."""

from dataclasses import dataclass

import numpy as np

from master.coupling import TIGHTEST, Coupling
from master.spectrum import rightmost_eigenvalue

# Perturbation of the interface, m (2-norm over all nodes): small against any wrinkle of the map, and 1e4 times what the
# structural tolerance leaves open.
STEP = 1e-4
# How close to 1 the eigenvalue of a neutral mode comes out: accuracy of the Arnoldi iteration.
NEUTRAL = 2e-3


@dataclass(frozen=True)
class Stability:
    """`statically_stable` (None where it could not be decided), the real part of the rightmost eigenvalue of G', and
    how
    many evaluations of G that took; `symmetric_only` where only mirror-symmetric motions were tested."""

    statically_stable: bool | None
    eigenvalue: float
    evaluations: int
    symmetric_only: bool
    message: str


def static_stability(coupling: Coupling, x: np.ndarray, start: np.ndarray) -> Stability:
    """Whether the equilibrium with interface displacement x (n,3) m is statically stable; `start` (n,3) is the
    initial x.

    The coupled tangent is K - F' = K (I - G') with the structural tangent K positive: it has a negative eigenvalue
    where G' has a real one above 1, and is singular (neutral) where one equals 1. Both participants return to their
    states. While both solve mirrored halves, the search stays within symmetric motions: it starts from the
    displacement that the solve found, entry by entry its square root, which keeps the symmetry and has a part in every
    mode.
    """
    participants = (coupling.structural, coupling.aero)
    symmetric = all("symmetry_used" in p.blocks and bool(p.get("symmetry_used")) for p in participants)
    seed = None
    if symmetric:
        d = x - start
        seed = np.sign(d) * np.sqrt(np.abs(d))
        if not np.any(seed):
            seed = None
    states = [p.save() for p in participants]
    try:
        coupling.set_tolerance(TIGHTEST)
        found = rightmost_eigenvalue(coupling, x, step=STEP, start=seed)
    finally:
        for participant, state in zip(participants, states, strict=True):
            participant.restore(state)
            participant.free(state)
    if not np.isfinite(found.value):
        return Stability(None, float("nan"), found.evaluations, symmetric, found.message)
    real = found.imaginary <= NEUTRAL
    above = real and found.value > 1.0 - NEUTRAL
    stable = None if not found.settled and not above else not above
    return Stability(stable, found.value, found.evaluations, symmetric, found.message)
