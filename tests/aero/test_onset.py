"""A wind that is linear in space: along a tether that turns about the ground, and that of a kite that turns."""

import numpy as np
import pytest

from aero import Flow, LinearField, LinesInWind
from aero.vortex_step import VortexStepModel
from interface import UprightPlane
from interface.vectors import azimuth_axes
from tests.aero.closed_wings import direction, panel_model, values, wing
from tests.aero.wings import arched_nodes, linear_wing, nodes_of, stalling_wing

RATE, CENTRE = np.array([0.3, -0.2, 0.5]), np.array([-1.0, 2.0, -3.0])
DENSITY, SPEED, DRAG = 1.2, 10.0, 1.1


def models():
    """Name -> a model of every kind, its nodes, and the outputs that are loads."""
    strips, surface = stalling_wing(6), wing(4, 16)
    nodes = arched_nodes(6)
    lines = LinesInWind(np.array([[0, 1], [1, 2]]), np.array([0.01, 0.02]), "inclined", DRAG, 0.0)
    return {
        "strips": (VortexStepModel(strips, True), nodes, ("pressure", "shear")),
        "panels": (panel_model(surface), surface.nodes, ("shear", "pressure_coefficient")),
        "lines": (lines, np.array([[0.0, 0.0, 0.0], [0.5, 0.1, 2.0], [0.2, 1.0, 5.0]]), ("line_load",)),
    }


MODELS = models()


def solved(name, field=None, nodes=None, velocity=None, speed=SPEED, towards=None, **given):
    model, own, loads = MODELS[name]
    nodes = own if nodes is None else nodes
    towards = direction(0.08) if towards is None else towards
    flow = Flow(nodes, towards, speed, DENSITY, velocity=velocity, field=field)
    response = model.solve(flow, values(model, **given))
    return np.concatenate([np.ravel(response.outputs[k]) for k in loads]), response


def tether(n, length=300.0, share=0.0):
    """Force and moment (3,) about the ground of a straight upright tether of n lines, over those of all-over wind."""
    wind, nodes = np.array([6.0, 0.0, 0.0]), np.linspace([0.0, 0.0, 0.0], [0.0, 0.0, length], n + 1)
    links = np.stack([np.arange(n), np.arange(n) + 1], axis=1)
    model = LinesInWind(links, np.full(n, 0.004), "inclined", DRAG, 0.0)
    field = LinearField.along_line(wind, nodes[0], nodes[-1], share)
    found = model.solve(Flow(nodes, wind / 6.0, 6.0, DENSITY, field=field), values(model))
    drag = 0.5 * DENSITY * 0.004 * length * DRAG * 36.0
    return found.force / drag, found.moment / (drag * length)


@pytest.mark.parametrize("n", [1, 2, 24])
def test_a_tether_in_wind_that_grows_from_nothing_has_a_third_of_the_drag(n):
    # int_0^1 s^2 ds, which two points of Gauss on each line give exactly
    force, _ = tether(n)
    assert force == pytest.approx([1.0 / 3.0, 0.0, 0.0], abs=1e-14)


@pytest.mark.parametrize("n", [1, 2, 24])
def test_its_moment_about_the_ground_is_that_of_an_eighth_at_the_kite(n):
    # int_0^1 s^3 ds = 1/4 of rho d l C_D V^2 / 2: the lumped 1/8 of the ram-air thesis, eq. 2.13; less 1/12 n^2 as the
    # load of each line is even along it
    _, moment = tether(n)
    assert moment == pytest.approx([0.0, 0.25 - 1.0 / (12.0 * n**2), 0.0], abs=1e-14)


@pytest.mark.parametrize("share", [0.25, 1.0, 2.0])
def test_wind_at_the_ground_counts_with_its_share(share):
    # int_0^1 (a + (1 - a) s)^2 ds = (1 + a + a^2) / 3
    assert tether(3, share=share)[0][0] == pytest.approx((1.0 + share + share**2) / 3.0, rel=1e-14)


@pytest.mark.parametrize("name", MODELS)
def test_a_wind_that_is_the_same_everywhere_is_the_uniform_one(name):
    # 3 m/s upwards beside, as a field of no gradient and as part of the wind: to rounding, 1e-12 of the loads, times
    # the condition of the panels' equations solved to 1e-10
    beside = np.array([0.0, 0.0, 3.0])
    field, _ = solved(name, LinearField(np.ones(3), beside, np.zeros((3, 3))))
    wind = SPEED * direction(0.08) + beside
    speed = float(np.linalg.norm(wind))
    uniform, _ = solved(name, towards=wind / speed, speed=speed)
    assert np.abs(field - uniform).max() <= 1e-9 * np.abs(uniform).max()


