"""The verdict of runs on validity: what it says, when its largest values came, exit codes, both backends."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from master.cli import app
from master.commands import pair
from master.coupling import Coupling, InProcessParticipant, coupled_run, scheme, simulate
from master.coupling.simulation import Inputs
from scenes import load
from tests.scenes.broken import copy_of, edited

TETHER = 300.0  # m between its ends


def run(*words):
    return CliRunner().invoke(app, ["run", *map(str, words), "--no-report", "--backend", "in-process"])


def written(folder):
    return json.loads((folder / "summary.json").read_text())


def reeled(metres):
    """The tether in wind after reeling in so many metres by rate, and its participants."""
    cores = load("tether_in_wind").cores()
    sides = {side: InProcessParticipant(core) for side, core in cores.items()}
    times = np.array([0.0, 1.0, 3.0, 4.0])
    table = Inputs("in.csv", times, {"tether_length_rate": np.array([0.0, -metres / 3.0, -metres / 3.0, 0.0])})
    return simulate(sides, 8.0, 0.1, "explicit", inputs=table), sides["structural"]


def test_after_reeling_by_rate_tensions_and_strains_are_those_of_the_elastic_energy():
    run, structure = reeled(0.4)
    assert run.finished
    length, stiffness = structure.get("rest_length").sum(), structure.get("axial_stiffness")
    assert length == pytest.approx(structure.get("tether_length_present"), rel=1e-12)  # rounding
    assert structure.get("tether_length") == TETHER  # the parameter, which nobody has changed
    expected = np.sqrt(2.0 * structure.get("elastic_energy") * stiffness[0] / length)
    # the tension of a flat bow is the same all along, but for what swings
    np.testing.assert_allclose(structure.get("tension"), expected, rtol=1e-4)
    np.testing.assert_allclose(structure.get("tension"), stiffness * structure.get("strain"), rtol=1e-9)
    np.testing.assert_allclose(structure.get("strain"), structure.get("length") / structure.get("rest_length") - 1.0)
    assert structure.get("slack_lines") == 0


def test_reeling_a_tether_in_that_is_held_at_both_ends_is_outside_validity():
    judged = {j.criterion.name: j for j in reeled(6.0)[0].validity}["largest_line_strain"]
    assert judged.value == pytest.approx(6.0 / (TETHER - 6.0), rel=0.05)  # straight, but for its bow and swing
    assert not judged.within
    assert judged.where.startswith("segment_")


def test_verdict_of_a_transient_run_is_on_its_largest_values_with_their_times(tmp_path):
    (tmp_path / "in.csv").write_text("time,tether_length\n0,300\n0.5,296\n1,296\n1.5,300\n3,300\n")
    out = tmp_path / "out"
    words = ("tether_in_wind", "--inputs", tmp_path / "in.csv", "--stop-time", "3", "--out", out)
    assert run(*words).exit_code == 0
    (verdict,) = written(out)["validity"]
    with (out / "history.csv").open() as file:
        rows = list(csv.DictReader(file))[1:]
    strain = [float(row["largest_line_strain"]) for row in rows]
    largest = int(np.argmax(strain))
    assert verdict["value"] == strain[largest] > 0.01 > strain[-1]
    assert verdict["time"] == float(rows[largest]["time_s"]) == pytest.approx(1.0, abs=0.5)
    assert not verdict["within"]
    assert verdict["output"] == "structural.largest_line_strain"
    assert run(*words, "--strict").exit_code == 1


def test_restart_remembers_the_largest_values_of_before(tmp_path):
    (tmp_path / "in.csv").write_text("time,tether_length\n0,300\n0.5,296\n1,296\n1.5,300\n3,300\n")
    words = ("tether_in_wind", "--inputs", tmp_path / "in.csv", "--out", tmp_path / "out")
    checkpoint = tmp_path / "c.ckp"
    run(*words, "--stop-time", "3")
    whole = written(tmp_path / "out")["validity"]
    assert run(*words, "--stop-time", "2", "--checkpoint", checkpoint).exit_code == 0
    again = run("tether_in_wind", "--restart", checkpoint, "--stop-time", "3", "--out", tmp_path / "on", "--strict")
    assert again.exit_code == 1
    assert "line strain" in again.stdout
    assert written(tmp_path / "on")["validity"] == whole


@pytest.mark.parametrize(("area", "code"), [(1.0, 0), (3.0, 1)])
def test_strict_makes_a_wrong_reference_area_exit_code_one(tmp_path, area, code):
    folder = copy_of("typical_section", tmp_path)
    edited(folder, "scene.toml", "reference_area = 1.0", f"reference_area = {area}")
    out = tmp_path / "out"
    assert run(folder, "--out", out).exit_code == 0  # it converged
    strict = run(folder, "--out", out, "--strict")
    assert strict.exit_code == code
    content = written(out)
    assert content["status"] == "converged"
    found = {v["quantity"]: v for v in content["validity"]}
    assert all(v.keys() >= {"quantity", "value", "limit", "source", "where", "within"} for v in found.values())
    assert found["reference area against that of the wing"]["within"] == (code == 0)
    assert ("outside: reference area" in strict.stdout) == bool(code)
    if code:
        assert run(folder, "--out", out, "--strict", "--restart", _checkpoint(folder, tmp_path)).exit_code == 1


def _checkpoint(folder, tmp_path):
    run(folder, "--out", tmp_path / "first", "--checkpoint", tmp_path / "c.ckp")
    return tmp_path / "c.ckp"


@pytest.fixture(scope="module")
def kite():
    coupling = Coupling.in_process(load("v3_kite"))
    return coupled_run(coupling, scheme("iqn-ils", coupling, "serial"), stability=False), coupling


def test_kite_with_soft_lines_names_the_line_that_stretches_most(kite):
    run, coupling = kite
    (judged,) = [j for j in run.validity if not j.within]
    lengths, rests = (coupling.structural.get(name) for name in ("length", "rest_length"))
    names, area = load("v3_kite").members.names, load("v3_kite").members.area
    strain = np.where(area > 0.0, lengths / rests - 1.0, 0.0)
    assert judged.value == strain.max()
    assert judged.where in {names[i] for i in np.flatnonzero(strain > strain.max() * (1.0 - 1e-9))}  # left or right
    assert coupling.validity() == run.validity
    assert coupling.structural.get("outside_validity") == 1


def test_report_and_tables_show_the_strain_and_the_verdict(kite, tmp_path):
    from master.report.page import _validity
    from master.report.tables import write_state

    run, _ = kite
    scene, blocks = load("v3_kite"), run.blocks["structural"]
    (marked,) = _validity(run)["marked"]
    assert _validity(run)["rows"][marked][0][0] == "line strain"
    names = {"position": scene.members.labels, "tension": scene.members.names, "line_load": scene.members.leg_names}
    write_state(tmp_path, blocks | run.blocks["aero"], names, scene.interface)
    with (tmp_path / "elements.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["element", "tension_N", "strain", "rest_length_m", "length_m", "EA_N"]
    taut = [row for row in rows if float(row["tension_N"]) > 0.0]
    for row in taut:
        assert float(row["tension_N"]) == pytest.approx(float(row["EA_N"]) * float(row["strain"]), rel=1e-8, abs=1e-9)


def test_fmus_give_the_same_verdict_as_the_solvers_in_this_process(tmp_path):
    scene = load("typical_section")
    found = {}
    for backend in ("in-process", "fmu"):
        with pair(scene, backend, {}, tmp_path) as coupling:
            coupled_run(coupling, scheme("iqn-ils", coupling, "serial"), stability=False)
            found[backend] = coupling.validity()
            assert float(coupling.aero.get("outside_validity")) == 0.0
    assert found["fmu"] == found["in-process"] != []


def test_participants_without_criteria_are_not_judged():
    from master.report.validity import validity_row

    assert validity_row([]) == ("validity", "not judged: no step was completed, or no model here has limits")


def test_comparison_counts_what_is_outside_validity():
    from master import compare

    soft, stiff = compare("v3_kite", ["iqn-ils"], sweep={"line_modulus": ["0.55e9", "100e9"]}, jobs=0)
    assert (soft["outside_validity"], stiff["outside_validity"]) == (1, 0)
