"""Cells of a ram-air wing under one pressure everywhere: contraction, stress and cuts beside Barlow's formula and the
closed form of a cell of cylinders.
"""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from benchmarks.ballooned_wings import (
    HEIGHT,
    NU,
    PRESSURE,
    STIFF,
    STIFFNESS,
    WIDTH,
    ballooning,
    inflated_wing,
    plane_strain,
)
from benchmarks.ballooning import (
    ballooned,
    cell_slice,
    free_cell,
    held_cell,
    pull_on_end_rib,
    rib_height,
    straight_ribs,
)
from master.report.ribs import arc_radius

STRIPS = (2, 4, 8)
WING_STRIPS = 4


def order(errors):
    """Rate between each two of the errors on meshes that are halved."""
    return np.log2(np.abs(errors[:-1]) / np.abs(errors[1:]))


# The closed form


@pytest.mark.parametrize("height", [0.1, 0.4, 1.0, 2.0])
def test_the_arcs_of_free_ribs_enclose_the_largest_volume_that_their_cloth_can(height):
    def volume(angle):
        radius = 0.5 / angle
        return -(2.0 * radius * np.sin(angle) * height + radius**2 * (2.0 * angle - np.sin(2.0 * angle)))

    most = minimize_scalar(volume, bounds=(1e-3, 0.5 * np.pi), method="bounded", options={"xatol": 1e-10})
    # at a maximum rounding of the volume, 1e-16, moves the angle by its root
    assert free_cell(1.0, height).angle == pytest.approx(most.x, abs=1e-6)


@pytest.mark.parametrize("height", [0.1, 0.4, 1.0, 2.0])
def test_the_formula_of_the_report_is_that_of_cloth_that_does_not_stretch(height):
    cell = free_cell(0.7, height)
    assert float(arc_radius(np.array(0.7), np.array(height))) == pytest.approx(cell.radius, rel=1e-12)
    assert 2.0 * cell.radius * np.cos(cell.angle) == pytest.approx(height, rel=1e-12)  # centre halfway up the rib
    assert pull_on_end_rib(cell, 1.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("chord", "radius", "contraction"), [(0.15, 0.72, 4.0), (0.30, 0.79, 3.4), (0.70, 0.54, 7.0), (0.90, 0.33, 18.0)]
)
def test_cells_of_the_160_m2_kite_have_the_radii_and_contractions_worked_out_for_it(chord, radius, contraction):
    x, root = chord, 7.855
    naca = 0.2969 * np.sqrt(x) - 0.1260 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4
    cell = free_cell(0.711, root * 1.8 * naca)
    assert cell.radius == pytest.approx(radius, abs=0.011)  # given with two digits
    assert 100.0 * (1.0 - cell.spacing / 0.711) == pytest.approx(contraction, rel=0.06)  # with one or two


def test_ribs_held_where_free_ones_come_to_bear_nothing_along_the_span():
    for stiffness in (np.inf, 1e3):
        free = free_cell(1.0, 0.6, PRESSURE, stiffness)
        held = held_cell(1.0, free.spacing, 0.6, PRESSURE, stiffness)
        assert held.tension == pytest.approx(free.tension, rel=1e-9)
        # rounding of the spacing, 1e-16, over how fast the tension falls with it
        assert pull_on_end_rib(held, PRESSURE) == pytest.approx(0.0, abs=1e-9 * PRESSURE)


# Slices of cells of membranes


@pytest.mark.parametrize("height", [0.4, 1.0, 2.0])
def test_free_ribs_come_together_as_far_as_the_closed_form_says_with_the_square_of_the_strips(height):
    exact = free_cell(1.0, height, PRESSURE, STIFF)
    found = [ballooned(cell_slice(1.0, height, n, STIFF), PRESSURE) for n in STRIPS]
    assert {one.status for one in found} == {"converged"}
    spacing = np.array([one.spacing / exact.spacing - 1.0 for one in found])
    tension = np.array([one.tension / exact.tension - 1.0 for one in found])
    assert order(spacing) == pytest.approx([2.0, 2.0], abs=0.15)  # 2.00 to 2.07 seen
    assert order(tension) == pytest.approx([2.0, 2.0], abs=0.15)
    # a polygon in place of an arc of the half angle phi is wrong by (phi / n)^2 / 6 and more where it meets the rib
    assert np.all(np.abs(spacing) <= exact.angle**2 / np.array(STRIPS) ** 2 / 6.0)
    assert np.all(np.abs(tension) <= exact.angle**2 / np.array(STRIPS) ** 2 / 2.0)


