"""What an FMU carries beside its solver: reference results, a drawing, an icon, notes."""

import csv
import html
import re
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest

import scenes
from fmus.builder import build, own_binary
from fmus.picture import VIEWS, drawing
from fmus.reference import STEPS, reference_tables
from tests.fmus.cases import PLAIN, label
from tests.fmus.importer import Importer


def entries(path):
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def table(content):
    """Names and rows of a CSV file."""
    names, *rows = csv.reader(content.decode().splitlines())
    return names, [[float(x) for x in row] for row in rows]


@pytest.mark.parametrize("case", PLAIN, indirect=True, ids=label)
def test_the_script_on_the_page_finds_the_reference_results_to_the_last_bit(case, tmp_path):
    for path in case[1]:
        folder = tmp_path / path.stem
        fmpy.extract(str(path), folder)
        page = (folder / "documentation" / "index.html").read_text(encoding="utf-8")
        script = html.unescape(re.search("<pre>(.*?)</pre>", page, re.DOTALL)[1])
        done = subprocess.run(
            [sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, timeout=120, check=False
        )
        assert done.stdout == "largest difference 0.0\n", done.stderr


@pytest.mark.parametrize("case", PLAIN, indirect=True, ids=label)
def test_an_importer_that_sets_each_row_and_steps_finds_them_too(case):
    for path in case[1]:
        files = entries(path)
        given, expected = (table(files[f"documentation/{path.stem}_{kind}.csv"]) for kind in ("in", "ref"))
        assert [row[0] for row in given[1]] == [float(k) for k in range(STEPS)]
        assert [row[0] for row in expected[1]] == [float(k) for k in range(STEPS + 1)]
        with Importer(path) as fmu:
            of_type = {kind: [n for n in expected[0][1:] if fmu.types[n] == kind] for kind in set(fmu.types.values())}
            places = [fmu.references[name] for name in given[0][1:]]
            for now, (t, *row) in zip(expected[1][1:], given[1], strict=True):
                fmu.slave.setReal(places, row)
                fmu.slave.doStep(t, 1.0)
                found = {}
                for kind, names in of_type.items():
                    if names:
                        values = getattr(fmu.slave, f"get{kind}")([fmu.references[name] for name in names])
                        found |= dict(zip(names, values, strict=True))
                assert found == dict(zip(expected[0][1:], now[1:], strict=True))


def test_reference_results_end_where_a_solver_cannot_go_on():
    scene = scenes.load("v3_kite")
    parameters = scene.with_trim({"wind_speed": 40.0, "power_tape_length": 8.0})
    tables = reference_tables(scene, parameters)
    counts = {side: tuple(len(list(csv.reader(text.splitlines()))) for text in pair) for side, pair in tables.items()}
    for rows_in, rows_ref in counts.values():
        assert rows_ref == rows_in + 1 <= STEPS + 2


def test_fmus_without_reference_results_say_nothing_of_them(scene, tmp_path):
    for path in build(scene, tmp_path, reference=False):
        files = entries(path)
        assert not [name for name in files if name.endswith(".csv") and name.startswith("documentation")]
        assert b"Reference inputs" not in files["documentation/index.html"]


def test_the_drawing_has_every_panel_and_line_in_each_view_to_scale(case):
    scene = case[0]
    root = ElementTree.fromstring(drawing(scene))
    paths = root.iter("{http://www.w3.org/2000/svg}path")
    panels = [element.get("d") for element in paths if element.get("class") == "p"]
    assert len(panels) == len(VIEWS)
    assert all(text.count("M") == len(scene.interface.panels) for text in panels)
    x = scene.interface.nodes[scene.interface.panels].reshape(-1, 3)
    for text, (_, right, up) in zip(panels, VIEWS, strict=True):
        drawn = np.array([[float(v) for v in point.split()] for point in re.split("[MLZ]+", text) if point])
        flat = x @ np.array([right, [-u for u in up]]).T
        scale = np.ptp(drawn, axis=0).max() / np.ptp(flat, axis=0).max()
        # a tenth of a unit of the drawing is what its numbers are rounded to
        np.testing.assert_allclose(drawn - drawn.mean(axis=0), scale * (flat - flat.mean(axis=0)), atol=0.2)


def test_each_side_has_an_icon_of_its_own(case):
    icons = [entries(path)["model.png"] for path in case[1]]
    assert len(set(icons)) == len(icons)
    for content in icons:
        assert len(content) < 4096
        assert content.startswith(b"\x89PNG\r\n\x1a\n")
        assert struct.unpack(">II", content[16:24]) == (64, 64)
        length = struct.unpack(">I", content[33:37])[0]
        pixels = np.frombuffer(zlib.decompress(content[41 : 41 + length]), np.uint8).reshape(64, 1 + 3 * 64)[:, 1:]
        assert 0.02 < np.mean(pixels < 128) < 0.5  # neither empty nor a blot


def test_the_page_says_what_is_modelled_and_what_may_be_set(case):
    scene, paths = case
    for path in paths:
        page = html.unescape(entries(path)["documentation/index.html"].decode())
        assert scene.content["description"].strip()[:60] in page
        for key, value in scene.settings.items():
            assert f"{key} = {value}" in page
        for v in fmpy.read_model_description(str(path)).modelVariables:
            if v.causality == "parameter":
                row = re.search(rf"<tr><td>{re.escape(v.name.partition('[')[0])}</td>.*?</tr>", page)[0]
                assert ("before the first step" if v.variability == "fixed" else "at any time") in row


def test_what_an_fmu_depends_on_is_told_in_a_file_of_its_own(scene_paths):
    for path in scene_paths:
        text = entries(path)["documentation/externalDependencies.txt"].decode()
        assert re.search(r"^Python +3\.11 or newer", text, re.MULTILINE)
        for name, module in (("numpy", np), ("scipy", sys.modules["scipy"])):
            assert re.search(rf"^{name} +{re.escape(module.__version__)} ", text, re.MULTILINE)


def test_builds_of_other_processes_folders_and_times_give_the_same_bytes(scene, scene_paths, tmp_path):
    script = (
        "import os, sys, scenes\nfrom fmus.builder import build\n"
        f"os.umask(0o077)\nbuild(scenes.load({scene.name!r}), sys.argv[1])"
    )
    for k, zone in enumerate(("UTC", "Pacific/Auckland")):
        out = tmp_path / f"{k}"
        subprocess.run(
            [sys.executable, "-c", script, str(out)],
            env={"PYTHONHASHSEED": str(k), "TZ": zone},
            cwd=Path(scenes.__file__).parents[1],
            check=True,
            timeout=120,
        )
        for path in scene_paths:
            assert (out / path.name).read_bytes() == path.read_bytes()


def test_nothing_is_carried_that_is_not_needed(scene_paths):
    for path in scene_paths:
        names = entries(path).keys()
        tops = {name.partition("/")[0] for name in names}
        assert tops == {"modelDescription.xml", "model.png", "binaries", "documentation", "resources"}
        if own_binary() is not None:
            assert path.stat().st_size < 3e5  # the solvers' sources, and two binaries, half of it that for Windows
