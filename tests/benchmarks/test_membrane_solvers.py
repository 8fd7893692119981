"""The benchmark of a Newton iteration of membranes: what it times adds up, and every solver is measured."""

import pytest

from benchmarks import membrane_solvers
from benchmarks.membrane_solvers import iterations, newton_iteration
from structural.solve import energy, linear

needs_pardiso = pytest.mark.skipif(not linear.has_pardiso(), reason="the extra pardiso is not installed")


def test_assembly_and_factorisation_are_parts_of_an_iteration_and_nothing_stays_changed():
    before = linear.LARGE, energy.factorised
    medians, unknowns = iterations(12, ("SuperLU",))
    parts = medians["SuperLU"]
    assert unknowns == 3 * (13**2 + 12**2) - 2 * 13 - 2 * 13 + 1  # supports: x = 0, y = 0, and z of the outer edges
    assert 0.0 < parts["assembly"] < parts["iteration"]
    assert 0.0 < parts["factors"] < parts["iteration"]
    assert (linear.LARGE, energy.factorised) == before


@needs_pardiso
def test_each_solver_makes_its_own_factors(monkeypatch):
    from structural.solve import pardiso

    made = []

    def noted(name, plain):
        return lambda *arguments: (made.append(name), plain(*arguments))[1]

    monkeypatch.setattr(linear, "Factors", noted("SuperLU", linear.Factors))
    monkeypatch.setattr(pardiso, "PardisoFactors", noted("PARDISO", pardiso.PardisoFactors))
    iterations(4, ("SuperLU", "PARDISO"))
    assert set(made) == {"SuperLU", "PARDISO"}
    assert made.count("SuperLU") == made.count("PARDISO")


def test_the_table_has_exponents_and_says_which_solvers_are_there(monkeypatch):
    monkeypatch.setattr(membrane_solvers, "QUICK", (4, 6, 8))
    text = newton_iteration(True)
    assert "Fitted exponents, iteration ~ triangles^p" in text
    assert ("PARDISO is not installed" in text) != linear.has_pardiso()
