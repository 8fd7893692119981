"""Signals that are no real numbers, elements of arrays, units and bounds in couplings of other makers' FMUs."""

import numpy as np
import pytest

from master import couple
from master.fmu_coupling.document import Document
from master.fmu_coupling.units import by_name
from tests.master.guests import coupling, guest, lin

SCHEMES = ["explicit", "relaxation", "aitken", "iqn-ils", "iqn-imvj"]
MODE = (
    '<SimpleType name="Mode"><Enumeration><Item name="off" value="1"/><Item name="cruise" value="2"/>'
    '<Item name="boost" value="5"/></Enumeration></SimpleType>'
)


def coupled(folder, content, **options):
    return couple(Document.of(content, folder), **options)


def refusal(folder, content):
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the caller looks at the sentence
        Document.of(content, folder)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def thermostat(folder):
    """A room that a heater warms, and a control that counts its switches and has a mode; all three are sent back."""
    guest(
        folder,
        "room",
        [("on", 0, "input", "Boolean", ""), ("level", 0, "input", "Integer", ""), ("T", 0, "output", "Real", ""),
         ("mode", 1, "input", "Enumeration", 'declaredType="Mode" start="1"')],
        types=MODE,
        begin="r[0] = 18.0; k[1] = 1",
        step="r[0] += h * (b[0] ? 0.5 * (k[0] + k[1]) : -1.0)",
    )  # fmt: skip
    guest(
        folder,
        "control",
        [("T", 0, "input", "Real", ""), ("on", 0, "output", "Boolean", ""), ("level", 0, "output", "Integer", ""),
         ("mode", 1, "output", "Enumeration", 'declaredType="Mode"')],
        types=MODE,
        begin="k[1] = 1",
        step="b[0] = t > 0.45 || r[0] < 16.0; k[0] = (int)floor(10.0 * (t + 0.5 * h)); k[1] = t > 0.65 ? 5 : 2",
    )  # fmt: skip


def by_hand(steps, step):
    """Room and control by their equations: level and mode follow the time, the heater the time and the temperature."""
    T, found = 18.0, []
    for n in range(steps):
        t = n * step
        level, mode = int(np.floor(10.0 * (t + 0.5 * step))), 5 if t > 0.65 else 2
        on = t > 0.45  # the room never falls below 16
        T += step * (0.5 * (level + mode) if on else -1.0)
        found.append((T, on, level, mode))
    return found


@pytest.mark.parametrize("order", ["serial", "parallel"])
@pytest.mark.parametrize("scheme", SCHEMES[1:])
def test_whole_numbers_that_are_sent_back_are_passed_on_as_they_are(tmp_path, scheme, order):
    thermostat(tmp_path)
    links = [("control.on", "room.on"), ("control.level", "room.level"), ("control.mode", "room.mode"),
             ("room.T", "control.T")]  # fmt: skip
    seen = []
    content = coupling({"room": "room", "control": "control"}, links, scheme=scheme, order=order, predictor="quadratic")
    result = coupled(tmp_path, content, follow=lambda n, t, r, values: seen.append(dict(values)))
    assert result.status == "converged", result.message
    assert not result.steps.messages
    for values, (T, on, level, mode) in zip(seen[1:], by_hand(10, 0.1), strict=True):
        assert (values["control.on"], values["control.level"], values["control.mode"]) == (on, level, mode)
        assert values["room.T"] == pytest.approx(T, rel=1e-6)  # the tolerance of a step


def test_whole_numbers_are_not_interpolated_over_substeps(tmp_path):
    thermostat(tmp_path)
    links = [("control.level", "room.level"), ("control.on", "room.on"), ("room.T", "control.T")]
    room = {"fmu": "room.fmu", "substeps": 4}
    result = coupled(tmp_path, coupling({"control": "control", "room": room}, links))
    assert result.status == "converged", result.message
    assert result.values["control.level"] == 9


def test_a_whole_number_that_never_repeats_is_named_with_what_helps(tmp_path):
    flip = [("u", 0, "input", "Boolean", ""), ("y", 1, "output", "Boolean", "")]
    guest(tmp_path, "same", flip, step="b[1] = b[0]")
    guest(tmp_path, "other", flip, step="b[1] = !b[0]")
    links = [("a.y", "b.u"), ("b.y", "a.u")]
    result = coupled(tmp_path, coupling({"a": "same", "b": "other"}, links))
    assert result.status == "max_iterations"
    assert "b.y has a residual of 1 and is passed on as it is, a whole number" in result.message
    assert coupled(tmp_path, coupling({"a": "same", "b": "other"}, links, scheme="explicit")).status == "converged"


