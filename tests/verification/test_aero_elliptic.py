"""Planar wings of linear section polars: elliptic wings against lifting-surface theory, convergence, sweep."""

import numpy as np
import pytest

from tests.aero.wings import linear_wing, nodes_of, wind

CHORD = np.array([1.0, 0.0, 0.0])  # m


def cosine(strips):
    return -np.cos(np.linspace(0.0, np.pi, strips + 1))


def elliptic_nodes(aspect_ratio, strips, straight):
    """Elliptic wing of root chord 1 m whose chord fraction `straight` (0.25 or 0.5) lies on a straight line."""
    eta = cosine(strips)
    y = 0.125 * np.pi * aspect_ratio * eta
    chord = np.sqrt(np.maximum(1.0 - eta**2, 1e-8))  # the tip sections are points: 1e-4 m keeps them a direction
    le = np.stack([-straight * chord, y, 0.0 * y], axis=1)
    return nodes_of(le, le + np.stack([chord, 0.0 * y, 0.0 * y], axis=1))


def coefficients(nodes, strips, area, alpha):
    """C_L and C_D of a wing of cl = 2 pi alpha, and its loads."""
    loads = linear_wing(strips, direction="bound").loads(nodes, wind(alpha, 10.0))
    along = wind(alpha, 1.0)
    force = loads.total_force() / (0.5 * 1.225 * 100.0 * area)
    return force @ [-along[2], 0.0, along[0]], force @ along, loads


def elliptic(aspect_ratio, strips, alpha, straight):
    area = 0.0625 * np.pi**2 * aspect_ratio  # pi / 4 b c with b = pi A c / 4
    return coefficients(elliptic_nodes(aspect_ratio, strips, straight), strips, area, alpha)


def lifting_surface(aspect_ratio):
    """C_L / alpha of a flat elliptic plate of large aspect ratio (Van Dyke 1964, third order, in Germain's 1967 form).

    2 pi / (1 + 2/A + 16 ln(1 + pi e^(-9/8) A) / (pi A)^2). Against `lattice` below it is
    0.5 % high at A = 5, 0.15 % at A = 10 and 0.04 % at A = 20.
    """
    third = 16.0 / (np.pi * aspect_ratio) ** 2 * np.log(1.0 + np.pi * np.exp(-9.0 / 8.0) * aspect_ratio)
    return 2.0 * np.pi / (1.0 + 2.0 / aspect_ratio + third)


def lattice(aspect_ratio, spanwise, chordwise, straight=0.5):
    """C_L / alpha of the same plate by a vortex lattice, written for this comparison alone.

    Cosine strips, vortices and control points at Lan's (1974) chordwise stations, straight wake, alpha small.
    """
    half = 0.125 * np.pi * aspect_ratio
    edge, middle = half * cosine(spanwise), -half * np.cos((np.arange(spanwise) + 0.5) * np.pi / spanwise)
    k = np.arange(1, chordwise + 1)
    vortex, control = (0.5 * (1.0 - np.cos(a * np.pi / (2 * chordwise))) for a in (2 * k - 1, 2 * k))

    def points(fraction, y):
        return np.stack([(fraction[:, None] - straight) * np.sqrt(1.0 - (y / half) ** 2), 0.0 * fraction[:, None] + y])

    p, a, b = (points(f, y).reshape(2, -1) for f, y in ((control, middle), (vortex, edge[:-1]), (vortex, edge[1:])))
    ra, rb = p[:, :, None] - a[:, None], p[:, :, None] - b[:, None]
    la, lb = np.hypot(*ra), np.hypot(*rb)
    cross = ra[0] * rb[1] - ra[1] * rb[0]
    bound = np.einsum("kj,kij->ij", b - a, ra / la - rb / lb) / cross
    wash = (bound + (1.0 + rb[0] / lb) / rb[1] - (1.0 + ra[0] / la) / ra[1]) / (4.0 * np.pi)
    gamma = np.linalg.solve(wash, -np.ones(wash.shape[0]))
    area = 0.5 * np.pi * half
    return 2.0 * abs(gamma @ np.tile(np.diff(edge), chordwise)) / area


@pytest.mark.parametrize(("aspect_ratio", "tolerance"), [(10.0, 2e-3), (20.0, 1e-3)])
def test_the_lifting_surface_formula_is_what_a_vortex_lattice_gives(aspect_ratio, tolerance):
    # the formula leaves out terms of order A^-3: 1e-3 at A = 10, 1e-4 at 20; the lattice of 40 x 6 is good to 2e-4
    assert lattice(aspect_ratio, 40, 6) == pytest.approx(lifting_surface(aspect_ratio), rel=tolerance)


@pytest.mark.parametrize("alpha", [0.02, 0.08])
@pytest.mark.parametrize("aspect_ratio", [10.0, 20.0])
def test_an_elliptic_plate_of_36_strips_lifts_as_lifting_surface_theory_says(aspect_ratio, alpha):
    lift, _, _ = elliptic(aspect_ratio, 36, alpha, straight=0.5)
    # 0.5 % is what is asked for; measured -0.4 % at A = 10 and -0.25 % at A = 20, of which 0.15 % falls with the strips
    assert lift == pytest.approx(lifting_surface(aspect_ratio) * alpha, rel=5e-3)


