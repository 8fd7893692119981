"""Forces that rounding alone leaves out of balance, below which no tolerance can be met."""

import numpy as np

EPS = float(np.finfo(float).eps)


def rounding_force(groups, at, reach=0.0):
    """Force N by which rounding of the element lengths alone may leave a structure out of balance: 4 eps ||k l0|| for
    springs; `at` is a configuration, `reach` m how large coordinates are. In motion see `rounding_of_positions`.
    """
    squares = sum(np.sum(group.rounding(at, reach) ** 2) for group in groups)
    return 4.0 * EPS * float(np.sqrt(squares))


def rounding_of_positions(groups, at, reach):
    """Force N that rounding of coordinates of `reach` m makes: eps ||k reach||, the errors of elements being random."""
    return EPS * reach * float(np.sqrt(sum(np.sum(group.stiffness(at) ** 2) for group in groups)))


def stiffest(groups, at):
    """Stiffness N/m of the stiffest element in a configuration, 0 without any (see `ElementGroup.stiffness`)."""
    return max((float(group.stiffness(at).max(initial=0.0)) for group in groups), default=0.0)