VECTOR = [(f"in[{i}]", i, "input", "Real", "") for i in (1, 2, 3)] + [
    (f"out[{i}]", 10 + i, "output", "Real", "") for i in (1, 2, 3)
]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_elements_of_arrays_have_their_own_names_in_connections_start_and_record(tmp_path, scheme):
    guest(tmp_path, "vector", VECTOR, step="for (int i = 1; i < 4; i++) r[10 + i] = i * r[i]")
    lin(tmp_path)
    vector = {"fmu": "vector.fmu", "start": {"in[2]": 7.0}}
    links = [("a.out[1]", "b.u"), ("b.y", "a.in[1]")]
    content = coupling({"a": vector, "b": "lin"}, links, scheme=scheme, record=["a.out[2]", "a.out[1]", "a.in[3]"])
    result = coupled(tmp_path, content)
    assert result.status == "converged", result.message
    assert Document.of(content, tmp_path).unconnected() == ["a.in[3]"]
    assert (result.values["a.out[2]"], result.values["a.in[3]"]) == (14.0, 0.0)
    if scheme != "explicit":
        assert result.values["a.out[1]"] == pytest.approx(2.0, rel=1e-5)  # y = 1 + y / 2


def test_an_element_and_its_array_do_not_both_get_a_source(tmp_path):
    guest(tmp_path, "vector", VECTOR)
    links = [("a.out", "b.in"), ("a.out[2]", "b.in[2]")]
    assert "in[2] of b has a source already" in refusal(tmp_path, coupling({"a": "vector", "b": "vector"}, links))


UNITS = (
    '<Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit><Unit name="m"><BaseUnit m="1"/></Unit>'
    '<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit><Unit name="K"><BaseUnit K="1"/></Unit>'
    '<Unit name="degF"><BaseUnit K="1" factor="0.5555555555555556" offset="255.3722222222222"/></Unit>'
)
TYPES = '<SimpleType name="Length"><Real unit="mm"/></SimpleType>'


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
@pytest.mark.parametrize(
    ("sent", "wanted", "value", "arrives", "units"),
    [
        ('unit="mm"', 'unit="m"', 1000.0, 1.0, UNITS),
        ('declaredType="Length"', 'unit="m"', 1000.0, 1.0, UNITS),
        ('unit="m"', 'declaredType="Length"', 2.0, 2000.0, UNITS),
        ('unit="degC"', 'unit="K"', 20.0, 293.15, UNITS),
        ('unit="K"', 'unit="degC"', 293.15, 20.0, UNITS),
        ('unit="degF"', 'unit="degC"', 212.0, 100.0, UNITS),
        ('unit="degC" relativeQuantity="true"', 'unit="K" relativeQuantity="true"', 20.0, 20.0, UNITS),
        ('unit="km/h"', 'unit="m/s"', 36.0, 10.0, ""),  # defined by neither FMU
        ('unit="rev/min"', 'unit="rad/s"', 60.0, 2.0 * np.pi, ""),
        ('unit="N.mm"', 'unit="J"', 1000.0, 1.0, ""),
        ('unit="m"', 'unit="m"', 3.0, 3.0, ""),
        ('unit="parsec_of_our_own"', 'unit="parsec_of_our_own"', 3.0, 3.0, ""),
    ],
)
def test_declared_units_are_converted(tmp_path, sent, wanted, value, arrives, units, scheme):
    guest(tmp_path, "probe", [("x", 0, "output", "Real", sent), ("y", 1, "input", "Real", "")], units, TYPES,
          begin=f"r[0] = {value!r}")  # fmt: skip
    guest(tmp_path, "rig", [("x", 0, "input", "Real", wanted), ("seen", 1, "output", "Real", "")], units, TYPES,
          step="r[1] = r[0]")  # fmt: skip
    links = [("probe.x", "rig.x"), ("rig.seen", "probe.y")]
    result = coupled(tmp_path, coupling({"probe": "probe", "rig": "rig"}, links, stop=0.2, scheme=scheme))
    assert result.values["rig.seen"] == pytest.approx(arrives, rel=1e-14)  # a few operations


