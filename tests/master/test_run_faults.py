"""Coupled runs of scenes whose solvers fail: they recover and say so, or end with a status and leave nothing behind."""

import contextlib
import json

import numpy as np
import pytest

from benchmarks.problems import BACKENDS, in_process
from master import commands, restart
from master.coupling import Coupling, coupled_run, scheme, solve
from master.coupling.run import _branch_remarks
from master.report import summary
from tests.master.toys import Faulty

SETTINGS = {"scene": "x", "scheme": "iqn-ils", "backend": "in-process"}


def wrapped(coupling, faults, where):
    """The same coupling with faults in one of its solvers."""
    pair = {"structural": Faulty(coupling.structural), "aero": Faulty(coupling.aero)}
    pair[where].faults = faults or {}
    return Coupling(pair["structural"], pair["aero"])


def alive(coupling):
    return coupling.structural.alive, coupling.aero.alive


@pytest.fixture(scope="module")
def sound():
    """Undisturbed runs of the kite: scheme -> run."""
    found = {}

    def of(name):
        if name not in found:
            coupling = in_process("v3_kite", wind_speed=12.0)
            found[name] = coupled_run(coupling, scheme(name, coupling))
        return found[name]

    return of


# the solvers of the kite fail at their first coupling iteration, the third, or one in the middle
@pytest.mark.parametrize("at", [1, 3, 6])
@pytest.mark.parametrize("fault", ["nan", "raise", "discard"])
@pytest.mark.parametrize("where", ["structural", "aero"])
def test_a_fault_of_a_solver_of_the_kite_is_overcome_and_reported(sound, where, fault, at):
    coupling = wrapped(in_process("v3_kite", wind_speed=12.0), {at: fault}, where)
    run = coupled_run(coupling, scheme("iqn-ils"))
    assert run.status == "converged"
    assert alive(coupling) == (0, 0)
    content = summary(run, SETTINGS)
    (recovery,) = content["recoveries"]
    assert recovery["iteration"] == at
    assert recovery["remedy"]
    names = {"nan": "finite", "raise": "a fault of the solver", "discard": "the step was discarded"}
    assert names[fault] in recovery["reason"]
    assert fault == "nan" or f"the {where} solver" in recovery["reason"]
    assert any(r.startswith("recovered: ") and f"evaluation {at}" in r for r in content["remarks"])
    json.dumps(content["recoveries"])
    # both within 1e-5 m of the residual, and (I - G')^-1 is below 10 for this kite
    assert np.abs(run.result.displacement - sound("iqn-ils").result.displacement).max() < 1e-4
    assert run.result.iterations <= sound("iqn-ils").result.iterations + 4


@pytest.mark.parametrize("name", ["aitken", "iqn-imvj", "newton-krylov", "relaxation"])
@pytest.mark.parametrize("at", [1, 4])
def test_every_scheme_overcomes_a_fault(sound, name, at):
    coupling = wrapped(in_process("v3_kite", wind_speed=12.0), {at: "discard"}, "structural")
    run = coupled_run(coupling, scheme(name, coupling))
    assert run.status == "converged"
    assert len(run.result.recoveries) == 1
    assert alive(coupling) == (0, 0)
    assert np.abs(run.result.displacement - sound(name).result.displacement).max() < 1e-4  # as above


@pytest.mark.parametrize("fault", ["nan", "raise", "discard"])
@pytest.mark.parametrize("where", ["structural", "aero"])
def test_a_fault_of_an_fmu_is_overcome(where, fault):
    with BACKENDS["FMU"]("typical_section", wind_speed=12.0) as fmus:
        coupling = wrapped(fmus, {2: fault}, where)
        run = coupled_run(coupling, scheme("iqn-ils"), atol=1e-8)
        assert run.status == "converged"
        assert len(run.result.recoveries) == 1
        assert alive(coupling) == (0, 0)
        assert not fmus.structural._states
        assert not fmus.aero._states
    reference = solve(in_process("typical_section", wind_speed=12.0), scheme("iqn-ils"), atol=1e-8)
    assert np.abs(run.result.displacement - reference.displacement).max() < 1e-7  # residual over 1 - q / q_D > 0.5


@pytest.mark.parametrize("first", [1, 4])
@pytest.mark.parametrize("fault", ["nan", "raise", "discard"])
@pytest.mark.parametrize("where", ["structural", "aero"])
def test_a_solver_that_keeps_failing_ends_as_diverged(where, fault, first):
    faults = dict.fromkeys(range(first, 500), fault)
    coupling = wrapped(in_process("v3_kite", wind_speed=12.0), faults, where)
    run = coupled_run(coupling, scheme("iqn-ils"))
    assert run.status == "diverged"
    assert run.message.endswith(".")
    assert {"nan": "finite", "raise": "a fault of the solver", "discard": "discarded"}[fault] in run.message
    assert alive(coupling) == (0, 0)
    tried = 3 if first > 1 else 1  # without a better point to go back to, the same is tried once more
    assert len(run.result.recoveries) == tried
    assert run.result.iterations == len(run.result.history) == first + tried
    assert np.all(np.isfinite(run.result.displacement))
    summary(run, SETTINGS)


