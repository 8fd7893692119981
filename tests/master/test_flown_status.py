"""Runs whose kite does not fly as one any more have a status of their own, converged or not."""

import numpy as np
import pytest

from aero.panel.bodies import Body
from aero.panel.influence import PanelGeometry
from aero.panel.strips import Strips
from master.coupling.run import _as_flown
from tests.aero.closed_wings import wing


def ended(status, flow=(), structure=()):
    blocks = {
        "aero": {"CL": np.array(0.8), **dict(flow)},
        "structural": {"trim_angle": np.array(0.1), **dict(structure)},
    }
    return _as_flown(status, "How it ended.", [{"aero.CL": 0.9}], blocks)


@pytest.mark.parametrize("status", ["converged", "max_iterations"])
def test_a_kite_that_hangs_upside_down_is_not_converged(status):
    found, message = ended(status, {"CL": np.array(-0.2)})
    assert found == "negative_lift"
    assert "C_L is -0.2, 0.9 at the start" in message
    assert ("How it ended." in message) == (status != "converged")


def test_cells_turned_inside_out_are_named():
    found, message = ended("converged", {"crossed_strips": np.array(3.0), "crossed_strips_at": np.array(7.0)})
    assert found == "crossed_cells"
    assert "3 strips" in message
    assert "strip 7" in message


def test_a_kite_without_a_taut_line_is_lost():
    slack = {"tension": np.zeros(4), "slack_lines": np.array(4.0)}
    assert ended("max_iterations", structure=slack)[0] == "lines_lost"
    assert ended("max_iterations", structure=slack | {"slack_lines": np.array(3.0)})[0] == "max_iterations"


def test_strips_that_separate_explain_a_solve_without_an_end_and_no_other():
    separated = {"separated": np.array([0.0, 1.0, 1.0])}
    found, message = ended("stalled", separated)
    assert found == "separated"
    assert "strips 2, 3" in message
    assert "How it ended." in message
    assert ended("converged", separated) == ("converged", "How it ended.")


def test_a_kite_that_flies_keeps_its_status():
    for status in ("converged", "statically_unstable", "diverged", "stalled"):
        assert ended(status) == (status, "How it ended.")


def test_sides_that_went_through_each_other_are_seen_strip_by_strip():
    surface = wing()
    strips = Strips.of(Body.of(surface.nodes, surface.panels, surface.trailing_edges), surface.nodes)
    tips = strips.middles(surface.nodes)[:, 1]
    turned = np.where(surface.nodes[:, 1:2] > 1.5, surface.nodes * [1.0, 1.0, -1.0], surface.nodes)  # inside out there
    for nodes, crossed in ((surface.nodes, tips > 9.0), (turned, tips > 1.5)):
        g = PanelGeometry.of(nodes, surface.panels)
        sure = np.abs(tips - 1.5) > 0.6  # one strip is half turned
        assert np.array_equal(strips.crossed(g.centre, g.normal)[sure], crossed[sure])
