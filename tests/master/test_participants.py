"""An FMU and a solver core in this process are the same to the coupling loop. Exact equality throughout."""

import gc
import os
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import scenes
from fmus.aero_fmu import AeroFmu
from fmus.builder import archive, build
from master.coupling import FmuParticipant, InProcessParticipant, StepFailed
from master.coupling.participants.blocks import grouped
from tests.fmus.toy_fmu import Toy, ToyFmu

LOADS = np.random.default_rng(7).normal(size=(6, 2, 3))


@pytest.fixture(scope="module")
def toy_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("toy") / "toy.fmu"
    path.write_bytes(archive("toy", ToyFmu(Toy(), instance_name="toy"), {}))
    return path


@pytest.fixture(params=["fmu", "in-process"])
def toy(request, toy_path):
    """A participant of either kind, with the same parameters."""
    parameters = {"gain": 0.7, "scale": [3.0, 2.0, 1.0]}
    fmu = request.param == "fmu"
    with FmuParticipant(toy_path, parameters) if fmu else InProcessParticipant(Toy(), parameters) as participant:
        yield participant


def response(participant, loads=LOADS):
    """Positions after each load, one step each."""
    found = []
    for t, load in enumerate(loads):
        participant.set("load", load)
        participant.step(float(t), 1.0)
        found.append(participant.get("position"))
    return np.array(found)


def test_both_kinds_exchange_the_same_bits_with_each_other_over_a_scene(tmp_path):
    scene = scenes.load("typical_section")
    paths = build(scene, tmp_path)
    cores = scene.structural_core(), scene.aero_core()
    results = []
    for structural, aero in (map(FmuParticipant, paths), map(InProcessParticipant, cores)):
        with structural, aero:
            loads = [name for name in ("pressure", "shear") if name in aero.blocks]
            history = []
            for k in range(5):
                aero.step(float(k), 1.0)
                for name in loads:
                    structural.set(name, aero.get(name))
                structural.step(float(k), 1.0)
                aero.set("displacement", structural.get("displacement"))
                history += [structural.get(name) for name in structural.blocks] + [aero.get(n) for n in aero.blocks]
            results.append((structural.blocks, aero.blocks, structural.causality, aero.causality, history))
    *fmu_names, by_fmu = results[0]
    *core_names, by_core = results[1]
    assert fmu_names == core_names
    assert [value.dtype for value in by_fmu] == [value.dtype for value in by_core]
    assert all(np.array_equal(a, b) for a, b in zip(by_fmu, by_core, strict=True))
    assert np.any(by_core[-1] != by_core[0])  # something happened


def test_both_kinds_give_the_closed_form_of_the_toy(toy):
    memory = np.zeros((2, 3))
    for position, load in zip(response(toy), LOADS, strict=True):
        memory = 0.5 * memory + 0.7 * load
        assert np.array_equal(position, np.sin(memory))
    assert np.array_equal(toy.get("offset"), 0.7 * np.array([3.0, 2.0, 1.0]))
    assert (toy.get("steps"), toy.get("active")) == (6.0, 1.0)
    assert toy.get("loaded").tolist() == [1.0, 1.0]


def test_a_boolean_parameter_switches(toy):
    toy.set("active", False)
    assert not response(toy).any()
    toy.set("active", 1.0)
    assert response(toy).any()


def test_a_value_that_was_got_does_not_change_with_the_next_step(toy):
    toy.set("load", LOADS[0])
    toy.step(0.0, 1.0)
    first = toy.get("position")
    kept = first.copy()
    first_again = toy.get("position")
    first_again[:] = 9.0
    toy.step(1.0, 1.0)
    assert np.array_equal(first, kept)
    assert not np.array_equal(toy.get("position"), kept)


def test_a_restored_state_repeats_the_steps_any_number_of_times(toy):
    response(toy)
    state = toy.save()
    first = response(toy)
    toy.set("gain", 2.0)
    for _ in range(3):
        toy.restore(state)
        assert toy.get("gain") == 0.7
        assert np.array_equal(response(toy), first)
    toy.free(state)


def test_saved_states_are_freed_by_free_and_by_close(toy_path):
    with FmuParticipant(toy_path) as toy:
        saved = next(m for n, m in sys.modules.items() if n.startswith("toy_fmu_")).SAVED
        states = [toy.save() for _ in range(20)]
        assert len(saved) == 20
        for state in states[:5]:
            toy.free(state)
            toy.free(state)  # nothing is left to give back
        assert len(saved) == 15
    gc.collect()
    assert len(saved) == 0


