"""Direct solvers: right answers for unsymmetric values, singular matrices said so, factors that outlive others."""

import numpy as np
import pytest
import scipy.sparse as sp

from benchmarks.nets import saddle
from structural import Assembly, Loads, equilibrium
from structural.solve import linear

needs_pardiso = pytest.mark.skipif(not linear.has_pardiso(), reason="the extra pardiso is not installed")
SOLVERS = [pytest.param(np.inf, id="SuperLU"), pytest.param(0, id="PARDISO", marks=needs_pardiso)]


@pytest.fixture(params=SOLVERS)
def factorised(request, monkeypatch):
    monkeypatch.setattr(linear, "LARGE", request.param)
    return linear.factorised


def laplacian(n, seed=0, asymmetry=0.3):
    """A grid's Laplacian whose entries, not whose pattern, are made unsymmetric; diagonally dominant."""
    line = sp.diags_array([-np.ones(n - 1), 2.0 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    a = sp.csc_array(sp.kronsum(line, line) + 0.1 * sp.eye_array(n * n))
    off = a.indices != np.repeat(np.arange(n * n), np.diff(a.indptr))
    a.data[off] *= 1.0 - asymmetry * np.random.default_rng(seed).random(off.sum())
    return a


def test_solution_of_unsymmetric_values(factorised):
    a = laplacian(20)
    x = np.random.default_rng(1).standard_normal(400)
    # condition below 1e2, times rounding
    np.testing.assert_allclose(factorised(a).solve(a @ x), x, rtol=0.0, atol=1e-12)


def test_factors_stay_those_of_their_matrix_when_others_are_made(factorised):
    systems = [laplacian(12, seed) for seed in (0, 1)] + [laplacian(7)]
    kept = [factorised(a) for a in systems]
    for _ in range(2):
        for a, factors in zip(systems, kept, strict=True):
            np.testing.assert_allclose(factors.solve(a @ np.ones(a.shape[0])), 1.0, rtol=1e-12)


def test_singular_matrix_is_said_to_be(factorised):
    a = laplacian(5)
    a.data[a.indptr[7] : a.indptr[8]] = 0.0
    with pytest.raises(linear.Singular):
        factorised(a).solve(np.ones(25))


def test_negative_pivots_count_negative_eigenvalues():
    a = laplacian(8, asymmetry=0.0)
    for shift in (0.0, 1.0, 3.0, 9.0):
        shifted = sp.csc_array(a - shift * sp.eye_array(64))
        expected = int((np.linalg.eigvalsh(shifted.toarray()) < 0.0).sum())
        assert linear.factorised(shifted, pivot=0.0).negative_pivots() == expected


def test_a_negative_direction_curves_down():
    a = laplacian(12, asymmetry=0.0)
    values = np.linalg.eigvalsh(a.toarray())
    for shift in (0.5 * (values[2] + values[3]), 0.5 * (values[0] + values[1])):
        shifted = sp.csc_array(a - shift * sp.eye_array(144))
        v = linear.factorised(shifted, pivot=0.0).negative_direction()
        assert v @ (shifted @ v) < 0.0
    assert linear.factorised(a, pivot=0.0).negative_direction() is None


@needs_pardiso
@pytest.mark.parametrize(("ratio", "two_way"), [(0.5, True), (0.5, False), (0.9, False)])
def test_net_has_one_equilibrium_whatever_the_solver(monkeypatch, ratio, two_way):
    s = saddle(13, ratio, two_way)
    found = []
    for large in (np.inf, 0):
        monkeypatch.setattr(linear, "LARGE", large)
        found.append(equilibrium(Assembly(s), Loads(np.zeros_like(s.nodes)), s.nodes, atol=1e-10))
    assert [f.status for f in found] == ["converged", "converged"]
    # forces of 1e-10 N over the softest direction of these nets, above 1e-2 N/m
    np.testing.assert_allclose(found[1].x, found[0].x, rtol=0.0, atol=1e-8)
