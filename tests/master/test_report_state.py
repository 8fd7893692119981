"""The final state of a run and the rows of its result: weight, slack and loose lines, numbers as they are shown."""

import dataclasses
import re
import shutil

import numpy as np
import pytest

import scenes
import scenes.readers.scene as readers
from master.commands import run_scene
from master.coupling import SCHEMES, Coupling, coupled_run
from master.coupling.checkpoint import Files
from master.report import final_state, result_rows, summary
from master.report.page import cell
from master.report.state import loose_lines
from scenes.cores import Core


def flown(name, **given):
    """Scene, run and rows of the result of a scene at given parameters."""
    scene = scenes.load(name)
    run = coupled_run(Coupling.in_process(scene, given), SCHEMES["iqn-ils"](), stability=False)
    content = summary(run, {"scene": scene.name, "scheme": "iqn-ils", "backend": "in-process"})
    return scene, run, dict(result_rows(scene, run, content))


@pytest.mark.parametrize("given", [{}, {"wing_mass": 20.0, "gravity": 3.71}], ids=["earth", "heavy wing on mars"])
def test_what_the_air_carries_less_the_weight_hangs_on_the_supports(given):
    _, run, rows = flown("v3_kite", wind_speed=12.0, **given)
    aero, structural = run.blocks["aero"], run.blocks["structural"]
    weight, mass = (float(part.split()[0]) for part in rows["weight"].split(","))
    carried = aero["force"][2] + aero["line_force"][2] - structural["support_force"][2]
    assert carried == pytest.approx(weight, abs=0.006)  # as printed; the residual is far below
    assert mass * float(structural["gravity"]) == pytest.approx(weight, rel=6e-4)  # four digits


def test_scene_without_mass_and_lines_has_no_rows_for_them():
    assert not {"weight", "slack lines", "loose lines"} & flown("typical_section")[2].keys()


def test_lines_that_hold_next_to_nothing_are_named_with_what_they_hold():
    # at 12 m/s the wind on two steering lines and their weight keep them from slack
    scene, run, rows = flown("v3_kite", wind_speed=12.0)
    assert rows["slack lines"] == "none"
    assert rows["loose lines"] == "br6_right (0.44 N), br6_left (0.44 N)"
    largest = float(rows["largest line tension"].split()[0])
    for name in ("br6_right", "br6_left"):
        assert 0.0 < run.blocks["structural"]["tension"][scene.members.names.index(name)] < 0.01 * largest
    calm = flown("v3_kite", wind_speed=8.0)[2]
    assert calm["loose lines"] == "none"
    assert calm["slack lines"] == "br6_right, br6_left"


def test_loose_is_above_zero_and_below_a_hundredth_of_the_largest_line_tension():
    tension = np.array([100.0, 1.0, 0.99, 1e-9, 0.0, -1.0, 0.5, 900.0])
    two_way = np.array([False, False, False, False, False, False, True, True])  # springs do not count
    np.testing.assert_array_equal(np.flatnonzero(loose_lines(tension, two_way)), [2, 3])
    assert not loose_lines(tension, np.ones(8, bool)).any()


def test_page_shows_the_rounding_of_zeros_as_zero_and_small_numbers_as_they_are():
    assert cell(np.array([122.0, -1.6e-14, -0.0])) == ("(122, 0, 0)", True)
    assert cell(np.array([1.0, 2e-12])) == ("(1, 2e-12)", True)
    assert cell(-1.6e-17) == ("-1.6e-17", True)  # of what size, nobody knows
    assert cell(-0.0) == ("0", True)


def test_undeformed_shape_follows_a_rigid_pitch():
    scene, run, _ = flown("v3_kite", wind_speed=8.0)
    angle, about = 0.2, scene.members.nodes[scene.pivot]
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    position = about + (scene.members.nodes - about) @ turn.T
    displacement = scene.interface.weights @ position - scene.interface.nodes
    blocks = {
        "aero": run.blocks["aero"],
        "structural": {**run.blocks["structural"], "position": position, "displacement": displacement},
    }
    state = final_state(scene, dataclasses.replace(run, blocks=blocks))
    assert state.turn == pytest.approx(np.rad2deg(angle), abs=1e-10)  # closed form
    np.testing.assert_allclose(state.frame.undeformed, position, atol=1e-12)


