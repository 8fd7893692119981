"""Wings whose nodes move: every strip meets the wind minus its own velocity, as thin-airfoil theory says."""

import numpy as np
import pytest

from aero import Flow
from aero.vortex_step import VortexStepModel
from tests.aero.wings import arched_nodes, linear_wing, nodes_of, stalling_wing, wind

SPEED, CHORD, SPAN, STRIPS, DENSITY = 12.0, 1.5, 8.0, 6, 1.225
CHOICES = [{}, {"direction": "control", "circulation_speed": "far"}, {"induction": False}, {"camber": True}]


def flat_nodes():
    """Rectangular wing in the plane z = 0, leading edge at x = 0."""
    y = np.linspace(-0.5 * SPAN, 0.5 * SPAN, STRIPS + 1)
    leading = np.stack([0 * y, y, 0 * y], axis=1)
    return nodes_of(leading, leading + np.array([CHORD, 0.0, 0.0]))


def pitching(nodes, rate, axis):
    """Velocities (s,3) m/s of a nose-up rotation by `rate` rad/s about the line x = `axis` m, z = 0."""
    v = np.zeros_like(nodes)
    v[:, 0], v[:, 2] = rate * nodes[:, 2], -rate * (nodes[:, 0] - axis)
    return v


def sums(loads, about=(0.25 * CHORD, 0.0, 0.0)):
    return np.concatenate([loads.total_force(), loads.total_moment(np.array(about))])


def test_heave_damping_of_a_plate_is_that_of_the_angle_that_it_changes():
    # alpha = -w / U, so that dF/dw = -rho U c pi per span (thin-airfoil theory, quasi-steady)
    wing, nodes = linear_wing(STRIPS, induction=False), flat_nodes()
    h = 1e-3  # m/s; the difference has an error of (h / U)^2 = 1e-8
    up = h * np.array([0.0, 0.0, 1.0]) + 0.0 * nodes
    lift = [wing.loads(nodes, wind(0.0), velocity=v).total_force()[2] for v in (up, -up)]
    damping = (lift[0] - lift[1]) / (2.0 * h)
    assert damping == pytest.approx(-DENSITY * SPEED * CHORD * np.pi * SPAN, rel=1e-7)


def test_strips_that_translate_carry_what_they_would_at_rest_in_the_relative_wind():
    # without induction only the relative wind counts; every strip of a warped wing is given a velocity of its own
    rng = np.random.default_rng(3)
    nodes = arched_nodes(7, noise=0.03, rng=rng)
    wing = stalling_wing(7, induction=False)
    shift = rng.uniform(-1.5, 1.5, 3)
    moving = wing.loads(nodes, wind(0.1), velocity=shift + 0.0 * nodes)
    resting = wing.loads(nodes, wind(0.1) - shift)
    scale = np.abs(resting.force).max()
    assert moving.force == pytest.approx(resting.force, abs=1e-12 * scale)  # rounding
    assert moving.moment == pytest.approx(resting.moment, abs=1e-12 * scale)


@pytest.mark.parametrize("axis", [0.0, 0.25, 0.5, 0.75])
def test_pitching_plate_has_the_lift_and_moment_of_thin_airfoil_theory(axis):
    # steady pitch rate q about x = a c: c_l = 2 pi q c (3/4 - a) / U, c_m about the quarter chord -pi q c / 8 U
    wing, nodes = linear_wing(STRIPS, induction=False), flat_nodes()
    rate = 1e-4  # rad/s: what is not linear in q is of relative order (q c / U)^2 = 1e-10
    out = sums(wing.loads(nodes, wind(0.0), velocity=pitching(nodes, rate, axis * CHORD)))
    unit = 0.5 * DENSITY * SPEED**2 * CHORD * SPAN * rate * CHORD / SPEED
    assert out[2] == pytest.approx(unit * 2.0 * np.pi * (0.75 - axis), abs=1e-8 * unit)
    assert out[4] == pytest.approx(-unit * CHORD * np.pi / 8.0, rel=1e-8)  # +y is nose-up


@pytest.mark.parametrize("choices", CHOICES)
def test_wing_that_moves_with_the_wind_meets_no_air(choices):
    nodes = arched_nodes(7)
    loads = stalling_wing(7, **choices).loads(nodes, wind(0.1), velocity=wind(0.1) + 0.0 * nodes)
    assert loads.circulation.converged
    assert not loads.force.any()
    assert not loads.moment.any()
    assert not loads.pressure.any()


@pytest.mark.parametrize("choices", CHOICES)
@pytest.mark.parametrize("part", [-0.5, 0.4])
def test_wing_carried_along_by_part_of_the_wind_has_the_loads_of_the_rest_of_it(part, choices):
    # the wake lies along the wind in both, so that this holds with induction
    nodes = arched_nodes(8, noise=0.02, rng=np.random.default_rng(5))
    wing = stalling_wing(8, **choices)
    moving = wing.loads(nodes, wind(0.08), velocity=part * wind(0.08) + 0.0 * nodes)
    resting = wing.loads(nodes, (1.0 - part) * wind(0.08))
    assert moving.circulation.converged
    scale = np.abs(resting.force).max()
    assert moving.force == pytest.approx(resting.force, abs=1e-9 * scale)  # solved to an imbalance of 1e-12
    assert moving.circulation.gamma == pytest.approx(resting.circulation.gamma, rel=1e-9, abs=1e-10)


