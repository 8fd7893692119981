"""Packages of SSP 1.0 in `kitecosim couple`: the same bits as the coupling file that says the same."""

import json
import re
import zipfile

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from fmus.builder import build
from fmus.ssp import package
from master import couple
from master.cli import app
from master.fmu_coupling import Document, opened
from tests.fmus.cases import start
from tests.master.ssps import (
    bound,
    component,
    connectors,
    linear,
    link,
    mapping,
    packed,
    parameters,
    structure,
    system,
)
from tests.master.test_couple import coupled
from tests.master.toy_fmus3 import signals_fmu

EXPLICIT = {"time": {"step": 0.1}, "coupling": {"scheme": "explicit"}}
FLUID = connectors(wallPos__x="input m", wallPos__y="input m", loadX="output kN", loadY="output kN")
WALL = connectors(F_1="input N", F_2="input N", q_1="output m", q_2="output m")
FLUID_START = {"stiffness": 3.0, "wallPos__x": "1.0 m", "wallPos__y": "500 mm"}
WALL_START = {"mass": 1.0, "stiffness": 1.0, "q0_1": 1.0, "q0_2": 0.5, "F_1": -3.0, "F_2": -1.5}
LOADS = link("fluid/loadX", "wall/F_1") + link("wall/F_2", "fluid/loadY")  # the other way round, which means nothing
PLACES = link("wall/q_1", "fluid/wallPos.x") + link("wall/q_2", "fluid/wallPos.y")


def same_document(**changes):
    """The coupling file that says what the packages below do."""
    pairs = [("fluid.loadX", "wall.F_1"), ("fluid.loadY", "wall.F_2")]
    pairs += [("wall.q_1", "fluid.wallPos.x"), ("wall.q_2", "fluid.wallPos.y")]
    content = {
        "time": {"stop": 1.0, "step": 0.1},
        "coupling": {"scheme": "explicit"},
        "participants": {
            "fluid": {"fmu": "fluid.fmu", "start": {"stiffness": 3.0, "wallPos.x": 1.0, "wallPos.y": 0.5}},
            "wall": {"fmu": "wall.fmu", "start": WALL_START},
        },
        "connections": [{"from": a, "to": b, "factor": 1000.0 if a.startswith("fluid") else 1.0} for a, b in pairs],
    }
    return content | changes


def plain(fluid=FLUID, wall=WALL, links=LOADS + PLACES, fluid_start=None, wall_start=None):
    """The two of them in one system."""
    fluid_start = bound(parameters(**FLUID_START)) if fluid_start is None else fluid_start
    wall_start = bound(parameters(**WALL_START)) if wall_start is None else wall_start
    elements = component("fluid", "fluid.fmu", fluid + fluid_start) + component("wall", "wall.fmu", wall + wall_start)
    return system("both", elements, links)


@pytest.fixture
def pack(toy_fmus, tmp_path):
    """Packages with the two FMUs."""
    fmus = [toy_fmus / "fluid.fmu", toy_fmus / "wall.fmu"]
    return lambda ssd, **files: packed(tmp_path / "x.ssp", ssd, fmus, **files)


def values(path, settings=EXPLICIT):
    result = couple(Document.read(path, settings))
    assert result.status == "converged", result.message
    return result.values


def test_a_package_gives_the_bits_of_the_file_that_says_the_same(toy_fmus, pack):
    expected = coupled(toy_fmus, same_document()).values
    found = values(pack(structure(plain())))
    assert list(found) == list(expected)
    assert all(np.array_equal(found[name], expected[name]) for name in expected)


