"""A start for form finding from nothing: the net of uniform pull that is as long as the elements want to be."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from structural.assembly import Assembly
from structural.elements import ElementGroup
from structural.elements.chains import Chains
from structural.model import Loads
from structural.solve.linear import factorised
from structural.solve.singular import Singular

# Bounds of the common pull N relative to the load and to the stiffest element, within which it is sought.
WEAKEST, STRONGEST = 1e-6, 1.0


def force_density_start(assembly: Assembly, groups: Sequence[ElementGroup], loads: Loads, x0: np.ndarray):
    """Node positions (n,3) m where every element pulls with s l / l0 and the loads are those at x0; None where there
    are no springs or lines, some run through more than two nodes or have no length, or nothing holds them.

    With given force densities equilibrium is linear (Schek 1974): x = x_held + x_loaded / s with two solutions on one
    factorisation. The pull s is that for which the elements together have the length that they have under it.
    """
    chains = [g for g in groups if isinstance(g, Chains)]
    if not chains or any(c.nodes.shape[1] != 2 or np.any(c.l0 <= 0.0) for c in chains):
        return None

    def pulling(c):
        return replace(c.never_slack(), l0=np.zeros_like(c.l0), k=1.0 / c.l0)

    nets = tuple(pulling(g) if isinstance(g, Chains) else g for g in groups)
    q0 = assembly.unknowns.restrict(x0)
    held, k, _ = assembly.residual_and_tangent(q0, assembly.prepare(Loads(np.zeros_like(loads.dead)), nets))
    loaded, _ = assembly.residual(q0, assembly.prepare(loads, nets))
    try:
        factors = factorised(k)
    except Singular:  # nothing holds a part of it
        return None
    at_rest, moved = q0 - factors.solve(held), factors.solve(held - loaded)
    load = assembly.unknowns.norm(held - loaded)
    if not load > 0.0:
        return assembly.positions(at_rest)

    def too_long(log_pull):
        pull = np.exp(log_pull)
        x = assembly.positions(at_rest + moved / pull)
        gap = 0.0
        for c in chains:
            length = np.linalg.norm(x[c.nodes[:, 1]] - x[c.nodes[:, 0]], axis=1)
            gap += float(np.sum(length - c.l0 - pull * length / (c.l0 * c.k)))
        return gap

    low = np.log(WEAKEST * load)
    high = np.log(max(max(float(np.max(c.k * c.l0)) for c in chains) * STRONGEST, 10.0 * WEAKEST * load) * 1e3)
    if not too_long(low) > 0.0 > too_long(high):
        return None
    return assembly.positions(at_rest + moved / np.exp(brentq(too_long, low, high, xtol=1e-3)))
