"""What an FMU carries beside its solver: reference results, a drawing, an icon, notes."""

import csv
import html
import itertools
import re
import struct
import subprocess
import sys
import zipfile
import zlib
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
import scipy
from packaging.requirements import Requirement

import scenes
from fmus.builder import _without_search_path, build, own_binary
from fmus.documentation.picture import VIEWS, drawing
from fmus.documentation.reference import RELATIVE, STEPS, reference_tables
from tests.fmus.cases import PLAIN, RIGID, label
from tests.fmus.importer import Importer


def entries(path):
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


SVG = "{http://www.w3.org/2000/svg}"


def shapes(view, kind):
    """Points (k, n, 2) of the paths of a class."""
    found = "".join(path.get("d") for path in view.iter(f"{SVG}path") if path.get("class") == kind)
    parts = [part.rstrip("Z").split() for part in found.split("M") if part]
    return np.array(parts, dtype=float).reshape(len(parts), -1, 2) if parts else np.zeros((0, 4, 2))


def table(content):
    """Names and rows of a CSV file."""
    names, *rows = csv.reader(content.decode().splitlines())
    return names, [[float(x) for x in row] for row in rows]


@pytest.mark.parametrize("case", PLAIN + RIGID, indirect=True, ids=label)
def test_the_script_on_the_page_finds_the_reference_results_to_the_last_bit(case, tmp_path):
    for path in case[1]:
        folder = tmp_path / path.stem
        fmpy.extract(str(path), folder)
        page = (folder / "documentation" / "index.html").read_text(encoding="utf-8")
        script = html.unescape(re.search("<pre>(.*?)</pre>", page, re.DOTALL)[1])
        done = subprocess.run(
            [sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, timeout=120, check=False
        )
        words, difference = done.stdout.rsplit(maxsplit=1)
        assert words == "largest difference"
        # in transient scenes steps of 0.1 s end at sums of them, and are of sizes that differ in the last bit
        assert float(difference) <= (1e-12 if case[0].transient else 0.0), done.stderr


@pytest.mark.parametrize("case", PLAIN + RIGID, indirect=True, ids=label)
def test_the_command_on_the_page_finds_them_where_no_input_has_a_comma_in_its_name(case, tmp_path):
    for path in case[1]:
        files = entries(path)
        command = re.search("<code>(fmpy simulate .*?)</code> finds", files["documentation/index.html"].decode(), re.S)
        given, (names, rows) = (table(files[f"documentation/{path.stem}_{kind}.csv"]) for kind in ("in", "ref"))
        assert (command is None) is any("," in name for name in given[0])
        if command is None:
            continue
        (tmp_path / path.name).write_bytes(path.read_bytes())
        (tmp_path / f"{path.stem}_in.csv").write_bytes(files[f"documentation/{path.stem}_in.csv"])
        words = command[1].split()
        subprocess.run([Path(sys.executable).with_name(words[0]), *words[1:]], cwd=tmp_path, timeout=120, check=True)
        text = (tmp_path / "out.csv").read_text().replace("True", "1").replace("False", "0")  # fmpy's truth values
        found_names, found = table(text.encode())
        columns = [found_names.index(name) for name in names]
        assert [[row[k] for k in columns] for row in found] == rows


@pytest.mark.parametrize("case", PLAIN + RIGID, indirect=True, ids=label)
def test_an_importer_that_sets_each_row_and_steps_finds_them_too(case):
    for path in case[1]:
        files = entries(path)
        given, expected = (table(files[f"documentation/{path.stem}_{kind}.csv"]) for kind in ("in", "ref"))
        quoted = files[f"documentation/{path.stem}_ref.csv"].decode().partition("\n")[0]
        assert quoted == ",".join(f'"{name}"' for name in expected[0])  # as the FMI cross-check rules have it
        dt = case[0].communication_step
        assert [row[0] for row in given[1]] == [k * dt for k in range(STEPS)]
        assert [row[0] for row in expected[1]] == [k * dt for k in range(STEPS + 1)]
        with Importer(path) as fmu:
            of_type = {kind: [n for n in expected[0][1:] if fmu.types[n] == kind] for kind in set(fmu.types.values())}
            places = [fmu.references[name] for name in given[0][1:]]
            for now, (t, *row) in zip(expected[1][1:], given[1], strict=True):
                fmu.slave.setReal(places, row)
                fmu.slave.doStep(t, dt)
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


@pytest.mark.parametrize("side", ["structural", "aero"])
def test_the_drawing_has_every_panel_in_each_view_to_scale(case, side):
    scene = case[0]
    if not len(scene.interface.panels) or scene.body is not None:
        pytest.skip("a scene without panels, or with many that are drawn by their outline")
    views = list(ElementTree.fromstring(drawing(scene, side)).iterfind(f"{SVG}g"))
    x = scene.interface.nodes[scene.interface.panels]
    scales = []
    for view, (_, right, up) in zip(views, VIEWS, strict=True):
        assert abs(right @ up) < 1e-15  # rounding: a parallel view that distorts nothing
        flat = x @ np.array([right, -up]).T
        d, e = flat[:, 2] - flat[:, 0], flat[:, 3] - flat[:, 1]
        lower = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0] >= 0.0  # seen on the side that a normal points away from
        drawn = np.concatenate([shapes(view, kind) for kind in "qp"])
        flat = np.concatenate([flat[lower], flat[~lower]])
        assert drawn.shape == flat.shape
        drawn, flat = (points.reshape(-1, 2) - points.reshape(-1, 2).mean(axis=0) for points in (drawn, flat))
        scales.append(np.sum(drawn * flat) / np.sum(flat * flat))
        np.testing.assert_allclose(drawn, scales[-1] * flat, atol=1.5)  # numbers are rounded to integers
    np.testing.assert_allclose(scales, scales[0], rtol=1e-2)  # of two pixels in some hundreds


