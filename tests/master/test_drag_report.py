"""Drag of a flown parafoil, part by part, and that of a tether by its force and by its moment."""

import csv
import json
import re
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app
from scenes.schema import SceneError

LENGTH, DIAMETER, WIND, DENSITY = 100.0, 0.014, 10.0, 1.2
GROUND, PILOT = np.array([-0.12, 0.0, -6.1 - LENGTH]), np.array([-0.12, 0.0, -6.1])


def tethered(tmp_path, more=""):
    """The folder of the small parafoil on an upright tether."""
    folder = tmp_path / "kite"
    shutil.copytree(scenes.load("parafoil_small").folder, folder)
    text = (folder / "scene.toml").read_text()
    tether = f"tether_length = {LENGTH}\ntether_diameter = {DIAMETER}\ndepth ="
    text = re.sub(r"^depth =", tether, text, count=1, flags=re.MULTILINE).replace("[trim]", f"{more}\n[trim]")
    (folder / "scene.toml").write_text(text)
    return folder


def on_tether(tmp_path, more=""):
    """Drag in summary.json, and the printed table, of the parafoil on a tether."""
    folder = tethered(tmp_path, more)
    words = ["run", str(folder), "--set", "start_angle=13", "--backend", "in-process", "--no-report", "--no-stability"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "out")], env={"COLUMNS": "200"})
    assert done.exit_code == 0, done.output
    return json.loads((tmp_path / "out" / "summary.json").read_text())["drag"], done.output


@pytest.mark.parametrize(("linear", "force", "moment"), [(False, 1.0, 0.5), (True, 1.0 / 3.0, 0.25)])
def test_the_tether_has_the_drag_of_its_wind_and_is_lumped_by_its_moment(tmp_path, linear, force, moment):
    more = f"[aero.linear_wind]\nground = {GROUND.tolist()}\nkite = {PILOT.tolist()}\n" if linear else ""
    drag, printed = on_tether(tmp_path, more)
    with (tmp_path / "out" / "nodes.csv").open() as file:
        (flown,) = (
            [float(row[f"{axis}_m"]) for axis in "xyz"] for row in csv.DictReader(file) if row["node"] == "pilot"
        )
    way = np.array(flown) - GROUND
    upward = np.deg2rad(13.0)  # of the wind
    c = way @ [np.cos(upward), 0.0, np.sin(upward)] / np.linalg.norm(way)
    across = 0.5 * DENSITY * (1.1 * (1.0 - c**2) ** 1.5 + 0.02) * DIAMETER * np.linalg.norm(way) * WIND**2  # inclined
    if linear:
        across *= (way[2] / LENGTH) ** 2  # the wind is that at its height
    # drag of 3 to 8 % of the tension bows the tether, so that its ends lean by 1 to 2 deg more and less
    assert drag["tether_N"] == pytest.approx(force * across, rel=0.02)
    assert drag["tether_at_kite_N"] == pytest.approx(moment * across, rel=0.02)
    glide = drag["glide_ratio"]
    assert glide["wing"] > glide["kite"] > glide["system"]
    assert "at the kite" in " ".join(printed.replace("│", " ").split())
    assert f"with tether {glide['system']:.3f}" in printed


def test_a_kite_on_a_tether_asks_for_an_angle_to_start_at(tmp_path):
    folder = tethered(tmp_path)
    with pytest.raises(SceneError, match=r"a kite on a tether starts as it is drawn.*give start_angle"):
        scenes.load(folder).with_trim()
    assert scenes.load(folder, {"start_angle": 13.0}).with_trim()["trim_angle"] == 0.0


def test_a_kite_that_is_held_at_its_pilot_point_has_no_tether(tmp_path):
    words = [
        "run",
        "parafoil_small",
        "--backend",
        "in-process",
        "--no-report",
        "--no-stability",
        "--out",
        str(tmp_path),
    ]
    done = CliRunner().invoke(app, words, env={"COLUMNS": "200"})
    assert done.exit_code == 0, done.output
    content = json.loads((tmp_path / "summary.json").read_text())
    drag, outputs = content["drag"], content["outputs"]
    assert "tether_N" not in drag
    assert drag["bridle_N"] == pytest.approx(outputs["line_force"][0], rel=1e-9)  # the wind blows along x
    assert drag["glide_ratio"]["kite"] == pytest.approx(outputs["force"][2] / (outputs["force"][0] + drag["bridle_N"]))
    assert "system" not in drag["glide_ratio"]
