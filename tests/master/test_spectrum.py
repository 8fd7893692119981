"""Eigenvalues of G' from finite differences against matrices with known spectra."""

import numpy as np
import pytest

from master.coupling.acceleration import ConstantRelaxation
from master.coupling.fixed_point import fixed_point
from master.coupling.spectrum import critical_relaxation, dominant_eigenvalue, rightmost_eigenvalue


def spectral_map(leading, n, normal=True, noise=0.0, seed=0):
    """G with fixed point x, slope spectrum `leading` + a decaying tail, curvature, and solver noise relative to |x|."""
    rng = np.random.default_rng(seed)
    tail = 0.5 * 0.85 ** np.arange(n - len(leading)) * rng.choice([-1.0, 1.0], n - len(leading))
    S, _ = np.linalg.qr(rng.standard_normal((n, n)))
    if not normal:  # condition of the modes 5
        S = S * np.linspace(1.0, 5.0, n) @ np.linalg.qr(rng.standard_normal((n, n)))[0]
    eigenvalues = np.concatenate((leading, tail))
    A = S @ np.diag(eigenvalues) @ np.linalg.inv(S)
    x = rng.standard_normal(n)
    scale = noise * np.linalg.norm(x) / np.sqrt(n)

    def G(y):
        return x + A @ (y - x) + 0.1 * (y - x) ** 2 + scale * rng.standard_normal(n)

    return G, x, A, eigenvalues


@pytest.mark.parametrize("normal", [True, False])
@pytest.mark.parametrize("noise", [0.0, 1e-7])
@pytest.mark.parametrize(
    "leading", [(1.1, -4.0, -2.0, 0.6), (1.05, 1.0, -3.6), (0.99, -4.0, 0.9, -2.0), (-3.6, 0.3, 0.2)]
)
def test_the_rightmost_eigenvalue_of_333_unknowns_takes_at_most_40_evaluations(leading, noise, normal):
    G, x, A, eigenvalues = spectral_map(leading, 333, normal, noise)
    mode = rightmost_eigenvalue(G, x)
    assert mode.settled
    assert mode.evaluations <= 40
    assert mode.value == pytest.approx(eigenvalues.max(), abs=1e-3)  # the accuracy asked for
    # 0.05: a mode is only as good as its residual over the gap to the next eigenvalue, which is 0.05 at least
    assert np.linalg.norm(A @ mode.vector - mode.value * mode.vector) <= 0.05
    assert np.linalg.norm(mode.vector) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("n", [1, 2, 5, 6, 12])
def test_small_problems_are_exact(n):
    rng = np.random.default_rng(n)
    A = rng.standard_normal((n, n))
    A = A + A.T
    mode = rightmost_eigenvalue(lambda y: A @ y, np.zeros(n))
    # linear, so only rounding over the step: 1e-16 / 1e-3, with room for its accumulation; else the accuracy asked for
    assert mode.value == pytest.approx(np.linalg.eigvalsh(A)[-1], abs=1e-10 if n <= 5 else 1e-3)
    assert mode.evaluations <= 2 * n


def test_an_invariant_subspace_ends_the_search():
    for factor in (1.1, 0.0, -2.0):
        mode = rightmost_eigenvalue(lambda y, factor=factor: factor * y, np.ones(50))
        assert mode.settled
        assert mode.evaluations == 2
        assert mode.value == pytest.approx(factor, abs=1e-9)  # rounding over the step
        assert dominant_eigenvalue(lambda y, factor=factor: factor * y, np.ones(50)).value == pytest.approx(
            factor, abs=1e-9
        )


def test_a_rotation_has_a_complex_pair_and_power_iteration_says_that_it_does_not_settle():
    A = np.diag([0.1] * 10)
    A[:2, :2] = [[0.9, -0.8], [0.8, 0.9]]
    mode = rightmost_eigenvalue(lambda y: A @ y, np.ones((5, 2)).ravel())
    assert (mode.value, mode.imaginary) == pytest.approx((0.9, 0.8), abs=1e-6)  # exact on the invariant subspace of 3
    dominant = dominant_eigenvalue(lambda y: A @ y, np.ones(10))
    assert not dominant.settled
    assert "complex" in dominant.message


def test_eigenvalues_of_equal_magnitude_and_opposite_sign_do_not_settle():
    A = np.diag([2.0, -2.0, 0.5, 0.1])
    assert not dominant_eigenvalue(lambda y: A @ y, np.ones(4)).settled


@pytest.mark.parametrize("lead", [(-3.6, 0.3, 0.2), (1.2, -0.8, 0.3), (-0.8, 0.5)])
@pytest.mark.parametrize("normal", [True, False])
def test_power_iteration_finds_the_signed_dominant_eigenvalue(lead, normal):
    G, x, _, _ = spectral_map(lead, 333, normal, noise=1e-7)
    mode = dominant_eigenvalue(G, x)
    # residual 1e-3 relative times the condition of the modes, 5
    assert mode.settled
    assert mode.value == pytest.approx(lead[0], rel=5e-3)


@pytest.mark.parametrize("slope", [-3.6, -0.8, 0.3])
def test_relaxation_converges_just_below_the_critical_factor_and_fails_just_above(slope):
    G, x, _, _ = (
        spectral_map((slope,), 40) if slope < -0.5 else (lambda y: slope * y + 1.0, np.array([1 / 0.7]), None, None)
    )
    omega = critical_relaxation(dominant_eigenvalue(G, x).value)
    start = x + 1e-3
    ends = [
        fixed_point(G, start, ConstantRelaxation(f * omega), residual_rtol=1e-6, max_iterations=2000).status
        for f in (0.97, 1.03)
    ]
    assert ends[0] == "converged"
    assert ends[1] != "converged"


def test_critical_relaxation_is_the_closed_form():
    assert critical_relaxation(-3.0) == 0.5
    assert critical_relaxation(0.0) == 2.0
    assert critical_relaxation(1.0) == critical_relaxation(1.1) == 0.0


def test_values_that_are_not_finite_are_reported():
    for search in (dominant_eigenvalue, rightmost_eigenvalue):
        for n in (3, 30):
            mode = search(lambda y: np.full_like(y, np.nan), np.ones(n))
            assert not mode.settled
            assert "finite" in mode.message


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="step"):
        dominant_eigenvalue(np.sin, np.ones(3), step=0.0)
    with pytest.raises(ValueError, match="finite"):
        rightmost_eigenvalue(np.sin, np.array([np.nan]))
    with pytest.raises(ValueError, match="finite"):
        critical_relaxation(np.nan)


def test_a_symmetric_start_confines_the_search_to_symmetric_modes():
    n = 40
    mirrored = np.concatenate(
        (np.linspace(0.9, 0.1, n // 2), np.linspace(1.1, 0.2, n // 2))
    )  # symmetric, antisymmetric
    i = np.arange(n // 2)
    Q, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((n // 2, n // 2)))
    S = np.block([[Q, Q], [Q[::-1], -Q[::-1]]]) / np.sqrt(2.0)
    A = (S * mirrored) @ S.T
    symmetric = np.concatenate((np.sqrt(i + 1.0), np.sqrt(i + 1.0)[::-1]))
    found = rightmost_eigenvalue(lambda y: A @ y, np.ones(n), start=symmetric)
    assert found.value == pytest.approx(0.9, abs=1e-3)  # the accuracy asked for
    assert rightmost_eigenvalue(lambda y: A @ y, np.ones(n)).value == pytest.approx(1.1, abs=1e-3)
    with pytest.raises(ValueError, match="start"):
        rightmost_eigenvalue(lambda y: A @ y, np.ones(n), start=np.zeros(n))