def test_the_drawing_has_each_line_and_tube_of_the_structure_and_the_exposed_lines_of_the_flow(case):
    scene, mesh, members = case[0], case[0].interface, case[0].members
    if scene.body is not None:
        pytest.skip("a closed body, drawn by its outline")
    canopy = set() if members.wing is None else {name for name, *_ in members.wing.springs}
    pairs = {
        frozenset(pair)
        for group in members.chains
        for nodes, name in zip(group.nodes.tolist(), group.names, strict=True)
        if name not in canopy
        for pair in itertools.pairwise(nodes)
    }
    seams = () if members.membranes is None else members.membranes.seams.values()
    pairs |= {frozenset(pair) for sides in seams for pair in sides.tolist()}
    tubes = 0 if members.wing is None else len(members.wing.tubes.ends)
    for view in ElementTree.fromstring(drawing(scene, "structural")).iterfind(f"{SVG}g"):
        assert sum(len(shapes(view, kind)) for kind in "kl") == len(pairs)
        assert len(shapes(view, "t")) == tubes
    for view in ElementTree.fromstring(drawing(scene, "aero")).iterfind(f"{SVG}g"):
        assert len(shapes(view, "l")) == len(mesh.lines)
        assert not len(shapes(view, "k")) + len(shapes(view, "t"))


@pytest.mark.parametrize(("direction", "seen"), [((1.0, 0.0, 0.0), "from the left"), ((0.0, -2.0, 0.0), "from behind")])
def test_the_arrow_points_where_the_wind_goes(scene, direction, seen):
    """Level, and to the right or to the left of the view, as it is seen from there."""
    root = ElementTree.fromstring(drawing(scene, "aero", ("wind", np.array(direction))))
    view = next(view for view in root.iterfind(f"{SVG}g") if view.find(f"{SVG}text").text == seen)
    (arrow,) = [path for path in view.iter(f"{SVG}path") if path.get("class") == "w"]
    x0, y0, x1, y1 = map(float, re.match("M(.+?) (.+?)L(.+?) (.+?)M", arrow.get("d")).groups())
    assert y0 == y1
    assert np.sign(x1 - x0) == np.sign(sum(direction))


def test_pages_stay_small_though_the_wing_is_finely_meshed(case):
    """Drawings of tens of kB, whatever the scene."""
    for side in ("structural", "aero"):
        assert len(drawing(case[0], side)) < 5e4


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
        assert scene.description.strip()[:60] in page
        for key, value in scene.settings.items():
            assert f"{key} = {value}" in page
        for v in fmpy.read_model_description(str(path)).modelVariables:
            if v.causality == "parameter":
                row = re.search(rf"<tr><td>{re.escape(v.name.partition('[')[0])}</td>.*?</tr>", page)[0]
                cells = re.findall("<td>(.*?)</td>", row)
                assert cells[6] == v.variability
                bounds = [getattr(v, name, None) for name in ("min", "max")]
                shown = [None if cell == "–" else float(cell) for cell in cells[4:6]]
                assert shown == [None if bound is None else float(f"{float(bound):g}") for bound in bounds]


