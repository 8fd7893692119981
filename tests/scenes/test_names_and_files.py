"""What a scene is made of: regular files of its own folder, and names that every table, page and FMU can hold."""

import os
import re
import shutil
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

import scenes
from fmus.builder import build
from interface import misnamed, unprintable
from master.cli import app
from master.coupling import checkpoint
from master.coupling.checkpoint import Files
from master.coupling.participants import FmuParticipant, fmu
from master.coupling.simulation import Inputs
from master.fmu_coupling.document import Document
from scenes import SceneError

TETHER = Path(scenes.__file__).parent / "tether_in_wind"


@pytest.fixture
def tether(tmp_path):
    """A copy of a scene, to be spoiled."""
    return Path(shutil.copytree(TETHER, tmp_path / "tether"))


def replaced(folder, file, old, new):
    path = folder / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


@pytest.mark.parametrize("name", ["=1+1", "+a", "-a", "@a", "a\x1b[31mb", "a\x00b", "a\u2028b", "a\uffffb"])
@pytest.mark.parametrize("table", ["nodes.csv", "lines.csv"])
def test_names_that_a_table_cannot_hold_are_refused_with_file_and_row(name, table, tether):
    first = (tether / table).read_text().splitlines()[1].partition(",")[0]
    replaced(tether, table, f"\n{first},", f"\n{name},")
    done = CliRunner().invoke(app, ["build", str(tether), "--out", str(tether.parent / "out")])
    assert done.exit_code == 2
    assert f"tether/{table} row 2" in done.output
    assert not unprintable(done.output.rstrip("\n"))


def test_a_name_within_others_is_refused_as_well(tether):
    row = (tether / "lines.csv").read_text().splitlines()[1].split(",")
    replaced(tether, "lines.csv", ",".join(row), ",".join([row[0], f"{row[1]} =x", *row[2:]]))
    with pytest.raises(SceneError, match=r"lines\.csv row 2: nodes .* none of which begins with = \+ - @"):
        scenes.load(tether)


@pytest.mark.parametrize("key", ["title", "description"])
@pytest.mark.parametrize("mark", ["\\u0000", "\\u001b", "\\u0085", "\\uFFFE"])
def test_texts_with_control_characters_are_refused(key, mark, tether):
    text = (tether / "scene.toml").read_text()
    opening = re.search(f'^{key} = "+', text, re.MULTILINE)[0]
    (tether / "scene.toml").write_text(text.replace(opening, f"{opening}a{mark}b"))
    with pytest.raises(SceneError, match=f"{key} has the control character"):
        scenes.load(tether)


@pytest.mark.parametrize("name", ["a\nb", "=a", "a\x7fb"])
def test_a_scene_whose_folder_has_such_a_name_is_refused(name, tether):
    other = tether.rename(tether.with_name(name))
    with pytest.raises(SceneError, match="a scene is called like its folder: rename it"):
        scenes.load(other)


def test_usual_names_of_all_scripts_are_taken():
    for name in ("A5_right", "21", "Leine", "ligne_à_gauche", "линия", "線", "a=b", "a-b", "a+b", "x@y"):
        assert not misnamed(name)


@pytest.mark.parametrize("file", ["nodes.csv", "scene.toml"])
def test_links_out_of_a_scene_are_not_followed(file, tether):
    moved = shutil.move(tether / file, tether.parent / "secret")
    (tether / file).symlink_to(moved)
    with pytest.raises(SceneError, match=f"tether/{file} is a link to .*secret, outside of the scene; put a copy"):
        scenes.load(tether)
    shutil.move(moved, tether / "kept")
    (tether / file).unlink()
    (tether / file).symlink_to("kept")
    assert scenes.load(tether).name == "tether"


def test_an_fmu_carries_nothing_from_outside_of_its_scene(tether, tmp_path):
    (tmp_path / "private").write_text("my key")
    (tether / "LICENSE_x").symlink_to(tmp_path / "private")
    (tether / "LICENSE_y").write_text("free")
    for path in build(scenes.load(tether), tmp_path / "out", reference=False):
        with zipfile.ZipFile(path) as file:
            assert [n for n in file.namelist() if "LICENSE_" in n] == ["documentation/scene/LICENSE_y"]
            assert not any(b"my key" in file.read(name) for name in file.namelist())


