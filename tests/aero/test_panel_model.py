"""The panel method as a model of the flow: loads, halves, moving wings, strips, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from aero.model import Flow, Wing
from aero.panel.model import LARGEST_ANGLE, PanelModel
from aero.vortex_step import StripPolars
from benchmarks.panel_references import sphere
from interface import StepFailed, SurfaceMesh, area_vectors, records
from interface.vectors import rotation
from tests.aero.closed_wings import direction, flow, panel_model, values, wing

SURFACE = wing()


@pytest.fixture(scope="module")
def model():
    return panel_model(SURFACE)


def close(a, b, scale, relative=1e-7):
    """Equations are solved to 1e-10; their condition and differences between panels take a thousand times that."""
    np.testing.assert_allclose(a, b, rtol=0, atol=relative * np.abs(scale).max())


def ball():
    nodes, panels = sphere(4)
    return type(SURFACE)(nodes, panels, np.zeros((0, 2), dtype=int))


@pytest.mark.parametrize(("surface", "options"), [(SURFACE, {}), (SURFACE, {"wake": "relaxed"}), (None, {})])
def test_outputs_are_those_that_are_declared(surface, options):
    surface = surface or ball()
    model = panel_model(surface, **options)
    found = model.solve(flow(surface), values(model)).outputs
    declared = {v.name: v.shape for v in model.variables if v.causality == "output"}
    assert {name: np.shape(value) for name, value in found.items()} == declared
    assert model.rows(found)[-1][0] == "span efficiency"
    assert sum(len(rows) for _, _, rows in model.tables()) == len(surface.trailing_edges)


def test_a_ball_has_no_strips_no_lift_and_no_drag():
    found = panel_model(ball()).solve(flow(ball()), values(panel_model(ball())))
    q_area = 0.5 * 1.2 * 10.0**2 * np.pi
    np.testing.assert_allclose(found.force, 0.0, atol=2e-3 * q_area)  # 96 panels
    assert found.outputs["induced_drag"] == 0.0


@pytest.mark.parametrize("beta", [0.0, 0.1])
def test_the_force_is_that_of_the_loads_and_lift_and_drag_are_its_parts(model, beta):
    given = flow(SURFACE, beta=beta, about=np.array([0.3, -0.2, 1.0]))
    found = model.solve(given, values(model, internal_pressure_coefficient=0.7))
    corners = SURFACE.nodes[SURFACE.panels]
    area = area_vectors(corners)
    out = found.outputs
    force = out["pressure"][:, None] * area + np.linalg.norm(area, axis=1)[:, None] * out["shear"]
    np.testing.assert_allclose(found.force, force.sum(axis=0), atol=1e-11)
    drag = found.force @ given.direction
    lift = found.force @ np.cross(given.direction, np.cross([0.0, 0.0, 1.0], given.direction))
    lift /= np.linalg.norm(np.cross([0.0, 0.0, 1.0], given.direction))
    close([out["pressure_drag"], out["pressure_lift"]], [drag, lift], lift, 1e-10)
    pressure = 0.6 * 100.0 * out["pressure_coefficient"]
    close(out["shear"], -pressure[:, None] * area / np.linalg.norm(area, axis=1)[:, None], pressure, 1e-12)


def test_internal_pressure_is_that_of_the_stream_and_has_no_resultant(model):
    without = model.solve(flow(SURFACE), values(model))
    within = model.solve(flow(SURFACE), values(model, internal_pressure_coefficient=1.0))
    np.testing.assert_allclose(within.outputs["pressure"], 0.6 * 100.0, rtol=1e-14)  # q, closed form
    assert np.all(without.outputs["pressure"] == 0.0)
    np.testing.assert_allclose(within.force, without.force, atol=1e-11)
    np.testing.assert_allclose(within.moment, without.moment, atol=1e-10)


def test_loads_that_all_follow_are_the_same_forces(model):
    """Pressure inside less that outside on each area vector; a polar's drag alone would be left as traction."""
    inside = values(model, internal_pressure_coefficient=1.0)
    split, whole = (one.solve(flow(SURFACE), inside) for one in (model, panel_model(SURFACE, follow="all")))
    np.testing.assert_allclose(whole.force, split.force, atol=1e-11)
    np.testing.assert_allclose(whole.moment, split.moment, atol=1e-10)
    np.testing.assert_allclose(whole.outputs["shear"], 0.0, atol=1e-12)
    q = 0.6 * 100.0
    np.testing.assert_allclose(whole.outputs["pressure"], q * (1.0 - whole.outputs["pressure_coefficient"]), rtol=1e-12)