def test_nested_systems_are_flat_and_their_transformations_follow_one_another(toy_fmus, pack):
    inner = system(
        "in",
        component("fluid", "fluid.fmu", FLUID),
        link("here", "fluid/wallPos.x")
        + link("fluid/loadX", "push", linear(-2))
        + link("there", "fluid/wallPos.y")
        + link("fluid/loadY", "shove", linear(-2)),
        connectors(here="input mm", there="input", push="output N", shove="output"),
    )
    links = (
        link("in/push", "wall/F_1", linear(-0.5))
        + link("in/shove", "wall/F_2", linear(-500, 0.0), 'suppressUnitConversion="true"')
        + link("wall/q_1", "in/here")
        + link("wall/q_2", "in/there")
    )
    start_values = {f"in.fluid.{name.replace('__', '.')}": value for name, value in FLUID_START.items()}
    start_values |= {f"wall.{name}": value for name, value in WALL_START.items()}
    outer = system("both", inner + component("wall", "wall.fmu", WALL), links, bound(parameters(**start_values)))
    document = Document.read(pack(structure(outer)), EXPLICIT)
    assert list(document.participants) == ["in/fluid", "wall"]
    ways = {str(c): (c.factor, c.offset) for c in document.connections}
    assert ways["in/fluid.loadX -> wall.F_1"] == (1000.0, 0.0)
    assert ways["in/fluid.loadY -> wall.F_2"] == (1000.0, 0.0)
    assert ways["wall.q_1 -> in/fluid.wallPos.x"] == (1.0, 0.0)
    expected = coupled(toy_fmus, same_document()).values
    found = couple(document).values
    assert found["wall.q_1"] == pytest.approx(expected["wall.q_1"], rel=1e-14)  # mm and back, ten roundings
    assert np.array_equal(found["wall.q_2"], expected["wall.q_2"])


def test_units_are_converted_before_a_transformation_or_not_at_all(pack):
    factors = []
    for more in ("", 'suppressUnitConversion="true"'):
        links = (
            link("fluid/loadX", "wall/F_1", linear(2, 7), more) + LOADS[len(link("fluid/loadX", "wall/F_1")) :] + PLACES
        )
        document = Document.read(pack(structure(plain(links=links))), EXPLICIT)
        factors.append([(c.factor, c.offset) for c in document.connections if c.input == "F_1"])
    assert factors == [[(2000.0, 7.0)], [(2.0, 7.0)]]


def test_parameters_of_files_are_mapped_converted_and_transformed(pack):
    sets = {"resources__p_dot_ssv": parameters(k=1.5, x="1200 mm", unused=3.0), "resources__p_dot_ssm": mapping(
        ("k", "stiffness", linear(2)), ("x", "wallPos.x", linear(1, 0.1)), ("none", "offset", ""))}  # fmt: skip
    start_values = bound("resources/p.ssv", mapped="resources/p.ssm")
    document = Document.read(pack(structure(plain(fluid_start=start_values)), **sets), EXPLICIT)
    assert document.participants["fluid"].start == {"stiffness": 3.0, "wallPos.x": pytest.approx(1.3, rel=1e-15)}
    inline = bound(sets["resources__p_dot_ssv"], mapped=sets["resources__p_dot_ssm"])
    same = Document.read(pack(structure(plain(fluid_start=inline))), EXPLICIT)
    assert same.participants["fluid"].start == document.participants["fluid"].start


def test_higher_levels_and_later_sets_have_priority_and_what_nothing_takes_is_told(pack):
    inside = bound(parameters(wall__mass=4.0, wall__none=1.0), parameters(wall__mass=5.0))
    whole = plain(wall_start=bound(parameters(mass=2.0, stiffness=2.0), parameters(stiffness=3.0)))
    document = Document.read(pack(structure(whole.replace('name="both">', f'name="both">{inside}', 1))), EXPLICIT)
    assert document.participants["wall"].start == {"mass": 5.0, "stiffness": 3.0}
    assert document.remarks == ("parameters that nothing takes: wall.none",)


def test_a_parameter_of_a_system_goes_to_all_that_its_connector_is_joined_to(pack):
    inner = connectors(k="parameter", place="input mm") + bound(parameters(k=2.0, place="250 mm"))
    links = LOADS + link("wall/q_2", "fluid/wallPos.y") + link("place", "fluid/wallPos.x")
    links += link("k", "wall/stiffness") + link("k", "fluid/stiffness", linear(10))
    whole = plain(links=links, fluid_start="", wall_start="").replace('name="both">', f'name="both">{inner}', 1)
    document = Document.read(pack(structure(whole)), EXPLICIT)
    assert document.participants["wall"].start == {"stiffness": 2.0}
    assert document.participants["fluid"].start == {"stiffness": 20.0, "wallPos.x": 0.25}
    assert "fluid.wallPos.x" not in [f"{c.target}.{c.input}" for c in document.connections]