@pytest.mark.parametrize("file", ["nodes.csv", "scene.toml"])
def test_a_pipe_in_a_scene_is_refused_and_not_waited_for(file, tether):
    (tether / file).unlink()
    os.mkfifo(tether / file)
    with pytest.raises(SceneError, match=f"tether/{file} is a named pipe; put a regular file in its place"):
        scenes.load(tether)
    (tether / file).unlink()
    (tether / file).mkdir()
    with pytest.raises(SceneError, match=f"tether/{file} is a folder"):
        scenes.load(tether)


@pytest.mark.parametrize("path", ["pipe", "/dev/zero"])
def test_pipes_and_devices_are_refused_wherever_a_file_is_named(path, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    path = tmp_path / path
    what = "a device" if path.name == "zero" else "a named pipe"
    for read in (Inputs.read, checkpoint.read, checkpoint.head, Document.read, Files):
        with pytest.raises(ValueError, match=what):
            read(path)
    with pytest.raises(ValueError, match="There is no FMU"):
        FmuParticipant(path)


def test_an_fmu_that_would_fill_the_disk_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(fmu, "LARGEST", 10**6)
    bomb = tmp_path / "bomb.fmu"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("modelDescription.xml", "<x/>")
        file.writestr("resources/zeros", bytes(2 * 10**6))
    assert bomb.stat().st_size < 10**4
    says = r"bomb\.fmu is not a readable FMU: it takes .* GiB unpacked, more than"
    with pytest.raises(ValueError, match=says):
        FmuParticipant(bomb)
    connection = {"from": "a.y", "to": "b.u"}
    content = {"participants": {"a": {"fmu": "bomb.fmu"}, "b": {"fmu": "bomb.fmu"}}, "connections": [connection]}
    with pytest.raises(ValueError, match=says):
        Document.of(content | {"time": {"stop": 1.0, "step": 0.1}}, tmp_path)


@pytest.mark.parametrize("name", ["=x", "a\nb"])
def test_participants_of_such_names_are_refused(name, tmp_path):
    (tmp_path / "x.fmu").write_text("")
    content = {"time": {"stop": 1.0, "step": 0.1}, "participants": {name: {"fmu": "x.fmu"}}}
    with pytest.raises(ValueError, match=r"has the name .*; choose another"):
        Document.of(content, tmp_path)


def numbers_of_tables():
    """Scene, table and column of every number in the tables of small scenes."""
    for name in ("tether_in_wind", "typical_section", "v3_kite"):
        for path in sorted((TETHER.parent / name).glob("*.csv")):
            header, first = (line.split(",") for line in path.read_text().splitlines()[:2])
            yield from ((name, path.name, k) for k, cell in enumerate(first) if re.fullmatch(r"-?[\d.]+", cell) and k)
            assert len(header) == len(first)


# every column, each with one of the values, and one column with all of them: a scene takes a second to load
VALUES = ["1e300", "1e90", "-1e300", "1e-300", "1e-90"]
NUMBERS = [(*place, VALUES[k % len(VALUES)]) for k, place in enumerate(numbers_of_tables())]
NUMBERS += [("v3_kite", "sections.csv", 2, value) for value in VALUES]


@pytest.mark.parametrize(("name", "table", "column", "value"), NUMBERS)
def test_numbers_whose_squares_are_none_are_refused_and_others_are_taken(name, table, column, value, tmp_path):
    folder = Path(shutil.copytree(TETHER.parent / name, tmp_path / name))
    lines = (folder / table).read_text().splitlines()
    cells = lines[1].split(",")
    cells[column] = value
    (folder / table).write_text("\n".join([lines[0], ",".join(cells), *lines[2:]]) + "\n")
    said = ""
    try:
        scenes.load(folder).cores()
    except SceneError as error:
        said = str(error)
    assert not said or f"{name}/" in said
