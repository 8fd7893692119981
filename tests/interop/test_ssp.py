"""A package of both FMUs, opened by the tools that read SSP: the exchange is that of a plain loop over the cores."""

import csv
import re
import sys
import zipfile
from functools import cache

import numpy as np
import pytest

import scenes
from fmus.description import scalar_names
from tests.docs.pages import checked
from tests.interop import tools
from tests.interop.tools import PAGE

SCENE, WIND, STEPS = "v3_kite", 12.0, 8  # begun from zero, the tenth step is discarded
LOADS = ("pressure", "shear", "line_load")
COMPARED = (("structural", "displacement"), *(("aero", name) for name in LOADS))

# The FMUs do what the cores do and no tool changes a value on its way: nothing but zero is expected. A library that
# sums in another order would give 1e-12 of the largest value, another order of exchange 1e-2 and more.
SAME = 1e-9


def program(*words, folder):
    """A program of this Python that has to succeed."""
    done = tools.program([sys.executable, *words], folder)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def folder(shell):
    """A folder with the scripts of the page, and the package built as the page says."""
    build = ["-m", "master", "build", SCENE, "--ssp", "--set", f"wind_speed={WIND:g}", "--out", "my_fmus"]
    program(*build, folder=shell.folder)
    return shell.folder


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
        aero.look()  # before the first step: the loads on the wing as it starts
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
    return float(max(apart))


def extracted(folder, name, changes):
    """A folder with the content of the package, values of parameters changed in every .ssv that has them."""
    place = folder / name
    with zipfile.ZipFile(folder / "my_fmus" / f"{SCENE}.ssp") as package:
        package.extractall(place)
    for file in (place / "resources").glob("*.ssv"):
        text = file.read_text()
        for parameter, value in changes.items():
            text = re.sub(rf'(name="{parameter}">\s*<ssv:\w+ value=")[^"]*', rf"\g<1>{value}", text)
        file.write_text(text)
    return place


def test_libcosim_passes_start_values_on_and_then_steps_all_components_from_the_step_before(folder, row):
    row.of_package("libcosimpy, SSP", "libcosimpy", "parallel", "libcosimpy.CosimExecution")
    program("ssp_libcosim.py", f"my_fmus/{SCENE}.ssp", str(STEPS), "libcosim.csv", folder=folder)
    row.difference = difference(folder / "libcosim.csv", loop("settled"))
    assert row.difference <= SAME
    assert difference(folder / "libcosim.csv", loop("zero")) > 1e-3  # so that what begins differently shows


@pytest.mark.parametrize("changes", [{"wind_speed": 13.0}, {"trim_angle": 0.05}], ids=str)
def test_a_value_that_is_changed_in_the_package_is_what_the_fmus_start_from(changes, folder):
    tools.Row().of_package("libcosimpy, SSP", "libcosimpy", "parallel", "libcosimpy.CosimExecution")
    name = f"with_{next(iter(changes))}"
    extracted(folder, name, changes)
    program("ssp_libcosim.py", name, str(STEPS), f"{name}.csv", folder=folder)
    assert difference(folder / f"{name}.csv", loop("settled", **changes)) <= SAME
    assert difference(folder / f"{name}.csv", loop("settled")) > 1e-3


@pytest.mark.parametrize(("begin", "order"), [("zero", "parallel, from zero"), ("start", "parallel")])
def test_fmpy_steps_all_components_from_the_step_before(begin, order, folder, row):
    row.of_package("fmpy, SSP", "fmpy", order)
    program("ssp_fmpy.py", f"my_fmus/{SCENE}.ssp", str(STEPS), f"{begin}.csv", begin, folder=folder)
    row.difference = difference(folder / f"{begin}.csv", loop(begin))
    assert row.difference <= SAME


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


def test_the_page_shows_what_its_commands_print(shell):
    tools.Row().of_package("libcosimpy, SSP", "libcosimpy", "parallel", "libcosimpy.CosimExecution")
    for section in ("An SSP package", "FMI 3.0"):
        wrong = checked(PAGE, shell, section)
        assert not wrong, "\n".join(wrong)
