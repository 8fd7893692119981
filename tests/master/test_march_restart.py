"""Transient runs that are interrupted continue to the last bit as if they had not been."""

import contextlib
import pickle

import numpy as np
import pytest

from benchmarks.problems import in_process
from fmus.builder import archive
from master.coupling import Connection, Exchange, FmuParticipant, checkpoint
from master.coupling.acceleration import IQNILS, IQNIMVJ, Aitken, ConstantRelaxation
from master.coupling.march import march
from tests.fmus.toy_fmu import Toy as Core
from tests.fmus.toy_fmu import ToyFmu
from tests.master.toys import Mass, Spring

MARCHING = {
    "explicit": lambda: None,
    "relaxation": lambda: ConstantRelaxation(0.9),
    "aitken": Aitken,
    "iqn-ils": IQNILS,
    "iqn-imvj": IQNIMVJ,
}
DT, STEPS = 0.05, 8


def oscillator(dt=DT, time=0.0):
    connections = [Connection("spring", "f", "mass", "f"), Connection("mass", "x", "spring", "x")]
    return Exchange(
        {"spring": Spring(4.0, 1.0), "mass": Mass(1.0, forces=-5.0)}, connections, dt, time, {"mass": 2}, rollback=True
    )  # fmt: skip


def alive(exchange):
    return sum(p.alive for p in exchange.participants.values())


@pytest.mark.parametrize("name", MARCHING)
def test_a_march_goes_on_bitwise_from_every_step(name, tmp_path):
    options = {"rtol": 1e-9, "predictor": "quadratic"}
    exchange, used, files = oscillator(), MARCHING[name](), []

    def keep(now):
        files.append(tmp_path / f"{len(files)}.checkpoint")
        checkpoint.write(files[-1], {"step": len(files)}, checkpoint.dump_march(exchange, used, now))

    whole = march(exchange, used, STEPS * DT, hold=keep, **options)
    assert whole.status == "converged"
    assert alive(exchange) == 0
    for k, file in enumerate(files[:-1]):
        about, content = checkpoint.read(file)
        assert about == {"step": k + 1}
        again, fresh = oscillator(), MARCHING[name]()
        begun = checkpoint.load_march(again, content, fresh)
        assert again.time == (k + 1) * DT
        rest = march(again, fresh, STEPS * DT, begun=begun, **options)
        assert np.array_equal(rest.x, whole.x)
        assert rest.steps == whole.steps  # times, statuses, evaluations, residuals
        assert rest.evaluations == whole.evaluations
        for p in ("mass", "spring"):
            for block, values in again.participants[p].values.items():
                assert np.array_equal(values, exchange.participants[p].values[block])
        assert alive(again) == 0


@pytest.mark.parametrize("name", ["explicit", "iqn-ils"])
def test_a_march_of_fmus_goes_on_bitwise_in_new_instances(name, tmp_path):
    path = tmp_path / "toy.fmu"
    path.write_bytes(archive("toy", ToyFmu(Core(), instance_name="toy"), {}))

    @contextlib.contextmanager
    def pair():
        with FmuParticipant(path, {"gain": 0.9}) as a, FmuParticipant(path, {"gain": 0.7}) as b:
            a.set("load", np.arange(6.0).reshape(2, 3))
            links = [Connection("a", "position", "b", "load"), Connection("b", "position", "a", "load")]
            yield Exchange({"a": a, "b": b}, links, 0.1, rollback=True)

    files = []
    with pair() as exchange:
        used = MARCHING[name]()

        def keep(now):
            files.append(tmp_path / f"{len(files)}.checkpoint")
            checkpoint.write(files[-1], {}, checkpoint.dump_march(exchange, used, now))

        whole = march(exchange, used, 0.6, hold=keep)
        assert whole.status == "converged"
    for file in files[:-1]:
        with pair() as exchange:
            used = MARCHING[name]()
            begun = checkpoint.load_march(exchange, checkpoint.read(file)[1], used)
            rest = march(exchange, used, 0.6, begun=begun)
            assert np.array_equal(rest.x, whole.x)
            assert rest.steps == whole.steps
            assert not exchange.participants["a"]._states


def interrupted(step, name="iqn-ils", **options):
    """What a checkpoint after a step of a march holds."""
    exchange, used, kept = oscillator(), MARCHING[name](), []
    march(exchange, used, step * DT, hold=lambda now: kept.append(pickle.dumps(
        checkpoint.dump_march(exchange, used, now)
    )), **options)  # fmt: skip
    return pickle.loads(kept[-1])


def test_a_march_may_go_on_with_another_scheme_tolerance_predictor_and_step():
    content = interrupted(4, rtol=1e-6)
    exchange = oscillator(dt=0.5 * DT)
    used = Aitken()
    begun = checkpoint.load_march(exchange, content, used)  # no history of IQN-ILS for it
    result = march(exchange, used, STEPS * DT, begun=begun, rtol=1e-10, predictor="quadratic")
    assert result.status == "converged"
    assert len(result.steps) == 4 + 2 * 4
    assert result.time == pytest.approx(STEPS * DT, abs=1e-15)
    assert np.diff(result.steps.times) == pytest.approx([DT] * 3 + [0.5 * DT] * 8, abs=1e-15)
    assert begun.predictor.kind == "quadratic"


def test_a_march_that_goes_on_remembers_steps_that_did_not_converge():
    content = interrupted(2, "relaxation", rtol=1e-15, max_iterations=1, strict=False)
    exchange = oscillator()
    result = march(exchange, IQNILS(), STEPS * DT, begun=checkpoint.load_march(exchange, content))
    assert result.status == "max_iterations"
    assert "step 1" in result.message


def test_a_march_of_the_other_order_or_of_other_participants_is_refused_in_one_sentence():
    content = interrupted(2)
    exchange = oscillator()
    begun = checkpoint.load_march(exchange, content)
    with pytest.raises(ValueError, match=r"unknowns.*\.$"):
        march(exchange, IQNILS(), 1.0, order="parallel", begun=begun)
    other = Exchange({"a": Spring(1.0), "b": Mass(1.0)}, [Connection("a", "f", "b", "f")], rollback=True)
    with pytest.raises(ValueError, match=r"other participants.*\.$"):
        checkpoint.load_march(other, content)
    with pytest.raises(ValueError, match=r"not of a transient run\.$"):
        checkpoint.load_march(exchange, {"search": None})
    with pytest.raises(ValueError, match=r"not of a coupled equilibrium\.$"):
        checkpoint.load_search(in_process("typical_section"), content)