def test_what_an_fmu_depends_on_is_told_in_a_file_of_its_own(scene_paths):
    for path in scene_paths:
        text = entries(path)["documentation/externalDependencies.txt"].decode()
        assert "Python 3.11 or newer" in text
        wanted = [Requirement(line) for line in text.splitlines() if not line.startswith("#")]
        project = {r.name: r.specifier for r in map(Requirement, metadata.requires("kitecosim"))}
        assert {r.name: r.specifier for r in wanted} == {name: project[name] for name in ("numpy", "scipy")}
        for requirement, module in zip(wanted, (np, scipy), strict=True):
            assert requirement.specifier.contains(module.__version__)
            assert f"{requirement.name} {module.__version__}" in text  # what it was built with


def test_builds_of_other_processes_folders_and_times_give_the_same_bytes(scene, scene_paths, tmp_path):
    script = (
        "import os, sys, scenes\nfrom fmus.builder import build\n"
        f"os.umask(0o077)\nbuild(scenes.load({scene.name!r}), sys.argv[1])"
    )
    for k, zone in enumerate(("UTC", "Pacific/Auckland")):
        out = tmp_path / f"{k}"
        out.mkdir()
        subprocess.run(
            [sys.executable, "-c", script, "built"],
            env={"PYTHONHASHSEED": str(k), "TZ": zone, "PYTHONPATH": str(Path(scenes.__file__).parents[1])},
            cwd=out,
            check=True,
            timeout=120,
        )
        for path in scene_paths:
            assert (out / "built" / path.name).read_bytes() == path.read_bytes()


def test_options_of_the_reference_results_fit_their_times(scene_paths):
    for path in scene_paths:
        files = entries(path)
        names, rows = table(files[f"documentation/{path.stem}_ref.csv"])
        options = dict(line.split(",") for line in files[f"documentation/{path.stem}_ref.opt"].decode().splitlines())
        assert [float(options[key]) for key in ("StartTime", "StopTime")] == [rows[0][0], rows[-1][0]]
        assert float(options["StepSize"]) == rows[1][0] - rows[0][0]
        assert float(options["RelTol"]) == float(options["AbsTol"]) == RELATIVE
        assert not {"residual", "newton_iterations"} & set(names)


def test_reference_results_do_not_hang_on_how_far_the_solvers_went():
    """A hundred times tighter solves stay far within what the options allow another machine."""
    scene = scenes.load("v3_kite")
    given = scene.with_trim({})
    loose, tight = (reference_tables(scene, given | extra) for extra in ({}, {"solver_tolerance": 1e-8}))
    for side in loose:
        names, a = table(loose[side][1].encode())
        b = np.array(table(tight[side][1].encode())[1])
        for block in {name.partition("[")[0] for name in names}:
            columns = [k for k, name in enumerate(names) if name.partition("[")[0] == block]
            found, expected = np.array(a)[:, columns], b[:, columns]
            assert np.abs(found - expected).max() <= 1e-2 * (RELATIVE + RELATIVE * np.abs(expected).max())


def test_every_file_is_under_a_licence_that_is_told(scene_paths):
    for path in scene_paths:
        files = entries(path)
        told = files["documentation/licenses/license.txt"].decode()
        rows = [line for line in told.splitlines() if line.startswith("* ")]
        for text in re.findall(r"documentation/licenses/\w+\.txt|documentation/scene/[\w.]+", told):
            assert text in files
        for name in files:
            covered = re.match(r"binaries/.*|resources/\w+\.\w+|resources/\w+/\w+(?=/)|resources/\w+(?=/)|\w+", name)[0]
            if not name.endswith((".txt", ".json", ".png")):
                assert any(covered in row for row in rows), name
        own = own_binary()
        for name in files:
            if name.startswith("binaries/"):
                (row,) = [row for row in rows if name in row]
                assert ("MIT" in row) is (own is None or files[name] != _without_search_path(own.read_bytes()))


def test_nothing_is_carried_that_is_not_needed(scene_paths):
    for path in scene_paths:
        names = entries(path).keys()
        tops = {name.partition("/")[0] for name in names}
        assert tops == {"modelDescription.xml", "model.png", "binaries", "documentation", "resources"}
        if own_binary() is not None:
            assert path.stat().st_size < 3e5  # the solvers' sources, and two binaries, half of it that for Windows
