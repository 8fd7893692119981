"""The loop that tools are measured against is the explicit scheme of the master."""

import numpy as np
import pytest

from master.coupling import SCHEMES, Coupling, solve
from tests.interop import reference


@pytest.mark.parametrize("order", ["serial", "parallel"])
@pytest.mark.parametrize("steps", [1, 10])
def test_the_loop_is_the_explicit_scheme_of_the_master(order, steps):
    coupling = Coupling.in_process(reference.scene(), {"wind_speed": reference.WIND})
    result = solve(coupling, SCHEMES["explicit"](), max_iterations=steps, tie_tolerance=False, order=order)
    displacement = np.ravel(result.displacement)
    shape = reference.trajectory(order)[steps - 1, : displacement.size]
    # The master takes the first loads of the flow as they are, on a wing that it has displaced itself, 2e-15 m away.
    assert np.abs(displacement - shape).max() <= reference.SAME


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_either_order_ends_at_the_equilibrium_of_the_master(order):
    assert reference.distance(reference.trajectory(order)) <= reference.AT_REST


def test_stepping_both_at_once_makes_every_change_of_the_serial_order_in_two_steps():
    serial, parallel = reference.trajectory("serial"), reference.trajectory("parallel")
    n = reference.equilibrium().size
    for first in (0, 1):  # the shape stands still at every second step
        assert np.abs(parallel[first:20:2, :n] - serial[:10, :n]).max() <= reference.SAME


def test_loads_of_an_undeformed_wing_lead_to_another_equilibrium():
    # metres apart: its tips are folded (on the page: tip span below 6.8 m)
    assert reference.distance(reference.trajectory("parallel, undeformed")) > 1.0
