"""A package of both FMUs, opened by the tools that read SSP: the exchange is that of a plain loop over the cores."""

import csv
import os
import re
import subprocess
import sys
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import scenes
from fmus.description import scalar_names
from tests.docs.pages import DOCS, blocks, differences, give_files

PAGE = DOCS / "_ssp_part.md"
SCENE, WIND, STEPS = "v3_kite", 12.0, 10
LOADS = ("pressure", "shear", "line_load")
COMPARED = (("structural", "displacement"), *(("aero", name) for name in LOADS))

# The FMUs do what the cores do and no tool changes a value on its way: nothing but zero is expected. A library that
# sums in another order would give 1e-12 of the largest value, another order of exchange 1e-2 and more.
SAME = 1e-9


def program(*words, folder):
    """What a program of this Python prints, with the packages of this checkout; it takes a few seconds."""
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(DOCS.parent)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the scripts of the page, and the package built as the page says."""
    folder = tmp_path_factory.mktemp("ssp")
    give_files(PAGE, folder)
    program("-m", "master", "build", SCENE, "--ssp", "--set", f"wind_speed={WIND:g}", "--out", "pair", folder=folder)
    return folder


@pytest.fixture(scope="module")
def libcosim(folder):
    """Skips where libcosimpy is not there or cannot load its library."""
    done = subprocess.run(
        [sys.executable, "-c", "from libcosimpy.CosimExecution import CosimExecution as E; E.from_step_size(10**9)"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    if done.returncode != 0:
        pytest.skip(f"not run: {done.stderr.strip().splitlines()[-1]}")
    return folder


@cache
def names():
    variables = {(side, v.name): v for side, core in scenes.load(SCENE).cores().items() for v in core.variables}
    return [[f"{side}.{name}" for name in scalar_names(variables[side, block])] for side, block in COMPARED]


def loop(begin, steps=STEPS, **parameters):
    """The compared blocks after every step of a loop over the cores: both step, then all values go over.

    `begin`, what is given to the first step: "zero" is nothing but zeros; "start" the outputs that each core starts
    with; "settled" the displacement that the structure starts with, and the loads on the wing so displaced.
    """
    scene = scenes.load(SCENE)
    cores = scene.cores()
    structural, aero = cores["structural"], cores["aero"]
    for core in (structural, aero):
        for name, value in scene.with_trim({"wind_speed": WIND}).items():
            if name in {v.name for v in core.variables}:
                core.set(name, np.array(parameters.get(name, value)))

    def exchange():
        loads = {name: aero.get(name) for name in LOADS}
        aero.set("displacement", structural.get("displacement"))
        for name, values in loads.items():
            structural.set(name, values)

    if begin == "zero":
        aero.set("displacement", np.zeros_like(structural.get("displacement")))
        for name in LOADS:
            structural.set(name, np.zeros_like(aero.get(name)))
    else:
        exchange()
        if begin == "settled":
            exchange()
    rows = []
    for k in range(steps):
        structural.step(float(k), 1.0)
        aero.step(float(k), 1.0)
        rows.append([np.ravel(cores[side].get(block)) for side, block in COMPARED])
        exchange()
    return [np.array(block) for block in zip(*rows, strict=True)]


def difference(path, expected):
    """The largest difference of a written table from a loop, of the largest value of each block."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(expected[0])
    apart = []
    for block, values in zip(names(), expected, strict=True):
        got = np.array([[float(row[name]) for name in block] for row in rows])
        apart.append(np.abs(got - values).max() / np.abs(values).max())
    return max(apart)


def extracted(folder, name, changes):
    """A folder with the content of the package, values of parameters changed in every .ssv that has them."""
    place = folder / name
    with zipfile.ZipFile(folder / "pair" / f"{SCENE}.ssp") as package:
        package.extractall(place)
    for file in (place / "resources").glob("*.ssv"):
        text = file.read_text()
        for parameter, value in changes.items():
            text = re.sub(rf'(name="{parameter}">\s*<ssv:\w+ value=")[^"]*', rf"\g<1>{value}", text)
        file.write_text(text)
    return place


def test_libcosim_passes_start_values_on_and_then_steps_all_components_from_the_step_before(libcosim, record_property):
    program("ssp_libcosim.py", f"pair/{SCENE}.ssp", str(STEPS), "libcosim.csv", folder=libcosim)
    apart = difference(libcosim / "libcosim.csv", loop("settled"))
    record_property("difference", apart)
    assert apart <= SAME
    assert difference(libcosim / "libcosim.csv", loop("zero")) > 1e-3  # so that what begins differently shows


@pytest.mark.parametrize("changes", [{"wind_speed": 13.0}, {"trim_angle": 0.05}], ids=str)
def test_a_value_that_is_changed_in_the_package_is_what_the_fmus_start_from(changes, libcosim):
    name = f"with_{next(iter(changes))}"
    extracted(libcosim, name, changes)
    program("ssp_libcosim.py", name, str(STEPS), f"{name}.csv", folder=libcosim)
    assert difference(libcosim / f"{name}.csv", loop("settled", **changes)) <= SAME
    assert difference(libcosim / f"{name}.csv", loop("settled")) > 1e-3


@pytest.mark.parametrize("begin", ["zero", "start"])
def test_fmpy_steps_all_components_from_the_step_before(begin, folder, record_property):
    program("ssp_fmpy.py", f"pair/{SCENE}.ssp", str(STEPS), f"{begin}.csv", begin, folder=folder)
    apart = difference(folder / f"{begin}.csv", loop(begin))
    record_property("difference", apart)
    assert apart <= SAME


def fmpy_table(folder, steps, changes):
    """The file that the script for fmpy writes for a package with changed values."""
    place = extracted(folder, f"fmpy_{next(iter(changes))}", changes)
    with zipfile.ZipFile(folder / "changed.ssp", "w") as package:
        for path in sorted(place.rglob("*.*")):
            package.write(path, path.relative_to(place))
    program("ssp_fmpy.py", "changed.ssp", str(steps), "changed.csv", "start", folder=folder)
    return folder / "changed.csv"


@pytest.mark.parametrize("changes", [{"wind_speed": 13.0}, {"trim_angle": 0.05}], ids=str)
def test_fmpy_starts_from_the_parameter_set_that_it_is_given(changes, folder):
    table = fmpy_table(folder, STEPS, changes)
    assert difference(table, loop("start", **changes)) <= SAME
    assert difference(table, loop("start")) > 1e-3


def test_a_boolean_that_is_false_in_the_package_is_false_in_both_fmus(folder):
    with fmpy_table(folder, 1, {"symmetric": "false"}).open(newline="") as file:
        (row,) = csv.DictReader(file)
    for side in ("structural", "aero"):
        assert row[f"{side}.symmetric"] == row[f"{side}.symmetry_used"] == "False"


def test_the_page_shows_what_its_commands_print(libcosim):
    shown = [block for block in blocks(PAGE) if block.kind in ("sh", "text")]
    for commands, printed in zip(shown[::2], shown[1::2], strict=True):
        output = ""
        for line in commands.text.splitlines():
            words = line.split()
            words = ["-m", "master", *words[1:]] if Path(words[0]).name == "kitecosim" else words[1:]
            output += program(*words, folder=libcosim)
        assert not differences(printed.text, output)
