"""`kitecosim couple` on FMUs of other makers: a mass on springs, a load without memory, a wheel without rollback."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from master import couple
from master.cli import app
from master.coupling.march import march
from master.fmu_coupling.document import Document

START = np.array([1.0, 0.5])  # m
WALL = {
    "fmu": "wall.fmu",
    "start": {"mass": 1.0, "stiffness": 1.0, "q0_1": 1.0, "q0_2": 0.5, "load": [-3.0, -1.5]},
    "blocks": {"position": "q_#", "load": ["F_1", "F_2"]},
}
FLUID = {
    "fmu": "fluid.fmu",
    "memoryless": True,
    "start": {"stiffness": 3.0, "place": [1.0, 0.5]},
    "blocks": {
        "place": ["wallPos.x", "wallPos.y"],
        "load": {"variables": ["loadX", "loadY"], "factor": 1e3},  # kN -> N
    },
}
WHEEL = {"fmu": "wheel.fmu", "start": {"speed_0": 2.0}}
BRAKE = {
    "fmu": "fluid.fmu",
    "memoryless": True,
    "start": {"stiffness": 1.5, "wallPos.x": 2.0},
    "blocks": {"torque": {"variables": "loadX", "factor": 1e3}},
}


def oscillator(step=0.1, wall=None, fluid=None, stop=1.0, **coupling):
    """m q'' = -(1 + 3) q, so q = START cos 2t; the spring of 1 N/m in one FMU, that of 3 N/m in the other."""
    return {
        "time": {"stop": stop, "step": step},
        "coupling": {"rtol": 1e-11, **coupling},
        "participants": {"fluid": FLUID | (fluid or {}), "wall": WALL | (wall or {})},
        "connections": [{"from": "fluid.load", "to": "wall.load"}, {"from": "wall.position", "to": "fluid.place"}],
    }


def braked(step=0.1, wheel=None, brake=None, **coupling):
    """w' = -1.5 w, so w = 2 exp(-1.5 t)."""
    return {
        "time": {"stop": 1.0, "step": step},
        "coupling": {"scheme": "explicit", **coupling},
        "participants": {"wheel": WHEEL | (wheel or {}), "brake": BRAKE | (brake or {})},
        "connections": [
            {"from": "wheel.speed", "to": "brake.wallPos.x"},
            {"from": "brake.torque", "to": "wheel.torque"},
        ],
    }


def coupled(folder, content, **options):
    return couple(Document.of(content, folder), **options)


