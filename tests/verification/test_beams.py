"""Beams and tubes against closed forms and published figures of large deflections, in the plane and out of it."""

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.cantilevers import arc, cantilever, elastica, straight, tip_loaded
from structural import Assembly, LinearSection, Loads, breukels_tube, collapse_deflection, tip_load, torque
from structural.materials import sections

# EI = 1, L = 1, so that forces are P L^2 / EI. The elastica does not stretch: 1e-5 / 1e6 of it is left with this EA.
EA = 1e6


def _tip(found):
    """w / L, u / L and angle rad of the tip."""
    r = found.rotations[-1]
    return np.array([found.x[-1, 1], 1.0 - found.x[-1, 0], np.arctan2(r[1, 0], r[0, 0])])


def _deflected(count, load):
    s = cantilever(straight(count), LinearSection.of(count, EA, 1.0, 1.0))
    found = tip_loaded(s, (0.0, load, 0.0), atol=1e-9)
    assert found.converged
    return _tip(found)


@pytest.mark.parametrize("load", [0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0])
def test_ten_elements_follow_the_elastica_to_a_tenth_of_a_per_cent(load):
    # LEI thesis 3.1, after Mattiasson (1981); measured 1.3e-5 at most, which is the stretch
    assert _deflected(10, load) == pytest.approx(elastica(load), rel=1e-3)


def test_the_elastica_converges_with_the_fourth_power_of_the_element_length():
    counts = np.array([2, 4, 8])
    errors = [np.abs(_deflected(n, 10.0) / elastica(10.0) - 1.0).max() for n in counts]
    orders = np.log(np.array(errors[:-1]) / errors[1:]) / np.log(2.0)
    # a cubic beam's natural deformations are exact for the linear part: 1.9 is asked for, about 4 is found
    assert np.all(orders >= 3.5)


def test_elliptic_integrals_give_mattiassons_table():
    # Mattiasson (1981), table 1, P L^2 / EI = 1, 5, 10: w / L, u / L, angle; printed to five digits
    assert elastica(1.0) == pytest.approx([0.30172, 0.05643, 0.46135], abs=6e-6)
    assert elastica(5.0) == pytest.approx([0.71379, 0.38763, 1.21537], abs=6e-6)
    assert elastica(10.0) == pytest.approx([0.81061, 0.55500, 1.43029], abs=6e-6)


def test_a_moment_of_two_pi_rolls_a_cantilever_into_a_circle():
    n = 20
    s = cantilever(straight(n), LinearSection.of(n, EA, 1.0, 1.0))
    found = tip_loaded(s, moment=(0.0, 0.0, 2.0 * np.pi), steps=10, atol=1e-9)
    assert found.converged
    phi = np.linspace(0.0, 2.0 * np.pi, n + 1)
    circle = np.column_stack([np.sin(phi), 1.0 - np.cos(phi), 0.0 * phi]) / (2.0 * np.pi)
    # asked for: 1e-3 of the length; found is 2e-6, the fourth order of the arc over its chord
    assert found.x == pytest.approx(circle, abs=1e-5)
    assert found.x[-1] == pytest.approx(np.zeros(3), abs=1e-9)  # it closes whatever the division


def _critical(count, ratio):
    """Critical tip load of a narrow cantilever over 4.0126 sqrt(EI_z GJ) / L^2, with EI_y = ratio EI_z."""
    gj = 0.5
    crit = 4.0126 * np.sqrt(gj)
    section = LinearSection.of(count, EA, ratio, gj, EI_b=1.0)
    s = cantilever(straight(count), section, across=(0.0, 1.0, 0.0))
    assembly = Assembly(s)

    def solved(part):
        return tip_loaded(s, (0.0, 0.0, -part * crit), atol=1e-9)

    def softest(part):
        found = solved(part)
        assert found.converged
        dead = np.zeros_like(s.nodes)
        dead[-1, 2] = -part * crit
        prepared = assembly.prepare(Loads(dead))
        _, k, _ = assembly.residual_and_tangent(assembly.unknowns.restrict(found.x), prepared, found.rotations)
        return np.linalg.eigvalsh(k.toarray())[0]

    part = brentq(softest, 0.8, 1.6, xtol=1e-6)
    return part, solved(0.98 * part).unstable_modes, solved(1.02 * part).unstable_modes


