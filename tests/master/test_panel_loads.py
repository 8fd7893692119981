"""The loads on the panels as a run shows them: net, in every file, whichever way they went from flow to structure."""

import csv
import json

import meshio
import numpy as np
import pytest

import scenes
from interface import area_vectors
from master.commands import run_scene
from master.coupling import SCHEMES, Coupling, InProcessParticipant, coupled_run, simulate
from master.report import final_state, summary, write_report
from master.report.panels import FIELDS, panel_loads
from master.report.vtk import wing_file

CHOICES = {
    "scheme": "iqn-ils", "order": "serial", "backend": "in-process", "relaxation": None, "tolerance": 1e-5,
    "force_tolerance": 0.01, "max_iterations": 200, "stability": False, "report": True,
}  # fmt: skip
ROUNDING = 1e-12  # of the size of the force: of a sum over some hundred panels


@pytest.fixture(scope="module", params=["v3_kite", "v3_kite_detailed", "typical_section"])
def flown(request, tmp_path_factory):
    """A scene as flown, and the folder with its files."""
    scene, out = scenes.load(request.param), tmp_path_factory.mktemp(request.param)
    run = coupled_run(Coupling.in_process(scene, scene.with_trim({})), SCHEMES["iqn-ils"](), stability=False)
    assert run_scene(request.param, CHOICES, {}, out) == 0
    return scene, run, out


def fields(folder):
    """The fields of the panels in wing.vtu."""
    return {name: np.concatenate(parts) for name, parts in meshio.read(folder / "wing.vtu").cell_data.items()}


def table(folder):
    """The columns of panels.csv."""
    names, *rows = csv.reader((folder / "panels.csv").read_text().splitlines())
    return dict(zip(names, np.array(rows, float).T, strict=True))


def test_load_times_area_adds_up_to_the_aerodynamic_force(flown):
    _, run, folder = flown
    force, found, columns = run.blocks["aero"]["force"], fields(folder), table(folder)
    size = np.linalg.norm(force)
    np.testing.assert_allclose(found["area_m2"] @ found["load_Pa"], force, rtol=0.0, atol=ROUNDING * size)
    summed = [columns["area_m2"] @ columns[f"load_{axis}_Pa"] for axis in "xyz"]
    np.testing.assert_allclose(summed, force, rtol=0.0, atol=ROUNDING * size)


def test_load_across_the_wind_is_the_lift_and_along_it_the_drag(flown):
    scene, run, folder = flown
    aero, found = run.blocks["aero"], fields(folder)
    along = aero["wind_direction"] / np.linalg.norm(aero["wind_direction"])
    up = np.array([-along[2], 0.0, along[0]])  # z, where the wind is level
    q_area = 0.5 * float(aero["air_density"]) * float(aero["wind_speed"]) ** 2 * scene.aero.reference_area
    force, size = found["area_m2"] @ found["load_Pa"], ROUNDING * np.linalg.norm(aero["force"])
    assert force @ up == pytest.approx(float(aero["CL"]) * q_area, abs=size)
    assert force @ along == pytest.approx(float(aero["CD"]) * q_area, abs=size)


def test_pressure_that_strips_exchange_is_no_load_but_their_pitching_couple(flown):
    """Where lift and drag travel as shear, pressure alone carries about nothing."""
    scene, run, folder = flown
    found, up = fields(folder), run.blocks["aero"]["force"][2]
    area = area_vectors((scene.interface.nodes + run.blocks["aero"]["displacement"])[scene.interface.panels])
    carried = found["exchanged_pressure_Pa"] @ area[:, 2]
    if "exchanged_shear_Pa" in found:
        assert abs(carried) < 0.01 * up  # -1 of 1133 N; the couples cancel but for the angle between fore and aft
    else:
        assert carried == pytest.approx(up, rel=ROUNDING)
    assert not {"pressure_Pa", "shear_Pa"} & found.keys()  # what would be taken for the load