@pytest.mark.parametrize("aspect_ratio", [10.0, 20.0])
def test_an_elliptic_wing_on_a_straight_lifting_line_lifts_as_its_own_vortex_lattice(aspect_ratio):
    lift, _, _ = elliptic(aspect_ratio, 36, 0.02, straight=0.25)
    exact = lattice(aspect_ratio, 100, 4, straight=0.25)  # 0.1 % above its limit: first order at the pointed tips
    # 0.5 % as above; measured -0.40 % and -0.28 %, of which 0.15 % falls with the strips
    assert lift == pytest.approx(exact * 0.02, rel=5e-3)


def test_at_large_aspect_ratio_the_lift_tends_to_prandtls():
    gaps = [elliptic(a, 72, 0.02, 0.25)[0] / (2.0 * np.pi / (1.0 + 2.0 / a) * 0.02) - 1.0 for a in (20.0, 40.0, 80.0)]
    assert abs(gaps[1]) < 6e-3  # A = 40: the third-order term of lifting-surface theory is 0.4 %
    # that term falls as ln A / A^2, by 3.3 to 3.5 a doubling, until what 72 strips leave (0.1 %) shows
    assert abs(gaps[0]) > 2.0 * abs(gaps[1]) > 3.0 * abs(gaps[2])


@pytest.mark.parametrize("alpha", [0.02, 0.08])
@pytest.mark.parametrize("aspect_ratio", [5.0, 10.0, 20.0])
def test_the_induced_drag_of_an_elliptic_wing_is_the_least_possible(aspect_ratio, alpha):
    lift, drag, _ = elliptic(aspect_ratio, 36, alpha, straight=0.25)
    # 0.5 % is what is asked for; measured 0.9975 to 0.999, nearer with more strips
    assert lift**2 / (np.pi * aspect_ratio * drag) == pytest.approx(1.0, abs=5e-3)


def test_taking_the_flow_direction_at_the_control_point_adds_drag():
    nodes, area = elliptic_nodes(10.0, 36, 0.25), 0.0625 * np.pi**2 * 10.0
    drags = []
    for direction in ("bound", "control"):
        loads = linear_wing(36, direction=direction).loads(nodes, wind(0.05, 10.0))
        drags.append(loads.total_force() @ wind(0.05, 1.0) / (0.5 * 1.225 * 100.0 * area))
    # at three quarters of the chord the wake's wash is larger: e = 0.817 instead of 0.998 (measured at A = 10)
    assert drags[1] / drags[0] == pytest.approx(0.998 / 0.817, rel=0.02)


@pytest.mark.parametrize("shape", ["elliptic", "rectangular"])
def test_circulation_converges_with_the_square_of_the_strip_angle(shape):
    """Circulation at mid span and lift with 18, 36, 72, 144 cosine strips: observed order 2."""
    lifts, middle = [], []
    for strips in (18, 36, 72, 144):
        if shape == "elliptic":
            lift, _, loads = elliptic(10.0, strips, 0.05, 0.25)
        else:
            y = 4.0 * cosine(strips)
            le = np.stack([0.0 * y, y, 0.0 * y], axis=1)
            lift, _, loads = coefficients(nodes_of(le, le + CHORD), strips, 8.0, 0.05)
        lifts.append(lift)
        middle.append(loads.circulation.gamma[strips // 2])
    circulation, lift = (np.log2(np.diff(v)[:-1] / np.diff(v)[1:]) for v in (middle, lifts))
    assert np.abs(circulation - 2.0).max() < 0.2  # measured 1.93 to 1.99
    # the square tips of the rectangle come later into their asymptote: measured 1.48, 1.78 (1.90 with 288)
    assert np.all(lift > (1.8 if shape == "elliptic" else 1.4))
    assert np.all(np.diff(lift) > 0.0)
    assert abs(lifts[-1] / lifts[-2] - 1.0) < 5e-4  # 72 strips are within 0.05 %


def test_a_swept_wing_without_sideslip_has_no_side_force_and_even_loads():
    y = np.linspace(-4.0, 4.0, 25)
    le = np.stack([0.6 * np.abs(y), y, 0.0 * y], axis=1)
    _, _, loads = coefficients(nodes_of(le, le + CHORD), 24, 8.0, 0.06)
    flip = [1.0, -1.0, 1.0]
    # rounding, after a solve to 1e-12
    np.testing.assert_allclose(loads.circulation.gamma[::-1], loads.circulation.gamma, rtol=1e-9)
    np.testing.assert_allclose(loads.force[::-1] * flip, loads.force, rtol=0, atol=1e-9)
    assert abs(loads.total_force()[1]) < 1e-9
    roll, _, yaw = loads.total_moment(np.zeros(3))
    assert abs(roll) + abs(yaw) < 1e-8


def test_aft_sweep_loads_the_tips_and_forward_sweep_the_root():
    def tip_to_root(sweep):
        y = 4.0 * cosine(40)
        le = np.stack([sweep * np.abs(y), y, 0.0 * y], axis=1)
        gamma = coefficients(nodes_of(le, le + CHORD), 40, 8.0, 0.05)[2].circulation.gamma
        return gamma[4] / gamma[20]

    assert tip_to_root(-0.5) < tip_to_root(0.0) < tip_to_root(0.5)
