"""FMUs run the code that they carry, whatever else their process has loaded."""

import ast
import json
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest

import scenes
from fmus.private import CARRIED, private_code, private_name, rewritten, script_of, sources
from fmus.stored_scene import read_scene, scene_files
from tests.fmus.cases import COARSE
from tests.fmus.importer import START, Importer

ROOT = Path(__file__).parents[2]

TAKEN = """
import sys, types
for name in {taken!r}:
    sys.modules[name] = types.ModuleType(name)
"""
COUPLED = """
(structural, s, one), (aero, a, two) = map(start, sys.argv[1:])
for k in range(3):
    aero.doStep(float(k), 1.0)
    for name in ("pressure", "shear"):
        structural.setReal(s[name], aero.getReal(a[name])) if name in a else None
    structural.doStep(float(k), 1.0)
    aero.setReal(a["displacement"], structural.getReal(s["displacement"]))
print([x.hex() for x in structural.getReal(s["displacement"])])
for name in {taken!r}:
    assert not vars(sys.modules[name]).get("__path__"), f"{{name}} of the host was touched"
for folder in (one, two):
    shutil.rmtree(folder)
state = structural.getFMUstate()
copy = structural.deSerializeFMUstate(structural.serializeFMUstate(state))
structural.doStep(3.0, 1.0)
once = structural.getReal(s["displacement"])
structural.setFMUstate(copy)
structural.doStep(3.0, 1.0)
assert structural.getReal(s["displacement"]) == once
"""
FALLING = """
found = []
for path in sys.argv[1:]:
    slave, references, folder = start(path)
    slave.doStep(0.0, 1.0)
    found.append(slave.getReal(references["support_force"])[2])
    slave.freeInstance()
    shutil.rmtree(folder)
print([x.hex() for x in found])
"""