@pytest.mark.parametrize(
    ("sent", "wanted", "says"),
    [
        ('unit="mm"', 'unit="K"', "probe.x is in mm, rig.x in K, which measure different things; give factor"),
        ('unit="Hz"', 'unit="rad/s"', "of which one counts cycles and the other angles, both without a dimension"),
        ('unit="rpm"', 'unit="kHz"', "of which one counts cycles and the other angles, both without a dimension"),
        ('unit="degC"', 'unit="K" relativeQuantity="true"', "of which one is a difference (relativeQuantity) and"),
        ('unit="mm"', 'unit="smidgens_of_ours"', "nothing says what smidgens_of_ours is in base units; give factor"),
    ],
)
def test_units_that_cannot_be_converted_are_refused_unless_a_factor_is_given(tmp_path, sent, wanted, says):
    guest(tmp_path, "probe", [("x", 0, "output", "Real", sent)], UNITS, TYPES, begin="r[0] = 1.0")
    guest(tmp_path, "rig", [("x", 0, "input", "Real", wanted)], UNITS if "K" in wanted else "", TYPES)
    assert says in refusal(tmp_path, coupling({"probe": "probe", "rig": "rig"}, [("probe.x", "rig.x")]))
    content = coupling({"probe": "probe", "rig": "rig"}, [("probe.x", "rig.x", {"factor": 3.0, "offset": 1.0})])
    content["results"] = {"record": ["rig.x"]}
    assert coupled(tmp_path, content).values["rig.x"] == 4.0


def test_entries_of_one_block_may_have_units_of_their_own(tmp_path):
    sent = [("a", 0, "output", "Real", 'unit="mm"'), ("b", 1, "output", "Real", 'unit="m"')]
    guest(tmp_path, "probe", sent, UNITS, begin="r[0] = 1000.0; r[1] = 2.0")
    wanted = [(f"x[{i}]", i, "input", "Real", 'unit="m"') for i in (1, 2)]
    guest(tmp_path, "rig", wanted, UNITS)
    probe = {"fmu": "probe.fmu", "blocks": {"both": ["a", "b"]}}
    content = coupling({"probe": probe, "rig": "rig"}, [("probe.both", "rig.x")], record=["rig.x"])
    assert coupled(tmp_path, content).values["rig.x"].tolist() == [1.0, 2.0]


def test_a_unit_at_one_end_only_is_remarked_upon(tmp_path):
    guest(tmp_path, "probe", [("x", 0, "output", "Real", 'unit="mm"')], UNITS)
    lin(tmp_path)
    document = Document.of(coupling({"probe": "probe", "b": "lin"}, [("probe.x", "b.u")]), tmp_path)
    assert "probe.x -> b.u (mm)" in document.remarks[0]


def test_names_of_units_are_read_as_modelica_and_others_write_them():
    for one, other in (("m/s2", "m/s^2"), ("N.m", "J"), ("kg.m2/s2", "Nm"), ("W/(m2.K)", "kg/(s3.K)"), ("Hz", "1/s"),
                       ("°C", "degC"), ("m²", "m2"), ("%", "cm/m")):  # fmt: skip
        a, b = by_name(one), by_name(other)
        assert a is not None
        assert b is not None
        assert a.exponents == b.exponents
        assert (a.factor, a.offset) == pytest.approx((b.factor, b.offset), rel=1e-15)
    assert by_name("furlongs_of_ours") is None


KINDS = {"Real": "r", "Integer": "k", "Boolean": "b", "Enumeration": "k"}


@pytest.mark.parametrize("sent", KINDS)
@pytest.mark.parametrize("wanted", KINDS)
def test_an_input_is_connected_to_what_it_can_take_always_or_the_types_are_named(tmp_path, sent, wanted):
    more = {"Enumeration": 'declaredType="Mode"'}
    guest(tmp_path, "source", [("y", 0, "output", sent, more.get(sent, ""))], types=MODE, begin="k[0] = 1; b[0] = 1")
    start = ' start="1"' if wanted == "Enumeration" else ""
    guest(tmp_path, "sink", [("u", 0, "input", wanted, more.get(wanted, "") + start)], types=MODE)
    content = coupling({"a": "source", "b": "sink"}, [("a.y", "b.u")], record=["b.u", "a.y"])
    wider = {("Boolean", "Integer"), ("Boolean", "Real"), ("Integer", "Real"), ("Enumeration", "Integer"),
             ("Enumeration", "Real")}  # fmt: skip
    if sent == wanted or (sent, wanted) in wider:
        values = coupled(tmp_path, content).values
        assert values["b.u"] == values["a.y"]
    else:
        assert f"a.y is {sent}, but b.u {wanted}" in refusal(tmp_path, content)


