"""Sections of an inflatable wing: closed forms of their profiles; what tables and plots show of tubes and canopy."""

import csv
import dataclasses

import meshio
import numpy as np
import pytest
from matplotlib.text import Text

import scenes
from master.coupling import SCHEMES, Coupling, coupled_run
from master.report import RESULTS, final_state, result_rows, summary, write_report, write_state
from master.report.billowing import billowing_figure
from master.report.page import _structure, _tubes
from master.report.sections import normals, sections, strut_columns, wing_sections
from master.report.shape import shape_figure
from master.report.wing import largest, wing_results, wing_rows


@pytest.fixture(scope="module")
def hanging():
    scene = scenes.load("v3_hanging_test")
    run = coupled_run(Coupling.in_process(scene, {}), SCHEMES["iqn-ils"](), stability=False)
    assert run.status == "converged"
    return scene, run


@pytest.fixture(scope="module")
def folder(hanging, tmp_path_factory):
    """The files of the run, tables and report."""
    scene, run = hanging
    out = tmp_path_factory.mktemp("hanging")
    labels = {"position": scene.members.labels, "tension": scene.members.names}
    blocks = {**run.blocks["structural"], **run.blocks["aero"]}
    written = write_state(out, blocks, labels, scene.interface, scene.members.wing)
    content = summary(run, {"scene": scene.name, "scheme": "iqn-ils", "backend": "in-process"})
    written += write_report(out, scene, run, content)
    assert set(written) <= set(RESULTS)
    return out


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def arc_wing(angle=0.6, chord=1.7, columns=5, stations=9):
    """Columns of one circular arc, opening angle 2 `angle`, side by side in y: nodes (n,3) m and their grid."""
    radius = 0.5 * chord / np.sin(angle)
    turn = np.linspace(-angle, angle, stations)
    profile = np.stack([radius * np.sin(turn), 0.0 * turn, radius * (np.cos(turn) - np.cos(angle))], axis=1)
    nodes = [profile + np.array([0.1 * c, 0.8 * c, 0.0]) for c in range(columns)]
    return np.concatenate(nodes), np.arange(columns * stations).reshape(columns, stations)


@pytest.mark.parametrize("angle", [0.05, 0.6, 1.2])
def test_column_bent_to_a_circular_arc_has_the_sagitta_of_the_arc(angle):
    nodes, grid = arc_wing(angle)
    found = sections(nodes, nodes * [1.0, 1.0, 0.0], grid, np.zeros(len(grid), bool))
    np.testing.assert_allclose(found.chord, 1.7, rtol=1e-14)
    np.testing.assert_allclose(found.camber, 0.5 * np.tan(0.5 * angle), rtol=1e-12)  # R (1 - cos a) / (2 R sin a)
    np.testing.assert_allclose(found.place, 0.5, rtol=1e-12)
    np.testing.assert_allclose(found.arc, np.hypot(0.1, 0.8) * np.arange(-2, 3), rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(found.design_camber, 0.0)
    hollow = sections(nodes * [1.0, 1.0, -1.0], nodes, grid, found.strut)  # towards pressure
    np.testing.assert_allclose(hollow.camber, -found.camber, rtol=1e-12)
    np.testing.assert_allclose(hollow.design_camber, found.camber, rtol=1e-12)


def test_normal_of_the_sections_points_along_the_area_vectors_of_the_panels():
    scene = scenes.load("v3_kite_detailed")
    grid, nodes = scene.members.wing.grid, scene.members.nodes
    bays = len(grid) - 1
    corners = scene.interface.nodes[scene.interface.panels]
    area = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]).reshape(-1, bays, 3).sum(axis=0)
    beside = np.concatenate([area[:1], area]) + np.concatenate([area, area[-1:]])  # left and right of each column
    beside /= np.linalg.norm(beside, axis=1)[:, None]
    # the bays beside a column meet at up to 30 deg, and the panels of a tapered bay are not normal to its chord
    assert np.sum(normals(nodes[grid]) * beside, axis=1).min() > 0.95