def test_values_are_mapped_on_their_way_as_the_tables_say(tmp_path):
    fmu = signals_fmu(tmp_path)
    boolean = "<ssc:BooleanMappingTransformation>{}</ssc:BooleanMappingTransformation>".format(
        "".join(f'<ssc:MapEntry source="{a}" target="true"/>' for a in ("true", "false"))
    )
    integer = "<ssc:IntegerMappingTransformation>{}</ssc:IntegerMappingTransformation>".format(
        "".join(f'<ssc:MapEntry source="{a}" target="{b}"/>' for a, b in ((0, 5), (1, -7), (2, 20)))
    )
    links = link("a/y_Boolean[1]", "b/x_Boolean[1]", boolean) + link("a/y_Int32[2]", "b/x_Int32[1]", integer)
    whole = system("s", component("a", "signals.fmu") + component("b", "signals.fmu"), links)
    document = Document.read(
        packed(tmp_path / "m.ssp", structure(whole), [fmu]), EXPLICIT | {"time": {"stop": 0.1, "step": 0.1}}
    )
    with opened(document) as exchange:
        exchange.evaluate(exchange.present())
        b = exchange.participants["b"]
        assert b.get("x_Boolean").tolist() == [1.0, 0.0]
        assert b.get("x_Int32").tolist() == [-7.0, 0.0]  # of 0 + 1
        exchange.participants["a"].set("x_Int32", [0.0, 9.0])
        with pytest.raises(Exception, match=r"participant b got no input: a\.y_Int32\[2\] is 10, which the map"):
            exchange.evaluate(exchange.present())


def integers(*pairs):
    """A mapping of integers."""
    listed = "".join(f'<ssc:MapEntry source="{a}" target="{b}"/>' for a, b in pairs)
    return f"<ssc:IntegerMappingTransformation>{listed}</ssc:IntegerMappingTransformation>"


def test_a_table_behind_a_factor_looks_up_what_arrives_there(tmp_path):
    fmu = signals_fmu(tmp_path)
    inner = system(
        "in", component("b", "signals.fmu"), link("n", "b/x_Int32[1]", integers((3, 40), (5, 60))),
        connectors(n="input"),
    )  # fmt: skip
    whole = system("s", component("a", "signals.fmu") + inner, link("a/y_Int32[2]", "in/n", linear(2, 1)))
    path, settings = tmp_path / "t.ssp", EXPLICIT | {"time": {"stop": 0.1, "step": 0.1}}
    with opened(Document.read(packed(path, structure(whole), [fmu]), settings)) as exchange:
        exchange.evaluate(exchange.present())
        assert exchange.participants["in/b"].get("x_Int32").tolist() == [40.0, 0.0]  # of 2 (0 + 1) + 1


def test_mappings_without_one_answer_to_what_is_sent_are_refused(tmp_path):
    fmu = signals_fmu(tmp_path)
    elements = component("a", "signals.fmu") + component("b", "signals.fmu")
    for pairs, sentence in (
        (((0, 5), (0, 7)), "does not suit: it has 0 twice, with 5 and 7; leave one of them."),
        ((), "does not suit: nothing that is sent is in it."),
    ):
        whole = system("s", elements, link("a/y_Int32[2]", "b/x_Int32[1]", integers(*pairs)))
        with pytest.raises(ValueError, match=re.escape(sentence)):
            Document.read(packed(tmp_path / "t.ssp", structure(whole), [fmu]), EXPLICIT)


def test_items_of_enumerations_are_mapped_and_started_by_name(tmp_path):
    fmu = signals_fmu(tmp_path)
    swapped = "".join(
        f'<ssc:MapEntry source="{a}" target="{b}"/>' for a, b in (("first", "second"), ("second", "first"))
    )
    swapped = f"<ssc:EnumerationMappingTransformation>{swapped}</ssc:EnumerationMappingTransformation>"
    second = '<ssv:Parameter name="x_gear"><ssv:Enumeration value="second"/></ssv:Parameter>'
    text = parameters().replace("<ssv:Parameters></ssv:Parameters>", f"<ssv:Parameters>{second}</ssv:Parameters>")
    elements = component("a", "signals.fmu", bound(text)) + component("b", "signals.fmu")
    whole = system("s", elements, link("a/y_gear", "b/x_gear", swapped))
    path, settings = tmp_path / "e.ssp", {"time": {"stop": 0.1, "step": 0.1}, "coupling": {"scheme": "explicit"}}
    with opened(Document.read(packed(path, structure(whole), [fmu]), settings)) as exchange:
        assert exchange.participants["a"].get("x_gear") == 2
        exchange.evaluate(exchange.present())
        assert exchange.participants["b"].get("x_gear") == 1
    packed(path, structure(whole.replace('value="second"', 'value="third"')), [fmu])
    with pytest.raises(ValueError, match=r"parameter 'x_gear' for a\.x_gear does not suit: 'third' is no item of its"):
        Document.read(path, settings)