@pytest.mark.parametrize("choices", CHOICES)
@pytest.mark.parametrize("symmetric", [False, True])
def test_wing_at_rest_has_the_loads_of_one_without_velocities(choices, symmetric):
    nodes = arched_nodes(8)
    wing = stalling_wing(8, **choices)
    resting = wing.loads(nodes, wind(0.1), velocity=np.zeros_like(nodes), symmetric=symmetric)
    without = wing.loads(nodes, wind(0.1), symmetric=symmetric)
    scale = np.abs(without.force).max()
    assert resting.force == pytest.approx(without.force, abs=1e-12 * scale)  # the same sums in another order
    assert resting.pressure == pytest.approx(without.pressure, abs=1e-12 * np.abs(without.pressure).max())


@pytest.mark.parametrize("strips", [7, 8])
def test_half_of_a_wing_that_flaps_and_pitches_symmetrically_stands_for_the_whole(strips):
    nodes = arched_nodes(strips)
    velocity = pitching(nodes, 0.4, 0.3)
    velocity[:, 2] += 0.3 * nodes[:, 1] ** 2
    velocity[:, 1] += 0.2 * nodes[:, 1]
    wing = stalling_wing(strips)
    half, whole = (wing.loads(nodes, wind(0.1), symmetric=s, velocity=velocity) for s in (True, False))
    scale = np.abs(whole.force).max()
    assert half.force == pytest.approx(whole.force, abs=1e-9 * scale)  # solved to an imbalance of 1e-12
    assert half.moment == pytest.approx(whole.moment, abs=1e-9 * scale)


def test_rolling_wing_is_damped_and_lifts_as_at_rest():
    nodes = flat_nodes()
    wing = linear_wing(STRIPS)
    rate = 0.05
    rolling = np.cross([rate, 0.0, 0.0], nodes)
    turned, resting = wing.loads(nodes, wind(0.05), velocity=rolling), wing.loads(nodes, wind(0.05))
    moment, lift = turned.total_moment(np.zeros(3))[0], turned.total_force()[2]
    # strip theory: rho U c pi / 2 rate times the integral of y^2 over the span; induction takes some of it away
    sectional = DENSITY * SPEED * CHORD * np.pi * rate * SPAN**3 / 12.0
    assert -sectional < moment < -0.4 * sectional
    assert lift == pytest.approx(resting.total_force()[2], rel=1e-3)  # what is even in the rate: (rate b / 2 U)^2


def test_pressures_and_shears_carry_force_and_moment_of_moving_strips():
    rng = np.random.default_rng(11)
    nodes = arched_nodes(9, noise=0.03, rng=rng)
    velocity = pitching(nodes, 0.5, 0.4) + rng.uniform(-0.5, 0.5, 3)
    wing = stalling_wing(9)
    loads = wing.loads(nodes, wind(0.1), velocity=velocity)
    corners = nodes[wing.grid.panels]
    area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    force = loads.pressure[:, None] * area + loads.shear * np.linalg.norm(area, axis=1)[:, None]
    assert force.sum(axis=0) == pytest.approx(loads.total_force(), rel=1e-11, abs=1e-10)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_reduced_frequency_is_the_relative_rate_of_circulation_times_half_chord_over_speed(direction):
    nodes = flat_nodes()
    wing = linear_wing(4, induction=False)
    model = VortexStepModel(wing, False, transient=True)
    low, high, dt, still = 10.0, 10.0 + direction, 0.05, np.zeros_like(nodes)

    def flow(speed):
        return Flow(nodes, wind(np.deg2rad(5.0)) / 12.0, speed, velocity=still, dt=dt)

    before = model.solve(flow(low), {"symmetric": 0.0})
    assert before.outputs["reduced_frequency"] == 0.0  # there is no step before
    found = model.solve(flow(high), {"symmetric": 0.0}, before.state).outputs
    # strip theory: Gamma = c U cl / 2, so that dGamma / Gamma = dU / U; the largest Gamma of the wing is its own
    expected = 0.5 * CHORD / high * abs(high - low) / dt / high
    assert found["reduced_frequency"] == pytest.approx(expected, rel=1e-10)  # residual of the circulation
    assert found["reduced_frequency_at"] == 1  # all strips alike: the first
    assert model.repeated({})["reduced_frequency"] == 0.0


def test_wings_at_rest_and_those_of_quasi_static_scenes_have_no_reduced_frequency():
    model = VortexStepModel(linear_wing(4), False)
    assert "reduced_frequency" not in {v.name for v in model.variables}
    assert [c.name for c in model.criteria] == ["stalled_strips", "strips_beyond_polar"]