def test_one_half_gives_the_loads_of_the_whole(model):
    half = model.solve(flow(SURFACE), values(model))
    whole = model.solve(flow(SURFACE), values(model, symmetric=0.0))
    assert half.symmetric
    assert not whole.symmetric
    for name in ("shear", "circulation", "strip_lift", "separation"):
        close(half.outputs[name], whole.outputs[name], whole.outputs[name], 1e-6)
    close(half.force, whole.force, whole.force)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.3, -0.8, 0.5)])
def test_loads_turn_with_wing_and_wind(model, axis):
    turn = rotation(np.deg2rad(30.0) * np.array(axis) / np.linalg.norm(axis))
    one = model.solve(flow(SURFACE), values(model))
    nodes = SURFACE.nodes @ turn.T + [3.0, -7.0, 2.0]
    other = model.solve(Flow(nodes, turn @ direction(0.08), 10.0, 1.2), values(model))
    assert other.symmetric == (axis[0] == 0.0)  # the plane is still upright
    close(other.outputs["shear"], one.outputs["shear"] @ turn.T, one.outputs["shear"], 1e-6)
    close(other.force, turn @ one.force, one.force)
    close(other.outputs["induced_drag"], one.outputs["induced_drag"], one.outputs["induced_drag"])


def test_loads_grow_with_density_and_the_square_of_the_speed_and_of_the_size(model):
    one = model.solve(flow(SURFACE), values(model))
    faster = model.solve(replace(flow(SURFACE, speed=30.0), density=2.4), values(model))
    larger = model.solve(replace(flow(SURFACE), nodes=2.0 * SURFACE.nodes), values(model))
    close(faster.force, 18.0 * one.force, 18.0 * one.force)
    close(larger.force, 4.0 * one.force, 4.0 * one.force)
    close(larger.moment, 8.0 * one.moment, 8.0 * one.moment)
    close(faster.outputs["pressure_coefficient"], one.outputs["pressure_coefficient"], 10.0)
    close(faster.outputs["span_efficiency"], one.outputs["span_efficiency"], 1.0)


def test_a_wing_that_moves_against_still_air_is_one_in_a_wind(model):
    still = model.solve(flow(SURFACE, speed=10.0), values(model))
    velocity = np.tile(-4.0 * direction(0.08), (len(SURFACE.nodes), 1))
    moving = model.solve(flow(SURFACE, speed=6.0, velocity=velocity), values(model))
    for name in ("shear", "circulation", "pressure_coefficient", "induced_drag"):
        close(moving.outputs[name], still.outputs[name], still.outputs[name], 1e-6)


