"""Participants of FMI 3.0 in `kitecosim couple`: our own pair bitwise as that of FMI 2.0, and another maker's types."""

import re

import numpy as np
import pytest

import scenes
from fmus import builder
from fmus.builder import build
from master import couple
from master.coupling.checkpoint import Files
from master.fmu_coupling.document import Document
from master.fmu_coupling.mapping import Described, MappedParticipant, Naming
from tests.fmus.cases import start
from tests.master.toy_fmus3 import KINDS, signals_fmu

own_binary = pytest.mark.skipif(
    builder.own_binary() is None, reason="not run: no C compiler was there when the project was installed"
)


@pytest.fixture(scope="module")
def signals(tmp_path_factory):
    """The folder with signals.fmu, of FMI 3.0."""
    return signals_fmu(tmp_path_factory.mktemp("signals")).parent


def pair(folder, versions, time, coupling, blocks=("pressure",), named=None):
    """The coupling of the pair of a scene in `folder`; `versions` are those of FMI of aero and structural."""
    scene = next(folder.glob("*_aero.fmu")).name.removesuffix("_aero.fmu")
    names = [
        f"{scene}_{side}{'_fmi3' * (v == 3)}.fmu" for side, v in zip(("aero", "structural"), versions, strict=True)
    ]
    back = named or {"displacement": "displacement"}
    return Document.of(
        {
            "time": time,
            "coupling": coupling,
            "participants": {
                "aero": {"fmu": names[0], "blocks": named or {}},
                "structural": {"fmu": names[1], "blocks": named or {}},
            },
            "connections": [
                *({"from": f"aero.{b}", "to": f"structural.{b}"} for b in blocks),
                *({"from": f"structural.{b}", "to": f"aero.{b}"} for b in back),
            ],
            "results": {"record": ["structural.displacement"]},
        },
        folder,
    )


@own_binary
def test_the_pair_of_fmi_3_is_coupled_as_that_of_fmi_2_to_the_last_bit_also_mixed_and_by_element(tmp_path):
    scene = scenes.load("typical_section")
    for options in ({"fmi": 3}, {"reference": False}):
        build(scene, tmp_path, start(scene), **options)
    steady = {"mode": "steady"}, {"rtol": 1e-9}
    expected = couple(pair(tmp_path, (2, 2), *steady))
    assert expected.status == "converged"
    nodes = Described(tmp_path / "typical_section_aero.fmu").blocks["displacement"]
    names = [f"displacement[{i + 1},{j + 1}]" for i, j in np.ndindex(nodes)]
    for versions, named in (((3, 3), None), ((3, 2), None), ((2, 3), None)):
        found = couple(pair(tmp_path, versions, *steady, named=named))
        assert found.evaluations == expected.evaluations
        assert np.array_equal(found.values["structural.displacement"], expected.values["structural.displacement"])
    explicit = {"stop": 5.0, "step": 1.0}, {"scheme": "explicit"}
    whole = couple(pair(tmp_path, (2, 2), *explicit))
    apart = couple(pair(tmp_path, (3, 3), *explicit, named={name: name for name in names}))
    assert np.array_equal(whole.values["structural.displacement"], apart.values["structural.displacement"])


@own_binary
def test_states_of_the_pair_of_fmi_3_are_restored_and_continued_as_those_of_fmi_2(tmp_path):
    scene = scenes.load("tether_in_wind")
    for options in ({"fmi": 3}, {"reference": False}):
        build(scene, tmp_path, start(scene), **options)
    described = Described(tmp_path / "tether_in_wind_aero.fmu")
    loads = tuple(b for b in ("pressure", "shear", "line_load") if b in described.blocks)
    sent = {b: b for b in ("displacement", "velocity") if b in described.blocks}
    step = scene.communication_step
    implicit = {"stop": 4 * step, "step": step}, {"rtol": 1e-9}
    two, three = (
        couple(pair(tmp_path, (v, v), *implicit, loads, sent), files=Files(tmp_path / f"{v}.ckp", 2)) for v in (2, 3)
    )
    assert two.status == three.status == "converged"
    assert two.evaluations == three.evaluations > 4
    assert np.array_equal(two.values["structural.displacement"], three.values["structural.displacement"])
    half = {"stop": 2 * step, "step": step}, {"rtol": 1e-9}
    begun = couple(pair(tmp_path, (3, 3), *half, loads, sent), files=Files(tmp_path / "half.ckp", 2))
    assert begun.status == "converged", begun.message
    assert not begun.remarks
    rest = couple(pair(tmp_path, (3, 3), *implicit, loads, sent), files=Files(restart=tmp_path / "half.ckp"))
    assert np.array_equal(rest.values["structural.displacement"], three.values["structural.displacement"])


