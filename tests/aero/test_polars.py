"""Section polars between, at and beyond the points of their tables."""

import numpy as np
import pytest

from aero.vortex_step import StripPolars
from tests.aero.wings import stalling_tables

ALPHA, CL, CD, CM = stalling_tables(4)
SPAN = np.array([0.0, 0.3, 0.6, 1.0])


def polars(strip_span):
    return StripPolars.from_tables(ALPHA, CL, CD, CM, SPAN, strip_span)


def test_linear_tables_are_reproduced_exactly_in_angle_and_along_the_span():
    alpha = np.deg2rad([-20.0, -3.0, 1.0, 14.0])
    span = np.array([0.0, 0.2, 1.0])
    slope = 4.0 + 2.0 * span
    tables = [slope[:, None] * alpha + k for k in (0.1, 0.2, 0.3)]
    at = np.random.default_rng(0).uniform(0.0, 1.0, 20)
    angle = np.random.default_rng(1).uniform(alpha[0], alpha[-1], 20)
    p = StripPolars.from_tables(alpha, *tables, span, at)
    exact = (4.0 + 2.0 * at) * angle
    cl, d_cl, outside = p.lift(angle)
    # rounding of coefficients of order 1
    np.testing.assert_allclose(cl, exact + 0.1, atol=1e-14)
    np.testing.assert_allclose(d_cl, 4.0 + 2.0 * at, rtol=1e-13)
    np.testing.assert_allclose(p.all(angle), exact + np.array([[0.1], [0.2], [0.3]]), atol=1e-14)
    assert not outside.any()


def test_every_table_point_is_met_by_a_strip_on_its_section():
    p = polars(SPAN)
    for k, a in enumerate(ALPHA):
        # rounding: cubics evaluated at their ends
        np.testing.assert_allclose(p.all(np.full(4, a)), [CL[:, k], CD[:, k], CM[:, k]], atol=1e-14)


@pytest.mark.parametrize("beyond", [-0.5, -1e-6, 1e-6, 2.0])
def test_beyond_the_table_the_end_value_is_held_flat_and_flagged(beyond):
    p = polars(SPAN)
    end = 0 if beyond < 0.0 else -1
    angle = np.full(4, ALPHA[end] + beyond)
    cl, slope, outside = p.lift(angle)
    np.testing.assert_allclose(cl, CL[:, end], atol=1e-14)  # rounding
    np.testing.assert_allclose(p.all(angle)[1:], [CD[:, end], CM[:, end]], atol=1e-14)  # rounding
    assert np.all(slope == 0.0)
    assert outside.all()
    assert not p.lift(np.full(4, ALPHA[end]))[2].any()  # the end itself belongs to the table


def test_a_strip_outside_the_outermost_sections_takes_the_nearest_polar():
    outer, inner = polars(np.array([-0.4, 1.7])), polars(np.array([0.0, 1.0]))
    assert np.array_equal(outer.coefficients, inner.coefficients)


def test_values_between_two_table_points_stay_between_theirs_through_stall():
    """No overshoot: monotone between neighbouring points in angle (on a section) and between sections (at an angle)."""
    p = polars(SPAN)
    for t in np.linspace(0.0, 1.0, 11):
        for k in range(len(ALPHA) - 1):
            values = p.all(np.full(4, ALPHA[k] + t * (ALPHA[k + 1] - ALPHA[k])))
            for got, table in zip(values, (CL, CD, CM), strict=True):
                low, high = np.minimum(table[:, k], table[:, k + 1]), np.maximum(table[:, k], table[:, k + 1])
                assert np.all(got >= low - 1e-14)  # rounding
                assert np.all(got <= high + 1e-14)
    at = np.linspace(0.0, 1.0, 101)
    bay = np.clip(np.searchsorted(SPAN, at, side="right") - 1, 0, 2)
    p = polars(at)
    for k in range(0, len(ALPHA), 5):
        cl = p.lift(np.full(101, ALPHA[k]))[0]
        assert np.all(cl >= np.minimum(CL[bay, k], CL[bay + 1, k]) - 1e-14)  # rounding
        assert np.all(cl <= np.maximum(CL[bay, k], CL[bay + 1, k]) + 1e-14)


def test_value_and_slope_are_continuous_at_every_inner_table_point():
    p = polars(np.array([0.1, 0.45, 0.9]))
    h = 1e-9
    for a in ALPHA[1:-1]:
        below, above = p.lift(np.full(3, a - h)), p.lift(np.full(3, a + h))
        # curvature is below 1e3 per rad^2, so over 2 h the slope may change by 2e-6 and the value by 2e-8
        np.testing.assert_allclose(below[0], above[0], rtol=0, atol=3e-8)
        np.testing.assert_allclose(below[1], above[1], rtol=0, atol=5e-6)


def test_the_slope_is_the_derivative_of_the_lift():
    p = polars(np.array([0.1, 0.45, 0.9]))
    h = 1e-6
    angles = np.deg2rad(np.arange(-14.7, 29.5, 1.0))  # 0.3 degrees from the knots, where the third derivative jumps
    for a in angles:
        difference = (p.lift(np.full(3, a + h))[0] - p.lift(np.full(3, a - h))[0]) / (2.0 * h)
        # rounding 1e-16 / h = 1e-10; cubic term below 1e5 h^2 = 1e-7
        np.testing.assert_allclose(p.lift(np.full(3, a))[1], difference, rtol=0, atol=1e-6)


