"""An exchange has one clock: it counts, continues after a restart, and goes back with the best point."""

import pickle

import numpy as np
import pytest

from master import IQNILS
from master.coupling import Coupling, checkpoint
from master.coupling.exchange import Connection, Exchange, StateSnapshot
from master.coupling.march import march
from master.coupling.steady import Search
from tests.master.toys import Mass, Spring


def oscillator(dt, order=("f", "x")):
    connections = {"f": Connection("spring", "f", "mass", "f"), "x": Connection("mass", "x", "spring", "x")}
    participants = {"spring": Spring(4.0), "mass": Mass(1.0, forces=-4.0)}
    return Exchange(participants, [connections[name] for name in order], dt, rollback=True)


def kept(exchange, stop, order="serial"):
    contents = []
    march(exchange, None, stop, order, hold=lambda now: contents.append(
        pickle.dumps(checkpoint.dump_march(exchange, None, now))
    ))  # fmt: skip
    return pickle.loads(contents[-1])


def test_times_after_a_restart_with_another_step_are_counted_from_there():
    exchange = oscillator(0.001)
    begun = checkpoint.load_march(exchange, kept(oscillator(0.1), 0.3))
    result = march(exchange, None, 3.3, begun=begun)
    begin = 3 * 0.1
    assert result.steps.times.tolist() == [0.1, 0.2, begin, *(begin + k * 0.001 for k in range(1, 3001))]


@pytest.mark.parametrize("evaluations", [1, 3])
def test_the_best_point_in_a_checkpoint_has_its_own_time(evaluations):
    import scenes

    def made():
        return Coupling.in_process(scenes.load("typical_section"), {"wind_speed": 15.0})

    coupling = made()
    x = coupling.present()
    coupling.evaluate(x)
    snapshot = StateSnapshot(coupling)  # the best point, after one evaluation
    for _ in range(evaluations):
        coupling.evaluate(x)
    search = Search("serial", x)
    content = pickle.loads(pickle.dumps(checkpoint.dump_search(coupling, IQNILS(), search, snapshot)))
    again = made()
    best = StateSnapshot(again, checkpoint.load_search(again, content).best)
    assert again.time == 1.0 + evaluations
    best.restore()
    assert again.time == 1.0


def test_a_march_with_connections_in_another_sequence_is_refused_and_not_mixed_up():
    content = kept(oscillator(0.1), 0.3, "parallel")
    other = oscillator(0.1, ("x", "f"))  # as many unknowns of one size, in another sequence
    begun = checkpoint.load_march(other, content)
    with pytest.raises(ValueError, match=r"has the unknowns spring\.f, mass\.x, but .* mass\.x, spring\.f here; .*\.$"):
        march(other, None, 0.5, "parallel", begun=begun)
    same = oscillator(0.1)
    rest = march(same, None, 0.5, "parallel", begun=checkpoint.load_march(same, content))
    assert np.array_equal(rest.x, march(oscillator(0.1), None, 0.5, "parallel").x)


def test_what_cannot_be_pickled_is_refused_by_file_and_leaves_none(tmp_path):
    with pytest.raises(ValueError, match=r"a b\.ckp cannot be written: .*\.$"):
        checkpoint.write(tmp_path / "a b.ckp", {}, {"scheme": lambda x, r: x + r})
    assert not list(tmp_path.iterdir())
