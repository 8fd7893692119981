"""Values, references, types and steps that an FMU refuses: the sentence, the old value, the step after."""

import ctypes

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from fmus.builder import build, own_binary
from scenes import load
from tests.fmus.importer import Importer
from tests.fmus.test_adapter import DISCARD, ERROR, LOADS, responses, step


@pytest.fixture
def toy(toy_path):
    with Importer(toy_path) as importer:
        yield importer


REFUSED = [
    ("load", [1.0, 2.0, float("nan"), 4.0, 5.0, 6.0], "load[1,3] must be finite, not nan; it stays 0 N."),
    ("load", float("-inf"), "load[1,1] must be finite, not -inf; it stays 0 N."),
    ("gain", float("inf"), "gain must be finite, not inf; it stays 0.3 m/N."),
    ("gain", -1.0, "gain must be at least 0 m/N, not -1; it stays 0.3 m/N."),
    ("gain", 1001.0, "gain must be finite and a gain at most 1000."),  # by the core, which knows more than the bounds
    ("trouble", 4, "trouble must be between 0 and 3, not 4; it stays 0."),
]


@pytest.mark.parametrize(("name", "value", "sentence"), REFUSED)
def test_a_value_that_does_not_fit_is_refused_where_it_is_set_and_the_old_one_stays(
    toy, toy_path, name, value, sentence
):
    with Importer(toy_path) as untouched:
        expected = responses(untouched, LOADS)
    before = toy.get(name)
    assert toy.refused(**{name: value}) == sentence
    assert toy.get(name) == before
    assert step(toy) == DISCARD  # for importers that do not look at what setting returns
    assert toy.log[-1] == (DISCARD, sentence)
    assert responses(toy, LOADS) == expected  # nothing has to be repaired


def test_a_vector_that_the_core_refuses_as_a_whole_has_its_old_values_after_the_discarded_step(toy_path, scene_paths):
    with Importer(scene_paths[1]) as aero:
        before = aero.get("wind_direction")
        reference = [aero.references[name] for name in aero.names("wind_direction")]
        for place in reference:  # one by one, so that it is zero in between
            aero.slave.setReal([place], [0.0])
        assert step(aero) == DISCARD
        assert aero.log[-1][1].startswith("wind_direction must not be zero")
        assert aero.get("wind_direction") == before
        assert step(aero) == 0
        for place, value in zip(reference, [0.0, 0.0, 1.0], strict=True):
            aero.slave.setReal([place], [value])
        assert step(aero) == 0
        assert aero.get("wind_direction") == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("initialise", [True, False])
def test_a_call_of_which_the_core_refuses_one_value_sets_none(toy_path, initialise):
    with Importer(toy_path, initialise) as toy:
        names = ["gain", "load[1,1]", "load[2,2]"]
        references = [toy.references[name] for name in names]
        toy.slave.setReal(references, [0.5, 1.0, 2.0])
        with pytest.raises(FMICallException):
            toy.slave.setReal(references, [1001.0, 8.0, 9.0])
        assert toy.log[-1] == (ERROR, "gain must be finite and a gain at most 1000.")
        assert list(toy.slave.getReal(references)) == [0.5, 1.0, 2.0]
        if not initialise:
            toy.slave.exitInitializationMode()
        assert [step(toy), step(toy)] == [DISCARD, 0]
        assert toy.get("position")[0] == np.sin(0.5 * 1.0)


def test_a_bad_start_value_is_logged_and_discards_the_first_step(toy_path):
    with Importer(toy_path, initialise=False) as toy:
        assert toy.refused(gain=1001.0) == "gain must be finite and a gain at most 1000."
        toy.slave.exitInitializationMode()
        assert toy.get("gain") == [0.1 + 0.2]
        assert [step(toy), step(toy)] == [DISCARD, 0]


@pytest.mark.parametrize(
    ("block", "why"), [("position", "an output"), ("scale", "a fixed parameter, set before initialization mode ends")]
)
def test_an_output_or_a_fixed_parameter_keeps_its_value_and_setting_it_discards_one_step(toy, block, why):
    before = toy.get(block)
    assert toy.refused(**{block: 8.0}) == f"{block} cannot be set: it is {why}."
    assert toy.get(block) == before
    assert [step(toy), step(toy)] == [DISCARD, 0]