@pytest.mark.parametrize("name", MODELS)
def test_a_body_that_turns_in_still_air_meets_a_linear_wind(name):
    # nodes that move as a rigid body, in a wind without which neither has a direction: only the wake knows of that,
    # which goes with the wind where strips move and with the wind that they meet where it is a field
    _, nodes, _ = MODELS[name]
    small, centre = 1e-3 * RATE, nodes.mean(axis=0)
    moving, _ = solved(name, velocity=np.cross(small, nodes - centre))
    field, _ = solved(name, LinearField.rotation(small, centre))
    uniform, _ = solved(name)
    # the strips' wakes differ by 4e-4 of an angle, and the mean speeds of lines by the square of their change
    allowed = {"strips": 0.02, "panels": 1e-9, "lines": 1e-3}[name]
    assert np.abs(moving - field).max() <= allowed * np.abs(moving - uniform).max()


def test_motion_and_wind_of_the_place_add_up():
    # without induction, whose wake goes with the wind of the place but not with the motion, they are one for strips
    rng = np.random.default_rng(7)
    nodes, field = arched_nodes(6), LinearField.rotation(RATE, CENTRE)
    strips, surface = VortexStepModel(stalling_wing(6, induction=False), False), wing(4, 16)
    for model, x, load in ((strips, nodes, "shear"), (panel_model(surface, False), surface.nodes, "shear")):
        velocity = np.cross(rng.uniform(-0.3, 0.3, 3), x) + rng.uniform(-1.0, 1.0, 3)
        air = direction(0.08), SPEED, DENSITY
        both = model.solve(Flow(x, *air, velocity=velocity, field=field), values(model)).outputs[load]
        one = model.solve(Flow(x, *air, velocity=velocity - field.velocity(x)), values(model)).outputs[load]
        assert np.abs(both - one).max() <= 1e-9 * np.abs(one).max()  # rounding, times the condition


@pytest.mark.parametrize("name", MODELS)
def test_loads_turn_with_kite_wind_and_line(name):
    # all of it turned about the upright axis and shifted; rounding times the condition, as above
    _, nodes, loads = MODELS[name]
    wind, turn, shift = SPEED * direction(0.08), azimuth_axes(0.7), np.array([3.0, -1.0, 2.0])

    def beside(wind, ground, kite, rate, centre):
        return LinearField.along_line(wind, ground, kite, 0.3) + LinearField.rotation(rate, centre)

    ground, kite = np.array([-8.0, 1.0, -20.0]), np.array([0.5, 0.0, 1.0])
    _, one = solved(name, beside(wind, ground, kite, RATE, CENTRE))
    points = [turn @ p + shift for p in (ground, kite)]
    field = beside(turn @ wind, *points, turn @ RATE, turn @ CENTRE + shift)
    _, other = solved(name, field, nodes @ turn.T + shift, towards=turn @ direction(0.08))
    for load in loads:
        a, b = one.outputs[load], other.outputs[load]
        a = a @ turn.T if a.ndim == 2 else a
        assert np.abs(a - b).max() <= 1e-9 * np.abs(a).max()
    assert other.force == pytest.approx(turn @ one.force, abs=1e-9 * np.linalg.norm(one.force))


@pytest.mark.parametrize("name", ["strips", "panels"])
def test_half_a_wing_is_solved_where_the_wind_has_the_same_plane_of_symmetry(name):
    wind, kite = SPEED * direction(0.08), np.zeros(3)
    level = LinearField.along_line(wind, np.array([-5.0, 0.0, -20.0]), kite, 0.0)
    pitching = LinearField.rotation([0.0, 0.2, 0.0], CENTRE)
    for field in (level, pitching, level + pitching):
        half, response = solved(name, field, symmetric=1.0)
        whole, other = solved(name, field, symmetric=0.0)
        assert response.symmetric
        assert not other.symmetric
        assert np.abs(half - whole).max() <= 1e-8 * np.abs(whole).max()  # equations solved to 1e-10
    for field in (
        LinearField.along_line(wind, np.array([-5.0, 3.0, -20.0]), kite, 0.0),
        LinearField.rotation([0.01, 0.0, 0.0], CENTRE),
        level + LinearField.rotation([0.0, 0.0, 0.01], CENTRE),
    ):
        assert not solved(name, field, symmetric=1.0)[1].symmetric


