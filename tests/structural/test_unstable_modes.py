"""How many directions of a converged equilibrium are unstable."""

import numpy as np
import pytest

from structural import Assembly, equilibrium
from tests.structural.models import chains, dead, structure


@pytest.mark.parametrize(("stretch", "mirror", "modes"), [(0.9, None, 2), (0.9, [0, 1, 2], 1), (1.1, None, 0)])
def test_a_compressed_straight_strut_is_unstable_in_both_directions_across(stretch, mirror, modes):
    # two springs in line with force T: stiffness across 2 T / l, negative in compression; the mirror plane holds y
    nodes = stretch * np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    s = structure(nodes, [True, False, True], [chains([[0, 1], [1, 2]], 1.0, 1e3, True)])
    a = Assembly(s, None if mirror is None else np.array(mirror))
    assert equilibrium(a, dead(np.zeros_like(nodes)), nodes).unstable_modes == modes
