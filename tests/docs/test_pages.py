"""The pages say what is true: their code runs, prints what they promise, and their links lead somewhere."""

import csv
import json
import re
import shutil
import sys
from dataclasses import MISSING, fields
from pathlib import Path

import numpy as np
import pytest

import scenes
from master.coupling import SCHEMES, schemes
from master.fmu_coupling.document import Member
from master.fmu_coupling.settings import Settings
from scenes.readers.description import known_keys
from scenes.schema import SECTIONS
from tests.docs.pages import DOCS, blocks, checked, give_files

GUIDE = DOCS / "scenes.md"
ROOT = DOCS.parent
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def test_every_block_of_the_scripting_page_runs_and_prints_what_the_page_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = checked(DOCS / "scripting.md")
    assert not wrong, "\n".join(wrong)


def test_every_block_of_the_coupling_page_runs_and_prints_what_the_page_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))  # PythonFMU's builder adds to it
    give_files(DOCS / "couple.md", tmp_path)
    wrong = checked(DOCS / "couple.md")
    assert not wrong, "\n".join(wrong)
    with Path("results/trolley/results.csv").open() as file:
        x = np.array([float(row["trolley.x"]) for row in csv.DictReader(file)])
    assert x.min() == pytest.approx(-0.1, rel=1e-3)  # energy is kept; the turn is between two steps
    assert json.loads(Path("results/section/summary.json").read_text())["status"] == "converged"


def test_every_block_of_the_page_on_motion_runs_and_prints_what_the_page_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = checked(DOCS / "motion.md")
    assert not wrong, "\n".join(wrong)


def test_the_page_on_motion_names_every_key_with_its_default():
    text = (DOCS / "motion.md").read_text()
    for key, (_, default) in known_keys("dynamics").items():
        assert f"| `{key}` | {json.dumps(default)} |" in text


def test_the_coupling_page_names_every_setting():
    text = (DOCS / "couple.md").read_text()
    keys = ["blocks" if entry.name == "names" else entry.name for entry in (*fields(Settings), *fields(Member))]
    for name in (*keys, *SCHEMES):
        assert f"`{name}`" in text