def rows_of(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def end_errors(folder, make, exact, name, steps, **options):
    errors = []
    for step in steps:
        result = coupled(folder, make(step, **options))
        assert result.status == "converged", result.message
        errors.append(np.linalg.norm(result.values[name] - exact))
    return np.array(errors)


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_two_foreign_fmus_oscillate_as_one_with_order_two(toy_fmus, order):
    exact = START * np.cos(2.0)
    errors = end_errors(toy_fmus, oscillator, exact, "wall.position", (0.1, 0.05, 0.025), order=order)
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(2.0, abs=0.05)  # the next term of the error expansion


def test_the_coupled_solution_is_the_trapezoidal_rule_of_the_whole(toy_fmus):
    dt, whole = 0.1, 4.0
    q, v = START.copy(), np.zeros(2)
    for _ in range(10):
        new = (v * (1.0 - 0.25 * whole * dt**2) - dt * whole * q) / (1.0 + 0.25 * whole * dt**2)
        q, v = q + 0.5 * dt * (v + new), new
    found = coupled(toy_fmus, oscillator(dt)).values
    assert found["wall.position"] == pytest.approx(q, rel=1e-9)  # the tolerance of ten steps
    assert found["fluid.load"] == pytest.approx(-3.0 * q, rel=1e-9)  # newtons


def test_parallel_order_and_other_schemes_converge_to_the_serial_result(toy_fmus):
    reference = coupled(toy_fmus, oscillator()).values["wall.position"]
    # aitken has one factor for all, which does not suit the pair of imaginary eigenvalues of the parallel map
    serial = [("serial", scheme) for scheme in ("relaxation", "aitken", "iqn-ils", "iqn-imvj")]
    for order, scheme in [*serial, ("parallel", "relaxation"), ("parallel", "iqn-ils")]:
        parameters = {"omega": 0.9} if scheme == "relaxation" else {}
        content = oscillator(order=order, scheme=scheme, parameters=parameters)
        result = coupled(toy_fmus, content)
        assert result.status == "converged", (order, scheme, result.message)
        assert result.values["wall.position"] == pytest.approx(reference, rel=1e-9)


def test_signs_and_units_of_connections_and_blocks_come_to_the_same(toy_fmus):
    reference = coupled(toy_fmus, oscillator()).values["wall.position"]
    content = oscillator(
        fluid={
            "start": {"stiffness": -3.0, "place": [1e3, 5e2]},  # mm
            "blocks": {
                "place": {"variables": ["wallPos.x", "wallPos.y"], "factor": 1e3},
                "load": ["loadX", "loadY"],  # kN
            },
        }
    )
    content["connections"] = [
        {"from": "fluid.load", "to": "wall.load", "factor": -1e3},
        {"from": "wall.position", "to": "fluid.place", "factor": 1e3},
    ]
    assert coupled(toy_fmus, content).values["wall.position"] == pytest.approx(reference, rel=1e-9)


def test_substeps_divide_the_step_of_one_participant(toy_fmus):
    content = oscillator(wall={"substeps": 4})
    content["results"] = {"record": ["wall.steps", "wall.position"]}
    result = coupled(toy_fmus, content)
    assert result.values["wall.steps"] == 40
    exact = START * np.cos(2.0)
    plain = np.linalg.norm(coupled(toy_fmus, oscillator()).values["wall.position"] - exact)
    assert 0.3 * plain < np.linalg.norm(result.values["wall.position"] - exact) < plain  # interpolation error is left
    errors = end_errors(toy_fmus, oscillator, exact, "wall.position", (0.1, 0.05), wall={"substeps": 4})
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_explicit_coupling_runs_through_fmus_that_never_go_back_with_order_one(with_wheel):
    errors = end_errors(with_wheel, braked, 2.0 * np.exp(-1.5), "wheel.speed", (0.04, 0.02, 0.01))
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(1.0, abs=0.1)


def test_an_implicit_scheme_on_an_fmu_that_cannot_go_back_is_refused_with_the_reason(with_wheel):
    with pytest.raises(ValueError, match=r"participant wheel cannot save and restore .*canGetAndSetFMUstate is false"):
        Document.of(braked(scheme="iqn-ils"), with_wheel)
    with pytest.raises(ValueError, match="participant fluid cannot save"):
        Document.of(oscillator(fluid={"memoryless": False}), with_wheel)


def test_a_wheel_that_is_wrongly_called_memoryless_is_heard(with_wheel):
    result = coupled(with_wheel, braked(wheel={"memoryless": True}, scheme="aitken"))
    assert result.status == "diverged"
    assert "participant wheel refused a step: the step does not begin where the last one ended" in result.message


def test_a_steady_run_finds_where_the_wheel_comes_to_turn(with_wheel):
    content = braked(wheel={"start": {"c": 0.5}}, brake={"start": {"stiffness": 1.5, "offset": 3.0}}, scheme="iqn-ils")
    content["time"] = {"mode": "steady", "step": 1e3}  # far beyond the time constant of the wheel
    result = coupled(with_wheel, content)
    assert result.status == "converged"
    assert result.values["wheel.speed"] == pytest.approx(3.0 / (1.5 + 0.5), rel=1e-6)
    assert result.time == result.evaluations * 1e3  # no state was restored


def test_a_state_that_the_fmu_lets_one_start_is_a_start_value(toy_fmus):
    wall = {"start": {"stiffness": 1.0, "v": [2.0, -1.0]}, "blocks": WALL["blocks"] | {"v": "v_#"}}
    content = oscillator(0.02, wall=wall, fluid={"start": {"stiffness": 3.0}})
    position = coupled(toy_fmus, content).values["wall.position"]
    exact = np.array([1.0, -0.5]) * np.sin(2.0)
    assert position == pytest.approx(exact, abs=2.0 * 0.02**2)  # of second order


def test_texts_are_start_values_too_and_what_an_fmu_says_to_them_is_heard(toy_fmus):
    fluid = {"start": FLUID["start"] | {"table": "table.csv"}}
    assert coupled(toy_fmus, oscillator(fluid=fluid)).status == "converged"
    fluid["start"]["table"] = "täble.csv"
    with pytest.raises(RuntimeError, match=r"there is no table täble\.csv"):  # PythonFMU calls that fmi2Fatal
        coupled(toy_fmus, oscillator(fluid=fluid))


def test_a_discarded_step_is_begun_again_without_prediction_and_reported(toy_fmus, tmp_path):
    reference = coupled(toy_fmus, oscillator()).values["wall.position"]
    fluid = {"start": FLUID["start"] | {"fail_at": 5}}
    result = coupled(toy_fmus, oscillator(fluid=fluid), out=tmp_path)
    assert result.status == "converged", result.message
    assert result.steps.count("recovered") == 1
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["steps_recovered"] == 1
    assert "participant fluid refused a step" in summary["messages"][0]["message"]
    assert result.values["wall.position"] == pytest.approx(reference, rel=1e-9)


def test_the_explicit_scheme_does_not_ask_twice_for_a_step_that_was_discarded(toy_fmus):
    fluid = {"start": FLUID["start"] | {"fail_at": 5}}
    result = coupled(toy_fmus, oscillator(fluid=fluid, scheme="explicit"))
    assert (result.status, len(result.steps), result.evaluations) == ("diverged", 5, 5)
    assert "participant fluid refused a step: it returned fmi2Discard from fmi2DoStep at 0.4 s" in result.message


@pytest.mark.parametrize(("trouble", "reason"), [(3, "the step was not completed"), (-3, "the wheel is off")])
def test_a_step_that_nobody_can_repeat_ends_the_run_with_its_reason_and_what_was_reached(
    with_wheel, tmp_path, trouble, reason
):
    result = coupled(with_wheel, braked(wheel={"start": {"speed_0": 2.0, "trouble": trouble}}), out=tmp_path)
    assert result.status == "diverged"
    assert reason in result.message
    assert result.time == pytest.approx(0.2)
    assert [float(row["time_s"]) for row in rows_of(tmp_path / "results.csv")] == pytest.approx([0.0, 0.1, 0.2])
    assert result.logs["wheel"][-1] == ((2 if trouble > 0 else 4), reason)
    assert json.loads((tmp_path / "summary.json").read_text())["fmu_messages"] == {"wheel": [reason], "brake": []}
    assert [row["status"] for row in rows_of(tmp_path / "steps.csv")] == ["converged", "converged", "diverged"]


def test_an_fmu_that_ends_in_an_implicit_step_ends_the_run_with_its_reason(with_wheel):
    content = braked(wheel={"memoryless": True, "start": {"speed_0": 2.0, "trouble": -1}}, scheme="aitken")
    result = coupled(with_wheel, content)
    assert result.status == "diverged"
    assert "fmi2Fatal: the wheel is off" in result.message


def three(closed=True):
    """wall -> fluid -> a second fluid that passes the load on (-> wall)."""
    content = oscillator()
    passed = {"stiffness": -1.0, "place": [-3.0, -1.5]}
    content["participants"] = {"wall": WALL, "fluid": FLUID, "passing": FLUID | {"start": passed}}
    content["connections"] = [
        {"from": "wall.position", "to": "fluid.place"},
        {"from": "fluid.load", "to": "passing.place"},
        *([{"from": "passing.load", "to": "wall.load"}] if closed else []),
    ]
    return content


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_three_participants_in_a_ring_give_what_two_give(toy_fmus, order):
    reference = coupled(toy_fmus, oscillator()).values["wall.position"]
    content = three()
    content["coupling"]["order"] = order
    result = coupled(toy_fmus, content)
    assert result.status == "converged", result.message
    assert result.values["wall.position"] == pytest.approx(reference, rel=1e-9)


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_in_a_row_without_feedback_one_exchange_a_step_is_the_answer(toy_fmus, scheme):
    content = three(closed=False)
    content["coupling"]["scheme"] = scheme
    content["results"] = {"record": ["wall.position", "passing.load"]}
    content["participants"]["wall"] = WALL | {"start": WALL["start"] | {"load": [0.0, 0.0]}}
    result = coupled(toy_fmus, content)
    assert result.status == "converged", result.message
    assert result.evaluations == 10
    position = result.values["wall.position"]
    assert position == pytest.approx(START * np.cos(1.0), abs=2e-3)  # own spring of 1 N/m; dt^2/12 t of the rule
    assert result.values["passing.load"] == pytest.approx(-3.0 * position, rel=1e-12)


def test_the_files_of_a_run_are_complete_and_agree(toy_fmus, tmp_path):
    content = oscillator(wall={"substeps": 2})
    content["results"] = {"record": ["wall.position", "fluid.loadX", "wall.F_1"]}
    seen = []
    result = coupled(toy_fmus, content, out=tmp_path, follow=lambda number, *_: seen.append(number))
    assert seen == list(range(11))
    names = {"results.csv", "steps.csv", "summary.json", "results.png", "results.svg"}
    assert {path.name for path in tmp_path.glob("[!.]*")} == names
    rows = rows_of(tmp_path / "results.csv")
    assert list(rows[0]) == ["time_s", "wall.position[1]", "wall.position[2]", "fluid.loadX", "wall.F_1"]
    table = np.array([list(row.values()) for row in rows], dtype=float)
    assert table[:, 0] == pytest.approx(np.linspace(0.0, 1.0, 11), abs=1e-15)
    assert table[-1, 1:3].tolist() == result.values["wall.position"].tolist()
    assert table[:, 3] == pytest.approx(-3e-3 * table[:, 1], rel=1e-9)  # kN, as the FMU has it
    assert table[:, 4] == pytest.approx(-3.0 * table[:, 1], rel=1e-9)
    steps = rows_of(tmp_path / "steps.csv")
    assert len(steps) == 10
    assert sum(int(row["evaluations"]) for row in steps) == result.evaluations
    assert {row["status"] for row in steps} == {"converged"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["status"], summary["steps"], summary["evaluations"]) == ("converged", 10, result.evaluations)
    assert summary["participants"]["fluid"]["saves_state"] is False
    assert summary["participants"]["wall"]["substeps"] == 2
    assert summary["inputs_without_source"] == []
    assert {"total", "set_up", "wall", "fluid", "master"} == summary["wall_time_s"].keys()
    assert summary["versions"]["fmpy"]


def test_what_there_is_stays_whole_when_a_run_breaks_off(toy_fmus, tmp_path):
    def stop(number, *_):
        if number == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        coupled(toy_fmus, oscillator(), out=tmp_path / "out", follow=stop)
    assert not (tmp_path / "out").exists()
    partial = tmp_path / "out.partial"
    assert caught.value.__notes__ == [f"what was written until then is in {partial}"]
    assert {path.name for path in partial.glob("[!.]*")} == {"results.csv", "steps.csv"}
    assert len((partial / "results.csv").read_text().splitlines()) == 1 + 5
    assert len((partial / "steps.csv").read_text().splitlines()) == 1 + 4


def test_an_fmu_that_does_not_load_leaves_no_results(toy_fmus, tmp_path):
    fluid = {"start": FLUID["start"] | {"table": "none.csv"}}
    with pytest.raises(RuntimeError, match=r"there is no table none\.csv"):
        coupled(toy_fmus, oscillator(fluid=fluid), out=tmp_path)
    assert not list(tmp_path.iterdir())


def test_curves_for_the_plot_stay_few_however_long_a_run_is():
    from master.fmu_coupling.results import POINTS, Curve

    curve = Curve()
    for k in range(20 * POINTS):
        curve.add(float(k), np.array([float(k)]))
    assert POINTS / 2 <= len(curve.times) <= POINTS
    assert set(np.diff(curve.times)) == {32.0}  # evenly thinned, five times by half
    assert [float(v[0]) for v in curve.values] == curve.times


def test_a_document_serves_a_script_that_marches_itself(toy_fmus):
    from master.coupling.acceleration import IQNILS
    from master.fmu_coupling.run import opened

    with opened(Document.of(oscillator(), toy_fmus)) as exchange:
        result = march(exchange, IQNILS(), 0.5, rtol=1e-11)
        assert result.status == "converged"
        assert exchange.participants["wall"].get("position") == pytest.approx(START * np.cos(1.0), abs=5e-3)


TOML = """
[time]
stop = 1.0
step = 0.1
[coupling]
max_iterations = {most}
[participants.fluid]
fmu = "fluid.fmu"
memoryless = true
start = {{ "wallPos.x" = 1.0 }}
blocks = {{ place = "wallPos.x", load = {{ variables = ["loadX"], factor = 1e3, shape = [] }} }}
[participants.wall]
fmu = "wall.fmu"
start = {{ q0_1 = 1.0, F_1 = -3.0 }}
[[connections]]
from = "fluid.load"
to = "wall.F_1"
[[connections]]
from = "wall.q_1"
to = "fluid.place"
"""


@pytest.mark.parametrize(("most", "code", "status"), [(100, 0, "converged"), (1, 1, "max_iterations")])
def test_the_command_prints_a_table_and_its_exit_code_tells_whether_it_converged(
    toy_fmus, tmp_path, most, code, status
):
    file = toy_fmus / f"ring_{most}.toml"
    file.write_text(TOML.format(most=most))
    done = CliRunner().invoke(app, ["couple", str(file), "--out", str(tmp_path / "out"), "--no-report"])
    assert done.exit_code == code, done.output
    assert f"ring_{most}: {status}" in done.output
    assert "inputs without a source keep their start values: fluid.wallPos.y, wall.F_2" in done.output
    assert json.loads((tmp_path / "out/summary.json").read_text())["status"] == status
    assert not (tmp_path / "out/results.png").exists()


def test_bad_input_is_one_sentence_and_exit_code_2_and_nothing_is_written(toy_fmus, tmp_path):
    file = toy_fmus / "bad.toml"
    file.write_text(TOML.format(most='"many"'))
    done = CliRunner().invoke(app, ["couple", str(file), "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert "bad.toml: [coupling] max_iterations must be a whole number of at least 1, not 'many'." in done.output
    assert not (tmp_path / "out").exists()
