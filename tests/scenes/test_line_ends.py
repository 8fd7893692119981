"""Lines that end in a node to which nothing else is joined: weights, loads and wind pull there, or nothing does."""

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app

GRAVITY, MODULUS, DIAMETER = 9.81, 50e9, 0.004
EA = MODULUS * 0.25 * np.pi * DIAMETER**2
NODES = "top,0,0,0,xyz\nmiddle,3,0,-4,\nend,6,0,-8,\n"
LINES = f"upper,top middle,5,{DIAMETER}\nlower,middle end,5,{DIAMETER}\n"
AIR = "[aero]\nwind_speed = 8.0\n[settings.line_drag]\ndefault = 'on'\noptions = ['on', 'off']\n"
AT_REST = "[dynamics]\nstart_in_equilibrium = true\n"


def _scene(folder, *more, masses="", loads="", density=0.0, nodes=NODES, lines=LINES, gravity=GRAVITY):
    """A folder `hung` with two lines in a row from a support, and what else scene.toml says."""
    folder = folder / "hung"
    folder.mkdir(exist_ok=True)
    tables = {
        "nodes": "node,x_m,y_m,z_m,fixed\n" + nodes,
        "lines": "name,nodes,rest_length_m,diameter_m\n" + lines,
        "masses": masses and "node,mass_kg\n" + masses,
        "loads": loads and "load,node,x,y,z\n" + loads,
    }
    structure = [f"line_modulus = {MODULUS}", f"line_density = {density}", f"gravity = {gravity}"]
    for name, text in tables.items():
        if text:
            (folder / f"{name}.csv").write_text(text)
            structure.append(f'{name} = "{name}.csv"')
    toml = ['title = "hung"', "[structure]", *structure, *(["load_values = { pull = 500.0 }"] if loads else [])]
    (folder / "scene.toml").write_text("\n".join([*toml, *more]) + "\n")
    return folder


def _refused(folder, **settings):
    with pytest.raises(scenes.SceneError) as caught:
        scenes.load(folder, settings)
    return str(caught.value)


def _settled(folder, **parameters):
    """The structural core after a first step, at rest in its equilibrium."""
    core = scenes.load(folder).structural_core()
    for name, value in parameters.items():
        core.set(name, value)
    core.step(0.0, 0.01)
    return core


def test_weight_at_the_end_of_a_line_hangs_below_its_support_and_stretches_it(tmp_path):
    """N = m g in the lower line and (m + m') g in the upper one, each longer by N l0 / EA."""
    core = _settled(_scene(tmp_path, AT_REST, masses="middle,1\nend,5\n"))
    force = GRAVITY * np.array([6.0, 5.0])
    # the start of a motion is an equilibrium to 1e-6 N, of forces of 50 N
    np.testing.assert_allclose(core.get("tension"), force, rtol=1e-7)
    depth = -np.cumsum(5.0 * (1.0 + force / EA))
    np.testing.assert_allclose(core.get("position")[1:, 2], depth, rtol=1e-8)


def test_load_at_the_end_of_a_line_draws_it_straight_against_its_weight(tmp_path):
    """The lower line points along pull and weight at the end, the upper one along both weights and the pull."""
    core = _settled(_scene(tmp_path, AT_REST, masses="middle,1\nend,5\n", loads="pull,end,0.3,0,1\n"))
    at_end = 500.0 * np.array([0.3, 0.0, 1.0]) / np.hypot(0.3, 1.0) - [0.0, 0.0, 5.0 * GRAVITY]
    force = np.array([at_end - [0.0, 0.0, GRAVITY], at_end])
    tension = np.linalg.norm(force, axis=1)
    legs = np.diff(core.get("position"), axis=0)
    # as above, of 500 N
    np.testing.assert_allclose(core.get("tension"), tension, rtol=1e-7)
    np.testing.assert_allclose(legs / np.linalg.norm(legs, axis=1)[:, None], force / tension[:, None], atol=1e-6)


def test_rope_over_a_sheave_carries_the_weight_at_its_free_end_in_both_legs(tmp_path):
    nodes, rope = "top,0,0,5,xyz\nsheave,1,0,5,xyz\nend,1,0,4.5,\n", f"rope,top sheave end,3,{DIAMETER}\n"
    core = _settled(_scene(tmp_path, AT_REST, masses="end,5\n", nodes=nodes, lines=rope))
    # the rope's elongation m g l0 / EA all shows below the sheave; equilibrium to 1e-6 N as above
    np.testing.assert_allclose(core.get("tension"), 5.0 * GRAVITY, rtol=1e-7)
    assert core.get("position")[2, 2] == pytest.approx(5.0 - 2.0 - 3.0 * 5.0 * GRAVITY / EA, abs=1e-8)


