"""What the FMUs say of themselves: true, complete, and clean in the eyes of two importers and of the standard."""

import io
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from fmus.aero_fmu import AeroFmu
from fmus.builder import archive
from fmus.structural_fmu import StructuralFmu
from tests.fmus.toy_fmu import Toy, ToyFmu

ROOT = Path(__file__).resolve().parents[2]
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
FMUTOOL = Path(sys.executable).with_name("fmutool")
CLEAN = {"This FMU seems to be compliant with FMI-2.0.", "No semantic error against the FMI-2 standard."}

# Variables up to which FMPy judges a description: its time goes with their square, a minute at ten thousand; what
# they are is the same in smaller scenes.
MOST = 1500

# FMI 2.0.4, section 2.2.7: (causality, variability) -> initial that may stand there; None: the attribute is left out.
ALLOWED = {
    ("parameter", "fixed"): "exact",
    ("parameter", "tunable"): "exact",
    ("input", "discrete"): None,
    ("input", "continuous"): None,
    ("output", "discrete"): "calculated",
    ("output", "continuous"): "calculated",
}


@pytest.fixture(scope="module")
def schema():
    return etree.XMLSchema(etree.parse(SCHEMA))


def description(path):
    """The root of the model description, and its bytes."""
    with zipfile.ZipFile(path) as whole:
        content = whole.read("modelDescription.xml")
    return etree.fromstring(content), content


