"""Starts at rest in the equilibrium of structure and flow, of runs by any scheme and of hosts that exchange once."""

import csv

import numpy as np
import pytest
from typer.testing import CliRunner

from master.cli import app
from master.coupling import FmuParticipant, InProcessParticipant, simulate, with_start
from scenes import load

DT, REST = 0.02, 100  # s; communication steps before the first gust
# N. What is left of the equilibrium is 1e-8 m, on a kite that answers with some 1e3 N/m, and 1e-6 N of the solver.
STILL = 1e-4


def _sides(scene, given):
    """The two solvers of a scene in-process, with those of the parameters that each has."""
    return {
        side: InProcessParticipant(core, {k: v for k, v in given.items() if k in core.names})
        for side, core in scene.cores().items()
    }


def _exchanged_once(flow, structure, steps, order):
    """Support forces (steps,) N of two participants as a host steps them that repeats nothing."""
    structure.set("loads_vary", np.array(0.0))
    loads = [b for b, c in structure.causality.items() if c == "input" and b in flow.blocks]
    force = []
    for k in range(steps):
        sent = {b: flow.get(b) for b in loads}
        for block in ("displacement", "velocity"):
            flow.set(block, structure.get(block))
        flow.step(k * DT, DT)
        for block in loads:
            structure.set(block, flow.get(block) if order == "serial" else sent[block])
        structure.step(k * DT, DT)
        force.append(np.linalg.norm(structure.get("support_force")))
    return np.array(force)


def _forces(folder):
    """Support forces N of a run's history at its times s, without the row of the start."""
    rows = list(csv.DictReader((folder / "history.csv").read_text().splitlines()))[1:]
    force = np.array([[float(row[f"support_force[{k}]"]) for k in (1, 2, 3)] for row in rows])
    return np.array([float(row["time_s"]) for row in rows]), np.linalg.norm(force, axis=1)