def reeled_kite(tmp_path):
    """A copy of the V3 kite whose power tape is reeled, by name."""
    folder = shutil.copytree(scenes.load("v3_kite").folder, tmp_path / "reelkite")
    file = folder / "scene.toml"
    text = re.sub(r"^power_tape_length = .*\n", "", file.read_text(), flags=re.MULTILINE)
    file.write_text(text + '\n[structure.reels]\npower_reel = ["power_tape"]\n')
    return folder


def test_elements_have_the_rest_length_and_tension_that_were_solved(tmp_path):
    folder = reeled_kite(tmp_path)
    for name, given, element, length in (
        ("v3_kite", {"power_tape_length": 1.5}, "power_tape", 1.5),
        (folder, {"power_reel": 3.0, "line_modulus": 50e9}, "power_tape", 3.0),
    ):
        scene, run, _ = flown(name, wind_speed=12.0, **given)
        frame, blocks = final_state(scene, run).frame, run.blocks["structural"]
        row = frame.names.index(element)
        assert frame.rest_length[row] == length
        stretched = blocks["line_modulus"] * scene.members.area[row] * (frame.length[row] / length - 1.0)
        assert frame.tension[row] == pytest.approx(stretched, rel=1e-9)  # EA eps of the same positions


def test_tension_and_rest_length_are_those_of_the_line_as_reeled():
    scene = scenes.load("tether_in_wind", {"line_drag": "on"})
    core = scene.structural_core()
    core.set("tether_length_rate", 2.0)
    start, dt, steps = float(core.get("tether_length")), 0.05, 4
    for k in range(steps):
        core.step(k * dt, dt)
    length = start + 2.0 * steps * dt
    assert float(core.get("tether_length_present")) == pytest.approx(length, rel=1e-14)
    rest = core.get("rest_length")
    assert rest.sum() == pytest.approx(length, rel=1e-14)
    m, x = scene.members, core.get("position")
    (chains,) = m.chains
    now = np.linalg.norm(np.diff(x[chains.nodes], axis=1), axis=2).sum(axis=1)
    expected = np.maximum(float(core.get("line_modulus")) * m.area * (now / rest - 1.0), 0.0)
    assert core.get("tension") == pytest.approx(expected, rel=1e-9, abs=1e-6)
    assert float(core.get("slack_lines")) == np.count_nonzero(expected <= 0.0)


@pytest.mark.parametrize(("backend", "cores"), [("in-process", 2), ("fmu", 4)])  # FMUs have cores of their own
def test_a_run_reads_its_scene_once_and_makes_each_core_once(tmp_path, monkeypatch, backend, cores):
    counts = {"scenes": 0, "cores": 0}

    def counted(what, function):
        def call(*args, **options):
            counts[what] += 1
            return function(*args, **options)

        return call

    monkeypatch.setattr(Core, "__init__", counted("cores", Core.__init__))
    monkeypatch.setattr(readers, "read_members", counted("scenes", readers.read_members))
    choices = {
        "scheme": "iqn-ils", "backend": backend, "relaxation": None, "tolerance": 1e-4, "force_tolerance": 1e-2,
        "max_iterations": 50, "stability": False, "report": True, "order": "serial",
    }  # fmt: skip
    path = tmp_path / "kite.ckp"
    assert run_scene("v3_kite", choices, {"chord": "design", "wind_speed": "10"}, tmp_path / "a", Files(path)) == 0
    assert counts == {"scenes": 1, "cores": cores}
    assert run_scene("v3_kite", choices, {}, tmp_path / "b", Files(restart=path)) == 0
    assert counts == {"scenes": 2, "cores": 2 * cores}