def test_a_wing_that_rolls_gains_lift_on_the_side_that_goes_down_and_its_pressure_is_of_the_air_it_meets(model):
    """Strips of a wide wing see the angle that their own motion adds: at a roll rate p that is p y / U."""
    rate = 0.4
    velocity = np.cross([rate, 0.0, 0.0], SURFACE.nodes)
    rolling = model.solve(flow(SURFACE, alpha=0.0, velocity=velocity), values(model))
    assert not rolling.symmetric
    gamma = rolling.outputs["circulation"]
    close(gamma, -gamma[::-1], gamma, 1e-6)  # as much less on the one side as more on the other
    assert np.all(gamma[len(gamma) // 2 :] < 0.0)  # the right side goes up
    assert abs(rolling.force[2]) < 1e-6 * abs(rolling.moment[0])
    assert rolling.moment[0] < 0.0  # damped
    # C_lp of a rectangular wing of aspect ratio 6: -0.40 to -0.45 by lifting-surface theory (Etkin, fig. B.10)
    damping = rolling.moment[0] / (0.6 * 100.0 * 6.0 * 6.0) / (rate * 6.0 / 20.0)
    assert -0.48 < damping < -0.38


def test_a_state_is_complete_and_survives_storage(model):
    """The next step from a stored state, by a model that has nothing else, is the next step to the bit."""
    steps = [flow(SURFACE, alpha=0.05 + 0.02 * i) for i in range(4)]
    steps[2] = replace(steps[2], nodes=SURFACE.nodes + 0.02 * SURFACE.nodes[:, 1:2] ** 2 * [0.0, 0.0, 1.0])
    state, found, stored = None, [], []
    for step in steps:
        stored.append(records.loads(records.dumps(state)) if state is not None else None)
        found.append(model.solve(step, values(model), state))
        state = found[-1].state
    for step, before, response in zip(steps, stored, found, strict=True):
        again = panel_model(SURFACE).solve(step, values(model), before)
        for name, value in response.outputs.items():
            assert np.array_equal(value, again.outputs[name]), name
        assert np.array_equal(response.force, again.force)


def test_the_wing_that_stopped_being_symmetric_is_solved_whole(model):
    state = model.solve(flow(SURFACE), values(model)).state
    yawed = model.solve(flow(SURFACE, beta=0.05), values(model), state)
    fresh = model.solve(flow(SURFACE, beta=0.05), values(model))
    assert not yawed.symmetric
    assert np.array_equal(yawed.outputs["shear"], fresh.outputs["shear"])


@pytest.mark.parametrize(("alpha", "beta"), [(0.9, 0.0), (-0.9, 0.0), (0.0, 0.9), (np.pi, 0.0)])
def test_a_wind_at_more_than_45_degrees_is_refused(model, alpha, beta):
    with pytest.raises(StepFailed, match=rf"^the wind meets the wing at [\d.]+ deg .* up to {LARGEST_ANGLE:g} deg\.$"):
        model.solve(flow(SURFACE, alpha, beta), values(model))


def test_a_wing_squeezed_flat_is_refused(model):
    with pytest.raises(StepFailed, match="degenerate"):
        model.solve(replace(flow(SURFACE), nodes=SURFACE.nodes * [0.0, 1.0, 1.0]), values(model))


def test_a_wing_whose_halves_go_through_each_other_or_whose_strips_get_too_wide_is_refused(model):
    y = SURFACE.nodes[:, 1]
    crossed = SURFACE.nodes - np.outer(1.2 * np.sign(y) * np.exp(-(y**4)), [0.0, 1.0, 0.0])  # 0.78 m by 0.83 m
    with pytest.raises(StepFailed, match=r"^the displaced wing: .* through the plane y = 0"):
        model.solve(replace(flow(SURFACE), nodes=crossed), values(model))
    with pytest.raises(StepFailed, match=r"^the displaced wing: .* times as wide as the chord is long"):
        model.solve(replace(flow(SURFACE), nodes=SURFACE.nodes * [1.0, 100.0, 1.0]), values(model))


def test_there_are_no_derivatives(model):
    with pytest.raises(ValueError, match="has no directional derivatives"):
        model.derivative(flow(SURFACE), values(model), None)


def test_profile_drag_is_that_of_the_strips_areas_along_the_wind(model):
    without = model.solve(flow(SURFACE), values(model))
    found = model.solve(flow(SURFACE), values(model, profile_drag_coefficient=0.02))
    # rectangular, 6 m2; strips lie across the wind, which meets their chords at 0.08 rad
    close(found.outputs["profile_drag"], 0.02 * 0.6 * 100.0 * 6.0, 7.2, 1e-6)
    close(found.force - without.force, 7.2 * direction(0.08), 7.2, 1e-6)
    close(found.outputs["pressure_drag"], without.outputs["pressure_drag"], without.outputs["pressure_drag"], 1e-12)


def test_section_polars_give_each_strip_the_drag_of_its_lift():
    alpha = np.deg2rad(np.arange(-20.0, 21.0))
    lift = np.where(np.abs(alpha) < np.deg2rad(15.0), 6.0 * alpha, np.sign(alpha) * np.deg2rad(15.0) * 6.0 * 0.8)
    tables = [lift], [0.01 + 0.02 * lift**2], [0.0 * alpha]
    polars = StripPolars.from_tables(alpha, *tables, [0.0], np.zeros(12))
    model = panel_model(SURFACE, polars=lambda: polars)
    found = model.solve(flow(SURFACE), values(model)).outputs
    y = np.sort(np.unique(SURFACE.nodes[np.unique(SURFACE.trailing_edges), 1]))
    cl = found["strip_lift"] / (0.6 * 100.0)
    expected = 0.6 * 100.0 * np.diff(y) @ (0.01 + 0.02 * cl**2)
    np.testing.assert_allclose(found["profile_drag"], expected, rtol=2e-3)  # tables are linear between degrees
    assert "profile_drag_coefficient" not in values(model)
    with pytest.raises(ValueError, match="as many of them as there are strips"):
        panel_model(SURFACE, polars=lambda: polars.of(slice(0, 5)))


def test_strips_separate_when_the_angle_grows_and_are_named():
    surface = wing(panels=60)
    model = panel_model(surface)
    low = model.solve(flow(surface, np.deg2rad(3.0), speed=60.0), values(model))
    high = model.solve(flow(surface, np.deg2rad(32.0), speed=60.0), values(model))
    assert low.outputs["separated_strips"] == 0
    assert low.outputs["separated_strips_at"] == 0
    assert model.remarks(low.outputs) == []
    assert high.outputs["separated_strips"] >= 6
    assert np.all(high.outputs["separation"][high.outputs["separated"] > 0] < 0.85)
    (remark,) = model.remarks(high.outputs)
    assert "Stratford" in remark
    criterion = model.criteria[0]
    assert criterion.named(high.outputs["separated_strips_at"]).startswith("strip ")
    laminar = panel_model(surface, transition="laminar")
    assert laminar.solve(flow(surface, np.deg2rad(3.0), speed=60.0), values(model)).outputs["separated_strips"] > 0


def test_angles_of_strips_are_those_of_their_chords():
    surface = wing(twist=np.deg2rad(-4.0))
    model = panel_model(surface)
    found = model.solve(flow(surface, np.deg2rad(6.0)), values(model)).outputs
    y = 0.5 * np.abs(surface.nodes[surface.trailing_edges, 1].sum(axis=1))
    np.testing.assert_allclose(np.rad2deg(found["alpha"]), 6.0 - 4.0 * y / 3.0, atol=0.03)  # edges lean with the twist
    np.testing.assert_allclose(np.rad2deg(found["alpha_mid"]), 6.0, atol=0.6)


def test_a_relaxed_wake_goes_down_behind_a_wing_that_lifts_and_changes_little_of_the_lift():
    surface = wing(strips=5, panels=24)
    straight, relaxed = panel_model(surface), panel_model(surface, wake="relaxed")
    one, other = (m.solve(flow(surface), values(m)).outputs for m in (straight, relaxed))
    np.testing.assert_allclose(other["pressure_lift"], one["pressure_lift"], rtol=5e-3)  # 0.1 % measured
    np.testing.assert_allclose(other["induced_drag"], one["induced_drag"], rtol=0.05)
    assert 0.0 < other["wake_change"] < 0.02
    whole = relaxed.solve(flow(surface), values(relaxed, symmetric=0.0)).outputs
    np.testing.assert_allclose(whole["pressure_lift"], other["pressure_lift"], rtol=1e-7)


def test_what_is_said_of_strips_is_of_the_wing_and_not_of_the_rolled_up_wake_behind_it():
    surface = wing(strips=5, panels=24)
    models = panel_model(surface), panel_model(surface, wake="relaxed")
    one, other = (m.solve(flow(surface, 0.3), values(m, profile_drag_coefficient=0.02)).outputs for m in models)
    for name in ("strip_width", "profile_drag"):
        np.testing.assert_allclose(other[name], one[name], rtol=1e-12)  # sums of the same
    for found in (one, other):  # c c_l = 2 Gamma / U across trailing edges that lie across the wind
        np.testing.assert_allclose(found["span_loading"], 2.0 * found["circulation"] / 10.0, rtol=1e-6)
    # 0.7 % measured at the tips: the wake bends down behind them
    np.testing.assert_allclose(other["pressure_span_loading"], one["pressure_span_loading"], rtol=0.02)


def test_a_wing_that_turns_so_fast_that_air_meets_strips_from_behind_is_refused(model):
    """At 5 rad/s about z the left tip, 3 m away, goes downwind at 15 m/s, faster than the wind of 10 m/s."""
    velocity = np.cross([0.0, 0.0, 5.0], SURFACE.nodes)
    with pytest.raises(StepFailed, match=r"^the air meets the strips? 1\b.* from behind; .*slowly, or .*\.$"):
        model.solve(flow(SURFACE, velocity=velocity), values(model))
    model.solve(flow(SURFACE, velocity=0.5 * velocity), values(model))


def test_a_relaxed_wake_turns_with_the_wing_from_a_state():
    surface = wing(strips=5, panels=24)
    model, turn = panel_model(surface, wake="relaxed", symmetric=False), rotation(np.array([0.1, 0.2, -0.3]))
    one = model.solve(flow(surface), values(model))
    turned = Flow(surface.nodes @ turn.T + [1.0, 2.0, 3.0], turn @ direction(0.08), 10.0, 1.2)
    other = model.solve(turned, values(model), one.state)
    close(other.force, turn @ one.force, one.force, 1e-6)


def triangles(facing):
    """The wing of triangles, those of both sides `facing` each other across it or not."""
    quads = SURFACE.panels[SURFACE.panels[:, 2] != SURFACE.panels[:, 3]]
    rest = SURFACE.panels[SURFACE.panels[:, 2] == SURFACE.panels[:, 3]]
    other = (area_vectors(SURFACE.nodes[quads])[:, 2] < 0.0) & facing
    four = np.where(other[:, None], np.roll(quads, -1, axis=1), quads)
    panels = np.concatenate([rest, four[:, [0, 1, 2, 2]], four[:, [0, 2, 3, 3]]])
    return type(SURFACE)(SURFACE.nodes, panels, SURFACE.trailing_edges)


def test_a_mesh_of_triangles_has_loads_but_no_sections(model):
    of_triangles = panel_model(triangles(facing=True))
    found, quads = (m.solve(flow(SURFACE), values(m)).outputs for m in (of_triangles, model))
    assert "separated" not in found
    np.testing.assert_allclose(found["trefftz_lift"], quads["trefftz_lift"], rtol=0.01)  # 0.02 % measured
    assert found["trailing_edge_skew"] < 1e-6
    assert quads["trailing_edge_skew"] < 1e-6


def test_long_triangles_that_do_not_face_each_other_at_the_trailing_edge_are_beyond_what_is_known_to_be_good():
    model = panel_model(triangles(facing=False))
    found = model.solve(flow(SURFACE), values(model)).outputs
    criterion = next(c for c in model.criteria if c.name == "trailing_edge_skew")
    assert not criterion.within(found[criterion.name])
    assert criterion.named(found[criterion.place]).startswith("strip ")


def test_a_wing_that_memory_does_not_hold_is_refused_before_any_work_on_it(monkeypatch):
    monkeypatch.setattr("aero.panel.solver.free_memory", lambda: 2e8)
    monkeypatch.setattr("aero.panel.model.Body", None)  # nothing is asked of the surface
    for symmetric, count in ((True, len(SURFACE.panels) // 2), (False, len(SURFACE.panels))):
        with pytest.raises(StepFailed, match=rf"^{count} panels need 0\.20\d GB of memory and 0\.2 GB are free; "):
            panel_model(SURFACE, symmetric)


def test_an_open_surface_is_refused():
    nodes, panels = SURFACE.nodes, SURFACE.panels[1:]
    with pytest.raises(ValueError, match="open"):
        PanelModel(Wing(SurfaceMesh(nodes, panels), {"wake": "straight", "transition": "turbulent"}))
