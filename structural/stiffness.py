"""What stiff members mean for a solve: the rounding that they leave, and softer ones to begin with."""

from dataclasses import replace

import numpy as np

# A soft line is stretched to twice its length by SOFT times the load at first, then by STIFFENING times more each time;
# no load counts as less than SMALLEST_LOAD of the largest k l0. Chosen on random networks of ropes.
SOFT, STIFFENING, SMALLEST_LOAD = 3.0, 30.0, 1e-9


def rounding_force(chains, beams=(), reach=0.0):
    """Force N by which rounding of the element lengths alone may leave a structure out of balance: 4 eps ||k l0||.

    For beams, which may be much shorter than their coordinates (at most `reach` m), EA max(1, reach / l0) takes the
    place of k l0, with the stiffness 12 EI / l0^2 of bending added to EA. In motion see `rounding_of_positions`.
    """
    squares = sum(np.sum((c.k * c.l0) ** 2) for c in chains)
    for b in beams:
        stiffness = b.section.EA + 12.0 * b.section.initial_bending / b.l0**2
        squares += np.sum((stiffness * np.maximum(1.0, reach / b.l0)) ** 2)
    return 4.0 * np.finfo(float).eps * float(np.sqrt(squares))


def rounding_of_positions(chains, reach):
    """Force N that rounding of coordinates of `reach` m makes: eps ||k reach||, the errors of elements being random."""
    return np.finfo(float).eps * reach * float(np.sqrt(sum(np.sum(c.k**2) for c in chains)))


def softened_stages(chains, load):
    """The chains with lines and ropes that are softer than they are by degrees, the softest first; none without load.

    A soft line has a spring in series, k' = k P / (P + k l0), P the load N that stretches that spring by l0. Springs
    that may push keep their stiffness, which keeps them from buckling.
    """
    largest = max((float(np.max(c.k * c.l0, where=~c.two_way, initial=0.0)) for c in chains), default=0.0)
    stages = []
    spring = SOFT * max(load, SMALLEST_LOAD * largest)
    while 0.0 < load < np.inf and spring < largest:
        k = [np.where(c.two_way, c.k, c.k * spring / (spring + c.k * c.l0)) for c in chains]
        stages.append(tuple(replace(c, k=soft) for c, soft in zip(chains, k, strict=True)))
        spring *= STIFFENING
    return stages