@pytest.mark.parametrize("backend", ["in-process", "FMU"])
def test_the_command_ends_with_exit_code_1_and_says_why(backend, tmp_path, monkeypatch):
    made = commands.pair

    @contextlib.contextmanager
    def failing(*arguments):
        with made(*arguments) as coupling:
            yield wrapped(coupling, {"always": "discard"}, "aero")

    monkeypatch.setattr(commands, "pair", failing)
    choices = {
        "scheme": "iqn-ils", "backend": "in-process" if backend == "in-process" else "fmu", "order": "serial",
        "tolerance": 1e-5, "force_tolerance": 0.01, "max_iterations": 50, "relaxation": None, "stability": True,
        "report": False,
    }  # fmt: skip
    assert commands.run_scene("typical_section", choices, {}, tmp_path) == 1
    content = json.loads((tmp_path / "summary.json").read_text())
    assert content["status"] == "diverged"
    assert "the step was discarded" in content["message"]
    assert len(content["recoveries"]) == 1  # the first evaluation, tried once more


def test_a_solver_that_ended_is_reported_with_its_reason():
    for where in ("structural", "aero"):
        coupling = wrapped(in_process("typical_section", wind_speed=12.0), {2: "dead"}, where)
        with pytest.raises(RuntimeError, match=f"the {where} solver .* fmi2Fatal"):
            coupled_run(coupling, scheme("iqn-ils"))


@pytest.mark.parametrize("at", [1, 2, 5])
def test_an_interrupt_leaves_no_saved_state(at):
    coupling = wrapped(in_process("v3_kite", wind_speed=12.0), {at: "interrupt"}, "aero")
    with pytest.raises(KeyboardInterrupt):
        coupled_run(coupling, scheme("iqn-ils"))
    assert alive(coupling) == (0, 0)

    def stop(k, residual):
        if k == at:
            raise KeyboardInterrupt

    coupling = wrapped(in_process("v3_kite", wind_speed=12.0), {}, "aero")
    with pytest.raises(KeyboardInterrupt):
        coupled_run(coupling, scheme("iqn-ils"), progress=stop)
    assert alive(coupling) == (0, 0)


def test_a_solver_that_cannot_save_ends_in_a_sentence_and_frees_the_other():
    class Unsaved(Faulty):
        def save(self):
            raise MemoryError("no memory left")

    whole = in_process("typical_section", wind_speed=12.0)
    coupling = Coupling(Unsaved(whole.structural), Faulty(whole.aero))
    with pytest.raises((ValueError, RuntimeError), match="could not save its state: MemoryError: no memory left"):
        coupled_run(coupling, scheme("iqn-ils"))
    assert alive(coupling) == (0, 0)


def test_a_save_that_fails_later_ends_in_a_status():
    class Full(Faulty):
        saves = 0

        def save(self):
            self.saves += 1
            if self.saves == 3:
                raise MemoryError("no memory left")
            return super().save()

    whole = in_process("v3_kite", wind_speed=12.0)
    coupling = Coupling(Full(whole.structural), Faulty(whole.aero))
    run = coupled_run(coupling, scheme("iqn-ils"))
    assert run.status == "diverged"
    assert "no memory left" in run.message
    assert alive(coupling) == (0, 0)


def test_a_restart_that_begins_a_new_loop_frees_what_it_read(tmp_path):
    path = tmp_path / "kept.checkpoint"
    about = {"scene": "v3_kite", "scene_settings": {}, "parameters": {}, "order": "serial", "tolerance": 1e-5}

    class Stop(Exception):
        pass

    coupling = wrapped(in_process("v3_kite", wind_speed=12.0), {}, "aero")
    used = scheme("iqn-ils")
    keeper = restart.CheckpointWriter(path, 1, coupling, used, about)

    def hold(search, snapshot):
        keeper(search, snapshot)
        if len(search.history) == 4:
            raise Stop

    with pytest.raises(Stop):
        solve(coupling, used, hold=hold)
    assert alive(coupling) == (0, 0)
    for changed in ({}, {"tolerance": 1e-6}):
        again, used = wrapped(in_process("v3_kite", wind_speed=12.0), {}, "aero"), scheme("iqn-ils")
        search, _ = restart.resumed(path, again, used, about | changed, {})
        assert solve(again, used, search=search).status == "converged"
        assert alive(again) == (0, 0)


def evaluations_of(speed=12.0, stability=False):
    """Steps of each solver in an undisturbed run of the kite: in the loop, and in all."""
    coupling = wrapped(in_process("v3_kite", wind_speed=speed), {}, "aero")
    run = coupled_run(coupling, scheme("iqn-ils"), stability=stability)
    return run.result.iterations, coupling.aero.steps


