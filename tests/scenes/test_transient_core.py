"""The structure of transient scenes: time, loads within a step, reeling, state, refusals."""

import pickle
from itertools import pairwise

import numpy as np
import pytest

from interface import StepFailed
from scenes import SceneError, load
from scenes.cores.transient import Transient
from tests.scenes.broken import edited

DT = 0.05


def _tether(**parameters):
    core = load("tether_in_wind").structural_core()
    for name, value in parameters.items():
        core.set(name, value)
    return core


def _blown(core, load_per_metre=0.1):
    """Wind of so many N/m on all lines."""
    core.set("line_load", np.tile([load_per_metre, 0.0, 0.0], (24, 1)))
    return core


def test_motion_begins_at_rest_and_the_balance_of_energies_closes():
    core = _blown(_tether())
    for k in range(40):
        core.step(k * DT, DT)
    kinetic, elastic, work, reeled, lost, numerical = (
        float(core.get(f"{name}"))
        for name in ("kinetic_energy", "elastic_energy", "external_work", "reeling_work", "dissipated_energy",
                     "numerical_loss")
    )  # fmt: skip
    assert kinetic > 1.0  # J
    assert reeled == 0.0
    assert kinetic + elastic == pytest.approx(work - lost - numerical, rel=1e-9)
    assert core.get("displacement").shape == core.get("velocity").shape == (25, 3)
    assert np.array_equal(core.get("displacement")[:, 0], core.get("position")[:, 0])


def test_the_velocity_is_the_rate_of_the_displacement():
    core = _blown(_tether())
    for k in range(20):
        core.step(k * DT, DT)
    before, v0 = core.get("displacement"), core.get("velocity")
    core.step(20 * DT, 1e-3)
    rate = (core.get("displacement") - before) / 1e-3
    assert np.allclose(rate, 0.5 * (v0 + core.get("velocity")), atol=2e-3 * np.abs(rate).max())  # of second order


def test_what_stays_as_it_was_is_a_longer_rest_of_the_same_motion():
    """Two halves of a step under constant loads are the whole step: the integration steps are the same."""
    whole, halves = (_blown(_tether(longest_step=0.0125, loads_vary=0.0)) for _ in range(2))
    whole.step(0.0, 0.1)
    halves.step(0.0, 0.05)
    halves.step(0.05, 0.05)
    # the second half begins with the acceleration of the present loads, which is the same to second order
    assert np.allclose(whole.get("position"), halves.get("position"), atol=1e-5)


def test_loads_that_vary_act_with_their_mean_over_the_step():
    steady, varying = (_tether(gravity=0.0, longest_step=0.002) for _ in range(2))
    for core in (steady, varying):
        _blown(core, 0.0).step(0.0, DT)
    varying.set("line_load", np.tile([0.2, 0.0, 0.0], (24, 1)))
    varying.step(DT, DT)
    steady.set("loads_vary", 0.0)
    steady.set("line_load", np.tile([0.1, 0.0, 0.0], (24, 1)))
    steady.step(DT, DT)
    momentum = [core.get("velocity")[1:-1, 0].mean() for core in (varying, steady)]
    assert momentum[0] == pytest.approx(momentum[1], rel=0.05)  # 25 steps, the first of them of first order


def test_a_state_that_is_put_back_repeats_the_same_bits_in_another_process_too():
    core = _blown(_tether(tether_length_rate=0.05))
    for k in range(5):
        core.step(k * DT, DT)
    state = pickle.loads(pickle.dumps(core.save()))

    def onward(solver):
        _blown(solver, 0.15)
        for k in range(5, 9):
            solver.step(k * DT, DT)
        return {name: solver.get(name).tobytes() for name in solver.names}

    first = onward(core)
    core.restore(state)
    assert onward(core) == first
    other = _tether()
    other.restore(state)
    assert onward(other) == first


@pytest.mark.parametrize("integration", ["implicit-euler", "generalised-alpha", "bdf2"])
def test_every_scheme_reaches_the_rest_that_the_loads_ask_for(integration):
    core = load("tether_in_wind", {"integration": integration}).structural_core()
    core.set("line_damping_time", 0.5)
    _blown(core)
    for k in range(400):
        core.step(k * 0.25, 0.25)
    tension = core.get("tension")
    assert float(core.get("kinetic_energy")) < 0.05
    assert core.get("support_force")[0] == pytest.approx(0.1 * 300.0, rel=1e-2)
    assert tension.min() > 0.9 * tension.max()