@pytest.mark.parametrize(
    ("kind", "value", "says"),
    [
        ("Boolean", 2, "takes true or false (1 or 0), not 2."),
        ("Boolean", 0.5, "takes true or false (1 or 0), not 0.5."),
        ("Integer", 0.5, "takes whole numbers, not 0.5."),
        ("Integer", 3_000_000_000, "takes whole numbers of 32 bits."),
        ("Integer", 8, "must be between 0 and 7, not 8."),
        ("Integer", True, "takes whole numbers, not true or false."),
        ("Real", True, "takes numbers, not true or false."),
        ("Enumeration", 9, "takes one of the items off (1), cruise (2), boost (5), not 9."),
        ("Enumeration", "warp", "takes one of the items off (1), cruise (2), boost (5), not 'warp'."),
    ],
)
def test_start_values_of_another_type_are_refused_before_the_run(tmp_path, kind, value, says):
    more = {"Enumeration": 'declaredType="Mode" start="1"', "Integer": 'declaredType="Small" start="1"'}.get(kind, "")
    types = MODE + '<SimpleType name="Small"><Integer min="0" max="7"/></SimpleType>'
    guest(tmp_path, "sink", [("v", 0, "parameter", kind, more), ("u", 5, "input", "Real", "")], types=types)
    lin(tmp_path)
    sink = {"fmu": "sink.fmu", "start": {"v": value}}
    assert says in refusal(tmp_path, coupling({"a": "lin", "b": sink}, [("a.y", "b.u")]))


def test_items_of_an_enumeration_are_start_values_by_name_too(tmp_path):
    listed = [(f"mode[{i}]", i, "input", "Enumeration", 'declaredType="Mode" start="1"') for i in (1, 2)]
    guest(tmp_path, "modes", [*listed, ("u", 5, "input", "Real", "")], types=MODE)
    lin(tmp_path)
    for start, found in (({"mode": ["boost", 2]}, [5, 2]), ({"mode[2]": "cruise"}, [0, 2])):
        modes = {"fmu": "modes.fmu", "start": start}
        content = coupling({"a": "lin", "b": modes}, [("a.y", "b.u")], record=["b.mode"])
        assert coupled(tmp_path, content).values["b.mode"].tolist() == found


def test_factors_of_whole_numbers_are_whole(tmp_path):
    guest(tmp_path, "count", [("n", 0, "output", "Integer", ""), ("m", 1, "input", "Integer", "")], begin="k[0] = 3")
    for factor, offset in ((2.0, 1.0), (0.5, 0.0), (1.0, 0.5)):
        links = [("a.n", "b.m", {"factor": factor, "offset": offset})]
        content = coupling({"a": "count", "b": "count"}, links, record=["b.m"])
        if factor == 2.0:
            assert coupled(tmp_path, content).values["b.m"] == 7
        else:
            assert "b.m is Integer and takes whole numbers; make factor and offset whole." in refusal(tmp_path, content)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_value_beside_a_bound_by_rounding_is_put_there_and_one_beyond_is_left_to_the_fmu(tmp_path, scheme):
    valve = [("open", 0, "input", "Real", 'min="0" max="1"'), ("flow", 1, "output", "Real", "")]
    guest(tmp_path, "valve", valve, step="r[1] = r[0]; if (r[0] < 0.0 && r[0] > -0.1) return 3")
    for sent, arrives in ((-1e-18, 0.0), (1.0 + 1e-7, 1.0), (-0.5, -0.5), (1.5, 1.5)):
        sender = [("flow", 0, "input", "Real", ""), ("open", 1, "output", "Real", "")]
        guest(tmp_path, "sender", sender, begin=f"r[1] = {sent!r}")
        links = [("ctl.open", "valve.open"), ("valve.flow", "ctl.flow")]
        result = coupled(tmp_path, coupling({"valve": "valve", "ctl": "sender"}, links, scheme=scheme))
        assert result.status == "converged", result.message
        assert result.values["valve.flow"] == pytest.approx(arrives, rel=1e-12)  # converged, of a constant
        beyond = arrives == sent
        assert any("valve.open was sent" in remark for remark in result.remarks) == beyond