def test_a_narrow_cantilever_buckles_sideways_at_prandtls_load():
    # without bending in the plane before (EI ratio 1e4): the error falls with h^2, 4.6, 1.1, 0.29 %
    found = [_critical(n, 1e4) for n in (4, 8, 16)]
    errors = [part - 1.0 for part, _, _ in found]
    assert 0.0 < errors[2] < 3e-3
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.1)
    assert (4.0 * errors[2] - errors[1]) / 3.0 == pytest.approx(0.0, abs=2e-4)  # what h -> 0 leaves
    assert [modes for _, *modes in found] == [[0, 1]] * 3  # the solver says so too
    assert _critical(32, 1e4)[1:] == (0, 1)  # also where the stiffest member has 1e13 of the buckling mode


def test_bending_before_it_buckles_makes_a_cantilever_stiffer_sideways():
    # for a beam under moment by 1 / sqrt((1 - EI_z / EI_y) (1 - GJ / EI_y)), 1.5 % at ratio 50 and GJ = EI_z / 2; a tip
    # load may differ from that by its distribution, but not in sign or size
    stiffer = _critical(8, 50.0)[0] / _critical(8, 1e4)[0] - 1.0
    assert 0.0075 < stiffer < 0.02


# Tip positions of the 45 degree bend (radius 100, unit square section, E = 1e7, nu = 0) under 300, 450 and 600 out of
# its plane: Simo and Vu-Quoc (1986) with eight elements; Bathe and Bolourchi (1979) give (47.2, 15.9, 53.4) at 600.
BEND = {300.0: (58.84, 22.33, 40.08), 450.0: (52.32, 18.62, 48.39), 600.0: (47.23, 15.79, 53.37)}
# Their figures are those of J = 2 I; with the torsion constant 0.1406 of a square the tip ends 0.4 away, where Exudyn's
# geometrically exact beam (its curved example, 32 elements) has it at 600: (46.90, 15.56, 53.60).
POLAR, SAINT_VENANT = 1.0 / 6.0, 0.140577


def _bend(count, load, torsion=POLAR):
    e = 1e7
    section = LinearSection.of(count, e, e / 12.0, 0.5 * e * torsion, kGA=0.5 * e * 5.0 / 6.0)
    s = cantilever(arc(count), section, across=(0.0, 0.0, 1.0))
    found = tip_loaded(s, (0.0, 0.0, load), steps=3, atol=1e-6)
    assert found.converged
    return found.x[-1]


@pytest.mark.parametrize("load", BEND)
def test_the_45_degree_bend_ends_where_published_solutions_end(load):
    # eight straight elements in the papers and here; the papers differ by 0.1 among themselves on an arc of 78.5
    assert _bend(8, load) == pytest.approx(BEND[load], abs=0.1)


def test_the_45_degree_bend_with_the_torsion_constant_of_a_square_ends_elsewhere():
    tip = _bend(32, 600.0, SAINT_VENANT)
    assert tip == pytest.approx((46.90, 15.56, 53.60), abs=0.015)  # two digits printed
    assert np.linalg.norm(tip - BEND[600.0]) > 0.3  # further than the papers from each other


def test_the_45_degree_bend_converges_with_the_square_of_the_element_length():
    reference = (4.0 * _bend(64, 600.0) - _bend(32, 600.0)) / 3.0
    errors = [np.linalg.norm(_bend(n, 600.0) - reference) for n in (4, 8, 16)]
    # chords in place of arcs are of second order
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.1)