def test_reeling_out_at_a_rate_gives_line_out_evenly_and_its_mass_with_it():
    core = _tether(gravity=9.81, tether_length_rate=0.5)
    for k in range(20):
        core.step(k * DT, DT)
    assert float(core.get("tether_length_present")) == pytest.approx(300.5, rel=1e-12)
    assert float(core.get("tether_length")) == 300.0
    # weight of 300.5 m of 0.012 kg/m; ends that are held carry their half segments
    weight = 300.5 * 0.012 * 9.81
    momentum = core.get("support_force")
    assert np.isfinite(momentum).all()
    at_rest = _tether(gravity=9.81, start_in_equilibrium=1.0, tether_length=300.5)
    at_rest.step(0.0, DT)
    assert at_rest.get("support_force")[2] == pytest.approx(-weight, rel=1e-3)  # the length was set, with its mass


def test_rest_length_that_would_become_negative_is_refused_and_nothing_is_lost():
    core = _blown(_tether())
    core.step(0.0, DT)
    state = {name: core.get(name).tobytes() for name in core.names}
    core.set("tether_length_rate", -1000.0)
    with pytest.raises(StepFailed, match=r"rest length of tether_length would become -200 m at 1.05 s; reel in slower"):
        core.step(DT, 1.0)  # the rate goes from 0 to -1000 m/s in the step
    core.set("tether_length_rate", 0.0)
    assert {name: core.get(name).tobytes() for name in core.names} == state
    core.step(DT, DT)


def test_energy_is_balanced_while_a_tether_is_reeled_in_far():
    core = _tether(start_in_equilibrium=1.0, gravity=9.81, line_damping_time=0.1)
    for k in range(100):
        core.set("tether_length_rate", -0.1 if k < 80 else 0.0)  # 0.4 m, a strain of 1.3e-3
        core.step(k * DT, DT)
    stored = float(core.get("elastic_energy"))
    assert stored > 200.0  # J
    put_in, heat = float(core.get("reeling_work")), float(core.get("dissipated_energy"))
    assert put_in == pytest.approx(stored + heat, rel=0.01)  # gravity takes little
    assert abs(float(core.get("numerical_loss"))) < 2e-3 * stored
    # dampers of 0.1 s resist 0.1 m/s over 300 m for 4 s: c (dl/dt)^2 t with c = 0.1 s EA / l
    stiffness = 70e9 * 0.25 * np.pi * 0.004**2 / 300.0
    assert heat == pytest.approx(0.1 * stiffness * 0.1**2 * 4.0, rel=0.1)


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan"), float("inf")])
def test_time_goes_forward(dt):
    core = _blown(_tether())
    before = {name: core.get(name).tobytes() for name in core.names}
    with pytest.raises(StepFailed, match="is none; time goes forward"):
        core.step(0.0, dt)
    assert {name: core.get(name).tobytes() for name in core.names} == before


def test_work_of_reeling_is_what_the_tension_gives():
    core = _tether(start_in_equilibrium=1.0, gravity=9.81, loads_vary=1.0)
    core.step(0.0, 0.01)
    tension = core.get("tension").mean()
    core.set("tether_length_rate", -0.01)
    core.step(0.01, 0.01)
    # the rate goes from 0 to 0.01 m/s: 5e-5 m at a tension that the step itself raises by EA / L times it
    assert float(core.get("reeling_work")) == pytest.approx(tension * 5e-5, rel=0.1)


def _reeled(step, vary=1.0):
    """A tether that hangs in the wind, reeled in at 0.2 m/s sin(2 pi t / 4 s) for 1 s, and its position then."""
    core = _blown(_tether(start_in_equilibrium=1.0, gravity=9.81, longest_step=0.0125, loads_vary=vary))
    for k in range(round(1.0 / step)):
        core.set("tether_length_rate", -0.2 * np.sin(0.5 * np.pi * (k + 1) * step))
        core.step(k * step, step)
    return float(core.get("tether_length_present")), core.get("position")


def test_rates_of_reeling_that_are_ramped_are_integrated_to_second_order():
    exact, (_, finest) = 300.0 - 0.2 / (0.5 * np.pi), _reeled(0.0125)
    lengths, places = zip(*(_reeled(step) for step in (0.2, 0.1, 0.05)), strict=True)
    # the first step begins at its own rate, for nobody knows one before it: wrong by 0.2 m/s sin(..) dt / 2, of order 2
    wrong = np.abs(np.array(lengths) - exact)
    moved = np.array([np.abs(place - finest).max() for place in places])
    assert np.log2(wrong[:-1] / wrong[1:]) == pytest.approx([2.0, 2.0], abs=0.15)
    assert np.log2(moved[0] / moved[2]) / 2.0 == pytest.approx(2.0, abs=0.3)  # the finest has a sixteenth of the last
    assert wrong[-1] < 1e-3
    held = [abs(_reeled(step, vary=0.0)[0] - exact) for step in (0.1, 0.05)]
    assert np.log2(held[0] / held[1]) == pytest.approx(1.0, abs=0.1)  # values that hold all through the step


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("line_damping_time = 7.7e-4", "line_damping_time = -1.0", ["line_damping_time", "0 or more"]),
        ("longest_step = 0.05", "longest_step = 0", ["longest_step", "above 0"]),
        ("spectral_radius = 0.0", "spectral_radius = 1.5", ["spectral_radius", "from 0 to 1"]),
        ('scheme = "generalised-alpha"', 'scheme = "leapfrog"', ["scheme", "implicit-euler"]),
        ("line_density = 954.929659", "line_density = 0.0", ["nodes.csv", "no mass"]),
        ('tether_length = ["segment_1"', 'tether_length = ["segment_99"', ["[structure.reels]", "segment_99"]),
    ],
)
def test_tables_of_motion_that_cannot_be_are_refused_in_one_sentence(before, after, words, tmp_path):
    folder = edited_copy(tmp_path, before, after)
    with pytest.raises(SceneError) as error:
        load(folder).structural_core()
    message = str(error.value)
    assert all(word in message for word in words), message
    assert message.count("\n") == 0