@pytest.mark.parametrize("predictor", ["linear", "quadratic"])
def test_predictions_and_updates_stay_within_the_bounds_of_the_inputs(tmp_path, predictor):
    valve = [("open", 0, "input", "Real", 'min="0" max="1"'), ("flow", 1, "output", "Real", "")]
    guest(tmp_path, "valve", valve, step="r[1] += h * r[0]; if (r[0] < 0.0 || r[0] > 1.0) return 3")
    sender = [("flow", 0, "input", "Real", ""), ("open", 1, "output", "Real", "")]
    guest(tmp_path, "sender", sender, step="r[1] = fmin(1.0, fmax(0.0, 3.0 * (t + h) - 0.8 - r[0]))")
    links = [("ctl.open", "valve.open"), ("valve.flow", "ctl.flow")]
    for factor in (1.0, -2.0):  # bounds go back through factor and offset
        links[0] = (*links[0][:2], {"factor": 1.0 / factor, "offset": 0.0})
        sent = f"r[1] = {factor} * fmin(1.0, fmax(0.0, 3.0 * (t + h) - 0.8 - r[0]))"
        guest(tmp_path, "sender", sender, step=sent)
        result = coupled(tmp_path, coupling({"valve": "valve", "ctl": "sender"}, links, predictor=predictor))
        assert result.status == "converged", result.message
        assert not result.steps.messages  # nothing had to be recovered


def test_bounds_hold_in_the_unit_of_the_block_that_has_them(tmp_path):
    bounds = [("open", 0, "input", "Real", 'min="0" max="1"'), ("flow", 1, "output", "Real", "")]
    guest(tmp_path, "valve", bounds, step="r[1] += h * r[0]; if (r[0] < 0.0 || r[0] > 1.0) return 3")
    sender = [("flow", 0, "input", "Real", ""), ("open", 1, "output", "Real", "")]
    for factor in (1e-3, -1.0, 1e3):
        sent = f"r[1] = {factor} * fmin(1.0, fmax(0.0, 3.0 * (t + h) - 0.8 - r[0]))"
        guest(tmp_path, "sender", sender, step=sent)
        valve = {"fmu": "valve.fmu", "blocks": {"lift": {"variables": "open", "factor": factor}}}
        links = [("ctl.open", "valve.lift"), ("valve.flow", "ctl.flow")]
        result = coupled(tmp_path, coupling({"valve": valve, "ctl": "sender"}, links))
        assert result.status == "converged", result.message
        assert not result.steps.messages  # nothing was predicted beyond the bounds and refused
        scaled = coupled(tmp_path, coupling(
            {"valve": "valve", "ctl": "sender"},
            [("ctl.open", "valve.open", {"factor": 1.0 / factor, "offset": 0.0}), links[1]],
        ))  # fmt: skip
        assert result.evaluations == scaled.evaluations  # as where the connection has the factor


def test_a_whole_number_beyond_the_bounds_of_an_input_is_remarked_upon_and_never_clipped(tmp_path):
    guest(tmp_path, "count", [("n", 0, "output", "Integer", ""), ("m", 1, "input", "Integer", 'max="100000000"')],
          begin="k[0] = 100000001")  # fmt: skip
    result = coupled(tmp_path, coupling({"a": "count", "b": "count"}, [("a.n", "b.m")], record=["b.m"]))
    assert result.values["b.m"] == 100000001  # one more than the bound, within the rounding of a Real
    assert any("b.m was sent 1e+08, which lies beyond its bounds" in remark for remark in result.remarks)


def test_integers_start_anywhere_in_their_32_bits(tmp_path):
    guest(tmp_path, "count", [("n", 0, "output", "Integer", ""), ("m", 1, "input", "Integer", "")])
    for value in (-(2**31), 2**31 - 1):
        content = coupling({"a": "count", "b": {"fmu": "count.fmu", "start": {"m": value}}}, [("a.n", "b.m")])
        Document.of(content, tmp_path)
    for value in (-(2**31) - 1, 2**31):
        content["participants"]["b"]["start"]["m"] = value
        assert "takes whole numbers of 32 bits" in refusal(tmp_path, content)


