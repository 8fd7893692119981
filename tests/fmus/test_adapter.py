"""A solver core behind the FMI functions: names, values, failures, complete state. Exact equality throughout."""

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from fmus.description import base_exponents, scalar_names
from interface import Variable
from tests.fmus.importer import Importer

LOADS = [[0.1 * k + 0.01 * i for i in range(6)] for k in range(5)]  # six scalars a step
DISCARD, ERROR = 2, 3


@pytest.fixture
def toy(toy_path):
    with Importer(toy_path) as importer:
        yield importer


def step(toy, t=0.0):
    """Status of a doStep."""
    try:
        toy.slave.doStep(t, 1.0)
    except FMICallException as error:
        return error.status
    return 0


def responses(toy, loads):
    """Positions and counters after a step with each load."""
    found = []
    for t, load in enumerate(loads):
        toy.set(load=load)
        assert step(toy, float(t)) == 0
        found.append((toy.get("position"), toy.get("steps")))
    return found


def test_the_validator_of_fmpy_finds_no_problem(toy_path):
    assert validate_fmu(str(toy_path)) == []


def test_a_block_is_one_run_of_value_references_in_row_major_order(toy):
    names = [f"load[{i},{j}]" for i in (1, 2) for j in (1, 2, 3)]
    assert scalar_names(Variable("load", (2, 3))) == names
    assert scalar_names(Variable("gain")) == ["gain"]
    first = toy.references[names[0]]
    assert [toy.references[name] for name in names] == list(range(first, first + 6))


@pytest.mark.parametrize(
    ("unit", "exponents"),
    [
        ("N/m", {"kg": 1, "s": -2}),
        ("N", {"kg": 1, "m": 1, "s": -2}),
        ("Pa", {"kg": 1, "m": -1, "s": -2}),
        ("kg/m3", {"kg": 1, "m": -3}),
        ("m/s2", {"m": 1, "s": -2}),
        ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("N m", {"kg": 1, "m": 2, "s": -2}),
        ("rad/s", {"rad": 1, "s": -1}),
        ("1/s", {"s": -1}),
        ("1", {}),
    ],
)
def test_a_unit_has_the_exponents_of_the_SI(unit, exponents):
    assert base_exponents(unit) == exponents


@pytest.mark.parametrize("unit", ["ft", "m/", "", "N**m", "-"])
def test_a_unit_outside_the_SI_is_refused_by_name(unit):
    with pytest.raises(ValueError, match="Unit"):
        base_exponents(unit)


def test_the_description_carries_units_bounds_and_start_values_to_the_last_bit(toy):
    described = {v.name: v for v in toy.description.modelVariables}
    assert float(described["gain"].start) == 0.1 + 0.2  # 0.30000000000000004 needs 17 digits
    assert [float(described[f"scale[{i}]"].start) for i in (1, 2, 3)] == [1.0, 2.0, 4.0]
    assert (described["gain"].min, described["scale[2]"].max) == ("0.0", "9.0")
    assert (described["trouble"].min, described["trouble"].max, described["trouble"].type) == ("0", "3", "Integer")
    assert (described["active"].start, described["active"].type) == ("true", "Boolean")
    assert described["load[1,2]"].description == "load < limit"
    assert {v.unit for v in described.values() if v.type == "Real"} == {"m", "N", "m/N"}


def test_no_output_depends_on_an_input_at_a_communication_point(toy):
    dependencies = {unknown.variable.name: unknown.dependencies for unknown in toy.description.outputs}
    assert set(dependencies) == {v.name for v in toy.description.modelVariables if v.causality == "output"}
    assert all(known == [] for known in dependencies.values())
    before = toy.get("position")
    toy.set(load=5.0)
    assert toy.get("position") == before


