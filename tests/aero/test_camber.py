"""Camber of a deformed section as a change of its polar, and loads on several panels along the chord."""

import numpy as np
import pytest

from aero import SurfaceGrid


def _grid(stations):
    sections = np.arange(2 * (stations + 1)).reshape(2, -1)
    return SurfaceGrid(sections, np.linspace(0.0, 1.0, stations + 1))


def _sections(stations, height, chord=2.0):
    x = np.linspace(0.0, 1.0, stations + 1)
    line = np.stack([chord * x, 0.0 * x, 4.0 * height * chord * x * (1.0 - x)], axis=1)
    return np.stack([line, line + np.array([0.0, 1.0, 0.0])])


def test_parabolic_camber_line_has_the_zero_lift_angle_and_moment_of_thin_airfoil_theory():
    """z = 4 h x (1 - x): alpha_0 = -2 h, c_m about the quarter chord -pi h."""
    gaps = []
    for stations in (4, 8, 16, 32):
        zero_lift, moment = _grid(stations).camber(_sections(stations, 0.05), np.array([[0.0, 0.0, 1.0]]))
        gaps.append([abs(zero_lift[0] + 0.1), abs(moment[0] + np.pi * 0.05)])
    gaps = np.array(gaps)
    orders = np.log2(gaps[:-1] / gaps[1:])
    assert orders.min() > 1.2  # straight pieces: second order but for the ends, where the weight is steep
    assert gaps[-1].max() < 1e-3


def test_a_turned_or_scaled_flat_section_has_no_camber():
    flat = _sections(6, 0.0)
    angle = 0.7
    turn = np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]])
    zero_lift, moment = _grid(6).camber(3.0 * flat @ turn.T, turn[:, 2][None])
    assert np.abs([zero_lift, moment]).max() < 1e-14


@pytest.mark.parametrize("stations", [3, 6, 12])
def test_load_shapes_are_those_of_plate_and_camber(stations):
    """Both add up to one; their centres of pressure go to a quarter and a half of the chord as panels get smaller."""
    grid = _grid(stations)
    middle = 0.5 * (grid.fractions[1:] + grid.fractions[:-1])
    assert grid.shapes.sum(axis=1) == pytest.approx([1.0, 1.0], rel=1e-14)
    centre = grid.shapes @ middle
    assert centre[1] == pytest.approx(0.5, abs=1e-14)  # symmetric about half chord
    assert centre[0] == pytest.approx(0.25, abs=0.2 / stations)  # the plate's load falls within the first panel
