"""Surfaces that the strips of closed bodies make up, and their span loading by circulation and by pressure."""

import numpy as np
import pytest

from aero.panel.surfaces import lifting_surfaces
from scenes.builders.profiles import naca
from scenes.builders.wings import BoxWing
from tests.aero.closed_wings import flow, panel_model, values, wing

SURFACE = BoxWing(12.0, 2.4, 1.0, 0.15, 6, 3, 4).surface(naca("0012").points(24))
Q = 0.5 * 1.2 * 100.0  # Pa of `flow`


@pytest.fixture(scope="module")
def box():
    model = panel_model(SURFACE)
    return model, model.solve(flow(SURFACE), values(model)).outputs


def middles(model):
    return SURFACE.nodes[model.edge_strips.ends].mean(axis=1)


def test_a_ring_is_two_wings_and_two_end_plates(box):
    model, _ = box
    found = {s.name: s for s in model.edge_strips.surfaces}
    assert list(found) == ["upper wing", "lower wing", "left end plate", "right end plate"]
    # half of the four strips of each corner belong to the wing, half to the plate
    assert [len(s.strips) for s in found.values()] == [16, 16, 7, 7]
    assert sorted(np.concatenate([s.strips for s in found.values()])) == list(range(46))
    at = middles(model)
    for name, axis in (("upper wing", 1), ("lower wing", 1), ("left end plate", 2), ("right end plate", 2)):
        assert np.all(np.diff(at[found[name].strips, axis]) > 0.0)  # in order
    assert found["upper wing"].sign == 1.0
    assert found["lower wing"].sign == -1.0  # whose outer side looks down
    assert np.all(at[found["upper wing"].strips, 2] > 0.0)
    assert np.all(at[found["left end plate"].strips, 1] < 0.0)


def test_loading_of_a_ring_is_alike_on_both_sides_and_lifts_both_wings(box):
    model, out = box
    found = {s.name: s.sign * out["span_loading"][s.strips] for s in model.edge_strips.surfaces}
    for name in ("upper wing", "lower wing"):
        assert found[name] == pytest.approx(found[name][::-1], rel=1e-9)  # one half was solved and mirrored
        assert np.all(found[name] > 0.0)
    assert found["left end plate"] == pytest.approx(found["right end plate"], rel=1e-9)


def test_c_cl_in_the_trefftz_plane_is_twice_the_circulation_over_the_speed(box):
    # Kutta and Joukowski: rho V Gamma = q c c_l
    _, out = box
    assert out["span_loading"] == pytest.approx(2.0 * out["circulation"] / 10.0, rel=1e-12, abs=1e-14)
    force = out["strip_width"] @ out["strip_lift"]
    assert force == pytest.approx(out["trefftz_lift"], rel=1e-12)


def test_pressures_on_the_strips_of_a_ring_add_up_to_the_lift_by_pressure(box):
    # a ring has no tips, so that every panel is one of a strip
    _, out = box
    total = out["strip_width"] @ out["strip_pressure_load"]
    lift, drag = np.array([-np.sin(0.08), 0.0, np.cos(0.08)]), np.array([np.cos(0.08), 0.0, np.sin(0.08)])
    assert total @ lift == pytest.approx(out["pressure_lift"], rel=1e-12)
    assert total @ drag == pytest.approx(out["pressure_drag"], rel=1e-12, abs=1e-12 * out["pressure_lift"])


def test_both_loadings_meet_away_from_the_tips_as_the_mesh_is_refined():
    worst = []
    for strips, panels in ((8, 24), (16, 48)):
        surface = wing(strips, panels, closed="round")
        model = panel_model(surface)
        out = model.solve(flow(surface), values(model)).outputs
        inner = np.abs(surface.nodes[model.edge_strips.ends].mean(axis=1)[:, 1]) < 2.0
        off = out["pressure_span_loading"] - out["span_loading"]
        worst.append(np.abs(off[inner]).max() / out["span_loading"].max())
    assert worst[1] < 0.5 * worst[0]  # order 1 at least
    assert worst[1] < 0.02


def test_chord_and_width_are_those_of_the_planform():
    surface = wing(6, 30, root=1.0, tip=0.5)
    model = panel_model(surface)
    out = model.solve(flow(surface, alpha=0.0), values(model)).outputs
    y = np.abs(surface.nodes[model.edge_strips.ends].mean(axis=1)[:, 1])
    assert out["strip_chord"] == pytest.approx(1.0 - 0.5 * y / 3.0, rel=1e-12)  # the nose is at the end of the chord
    assert out["strip_width"].sum() == pytest.approx(6.0, rel=1e-12)


def test_strips_apart_are_surfaces_of_their_own():
    # two wings one above the other, and an upright fin between, of one strip each or two
    nodes = np.array(
        [[0, -2, 1], [0, 0, 1], [0, 2, 1], [0, -2, -1], [0, 2, -1], [0, 0, -0.5], [0, 0, 0.5]], dtype=float
    )
    ends = np.array([[1, 2], [0, 1], [3, 4], [6, 5]])
    upper = np.array([[0, 0, 1.0], [0, 0, 1.0], [0, 0, 1.0], [0, 1.0, 0]])
    found = lifting_surfaces(ends, nodes, upper)
    assert [(s.name, s.strips.tolist(), s.upright) for s in found] == [
        ("wing 1", [1, 0], False),
        ("wing 2", [2], False),
        ("fin", [3], True),
    ]
