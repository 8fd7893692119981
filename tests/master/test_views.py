"""The views of a run: who looks from where sees what on which hand, and the same kite in wind from anywhere."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import scenes
from fmus.documentation.picture import VIEWS
from master.coupling import SCHEMES, Coupling, coupled_run
from master.report import final_state
from master.report.shape import shape_figure
from master.report.transient import shapes_figure
from master.report.views import FROM_ABOVE, FROM_LEFT, FROM_RIGHT, FROM_UPWIND, wind_axes, wind_of

AZIMUTHS = np.deg2rad([11.0, 45.0, 90.0, 180.0, 250.0])


@pytest.fixture(scope="module")
def kite():
    scene = scenes.load("v3_kite")
    return scene, coupled_run(Coupling.in_process(scene, scene.with_trim({})), SCHEMES["iqn-ils"](), stability=False)


def about_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turned(scene, run, angle):
    """The run as it would be in a wind turned by `angle` rad about the vertical through the bridle point."""
    turn, about = about_z(angle), scene.members.nodes[scene.pivot]
    blocks = {side: dict(values) for side, values in run.blocks.items()}
    nodes = scene.interface.nodes
    place = about + (nodes + run.blocks["structural"]["displacement"] - about) @ turn.T
    blocks["structural"]["displacement"] = blocks["aero"]["displacement"] = place - nodes
    blocks["structural"]["start_azimuth"] = np.array(angle)
    blocks["structural"]["position"] = about + (run.blocks["structural"]["position"] - about) @ turn.T
    for name in ("wind_direction", "shear", "line_load", "force"):
        blocks["aero"][name] = run.blocks["aero"][name] @ turn.T
    return dataclasses.replace(run, blocks=blocks)


def right_of(axes, left, right):
    """Whether the point `right` (2,) is shown right of `left` (2,)."""
    return axes.transData.transform(right)[0] > axes.transData.transform(left)[0]


@pytest.mark.parametrize(
    ("view", "viewer"),
    [(FROM_UPWIND, [-1, 0, 0]), (FROM_LEFT, [0, -1, 0]), (FROM_RIGHT, [0, 1, 0]), (FROM_ABOVE, [0, 0, 1])],
    ids=["upwind", "left", "right", "above"],
)
def test_a_picture_is_seen_from_where_its_title_says(view, viewer):
    """Right x up points to who looks; the wind blows along x, and the left wing of a kite that faces it is at y < 0."""
    np.testing.assert_array_equal(view.viewer, viewer)


def test_pictures_in_fmus_are_seen_from_where_their_titles_say():
    for title, right, up in VIEWS:
        viewer = np.cross(right, up)
        for word, way in (("behind", [1, 0, 0]), ("left", [0, -1, 0]), ("above", [0, 0, 1])):
            seen = viewer @ np.array(way)
            assert seen > 0.3 if word in title else abs(seen) < 1e-12


@pytest.mark.parametrize("azimuth", [0.0, *AZIMUTHS])
def test_a_kite_that_drifts_to_its_right_wing_is_seen_left_from_upwind(azimuth):
    """Who stands upwind faces the kite, so that its right wing (y > 0 in wind along x) is on the left hand."""
    scene = scenes.load("v3_kite_dynamic")
    start, turn = scene.members.nodes, about_z(azimuth)
    shapes = [(0.0, start @ turn.T), (1.0, (start + np.array([0.0, 3.0, 0.0])) @ turn.T)]
    figure = shapes_figure("a scene", SimpleNamespace(shapes=shapes), scene, 8.0 * turn[:, 0])
    side, front = figure.axes
    assert (side.get_title(), front.get_title()) == ("side view, from the left", "front view, from upwind")
    before, after = (np.column_stack([line.get_xdata(), line.get_ydata()]) for line in front.lines)
    assert right_of(front, after[0], before[0])
    left, right = (np.column_stack([line.get_xdata(), line.get_ydata()]) for line in side.lines)
    np.testing.assert_allclose(left[0], right[0], atol=1e-12)  # along the line of sight
    # the wind blows from the left of the side view to its right: the trailing edge is right of the leading one
    strut = scene.members.nodes[scene.struts[0]] @ turn.T @ wind_axes(8.0 * turn[:, 0]).T
    assert right_of(side, strut[0, [0, 2]], strut[1, [0, 2]])


def test_shapes_without_a_wind_are_not_said_to_be_seen_from_upwind():
    scene = scenes.load("v3_kite_dynamic")
    recorder = SimpleNamespace(shapes=[(0.0, scene.members.nodes)])
    assert [axes.get_title() for axes in shapes_figure("a scene", recorder, scene).axes] == [
        "side view, from the left", "front view, along x",
    ]  # fmt: skip


def test_right_wing_tip_is_left_of_the_left_one_from_upwind_and_from_above(kite):
    scene, run = kite
    figure = shape_figure(final_state(scene, run), "a scene", "converged", wind_of(run.blocks["aero"]))
    y = scene.members.nodes[:, 1]
    left, right = (run.blocks["structural"]["position"][pick(y)] for pick in (np.argmin, np.argmax))
    for axes, view in ((figure.axes[0], FROM_UPWIND), (figure.axes[2], FROM_ABOVE)):
        assert axes.get_title(loc="left") == view.title
        assert right_of(axes, right[view.at], left[view.at])


def segments(figure):
    """What lines and panels show in each view."""
    return [np.concatenate([p.vertices for c in axes.collections for p in c.get_paths()]) for axes in figure.axes[:3]]


@pytest.mark.parametrize("azimuth", AZIMUTHS)
def test_a_kite_looks_alike_in_wind_from_anywhere(kite, azimuth):
    scene, run = kite
    along_x, other = final_state(scene, run), final_state(scene, turned(scene, run, azimuth))
    assert other.turn == pytest.approx(along_x.turn, abs=1e-9)
    figures = [
        shape_figure(state, "a scene", "converged", wind_of(of.blocks["aero"]))
        for state, of in ((along_x, run), (other, turned(scene, run, azimuth)))
    ]
    # metres of some 10, turned there and back
    for one, two in zip(*map(segments, figures), strict=True):
        np.testing.assert_allclose(two, one, atol=1e-12)
    names = [[axes.get_xlabel() for axes in figure.axes[:3]] for figure in figures]
    assert names[0] == ["y, m", "x, m", "y, m"]
    assert names[1] == ["across the wind, m", "along the wind, m", "across the wind, m"]


@pytest.mark.parametrize("azimuth", AZIMUTHS)
def test_strips_carry_the_same_lift_drag_and_side_force_in_wind_from_anywhere(kite, azimuth):
    scene, run = kite
    one, two = (final_state(scene, r).strips for r in (run, turned(scene, run, azimuth)))
    size = np.abs(one.lift).max()
    for name in ("arc", "width", "lift", "side", "drag", "alpha"):
        np.testing.assert_allclose(getattr(two, name), getattr(one, name), atol=1e-11 * size)  # rounding


@pytest.mark.parametrize("direction", [[1.0, 0.0, 0.0], [3.0, 4.0, 1.0], [-1.0, 0.0, 0.2], [0.0, -2.0, 0.0]])
def test_wind_axes_are_right_handed_level_and_along_the_wind(direction):
    along, across, up = axes = wind_axes(np.array(direction))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_array_equal(up, [0.0, 0.0, 1.0])
    assert along @ direction == pytest.approx(np.hypot(*direction[:2]))
    assert across @ direction == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("direction", [None, [0.0, 0.0, 1.0], [1.0, 0.0, 0.3]])
def test_views_are_along_the_global_axes_without_a_wind_over_the_ground_and_in_wind_along_x(direction):
    np.testing.assert_array_equal(wind_axes(None if direction is None else np.array(direction)), np.eye(3))