@pytest.mark.parametrize("kind", KINDS)
def test_every_type_is_set_and_got_whole_and_by_entry(signals, kind):
    names = {"second": f"x_{kind}[{'2,3' if kind == 'Float64' else '2'}]"}
    with MappedParticipant(signals / "signals.fmu", {n: Naming(v) for n, v in names.items()}) as fmu:
        begun = fmu.get(f"x_{kind}")
        high = 1.0 if kind == "Boolean" else 100.0
        fmu.set("second", high)
        begun[(-1,) * begun.ndim] = high
        assert np.array_equal(fmu.get(f"x_{kind}"), begun)
        values = np.arange(begun.size).reshape(begun.shape) * 1.0
        fmu.set(f"x_{kind}", values)
        fmu.step(0.0, 0.1)
        expected = {"Boolean": 1.0 - values, "Float64": 2.0 * values}.get(kind, values + 1.0)
        assert np.array_equal(fmu.get(f"y_{kind}"), expected)


def test_an_enumeration_is_carried_as_a_whole_number(signals):
    with MappedParticipant(signals / "signals.fmu", start={"x_gear": 2}) as fmu:
        assert fmu.get("x_gear") == 2
        fmu.step(0.0, 0.1)
        assert fmu.get("y_gear") == 2


def test_single_precision_is_rounded_once_and_doubles_not_at_all(signals):
    with MappedParticipant(signals / "signals.fmu") as fmu:
        fmu.set("x_Float32", [0.1, 1.0 / 3.0])
        fmu.set("x_Float64", np.full((2, 3), 0.1))
        assert fmu.get("x_Float32").tolist() == [float(np.float32(0.1)), float(np.float32(1.0 / 3.0))]
        assert np.array_equal(fmu.get("x_Float64"), np.full((2, 3), 0.1))


def test_start_values_of_entries_leave_the_others_as_the_model_description_has_them(signals):
    names = {"a": Naming("x_Float64[1,1]"), "b": Naming("x_Float64[2,2]")}
    with MappedParticipant(signals / "signals.fmu", names, {"a": -1.0, "b": -5.0, "label": "one"}) as fmu:
        assert fmu.get("x_Float64").tolist() == [[-1.0, 2.0, 3.0], [4.0, -5.0, 6.0]]
        assert (0, "label one") in fmu.fmu.messages
    both = {"x_Float64": np.full((2, 3), 7.0), "b": -5.0}
    with MappedParticipant(signals / "signals.fmu", names, both) as fmu:
        assert fmu.get("x_Float64").tolist() == [[7.0, 7.0, 7.0], [7.0, -5.0, 7.0]]


def test_another_name_of_a_variable_is_that_variable(signals):
    with MappedParticipant(signals / "signals.fmu") as fmu:
        fmu.step(0.0, 0.1)
        assert np.array_equal(fmu.get("matrix"), fmu.get("y_Float64"))


def test_a_restored_state_repeats_a_step_and_its_bytes_do_so_in_another_instance(signals):
    with MappedParticipant(signals / "signals.fmu") as fmu, MappedParticipant(signals / "signals.fmu") as other:
        fmu.step(0.0, 0.1)
        state = fmu.save()
        data = fmu.serialised(state)
        fmu.step(0.1, 0.1)
        expected = fmu.get("y_Float64")
        fmu.restore(state)
        fmu.step(0.1, 0.1)
        assert np.array_equal(fmu.get("y_Float64"), expected)
        fmu.free(state)
        copy = other.deserialised(data)
        other.restore(copy)
        other.free(copy)
        other.step(0.1, 0.1)
        assert np.array_equal(other.get("y_Float64"), expected)