@pytest.mark.parametrize(
    ("output", "pairs", "sentence"),
    [
        ("on", [[0, 1], [0, 0], [1, 1]], "map does not suit: it has 0 twice, with 1 and 0; leave one of them."),
        ("on", [[2, 1], [0, 0], [1, 1]], "map has 2 for a.on, which sends true or false (1 or 0)."),
        ("on", [[0, float("nan")]], "map must be pairs of numbers"),
        ("y", [[0, 0], [1, 1]], "a.y is Real, and a map is of discrete values; use factor and offset."),
    ],
)
def test_a_map_has_one_answer_to_each_value_that_its_output_may_send(tmp_path, output, pairs, sentence):
    guest(tmp_path, "flag", [("on", 0, "output", "Boolean", ""), ("y", 1, "output", "Real", ""),
                             ("off", 2, "input", "Boolean", "")])  # fmt: skip
    content = coupling({"a": "flag", "b": "flag"}, [(f"a.{output}", "b.off", {"map": pairs})])
    assert sentence in refusal(tmp_path, content)


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_a_value_that_becomes_nan_in_the_run_names_participant_and_variable(tmp_path, scheme):
    lin(tmp_path)
    lin(tmp_path, "late", step="r[1] = t > 0.45 ? NAN : 1.0 + 0.5 * r[0]")
    links = [("late.y", "b.u"), ("b.y", "late.u")]
    for order in ({"b": "lin", "late": "late"}, {"late": "late", "b": "lin"}):  # sent back, or sent on
        result = coupled(tmp_path, coupling(order, links, scheme=scheme))
        assert result.status == "diverged"
        assert result.time == pytest.approx(0.5)
        fed_back = next(iter(order)) == "b"
        assert ("late.y" if fed_back else "participant late sent y = nan") in result.message
        assert ". (" not in result.message


@pytest.mark.parametrize("order", ["serial", "parallel"])
@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_an_output_that_is_no_item_before_the_first_step_is_stood_in_for_by_the_start_of_its_input(
    tmp_path, order, scheme
):
    mode = 'declaredType="Mode"'
    guest(tmp_path, "late", [("T", 0, "input", "Real", ""), ("mode", 0, "output", "Enumeration", mode)], types=MODE,
          step="k[0] = 2")  # fmt: skip
    guest(tmp_path, "room", [("mode", 0, "input", "Enumeration", f'{mode} start="5"'), ("T", 0, "output", "Real", "")],
          types=MODE, begin="k[0] = 5", step="r[0] += h * k[0]")  # fmt: skip
    links = [("late.mode", "room.mode"), ("room.T", "late.T")]
    content = coupling({"room": "room", "late": "late"}, links, scheme=scheme, order=order)
    result = coupled(tmp_path, content)
    assert result.status == "converged", result.message
    first = 5.0 if scheme == "explicit" else 2.0  # explicit: the first step has the start value
    assert result.values["room.T"] == pytest.approx(0.1 * (first + 9 * 2.0), rel=1e-12)
    says = "late.mode is no item of its enumeration before the first step; the start value of room.mode stands in for"
    assert any(says in remark for remark in result.remarks), result.remarks


def test_a_value_that_an_input_does_not_take_names_what_sent_it(tmp_path):
    mode = 'declaredType="Mode"'
    guest(tmp_path, "sender", [("mode", 0, "output", "Enumeration", mode)], types=MODE, begin="k[0] = 1",
          step="k[0] = t > 0.45 ? 3 : 2")  # fmt: skip
    guest(tmp_path, "room", [("mode", 0, "input", "Enumeration", f'{mode} start="5"')], types=MODE, begin="k[0] = 5")
    result = coupled(tmp_path, coupling({"a": "sender", "room": "room"}, [("a.mode", "room.mode")]))
    assert result.status == "diverged"
    assert (
        "takes one of the items off (1), cruise (2), boost (5), not 3 (participant a sent mode = 3)" in result.message
    )


@pytest.mark.parametrize("order", ["serial", "parallel"])
@pytest.mark.parametrize("scheme", SCHEMES[1:])
def test_a_loop_without_a_fixed_point_never_converges_by_the_rounding_of_unknowns_that_it_blew_up(
    tmp_path, scheme, order
):
    lin(tmp_path, gain=1.0)  # y = 1 + u twice: x = x + 2
    links = [("a.y", "b.u"), ("b.y", "a.u")]
    for start in ({}, {"u": 0.0}):  # the loop of the initialisation has none either
        content = coupling({"a": {"fmu": "lin.fmu", "start": start}, "b": "lin"}, links, scheme=scheme, order=order)
        assert coupled(tmp_path, content).status in ("diverged", "stalled")
