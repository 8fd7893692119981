"""Pressures and shears carry every strip's force and moment, on the displaced panels and to rounding."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad

from aero.vortex_step.surface_loads import panel_geometry
from tests.aero.wings import arched_nodes, grid, panel_corner_forces, stalling_wing, wind

CHOICES = [{"follow": False}, {"follow": True}, {"section_force": "normal"}]


def strip_resultants(nodes, wing, loads):
    """Force and moment about the origin of every strip from the corner forces of its panels, by quadrature."""
    n = len(loads.force)
    force, moment = np.zeros((n, 3)), np.zeros((n, 3))
    for k, corners in enumerate(nodes[wing.grid.panels]):
        shear = np.zeros(3) if loads.shear is None else loads.shear[k]
        f = panel_corner_forces(corners, loads.pressure[k], shear)
        force[k % n] += f.sum(axis=0)
        moment[k % n] += np.cross(corners, f).sum(axis=0)
    return force, moment


@pytest.mark.parametrize("rows", [2, 3, 6, 10])
@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("induction", [True, False])
def test_panel_forces_add_up_to_the_section_force_and_moment_of_every_strip_of_warped_wings(choice, induction, rows):
    rng = np.random.default_rng(4)
    wing = stalling_wing(7, rows, induction=induction, **choice)
    for alpha in (-0.1, 0.05, 0.15, 0.3):
        nodes = arched_nodes(7, 0.12 / rows, rng, rows)
        loads = wing.loads(nodes, wind(alpha))
        force, moment = strip_resultants(nodes, wing, loads)
        stated = np.cross(loads.point, loads.force) + loads.moment
        # conservation to 1e-10 of the largest strip force (about 300 N) and its arm of 4 m: rounding is 1e-14 of it
        size = np.abs(loads.force).max()
        np.testing.assert_allclose(force, loads.force, rtol=0, atol=1e-10 * size)
        np.testing.assert_allclose(moment, stated, rtol=0, atol=4e-10 * size)
        np.testing.assert_allclose(force.sum(axis=0), loads.total_force(), rtol=0, atol=1e-9 * size)
        np.testing.assert_allclose(moment.sum(axis=0), loads.total_moment(np.zeros(3)), rtol=0, atol=4e-9 * size)


def test_the_force_is_the_polars_and_the_couple_its_pitching_moment():
    """Magnitudes straight from cl, cd, cm, the flow at the strip, and its area; the couple is free of force."""
    wing, nodes = stalling_wing(9), arched_nodes(9)
    loads = wing.loads(nodes, wind(0.1))
    c, s = loads.circulation, loads.strips
    cl, cd, cm = wing.polars.all(c.alpha)
    q_area = 0.5 * 1.225 * c.speed**2 * s.chord * s.width
    # rounding
    np.testing.assert_allclose(np.linalg.norm(loads.force, axis=1), q_area * np.hypot(cl, cd), rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(loads.moment, axis=1), np.abs(q_area * s.chord * cm), rtol=1e-12)
    # nose-up: the couple turns about the span from the left to the right tip where cm > 0
    np.testing.assert_array_equal(np.sign(np.einsum("ij,ij->i", loads.moment, s.span)), np.sign(cm))
    # Kutta-Joukowski; solved to 1e-12 of 12 m^2/s
    np.testing.assert_allclose(c.gamma, 0.5 * s.chord * c.speed * cl, atol=1e-9)


def test_on_flat_panels_the_force_acts_at_the_quarter_chord():
    nodes = arched_nodes(6)
    nodes[:, 1] = np.repeat(np.linspace(-4.0, 4.0, 7), 3)  # flat, rectangular
    nodes[:, 0], nodes[:, 2] = np.tile([0.0, 1.0, 2.0], 7), 0.0
    loads = stalling_wing(6).loads(nodes, wind(0.1))
    middle = 0.5 * (np.linspace(-4.0, 4.0, 7)[1:] + np.linspace(-4.0, 4.0, 7)[:-1])
    exact = np.stack([np.full(6, 0.5), middle, np.zeros(6)], axis=1)
    np.testing.assert_allclose(loads.point, exact, rtol=0, atol=1e-14)  # rounding of lengths of order 1 m


def test_a_normal_section_force_needs_no_shear_on_plane_strips():
    nodes = arched_nodes(6)
    x = np.repeat(np.linspace(-4.0, 4.0, 7), 3)
    nodes = np.stack([np.tile([0.0, 1.0, 2.0], 7), x, np.zeros(21)], axis=1)
    wing = stalling_wing(6, section_force="normal")
    loads = wing.loads(nodes, wind(0.1))
    force, moment = strip_resultants(nodes, wing, loads)
    assert loads.shear is None
    np.testing.assert_allclose(force, loads.force, rtol=0, atol=1e-11)  # N, of 100: rounding
    np.testing.assert_allclose(moment, np.cross(loads.point, loads.force) + loads.moment, rtol=0, atol=1e-10)


def test_follow_moves_the_normal_part_of_the_force_into_pressure_and_changes_nothing_else():
    nodes = arched_nodes(7, 0.05, np.random.default_rng(8))
    dead, follower = (stalling_wing(7, follow=f) for f in (False, True))
    a, b = dead.loads(nodes, wind(0.1)), follower.loads(nodes, wind(0.1))
    corners = nodes[dead.grid.panels]
    area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    size = np.linalg.norm(area, axis=1)[:, None]
    np.testing.assert_allclose(
        a.pressure[:, None] * area + a.shear * size, b.pressure[:, None] * area + b.shear * size, rtol=0, atol=1e-11
    )  # the same panel forces, N of 100, to rounding
    # only tangential traction is left
    np.testing.assert_allclose(np.einsum("pk,pk->p", b.shear, area), 0.0, atol=1e-11)


def test_centroids_are_those_of_the_bilinear_panels():
    rng = np.random.default_rng(3)
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) + 0.2 * rng.standard_normal((5, 4, 3))
    fractions = np.tile([0.0, 0.5, 0.5, 0.0], (5, 1))
    geometry = panel_geometry(corners, fractions)
    for k in range(5):
        push = panel_corner_forces(corners[k], 1.0, np.zeros(3))
        share = push @ geometry.area[k] / geometry.area2[k]
        # rounding
        np.testing.assert_allclose(push.sum(axis=0), geometry.area[k], atol=1e-14)
        np.testing.assert_allclose(geometry.centroid[k], share @ corners[k], atol=1e-14)
        np.testing.assert_allclose(geometry.fraction[k], share @ fractions[k], atol=1e-14)


def test_the_section_force_stays_at_the_quarter_chord_however_many_panels_carry_it():
    found = []
    for rows in (2, 3, 6, 10):
        nodes = arched_nodes(6, rows=rows)
        y = np.repeat(np.linspace(-4.0, 4.0, 7), rows + 1)  # flat, rectangular
        nodes = np.stack([np.tile(np.linspace(0.0, 2.0, rows + 1), 7), y, 0.0 * y], axis=1)
        loads = stalling_wing(6, rows).loads(nodes, wind(0.1))
        np.testing.assert_allclose(loads.point[:, 0], 0.5, rtol=0, atol=1e-13)  # rounding of lengths of order 1 m
        found.append(np.concatenate([loads.force, loads.moment], axis=1))
    np.testing.assert_allclose(found[1:], np.broadcast_to(found[0], (3, 6, 6)), rtol=0, atol=1e-10)  # N, of 100


@pytest.mark.parametrize("rows", [3, 6, 10, 40])
def test_panels_share_lift_as_a_flat_plate_and_the_couple_as_a_parabolic_camber_does(rows):
    """Thin-airfoil theory: the lift of a plate up to x is (theta + sin theta) / pi, from a vortex sheet
    sqrt((1 - x) / x) 2 / pi; that of a parabolic camber at no incidence comes from sqrt(x (1 - x)) 8 / pi.
    """
    x = np.linspace(0.0, 1.0, rows + 1)
    plate, camber = grid(2, rows).shapes
    sheets = (lambda s: 2.0 / np.pi * np.sqrt((1.0 - s) / s), lambda s: 8.0 / np.pi * np.sqrt(s * (1.0 - s)))
    for found, sheet in zip((plate, camber), sheets, strict=True):
        exact = [quad(sheet, a, b, epsabs=1e-12)[0] for a, b in itertools.pairwise(x)]
        np.testing.assert_allclose(found, exact, rtol=0, atol=1e-8)  # quadrature next to the singular edge
    assert plate.sum() == pytest.approx(1.0, rel=1e-14)
    assert camber.sum() == pytest.approx(1.0, rel=1e-14)
