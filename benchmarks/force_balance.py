"""What a network is out of balance by, from positions alone: its own law in extended precision. It shares no code with
the solvers, which it is to judge.
"""

import numpy as np

REAL = np.longdouble
KNOB = REAL(1e-3)  # legs of ropes shorter than this part of the rest length end in a knob (theory: ropes over sheaves)


def out_of_balance(network, x):
    """Norm N of what the free nodes of a network are out of balance by at positions x (n,3) m, and the part of it that
    doubles explain: a unit in the last place of every coordinate, and four of lengths, whose squares and roots a solver
    rounds too, times the stiffness of every taut member along and across it,
    added up at each node as if all errors had the same sign.
    """
    x = np.asarray(x, REAL)
    force = np.asarray(network.loads, REAL).copy()
    noise = np.zeros(len(x), REAL)
    ulp = np.spacing(np.abs(np.asarray(x, float))).max(axis=1).astype(REAL) * np.sqrt(REAL(3.0))
    for group in network.members:
        legs = x[group.nodes[:, 1:]] - x[group.nodes[:, :-1]]
        length = np.sqrt((legs * legs).sum(axis=2))
        rest, stiffness = group.l0.astype(REAL), group.k.astype(REAL)
        knob = KNOB * rest[:, None] if group.nodes.shape[1] > 2 else np.zeros_like(length)
        divisor = np.maximum(length, knob)
        divisor = np.where(divisor > 0, divisor, 1)
        measured = np.where(length < knob, (length * length / divisor + divisor) / 2, length)
        stretch = measured.sum(axis=1) - rest
        pulls = group.two_way | (stretch > 0)
        tension = np.where(pulls, stiffness * stretch, 0)
        places = ulp[group.nodes].sum(axis=1)
        wrong = stiffness * (places + 4 * np.finfo(float).eps * np.maximum(length.sum(axis=1), rest))
        wrong += np.abs(tension) / divisor.sum(axis=1) * places  # by which it turns
        # within its own rounding a member may be taut or not, and then this is all that its tension is known to
        wrong = np.where(pulls | (stiffness * np.abs(stretch) <= wrong), wrong, 0)
        pull = tension[:, None, None] * legs / divisor[..., None]
        for i in range(legs.shape[1]):
            np.add.at(force, group.nodes[:, i], pull[:, i])
            np.subtract.at(force, group.nodes[:, i + 1], pull[:, i])
        for i in range(group.nodes.shape[1]):
            np.add.at(noise, group.nodes[:, i], wrong * (1 if i in (0, group.nodes.shape[1] - 1) else 2))
    free = ~network.held
    return float(np.sqrt((force[free] ** 2).sum())), float(np.sqrt((noise[free] ** 2).sum()))