def _out_of_plane(count):
    section = LinearSection.of(count, 1e4, 1.0, 0.7)
    s = cantilever(straight(count), section)
    found = tip_loaded(s, (0.3, 2.0, 1.5), (0.3, 0.0, 0.0), steps=4, atol=1e-10)
    assert found.converged
    return found.x[-1]


def test_the_twist_of_a_bent_axis_makes_cantilevers_out_of_plane_four_times_as_accurate(monkeypatch):
    reference = _out_of_plane(64)
    with_it = np.array([np.linalg.norm(_out_of_plane(n) - reference) for n in (2, 4, 8, 16)])
    monkeypatch.setattr(sections, "_TWIST", np.zeros((6, 6)))
    without = np.array([np.linalg.norm(_out_of_plane(n) - reference) for n in (2, 4, 8, 16)])
    # without it the error begins as h^2; with it the first halvings gain more, as h^3 and h^2.5
    assert np.log2(without[:-1] / without[1:]) == pytest.approx([2.1, 2.05, 2.05], abs=0.15)
    assert np.all(np.log2(with_it[:2] / with_it[1:3]) >= 2.4)
    assert np.all(without[2:] >= 3.5 * with_it[2:])


@pytest.mark.parametrize("pressure", [0.15e5, 0.3e5, 0.5e5, 0.7e5])
@pytest.mark.parametrize("radius", [0.06, 0.08, 0.1, 0.125])
@pytest.mark.parametrize("count", [1, 2, 20])
def test_an_inflated_cantilever_of_one_metre_bends_as_breukels_measured_however_it_is_divided(pressure, radius, count):
    collapse = collapse_deflection(pressure, radius)
    s = cantilever(straight(count), breukels_tube(pressure, np.full(count, radius)))
    for part in (0.2, 0.6, 1.0):
        v = part * collapse
        found = tip_loaded(s, (0.0, tip_load(pressure, radius, v), 0.0), atol=1e-7)
        assert found.converged
        # the law assumes how much the lever shortens: within 1.7 % up to collapse at 0.2 m, 0.6 % up to radii of 0.1 m
        assert found.x[-1, 1] == pytest.approx(v, rel=0.02 if radius > 0.1 else 0.007)


@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize(("pressure", "radius"), [(0.15e5, 0.06), (0.3e5, 0.1), (0.7e5, 0.16)])
def test_an_inflated_tube_of_one_metre_twists_as_breukels_measured(count, pressure, radius):
    s = cantilever(straight(count), breukels_tube(pressure, np.full(count, radius)))
    for angle in (0.1, 0.5):
        found = tip_loaded(s, moment=(torque(pressure, radius, angle), 0.0, 0.0), atol=1e-7)
        assert found.converged
        turn = found.rotations[-1]
        # asked for: 1 %; twist is the same along the tube, so the law is met to the tolerance of the solve
        assert np.arctan2(turn[2, 1], turn[1, 1]) == pytest.approx(angle, rel=1e-6)


@pytest.mark.parametrize("length", [2.0, 4.0])
def test_longer_inflated_cantilevers_converge_with_the_number_of_elements(length):
    p, r = 0.3e5, 0.1
    load = tip_load(p, r, 0.9 * collapse_deflection(p, r)) / length  # the root moment of the one metre tube
    tips = [
        tip_loaded(cantilever(straight(n, length), breukels_tube(p, np.full(n, r))), (0.0, load, 0.0), atol=1e-8).x[-1]
        for n in (1, 2, 4, 8, 16)
    ]
    errors = [np.linalg.norm(tip - tips[-1]) / length for tip in tips[:-1]]
    assert errors[0] < 0.01  # one element is within a per cent of the length already
    assert errors[3] < 1e-5
    assert np.all(np.log2(np.array(errors[1:-1]) / errors[2:]) >= 1.9)  # and it is of second order or more
