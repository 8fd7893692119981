"""How equilibria move with their loads: closed forms, and members without any stiffness."""

import numpy as np
import pytest

from structural import Assembly, Loads, LoadSensitivity, equilibrium, interface_loads
from tests.structural.models import chains, structure

K, L0 = 40.0, 1.5


def pulled(slack, w):
    """Assembly and loads of a line along x from a support, in a line load w N/m along it; with `slack` a loose
    line goes on from its free end to a node that nothing else holds.
    """
    nodes = np.array([[0.0, 0, 0], [2.0, 0, 0], [2.5, 0, 0]])[: 3 if slack else 2]
    group = chains([[0, 1], [1, 2]] if slack else [[0, 1]], [L0, 1.0] if slack else L0, K)
    fixed = np.arange(len(nodes)) == 0
    s = structure(nodes, fixed, [group], np.eye(2, len(nodes)), None, [[0, 1]])
    loads = Loads(np.zeros_like(nodes), interface_loads(line_load=np.array([[w, 0.0, 0.0]])))
    return Assembly(s), loads


@pytest.mark.parametrize("slack", [False, True], ids=["line", "line with a loose end"])
def test_line_in_a_line_load_stretches_with_it_as_its_closed_form(slack):
    """k (l - l0) = w l / 2, hence dl/dw = k l0 / 2 / (k - w / 2)^2; across it, T/l v = w_y l / 2 with T = w l / 2."""
    w = 12.0
    assembly, loads = pulled(slack, w)
    found = equilibrium(assembly, loads, assembly.structure.nodes, 1e-12)
    assert found.converged
    sensitivity = LoadSensitivity(assembly, loads, found.x)
    length = K * L0 / (K - w / 2)

    def moved(direction):
        return sensitivity(Loads(np.zeros_like(found.x), interface_loads(line_load=np.array([direction]))))

    along, across = moved([1.0, 0.0, 0.0]), moved([0.0, 2.0, 0.0])
    # rounding, and the shift of a millionth of a millionth that a node without stiffness needs
    assert along[1] == pytest.approx([K * L0 / 2 / (K - w / 2) ** 2, 0.0, 0.0], rel=1e-10, abs=1e-12)
    assert across[1] == pytest.approx([0.0, 2.0 * length / w, 0.0], rel=1e-10, abs=1e-12)
    assert not along[2:].any()  # nothing pulls at the loose node
    assert not across[2:].any()


def test_structure_without_unknowns_does_not_move():
    assembly, loads = pulled(False, 12.0)
    fixed = structure(assembly.structure.nodes, [True, True], assembly.structure.groups, np.eye(2), None, [[0, 1]])
    x = fixed.nodes
    sensitivity = LoadSensitivity(Assembly(fixed), loads, x)
    assert not sensitivity(loads).any()


def test_dead_forces_move_nodes_too():
    """A change of dead forces, along a line under tension T: dx = df / k along it and df l / T across it."""
    w = 12.0
    assembly, loads = pulled(False, 0.0)
    weight = np.array([[0.0, 0, 0], [w, 0, 0]])
    loads = Loads(weight, loads.on)
    found = equilibrium(assembly, loads, assembly.structure.nodes, 1e-12)
    change = Loads(np.array([[0.0, 0, 0], [1.0, 2.0, 3.0]]))
    length = L0 + w / K
    expected = [1.0 / K, 2.0 * length / w, 3.0 * length / w]
    assert LoadSensitivity(assembly, loads, found.x)(change)[1] == pytest.approx(expected, rel=1e-10)  # rounding