def test_every_block_of_the_page_on_comparisons_runs_and_prints_what_the_page_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(schemes.SCHEMES, "alternating", None)  # the page adds it; gone again after the test
    del schemes.SCHEMES["alternating"]
    wrong = checked(DOCS / "compare.md")
    assert not wrong, "\n".join(wrong)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The folder where the scene of the guide was made from the page and flown, and what the page promised in vain."""
    folder = tmp_path_factory.mktemp("guide")
    give_files(GUIDE, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return folder, checked(GUIDE)


def test_the_kite_of_the_guide_flies_as_the_page_says(flown):
    folder, wrong = flown
    assert not wrong, "\n".join(wrong)
    result = json.loads((folder / "results/my_kite/summary.json").read_text())
    assert result["status"] == "converged"
    assert result["coupling_iterations"] < 30
    assert result["statically_stable"] is True
    with (folder / "results/my_kite/elements.csv").open() as file:
        tension = {row["element"]: float(row["tension_N"]) for row in csv.DictReader(file)}
    with (folder / "my_kite/lines.csv").open() as file:
        lines = [row["name"] for row in csv.DictReader(file)]
    assert min(tension[line] for line in lines) > 1.0  # N: taut, by far more than the tolerance of the solve


def test_the_kite_of_the_guide_stands_above_its_bridle_point_with_its_chord_up_into_the_wind(flown):
    folder, _ = flown
    with (folder / "results/my_kite/nodes.csv").open() as file:
        place = {row["node"]: np.array([float(row[f"{k}_m"]) for k in "xyz"]) for row in csv.DictReader(file)}
    wing = np.array([place[n] for n in place if n[:2] in ("le", "te")])
    assert wing[:, 2].min() > 6.0  # m; the tips are drawn at 7 m
    chord = place["te_in_right"] - place["le_in_right"]
    assert 2.0 < np.rad2deg(np.arctan2(-chord[2], chord[0])) < 10.0  # between a flapping canopy and stall


SWAPPED = ["2,le_in_left,te_in_left", "3,le_in_right,te_in_right"]
# Per row of the page's table: the file, what stands there, and what is written instead.
MISTAKES = [
    ("lines.csv", "front_in_left,le_in_left", "front_in_left,le_inn_left"),
    ("nodes.csv", "0.0,0.0,0.0,xyz", "0.0,0.0,0.0,"),
    ("struts.csv", "\n".join(SWAPPED), "\n".join(SWAPPED[::-1])),
    ("scene.toml", "wind_speed = 10.0", "windspeed = 10.0"),
    ("scene.toml", "wind_speed = 10.0", "wind_speed = 2.0"),
]


@pytest.mark.parametrize("case", range(len(MISTAKES)))
def test_a_mistake_of_the_guide_is_answered_by_its_message(flown, tmp_path, case):
    folder = shutil.copytree(flown[0] / "my_kite", tmp_path / "my_kite")
    file, right, wrong = MISTAKES[case]
    text = (folder / file).read_text()
    assert right in text
    (folder / file).write_text(text.replace(right, wrong))
    table = re.findall(r"^\| [^|`]+ \| `([^`]+)` \|$", GUIDE.read_text(), re.MULTILINE)
    assert len(table) == len(MISTAKES)
    with pytest.raises(ValueError, match=re.escape(table[case].removesuffix("..."))):
        scenes.load(folder).trim_angle()


def test_a_line_of_the_guide_that_ends_in_the_air_is_named_by_its_note(flown, tmp_path):
    folder = shutil.copytree(flown[0] / "my_kite", tmp_path / "my_kite")
    lines, nodes = folder / "lines.csv", folder / "nodes.csv"
    lines.write_text(lines.read_text().replace("tape_top bridle_point,1.420", "tape_top loose,1.420"))
    nodes.write_text(nodes.read_text() + "loose,0.0,0.0,0.5,\n")
    (note,) = scenes.load(folder).notes()
    assert f"`note: {note}`" in " ".join(GUIDE.read_text().split())


def test_the_example_of_tapes_and_variants_makes_a_scene(flown, tmp_path):
    folder = shutil.copytree(flown[0] / "my_kite", tmp_path / "my_kite")
    (example,) = (block.text for block in blocks(GUIDE) if block.kind == "toml" and "steering_left" in block.text)
    lines = (folder / "lines.csv").read_text()
    lines += "".join(f"steering_{side},pulley_{side} bridle_point,4.6,0.002\n" for side in ("left", "right"))
    for name in ("lines.csv", "lines_long.csv"):
        (folder / name).write_text(lines)
    text = (folder / "scene.toml").read_text()
    plain = '[structure.tapes]\npower_tape_length = ["power_tape"]\n'
    assert plain in text
    (folder / "scene.toml").write_text(text.replace(plain, example))
    scene = scenes.load(folder, {"variant": "long"})
    assert (scene.structure.lines, scene.aero.wind_speed) == ("lines_long.csv", 12.0)
    assert scene.structural_core().get("steering_tape_left_length") == 4.6


def test_the_guide_names_every_key_of_a_scene_with_its_default():
    text = GUIDE.read_text()
    for section in SECTIONS:
        keys = known_keys(section)
        start = text.index(f"| `[{section}]` |")
        rows = re.findall(r"^\|(?: `\[\w+\]` \|| \|) `(\w+)` \|([^|]*)\|", text[start:], re.MULTILINE)[: len(keys)]
        told = {key: default.strip() for key, default in rows}
        assert told == {key: _shown(default) for key, (_, default) in keys.items()}, section


def _shown(default):
    """A default of schema.py as the guide writes it."""
    if default is MISSING:
        return ""
    return "none" if default in (None, {}) else json.dumps(default)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_to_a_file_and_a_heading(page):
    for target in LINK.findall(re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.*)$", file.read_text(), re.MULTILINE)
            slugs = {re.sub(r"[^\w -]", "", h.lower()).strip().replace(" ", "-") for h in headings}
            assert anchor in slugs, target


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: str(page.relative_to(DOCS)))
def test_every_page_is_in_the_index(page):
    assert page.name == "README.md" or f"({page.relative_to(DOCS).as_posix()})" in (DOCS / "README.md").read_text()


@pytest.mark.parametrize("page", sorted((DOCS / "theory").glob("*.md")), ids=lambda page: page.stem)
def test_code_that_the_theory_names_is_there(page):
    """`folder/file.py`: `name`, `other` — the file exists and defines the names."""
    named = re.findall(
        r"`((?:interface|structural|aero|scenes|master|fmus)/[\w/]+\.py)`:?\s*((?:`[\w.]+`(?:,\s)?)*)", page.read_text()
    )
    assert named
    for file, names in named:
        source = (ROOT / file).read_text()
        for name in re.findall(r"`([\w.]+)`", names):
            last = name.rpartition(".")[2]
            assert re.search(rf"^\s*(?:def|class) {last}\b|^{last}\b", source, re.MULTILINE), f"{file}: {name}"