def test_stall_begins_at_the_first_maximum_of_lift_and_stays_whatever_lift_does_later():
    alpha = np.deg2rad([-40.0, -20.0, -10.0, 0.0, 5.0, 10.0, 15.0, 20.0, 40.0])
    cl = [
        [-1.2, -0.9, -1.0, 0.0, 0.5, 1.0, 0.8, 0.7, 1.3],  # separated flow lifts more at 40 degrees than ever before
        [-4.0, -2.0, -1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 4.0],  # never stalls
    ]
    polars = StripPolars.from_tables(alpha, cl, np.zeros((2, 9)), np.zeros((2, 9)), [0.0, 1.0], [0.0, 1.0])
    low, high = np.rad2deg(polars.stall_angles())
    assert low == pytest.approx([-10.0, -np.inf])
    assert high == pytest.approx([10.0, np.inf])


# Two tables at the angles of both: the first has data from -20 to 20 deg, the second from -10 to 10 deg.
WIDE, ENDS = np.deg2rad([-20.0, -10.0, 0.0, 10.0, 15.0, 20.0]), np.deg2rad([[-20.0, 20.0], [-10.0, 10.0]])


def _of_two_ranges(strip_span, first=6.0, second=5.0):
    cl = np.array([first * WIDE, second * np.clip(WIDE, *ENDS[1])])
    zero = np.zeros_like(cl)
    return StripPolars.from_tables(WIDE, cl, zero, zero, [0.0, 1.0], strip_span, ENDS)


def test_table_that_ends_early_keeps_its_curve_to_its_ends_and_is_flagged_beyond():
    """A straight table stays straight up to its own last point, though its end value is held behind it."""
    p = _of_two_ranges(np.array([1.0]))
    for degrees in (-10.0, -9.9, -3.0, 7.0, 9.9, 10.0):
        cl, slope, outside = p.lift(np.deg2rad([degrees]))
        # rounding of coefficients of order 1; the slope at the very end is that on either side of it
        np.testing.assert_allclose(cl, 5.0 * np.deg2rad(degrees), atol=1e-14)
        assert not outside
        if abs(degrees) < 10.0:
            np.testing.assert_allclose(slope, 5.0, rtol=1e-13)
    for degrees in (-25.0, -10.1, 10.1, 17.0, 25.0):
        cl, slope, outside = p.lift(np.deg2rad([degrees]))
        np.testing.assert_allclose(cl, 5.0 * np.deg2rad(np.sign(degrees) * 10.0), atol=1e-14)
        np.testing.assert_allclose(slope, 0.0, atol=1e-13)
        assert outside


def test_strip_has_data_where_both_tables_beside_it_have_and_one_on_a_section_where_that_has():
    p = _of_two_ranges(np.array([0.0, 1e-12, 0.25, 1.0]))
    for degrees, flagged in ((12.0, [0, 0, 1, 1]), (-12.0, [0, 0, 1, 1]), (9.0, [0, 0, 0, 0]), (21.0, [1, 1, 1, 1])):
        assert p.lift(np.deg2rad(np.full(4, degrees)))[2].tolist() == [bool(f) for f in flagged]
    # between them the held value is blended with the one that goes on: no jump from strip to strip
    cl = _of_two_ranges(np.linspace(0.0, 1.0, 5)).lift(np.deg2rad(np.full(5, 17.5)))[0]
    np.testing.assert_allclose(np.diff(cl), np.diff(cl)[0], rtol=1e-12)  # two sections: linear along the span


@pytest.mark.parametrize("second", [(12.0, 20.0), (10.0, 20.0)])
def test_strip_between_tables_without_a_common_range_has_no_polar(second):
    """Touching at one angle is no range. Strips that stand on the sections need none."""
    alpha, zero = np.deg2rad([-10.0, 0.0, 10.0, 12.0, 20.0]), np.zeros((2, 5))
    ends = np.deg2rad([(-10.0, 10.0), second])
    with pytest.raises(ValueError, match="sections 0 and 1 share no range"):
        StripPolars.from_tables(alpha, zero, zero, zero, [0.0, 1.0], [0.0, 0.5], ends)
    on = StripPolars.from_tables(alpha, zero, zero, zero, [0.0, 1.0], [0.0, 1.0], ends)
    np.testing.assert_array_equal(on.ends, ends)


def test_wing_whose_halves_have_data_over_unlike_ranges_is_not_its_mirror_image():
    cl = np.zeros((2, len(WIDE)))  # the same values, known over other ranges
    unlike, alike = (
        StripPolars.from_tables(WIDE, cl, cl, cl, [0.0, 1.0], [0.0, 1.0], ends) for ends in (ENDS, ENDS[[1, 1]])
    )
    assert alike.mirrored()
    assert not unlike.mirrored()


def test_stall_is_found_where_a_table_has_data_and_not_where_its_end_is_held():
    cl = np.array([[-1.0, -0.9, 0.0, 0.9, 1.0, 0.8], [-0.8, -0.8, 0.0, 0.8, 0.8, 0.8]])
    p = StripPolars.from_tables(WIDE, cl, 0.0 * cl, 0.0 * cl, [0.0, 1.0], [0.0, 1.0], ENDS)
    assert np.rad2deg(p.stall_angles()[1]) == pytest.approx([15.0, np.inf])
