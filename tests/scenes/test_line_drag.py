"""Line drag between the two cores of a scene."""

import numpy as np
import pytest

import scenes
from aero import line_loads


def exchanged():
    """The cores of the V3 kite after one exchange from the trim pose."""
    scene = scenes.load("v3_kite")
    structure, air = scene.structural_core(), scene.aero_core()
    structure.set("trim_angle", scene.trim_angle())
    air.set("displacement", structure.get("displacement"))
    air.step(0.0, 0.0)
    for block in ("pressure", "shear", "line_load"):
        structure.set(block, air.get(block))
    structure.step(0.0, 0.0)
    return structure, air


def test_load_on_one_line_only_turns_symmetry_off():
    structure, _ = exchanged()
    assert bool(structure.get("symmetry_used"))
    load = structure.get("line_load")
    load[0] *= 2.0
    other = scenes.load("v3_kite").structural_core()
    other.restore(structure.save())
    structure.set("line_load", load)
    structure.step(0.0, 0.0)
    assert not bool(structure.get("symmetry_used"))
    other.set("symmetric", 0.0)
    other.set("line_load", load)
    other.step(0.0, 0.0)
    assert np.array_equal(structure.get("position"), other.get("position"))


def test_line_outputs_follow_air_wind_and_coefficients():
    scene = scenes.load("v3_kite", {"panels_per_section": 2})
    air = scene.aero_core()
    given = {"air_density": 1.0, "line_normal_drag": 0.9, "line_friction": 0.1, "wind_speed": 15.0}
    for block, value in given.items():
        air.set(block, value)
    direction = np.array([0.8, 0.0, 0.6])
    air.set("wind_direction", direction)
    moved = 0.1 * np.sin(np.arange(scene.interface.nodes.size)).reshape(-1, 3)
    air.set("displacement", moved)
    air.step(0.0, 0.0)
    ends = (scene.interface.nodes + moved)[scene.interface.lines]
    load = line_loads(ends, scene.interface.diameter, 15.0 * direction, 1.0, 0.9, 0.1)
    assert np.array_equal(air.get("line_load"), load)
    force = load * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
    rounding = 1e-13 * np.abs(force).sum()
    assert air.get("line_force") == pytest.approx(force.sum(axis=0), abs=rounding)
    pivot = scene.members.nodes[scene.pivot]
    moment = sum(np.cross(0.5 * (a + b) - pivot, f) for (a, b), f in zip(ends, force, strict=True))
    assert air.get("line_moment") == pytest.approx(moment, abs=12.0 * rounding)  # arms of up to 12 m
    total = air.get("force") + force.sum(axis=0)
    up = np.array([-0.6, 0.0, 0.8])
    assert float(air.get("glide_ratio")) == pytest.approx((total @ up) / (total @ direction), rel=1e-12)