def host(body, paths, taken=(), binary=None):
    """What a process that knows only fmpy prints, with modules of the names `taken` of its own."""
    script = TAKEN.format(taken=taken) + START + (body.format(taken=taken) if "{taken" in body else body)
    done = subprocess.run(
        [sys.executable, "-I", "-W", "error", "-c", script, *map(str, paths)],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return [float.fromhex(text.strip(" '")) for text in done.stdout.splitlines()[-1][1:-1].split(",")]


def test_a_host_whose_modules_have_all_our_names_runs_the_pair(scene_paths):
    taken = ("scenes", "aero", "structural", "fmus", "interface", "master", "pythonfmu")
    assert host(COUPLED, scene_paths, taken) == host(COUPLED, scene_paths)


def changed(path, out, change):
    """A copy of an FMU with Python files changed by `change(name, text)`."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            text = old.read(name)
            new.writestr(name, change(name, text.decode()).encode() if name.endswith(".py") else text)
    return out


def heavier(name, text):
    """Gravity doubled in the code of the structure."""
    if not name.endswith("cores/structure.py"):
        return text
    found = text.replace('= float(values["gravity"])', '= 2.0 * float(values["gravity"])')
    assert found != text
    return found


@pytest.fixture(scope="module")
def other_version(tmp_path_factory):
    """The structural FMU of the kite built by a project whose code has one constant changed."""
    folder = tmp_path_factory.mktemp("version")
    for room in ("interface", "structural", "aero", "scenes", "fmus"):
        shutil.copytree(ROOT / room, folder / room, ignore=shutil.ignore_patterns("__pycache__"))
    file = folder / "scenes/cores/structure.py"
    file.write_text(heavier("cores/structure.py", file.read_text()))
    script = "import scenes; from fmus.builder import build; build(scenes.load('v3_kite'), 'out', {'trim_angle': 0.0})"
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "out/v3_kite_structural.fmu"


@pytest.fixture(scope="module")
def kite(tmp_path_factory):
    from fmus.builder import build

    return build(scenes.load("v3_kite"), tmp_path_factory.mktemp("kite"), {"trim_angle": 0.0})[0]


@pytest.mark.parametrize("how", ["built", "changed in the file"])
def test_two_versions_in_one_process_each_run_their_own_code(kite, other_version, tmp_path, how):
    heavy = other_version if how == "built" else changed(kite, tmp_path / "other.fmu", heavier)
    alone = host(FALLING, [kite]) + host(FALLING, [heavy])
    assert alone[1] == pytest.approx(2.0 * alone[0], rel=1e-6)  # the tolerance of the equilibrium, N of N
    assert host(FALLING, [kite, heavy, kite]) == [*alone, alone[0]]
    assert host(FALLING, [heavy, kite]) == alone[::-1]


def test_an_fmu_of_other_code_runs_it_in_the_process_that_builds(kite, tmp_path):
    forces = []
    for path in (kite, changed(kite, tmp_path / "other.fmu", heavier), kite):
        with Importer(path) as structural:
            structural.slave.doStep(0.0, 1.0)
            forces.append(structural.get("support_force")[2])
    assert forces[1] == pytest.approx(2.0 * forces[0], rel=1e-6)
    assert forces[2] == forces[0]


def test_imports_of_what_is_carried_and_no_others_are_made_private():
    source = b"""\
import numpy as np
import scenes
import structural.dofs as dofs
from aero.vortex_step import Wing
from . import other
import aerodynamics


def late():
    from fmus import adapter  # of scenes and aero
    import scipy.sparse
"""
    expected = """\
import numpy as np
from k_1 import scenes
import k_1.structural.dofs as dofs
from k_1.aero.vortex_step import Wing
from . import other
import aerodynamics


def late():
    from k_1.fmus import adapter  # of scenes and aero
    import scipy.sparse
"""
    assert rewritten(source, "k_1").decode() == expected


@pytest.mark.parametrize(
    "text",
    [
        "import scenes, numpy",
        "import aero.wind",
        "from  interface import Variable",
        "if True: from interface import Variable",
        "import sys; from interface import Variable; from aero import Wing",
        "import importlib\nimportlib.import_module('interface.vectors')",
    ],
)
def test_an_import_without_a_private_form_is_refused_with_file_and_line(text):
    with pytest.raises(ValueError, match=r"^aero/own.py line \d: no FMU can carry this import of '\w+(\.\w+)*'; write"):
        rewritten(text.encode(), "k_1", "aero/own.py")


@pytest.mark.parametrize("source", [
    b"\xef\xbb\xbffrom interface import Variable\n",
    b"# -*- coding: latin-1 -*-\nfrom interface import Variable\nname = '\xe9'\n",
    b"from interface import Variable\r\nimport scenes\r\n",
    b'"""Of waves.\n\nimport aero, then fly.\n"""\nfrom interface import Variable\n',
])  # fmt: skip
def test_sources_of_any_encoding_and_line_ends_are_carried(source):
    text = rewritten(source, "k_1").decode()
    assert "from k_1.interface import Variable\n" in text
    assert text[0] != "\ufeff"
    ast.parse(text)


def test_no_private_module_imports_a_carried_package_by_its_usual_name():
    code = private_code(sources(), "k_1")
    for path, text in code.items():
        for node in ast.walk(ast.parse(text)):
            names = [node.module] if isinstance(node, ast.ImportFrom) and not node.level else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not {name.partition(".")[0] for name in names}.intersection(CARRIED), path


def test_nothing_but_imports_is_rewritten():
    for path, text in sources().items():
        old, new = (ast.parse(t) for t in (text, rewritten(text, "k_1")))
        for tree in (old, new):
            for node in ast.walk(tree):
                for field, value in ast.iter_fields(node):
                    if isinstance(value, list):
                        kept = [v for v in value if not isinstance(v, ast.Import | ast.ImportFrom)]
                        setattr(node, field, kept)
        assert ast.dump(old) == ast.dump(new), path


def test_the_private_name_follows_the_content():
    code = sources()
    name = private_name(code)
    assert re.fullmatch(r"kitecosim_[0-9a-f]{8}", name)
    path = next(iter(code))
    assert private_name({**code, path: code[path] + b"\n"}) != name
    assert private_name(dict(code)) == name


def test_a_script_looks_for_its_code_after_docstring_and_future_imports():
    text = script_of(b'"""Doc."""\n\nfrom __future__ import annotations\n\nimport scenes\n', "k_1").decode()
    lines = text.splitlines()
    assert lines[:3] == ['"""Doc."""', "", "from __future__ import annotations"]
    assert lines[4].startswith("__import__('k_1').require(")
    assert lines[5] == "from k_1 import scenes"


@pytest.mark.parametrize("name", [*scenes.available()])
@pytest.mark.parametrize("side", ["structural", "aero"])
def test_a_stored_scene_makes_the_core_of_its_side_bitwise(tmp_path, name, side):
    scene = scenes.load(name, COARSE.get(name, {}))
    if side not in scene.cores():
        pytest.skip("there is no such side")
    for file, content in scene_files(scene, side, {"wind_speed": 11.0}).items():
        (tmp_path / file).write_bytes(content)
    carried, parameters = read_scene(tmp_path)
    assert parameters == {"wind_speed": 11.0}
    ours, theirs = (getattr(s, f"{side}_core")() for s in (scene, carried))
    assert [v.name for v in theirs.variables] == [v.name for v in ours.variables]
    for core in (ours, theirs):
        core.step(0.0, scene.communication_step)
    for name in ours.names:
        assert theirs.get(name).tobytes() == ours.get(name).tobytes(), name


def test_a_scene_of_another_layout_is_refused_in_one_sentence(kite, tmp_path):
    folder = Path(fmpy.extract(str(kite), str(tmp_path / "fmu"))) / "resources"
    content = json.loads((folder / "scene.json").read_text())
    (folder / "scene.json").write_text(json.dumps(content | {"layout": 7}))
    with pytest.raises(ValueError, match=r"^scene.json has the layout 7; this FMU reads 1: build it anew\.$"):
        read_scene(folder)
    archive = shutil.make_archive(str(tmp_path / "other"), "zip", tmp_path / "fmu")
    told = []
    with pytest.raises(Exception, match="instantiate"):
        fmpy.simulate_fmu(archive, stop_time=1.0, logger=lambda *message: told.append(message))
    assert [text for *_, text in told] == [b"ValueError: scene.json has the layout 7; this FMU reads 1: build it anew."]


@pytest.mark.parametrize("change", ["npz", "tree", "fields"])
def test_a_damaged_scene_is_refused_in_one_sentence(tmp_path, change):
    files = scene_files(scenes.load("typical_section"), "aero", {})
    content = json.loads(files["scene.json"])
    if change == "npz":
        files["scene.npz"] = files["scene.npz"][:100]
    elif change == "tree":
        content["scene"] = {"of": "os:system", "fields": {}}
    else:
        del content["scene"]["fields"]["name"]
    files["scene.json"] = json.dumps(content).encode()
    for file, data in files.items():
        (tmp_path / file).write_bytes(data)
    with pytest.raises(ValueError, match=r"^scene.json and scene.npz hold no scene \(.*\); build the FMU anew\.$"):
        read_scene(tmp_path)


def test_a_stored_scene_holds_numbers_and_texts_only():
    files = scene_files(scenes.load("v3_kite_detailed", {"canopy_stations": 2}), "structural", {})
    assert files.keys() == {"scene.json", "scene.npz"}
    assert b"pickle" not in files["scene.npz"]
    loaded = np.load(__import__("io").BytesIO(files["scene.npz"]), allow_pickle=False)
    assert all(loaded[name].dtype.kind in "fib" for name in loaded)


def test_notices_come_from_the_folder_of_the_scene_and_nowhere_else(tmp_path):
    from fmus.builder import build

    folder = shutil.copytree(scenes.load("typical_section").folder, tmp_path / "plate")
    (tmp_path / "secret").write_text("secret")
    (folder / "SOURCES.md").unlink(missing_ok=True)
    (folder / "SOURCES.md").symlink_to(tmp_path / "secret")
    (folder / "LICENSE-gone").symlink_to(tmp_path / "nowhere")
    (folder / "LICENSES").mkdir()
    (folder / "LICENSE.md").write_text("ours")
    path = build(scenes.load(folder), tmp_path / "out", reference=False)[0]
    with zipfile.ZipFile(path) as archive:
        carried = {name for name in archive.namelist() if name.startswith("documentation/scene/")}
    assert {name.rpartition("/")[2] for name in carried} - {"LICENSE.txt"} == {"LICENSE.md"}


def test_code_that_changed_since_it_was_loaded_is_not_taken_for_that_of_an_fmu(tmp_path):
    for room in ("interface", "structural", "aero", "scenes", "fmus"):
        shutil.copytree(ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__"))
    script = """
import pathlib, scenes, time
time.sleep(0.05)
file = pathlib.Path("scenes/cores/structure.py")
file.write_text(file.read_text() + "\\n# changed\\n")
from fmus import builder
builder.build(scenes.load("typical_section"), "out", reference=False)
print(builder.LOADED[0])
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == ""


def test_an_fmu_carries_the_method_that_its_scene_names_alone(kite):
    with zipfile.ZipFile(kite) as archive:
        methods = {Path(n).stem for n in archive.namelist() if "/aero/methods/" in n}
    assert methods == {"__init__", "vortex_step"}


def test_no_folder_of_this_machine_is_in_a_binary(kite):
    with zipfile.ZipFile(kite) as archive:
        for name in archive.namelist():
            if name.startswith("binaries/linux64/"):
                assert sys.base_prefix.encode() not in archive.read(name)