def test_a_value_reference_that_does_not_exist_is_logged_not_fatal(toy):
    for verb, arguments in (("get", ([0, 9999],)), ("set", ([9999], [1.0]))):
        with pytest.raises(FMICallException, match="error"):
            getattr(toy.slave, f"{verb}Real")(*arguments)
        assert toy.log[-1] == (ERROR, "Value references go from 0 to 23.")
    assert [step(toy), step(toy)] == [DISCARD, 0]


@pytest.mark.parametrize(("name", "kind"), [("active", "Real"), ("gain", "Boolean"), ("trouble", "Real")])
def test_a_variable_is_set_and_got_as_the_type_that_it_has(toy, name, kind):
    own = toy.types[name]
    for verb, arguments in (("get", ([toy.references[name]],)), ("set", ([toy.references[name]], [1]))):
        with pytest.raises(FMICallException, match="error"):
            getattr(toy.slave, f"{verb}{kind}")(*arguments)
        assert toy.log[-1] == (ERROR, f"{name} is of type {own}: it is set and got as such, not as {kind}.")


@pytest.mark.parametrize(("t", "dt"), [(0.0, 0.0), (0.0, -1.0), (float("nan"), 1.0), (0.0, float("inf"))])
def test_a_step_that_does_not_go_forward_in_time_is_discarded(toy, t, dt):
    with pytest.raises(FMICallException, match="discard"):
        toy.slave.doStep(t, dt)
    assert toy.log[-1][1].startswith("A step from")
    assert step(toy) == 0


@pytest.fixture(scope="module")
def section(tmp_path_factory):
    return build(load("typical_section"), tmp_path_factory.mktemp("garbage"), reference=False)[0]


@pytest.mark.skipif(own_binary() is None, reason="not run: no C compiler was there when the project was installed")
@pytest.mark.parametrize("spoil", [lambda c: b"", lambda c: b"garbage" * 99, lambda c: c[:-1], lambda c: c[:60],
                                   lambda c: c[:-5] + bytes([c[-5] ^ 1]) + c[-4:]])  # fmt: skip
def test_bytes_that_are_no_state_are_refused_where_they_are_read_and_the_fmu_goes_on(spoil, section):
    with Importer(section) as fmu:
        state = fmu.slave.getFMUstate()
        content = fmu.slave.serializeFMUstate(state)
        fmu.slave.doStep(0.0, 1.0)
        with pytest.raises(FMICallException) as caught:
            fmu.slave.deSerializeFMUstate(spoil(content))
        assert caught.value.status == ERROR
        assert "are not a serialised state of this FMU" in fmu.log[-1][1]
        fmu.slave.setFMUstate(fmu.slave.deSerializeFMUstate(content))
        fmu.slave.doStep(0.0, 1.0)


@pytest.mark.skipif(own_binary() is None, reason="not run: no C compiler was there when the project was installed")
@pytest.mark.parametrize("count", [2**62, 2**63, 2**64 - 1, 2**61 + 1])
def test_more_values_than_there_is_memory_are_refused_before_any_is_touched(count, section):
    with Importer(section) as fmu:
        dll, values = fmu.slave.dll, (ctypes.c_double * 1)()
        references = (ctypes.c_uint * 1)(fmu.references[fmu.names("displacement")[0]])
        for call in (dll.fmi2GetReal, dll.fmi2SetReal):
            assert call(ctypes.c_void_p(fmu.slave.component), references, ctypes.c_size_t(count), values) == ERROR
            assert fmu.log[-1] == (ERROR, "More values are asked for than there is memory.")
        state = ctypes.c_void_p()
        assert dll.fmi2DeSerializeFMUstate(
            ctypes.c_void_p(fmu.slave.component), b"x", ctypes.c_size_t(count | 2**63), ctypes.byref(state)
        ) == ERROR  # fmt: skip