@pytest.mark.parametrize("name", ["typical_section", "tether_in_wind"])
def test_the_package_of_a_scene_gives_the_bits_of_its_two_fmus(tmp_path, name):
    scene = scenes.load(name)
    paths = build(scene, tmp_path, start(scene), reference=False)
    ssp = package(name, paths, tmp_path)
    step = scene.communication_step
    time = {"stop": 3 * step, "step": step} if scene.transient else {"mode": "steady"}
    document = Document.read(ssp, {"time": time, "coupling": {"rtol": 1e-9}})
    links = [{"from": c.field, "to": f"{c.target}.{c.input}"} for c in document.connections]
    assert all("[" not in one["to"] for one in links)  # whole arrays
    participants = {side: {"fmu": f"{name}_{side}.fmu"} for side in ("structural", "aero")}
    content = {"time": time, "coupling": {"rtol": 1e-9}, "participants": participants, "connections": links}
    found, expected = couple(document), couple(Document.of(content, tmp_path))
    assert found.status == expected.status == "converged"
    assert found.evaluations == expected.evaluations
    assert all(np.array_equal(found.values[key], expected.values[key]) for key in expected.values)


DICTIONARY = '<ssd:SignalDictionaries><ssd:SignalDictionary name="d" source="d.ssb"/></ssd:SignalDictionaries>'
REFERENCE = '<ssd:SignalDictionaryReference name="r" dictionary="d"/>'
BUS = '<ssc:Annotation type="org.openmodelica"><Bus xmlns="x" name="b"/></ssc:Annotation>'

