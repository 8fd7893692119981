"""Transient runs: order of coupled motion, results, inputs over time, refusals."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.particle_coupled import coupled, with_added_mass
from benchmarks.particle_kite import flown as kite_flown
from master import compare
from master.cli import app
from master.commands import opened
from master.coupling import FmuParticipant, InProcessParticipant, simulate
from master.coupling.simulation import Inputs
from scenes import load


def _cli(*words):
    return CliRunner().invoke(app, ["run", *map(str, words)])


@pytest.mark.parametrize(("scheme", "order"), [("explicit", 1), ("aitken", 2), ("iqn-ils", 2)])
def test_a_coupled_tether_converges_with_the_order_of_the_coupling(scheme, order):
    end = 0.8  # s of a gust
    runs = {step: coupled(scheme, step, end=end) for step in (0.1, 0.05, 0.025)}
    assert all(run.finished for run, _ in runs.values())
    exact = coupled("aitken", 0.0025, end=end)[1]  # with an error of a hundredth, or of a tenth where of first order
    errors = [np.linalg.norm(x - exact, axis=1).max() for _, x in runs.values()]
    assert np.log2(errors[0] / errors[2]) / 2.0 == pytest.approx(order, abs=0.25)
    assert errors[2] < (1e-2 if order == 1 else 5e-4)  # m, of a motion of 2 m


def test_air_heavier_than_the_structure_makes_explicit_coupling_unstable_however_short_the_step():
    for step in (0.1, 0.02):
        light, _ = with_added_mass("explicit", 0.8, step)
        heavy, x = with_added_mass("explicit", 2.0, step)
        assert light.finished
        assert not heavy.finished or np.abs(x[:, 0]).max() > 30.0  # m: it has gone off


@pytest.mark.parametrize("scheme", ["aitken", "iqn-ils"])
def test_implicit_coupling_cures_it(scheme):
    fine, exact = with_added_mass(scheme, 2.0, 0.01, end=1.0)
    coarse, x = with_added_mass(scheme, 2.0, 0.1, end=1.0)
    assert fine.finished
    assert coarse.finished
    assert np.abs(x - exact).max() < 0.1  # m of 4: the acceleration is a difference over 0.1 s


def test_the_kite_flies_on_in_gusts():
    run, rows, _ = kite_flown(200)  # 4 s, a slice of the ten thousand steps of `make stress`
    assert run.finished
    alpha, force, span = np.rad2deg(rows[50:, 1]), rows[50:, 2], rows[50:, 3]
    assert 4.0 < alpha.min() < alpha.max() < 9.0  # deg; 7.2 in equilibrium, less in a gust
    assert 700.0 < force.min() < force.max() < 1200.0  # N; 830 in equilibrium
    assert 7.5 < span.min() < span.max() < 7.9


def test_motion_settles_on_the_equilibrium_of_the_static_scene():
    from master.coupling import Coupling, solve

    static = Coupling.in_process(load("v3_kite"))
    from master import IQNILS

    solve(static, IQNILS())
    _, rows, _ = kite_flown(1000, parameters={"gust_speed": 0.0, "spring_damping_time": 0.05})
    alpha = float(static.aero.get("alpha_mid"))
    # a mode of 3 s that the air damps slowly is left with some hundredths of a degree after 20 s
    assert np.rad2deg(rows[-150:, 1].mean()) == pytest.approx(np.rad2deg(alpha), abs=0.05)
    assert rows[-1, 3] == pytest.approx(float(static.aero.get("tip_span")), abs=2e-3)


def test_a_steered_kite_moves_sideways():
    _, rows, _ = kite_flown(200, parameters={"gust_speed": 0.0}, tape=("steering_tape_left_length", 0.1))
    assert np.abs(rows[:99, 4]).max() < 1e-9  # m, before
    assert np.abs(rows[-1, 4]) > 0.01


def test_fmus_and_solvers_in_process_give_the_same_motion(tmp_path):
    scene = load("tether_in_wind")
    ends = []
    for backend in ("in-process", "fmu"):
        with opened(scene, backend, {"gust_speed": 2.0}, tmp_path) as pair:
            run = simulate(pair, 1.0, 0.1, "iqn-ils")
            assert run.finished
            ends.append(run.blocks["structural"]["position"])
    assert np.array_equal(*ends)


def test_a_run_leaves_its_history_summary_and_plots(tmp_path):
    result = _cli("tether_in_wind", "--stop-time", 1, "--backend", "in-process", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    content = json.loads((tmp_path / "summary.json").read_text())
    assert content["status"] == "converged"
    assert content["steps"] == 10
    assert content["settings"]["communication_step"] == 0.1
    assert content["real_time_factor"] > 0.0
    rows = list(csv.DictReader((tmp_path / "history.csv").read_text().splitlines()))
    assert [float(r["time_s"]) for r in rows] == pytest.approx(np.linspace(0.0, 1.0, 11).tolist())
    assert [r["status"] for r in rows] == ["start"] + ["converged"] * 10
    assert int(rows[0]["evaluations"]) == 0
    assert sum(int(r["evaluations"]) for r in rows) == content["evaluations"]
    assert rows[0]["residual"] == ""
    assert all(0.0 < float(r["residual"]) < 1e-3 for r in rows[1:])  # tolerances: 1e-5 m and 1e-4 m/s
    assert float(rows[-1]["kinetic_energy"]) == content["outputs"]["structural.kinetic_energy"]
    assert {"motion.png", "shapes.svg", "structure.vtu", "nodes.csv"} <= {p.name for p in tmp_path.iterdir()}
    assert "x real time" in result.output


def test_inputs_over_time_reach_both_sides(tmp_path):
    table = tmp_path / "inputs.csv"
    table.write_text("time,wind_speed,tether_length\n0,6,300\n1,10,302\n")
    out = tmp_path / "out"
    result = _cli("tether_in_wind", "--stop-time", 1, "--backend", "in-process", "--inputs", table, "--out", out)
    assert result.exit_code == 0, result.output
    outputs = json.loads((out / "summary.json").read_text())["outputs"]
    assert outputs["aero.present_wind_speed"] == pytest.approx(10.0)
    assert outputs["structural.tether_length_present"] == pytest.approx(302.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,wind\n0,6\n", ["row 1", "no 'wind'", "wind_speed"]),
        ("time,wind_speed\n0,six\n", ["row 2", "wind_speed 'six'", "finite number"]),
        ("time,wind_speed\n1,6\n0,7\n", ["row 3", "time does not increase"]),
        ("time,wind_speed\n0\n", ["row 2", "1 cells"]),
        ("when,wind_speed\n0,1\n", ["time,NAME"]),
        ("", ["time,NAME"]),
        ("time,wind_direction\n0,1\n", ["no single value"]),
        ("time,wind_speed\n0,6\n\n30,-1\n", ["row 4: wind_speed at 30 s must be between 0.001 and 340, not -1."]),
        ("time,spectral_radius\n0,0\n0.7,1.5\n", ["row 3: spectral_radius at 0.7 s must be between 0 and 1, not 1.5."]),
        ("time,symmetric\n0,0\n0.7,0.5\n", ["row 3: symmetric at 0.7 s must be 0 or 1, not 0.5."]),
        ("time,start_in_equilibrium\n0,1\n", ["row 1: start_in_equilibrium is fixed once a run has begun"]),
    ],
)
@pytest.mark.parametrize("backend", ["in-process", "fmu"])
def test_inputs_that_cannot_be_are_one_sentence_and_nothing_is_written(backend, text, words, tmp_path):
    table, out = tmp_path / "inputs.csv", tmp_path / "out"
    table.write_text(text)
    result = _cli("tether_in_wind", "--stop-time", 1, "--backend", backend, "--inputs", table, "--out", out)
    assert result.exit_code == 2
    assert all(word in result.output for word in words), result.output
    assert not list(out.glob("*.json"))


@pytest.mark.parametrize("backend", ["in-process", "fmu"])
def test_between_rows_numbers_are_linear_and_switches_as_in_the_row_before(backend, tmp_path):
    table = tmp_path / "inputs.csv"
    table.write_text("time,symmetric,spectral_radius\n0,1,0.1\n0.6,0,0.7\n")
    inputs = Inputs.read(table)
    with opened(load("tether_in_wind"), backend, {}, tmp_path) as sides:
        inputs.require(sides)
        for time, switch, number in ((0.0, 1, 0.1), (0.3, 1, 0.4), (0.1 + 0.2 + 0.3, 0, 0.7), (9.0, 0, 0.7)):
            inputs.apply(sides, time)
            assert float(sides["structural"].get("symmetric")) == switch
            assert float(sides["structural"].get("spectral_radius")) == pytest.approx(number, abs=1e-12)  # rounding


def test_a_value_that_only_the_solver_can_judge_ends_the_run_with_a_status(tmp_path):
    table, out = tmp_path / "inputs.csv", tmp_path / "out"
    table.write_text("time,gust_duration\n0,5\n0.5,5\n0.6,0\n")
    result = _cli("tether_in_wind", "--stop-time", 1, "--backend", "in-process", "--inputs", table, "--out", out)
    assert result.exit_code == 1
    content = json.loads((out / "summary.json").read_text())
    assert content["status"] == "diverged"
    assert content["message"].endswith("at 0.5 s: inputs for 0.6 s: gust_duration must be above zero.")
    assert len((out / "history.csv").read_text().splitlines()) == 2 + 5  # header, start, steps


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["v3_kite", "--stop-time", "1"], "--stop-time is for transient scenes"),
        (["tether_in_wind", "--step", "0"], "--step must be a number above zero, not 0.0"),
        (["tether_in_wind", "--step", "0.3", "--stop-time", "1"], "no whole number of communication steps"),
        (
            ["tether_in_wind", "--scheme", "newton-krylov", "--backend", "in-process"],
            "derivatives of quasi-static solves",
        ),
        (["tether_in_wind", "--live"], "--live"),
        (["tether_in_wind", "--checkpoint", "missing/a.ckp"], "there is no folder missing"),
        (["tether_in_wind", "--restart", "missing.ckp"], "checkpoint missing.ckp cannot be read"),
        (["tether_in_wind", "--inputs", "missing.csv"], "cannot be read"),
        (["tether_in_wind", "--set", "line_damping_time=-1"], "line_damping_time must be"),
    ],
)
def test_options_that_do_not_fit_are_refused_in_one_sentence(words, said, tmp_path):
    result = _cli(*words, "--out", tmp_path)
    assert result.exit_code == 2
    assert said in result.output


def test_schemes_are_compared_through_time_too(tmp_path):
    given = {"stop_time": 0.6, "step": 0.1, "jobs": 0, "out": tmp_path}
    rows = compare("tether_in_wind", ["explicit", "aitken", "iqn-ils", "newton-krylov"], **given)
    *ran, exact = rows
    assert exact["status"] == "unavailable"
    assert [row["status"] for row in ran] == ["converged"] * 3
    assert [row["communication_steps"] for row in ran] == [6] * 3
    assert all(len(row["evaluations_history"]) == 6 for row in ran)
    assert [sum(row["evaluations_history"]) for row in ran] == [row["coupling_iterations"] for row in ran]
    explicit, aitken, quasi = ran
    assert explicit["coupling_iterations"] == 6  # one exchange a step
    assert aitken["equilibrium"] == quasi["equilibrium"] == 1  # both meet the tolerance, so they end at one place
    assert explicit["displacement_difference"] > 1e-3  # the explicit scheme is of first order
    for name in ("steps.png", "iterations.svg", "compare.html", "compare.csv"):
        assert (tmp_path / name).stat().st_size > 0
    assert not (tmp_path / "residuals.png").exists()
    with opened(load("tether_in_wind"), "in-process", {}, tmp_path) as sides:
        run = simulate(sides, 0.6, 0.1, "aitken", tolerance=1e-5, max_iterations=200)
    assert list(run.steps.iterations) == aitken["evaluations_history"]
    assert compare("tether_in_wind", ["aitken"], **given)[0]["coupling_iterations"] == aitken["coupling_iterations"]


def test_time_is_no_matter_where_nothing_moves(tmp_path):
    words = ["compare", "typical_section", "--stop-time", "1", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2
    assert "for transient scenes" in result.output


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
@pytest.mark.parametrize("backend", ["in-process", "fmu"])
def test_a_run_goes_on_from_a_checkpoint_to_the_last_bit(scheme, backend, tmp_path):
    table = tmp_path / "inputs.csv"
    table.write_text("time,tether_length_rate,wind_speed\n0,0,6\n0.6,-1,8\n")

    def flown(out, stop, *more):
        words = ["--inputs", table, "--scheme", scheme, "--backend", backend, "--no-report", "--out", tmp_path / out]
        result = _cli("tether_in_wind", "--stop-time", stop, *words, *more)
        assert result.exit_code == 0, result.output
        return result.output, (tmp_path / out / "history.csv").read_text().splitlines()

    _, whole = flown("whole", 0.8)
    flown("half", 0.4, "--checkpoint", tmp_path / "a.ckp", "--checkpoint-every", 3)
    said, rest = flown("rest", 0.8, "--restart", tmp_path / "a.ckp")
    assert "restarted from a.ckp at 0.4 s" in said
    assert rest[2:] == whole[6:]  # header and the row that the restart begins with aside
    for name in ("nodes.csv", "elements.csv", "line_loads.csv"):
        assert (tmp_path / "rest" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_what_a_restart_through_time_may_change(tmp_path):
    kept = tmp_path / "a.ckp"
    words = ["tether_in_wind", "--backend", "in-process", "--no-report", "--out", tmp_path / "out"]
    assert _cli(*words, "--stop-time", 0.2, "--checkpoint", kept).exit_code == 0
    changed = _cli(*words, "--stop-time", 0.4, "--restart", kept, "--scheme", "aitken", "--set", "wind_speed=9")
    assert changed.exit_code == 0, changed.output
    assert "scheme iqn-ils -> aitken" in changed.output
    assert "wind_speed as in the scene -> 9" in changed.output
    content = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert content["outputs"]["aero.present_wind_speed"] == 9.0
    before = {p: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    for more, said in (
        (["--step", "0.15"], "no whole number of communication steps of 0.15 s after the 0.2 s of the checkpoint"),
        (["--stop-time", "0.1"], "--stop-time 0.1 s lies before the 0.2 s of the checkpoint"),
        (["--set", "start_in_equilibrium=1"], "start_in_equilibrium is fixed once a run has begun"),
        (["--set", "line_area=projected"], "a setting of the scene cannot change"),
        (["--backend", "fmu"], "is of backend in-process"),
    ):
        result = _cli(*words, "--stop-time", 0.4, "--restart", kept, *more)
        assert result.exit_code == 2
        assert said in result.output
        assert before == {p: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    other = _cli("v3_kite_dynamic", *words[1:], "--restart", kept)
    assert "is of scene tether_in_wind" in other.output


# A structure without a flow


def alone(**values):
    """The structure of the tether by itself."""
    return {"structural": InProcessParticipant(load("tether_in_wind").structural_core(), values)}


def test_a_structure_alone_falls_like_a_structure_in_an_exchange_without_loads():
    run = simulate(alone(), 0.5, 0.1)
    assert run.finished
    assert (run.time, run.evaluations, len(run.steps)) == (0.5, 5, 5)
    core = load("tether_in_wind").structural_core()
    for k in range(5):
        core.step(k * 0.1, 0.1)
    assert np.array_equal(run.blocks["structural"]["position"], core.get("position"))


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_a_failed_step_of_a_structure_alone_ends_the_run_with_a_status(scheme, tmp_path):
    table = tmp_path / "inputs.csv"
    table.write_text("time,tether_length_rate\n0,0\n0.3,0\n0.4,-999\n")
    followed = []
    run = simulate(
        alone(), 1.0, 0.1, scheme, inputs=Inputs.read(table), follower=lambda time, run: followed.append(time)
    )
    assert run.status == "diverged"
    assert not run.finished
    assert "rest length of tether_length would become" in run.message
    assert 0.3 <= run.time < 1.0
    assert followed[-1] == run.time  # all that was reached is kept
    assert run.steps.statuses[-1] == "diverged"
    assert run.steps.statuses[:-1] == ["converged"] * round(run.time / 0.1)


def test_the_list_of_scenes_says_which_move():
    result = CliRunner().invoke(app, ["scenes", "tether_in_wind"])
    assert "transient: to 60 s in communication steps of 0.1 s" in result.output
    assert "transient" not in CliRunner().invoke(app, ["scenes", "typical_section"]).output


def test_a_step_that_cannot_be_solved_ends_the_run_with_what_was_reached(tmp_path):
    table, out = tmp_path / "inputs.csv", tmp_path / "out"
    table.write_text("time,tether_length_rate\n0,0\n0.5,0\n0.6,-999\n")
    result = _cli("tether_in_wind", "--stop-time", 1, "--backend", "in-process", "--inputs", table, "--out", out)
    assert result.exit_code == 1
    content = json.loads((out / "summary.json").read_text())
    assert content["status"] == "diverged"
    assert "rest length of tether_length would become" in content["message"]
    assert 0.5 <= content["time"] < 1.0
    rows = (out / "history.csv").read_text().splitlines()
    assert len(rows) == 2 + round(content["time"] / 0.1)  # header, start, and the steps


@pytest.mark.parametrize("restarted", [False, True])
def test_followers_know_the_step_that_they_follow(restarted):
    begun, told = None, []
    sides = {side: InProcessParticipant(core) for side, core in load("tether_in_wind").cores().items()}
    if restarted:
        kept = []
        simulate(sides, 0.2, 0.1, hold=lambda exchange, scheme, march: kept.append((exchange.clock, march)))

        def begun(exchange, scheme):
            exchange.clock = kept[-1][0]
            return kept[-1][1]

    def follower(time, run):
        told.append((round(time, 9), len(run.steps), run.steps.times[-1] if run.steps else None))

    run = simulate(sides, 0.4, 0.1, follower=follower, begun=begun)
    assert run.finished
    whole = [(0.0, 0, None), *((round(t, 9), k + 1, t) for k, t in enumerate(run.steps.times))]
    assert told == whole[2 if restarted else 0 :]


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_an_fmu_that_ends_for_good_leaves_the_results_up_to_there(scheme, tmp_path, monkeypatch):
    step = FmuParticipant.step

    def failing(self, t, dt):
        if t > 0.25 and "structural" in self.name:
            self._fmu, self._end = None, "ended with fmi2Fatal: no reason logged"
            raise RuntimeError(f"{self.name} {self._end}")
        step(self, t, dt)

    monkeypatch.setattr(FmuParticipant, "step", failing)
    result = _cli("tether_in_wind", "--stop-time", 1, "--scheme", scheme, "--out", tmp_path)
    assert result.exit_code == 1, result.output
    content = json.loads((tmp_path / "summary.json").read_text())
    assert content["status"] == "diverged"
    assert "tether_in_wind_structural.fmu ended with fmi2Fatal" in content["message"]
    assert content["time"] == pytest.approx(0.3, abs=1e-12)
    assert "aero.present_wind_speed" in content["outputs"]
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 2 + 3  # header, start, steps
    assert (tmp_path / "motion.png").exists()
    assert not (tmp_path / "nodes.csv").exists()  # where they are is not known