def test_rigid_rotation_leaves_the_sections_unchanged(hanging):
    scene, run = hanging
    position = run.blocks["structural"]["position"]
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)  # no mirror
    before = wing_sections(scene.members.wing, position)
    after = wing_sections(scene.members.wing, position @ turn.T + [1.0, -2.0, 3.0])
    for name in ("arc", "chord", "x", "z"):
        # rounding of positions of 10 m over chords of 0.3 m
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), atol=1e-13)


def test_undeformed_wing_is_flat_and_its_canopy_sags_when_it_hangs(hanging):
    scene, run = hanging
    flat = wing_sections(scene.members.wing, scene.members.nodes)
    np.testing.assert_allclose(flat.camber, 0.0, atol=1e-14)  # rounding
    sagged = wing_sections(scene.members.wing, run.blocks["structural"]["position"])
    assert sagged.camber[sagged.middle].max() > 5e-3  # the thesis shows some percent, towards suction
    np.testing.assert_array_equal(sagged.design_z, flat.z)


def test_struts_are_the_columns_that_lie_on_tubes_and_bays_lie_between():
    wing = scenes.load("v3_kite_detailed").members.wing
    found = wing_sections(wing, wing.nodes)
    assert found.strut.sum() == len({t for t in wing.tubes.tube if t.startswith(("strut", "tip"))})
    assert not found.strut[found.middle].any()
    np.testing.assert_array_equal(found.middle, (len(found.strut) - 1 - found.middle)[::-1])  # left as right
    assert not strut_columns(wing.grid[:, [0, -1]], wing.tubes.ends).any()  # nothing between the edges to tell


def test_wing_without_a_grid_has_no_sections(hanging):
    position = hanging[1].blocks["structural"]["position"]
    assert wing_sections(None, position) is None
    assert wing_sections(hanging[0].members.wing, np.full_like(position, np.nan)) is None


def test_tables_give_back_tubes_strains_and_sections(hanging, folder):
    scene, run = hanging
    blocks, wing = run.blocks["structural"], scene.members.wing
    tubes = rows(folder / "tubes.csv")
    assert tuple(row["tube"] for row in tubes) == wing.tubes.names
    expected = {"radius_m": wing.tubes.radius, "moment_over_collapse": blocks["tube_load"]}
    for name, values in (expected | {"strain": blocks["tube_strain"]}).items():
        np.testing.assert_array_equal([float(row[name]) for row in tubes], values)
    elements = [float(row["strain"]) for row in rows(folder / "elements.csv")]
    np.testing.assert_array_equal(elements, blocks["strain"])
    found, table = wing_sections(wing, blocks["position"]), rows(folder / "sections.csv")
    np.testing.assert_array_equal([float(r["z_over_c"]) for r in table], found.z.reshape(-1))
    np.testing.assert_array_equal([float(r["x_over_c"]) for r in table], found.x.reshape(-1))
    np.testing.assert_array_equal([float(r["design_z_over_c"]) for r in table], found.design_z.reshape(-1))
    arc = [float(r["arc_m"]) for r in table]
    np.testing.assert_array_equal(arc, np.repeat(found.arc, found.x.shape[1]))
    struts = {int(r["column"]) - 1 for r in table if r["strut"] == "1"}
    assert struts == set(np.flatnonzero(found.strut))


