"""The typical section: a rigid plate on springs, whose answers have closed forms."""

import numpy as np
import pytest

import scenes


@pytest.mark.parametrize(("variant", "axis"), [("divergent", 0.4), ("restoring", 0.1)])
def test_supports_have_the_stiffness_of_a_plunge_and_a_pitch_spring(variant, axis):
    core = scenes.load("typical_section", {"variant": variant}).structural_core()
    m = scenes.load("typical_section", {"variant": variant}).members
    supports = {n: k for g in m.chains for n, k in zip(g.names, g.k, strict=True) if n.startswith("support")}
    assert sum(supports.values()) == 2000.0
    front = sum(k for n, k in supports.items() if "_le_" in n)
    assert 1.0 - front / 2000.0 == pytest.approx(axis, abs=1e-15)  # stiffness-weighted mean chord position
    # pitch stiffness about it is k_f x_f^2 + k_r x_r^2
    pitch = front * axis**2 + (2000.0 - front) * (1.0 - axis) ** 2
    assert pitch == pytest.approx({"divergent": 480.0, "restoring": 180.0}[variant], rel=1e-14)
    assert core.get("residual") == 0.0


@pytest.mark.parametrize("variant", ["divergent", "restoring"])
@pytest.mark.parametrize("pressures", [(30.0, 30.0), (50.0, 10.0), (-20.0, 40.0)])
def test_plate_twists_and_plunges_as_two_springs_say(variant, pressures):
    """A rigid plate on zero-length springs under pressures p1, p2 on its front and rear half (0.5 m2 each).

    Zero-length springs pull with k times the distance in any direction, so that turning the plate by theta about
    its elastic axis takes (sum k_i x_i^2) sin(theta), while the load, normal to the plate, keeps its moment about that
    axis: theta is an arcsine, and the axis moves by F / sum k_i along the turned normal.
    """
    core = scenes.load("typical_section", {"variant": variant}).structural_core()
    panels = core.get("pressure").size
    core.set("pressure", np.repeat(pressures, panels // 2))
    core.step(0.0, 0.0)
    front, rear = {"divergent": (1200.0, 800.0), "restoring": (1800.0, 200.0)}[variant]
    force = 0.5 * sum(pressures)
    arm = 0.5 * (0.25 * pressures[0] + 0.75 * pressures[1])  # moment about the leading edge per unit cos: N m
    axis = rear / (front + rear)
    stiffness = front * axis**2 + rear * (1.0 - axis) ** 2
    theta = np.arcsin((force * axis - arm) / stiffness)
    x = core.get("position")
    chord = x[1] - x[0]
    slope = np.arctan2(-chord[2], chord[0])
    # the plate is six springs of 1e8 N/m instead of rigid: in-plane loads of 30 N strain it by 1e-7
    assert slope == pytest.approx(theta, abs=1e-6)
    z_axis = (1.0 - axis) * x[0, 2] + axis * x[1, 2]
    assert z_axis == pytest.approx(force * np.cos(theta) / (front + rear), abs=1e-6)
    assert core.get("support_force") == pytest.approx([force * np.sin(theta), 0.0, force * np.cos(theta)], abs=1e-4)
    assert core.get("symmetry_used") == 1.0


def test_lift_of_the_flat_plate_is_two_pi_alpha():
    scene = scenes.load("typical_section")
    air = scene.aero_core()
    air.step(0.0, 0.0)
    q = 0.5 * 1.225 * 15.0**2
    assert air.get("alpha") == pytest.approx(0.001, abs=1e-12)  # strip theory: the geometric angle
    assert np.linalg.norm(air.get("force")) == pytest.approx(q * 2.0 * np.pi * 0.001, rel=1e-9)  # polar has 16 digits
    # normal to the plate, at a quarter of the chord: pressures of two panels carry force and moment
    assert air.get("force")[[0, 1]] == pytest.approx([0.0, 0.0], abs=1e-12 * q)
    assert air.get("moment")[1] == pytest.approx(-0.25 * air.get("force")[2], rel=1e-9)