def edited_copy(tmp_path, before, after):
    import shutil

    folder = tmp_path / "tether"
    shutil.copytree(load("tether_in_wind").folder, folder)
    edited(folder, "scene.toml", before, after)
    return folder


def test_a_kite_in_motion_stays_symmetric_in_symmetric_wind_and_steers_when_a_tape_is_pulled():
    core = load("v3_kite_dynamic").structural_core()
    core.set("start_in_equilibrium", 0.0)
    core.step(0.0, 0.02)
    assert core.get("symmetry_used")
    y = core.get("position")[:, 1]
    core.set("steering_tape_left_length", float(core.get("steering_tape_left_length")) + 0.1)
    core.step(0.02, 0.02)
    assert not core.get("symmetry_used")
    assert np.isfinite(y).all()


@pytest.mark.parametrize("added", [0.0, 1.0])
def test_supports_hold_what_the_lines_at_them_pull(added):
    scene = load("v3_kite_dynamic")
    core, flow = scene.structural_core(), scene.aero_core()
    for name, value in scene.with_trim({}).items():
        for one in (core, flow):
            one.set(name, value)
    core.set("added_mass_coefficient", added)
    for k in range(5):  # out of rest: the inertia counts
        flow.set("displacement", core.get("displacement"))
        flow.set("velocity", core.get("velocity"))
        flow.set("wind_speed", 12.0 + 0.2 * k)
        flow.step(0.02 * k, 0.02)
        for name in ("pressure", "shear", "line_load"):
            core.set(name, flow.get(name))
        core.step(0.02 * k, 0.02)
    x, at = core.get("position"), scene.pivot
    pull, start = np.zeros(3), 0
    for group in scene.members.chains:
        for e, nodes in enumerate(group.nodes):
            for a, b in pairwise(nodes):
                if at in (a, b):
                    other = b if a == at else a
                    along = (x[other] - x[at]) / np.linalg.norm(x[other] - x[at])
                    pull += core.get("tension")[start + e] * along
        start += len(group.l0)
    own = scene.members.mass[at] * 9.81  # the control unit hangs at the bridle point itself
    lines = flow.get("line_load"), scene.interface
    ends = (lines[1].nodes + core.get("displacement"))[lines[1].lines]
    half = 0.5 * lines[0] * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
    held = np.linalg.norm(ends - x[at], axis=2) < 1e-9
    wind = half[held.any(axis=1)].sum(axis=0)
    # dampers are not in the tensions, and accelerations are those of the middle of the last integration step
    assert core.get("support_force") == pytest.approx(pull + wind - [0.0, 0.0, own], rel=0.02, abs=10.0)


def test_air_that_moves_with_the_wing_slows_it_along_its_normals_only():
    scene = load("v3_kite_dynamic")
    solver = Transient(scene)
    values = {"added_mass_coefficient": np.array(0.0), "air_density": np.array(1.225)}
    assert solver._air_mass(values, scene.members.nodes) is None
    blocks = solver._air_mass(values | {"added_mass_coefficient": np.array(1.0)}, scene.members.nodes)
    i = scene.interface
    edges = i.nodes[i.sections]
    chord = np.linalg.norm(edges[:, -1] - edges[:, 0], axis=1)
    quarter = edges[:, 0] + 0.25 * (edges[:, -1] - edges[:, 0])
    width = np.linalg.norm(np.diff(quarter, axis=0), axis=1)
    mass = np.sum(0.25 * np.pi * 1.225 * (0.5 * (chord[:-1] + chord[1:])) ** 2 * width)
    # flat plates: rho pi c^2 / 4 per span; trapezoids and the spans of panels differ from it by some per cent
    assert np.trace(blocks.sum(axis=0)) == pytest.approx(mass, rel=0.05)
    assert np.all(np.linalg.eigvalsh(blocks) > -1e-12)