def test_it_is_so_for_soft_cloth_between_ribs_that_stretch():
    k = plane_strain(1e3)
    exact = free_cell(1.0, 0.6, PRESSURE, k, 2.0 * k)
    assert exact.stretch > 1.04
    assert exact.height == pytest.approx(rib_height(0.6, PRESSURE * exact.spacing, 2.0 * k), rel=1e-12)
    assert exact.height > 1.03 * 0.6
    slices = [cell_slice(1.0, 0.6, n, 1e3, NU, cells=4, rib_stiffness=2e3) for n in STRIPS]
    found = [ballooned(one, PRESSURE) for one in slices]
    for name in ("spacing", "tension"):
        error = np.array([getattr(one, name) / getattr(exact, name) - 1.0 for one in found])
        assert order(error) == pytest.approx([2.0, 2.0], abs=0.15)
        # two strips make 3 % of spacing and 10 % of tension, eight a sixteenth
        assert abs(error[-1]) < (0.0025 if name == "spacing" else 0.0065)
    # the pull on a rib, p s, has the error of the spacing, and its strain 4 % of the height
    assert found[-1].height == pytest.approx(exact.height, rel=2e-4)


@pytest.mark.parametrize("shortening", [-8.0, -4.0, 0.0, 2.0, 5.0])
def test_between_held_ribs_cloth_is_as_taut_as_its_cut_and_its_stretch_make_it(shortening):
    exact = held_cell(1.0 - 0.01 * shortening, 1.0, 0.6, PRESSURE, plane_strain(1e4))
    found = [ballooned(cell_slice(1.0, 0.6, n, 1e4, NU, shortening, held=True), PRESSURE) for n in STRIPS]
    tension = np.array([one.tension / exact.tension - 1.0 for one in found])
    pull = np.array([one.pull / pull_on_end_rib(exact, PRESSURE) - 1.0 for one in found])
    assert [one.spacing for one in found] == pytest.approx([1.0] * 3, abs=1e-12)
    assert order(tension) == pytest.approx([2.1, 2.0], abs=0.15)
    assert order(pull) == pytest.approx([2.1, 2.0], abs=0.15)
    assert abs(tension[-1]) < 0.01  # seen 0.03 % (5 % shorter) to 1.0 % (8 % wider), where the arc is deepest
    assert abs(pull[-1]) < 0.022  # the difference of the pull of cloth and the pressure on the end


@pytest.mark.parametrize("shortening", [-8.0, 4.0, 8.0])
def test_cloth_that_is_cut_narrower_brings_free_ribs_together_and_takes_stress_off(shortening):
    cut, plain = (free_cell(1.0 - 0.01 * s, 0.6, PRESSURE, STIFF) for s in (shortening, 0.0))
    one, other = (ballooned(cell_slice(1.0, 0.6, 8, STIFF, 0.0, s), PRESSURE) for s in (shortening, 0.0))
    # the polygons of both cuts are wrong alike: 0.2 % of the spacing, which a cut of 8 % changes by 5 % of that
    assert one.spacing / other.spacing == pytest.approx(cut.spacing / plain.spacing, abs=2e-4)
    assert one.tension / other.tension == pytest.approx(cut.tension / plain.tension, abs=5e-4)
    assert np.sign(plain.spacing - cut.spacing) == np.sign(plain.tension - cut.tension) == np.sign(shortening)


# Whole wings, closed at nose, tail and tips


@pytest.mark.parametrize("shortening", [-4.0, 0.0, 4.0])
def test_halfway_along_the_chord_a_wing_with_held_ribs_has_the_stress_of_its_cylinders(shortening):
    wing = inflated_wing(8.0, 8, ((0.0, shortening), (1.0, shortening)), held=True)
    alone = ballooned(cell_slice(WIDTH, HEIGHT, 8, STIFFNESS, NU, shortening, held=True), PRESSURE)
    exact = held_cell(WIDTH * (1.0 - 0.01 * shortening), WIDTH, HEIGHT, PRESSURE, plane_strain(STIFFNESS))
    middle = np.abs(wing.side - 0.5) < 0.2
    # nose and tail are five widths of a cell away: 3e-4 seen where the cloth is loosest
    assert wing.stress[middle] == pytest.approx(alone.tension, rel=1e-3)
    assert wing.stress[middle] == pytest.approx(exact.tension, rel=0.01)  # polygons of 8, 0.9 % seen at most


