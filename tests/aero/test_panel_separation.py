"""Separation by Stratford's criteria: flows whose separation is known."""

import numpy as np
import pytest

from aero.panel.separation import SuctionSides, criterion, equivalent_lengths, separations, suction_sides


def run(way, speed):
    """One run along all of its points."""
    return SuctionSides(way[None], speed[None], np.array([len(way)]), way[-1:])


def separation(way, speed, viscosity, transition="turbulent"):
    return float(separations(run(way, speed), viscosity, transition)[0])


def equivalent_length(way, speed, viscosity, transition):
    return float(equivalent_lengths(run(way, speed), viscosity, transition)[0])


def test_the_laminar_criterion_finds_where_howarths_flow_separates():
    x = np.linspace(1e-3, 0.4, 400)
    # u = 1 - x separates at 0.120 (Howarth 1938, exact); Stratford's criterion gives 0.122
    assert separation(x, 1.0 - x, 1e-6, "laminar") == pytest.approx(0.1199, rel=0.025)
    assert separation(x, 1.0 - x, 1e-6, "laminar") == pytest.approx(0.1220, abs=2e-4)  # its own, from the closed form


def test_the_turbulent_criterion_is_met_all_along_stratfords_flow_without_friction():
    """C = 0.645 (0.435 R^(1/5) ((x / x0)^(1/5) - 1))^(1/3), up to 4/7: Stratford (1959, J. Fluid Mech. 5, 17-35)."""
    nu, x = 1e-6, np.concatenate([np.linspace(0.01, 1.0, 300), 1.0 + np.geomspace(1e-4, 2.0, 2000)])
    rise = np.maximum(x, 1.0) ** 0.2 - 1.0
    recovered = 0.645 * np.cbrt(0.435 * 1e6**0.2 * rise)
    within = recovered < 4.0 / 7.0
    factor = criterion(run(x[within], np.sqrt(1.0 - recovered[within])), nu)[0]
    after = x[within] > 1.002
    assert after.sum() > 100
    # 0.3512 by the closed form over 0.35, by differences between points 0.8 % apart
    np.testing.assert_allclose(factor[after][:-2], 0.3512 / 0.35, rtol=5e-3)


def test_accelerated_flow_does_not_separate():
    x = np.linspace(0.01, 1.0, 50)
    for transition in ("turbulent", "peak", "laminar"):
        assert separation(x, 1.0 + x, 1e-6, transition) == np.inf


def test_turbulent_layers_go_further_than_laminar_ones_and_further_still_at_larger_reynolds_numbers():
    x = np.linspace(0.01, 1.0, 200)
    u = np.where(x < 0.3, 1.0, 1.0 - 1.5 * (x - 0.3))
    laminar, turbulent, faster = separation(x, u, 1e-6, "laminar"), separation(x, u, 1e-6), separation(x, u, 1e-8)
    assert laminar < turbulent < faster < np.inf


def test_the_equivalent_length_of_a_plate_is_its_length_and_a_laminar_run_counts_less():
    x, u = np.geomspace(1e-9, 2.0, 100), np.append(np.ones(99), 1.0 + 1e-12)  # the largest speed is the last
    assert equivalent_length(x, u, 1e-6, "turbulent") == pytest.approx(2.0, rel=1e-8)
    assert equivalent_length(x, u, 1e-6, "laminar") == pytest.approx(2.0, rel=1e-8)
    # both have the momentum thickness of the laminar plate, 0.664 against Thwaites' 0.671 (nu x / u)^(1/2)
    short = equivalent_length(x, u, 1e-6, "peak")
    turbulent = 0.0366 * short * (short / 1e-6) ** -0.2
    assert turbulent == pytest.approx(0.664 * np.sqrt(1e-6 * 2.0), rel=0.02)


def test_the_suction_side_runs_from_the_stagnation_line_over_the_faster_side():
    """A circle in a stream with circulation, whose stagnation line lies below."""
    angle = 2.0 * np.pi * (np.arange(200) + 0.5) / 200  # from the trailing edge at 0 over the top
    centre = np.column_stack([np.cos(angle), 0.0 * angle, np.sin(angle)])
    u = -2.0 * np.sin(angle) - 0.5  # anticlockwise, seen against y: -2 sin - circulation / 2 pi
    velocity = u[:, None] * np.column_stack([-np.sin(angle), 0.0 * angle, np.cos(angle)])
    sides = suction_sides(centre[None], velocity[None], np.array([[1.0, 0.0, 0.0]]))
    stagnation = np.pi + np.arcsin(0.25)
    assert sides.length[0] == pytest.approx(stagnation, rel=1e-3)  # polygon and its steps of 0.03
    np.testing.assert_allclose(sides.speed.max(), 2.5, rtol=1e-3)
    assert np.all(np.diff(sides.way[0, : sides.count[0]]) > 0.0)


def test_strips_separate_side_by_side_as_they_do_one_by_one():
    """Circles with circulation either way, with little and with none, and one that the flow does not divide on."""
    angle = 2.0 * np.pi * (np.arange(118) + 0.5) / 118  # one of them at the top: no two are fastest
    centre = np.column_stack([np.cos(angle), 0.0 * angle, np.sin(angle)])
    along = np.column_stack([-np.sin(angle), 0.0 * angle, np.cos(angle)])
    speeds = [*(-2.0 * np.sin(angle) - swirl for swirl in (0.5, -0.5, 0.1, 0.0, 1.2)), np.ones(118)]
    velocity = np.array([u[:, None] * along for u in speeds])
    centres, edges = np.tile(centre, (6, 1, 1)), np.tile([1.0, 0.0, 0.0], (6, 1))
    for transition in ("turbulent", "peak", "laminar"):
        together = separations(suction_sides(centres, velocity, edges), 1e-5, transition)
        alone = [
            separations(suction_sides(centres[[i]], velocity[[i]], edges[[i]]), 1e-5, transition)[0] for i in range(6)
        ]
        np.testing.assert_array_equal(together, alone)
        assert np.isfinite(together[:5]).all()
        assert together[0] == pytest.approx(together[1], rel=1e-9)  # its image
    assert suction_sides(centres, velocity, edges).count[5] == 0
