"""Form finding of the benchmark of the particle system thesis: its tables 8.1 and 8.3."""

import numpy as np
import pytest

from benchmarks.particle_cells import CASES, SIZES, STIFFNESSES, THESIS, best_of_thesis, cell
from benchmarks.particle_models import blown, hanging
from structural.dynamics import form_finding

CELLS = [(case, n, k) for case in CASES for n in SIZES for k in STIFFNESSES]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("k", STIFFNESSES)
@pytest.mark.parametrize("c", THESIS)
def test_the_equilibrium_engine_converges_in_every_cell_faster_than_any_way_of_the_thesis(c, k, case):
    for n in SIZES:
        form, seconds = cell(case, n, k, c, "equilibrium", repeats=3)
        assert form.converged
        assert form.residuals[-1] <= 1e-3
        best = best_of_thesis(c, case, n, k)
        assert best is None or seconds < best  # at least 19 times faster where nothing else runs


@pytest.mark.parametrize(("case", "n", "k"), [(b, n, k) for b, n, k in CELLS if n <= 85])
def test_kinetic_damping_converges_wherever_it_does_in_the_thesis(case, n, k):
    row, column = SIZES.index(n), list(CASES).index(case)
    if THESIS[1.0]["kinetic"][k][row][column] is not None:
        assert cell(case, n, k, 1.0, "kinetic")[0].converged


def test_kinetic_damping_converges_with_the_most_particles_too():
    for case in CASES:
        for k in (1.0, 6e4):
            assert cell(case, 181, k, 1.0, "kinetic")[0].converged


@pytest.mark.parametrize("method", ["viscous", "kinetic", "kinetic-q"])
def test_every_way_finds_the_same_form(method):
    s = hanging(13, 100.0, 1.0, two_way=False)  # springs that push have other equilibria too, which kinetic ways find
    exact = form_finding(s.assembly, s.loads, s.x, "equilibrium", atol=1e-9, groups=s.groups)
    other = form_finding(s.assembly, s.loads, s.x, method, atol=1e-7, max_steps=3000, groups=s.groups)
    assert other.converged
    # 1e-7 N over the least stiffness of the sag, some 1 N/m
    assert np.abs(other.x - exact.x).max() < 1e-6


def test_quadratic_correction_does_not_pay_with_implicit_steps():
    # the finding of thesis section 6.3: over the cells it takes more steps in all than plain resets do
    steps = {}
    for method in ("kinetic", "kinetic-q"):
        forms = [cell(case, 13, k, 1.0, method)[0] for case in CASES for k in STIFFNESSES]
        steps[method] = sum(f.iterations for f in forms)
        assert sum(f.resets for f in forms) > 0
    assert steps["kinetic-q"] > steps["kinetic"]


def test_lines_that_cannot_push_are_found_as_fast():
    for k in STIFFNESSES:
        for model in (hanging, blown):
            s = model(85, k, 0.0, two_way=False)
            form = form_finding(s.assembly, s.loads, s.x, groups=s.groups)
            assert form.converged
            assert form.iterations < 30  # from slack particles in a row it would be hundreds


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"method": "magic"}, "no method 'magic'"),
        ({"method": "viscous", "step": 0.0}, "time step must be a number above zero"),
        ({"atol": -1.0}, "tolerance must be a number above zero"),
        ({"method": "kinetic", "mass": 0.0}, "no mass but is free to move"),
    ],
)
def test_form_finding_refuses_what_cannot_be_in_one_sentence(given, words):
    s = hanging(5, 100.0, 1.0)
    with pytest.raises(ValueError, match=words):
        form_finding(s.assembly, s.loads, s.x, **given, groups=s.groups)
