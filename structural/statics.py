"""Static equilibrium: Newton on the true residual, globalised so that slack members and mechanisms do no harm."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg as spla

from .assembly import Assembly
from .chains import Chains
from .structure import Loads

# The shift that is always there, relative to the mean stiffness: it gives directions without any stiffness (slack
# nodes without weight) a zero step instead of an infinite one, and leaves Newton's convergence untouched.
SMALLEST_SHIFT = 1e-12
# Stiffness that a dof without any gets in the shift, relative to that of the stiffest element.
SOFTEST = 1e-6
# Steps refused one after the other, and cuts of one step, before giving up.
MOST_REJECTIONS, MOST_CUTS = 30, 12
# After this many short steps in a row (below a third) whole Newton steps are tried again, at most BURST of them.
SHORT_STEPS, BURST = 3, 10


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Result of a static solve: `x` (n,3) m, `status` "converged" or why not, and the residual norms N met on the
    way.
    """

    x: np.ndarray
    status: str
    iterations: int
    residuals: tuple[float, ...]

    @property
    def converged(self):
        """Whether the residual met the tolerance."""
        return self.status == "converged"

    @property
    def residual(self):
        """Norm of the out-of-balance force over the free dofs, N."""
        return self.residuals[-1]


def equilibrium(
    assembly: Assembly,
    chains: tuple[Chains, ...],
    loads: Loads,
    x0: np.ndarray,
    atol: float = 1e-6,
    rtol: float = 0.0,
    max_iterations: int = 200,
    step_limit: float = 1.0,
) -> Equilibrium:
    """Positions where internal and external forces balance: ||r|| <= atol + rtol ||f_ext||, in newtons.

    Where the elements are so stiff that rounding of their lengths alone makes larger forces, that rounding is the
    tolerance.

    Whole Newton steps come first and are kept as long as each burst of them lowers the residual: that is all a warm
    start needs, and it is what stiff members need that turn by a large angle. Otherwise Newton on K + mu S goes on, S
    the diagonal of K: the shift mu is tied to the residual and adapts to how well the step did (Levenberg-Marquardt;
    quadratic convergence at the end also with mechanisms), and a step is shortened until the out-of-balance force
    along it no longer grows. For tension-only members under dead loads that is a line search on a convex energy, and
    it needs no energy, so follower loads may take part. No step moves a node by more than `step_limit` m.
    """
    u = assembly.unknowns
    prepared = assembly.prepare(chains, loads)
    q = u.restrict(x0)
    r, k, external = assembly.residual_and_tangent(q, prepared)
    norm = float(np.linalg.norm(r))
    norms = [norm]
    atol = max(atol, rounding_force(chains))
    stiffest = max(float(c.k.max(initial=0.0)) for c in chains)
    damping = 0.0 if norm < 1e3 * (atol + rtol * external) else 1.0
    status = "max_iterations"
    rejected = short = 0
    patience = SHORT_STEPS
    while norm > atol + rtol * external and len(norms) <= max_iterations:
        (q, r, k, external), spent, better = _burst(
            assembly, prepared, (q, r, k, external), atol, rtol, step_limit, stiffest
        )
        norm = float(np.linalg.norm(r))
        norms.extend([norm] * spent)
        if not better:
            break
    for _ in range(max_iterations + 1):
        if norm <= atol + rtol * external:
            status = "converged"
            break
        if not np.isfinite(norm):
            status = "not_finite"
            break
        if len(norms) > max_iterations:
            break
        step = _step(k, r, norm, damping, external, assembly, stiffest)
        longest = float(np.abs(step).max())
        if longest > step_limit:
            step *= step_limit / longest
        s, trial = _along(assembly, prepared, q, r, step)
        if trial is None:
            damping = max(10.0 * damping, 1e-3)
            rejected += 1
            if rejected > MOST_REJECTIONS:
                status = "stalled"
                break
            continue
        rejected = 0
        short = short + 1 if s < 0.3 else 0
        if s == 1.0:
            damping = 0.2 * damping if damping > 1e-8 else 0.0
        elif s < 0.3:
            damping = max(4.0 * damping, 1e-4)
        q = q + s * step
        r, k, external = trial
        norm = float(np.linalg.norm(r))
        norms.append(norm)
        if short >= patience:
            (q, r, k, external), spent, better = _burst(
                assembly, prepared, (q, r, k, external), atol, rtol, step_limit, stiffest
            )
            norm = float(np.linalg.norm(r))
            norms.extend([norm] * spent)
            damping = 0.0 if better else damping
            short, patience = 0, SHORT_STEPS if better else 2 * patience
    return Equilibrium(u.expand(q), status, len(norms) - 1, tuple(norms))


def rounding_force(chains):
    """Force N by which rounding of the element lengths alone may leave a structure out of balance: 4 eps ||k l0||."""
    return 4.0 * np.finfo(float).eps * float(np.sqrt(sum(np.sum((c.k * c.l0) ** 2) for c in chains)))


def _step(k, r, norm, damping, external, assembly, stiffest):
    """Newton step of the shifted tangent; the shift grows until the step goes downhill (-r.d > 0)."""
    diagonal = np.abs(k.data[assembly.diagonal])
    scale = np.maximum(diagonal, SOFTEST * max(diagonal.max(), stiffest))
    mu = max(damping * min(norm / max(external, 1e-30), 1.0), SMALLEST_SHIFT)
    while True:
        shifted = k.copy()
        shifted.data[assembly.diagonal] += mu * scale
        try:
            step = spla.splu(shifted, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(-r)
        except RuntimeError:  # exactly singular
            step = np.full_like(r, np.nan)
        if np.all(np.isfinite(step)) and float(step @ r) < 0.0:
            return step
        if mu > 1e6:
            return -r / scale
        mu = max(10.0 * mu, 1e-6)


def _burst(assembly, prepared, state, atol, rtol, step_limit, stiffest):
    """State (q, r, K, ||f_ext||) after whole Newton steps, or the one given if they lead nowhere; steps; success."""
    q, r, k, external = state
    start = norm = float(np.linalg.norm(r))
    for count in range(1, BURST + 1):
        step = _step(k, r, norm, 0.0, external, assembly, stiffest)
        longest = float(np.abs(step).max())
        q = q + step * min(1.0, step_limit / longest)
        r, k, external = assembly.residual_and_tangent(q, prepared)
        norm = float(np.linalg.norm(r))
        if not np.isfinite(norm):
            return state, count, False
        if norm <= max(atol + rtol * external, 0.1 * start):
            return (q, r, k, external), count, True
    return (state, BURST, False) if norm >= start else ((q, r, k, external), BURST, True)


def _along(assembly, prepared, q, r, step):
    """Fraction s of the step along which the out-of-balance force r.d does not grow, and (r, K, ||f_ext||) there.

    The full step is tried with its tangent, because it is nearly always taken; None if no fraction will do.
    """
    slope, norm = float(r @ step), float(np.linalg.norm(r))
    s = 1.0
    for _ in range(MOST_CUTS):
        trial = assembly.residual_and_tangent(q + s * step, prepared)
        r_new = trial[0]
        slope_new = float(r_new @ step)
        if np.isfinite(slope_new):
            downhill = slope_new < 0.0  # the minimum along the step lies still ahead
            if downhill or abs(slope_new) <= 0.9 * abs(slope) or np.linalg.norm(r_new) < 0.5 * norm:
                return s, trial
            s *= min(max(slope / (slope - slope_new), 0.1), 0.7)  # secant to r.d = 0
        else:
            s *= 0.1
    return s, None