def test_a_kite_rests_until_the_first_gust_and_then_flies_as_with_iterated_steps(tmp_path):
    after = {}
    for scheme in ("explicit", "iqn-ils"):
        words = ["run", "v3_kite_dynamic", "--scheme", scheme, "--stop-time", "4.5", "--backend", "in-process"]
        result = CliRunner().invoke(app, [*words, "--no-report", "--out", str(tmp_path / scheme)])
        assert result.exit_code == 0, result.output
        time, force = _forces(tmp_path / scheme)
        assert np.ptp(force[time < REST * DT]) < STILL
        after[scheme] = force[-1]
    assert after["iqn-ils"] > 1.2 * force[0]  # a gust
    # explicit steps of 0.02 s lag by that: the force rises by some 20 N/s there
    assert after["explicit"] == pytest.approx(after["iqn-ils"], abs=1.0)


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_a_kite_rests_in_a_host_that_exchanges_its_fmus_once_a_step(order, tmp_path):
    result = CliRunner().invoke(app, ["build", "v3_kite_dynamic", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    names = [tmp_path / f"v3_kite_dynamic_{side}.fmu" for side in ("aero", "structural")]
    with FmuParticipant(names[0]) as flow, FmuParticipant(names[1]) as structure:
        force = _exchanged_once(flow, structure, REST + 60, order)
    assert np.ptp(force[:REST]) < STILL
    assert np.ptp(force[REST:]) > 10.0  # the gust


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_a_script_starts_from_the_coupled_equilibrium_in_the_first_step(scheme):
    scene, force = load("v3_kite_dynamic"), []
    sides = _sides(scene, scene.with_trim({"wind_speed": 13.0}))
    run = simulate(
        sides, 0.5, DT, scheme, tolerance=1e-8,
        follower=lambda t, run: force.append(np.linalg.norm(sides["structural"].get("support_force"))),
    )  # fmt: skip
    assert run.finished
    assert run.steps.iterations[0] > 5
    assert np.ptp(force[1:]) < STILL
    if scheme == "explicit":
        assert set(run.steps.iterations[1:]) == {1}


def test_without_a_coupled_equilibrium_the_explicit_scheme_starts_in_that_of_the_structure_and_says_so():
    scene = load("v3_kite_dynamic")
    sides = _sides(scene, scene.with_trim({}))
    told = []
    run = simulate(sides, 5 * DT, DT, "explicit", max_iterations=2, follower=lambda t, run: told.append(len(run.steps)))
    assert run.finished
    assert told == [0, 1, 2, 3, 4, 5]
    assert list(run.steps.iterations) == [1] * 5
    assert "structure starts in its own" in " ".join(sentence for _, sentence in run.steps.messages)


def test_a_start_is_that_of_its_parameters_and_leaves_the_solvers_as_they_were():
    scene = load("v3_kite_dynamic")
    given = scene.with_trim({"wind_speed": 14.0})
    cores = scene.cores()
    for core in cores.values():
        for name in given.keys() & set(core.names):
            core.set(name, given[name])
    before = {side: {name: core.get(name).tobytes() for name in core.names} for side, core in cores.items()}
    started, why = with_start(scene, given, cores)
    assert why == ""
    assert {side: {name: core.get(name).tobytes() for name in core.names} for side, core in cores.items()} == before
    sides = _sides(started, given)
    shape = sides["structural"].get("displacement")
    assert np.allclose(shape, sides["aero"].get("displacement"), atol=1e-12)  # rounding: both sides start in it
    assert np.ptp(_exchanged_once(sides["aero"], sides["structural"], 20, "serial")) < STILL
    assert np.abs(sides["structural"].get("displacement") - shape).max() < 1e-6
    # nor is it the start of who wants the shape of the tables
    from_tables = given | {"start_in_equilibrium": 0.0}
    drawn = _sides(scene, from_tables)["structural"].get("position")
    assert np.array_equal(_sides(started, from_tables)["structural"].get("position"), drawn)
    # another trim angle is another start, of which nothing is known
    turned = _sides(started, given | {"trim_angle": 0.1})["structural"].get("position")
    assert np.array_equal(turned, _sides(scene, given | {"trim_angle": 0.1})["structural"].get("position"))


@pytest.mark.parametrize("degrees", [30.0, 200.0])
def test_a_kite_in_wind_from_the_side_starts_in_the_same_shape_turned(degrees):
    scene, angle = load("v3_kite_dynamic"), np.deg2rad(degrees)
    along = {"wind_direction": np.array([np.cos(angle), np.sin(angle), 0.0])}
    ahead, _ = with_start(scene)
    given = scene.with_trim(along)
    turned, why = with_start(scene, given)
    assert why == ""
    towards = np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    assert np.allclose(turned.start.nodes, ahead.start.nodes @ towards, atol=1e-6)  # m, of solves to 1e-8
    sides = _sides(turned, given)
    shape = sides["structural"].get("displacement")
    assert np.allclose(sides["structural"].get("position"), turned.start.nodes, atol=1e-12)
    assert np.ptp(_exchanged_once(sides["aero"], sides["structural"], 10, "serial")) < STILL
    assert np.abs(sides["structural"].get("displacement") - shape).max() < 1e-6


@pytest.mark.parametrize("name", ["tether_in_wind", "v3_kite"])
def test_scenes_that_do_not_start_in_equilibrium_stay_as_they_are(name):
    scene = load(name)
    assert with_start(scene) == (scene, "")


def test_where_there_is_no_equilibrium_the_fmus_are_built_with_a_note(tmp_path, monkeypatch):
    import master.coupling.start as start

    monkeypatch.setattr(start, "TRIES", 1)  # of coupling iterations, too few
    result = CliRunner().invoke(app, ["build", "v3_kite_dynamic", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert "note: no equilibrium of structure and flow to start from" in result.output
    assert (tmp_path / "v3_kite_dynamic_structural.fmu").exists()