def test_a_freed_or_foreign_state_is_refused(toy_path):
    with FmuParticipant(toy_path) as one, FmuParticipant(toy_path) as two:
        state = one.save()
        with pytest.raises(ValueError, match="not one of its own"):
            two.restore(state)
        one.free(state)
        with pytest.raises(ValueError, match="was freed"):
            one.restore(state)


@pytest.mark.parametrize(
    ("block", "value", "sentence"),
    [
        ("lode", 0.0, "has no block 'lode'; it has gain, scale, active, load, trouble, position, offset"),
        ("load", np.zeros(6), r"block 'load' has shape \(2, 3\), not \(6,\)\."),
        ("load", np.full((2, 3), np.nan), "block 'load' must be finite"),
        ("load", "heavy", r"block 'load' takes numbers of shape \(2, 3\)"),
        ("gain", -0.1, "block 'gain' must be at least 0"),
        ("trouble", 4, "block 'trouble' must be between 0 and 3, not 4"),
        ("position", np.zeros((2, 3)), "block 'position' cannot be set, its causality is output"),
        ("scale", np.ones(3), "block 'scale' is fixed"),
    ],
)
def test_a_bad_value_is_refused_with_one_sentence_and_the_old_one_stays(toy, block, value, sentence):
    response(toy)
    state = toy.save()
    expected = response(toy)
    toy.restore(state)
    with pytest.raises(ValueError, match=sentence):
        toy.set(block, value)
    assert np.array_equal(response(toy), expected)


def test_an_unknown_block_cannot_be_got(toy):
    with pytest.raises(ValueError, match="has no block 'lode'; it has gain"):
        toy.get("lode")


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"moon": 1.0}, "has no block 'moon'"),
        ({"scale": [1.0, 2.0, 10.0]}, "block 'scale' must be at most 9"),
        ({"gain": 1001.0}, "a gain at most 1000"),  # known to the core only
        ({"steps": 3}, "block 'steps' cannot be set"),
    ],
)
def test_bad_parameters_are_refused_when_a_participant_is_made(toy_path, parameters, sentence):
    for make in (lambda p: FmuParticipant(toy_path, p), lambda p: InProcessParticipant(Toy(), p)):
        with pytest.raises(ValueError, match=sentence):
            make(parameters)


def test_a_participant_without_derivatives_says_so(toy):
    with pytest.raises(ValueError, match="gives no directional derivatives") as caught:
        toy.directional_derivative({})
    assert "\n" not in str(caught.value)


def test_a_failed_step_says_why_and_the_participant_goes_on_from_a_saved_state(toy):
    response(toy)
    state = toy.save()
    expected = response(toy)
    toy.restore(state)
    toy.set("trouble", 1)
    with pytest.raises(StepFailed, match=r"^The rope is torn at 100 % load\.$"):
        toy.step(0.0, 1.0)
    toy.restore(state)
    assert np.array_equal(response(toy), expected)


def test_an_interrupt_in_a_step_stops_the_loop_and_not_the_process(toy):
    toy.set("trouble", 3)
    with pytest.raises(KeyboardInterrupt):
        toy.step(0.0, 1.0)
    toy.set("trouble", 0)
    toy.step(0.0, 1.0)
    assert toy.get("steps") == 1.0


def test_messages_are_kept_by_the_participant_they_belong_to_and_not_printed(toy_path, capfd):
    with FmuParticipant(toy_path) as one, FmuParticipant(toy_path) as two:
        one.set("trouble", 1)
        with pytest.raises(StepFailed):
            one.step(0.0, 1.0)
        two.step(0.0, 1.0)
        assert list(one.messages) == [(2, "The rope is torn at 100 % load.")]
        assert not two.messages
    assert capfd.readouterr() == ("", "")