def test_line_without_weight_streams_in_the_wind(tmp_path):
    """Half of the wind's load w l on the lower line acts at its end, and the line points along it."""
    scene = scenes.load(_scene(tmp_path, AIR))
    structure, air = scene.structural_core(), scene.aero_core()
    for _ in range(3):
        air.set("displacement", structure.get("displacement"))
        air.step(0.0, 1.0)
        structure.set("line_load", air.get("line_load"))
        structure.step(0.0, 1.0)
    leg = np.diff(structure.get("position"), axis=0)[1]
    length = np.linalg.norm(leg)
    at_end = 0.5 * length * structure.get("line_load")[1]
    # equilibrium to 1e-6 N, of forces of 0.1 N
    np.testing.assert_allclose(structure.get("tension")[1] * leg / length, at_end, atol=2e-6)
    assert np.linalg.norm(at_end) > 0.05


@pytest.mark.parametrize("motion", [[AT_REST], [AIR, AT_REST]], ids=["at rest", "in wind"])
def test_load_and_gravity_set_to_nothing_leave_a_line_slack_or_to_the_wind(motion, tmp_path):
    folder = _scene(tmp_path, *motion, masses="middle,1\nend,5\n", loads="pull,end,0.3,0,1\n", density=970.0)
    core = _settled(folder, pull=0.0, gravity=0.0)
    assert core.get("slack_lines") == 2  # in the wind too: here a structure alone, whose loads are still zero
    np.testing.assert_array_equal(core.get("position"), scenes.load(folder).members.nodes)


PULLS = {
    "a mass": {"masses": "middle,1\nend,5\n"},
    "mass of the lines": {"density": 970.0},
    "a load": {"loads": "pull,end,0,0,1\n"},
    "a fixed end": {"nodes": NODES.replace("-8,\n", "-8,xyz\n")},
    "another line": {"lines": LINES + f"back,end top,10,{DIAMETER}\n"},
}


def test_line_end_at_which_nothing_pulls_is_refused_and_every_remedy_is_one(tmp_path):
    message = _refused(_scene(tmp_path, AIR), line_drag="off")
    for word in ("hung/lines.csv row 3: ", "'lower'", "'end'", "connect", "fix", "masses", "line_density", "loads"):
        assert word in message
    assert scenes.load(tmp_path / "hung", {"line_drag": "on"}).notes()  # the wind pulls
    assert "'lower'" in _refused(_scene(tmp_path, AIR, masses="end,0\n"), line_drag="off")
    for remedy in PULLS.values():
        scenes.load(_scene(tmp_path, AIR, **remedy), {"line_drag": "off"})


def test_end_that_slides_on_a_rail_is_free_too(tmp_path):
    nodes = NODES.replace("-8,\n", "-8,yz\n")
    assert "'lower'" in _refused(_scene(tmp_path, AIR, nodes=nodes), line_drag="off")
    scenes.load(_scene(tmp_path, AIR, nodes=nodes, loads="pull,end,1,0,0\n"), {"line_drag": "off"})


def test_free_particle_without_mass_is_refused_in_a_motion(tmp_path):
    with pytest.raises(scenes.SceneError, match=r"nodes.csv: node 'middle' has no mass"):
        scenes.load(_scene(tmp_path, AT_REST, loads="pull,end,0,0,1\n")).structural_core()


def test_ends_with_the_weight_of_their_line_alone_are_named_in_every_run(tmp_path):
    """A hanging rope, or a line that was to be joined to something: only who drew it knows."""
    bare = "lines that end free, where nothing but their own weight and the wind pulls: lower at node end"
    assert scenes.load(_scene(tmp_path, AT_REST, density=970.0)).notes() == [bare]
    words = ["run", str(tmp_path / "hung"), "--backend", "in-process", "--no-report", "--stop-time", "0.04"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0
    assert f"note: {bare}" in " ".join(done.output.split())
    for pull in (PULLS["a mass"], PULLS["a load"]):
        assert scenes.load(_scene(tmp_path, AT_REST, **{"density": 970.0, **pull})).notes() == []


def test_scaled_rope_is_as_bare_as_the_rope(tmp_path):
    scale = "[settings.scale]\ndefault = 2.0\nminimum = 0.1\nmaximum = 10.0"
    assert len(scenes.load(_scene(tmp_path, AT_REST, scale, density=970.0)).notes()) == 1
    heavy = _scene(tmp_path, AT_REST, scale, density=970.0, masses="end,0.5\n")
    assert scenes.load(heavy).notes() == []
