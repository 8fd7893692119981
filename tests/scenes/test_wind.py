"""Flow of transient scenes: gusts, wind relative to what moves, lines without a wing."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import scenes
from aero import LinesInWind, line_loads
from aero.vortex_step import VortexStep
from interface import StepFailed
from tests.scenes.broken import copy_of, edited

KITE, TETHER = "v3_kite_dynamic", "tether_in_wind"
GUST = {"gust_speed": 3.0, "gust_start": 1.0, "gust_duration": 4.0, "gust_interval": 0.0}
WIDTH = 0.5 * 1.225 * 0.004  # kg/m2 of the tether: rho d / 2
LENGTH, DRAG = 300.0, 1.22


def flow(name, **values):
    core = scenes.load(name).aero_core()
    for block, value in values.items():
        core.set(block, value)
    return core


def outputs(core):
    return {v.name: core.get(v.name) for v in core.variables if v.causality == "output"}


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[k], b[k]) for k in a)


def one_gust(since, duration, height):
    return 0.5 * height * (1.0 - np.cos(2.0 * np.pi * since / duration)) if 0.0 < since < duration else 0.0


# Gusts


@pytest.mark.parametrize("height", [3.0, -4.0])
def test_gust_is_a_cosine_once_and_the_wind_of_a_step_is_that_at_its_end(height):
    core, dt = flow(TETHER, **GUST | {"gust_speed": height}), 0.25
    for k in range(30):
        core.step(k * dt, dt)
        expected = 6.0 + one_gust((k + 1) * dt - 1.0, 4.0, height)
        assert float(core.get("present_wind_speed")) == pytest.approx(expected, rel=1e-14)  # rounding
        pull = WIDTH * DRAG * LENGTH * expected**2
        assert core.get("line_force")[0] == pytest.approx(pull, rel=1e-12)  # sum of 24 lines


def test_gusts_come_again_after_every_interval():
    core, dt = flow(TETHER, **GUST | {"gust_interval": 5.0}), 0.5
    speeds = []
    for k in range(42):
        core.step(k * dt, dt)
        speeds.append(float(core.get("present_wind_speed")))
    assert speeds[1:11] == pytest.approx([6.0 + one_gust(s, 4.0, 3.0) for s in np.arange(10) * dt], rel=1e-14)
    assert speeds[1:11] * 4 == pytest.approx(speeds[1:41], rel=1e-14)
    assert max(speeds) == pytest.approx(9.0, rel=1e-14)


@pytest.mark.parametrize("name", [KITE, TETHER])
def test_step_in_a_gust_is_solved_though_nothing_was_set(name):
    core = flow(name, **GUST)
    core.step(0.0, 1.0)
    load = core.get("line_load")
    core.step(1.0, 1.0)
    assert float(core.get("present_wind_speed")) > float(core.get("wind_speed"))
    resting = flow(name, gust_speed=0.0, wind_speed=core.get("present_wind_speed"))
    resting.step(0.0, 1.0)
    assert not np.array_equal(core.get("line_load"), load)
    assert core.get("line_load") == pytest.approx(resting.get("line_load"), rel=1e-13)  # the same speed, once summed


@pytest.mark.parametrize("name", [KITE, TETHER])
def test_unchanged_input_in_steady_wind_is_not_solved_again(name, monkeypatch):
    core = flow(name, gust_speed=0.0)
    core.step(0.0, 1.0)
    before, calls = outputs(core), []
    monkeypatch.setattr(VortexStep, "loads", lambda *a, **k: calls.append("wing"))
    monkeypatch.setattr(LinesInWind, "solve", lambda *a, **k: calls.append("lines"))
    core.step(1.0, 1.0)
    after = outputs(core)
    before.pop("newton_iterations", None), after.pop("newton_iterations", None)
    assert same(before, after)
    assert not calls


@pytest.mark.parametrize("name", [KITE, TETHER])
def test_restored_state_repeats_steps_in_gusts_and_motion_bitwise(name):
    core = flow(name, **GUST, added_mass_coefficient=1.0)
    rng = np.random.default_rng(1)
    shape = core.get("displacement").shape
    motion = 0.02 * rng.standard_normal((4, 2, *shape))

    def steps():
        out = []
        for k, (displacement, velocity) in enumerate(motion):
            core.set("displacement", displacement)
            core.set("velocity", velocity)
            core.step(1.5 + 0.5 * k, 0.5)
            out.append(outputs(core))
        return out

    core.step(1.0, 0.5)
    state = core.save()
    first = steps()
    core.restore(state)
    assert all(same(a, b) for a, b in zip(first, steps(), strict=True))


def test_wind_that_would_blow_backwards_ends_the_step_and_can_be_mended():
    core = flow(TETHER, **GUST | {"gust_speed": -6.5})
    core.step(0.0, 1.0)
    with pytest.raises(StepFailed, match=r"^the wind speed would be -0\.5 m/s at 3 s; gust_speed must be above"):
        core.step(1.0, 2.0)
    core.set("gust_speed", -5.0)
    core.step(1.0, 2.0)
    assert core.get("line_force")[0] == pytest.approx(WIDTH * DRAG * LENGTH, rel=1e-12)  # in 1 m/s


def test_gust_that_would_begin_before_the_last_is_over_ends_the_step():
    core = flow(TETHER, **GUST | {"gust_interval": 3.0})
    with pytest.raises(StepFailed, match=r"^a gust of 4 s is not over when the next begins after 3 s; make "):
        core.step(0.0, 1.0)


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        (TETHER, {"gust_duration": 0.0}, "gust_duration must be above zero"),
        (TETHER, {"gust_interval": -1.0}, "gust_interval must be between 0"),
        (TETHER, {"gust_start": np.nan}, "gust_start must be finite"),
        (TETHER, {"added_mass_coefficient": -1.0}, "added_mass_coefficient must be between 0"),
        (TETHER, {"velocity": np.zeros((24, 3))}, r"velocity has shape \(25, 3\)"),
        (TETHER, {"velocity": np.full((25, 3), np.inf)}, "velocity must be finite"),
        (TETHER, {"wind_direction": np.zeros(3)}, "wind_direction must not be zero"),
        ("v3_kite", {"velocity": np.zeros((30, 3))}, "there is no input or parameter 'velocity'"),
        ("v3_kite", {"gust_speed": 1.0}, "there is no input or parameter 'gust_speed'"),
    ],
)
def test_wrong_value_is_refused_in_one_sentence_and_changes_nothing(name, values, words):
    core = flow(name)
    before = core.save().values
    for block, value in values.items():
        with pytest.raises(ValueError, match=words) as caught:
            core.set(block, value)
        assert str(caught.value).endswith(".")
    assert same(before, core.save().values)


# The wing of a transient scene


def test_wing_of_a_scene_in_motion_has_the_loads_of_its_relative_wind():
    core = flow(KITE, gust_speed=0.0)
    resting = flow(KITE, gust_speed=0.0, wind_speed=0.75 * float(core.get("wind_speed")))
    along = 0.25 * float(core.get("wind_speed")) * core.get("wind_direction")
    core.set("velocity", np.broadcast_to(along, core.get("velocity").shape))
    for one in (core, resting):
        one.step(0.0, 0.02)
    for block in ("pressure", "shear", "line_load", "force", "moment"):
        expected = resting.get(block)
        # solved to an imbalance of 1e-12 of the circulation
        assert core.get(block) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


def test_wing_that_sinks_has_a_larger_lift():
    core = flow(KITE, gust_speed=0.0)
    lift = []
    for sinking in (-0.2, 0.0, 0.2):
        core.set("velocity", np.broadcast_to([0.0, 0.0, -sinking], core.get("velocity").shape))
        core.step(0.0, 0.02)
        lift.append(float(core.get("CL")))
    assert lift[0] < lift[1] < lift[2]


def test_coefficients_of_a_wing_in_gusts_stay_on_the_steady_wind_speed():
    core = flow(KITE, **GUST)
    core.step(2.0, 1.0)
    assert float(core.get("present_wind_speed")) == pytest.approx(15.0, rel=1e-14)
    q_area = 0.5 * 1.225 * 12.0**2 * 19.753
    assert float(core.get("CD")) == pytest.approx(core.get("force")[0] / q_area, rel=1e-12)
    assert float(core.get("CL")) == pytest.approx(core.get("force")[2] / q_area, rel=1e-12)


def test_rolling_wing_is_solved_whole():
    core = flow(KITE, gust_speed=0.0, symmetric=1.0)
    core.step(0.0, 0.02)
    assert bool(core.get("symmetry_used"))
    core.set("velocity", np.cross([0.1, 0.0, 0.0], scenes.load(KITE).interface.nodes))
    core.step(0.02, 0.02)
    assert not bool(core.get("symmetry_used"))
    assert core.get("moment")[0] < 0.0


@pytest.mark.parametrize("name", [KITE, TETHER])
def test_flow_in_motion_refuses_directional_derivatives(name):
    core = flow(name)
    core.step(0.0, 0.02)
    with pytest.raises(ValueError, match="no directional derivatives; use"):
        core.directional_derivative({"displacement": core.get("displacement")})


def test_scenes_without_motion_have_neither_velocities_nor_gusts():
    names = {v.name for v in scenes.load("v3_kite").aero_core().variables}
    assert not names & {"velocity", "present_wind_speed", "added_mass_coefficient", *GUST}


# Lines without a wing


def test_tether_across_the_wind_has_the_drag_of_a_cylinder():
    core = flow(TETHER)
    core.look()
    before = core.get("line_force")
    core.step(0.0, 0.1)
    drag = WIDTH * DRAG * 36.0
    assert core.get("line_load") == pytest.approx(np.tile([drag, 0.0, 0.0], (24, 1)), rel=1e-14)
    assert core.get("line_force") == pytest.approx([drag * LENGTH, 0.0, 0.0], rel=1e-13)
    assert core.get("line_moment") == pytest.approx([0.0, drag * LENGTH * 150.0, 0.0], rel=1e-13)
    assert np.array_equal(before, core.get("line_force"))  # what is shown before the first step


def test_tether_meets_the_wind_minus_the_mean_velocity_of_the_ends_of_each_line():
    core = flow(TETHER, wind_direction=np.array([0.6, 0.8, 0.0]), line_friction=0.02)
    rng = np.random.default_rng(7)
    velocity, displacement = rng.normal(size=(2, 25, 3))
    core.set("velocity", velocity)
    core.set("displacement", displacement)
    core.step(0.0, 0.1)
    nodes = scenes.load(TETHER).interface.nodes + displacement
    own = 0.5 * (velocity[:-1] + velocity[1:])  # particle system thesis eq. 4.5
    ends = np.stack([nodes[:-1], nodes[1:]], axis=1)
    load = line_loads(ends, np.full(24, 0.004), 6.0 * np.array([0.6, 0.8, 0.0]) - own, 1.225, DRAG, 0.02)
    assert core.get("line_load") == pytest.approx(load, rel=1e-10, abs=1e-14)  # d is a root of the table's area


def test_tether_carried_along_by_the_wind_has_no_load():
    core = flow(TETHER)
    core.set("velocity", np.tile([6.0, 0.0, 0.0], (25, 1)))
    core.step(0.0, 0.1)
    assert not core.get("line_load").any()


def test_projected_area_of_an_inclined_tether_is_that_of_the_particle_system_thesis():
    core = scenes.load(TETHER, {"line_area": "projected"}).aero_core()
    nodes = scenes.load(TETHER).interface.nodes
    core.set("displacement", nodes[:, [2, 1, 0]] * [0.75, 0.0, 0.0])  # 53.13 degrees to the wind, of cosine 3/5
    core.step(0.0, 0.1)
    assert core.get("line_load") == pytest.approx(np.tile([0.4 * WIDTH * DRAG * 36.0, 0.0, 0.0], (24, 1)), rel=1e-13)


def test_air_around_an_accelerated_tether_resists_with_its_added_mass():
    # C_a rho pi d^2 / 4 times the acceleration across the line, besides the drag in the relative wind
    core, dt = flow(TETHER, added_mass_coefficient=1.0), 0.1
    displaced = 1.225 * np.pi * 0.004**2 / 4.0

    def resistance(speed, along=0.0):
        core.set("velocity", np.tile([speed, 0.0, along], (25, 1)))
        core.step(0.0, dt)
        return core.get("line_load") - [WIDTH * DRAG * (6.0 - speed) ** 2, 0.0, 0.0]

    small = 1e-12 * WIDTH * DRAG * 36.0  # rounding of the drag
    assert resistance(1.0) == pytest.approx(0.0, abs=small)  # nothing is known of the time before the first step
    assert resistance(3.0) == pytest.approx(np.tile([-displaced * 2.0 / dt, 0.0, 0.0], (24, 1)), abs=small)
    assert resistance(3.0) == pytest.approx(0.0, abs=small)  # the same input again: no acceleration any more
    assert resistance(3.0, along=5.0) == pytest.approx(0.0, abs=small)  # motion along the line moves no air


def test_flow_around_lines_loads_no_vortices():
    code = (
        "import sys, scenes; core = scenes.load('tether_in_wind').aero_core(); core.step(0.0, 0.1); "
        "print(*sorted(m for m in sys.modules if m.startswith('aero.')))"
    )
    root = Path(scenes.__file__).parents[1]
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root)
    loaded = run.stdout.split()
    assert "aero.line_drag" in loaded
    assert not [name for name in loaded if name.startswith("aero.vortex_step")]


def test_displacement_too_large_for_numbers_shows_no_load_and_fails_the_step():
    core = flow(TETHER)
    core.set("displacement", np.linspace(0.0, 1e300, 75).reshape(25, 3))
    core.look()
    assert not core.get("line_force").any()
    with pytest.raises(StepFailed, match="is not finite"):
        core.step(0.0, 0.1)


def test_lines_that_do_not_stand_in_the_wind_are_no_flow(tmp_path):
    folder = copy_of(TETHER, tmp_path)
    edited(folder, "scene.toml", "[settings.line_drag]", "[settings.scale]")
    edited(folder, "scene.toml", 'default = "on"\noptions = ["on"]', "default = 1.0")
    with pytest.raises(scenes.SceneError, match=r'\[aero\] without \[wing\] .*"on"'):
        scenes.load(folder).aero_core()