@pytest.mark.parametrize("where", ["structural", "aero"])
@pytest.mark.parametrize("fault", ["raise", "discard", "nan"])
def test_a_fault_at_the_last_look_at_the_forces_is_overcome(where, fault):
    iterations, steps = evaluations_of()
    assert steps == iterations + 1
    if (where, fault) == ("structural", "nan"):
        return  # its shape is not looked at there
    coupling = wrapped(in_process("v3_kite", wind_speed=12.0), {steps: fault}, where)
    run = coupled_run(coupling, scheme("iqn-ils"), stability=False)
    assert run.status == "converged"
    (recovery,) = run.result.recoveries
    assert "reported shape" in recovery.reason
    assert run.result.residual_N <= 0.01
    assert alive(coupling) == (0, 0)
    lasting = wrapped(in_process("v3_kite", wind_speed=12.0), dict.fromkeys(range(steps, steps + 99), fault), where)
    run = coupled_run(lasting, scheme("iqn-ils"), stability=False)
    assert run.status == "diverged"
    assert "reported shape" in run.message
    assert alive(lasting) == (0, 0)


@pytest.mark.parametrize("where", ["structural", "aero"])
@pytest.mark.parametrize("fault", ["raise", "discard", "nan"])
def test_a_fault_while_the_stability_is_judged_leaves_it_undecided_and_the_equilibrium_as_it_was(where, fault):
    _, steps = evaluations_of()
    coupling = wrapped(in_process("v3_kite", wind_speed=12.0), {steps + 3: fault}, where)
    run = coupled_run(coupling, scheme("iqn-ils"))
    assert run.status == "converged"
    assert run.stability is not None
    assert run.stability.statically_stable is None
    assert any("could not be decided" in remark for remark in run.remarks)
    assert alive(coupling) == (0, 0)
    plain = coupled_run(in_process("v3_kite", wind_speed=12.0), scheme("iqn-ils"), stability=False)
    for name, values in plain.blocks["structural"].items():
        assert np.array_equal(run.blocks["structural"][name], values)


def test_a_restart_in_the_other_order_begins_without_history(tmp_path):
    path = tmp_path / "kept.checkpoint"
    about = {"scene": "v3_kite", "scene_settings": {}, "parameters": {}, "order": "serial", "tolerance": 1e-5}
    for order, other in (("serial", "parallel"), ("parallel", "serial")):
        coupling, used = in_process("v3_kite", wind_speed=12.0), scheme("iqn-ils")
        keeper = restart.CheckpointWriter(path, 1, coupling, used, about | {"order": order})
        solve(coupling, used, order=order, hold=keeper)
        again, used = in_process("v3_kite", wind_speed=12.0), scheme("iqn-ils")
        search, (remark,) = restart.resumed(path, again, used, about | {"order": other}, {})
        assert f"order {order} -> {other}" in remark
        assert solve(again, used, order=other, search=search).status == "converged"


@pytest.mark.parametrize("name", ["iqn-ils", "aitken"])
@pytest.mark.parametrize("at", [3, 5, 7])
def test_a_fault_after_a_restart_is_overcome_from_the_same_best_point(tmp_path, name, at):
    path, fault = tmp_path / "kept.checkpoint", 6
    about = {"scene": "v3_kite", "scene_settings": {}, "parameters": {}, "order": "serial"}

    class Stop(Exception):
        pass

    def run(stop=None, again=False, faults=None):
        coupling, used = wrapped(in_process("v3_kite", wind_speed=12.0), faults, "aero"), scheme(name)
        keeper = restart.CheckpointWriter(path, 1, coupling, used, about)
        search = restart.resumed(path, coupling, used, about, {})[0] if again else None

        def hold(search, snapshot):
            keeper(search, snapshot)
            if len(search.history) == stop:
                raise Stop

        try:
            return solve(coupling, used, search=search, hold=hold)
        finally:
            assert alive(coupling) == (0, 0)

    whole = run(faults={fault: "discard"})
    with pytest.raises(Stop):
        run(stop=at, faults={fault: "discard"})
    rest = run(again=True, faults={fault - at: "discard"} if at < fault else {})
    assert rest.recoveries == whole.recoveries
    assert np.array_equal(rest.displacement, whole.displacement)
    assert rest.iterations == whole.iterations


@pytest.mark.parametrize(
    ("first", "last", "told"),
    [(0.6, 0.65, 0), (0.6, 0.21, 0), (0.6, 0.19, 1), (0.6, -0.4, 1), (0.6, 1.9, 1), (-0.1, 0.5, 0)],
)
def test_a_lift_far_from_that_of_the_start_is_told(first, last, told):
    """A third or three times of it, or the other sign; nothing is known where the start had none."""
    found = _branch_remarks([{"aero.CL": first}, {"aero.CL": 9.0}], {"CL": np.array(last)})
    assert len(found) == told
    assert all(f"C_L is {last:g}, {first:g} at the start" in text for text in found)
    assert _branch_remarks([], {}) == []
