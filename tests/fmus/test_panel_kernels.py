"""Compiled kernels of the panel method in FMUs: carried where panels are, loaded from there, with the same numbers."""

import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fmus import builder
from fmus.private import libraries
from tests.fmus.panel_fmu import Body, BodyFmu
from tests.fmus.test_private import host

POINT = [0.3, 1.7, -0.4]
STARTED = """
from pathlib import Path
found, folders = [], []
for path in sys.argv[1:]:
    slave, references, folder = start(path)
    {before}
    slave.setReal(references["point"], [0.3, 1.7, -0.4])
    slave.doStep(0.0, 1.0)
    found += slave.getReal(references["potential"]) + slave.getReal(references["velocity"])
    found += map(float, slave.getBoolean(references["in_c"]))
    folders.append(folder)
lines = Path("/proc/self/maps").read_text().splitlines()
mapped = {{line.split(maxsplit=5)[5] for line in lines if line.endswith("/_kernels.so")}}
{after}
print([x.hex() for x in found])
"""
EACH_ITS_OWN = """
assert len(mapped) == len(folders), mapped
assert all(any(file.startswith(str(folder)) for file in mapped) for folder in folders), mapped
"""


def archived(path):
    path.write_bytes(builder.archive("body", BodyFmu(Body(), instance_name="body"), {}))
    return path


def in_process():
    body = Body()
    body.set("point", POINT)
    body.step(0.0, 1.0)
    return [*body.get("potential"), *body.get("velocity"), float(body.get("in_c"))]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    if not libraries():
        pytest.skip("not run: no C compiler was there when the project was installed")
    return archived(tmp_path_factory.mktemp("body") / "body.fmu")


def test_an_fmu_runs_the_kernels_that_it_carries_and_has_the_numbers_of_this_process_bitwise(path):
    found = host(STARTED.format(before="", after=EACH_ITS_OWN), [path])
    assert found == in_process()
    assert found[-1] == 1.0


def test_kernels_load_from_a_folder_that_was_deleted_after_instantiation(path):
    found = host(STARTED.format(before="shutil.rmtree(folder)", after=""), [path])
    assert found == in_process()


def test_kernels_load_from_a_folder_that_cannot_be_written(path):
    before = "import os; [os.chmod(p, 0o555) for p in (Path(folder), *Path(folder).rglob('*')) if p.is_dir()]"
    after = "[os.chmod(p, 0o755) for f in folders for p in (Path(f), *Path(f).rglob('*')) if p.is_dir()]"
    assert host(STARTED.format(before=before, after=EACH_ITS_OWN + after), [path]) == in_process()


def test_fmus_with_different_kernels_in_one_process_load_each_its_own(path, monkeypatch, tmp_path):
    ((name, file),) = libraries().items()
    other = tmp_path / "other.so"
    other.write_bytes(file.read_bytes() + bytes(8))  # what follows the sections of a library is not loaded
    monkeypatch.setattr(builder, "libraries", lambda: {name: other})
    second = archived(tmp_path / "second.fmu")
    assert host(STARTED.format(before="", after=EACH_ITS_OWN), [path, second]) == 2 * in_process()


def test_an_fmu_without_kernels_has_the_same_numbers_to_rounding(monkeypatch, tmp_path):
    monkeypatch.setattr(builder, "libraries", dict)
    found = host(STARTED.format(before="", after="assert not mapped"), [archived(tmp_path / "plain.fmu")])
    assert found[-1] == 0.0
    # Sums of a few terms of order one.
    assert np.array(found[:-1]) == pytest.approx(np.array(in_process()[:-1]), rel=1e-12, abs=1e-13)


def test_fmus_of_scenes_without_panels_carry_nothing_of_the_panel_method(scene_paths):
    for fmu in scene_paths:
        with zipfile.ZipFile(fmu) as archive:
            assert not [name for name in archive.namelist() if "aero/panel" in name or "_kernels" in name]


def test_no_folder_of_this_machine_is_in_the_carried_kernels(path):
    with zipfile.ZipFile(path) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith("aero/panel/_kernels.so")]
        content = archive.read(name)
    assert sys.base_prefix.encode() not in content
    assert str(Path(builder.__file__).parents[1]).encode() not in content
