"""Scenes of lines without a wing, at rest or in motion, in the wind or in still air, are scenes like any other."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from master.cli import app

TABLES = {"nodes.csv": "node,x_m,y_m,z_m,fixed\na,{a},xyz\nb,{b},\nc,{c},xyz\n",
          "lines.csv": "name,nodes,rest_length_m,diameter_m\nl1,a b,2.05,0.002\nl2,b c,2.05,0.002\n",
          "masses.csv": "node,mass_kg\nb,1\n"}  # fmt: skip
DYNAMICS = "[dynamics]\nstop_time = 0.2\ncommunication_step = 0.1\n"
# wind, motion, axis that the lines are along; lines at rest in still air are refused when they are read
CASES = [(True, False, "x"), (True, False, "y"), (True, False, "z"), (True, True, "x"), (False, True, "x")]


def cli(*words):
    return CliRunner().invoke(app, list(map(str, words)))


@pytest.fixture(params=CASES, ids=lambda case: "-".join(("wind" if case[0] else "still", str(case[1]), case[2])))
def lines(request, tmp_path):
    aero, moving, along = request.param
    folder = tmp_path / "lines"
    folder.mkdir()
    axis = np.eye(3)["xyz".index(along)]
    ends = {name: ",".join(f"{x:g}" for x in k * axis) for name, k in (("a", 0.0), ("b", 2.0), ("c", 4.0))}
    for name, text in TABLES.items():
        (folder / name).write_text(text.format(**ends) if name == "nodes.csv" else text)
    toml = 'title = "lines"\n[settings.line_drag]\ndefault = "on"\noptions = ["on"]\n' if aero else 'title = "lines"\n'
    toml += '[structure]\nnodes = "nodes.csv"\nlines = "lines.csv"\nmasses = "masses.csv"\nline_modulus = 1e9\n'
    toml += "line_density = 970.0\n" if moving else ""
    (folder / "scene.toml").write_text(toml + "[aero]\nwind_speed = 10.0\n" * aero + DYNAMICS * moving)
    return folder


@pytest.mark.parametrize("words", [["run", "--labels", "both"], ["run", "--backend", "in-process"], ["build", "--ssp"],
                                   ["build", "--fmi", "3"], ["compare", "--jobs", "0"]], ids=" ".join)  # fmt: skip
def test_every_command_takes_lines_alone(words, lines, tmp_path):
    out = tmp_path / "out"
    has_flow = "[aero]" in (lines / "scene.toml").read_text()
    done = cli(words[0], lines, *words[1:], "--out", out)
    assert done.exit_code == 0, done.output
    if words[0] == "run":
        content = json.loads((out / "summary.json").read_text())
        assert content["status"] in ("converged", "statically_unstable")
        assert (out / "nodes.csv").exists()
    if words[0] == "build":
        assert len(list(out.glob("*.fmu"))) == 1 + has_flow


def test_the_wind_on_a_line_at_rest_is_held_by_its_supports(tmp_path):
    """The drag of the wind across the whole line, 1/2 rho U^2 c d L, and the weight are carried by the two ends."""
    folder, out = tmp_path / "lines", tmp_path / "out"
    folder.mkdir()
    for name, text in TABLES.items():
        (folder / name).write_text(text.format(a="0,0,0", b="0,2,0", c="0,4,0"))
    toml = 'title = "lines"\n[settings.line_drag]\ndefault = "on"\noptions = ["on"]\n[structure]\nnodes = "nodes.csv"\n'
    toml += 'lines = "lines.csv"\nmasses = "masses.csv"\nline_modulus = 1e9\n[aero]\nwind_speed = 10.0\n'
    (folder / "scene.toml").write_text(toml)
    assert cli("run", folder, "--backend", "in-process", "--no-report", "--out", out).exit_code == 0
    content = json.loads((out / "summary.json").read_text())
    outputs, parameters = content["outputs"], content["settings"]["parameters"]
    force = np.array(outputs["line_force"])
    weight = np.array([0.0, 0.0, -float(parameters["structural.gravity"])])  # of 1 kg; the lines have no mass
    assert force[0] > 0.0
    assert np.allclose(outputs["support_force"], force + weight, rtol=0.0, atol=0.02), outputs["support_force"]
    # the equilibrium is one within the force tolerance of 0.01 N, here of wind on one shape and tension in the next
