"""The package of a scene (SSP 1.0): its schema, its connections, its parameters, its bytes."""

import zipfile
from types import SimpleNamespace

import pytest
from fmpy import read_model_description
from fmpy.ssp.ssd import get_connections, read_ssd, read_ssv
from lxml import etree
from typer.testing import CliRunner

import scenes
from fmus.builder import build
from fmus.ssp import package
from master.cli import app
from tests.fmus.cases import COARSE

STD = "{http://ssp-standard.org/SSP1/System"


@pytest.fixture(scope="module", params=scenes.available())
def packed(request, tmp_path_factory):
    """A scene, its FMUs and its package, with parameters unlike those of the scene where it has them."""
    coarse = COARSE.get(request.param, {}) if "canopy_stations" not in scenes.settings_of(request.param) else {}
    scene, out = scenes.load(request.param, coarse), tmp_path_factory.mktemp("packed")
    given = {"wind_speed": 11.0} if scene.has_flow else {}
    fmus = build(scene, out, given | {"symmetric": 0.0} if scene.name == "v3_kite" else given)
    path = package(scene.name, fmus, out)
    return SimpleNamespace(
        scene=scene,
        path=path,
        fmus=dict(zip(scene.cores(), fmus, strict=True)),
        system=read_ssd(path).system,  # validates against the schema of SSP 1.0
    )


def variables(path, *causalities):
    return [v for v in read_model_description(path).modelVariables if v.causality in causalities]


def test_the_fmus_in_the_package_are_those_beside_it(packed):
    with zipfile.ZipFile(packed.path) as archive:
        for side, path in packed.fmus.items():
            assert archive.read(f"resources/{side}.fmu") == path.read_bytes()


def test_every_input_that_the_other_side_gives_is_connected_to_it_and_no_other_is_a_connector(packed):
    outputs = {(side, v.name) for side, path in packed.fmus.items() for v in variables(path, "output")}
    inputs = {(side, v.name) for side, path in packed.fmus.items() for v in variables(path, "input")}
    other = {"structural": "aero", "aero": "structural"}
    expected = {(other[side], name, side, name) for side, name in inputs if (other[side], name) in outputs}
    got = [(a.parent.name, a.name, b.parent.name, b.name) for a, b in get_connections(packed.system)]
    assert set(got) == expected
    assert len(got) == len(expected)
    if len(packed.fmus) == 2:
        free = {(side, name) for side, name in inputs if name.endswith("_rate")}  # of reeling, set by the host
        assert {(side, name) for _, _, side, name in expected} == inputs - free  # all else is closed on both sides
    connectors = {(c.name, k.name) for c in packed.system.elements for k in c.connectors if k.kind == "input"}
    assert connectors == {(side, name) for _, _, side, name in expected}


def test_connectors_have_the_kind_type_and_unit_of_the_variables(packed):
    with zipfile.ZipFile(packed.path) as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
    units = {unit.get("name") for unit in root.iter(f"{STD}StructureCommon}}Unit")}
    for component in root.iter(f"{STD}StructureDescription}}Component"):
        known = {v.name: v for v in read_model_description(packed.fmus[component.get("name")]).modelVariables}
        connectors = list(component.iter(f"{STD}StructureDescription}}Connector"))
        assert connectors
        for connector in connectors:
            variable, kind = known[connector.get("name")], connector[0]
            assert connector.get("kind") == variable.causality
            assert etree.QName(kind).localname == variable.type
            assert kind.get("unit") == variable.unit
            assert variable.unit is None or variable.unit in units


def test_the_parameter_set_of_a_component_has_all_start_values_and_units_of_its_fmu(packed):
    shared = {}
    for side, path in packed.fmus.items():
        values = read_ssv(packed.path, f"resources/{side}.ssv").parameters
        expected = [(v.name, v.type, v.start, v.unit) for v in variables(path, "parameter")]
        assert [(p.name, p.type, p.value, p.unit) for p in values] == expected
        for name, _, value, _ in expected:
            assert shared.setdefault(name, value) == value  # one value of what both sides have
    assert float(shared.get("wind_speed", 11.0)) == 11.0
    assert packed.scene.name != "v3_kite" or shared["symmetric"] == "false"


def test_step_and_stop_time_are_told_to_every_tool_in_its_own_words(packed):
    with zipfile.ZipFile(packed.path) as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
    experiment = read_model_description(next(iter(packed.fmus.values()))).defaultExperiment
    names = root.nsmap
    (times,) = root.iterfind("ssd:DefaultExperiment", names)
    (osp,) = times.iterfind("ssd:Annotations/ssc:Annotation/osp:Algorithm/osp:FixedStepAlgorithm", names)
    place = "ssd:System/ssd:Annotations/ssc:Annotation/oms:Annotations/oms:SimulationInformation/oms:FixedStepMaster"
    (oms,) = root.iterfind(place, names)
    assert float(times.get("stopTime")) == float(experiment.stopTime)
    assert float(osp.get("baseStepSize")) == float(oms.get("stepSize")) == float(experiment.stepSize)


def test_the_same_fmus_give_the_same_bytes(packed, tmp_path):
    again = package(packed.scene.name, list(packed.fmus.values()), tmp_path)
    assert again.read_bytes() == packed.path.read_bytes()


def test_the_command_writes_the_package_beside_the_fmus_if_asked(tmp_path):
    result = CliRunner().invoke(app, ["build", "typical_section", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    fmus = {f"typical_section_{side}.fmu" for side in ("structural", "aero")}
    assert {path.name for path in tmp_path.iterdir()} == {*fmus, ".kitecosim.json"}  # and what says whose they are
    result = CliRunner().invoke(app, ["build", "typical_section", "--ssp", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert result.stdout.split() == [str(tmp_path / n) for n in [*sorted(fmus)[::-1], "typical_section.ssp"]]


def test_a_place_that_is_taken_is_one_sentence_and_nothing_is_written(tmp_path):
    (tmp_path / "typical_section.ssp").mkdir()
    result = CliRunner().invoke(app, ["build", "typical_section", "--ssp", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert result.stderr.startswith("kitecosim: --out ")
    assert result.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["typical_section.ssp"]


def test_a_folder_that_cannot_be_written_to_is_one_sentence(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("fmus.builder.os.replace", full)
    result = CliRunner().invoke(app, ["build", "typical_section", "--ssp", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "cannot be made a folder (no space left on device)" in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