def fmutool(path):
    """What `fmutool -check` says: (exit code, {(level, sentence)})."""
    done = subprocess.run(
        [FMUTOOL, "-input", path, "-check"], capture_output=True, text=True, timeout=120, check=False, cwd=path.parent
    )
    lines = [line.partition("|") for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    return done.returncode, {(level.strip(), sentence.strip()) for level, _, sentence in lines}


def test_two_importers_and_the_schema_of_the_standard_find_no_fault(case, schema):
    for path in case[1]:
        root = description(path)[0]
        schema.assertValid(root)
        if len(root.find("ModelVariables")) < MOST:
            assert validate_fmu(str(path)) == []
        code, said = fmutool(path)
        assert code == 0
        assert {level for level, _ in said} == {"INFO"}
        assert {sentence for _, sentence in said} >= CLEAN


BROKEN = {
    "an output that is not listed": (r'<Unknown index="\d+" dependencies="" />', "", "Outputs"),
    "two variables of one name": (r'name="tension\[2\]"', 'name="tension[1]"', "tension"),
    "an input without a start value": (r'(<Real unit="Pa") start="0.0"', r"\1", "start value"),
    "a unit that is not there": (r'<Unit name="Pa">', '<Unit name="bar">', "Pa"),
    "a fixed output": (
        'causality="output" variability="continuous"',
        'causality="output" variability="fixed"',
        "fixed",
    ),
    "an attribute that is not of the standard": ("<ModelVariables>", '<ModelVariables colour="red">', "colour"),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_a_fault_does_not_escape_the_checks(scene_paths, tmp_path, schema, fault):
    pattern, replacement, word = BROKEN[fault]
    path = tmp_path / "broken.fmu"
    content, count = re.subn(pattern, replacement, description(scene_paths[0])[1].decode(), count=1)
    assert count == 1
    with zipfile.ZipFile(scene_paths[0]) as whole, zipfile.ZipFile(path, "w") as broken:
        for name in whole.namelist():
            broken.writestr(name, content if name == "modelDescription.xml" else whole.read(name))
    assert any(word in problem for problem in validate_fmu(str(path)))
    if "unit" not in fault:  # units are not among what fmutool looks at
        code, said = fmutool(path)
        assert code != 0
        assert any(level == "ERROR" and word in sentence for level, sentence in said)
    assert schema.validate(description(path)[0]) is ("attribute" not in fault)


def test_every_variable_says_what_it_is_as_the_standard_asks(case):
    for path in case[1]:
        root, _ = description(path)
        units = {unit.get("name"): unit for unit in root.find("UnitDefinitions")}
        scalars = list(root.find("ModelVariables"))
        assert [scalar.get("valueReference") for scalar in scalars] == [str(i) for i in range(len(scalars))]
        assert len({scalar.get("name") for scalar in scalars}) == len(scalars)
        used = set()
        for scalar in scalars:
            kind = scalar[0]
            assert len(scalar.get("description")) > 10
            assert scalar.get("initial") == ALLOWED[scalar.get("causality"), scalar.get("variability")]
            assert kind.tag == "Real" or scalar.get("variability") != "continuous"
            assert ("start" in kind.attrib) is (scalar.get("causality") != "output")
            if kind.tag == "Real":
                used.add(kind.get("unit"))
                assert (kind.get("displayUnit") == "deg") is (kind.get("unit") == "rad")
            if "start" in kind.attrib and kind.tag != "Boolean":
                low, high = float(kind.get("min", "-inf")), float(kind.get("max", "inf"))
                assert low <= float(kind.get("start")) <= high
                assert low < high
        assert used == set(units)
        assert all(unit.find("BaseUnit") is not None for unit in units.values())
        if "rad" in units:
            assert float(units["rad"].find("DisplayUnit").get("factor")) == np.rad2deg(1.0)


def test_outputs_and_initial_unknowns_are_exactly_the_outputs(case):
    for path in case[1]:
        root, _ = description(path)
        scalars = list(root.find("ModelVariables"))
        outputs = [str(i) for i, scalar in enumerate(scalars, 1) if scalar.get("causality") == "output"]
        structure = root.find("ModelStructure")
        assert [unknown.get("index") for unknown in structure.find("Outputs")] == outputs
        assert [unknown.get("index") for unknown in structure.find("InitialUnknowns")] == outputs
        assert {unknown.get("dependencies") for unknown in structure.find("Outputs")} == {""}  # they change in doStep
        assert structure.find("Derivatives") is None


def values(instance):
    """All values of a slave, by the accessors of their types."""
    return [
        float(x)
        for variable, where in instance.blocks.values()
        for x in getattr(instance, f"get_{variable.kind}")(list(range(where.start, where.stop)))
    ]


@pytest.mark.parametrize("side", ["structural", "aero"])
def test_in_initialization_mode_outputs_follow_only_what_they_are_said_to_depend_on(case, side):
    scene, paths = case
    if side not in scene.cores():
        pytest.skip("a scene without flow or without structure")
    root, _ = description(dict(zip(scene.cores(), paths, strict=True))[side])
    names = [scalar.get("name") for scalar in root.find("ModelVariables")]
    sets, claimed = {None: set(names)}, {}  # dependencies left out: everything
    for unknown in root.find("ModelStructure").find("InitialUnknowns"):
        listed = unknown.get("dependencies")
        if listed not in sets:
            sets[listed] = {names[int(index) - 1] for index in listed.split()}
        claimed[names[int(unknown.get("index")) - 1]] = sets[listed]
    slave = {"structural": StructuralFmu, "aero": AeroFmu}[side]
    followed = set()
    for block, (variable, where) in slave(getattr(scene, f"{side}_core")(), instance_name="x").blocks.items():
        if variable.causality == "output":
            continue
        instance = slave(getattr(scene, f"{side}_core")(), instance_name="x")
        references = list(range(where.start, where.stop))
        instance.enter_initialization_mode()
        before = values(instance)
        flip = variable.kind == "boolean"
        given = [1.0 - x if flip else 1.01 * x + 1e-3 * i for i, x in enumerate(before[where], 1)]
        getattr(instance, f"set_{variable.kind}")(references, given)
        after = values(instance)
        assert not instance.log_queue
        changed = {names[i] for i in range(len(names)) if names[i] in claimed and after[i] != before[i]}
        own = {names[k] for k in references}
        followed |= {block} if changed else set()
        assert all(own <= claimed[name] for name in changed)
    if side == "aero":
        assert {"displacement", "wind_speed"} <= followed  # the loads are those of the wing as it starts
    else:
        assert not {"pressure", "shear", "line_load"} & followed  # so that there is no loop at the start


def test_who_made_it_under_which_licence_is_said_and_carried_along(scene_paths):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    licence = (ROOT / "LICENSE").read_bytes()
    for path in scene_paths:
        root, _ = description(path)
        assert root.get("version") == project["version"]
        assert root.get("author") == project["authors"][0]["name"]
        assert root.get("license").startswith(project["license"])
        assert root.get("copyright") in licence.decode()
        assert root.get("generationTool").startswith(f"kitecosim {project['version']}, PythonFMU ")
        assert root.get("variableNamingConvention") == "structured"
        assert root.get("generationDateAndTime") is None  # the same content gives the same bytes
        assert root.find("DefaultExperiment").attrib == {"startTime": "0.0", "stopTime": "60.0", "stepSize": "1.0"}
        with zipfile.ZipFile(path) as whole:
            assert whole.read("documentation/licenses/kitecosim.txt") == licence
            assert b"MIT License" in whole.read("documentation/licenses/pythonfmu.txt")


def guid(files, title="Toy", unit="N"):
    """The GUID of a toy FMU with these files, this description and this unit of its load."""
    toy = Toy()
    slave = ToyFmu(toy, instance_name="toy")
    slave.description = title
    object.__setattr__(toy.variables[3], "unit", unit)
    with zipfile.ZipFile(io.BytesIO(archive("toy", slave, files))) as content:
        return etree.fromstring(content.read("modelDescription.xml")).get("guid")


def test_the_guid_changes_with_any_content_and_with_nothing_else():
    plain = guid({})
    assert guid({}) == plain
    others = [
        guid({"resources/a.csv": b"1"}),
        guid({"resources/a.csv": b"2"}),
        guid({"resources/b.csv": b"1"}),
        guid({}, "Other"),
        guid({}, unit="m"),
    ]
    assert len({plain, *others}) == 6
