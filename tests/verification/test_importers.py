"""The V3 kite's two FMUs stepped by a plain master: in any order it runs the explicit scheme to the same place."""

import numpy as np
import pytest

import scenes
from benchmarks.problems import in_process, loaded
from fmus.builder import build
from master.coupling import FmuParticipant, solve
from master.coupling.acceleration import IQNILS

LOADS = ("pressure", "shear", "line_load")


def exchange(structure, flow, order, t):
    """One communication step of both, in an order that FMI masters use."""

    def to_structure():
        for block in LOADS:
            if block in structure.blocks:
                structure.set(block, flow.get(block))

    def to_flow():
        flow.set("displacement", structure.get("displacement"))

    if order == "flow first":
        to_flow()
        flow.step(t, 1.0)
        to_structure()
        structure.step(t, 1.0)
    elif order == "structure first":
        to_structure()
        structure.step(t, 1.0)
        to_flow()
        flow.step(t, 1.0)
    else:  # all outputs, then all steps
        to_structure()
        to_flow()
        structure.step(t, 1.0)
        flow.step(t, 1.0)


@pytest.mark.parametrize("order", ["flow first", "structure first", "both at once"])
def test_any_order_of_stepping_ends_at_the_coupled_equilibrium(order, tmp_path):
    scene, given = loaded("v3_kite", wind_speed=12.0)
    paths = build(scene, tmp_path, given)
    with FmuParticipant(paths[0]) as structure, FmuParticipant(paths[1]) as flow:
        assert float(flow.get("CL")) > 0.3  # the loads on the wing as it starts are there before the first step
        for t in range(60):
            exchange(structure, flow, order, float(t))
        alpha = np.rad2deg(float(flow.get("alpha_mid")))
    coupling = in_process("v3_kite", wind_speed=12.0)
    solve(coupling, IQNILS())
    expected = np.rad2deg(float(coupling.aero.get("alpha_mid")))
    # 60 steps at a contraction of about 0.5 a pair of steps leave less than 1e-3 deg of the first few degrees.
    assert alpha == pytest.approx(expected, abs=2e-3)


def test_a_scene_without_a_free_pitch_has_no_trim_angle():
    for core in (scenes.load("typical_section").structural_core(), scenes.load("typical_section").aero_core()):
        assert "trim_angle" not in {v.name for v in core.variables}