def test_structure_file_holds_the_tubes_behind_the_elements(hanging, folder):
    scene, run = hanging
    blocks, tubes = run.blocks["structural"], scene.members.wing.tubes
    mesh = meshio.read(folder / "structure.vtu")
    data = {name: values[0] for name, values in mesh.cell_data.items()}
    last = data["kind"] == 3
    assert np.count_nonzero(data["kind"] == 4) == len(scene.members.wing.springs)
    assert not np.any(data["slack"][data["kind"] == 4])  # slack lines are lines
    np.testing.assert_array_equal(mesh.cells_dict["line"][last], tubes.ends)
    np.testing.assert_array_equal(data["tube_load"][last], blocks["tube_load"])
    np.testing.assert_array_equal(data["tube_strain"][last], blocks["tube_strain"])
    assert not data["tube_load"][~last].any()
    assert not data["strain"][last].any()
    np.testing.assert_array_equal(data["strain"][~last], blocks["strain"][data["element"][~last] - 1])


def overloaded(hanging):
    """The state with three parts of tubes beyond collapse."""
    state = final_state(*hanging)
    load = state.frame.tubes.load.copy()
    load[[3, 50, 70]] = [1.0, 1.4, 1.2]
    tubes = dataclasses.replace(state.frame.tubes, load=load)
    return dataclasses.replace(state, frame=dataclasses.replace(state.frame, tubes=tubes))


def test_shape_shows_tubes_and_what_collapsed_of_them_and_no_canopy_springs(hanging):
    state = overloaded(hanging)
    figure = shape_figure(state, "a scene")
    for axes in figure.axes[:3]:
        count = {c.get_gid(): len(c.get_segments()) for c in axes.collections if c.get_gid()}
        assert (count["tubes"], count["collapsed"], count["springs"]) == (111, 3, 0)
        # the width of a line in points and the limits of its axes in m tell the diameter
        (fallen,) = (c for c in axes.collections if c.get_gid() == "collapsed")
        metre = 72.0 * axes.bbox.width / figure.dpi / np.ptp(axes.get_xlim())
        radius = state.frame.tubes.radius[state.frame.tubes.collapsed]
        np.testing.assert_allclose(fallen.get_linewidths(), 2.0 * radius * metre, rtol=1e-9)  # rounding
    (legend,) = (axes.get_legend() for axes in figure.axes if axes.get_legend())
    labels = [text.get_text().replace("\n", " ") for text in legend.get_texts()]
    assert {"tubes, width to scale (38)", "collapsed tube parts (3 of 114)"} <= set(labels)
    assert not any("springs" in label for label in labels)


def test_page_has_a_row_per_tube_the_most_loaded_first_and_marks_the_collapsed(hanging):
    state = overloaded(hanging)
    tubes, table = state.frame.tubes, _tubes(state.frame.tubes)
    assert sum(int(row[1][0]) for row in table["rows"]) == len(tubes.names)
    loads = [float(row[3][0]) for row in table["rows"]]
    assert loads == sorted(loads, reverse=True)
    assert loads[:3] == [1.4, 1.2, 1.0]
    assert [row[4][0] for row in table["rows"][:3]] == [tubes.names[i] for i in (50, 70, 3)]
    assert table["marked"] == {0, 1, 2}
    for row in table["rows"]:
        own = [i for i, tube in enumerate(tubes.tube) if tube == row[0][0]]
        assert row[3][0] == f"{tubes.load[own].max():.6g}"
        assert row[5][0] == f"{100.0 * tubes.strain[own].max():.6g}"


def test_page_counts_the_slack_canopy_and_does_not_call_it_slack_lines(hanging):
    state = final_state(*hanging)
    tables = {table["title"].partition(" (")[0]: table for table in _structure(state.frame)}
    canopy = tables["Canopy"]
    slack = np.count_nonzero(state.frame.tension[state.frame.canopy] == 0.0)
    assert f"{slack} of them slack" in canopy["title"]
    assert slack > 0
    assert not canopy["marked"]
    assert len(canopy["rows"]) == 20
    assert not tables["Springs"]["rows"]
    assert len(tables["Lines"]["rows"]) == np.count_nonzero(hanging[0].members.area > 0.0)