def test_a_closed_participant_has_removed_its_folder_and_refuses_calls(toy_path, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    toy = FmuParticipant(toy_path)
    assert len(os.listdir(tmp_path)) == 1
    toy.set("load", LOADS[0])
    toy.close()
    toy.close()
    assert not os.listdir(tmp_path)
    for call in (lambda: toy.set("load", LOADS[0]), lambda: toy.get("load"), lambda: toy.step(0.0, 1.0), toy.save):
        with pytest.raises(ValueError, match="is closed"):
            call()


def test_what_is_no_fmu_is_refused_and_nothing_is_left(toy_path, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    text = tmp_path / "text.fmu"
    text.write_text("no zip")
    broken = tmp_path / "broken.fmu"  # an FMU whose scene is missing cannot make an instance
    scene = scenes.load("typical_section")
    instance = AeroFmu(scene.aero_core(), instance_name="x")
    broken.write_bytes(archive("broken", instance, {}))
    for path, sentence in (
        (text, "readable"),
        (tmp_path / "none.fmu", "no FMU"),
        (broken, "cannot be instantiated: .*FileNotFoundError"),
    ):
        with pytest.raises(ValueError, match=sentence):
            FmuParticipant(path)
    assert not os.listdir(tmp_path / "temporary")
    with FmuParticipant(toy_path) as toy:  # and the process is well
        toy.step(0.0, 1.0)


FOREIGN = """
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String

class Foreign(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.a, self.b, self.n, self.on, self.text, self.y = 1.0, 2.0, 3, True, "text", 0.0
        get, put = (lambda name: lambda: getattr(self, name)), (lambda name: lambda v: setattr(self, name, v))
        given = dict(causality=Fmi2Causality.input)
        self.register_variable(Real("x[1]", getter=get("b"), setter=put("b"), **given))  # not in order
        self.register_variable(Real("x[0]", getter=get("a"), setter=put("a"), **given))
        discrete = dict(variability=Fmi2Variability.discrete, **given)
        self.register_variable(Integer("n", **discrete))
        self.register_variable(Boolean("on", **discrete))
        self.register_variable(String("text", **discrete))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, t, dt):
        self.y = self.on * (10.0 * self.a + self.b) * self.n
        return self.y < 1000.0
"""


def test_an_fmu_of_another_maker_is_a_participant_too(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "foreign_slave.py").write_text(FOREIGN)
    from pythonfmu import FmuBuilder

    path = FmuBuilder.build_FMU(tmp_path / "foreign_slave.py", dest=tmp_path)
    with FmuParticipant(Path(path), {"x": [4.0, 5.0]}) as foreign:
        assert foreign.blocks == {"x": (2,), "n": (), "on": (), "y": ()}
        foreign.step(0.0, 1.0)
        assert foreign.get("y") == 45.0 * 3
        foreign.set("x", [1.0, 2.0])
        foreign.set("n", 7)
        foreign.step(1.0, 1.0)
        assert foreign.get("y") == 12.0 * 7
        foreign.set("on", False)
        foreign.step(2.0, 1.0)
        assert foreign.get("y") == 0.0
        foreign.set("on", True)
        foreign.set("n", 1000)
        with pytest.raises(StepFailed, match="fmi2Discard"):
            foreign.step(3.0, 1.0)
        with pytest.raises(ValueError, match="cannot save its state"):
            foreign.save()


def described(*names, **changes):
    """Variables as fmpy describes them; `changes` holds the type of single ones."""
    return [SimpleNamespace(name=n, type=changes.get(n, "Real"), causality="input", variability=None) for n in names]


def test_scalars_become_a_block_only_if_their_indices_leave_no_gap_and_they_are_alike():
    square = [f"u[{i},{j}]" for j in (1, 2) for i in (1, 2)]  # column-major
    scalars, shape = grouped(described(*square))["u"]
    assert ([v.name for v in scalars], shape) == (["u[1,1]", "u[1,2]", "u[2,1]", "u[2,2]"], (2, 2))
    assert grouped(described("p[0]", "p[2]", "p[1]"))["p"][1] == (3,)
    assert grouped(described("a[1].b[10]", "a[1].b[9]"))["a[1].b"][1] == (2,)
    for apart in (
        described("p[1]", "p[1000000000]"),
        described("p", "p[1]"),
        described("p[1]", "p[1,2]"),
        described("p[1,2]", "p[2,1]"),
        described("p[1]", "p[2]", **{"p[2]": "Integer"}),
    ):
        assert {name: shape for name, (_, shape) in grouped(apart).items()} == {v.name: () for v in apart}
    assert grouped(described("s", s="String")) == {}