@pytest.mark.parametrize(("name", "symmetric"), [("strips", 0.0), ("strips", 1.0), ("lines", 0.0)])
def test_the_derivative_knows_that_nodes_move_into_other_wind(name, symmetric):
    model, nodes, loads = MODELS[name]
    rng = np.random.default_rng(4)
    change = rng.standard_normal(nodes.shape)
    wind, centre = SPEED * direction(0.08), np.array([0.0, 0.0, -3.0])
    field = LinearField.along_line(wind, np.array([-5.0, 0.0, -20.0]), np.zeros(3), 0.0)
    field = field + LinearField.rotation([0.0, 0.3, 0.0] if symmetric else RATE, centre)
    given = {"symmetric": symmetric} if name == "strips" else {}
    if symmetric:
        grid = change.reshape(7, 3, 3)
        change = (0.5 * (grid + grid[::-1] * [1.0, -1.0, 1.0])).reshape(-1, 3)
    _, at = solved(name, field, **given)
    flow = Flow(nodes, direction(0.08), SPEED, DENSITY, field=field)
    along = model.derivative(flow, {**values(model, **given), **at.outputs}, at.state)(change)
    found = np.concatenate([np.ravel(along[k]) for k in loads])
    h = 1e-5
    ends = [solved(name, field, nodes + s * h * change, **given)[0] for s in (1.0, -1.0)]
    expected = (ends[0] - ends[1]) / (2.0 * h)
    assert np.abs(found - expected).max() <= 1e-6 * np.abs(expected).max()  # h^2 of the differences, and rounding / h


def test_pressure_coefficients_are_of_the_dynamic_pressure_at_each_panel():
    # of 1 - C_p and the dynamic pressure of the place the traction: shear = -C_p q n
    surface = wing(4, 16)
    field = LinearField.rotation(np.array([0.0, 0.0, 1.0]), np.zeros(3))
    _, response = solved("panels", field)
    corners = surface.nodes[surface.panels]
    wind = SPEED * direction(0.08) + field.velocity(corners.mean(axis=1))
    q = 0.5 * DENSITY * np.einsum("mc,mc->m", wind, wind)
    size = np.linalg.norm(response.outputs["shear"], axis=1)
    on = q > 0.0
    expected = np.abs(response.outputs["pressure_coefficient"][on]) * q[on]
    # panels of straight chords are flat and nearly parallelograms, so that their middle is the mean of their corners
    assert np.abs(size[on] - expected).max() <= 1e-3 * expected.max()
    assert np.ptp(q) > 0.5 * q.mean()  # it differs indeed


def test_a_rolling_wing_is_damped_alike_by_both_methods():
    """Roll damping of a wing of aspect ratio 6, NACA 0012, by panels against strips with the lift slope of theory."""
    surface, rate = wing(10, 40), np.array([0.2, 0.0, 0.0])
    model = panel_model(surface, symmetric=False)
    flow = Flow(surface.nodes, direction(0.0), SPEED, DENSITY, field=LinearField.rotation(rate, np.zeros(3)))
    damping = model.solve(flow, values(model)).moment[0]
    y = np.linspace(-3.0, 3.0, 41)
    leading = np.stack([0.0 * y, y, 0.0 * y], axis=1)
    nodes = nodes_of(leading, leading + np.array([1.0, 0.0, 0.0]))
    strips = VortexStepModel(linear_wing(40), False)
    at = strips.solve(Flow(nodes, direction(0.0), SPEED, DENSITY, field=flow.field), values(strips))
    assert damping < 0.0
    assert damping == pytest.approx(at.moment[0], rel=0.08)  # thickness adds some 8 % to the slope of sections


def test_a_field_in_the_axes_of_a_plane_is_the_same_field():
    left, right = np.array([[0.0, -2.0, 1.0]]), np.array([[1.0, 3.0, 1.0]])
    plane = UprightPlane.between(left, right)
    field = LinearField.along_line(np.array([5.0, 1.0, 0.0]), CENTRE, np.ones(3), 0.2)
    field = field + LinearField.rotation(RATE, RATE)
    points = np.random.default_rng(0).standard_normal((5, 3))
    there = field.inward(plane).velocity(plane.inward(points, point=True))
    assert plane.outward(there) == pytest.approx(field.velocity(points), abs=1e-13)