def test_load_is_pressure_difference_along_the_normal_and_what_is_tangential(flown):
    scene, run, folder = flown
    found = fields(folder)
    area = area_vectors((scene.interface.nodes + run.blocks["aero"]["displacement"])[scene.interface.panels])
    normal = area / np.linalg.norm(area, axis=1)[:, None]
    size = ROUNDING * np.abs(found["load_Pa"]).max()
    parts = found["delta_p_Pa"][:, None] * normal + found["tangential_Pa"]
    np.testing.assert_allclose(parts, found["load_Pa"], rtol=0.0, atol=size)
    np.testing.assert_allclose(np.sum(found["tangential_Pa"] * normal, axis=1), 0.0, atol=size)


def test_pressure_coefficient_is_over_the_dynamic_pressure_of_the_wind(flown):
    _, run, folder = flown
    aero, found = run.blocks["aero"], fields(folder)
    q = 0.5 * float(aero["air_density"]) * float(aero["wind_speed"]) ** 2
    np.testing.assert_allclose(found["C_p"] * q, found["delta_p_Pa"], rtol=ROUNDING)
    # a kite in attached flow: suction and pressure side differ by less than three dynamic pressures
    assert 0.0 < found["area_m2"] @ found["C_p"] / found["area_m2"].sum() < 3.0


def test_table_and_mesh_hold_the_same_fields(flown):
    _, _, folder = flown
    found, columns = fields(folder), table(folder)
    for name in FIELDS.keys() & found.keys():
        if found[name].ndim == 1:
            np.testing.assert_array_equal(columns[name], found[name])
        else:
            parts = [columns[f"{name.removesuffix('_Pa')}_{axis}_Pa"] for axis in "xyz"]
            np.testing.assert_array_equal(np.stack(parts, axis=1), found[name])


def test_page_says_what_each_field_is(flown):
    scene, run, folder = flown
    text = (folder / "report.html").read_text()
    for name in fields(folder).keys() - {"panel"}:
        assert f">{name}<" in text
        assert FIELDS[name][2] in text
    assert final_state(scene, run).surface.loads.fields().keys() == fields(folder).keys() - {"panel"}


def plate(tilt=0.0):
    """Nodes and the panel of a plate of 2 m2 whose normal is turned from z by `tilt` rad about y."""
    c, s = np.cos(tilt), np.sin(tilt)
    flat = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    return np.column_stack([c * flat[:, 0], flat[:, 1], -s * flat[:, 0]]), np.array([[0, 1, 2, 3]])


AIR = {"air_density": np.array(1.2), "wind_speed": np.array(10.0), "wind_direction": np.array([2.0, 0.0, 0.0])}


@pytest.mark.parametrize("tilt", [0.0, 0.3, -1.2])
def test_pressure_difference_is_the_normal_part_of_both_exchanged_loads(tilt):
    nodes, panels = plate(tilt)
    blocks = {"pressure": np.array([3.0]), "shear": np.array([[0.0, 0.0, 10.0]])}
    loads = panel_loads(nodes, panels, blocks | AIR)
    assert loads.delta_p == pytest.approx([3.0 + 10.0 * np.cos(tilt)], rel=1e-14)  # closed form
    np.testing.assert_allclose(loads.load, [[3.0 * np.sin(tilt), 0.0, 3.0 * np.cos(tilt) + 10.0]], atol=1e-14)
    assert np.linalg.norm(loads.tangential) == pytest.approx(10.0 * abs(np.sin(tilt)), abs=1e-14)
    assert loads.C_p == pytest.approx(loads.delta_p / 60.0, rel=1e-14)  # rho U^2 / 2


def test_panel_that_moves_with_the_wind_meets_less_of_it():
    nodes, panels = plate()
    blocks = {"pressure": np.array([30.0]), **AIR}
    for speed, q in ((0.0, 60.0), (5.0, 15.0), (-10.0, 240.0)):
        moving = {"velocity": np.tile([speed, 0.0, 0.0], (4, 1))}
        assert panel_loads(nodes, panels, blocks | moving).C_p == pytest.approx([30.0 / q], rel=1e-14)
    carried = {"velocity": np.tile([10.0, 0.0, 0.0], (4, 1))}
    assert np.isnan(panel_loads(nodes, panels, blocks | carried).C_p).all()


