"""Meshes of bodies that are drawn any way: what they are is told by the wind of their scene."""

import numpy as np
import pytest

import scenes
from interface.vectors import azimuth_axes
from master import polar
from scenes.builders.profiles import naca
from scenes.builders.wings import Planform, span_shares
from tests.aero.closed_wings import wing
from tests.scenes.mesh_files import msh2

SURFACE = wing(4, 16, root=1.0, tip=0.6, sweep=0.3)
AREA = 4.8


def mesh(path, nodes, panels):
    msh2(path, nodes, [(1, tuple(int(n) + 1 for n in (p[:3] if p[2] == p[3] else p))) for p in panels])


def made(folder, azimuth, alpha=0.08, nodes=SURFACE.nodes, panels=SURFACE.panels):
    """The scene of a wing that is turned by an azimuth rad with its wind, its trailing edges to be found."""
    path = folder / "turned_mesh"
    path.mkdir(parents=True)
    turn = azimuth_axes(azimuth)
    mesh(path / "wing.msh", nodes @ turn.T, panels)
    wind = (turn @ [np.cos(alpha), 0.0, np.sin(alpha)]).tolist()
    (path / "scene.toml").write_text(
        'title = "turned"\n[body]\nshape = "mesh-file"\nmesh = "wing.msh"\n[aero]\nmethod = "panel"\n'
        f"wind_speed = 10.0\nwind_direction = {wind}\nreference_area = {AREA}\n"
    )
    return path


def looked(path):
    scene = scenes.load(path)
    core = scene.aero_core()
    core.look()
    return scene, core


@pytest.mark.parametrize("azimuth", [0.5, np.pi / 2.0, np.pi, -2.0])
def test_trailing_edges_are_found_and_loads_alike_whichever_way_the_nose_points(tmp_path, azimuth):
    plain, one = looked(made(tmp_path / "a", 0.0))
    scene, other = looked(made(tmp_path / "b", azimuth))
    pairs = [{frozenset(pair) for pair in s.interface.trailing_edges.tolist()} for s in (plain, scene)]
    assert pairs[0] == pairs[1] == {frozenset(pair) for pair in SURFACE.trailing_edges.tolist()}
    for name in ("CL", "CD", "span_efficiency", "alpha_mid"):
        assert float(other.get(name)) == pytest.approx(float(one.get(name)), rel=1e-6)  # equations solved to 1e-10
    names = [(s.name, len(s.strips), s.sign) for s in scene.wing_model.edge_strips.surfaces]
    assert names == [("wing", 8, 1.0)]
    at = scene.interface.nodes[scene.interface.trailing_edges].mean(axis=1) @ azimuth_axes(azimuth)[:, 1]
    assert np.all(np.diff(at[scene.wing_model.edge_strips.surfaces[0].strips]) > 0.0)  # from left to right


def test_wind_across_the_drawn_axes_is_not_along_the_span_of_a_mesh(tmp_path):
    _, core = looked(made(tmp_path, np.pi / 2.0))
    core.set("wind_direction", [0.0, 1.0, 0.05])
    core.step(0.0, 1.0)
    with pytest.raises(ValueError, match="along the span"):
        core.set("wind_direction", [1.0, 0.0, 0.0])


def test_the_polar_of_a_turned_mesh_is_that_of_the_mesh(tmp_path):
    found = [polar(str(made(tmp_path / str(k), angle)), [0.0, 4.0], [3.0]) for k, angle in enumerate((0.0, 2.5))]
    tables = [{n: np.array([p.coefficients[n] for p in f.points]) for n in f.points[0].coefficients} for f in found]
    for name, values in tables[0].items():
        assert tables[1][name] == pytest.approx(values, abs=1e-7), name


def test_a_wing_without_lift_has_no_span_efficiency(tmp_path):
    path = made(tmp_path, 0.0, alpha=0.0)
    scene, core = looked(path)
    assert float(core.get("span_efficiency")) == 0.0  # not the ratio of what rounding leaves
    assert dict(scene.wing_model.rows({v.name: core.get(v.name) for v in core.variables}))["span efficiency"] == (
        "none without lift"
    )
    efficiency = []
    for alpha in (1e-6, 0.05):
        core.set("wind_direction", [np.cos(alpha), 0.0, np.sin(alpha)])
        core.step(0.0, 1.0)
        efficiency.append(float(core.get("span_efficiency")))
    assert efficiency[0] == pytest.approx(
        efficiency[1], rel=2e-3
    )  # that of small angles: the change is of order alpha^2


def test_a_tip_that_ends_in_a_point_is_remarked_upon(tmp_path):
    # beyond the outermost sections triangles lead to a point
    plan = Planform(6.0, 1.0, 1.0).stations(span_shares(4, "uniform"))
    right = plan.sections(naca("0012").points(16))
    n = right.shape[1]
    left = right[:0:-1] * [1.0, -1.0, 1.0]
    sections = np.concatenate([left, right])[1:-1]
    tips = np.array([[0.3, -3.0, 0.0], [0.3, 3.0, 0.0]])
    nodes = np.concatenate([sections.reshape(-1, 3), tips])
    rows = np.arange(len(sections) * n).reshape(-1, n)
    after = np.roll(rows, -1, axis=1)
    quads = np.stack([rows[:-1], rows[1:], after[1:], after[:-1]], axis=2).reshape(-1, 4)
    a, b = len(nodes) - 2, len(nodes) - 1
    right_cap = [[rows[-1, i], b, after[-1, i], after[-1, i]] for i in range(n)]
    left_cap = [[rows[0, i], after[0, i], a, a] for i in range(n)]
    scene, core = looked(made(tmp_path, 0.0, nodes=nodes, panels=np.concatenate([quads, right_cap, left_cap])))
    (note,) = scene.notes()
    assert "2 trailing edges have no row of quads from side to side, as at a tip that ends in a point" in note
    assert note.endswith("cut the tip there")
    assert float(core.get("CL")) > 0.1
