"""Arguments from a script that make no sense are refused in one sentence, before anything is solved or written."""

import math

import pytest

from master import compare
from master.coupling import Coupling, InProcessParticipant, scheme, simulate, solve
from master.coupling.checkpoint import Files
from scenes import load


def sides(*wanted):
    """Participants of the tether."""
    cores = load("tether_in_wind").cores()
    return {side: InProcessParticipant(cores[side]) for side in wanted or cores}


def one_sentence(error):
    text = str(error.value)
    return text.endswith(".") and "\n" not in text


@pytest.mark.parametrize(
    ("participants", "change", "says"),
    [
        ((), {"participants": {}}, "there is no participant 'structural'"),
        (("aero",), {}, "there is no participant 'structural'"),
        ((), {"participants": {"structure": None}}, "there is no participant 'structural'"),
        ((), {"extra": 1}, "no place for a participant 'third'"),
        (("structural",), {"scheme_name": "foo"}, "there is no scheme 'foo'"),
        (("structural",), {"scheme_name": "newton-krylov"}, "derivatives of quasi-static solves"),
        (("structural",), {"order": "foo"}, "there is no order 'foo'; choose one of: serial, parallel"),
        (("structural",), {"tolerance": math.nan}, "tolerance must be a number above zero, not nan"),
        (("structural",), {"max_iterations": 0}, "max_iterations must be a whole number of at least 1, not 0"),
        ((), {"order": "foo"}, "there is no order 'foo'"),
        ((), {"scheme_name": "explicit", "omega": 0.3}, "scheme explicit has no parameter 'omega'"),
        ((), {"scheme_name": "explicit", "max_iterations": 2.5}, "a whole number of at least 1, not 2.5"),
        ((), {"tolerance": 0.0}, "tolerance must be a number above zero, not 0.0"),
        ((), {"tolerance": -1.0}, "tolerance must be a number above zero, not -1.0"),
        ((), {"tolerance": "a"}, "tolerance must be a number above zero, not 'a'"),
        ((), {"max_iterations": True}, "a whole number of at least 1, not True"),
        ((), {"stop_time": math.nan}, "stop_time must be a number of at least 0, not nan"),
        ((), {"stop_time": "x"}, "stop_time must be a number of at least 0, not 'x'"),
        ((), {"step": 0}, "step must be a number above zero, not 0"),
        ((), {"step": None}, "step must be a number above zero, not None"),
    ],
)
def test_simulate(participants, change, says):
    given = {"participants": sides(*participants), "stop_time": 0.2, "step": 0.1} | change
    if given.pop("extra", None):
        given["participants"]["third"] = given["participants"]["structural"]
    with pytest.raises(ValueError, match=says) as error:
        simulate(**given)
    assert one_sentence(error)


@pytest.fixture(scope="module")
def section():
    return Coupling.in_process(load("typical_section"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"order": "foo"}, "there is no order 'foo'"),
        ({"max_iterations": 0}, "max_iterations must be a whole number of at least 1, not 0"),
        ({"max_iterations": 1.5}, "not 1.5"),
        ({"max_iterations": None}, "not None"),
        ({"atol": 0.0}, "atol must be a number above zero, not 0.0"),
        ({"atol": math.nan}, "atol must be a number above zero, not nan"),
        ({"force_tolerance": 0.0}, "force_tolerance must be a number above zero, not 0.0"),
        ({"force_tolerance": -1.0}, "not -1.0"),
        ({"force_tolerance": math.nan}, "not nan"),
        ({"force_tolerance": "a"}, "not 'a'"),
    ],
)
def test_solve(section, change, says):
    with pytest.raises(ValueError, match=says) as error:
        solve(section, scheme("iqn-ils"), **change)
    assert one_sentence(error)
    assert section.evaluations == 0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"tolerance": "a"}, "--tolerance must be a number above zero, not 'a'"),
        ({"force_tolerance": None}, "--force-tolerance must be a number above zero, not None"),
        ({"max_iterations": 2.5}, "--max-iterations must be a whole number of at least 1, not 2.5"),
        ({"repeat": 0}, "--repeat must be a whole number of at least 1, not 0"),
        ({"jobs": "a"}, "--jobs .* must be a whole number of at least 0, not 'a'"),
        ({"stop_time": "x"}, "--stop-time must be a number above zero, not 'x'"),
        ({"step": True}, "--step must be a number above zero, not True"),
        ({"sweep": {"wind_speed": 8}}, "sweep takes several values of wind_speed in a list, not 8"),
        ({"sweep": {"integration": "bdf2"}}, "sweep takes several values of integration in a list, not 'bdf2'"),
        ({"orders": "foo"}, "there is no order 'foo'"),
    ],
)
def test_compare(change, says, tmp_path):
    given = {"stop_time": 0.2, "jobs": 0, "out": tmp_path / "out"} | change
    with pytest.raises(ValueError, match=says) as error:
        compare("tether_in_wind", "explicit", **given)
    assert one_sentence(error)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"checkpoint": "q.ckp"}, r"checkpoint must be a pathlib\.Path, not 'q\.ckp'"),
        ({"restart": 3}, r"restart must be a pathlib\.Path, not 3"),
        ({"every": 0}, "--checkpoint-every must be a whole number of at least 1, not 0"),
        ({"every": 1.5}, "not 1.5"),
    ],
)
def test_files(change, says):
    with pytest.raises(ValueError, match=says) as error:
        Files(**change)
    assert one_sentence(error)


@pytest.mark.parametrize("call", ["fields", "present"])
def test_an_order_that_an_exchange_does_not_know(section, call):
    with pytest.raises(ValueError, match="there is no order 'x'; choose one of: serial, parallel"):
        getattr(section, call)("x")