# What is written into the package that is right in place of what, and the sentence that answers it.
REFUSED = [
    (
        ("<ssd:Elements>", DICTIONARY + "<ssd:Elements>"),
        "system 'both' has signal dictionaries, which are not supported",
    ),
    (
        ("<ssd:Elements>", "<ssd:Elements>" + REFERENCE),
        "refers to the signal dictionary 'd', and signal dictionaries are not",
    ),
    (
        ("</ssd:System>", f"<ssd:Annotations>{BUS}</ssd:Annotations></ssd:System>"),
        "has the bus 'b', and buses are not supported; connect its signals.",
    ),
    (
        ('version="1.0" name="x"', 'version="2.0" name="x"'),
        "SystemStructure.ssd is of version 2.0 of SSP, and 1.0 is read",
    ),
    (
        ("SystemStructureDescription", "ParameterSet"),
        "holds .*ParameterSet' and not a SystemStructureDescription of SSP 1.0",
    ),
    (("<ssd:Units>", "<ssd:Unit>"), "SystemStructure.ssd is no XML: mismatched tag"),
    (('name="loadX" kind="output"', 'name="loadX" kind="inout"'), "'loadX' of component 'fluid' is of the kind inout"),
    (
        ('name="loadX" kind="output"', 'name="loadX" kind="input"'),
        "fluid.loadX is of the kind input, but its FMU says output",
    ),
    (('name="loadX" kind="output"', 'name="loadX"'), "connector 'loadX' of component 'fluid' lacks the attribute kind"),
    (
        ('<ssc:Real unit="kN"/>', "<ssc:Integer/>"),
        "fluid.loadX is of the type Integer, but its FMU says Real; correct it.",
    ),
    (
        ('unit="kN"', 'unit="mm"'),
        "what arrives at wall.F_1 is in mm and taken in N, which measure different things; define",
    ),
    (
        ('unit="kN"', 'unit="push"'),
        "is in push and taken in N, and nothing says what push is in base units; define the units",
    ),
    (
        ('startConnector="loadX"', 'startConnector="load"'),
        "component 'fluid': fluid.fmu has no variable 'load'; did you mean",
    ),
    (('startElement="fluid"', 'startElement="fluit"'), "names no element 'fluit'; did you mean fluid?"),
    (('startElement="fluid" ', ""), "system 'both' has no connector 'loadX'; it has: none."),
    (
        ('endConnector="F_1"', 'endConnector="q_1"'),
        "joins fluid.loadX and wall.q_1, which both send; join an output and an",
    ),
    (
        ('endConnector="wallPos.y"', 'endConnector="wallPos.x"'),
        "fluid.wallPos.x has two sources, wall.q_1 and wall.q_2; take",
    ),
    (
        ('source="resources/wall.fmu"', 'source="resources/w.fmu"'),
        "component 'wall' has the source 'resources/w.fmu', which the",
    ),
    (
        ('source="resources/wall.fmu"', 'source="../wall.fmu"'),
        "'../wall.fmu', which leads out of the package; put it there.",
    ),
    (
        ('source="resources/wall.fmu"', 'source="http://x.org/w.fmu"'),
        "and only files of the package are read; put it there.",
    ),
    (('source="resources/wall.fmu"', 'source="http://["'), "has the source 'http://\\[', which is no URI; correct it."),
    (('source="resources/wall.fmu"', 'source="a%00b"'), "has the source 'a%00b', which names no file; correct it."),
    (('source="resources/wall.fmu"', 'source="#s"'), "has the source '#s', and references to a part of a file are not"),
    (
        ('name="wall" ', 'name="wall" type="application/x-ssp-package" '),
        "is of the type application/x-ssp-package, which is not",
    ),
    (
        ('name="wall" ', 'name="wall" implementation="ModelExchange" '),
        "component 'wall' asks for model exchange, which is not",
    ),
    (('name="wall" ', 'name="fluid" '), "system 'both' has two elements 'fluid'; give one another name."),
    (
        ('<ssv:Real value="3.0"', '<ssv:Real value="soft"'),
        "parameter 'stiffness' for fluid.stiffness does not suit: 'soft' is no",
    ),
    (
        ('<ssv:Real value="3.0"', '<ssv:Binary value="00"'),
        "parameter 'stiffness' for fluid.stiffness is of the type Binary, which",
    ),
    (
        ("<ssd:ParameterBinding>", '<ssd:ParameterBinding type="text/csv">'),
        "is of the type text/csv, which is not supported",
    ),
    (
        ("<ssd:ParameterBinding>", '<ssd:ParameterBinding source="p.ssv">'),
        "has the source 'p.ssv', which the package does not",
    ),
    (('startTime="0"', 'startTime="now"'), "DefaultExperiment has startTime = 'now', which is no finite number."),
    (
        ("<ssd:Connections>", "<ssd:Conductors/><ssd:Connections>"),
        "holds 'Conductors', which is not supported; take it out.",
    ),
]


@pytest.mark.parametrize(("change", "sentence"), REFUSED, ids=lambda x: x[:40] if isinstance(x, str) else "")
def test_what_is_wrong_or_not_supported_is_refused_in_one_sentence_that_names_it(pack, change, sentence):
    text = structure(plain())
    old, new = change
    assert old in text
    text = text.replace(old, new) if old == "SystemStructureDescription" else text.replace(old, new, 1)
    path = pack(text)
    with pytest.raises(ValueError, match=sentence) as caught:
        Document.read(path, EXPLICIT)
    assert str(caught.value).startswith(f"{path}: ")
    assert "kitecosim." not in str(caught.value)  # the folder that is gone
    assert str(caught.value).endswith((".", "?"))
    assert "\n" not in str(caught.value)


def test_what_does_not_go_together_is_told_in_the_words_of_a_package(tmp_path, pack):
    fmu = signals_fmu(tmp_path)
    mixed = link("a/y_Int32[1]", "b/x_Boolean[1]") + link("b/y_Float32[1]", "a/x_Float32[1]")
    whole = system("s", component("a", "signals.fmu") + component("b", "signals.fmu"), mixed)
    with pytest.raises(
        ValueError, match=r"m\.ssp: a connection: a\.y_Int32\[1\] is Integer, but b\.x_Boolean\[1\] Boolean"
    ):
        Document.read(packed(tmp_path / "m.ssp", structure(whole), [fmu]), EXPLICIT)
    short = plain(fluid_start=bound(parameters(fail_at=0.5)))
    with pytest.raises(
        ValueError, match=r"x\.ssp: parameter fail_at of component fluid does not suit: .*whole numbers"
    ):
        Document.read(pack(structure(short)), EXPLICIT)