def test_gust_counts_in_the_dynamic_pressure():
    nodes, panels = plate()
    blocks = {"pressure": np.array([30.0]), **AIR, "present_wind_speed": np.array(20.0)}
    assert panel_loads(nodes, panels, blocks).C_p == pytest.approx([30.0 / 240.0], rel=1e-14)


@pytest.mark.parametrize("scheme", ["explicit", "aitken"])
def test_loads_of_a_moving_kite_add_up_to_its_force(scheme, tmp_path):
    """Explicit too, where structure and flow are a step apart: loads are those of the shape that the flow was given."""
    scene = scenes.load("v3_kite_dynamic")
    sides = {side: InProcessParticipant(core) for side, core in scene.cores().items()}
    run = simulate(sides, stop_time=0.4, step=0.04, scheme_name=scheme)
    state, force = final_state(scene, run), run.blocks["aero"]["force"]
    (tmp_path / "wing.vtu").write_bytes(wing_file(state.surface))
    found = fields(tmp_path)
    size = ROUNDING * np.linalg.norm(force)
    np.testing.assert_allclose(found["area_m2"] @ found["load_Pa"], force, rtol=0.0, atol=size)


@pytest.mark.parametrize(("name", "stagnation"), [("box_wing", 1.0), ("swept_wing", 0.5)])  # cos^2 of 45 deg of sweep
def test_pressure_coefficient_of_a_closed_body_is_positive_in_stagnation_and_negative_in_suction(
    name, stagnation, tmp_path
):
    given = {"variant": "sketch", "internal_pressure_coefficient": "0.7"}  # which is not in C_p
    assert run_scene(name, CHOICES, given, tmp_path) == 0
    scene, found = scenes.load(name, {"variant": "sketch"}), fields(tmp_path)["C_p"]
    np.testing.assert_array_equal(found, table(tmp_path)["C_p"])
    assert found.max() == pytest.approx(stagnation, abs=0.05)  # panels near the nose are as large as its radius
    up = area_vectors(scene.interface.nodes[scene.interface.panels])[:, 2]
    above, below = (np.maximum(sign * up, 0.0) for sign in (1.0, -1.0))
    suction, pressure = found @ above / above.sum(), found @ below / below.sum()
    assert suction < -0.2
    lift = json.loads((tmp_path / "summary.json").read_text())["outputs"]["CL"]
    assert pressure - suction == pytest.approx(lift, rel=0.03)  # along z and not across the wind, on the projected area


def test_run_without_a_flow_has_no_pressure_coefficient_and_the_shape_that_hangs(tmp_path):
    scene = scenes.load("v3_hanging_test")
    assert run_scene("v3_hanging_test", {**CHOICES, "report": False}, {}, tmp_path) == 0
    assert "C_p" not in table(tmp_path)
    names, *rows = csv.reader((tmp_path / "interface.csv").read_text().splitlines())
    at = dict(zip(names, np.array(rows, float).T, strict=True))
    _, *nodes = csv.reader((tmp_path / "nodes.csv").read_text().splitlines())
    position = np.array([row[1:] for row in nodes], float)
    shape = np.stack([at[f"{axis}_m"] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(shape, scene.interface.weights @ position, atol=1e-12)  # metres of some 10
    assert np.abs(at["dz_m"]).max() > 0.1


def test_report_of_a_model_that_sends_pressure_only_shows_it_as_the_load(tmp_path):
    scene = scenes.load("typical_section")
    run = coupled_run(Coupling.in_process(scene), SCHEMES["iqn-ils"](), stability=False)
    content = summary(run, {"scene": scene.name, **CHOICES})
    write_report(tmp_path, scene, run, content)
    found = fields(tmp_path)
    assert "exchanged_shear_Pa" not in found
    np.testing.assert_allclose(found["delta_p_Pa"], run.blocks["aero"]["pressure"], rtol=1e-14)
