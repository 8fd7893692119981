"""Validation cases of the particle system thesis against closed forms and an independent boundary-value problem."""

import numpy as np
import pytest

from benchmarks.particle_models import tether_in_wind
from benchmarks.particle_validation import (
    BLOCK,
    CABLE_EA,
    K_S,
    catenary,
    deflection,
    dropped,
    first_frequency,
    hanging_still,
    settled,
)
from structural.dynamics import BDF2, GeneralisedAlpha, ImplicitEuler, form_finding


def test_a_loaded_tether_hangs_where_the_closed_form_says():
    s = dropped()
    form = form_finding(s.assembly, s.loads, s.x, atol=1e-6, groups=s.groups)
    # 1e-6 N on springs of 1e5 N/m; the thesis is off by 1.9e-6 m
    assert np.abs(form.x[:, 2] - hanging_still()).max() < 1e-10
    assert np.abs(settled() - hanging_still()).max() < 1e-10


@pytest.mark.parametrize("scheme", [ImplicitEuler(), GeneralisedAlpha(0.5), GeneralisedAlpha(0.0), BDF2()], ids=str)
def test_its_first_frequency_is_that_of_the_mass_on_the_whole_tether(scheme):
    exact = np.sqrt(K_S / BLOCK) / (2.0 * np.pi)
    assert exact == pytest.approx(3.0397, abs=1e-4)
    # the period of a scheme is long by (w h)^2 / 12 to / 3, with w h = 0.019: 1e-4; the tether's mass makes it 3e-5
    assert first_frequency(scheme, 1e-3) == pytest.approx(exact, rel=3e-4)


@pytest.mark.parametrize("stiffness", [CABLE_EA, 1e8], ids=["elastic", "inextensible"])
def test_a_hanging_tether_converges_to_the_catenary_with_the_square_of_its_particles(stiffness):
    coarse, fine = (catenary(n, stiffness)[0] for n in (9, 33))
    assert np.log(coarse / fine) / np.log(4.0) == pytest.approx(2.0, abs=0.05)  # next term: (1/8)^2 of the first
    assert fine < 1.5e-3


@pytest.mark.parametrize("law", ["inclined", "projected"])
def test_a_tether_across_the_wind_bends_as_the_boundary_value_problem_says(law):
    # 25 particles: a polygon of 24 sides, off by 1 / 24^2 / 3 of its sag
    assert deflection(25, 1.0, law)[0] == pytest.approx(tether_in_wind(1.0, law), rel=1e-3)


def test_no_published_deflection_is_that_of_the_stated_drag_but_of_two_and_four_times_as_much():
    exact = {factor: tether_in_wind(factor) for factor in (1.0, 2.0, 4.0)}
    assert exact[1.0] == pytest.approx(3.6, abs=0.05)  # the digits that are published
    assert exact[2.0] == pytest.approx(4.5, abs=0.05)  # Baayen
    assert exact[4.0] == pytest.approx(5.8, abs=0.1)  # the thesis