def test_units_with_an_offset_and_units_known_by_name_are_converted(pack):
    warm = WALL.replace('unit="m"', 'unit="degC"'), FLUID.replace('unit="m"', 'unit="K"')
    document = Document.read(pack(structure(plain(warm[1], warm[0], fluid_start="", wall_start=""))), EXPLICIT)
    ways = {(c.factor, c.offset) for c in document.connections if c.source == "wall"}
    assert ways == {(1.0, 273.15)}
    feet = WALL.replace('unit="m"', 'unit="ft"')
    document = Document.read(pack(structure(plain(wall=feet, fluid_start="", wall_start=""))), EXPLICIT)
    assert [c.factor for c in document.connections if c.source == "wall"] == pytest.approx([0.3048] * 2, rel=1e-15)


def test_one_component_and_one_that_is_not_connected_are_refused(pack):
    alone = system("s", component("fluid", "fluid.fmu"), "")
    with pytest.raises(ValueError, match="has 1 component; two or more can be coupled"):
        Document.read(pack(structure(alone)), EXPLICIT)
    links = link("a/loadX", "b/F_1")
    third = system(
        "s", "".join(component(n, f) for n, f in (("a", "fluid.fmu"), ("b", "wall.fmu"), ("c", "wall.fmu"))), links
    )
    with pytest.raises(ValueError, match="component c is connected to no other; connect it, or take it out"):
        Document.read(pack(structure(third)), EXPLICIT)


@pytest.mark.parametrize(
    ("entries", "sentence"),
    [
        (
            {"x/SystemStructure.ssd": "<a/>"},
            "has no SystemStructure.ssd at its top; it has x/SystemStructure.ssd: zip the",
        ),
        ({"Variant.ssd": "<a/>"}, "has no SystemStructure.ssd at its top; it has Variant.ssd."),
        ({"modelDescription.xml": "<a/>"}, "has no SystemStructure.ssd at its top; is it a package of SSP?"),
        ({"SystemStructure.ssd": "<a/>", "resources\\a.fmu": ""}, "with a backslash; zip it with / between folders."),
        ({"SystemStructure.ssd": "<a/>", "../a.fmu": ""}, "leads out of the package; zip it anew."),
        ({"SystemStructure.ssd": "<a/>"}, "holds 'a' and not a SystemStructureDescription of SSP 1.0"),
        ({"SystemStructure.ssd": ""}, "SystemStructure.ssd is no XML: no element found"),
    ],
)
def test_archives_that_are_no_package_are_refused_in_one_sentence(tmp_path, entries, sentence):
    path = tmp_path / "bad.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in entries.items():
            archive.writestr(name, text)
    with pytest.raises(ValueError, match=re.escape(sentence)):
        Document.read(path, EXPLICIT)


def test_files_that_are_no_archive_are_refused_in_one_sentence(tmp_path, pack):
    path = tmp_path / "bad.ssp"
    for text, sentence in ((b"", "is no whole zip archive"), (b"PK\x03\x04", "is no whole zip archive")):
        path.write_bytes(text)
        with pytest.raises(ValueError, match=sentence):
            Document.read(path)
    whole = pack(structure(plain())).read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match="is no whole zip archive"):
        Document.read(path)
    with pytest.raises(ValueError, match="there is no file"):
        Document.read(tmp_path / "none.ssp")
    (tmp_path / "folder.ssp").mkdir()
    with pytest.raises(ValueError, match="is a folder; name a package"):
        Document.read(tmp_path / "folder.ssp")


def test_settings_that_a_package_lacks_come_from_the_command_line(pack, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path, run = pack(structure(plain())), CliRunner().invoke
    lacking = run(app, ["couple", str(path), "--no-report"])
    assert lacking.exit_code == 2
    assert "says no step of the time; give --step." in " ".join(lacking.output.split())
    refused = run(app, ["couple", str(path), "--no-report", "--step", "0.1", "--scheme", "iqn"])
    assert "[coupling] scheme is 'iqn', which there is not" in " ".join(refused.output.split())
    done = run(app, ["couple", str(path), "--no-report", "--step", "0.1", "--stop", "0.5", "--scheme", "explicit"])
    assert done.exit_code == 0, done.output
    summary = json.loads((tmp_path / "results/x/summary.json").read_text())
    assert summary["settings"]["stop"] == 0.5
    assert summary["participants"]["wall"]["fmu"] == f"{path}/resources/wall.fmu"
    assert summary["time"] == pytest.approx(0.5)
