"""Wind loads on lines against the inclined cylinder of Hoerner."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aero import line_loads, line_loads_derivative

WIND = np.array([12.0, 0.0, 0.0])
DENSITY, DIAMETER = 1.225, 0.004
PRESSURE_WIDTH = 0.5 * DENSITY * 12.0**2 * DIAMETER  # N/m for a coefficient of one


@pytest.mark.parametrize("degrees", [0.0, 10.0, 45.0, 90.0, 120.0, 180.0])
def test_inclined_line_has_the_drag_and_lift_of_hoerner(degrees):
    theta = np.deg2rad(degrees)
    end = 7.0 * np.array([np.cos(theta), 0.0, np.sin(theta)])
    load = line_loads(np.array([[np.zeros(3), end]]), [DIAMETER], WIND, DENSITY, 1.1, 0.02)[0]
    drag = 1.1 * np.sin(theta) ** 3 + 0.02  # ram-air thesis eq. 2.12
    lift = 1.1 * np.sin(theta) ** 2 * np.cos(theta)  # eq. 2.11; a line that leans downwind is pushed down
    assert load == pytest.approx(PRESSURE_WIDTH * np.array([drag, 0.0, -lift]), abs=1e-14)  # rounding


def test_straight_tether_in_uniform_wind_has_the_closed_form_force():
    # 40 pieces of a straight tether of 300 m at 60 degrees to the wind together
    theta, n = np.deg2rad(60.0), 40
    points = np.linspace(0.0, 300.0, n + 1)[:, None] * np.array([np.cos(theta), 0.0, np.sin(theta)])
    load = line_loads(np.stack([points[:-1], points[1:]], axis=1), np.full(n, DIAMETER), WIND, DENSITY)
    force = (load * 300.0 / n).sum(axis=0)
    expected = [1.1 * np.sin(theta) ** 3 + 0.02, 0.0, -1.1 * np.sin(theta) ** 2 * np.cos(theta)]
    assert force == pytest.approx(PRESSURE_WIDTH * 300.0 * np.array(expected), rel=1e-13, abs=1e-12)  # sum of 40 terms


def test_tether_whose_speed_grows_from_the_ground_drags_at_the_kite_with_an_eighth_of_rho_d_l_v2():
    # ram-air thesis eq. 2.13 (Argatov): the moment about the ground of a tether that turns about it, over its length
    errors = []
    for n in (10, 20, 40):
        z = np.linspace(0.0, 300.0, n + 1)
        points = np.stack([0 * z, 0 * z, z], axis=1)
        middle = 0.5 * (z[:-1] + z[1:])
        speed = 30.0 * middle[:, None] / 300.0 * [1.0, 0.0, 0.0]
        load = line_loads(np.stack([points[:-1], points[1:]], axis=1), np.full(n, DIAMETER), speed, DENSITY, 1.1, 0.02)
        at_kite = (load[:, 0] * 300.0 / n) @ middle / 300.0
        errors.append(at_kite / (DENSITY * DIAMETER * 300.0 * 1.12 * 30.0**2 / 8.0) - 1.0)
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert order == pytest.approx([2.0, 2.0], abs=0.02)  # midpoint rule
    assert abs(errors[-1]) < 1e-3


def test_loads_turn_with_wind_and_lines_and_do_not_care_which_end_is_first():
    rng = np.random.default_rng(1)
    ends = rng.normal(size=(50, 2, 3))
    wind = rng.normal(size=(50, 3))
    d = rng.uniform(0.001, 0.01, 50)
    load = line_loads(ends, d, wind)
    turn = Rotation.random(rng=rng)
    turned = line_loads(turn.apply(ends.reshape(-1, 3)).reshape(-1, 2, 3), d, turn.apply(wind))
    assert turned == pytest.approx(turn.apply(load), abs=1e-15)  # loads of 1e-2 N/m: rounding
    assert np.array_equal(line_loads(ends[:, ::-1], d, wind), load)


def test_line_without_length_has_a_finite_load():
    assert np.all(np.isfinite(line_loads(np.ones((1, 2, 3)), [DIAMETER], WIND)))


@pytest.mark.parametrize("law", ["inclined", "projected"])
def test_line_meets_the_wind_minus_its_own_velocity(law):
    rng = np.random.default_rng(2)
    ends, own = rng.normal(size=(20, 2, 3)), rng.normal(size=(20, 3))
    d = np.full(20, DIAMETER)
    moving = line_loads(ends, d, WIND - own, law=law)
    one_by_one = [line_loads(ends[k : k + 1], d[:1], WIND - own[k], law=law)[0] for k in range(20)]
    assert np.array_equal(moving, one_by_one)
    assert not line_loads(ends, d, WIND - np.tile(WIND, (20, 1)), law=law).any()


@pytest.mark.parametrize("degrees", [0.0, 30.0, 53.13010235415598, 90.0, 150.0])
def test_projected_line_is_blown_along_the_wind_with_one_minus_the_cosine_of_its_area(degrees):
    # particle system thesis eq. 4.7 and 4.8; at 53.13 degrees, of cosine 3/5 and sine 4/5, half of what geometry shows
    theta = np.deg2rad(degrees)
    end = 7.0 * np.array([np.cos(theta), 0.0, np.sin(theta)])
    ends = np.array([[np.zeros(3), end], [end, np.zeros(3)]])
    load = line_loads(ends, [DIAMETER] * 2, WIND, DENSITY, 1.22, 0.5, law="projected")
    drag = PRESSURE_WIDTH * 1.22 * (1.0 - abs(np.cos(theta)))
    assert load == pytest.approx(np.array([[drag, 0.0, 0.0]] * 2), abs=1e-14)  # rounding


def test_both_laws_agree_on_a_line_across_the_wind():
    ends = np.array([[[0.0, 0.0, 0.0], [0.0, 3.0, 4.0]]])
    loads = [line_loads(ends, [DIAMETER], WIND, DENSITY, 1.22, 0.0, law=law) for law in ("inclined", "projected")]
    assert loads[0] == pytest.approx(loads[1], rel=1e-15)


@pytest.mark.parametrize("law", ["inclined", "projected"])
def test_derivative_of_line_loads_is_that_of_central_differences(law):
    rng = np.random.default_rng(4)
    ends, direction = rng.normal(size=(2, 20, 2, 3))
    air = np.full(20, DIAMETER), WIND, DENSITY, 1.1, 0.02, law
    h = 1e-5  # differences: h^2 of the third derivative, and rounding over h, both below 1e-8 of the loads
    difference = (line_loads(ends + h * direction, *air) - line_loads(ends - h * direction, *air)) / (2.0 * h)
    exact = line_loads_derivative(ends, direction, *air)
    assert exact == pytest.approx(difference, abs=1e-7 * np.abs(exact).max())


def test_unknown_law_of_line_drag_is_refused():
    with pytest.raises(ValueError, match=r"no law 'area'.*inclined, projected"):
        line_loads(np.ones((1, 2, 3)), [DIAMETER], WIND, law="area")