@pytest.mark.parametrize(
    ("block", "value", "sentence"),
    [
        ("x_Int8", [0, 128], r"block 'x_Int8' must be between -128 and 127, not 128"),
        ("x_UInt8", [0, 201], r"block 'x_UInt8' must be between 0 and 200, not 201"),
        ("x_UInt16", [-1, 0], r"block 'x_UInt16' must be between 0 and 65535, not -1"),
        ("x_Int64", [2.0**60, 0], r"block 'x_Int64' must be between"),
        ("x_Float32", [1e39, 0], r"block 'x_Float32' must be between"),
        ("x_Int32", [0.5, 0], "block 'x_Int32' takes whole numbers"),
        ("x_Float64", [1.0, 2.0], r"block 'x_Float64' has shape \(2, 3\), not \(2,\)"),
        ("rows", 3, "block 'rows' cannot be set, its causality is structuralParameter"),
        ("image", 3, "has 'image' as binary data, and only numbers can be exchanged; leave it out"),
        ("tick", 3, "has 'tick' as a clock, and only numbers can be exchanged; leave it out"),
        (
            "sample",
            3,
            "has 'sample' as a value at the ticks of a clock, and only numbers can be exchanged; leave it out",
        ),
        ("labels", 3, "has 'labels' as an array of texts, and only numbers can be exchanged; leave it out"),
    ],
)
def test_what_a_type_does_not_hold_is_refused_before_anything_is_run(signals, block, value, sentence):
    with pytest.raises(ValueError, match=sentence):
        Described(signals / "signals.fmu").raw(block, value)


@pytest.mark.parametrize(
    ("name", "sentence"), [("labels", "'labels' is an array of texts"), ("x_Int8", "takes numbers")]
)
def test_a_text_for_what_takes_none_is_refused(signals, name, sentence):
    with pytest.raises(ValueError, match=f"{sentence}; texts go to: label"):
        Described(signals / "signals.fmu").require_text(name)


def test_a_whole_number_that_no_double_holds_is_refused_by_name(signals):
    with MappedParticipant(signals / "signals.fmu") as fmu:
        fmu.step(0.0, 0.1)
        with pytest.raises(ValueError, match=r"'far' holds 1152921504606846977, beyond 2\^53"):
            fmu.get("far")


def ring(trouble=0, **coupling):
    """Two of them in a ring through their matrices, halved on the way."""
    return {
        "time": {"stop": 0.3, "step": 0.1},
        "coupling": coupling,
        "participants": {
            "a": {"fmu": "signals.fmu", "start": {"trouble": trouble}},
            "b": {"fmu": "signals.fmu"},
        },
        "connections": [
            {"from": "a.y_Float64", "to": "b.x_Float64", "factor": 0.25},
            {"from": "b.y_Float64", "to": "a.x_Float64", "factor": 0.25, "offset": 1.0},
            {"from": "a.y_Boolean", "to": "b.x_Boolean"},
        ],
        "results": {"record": ["a.y_Float64", "b.y_Float64", "b.y_Boolean"]},
    }


def test_a_ring_of_arrays_is_solved_in_every_step(signals):
    # y = 2 x + sum so far, so that with x_b = y_a / 4 and x_a = y_b / 4 + 1 the first step has y_a = 8 / 3, y_b = 4 / 3
    a = b = total_a = total_b = 0.0
    for _ in range(3):
        # y_a = 2 x_a + S_a, y_b = 2 x_b + S_b
        a = (2.0 + 0.5 * total_b + total_a) / 0.75
        b = 0.5 * a + total_b
        total_a, total_b = total_a + 0.25 * b + 1.0, total_b + 0.25 * a
    result = couple(Document.of(ring(rtol=1e-12), signals))
    assert result.status == "converged", result.message
    assert result.values["a.y_Float64"] == pytest.approx(np.full((2, 3), a), rel=1e-10)  # three steps to 1e-12
    assert result.values["b.y_Boolean"].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("trouble", "sentence"),
    [
        (2, "participant a refused a step: the step is too large"),
        (-2, r"participant a asks to end the simulation at 0\.15 s"),
        (102, "ended with fmi3Fatal: there is no way on"),
    ],
)
def test_a_step_that_is_discarded_ends_or_is_fatal_ends_the_run_with_what_the_fmu_says(signals, trouble, sentence):
    result = couple(Document.of(ring(trouble=trouble, scheme="explicit", recoveries=0), signals))
    assert result.status != "converged"
    assert re.search(sentence, result.message)
    assert result.time == pytest.approx(0.1)