def test_any_order_of_value_references_reaches_the_same_scalars(toy):
    names = [*toy.names("load"), "gain"]
    values = dict(zip(names, np.arange(1.0, 8.0), strict=True))
    for order in ([6, 3, 0, 4, 1, 5, 2], [0, 1, 2, 3, 4, 5, 6], [0, 2, 1, 3, 4, 5, 6]):
        picked = [names[i] for i in order]
        toy.slave.setReal([toy.references[name] for name in picked], [values[name] for name in picked])
        assert toy.get("load") == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
        assert toy.slave.getReal([toy.references[name] for name in picked]) == [values[name] for name in picked]
        assert [toy.slave.getReal([toy.references[name]])[0] for name in names] == list(values.values())
        toy.set(load=0.0, gain=0.0)


def test_booleans_and_integers_keep_their_type(toy):
    active, loaded = toy.references["active"], [toy.references[f"loaded[{i}]"] for i in (1, 2)]
    assert toy.slave.getBoolean([active]) == [True]
    toy.slave.setBoolean([active], [False])
    toy.set(load=[0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    assert step(toy) == 0
    assert toy.slave.getBoolean(loaded) == [False, True]
    assert toy.slave.getInteger([toy.references["steps"]]) == [1]
    assert toy.get("position") == [0.0] * 6  # not active


def test_outputs_follow_the_parameters_in_initialization_mode_and_are_valid_before_the_first_step(toy_path):
    with Importer(toy_path, initialise=False) as toy:
        assert toy.get("offset") == [0.1 + 0.2, 2 * (0.1 + 0.2), 4 * (0.1 + 0.2)]
        toy.set(gain=2.0, scale=[1.0, 3.0, 5.0])
        assert toy.get("offset") == [2.0, 6.0, 10.0]
        toy.set(gain=3.0)
        toy.slave.exitInitializationMode()
        assert toy.get("offset") == [3.0, 9.0, 15.0]
        assert toy.get("position") == [0.0] * 6


def test_a_restored_state_repeats_the_steps_to_the_last_bit(toy):
    responses(toy, LOADS)
    toy.set(load=7.0)  # set, not yet stepped: belongs to the state too
    state = toy.slave.getFMUstate()
    first = [step(toy), toy.get("position"), *responses(toy, LOADS[::-1])]
    toy.set(gain=5.0)
    step(toy)
    for _ in range(2):
        toy.slave.setFMUstate(state)
        assert toy.get("load") == [7.0] * 6
        assert toy.get("gain") == [0.1 + 0.2]
        assert [step(toy), toy.get("position"), *responses(toy, LOADS[::-1])] == first
    toy.slave.freeFMUstate(state)


def test_a_serialised_state_goes_on_in_a_new_instance_to_the_last_bit(toy, toy_path):
    responses(toy, LOADS)
    state = toy.slave.getFMUstate()
    content = toy.slave.serializeFMUstate(state)
    expected = responses(toy, LOADS)
    toy.slave.freeFMUstate(state)
    with Importer(toy_path) as other:
        restored = other.slave.deSerializeFMUstate(content)
        other.slave.setFMUstate(restored)
        assert responses(other, LOADS) == expected
        other.slave.freeFMUstate(restored)


@pytest.mark.parametrize("content", [b"", b"no state", b"\x80\x05N."])
def test_bytes_that_are_no_state_are_refused_where_they_are_read_and_the_fmu_goes_on(toy, content):
    good = toy.slave.getFMUstate()
    expected = responses(toy, LOADS)
    with pytest.raises(FMICallException, match="fmi2DeSerializeFMUstate"):
        toy.slave.deSerializeFMUstate(content)
    assert toy.log[-1] == (ERROR, "The bytes are not a serialised state of this FMU, or were changed.")
    assert step(toy) == 0
    toy.slave.setFMUstate(good)
    assert responses(toy, LOADS) == expected
    toy.slave.freeFMUstate(good)


def test_a_serialised_state_of_which_one_byte_was_changed_is_not_taken(toy):
    state = toy.slave.getFMUstate()
    content = bytearray(toy.slave.serializeFMUstate(state))
    for place in (0, 20, len(content) // 2, len(content) - 1):
        changed = content.copy()
        changed[place] ^= 1
        with pytest.raises(FMICallException, match="fmi2DeSerializeFMUstate"):
            toy.slave.deSerializeFMUstate(bytes(changed))
    toy.slave.setFMUstate(toy.slave.deSerializeFMUstate(bytes(content)))
    assert step(toy) == 0


@pytest.mark.parametrize(
    ("trouble", "sentence"),
    [
        (1, "The rope is torn at 100 % load."),
        (2, "TypeError: a bug"),
        (3, "KeyboardInterrupt: by a user"),
    ],
)
def test_a_step_that_raises_is_discarded_with_its_sentence_and_the_host_goes_on(toy, trouble, sentence):
    reference = responses(toy, LOADS[:1])[0]
    for _ in range(50):  # a reference count that leaks or is dropped shows after some
        toy.slave.setInteger([toy.references["trouble"]], [trouble])
        assert step(toy) == DISCARD
        assert toy.log[-1] == (DISCARD, sentence)
        assert (toy.get("position"), toy.get("steps")) == reference  # of the last good step
    toy.slave.setInteger([toy.references["trouble"]], [0])
    assert step(toy) == 0


def test_a_tunable_parameter_acts_from_the_next_step_on(toy):
    toy.set(load=1.0)
    assert step(toy) == 0
    toy.set(gain=2.0)
    assert toy.get("position") == [np.sin(0.1 + 0.2)] * 6
    assert step(toy) == 0
    assert toy.get("position") == [np.sin(0.5 * (0.1 + 0.2) + 2.0)] * 6


def test_a_reset_instance_starts_again(toy):
    first = responses(toy, LOADS)
    toy.slave.reset()
    toy.slave.setupExperiment()
    toy.slave.enterInitializationMode()
    toy.slave.exitInitializationMode()
    assert responses(toy, LOADS) == first


def test_fmpy_simulates_it_as_any_other_fmu(toy_path):
    result = fmpy.simulate_fmu(
        toy_path,
        stop_time=4.0,
        output_interval=1.0,
        start_values={"load[1,1]": 1.0, "gain": 1.0},
        output=["position[1,1]"],
    )
    # The memory is 1, 1.5, 1.75, … = 2 − 2^(1−n) after n steps; sin of it is rounded once, here as there.
    memory = [2.0 - 2.0 ** (1 - n) for n in range(1, 5)]
    assert result["position[1,1]"].tolist() == [0.0, *np.sin(memory).tolist()]


def test_a_serialised_state_of_another_layout_is_refused_by_its_number(toy):
    state = toy.slave.getFMUstate()
    content = bytes(toy.slave.serializeFMUstate(state))
    assert content.startswith(b"kitecosim state 3\n")
    assert b"pickle" not in content
    with pytest.raises(FMICallException, match="fmi2DeSerializeFMUstate"):
        toy.slave.deSerializeFMUstate(b"kitecosim state 2\n" + content.partition(b"\n")[2])
    assert toy.log[-1] == (ERROR, "The serialised state has the layout 2; this FMU reads 3: save one with it.")
    toy.slave.freeFMUstate(state)


def test_a_state_that_cannot_be_serialised_is_an_error_at_once(own_toy):
    state = own_toy.slave.getFMUstate()
    (saved,) = own_toy.script.SAVED
    saved.values["odd"] = object()
    with pytest.raises(FMICallException, match="Serialize"):
        own_toy.slave.serializeFMUstate(state)
    assert own_toy.log[-1] == (
        ERROR,
        "The state cannot be serialised: a object cannot be stored; states are numbers, texts, arrays, tuples, lists, "
        "dicts, sets and dataclasses.",
    )
    own_toy.slave.freeFMUstate(state)
    state = own_toy.slave.getFMUstate()
    own_toy.slave.setFMUstate(own_toy.slave.deSerializeFMUstate(own_toy.slave.serializeFMUstate(state)))