def test_largest_values_name_left_and_right_together_and_leave_out_zeros():
    values = np.array([0.0, 0.5, 2.0, -3.0, 2.0 * (1.0 - 1e-9), 1.0])
    found = largest(values, "abcdef")
    assert found == [
        {"value": 2.0, "names": ["c", "e"]},
        {"value": 1.0, "names": ["f"]},
        {"value": 0.5, "names": ["b"]},
    ]
    assert largest(np.zeros(4), "abcd") == []


def test_result_of_the_wing_is_that_of_its_blocks(hanging):
    scene, run = hanging
    blocks, tubes = run.blocks["structural"], scene.members.wing.tubes
    found = wing_results(scene.members, blocks)
    for name, values in (("moment_over_collapse", blocks["tube_load"]), ("strain", blocks["tube_strain"])):
        entries = found["tubes"][f"largest_{name}"]
        assert entries[0]["value"] == values.max()
        assert all(entry["value"] == pytest.approx(values[tubes.names.index(n)], rel=1e-4)  # counts as one
                   for entry in entries for n in entry["names"])  # fmt: skip
    assert found["tubes"]["collapsed"] == {}
    assert found["canopy"]["springs"] + np.count_nonzero(scene.members.area) == len(blocks["strain"])
    sections = wing_sections(scene.members.wing, blocks["position"])
    assert abs(found["largest_camber"]["camber_over_c"]) == pytest.approx(np.abs(sections.camber).max(), abs=1e-9)
    fallen = {**blocks, "tube_load": np.where(np.arange(len(tubes.names)) == 7, 1.25, blocks["tube_load"])}
    assert dict(wing_rows(scene.members, fallen))["collapsed parts of tubes"] == f"{tubes.names[7]} (125 %)"
    assert wing_results(scenes.load("v3_kite").members, {}) is None


def test_kite_in_still_air_shows_no_wind_no_flow_and_which_way_its_weight_pulls(hanging, folder):
    scene, run = hanging
    figure = shape_figure(final_state(scene, run), "a scene", gravity=np.array([0.0, 0.0, 9.81]))
    texts = [text.get_text() for text in figure.findobj(Text)]
    assert not any("wind" in text for text in texts)
    assert "gravity 9.81 m/s\u00b2" in texts
    (arrow,) = (a for axes in figure.axes for a in axes.texts if getattr(a, "arrow_patch", None))
    assert arrow.xy[1] > arrow.xyann[1]  # head above tail: the scene hangs upside down
    figure.draw_without_rendering()
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert min(box.x0, box.y0) >= 0.0
    assert (box.x1 <= width, box.y1 <= height) == (True, True)
    assert not any((folder / f"{name}.png").exists() for name in ("strips", "polars"))
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "in still air" in page
    content = summary(run, {"scene": scene.name, "scheme": "iqn-ils", "backend": "in-process"})
    assert "N towards +z" in dict(result_rows(scene, run, content))["weight"]


def test_billowing_figure_is_on_the_page_and_in_the_report(hanging, folder):
    scene, run = hanging
    found = wing_sections(scene.members.wing, run.blocks["structural"]["position"])
    lopsided = np.where(found.arc[:, None] > 0.0, 2.0, -1.0) * found.z
    changes = ({}, {"z": 30.0 * found.z}, {"z": 0.0 * found.z}, {"z": lopsided}, {"design_z": 1.5 * found.z + 0.01})
    for shown in (dataclasses.replace(found, **change) for change in changes):
        figure = billowing_figure(shown, "a scene")
        profiles = figure.axes[0]
        assert sum(line.get_gid() == "bay" for line in profiles.lines) == len(found.middle)
        low, high = profiles.get_ylim()
        assert low <= shown.z.min() <= shown.z.max() <= high
        figure.draw_without_rendering()
        box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
        assert min(box.x0, box.y0) >= 0.0
        assert box.x1 <= width
        assert box.y1 <= height
        texts = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
        assert min(text.get_fontsize() for text in texts) >= 8.0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "billowing.png" in page
    assert (folder / "billowing.svg").exists()