def test_a_cut_that_changes_along_the_chord_changes_the_stress_from_place_to_place():
    law = ((0.0, 0.0), (1.0, 8.0))
    wing = inflated_wing(8.0, 8, law, held=True)
    flat = np.abs(wing.side - 0.5) < 0.25
    widths = WIDTH * (1.0 - 0.01 * np.interp(wing.side[flat], *np.array(law).T))
    exact = [held_cell(w, WIDTH, HEIGHT, PRESSURE, plane_strain(STIFFNESS)).tension for w in widths]
    assert max(exact) > 2.5 * min(exact)
    # 0.05 % seen: the narrower the cut, the flatter the arc, and the nearer to it a polygon of 8
    assert wing.stress[flat] == pytest.approx(exact, rel=1e-3)


@pytest.fixture(scope="module")
def wings():
    """(Chord m, shortening %) -> wings whose ribs are free."""
    law = {s: ((0.0, s), (1.0, s)) for s in (0.0, 8.0)}
    return {(c, s): inflated_wing(c, WING_STRIPS, law[s]) for c in (4.0, 8.0, 16.0) for s in law}


@pytest.mark.parametrize("shortening", [0.0, 8.0])
def test_the_longer_the_chord_the_nearer_a_wing_comes_to_the_slice_of_its_cells(wings, shortening):
    """Nose and tail, where cloth cannot balloon as far, are worth a length along the chord: their share is halved
    where the chord is twice as long.
    """
    alone = ballooned(cell_slice(WIDTH, HEIGHT, WING_STRIPS, STIFFNESS, NU, shortening), PRESSURE)
    exact = free_cell(WIDTH * (1.0 - 0.01 * shortening), HEIGHT, PRESSURE, plane_strain(STIFFNESS))
    assert alone.spacing == pytest.approx(exact.spacing, rel=0.008)  # polygons of 4
    beyond = np.array([wings[c, shortening].spacing / alone.spacing - 1.0 for c in (4.0, 8.0, 16.0)])
    assert order(beyond) == pytest.approx([1.0, 1.0], abs=0.06)
    assert 0.0 < beyond[-1] < 0.006
    longest = wings[16.0, shortening]
    middle = np.abs(longest.side - 0.5) < 0.05
    # strained by the pressure on nose and tail along the chord too, which the slice is not
    assert longest.stress[middle] == pytest.approx(alone.tension, rel=0.004)
    # the formula leaves out that cloth stretches, p w / (E h) = 0.5 %
    assert longest.barlow[middle] == pytest.approx(exact.tension, rel=0.003)


def test_shortening_makes_the_wing_narrower_by_as_much_as_the_closed_form_says(wings):
    k = plane_strain(STIFFNESS)
    plain, cut = (free_cell(WIDTH * share, HEIGHT, PRESSURE, k).spacing for share in (1.0, 0.92))
    wanted = 1.0 - cut / plain  # 7.0 %: less than the cut, since narrower cells are flatter
    change = np.array([1.0 - wings[c, 8.0].spacing / wings[c, 0.0].spacing for c in (4.0, 8.0, 16.0)])
    assert change == pytest.approx(wanted, rel=0.04)
    assert change[-1] == pytest.approx(wanted, rel=0.016)
    assert np.all(np.diff(np.abs(change - wanted)) < 0.0)


@pytest.mark.parametrize("chord", [8.0, 16.0])
def test_shortening_the_tail_alone_turns_the_ribs_in_plan_so_that_nothing_turns_the_last_one(chord):
    laws = ((0.0, 0.0), (1.0, 8.0)), ((0.0, 8.0), (1.0, 0.0))
    tail, nose = (inflated_wing(chord, WING_STRIPS, law) for law in laws)
    widths = WIDTH * np.linspace(1.0, 0.92, 41)
    mean, slope = straight_ribs(widths, HEIGHT, chord, PRESSURE, plane_strain(STIFFNESS))
    turned = 0.5 * (tail.slope - nose.slope)  # what nose and tail do without it is in both
    # ends as above: 3.8 % and 1.7 % seen, halved with twice the chord
    assert turned == pytest.approx(slope * chord, rel=0.35 / chord)
    assert 0.5 * (tail.spacing + nose.spacing) == pytest.approx(mean, rel=0.008 + 0.1 / chord)
    assert slope < 0.0


def test_the_table_has_slices_and_wings_beside_the_closed_form():
    text = ballooning(quick=True)
    assert "| free | 2.5 | 1e-05 | 0 | 19.32 |" in text
    assert "Whole wings of four cells" in text
