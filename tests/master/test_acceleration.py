"""Acceleration schemes against closed forms and against the counts of peers on the reference problems.

Counts are evaluations of G a communication step, mean over the steps. Kratos 10.4.4 and preCICE 3.4.1 ran the problems.
"""

import math

import numpy as np
import pytest

from benchmarks.reference_problems import AddedMass, BadlyScaledFields, Linear, Tube
from master.coupling.acceleration import IQNILS, Aitken, ConstantRelaxation
from master.coupling.fixed_point import fixed_point


def march(problem, scheme, steps, parallel=False, **options):
    """Mean evaluations of G a step over converged steps; every step must converge."""
    counts = []
    for _ in range(steps):
        G, x0 = (problem.parallel_G, problem.parallel_x0) if parallel else (problem.G, problem.x0)
        result = fixed_point(G, x0, scheme, **options)
        assert result.status == "converged", result.message
        counts.append(result.iterations)
        problem.advance(result.x)
    return float(np.mean(counts))


@pytest.mark.parametrize("slope", [-3.0, -0.5, 0.5, 0.94, 3.0])
def test_aitken_and_iqn_ils_are_exact_for_a_scalar_linear_problem(slope):
    for scheme in (Aitken(), IQNILS()):
        result = fixed_point(lambda x: slope * x + 1.0, np.array([0.3]), scheme, residual_rtol=1e-10)
        # first evaluation, one relaxed, one exact secant; 1e-12: rounding times the condition 1 / (1 - 0.94)
        assert result.status == "converged"
        assert result.iterations == 3
        assert result.x == pytest.approx(1.0 / (1.0 - slope), rel=1e-12)


def test_aitken_first_factor_of_a_step_keeps_its_sign_and_its_magnitude_is_capped():
    scheme = Aitken(omega=0.5, omega_max=0.2)
    fixed_point(lambda x: 3.0 * x + 1.0, np.array([0.3]), scheme, residual_rtol=1e-10)  # exact factor 1/(1-3) = -0.5
    x, r = np.array([1.0]), np.array([2.0])
    assert scheme.step(x, r) == pytest.approx(1.0 - 0.2 * 2.0, rel=1e-15)


def test_aitken_repeats_its_factor_when_the_residual_does_not_change():
    scheme = Aitken(omega=0.25)
    x, r = np.zeros(3), np.ones(3)
    scheme.step(x, r)
    assert np.array_equal(scheme.step(x, r), 0.25 * r)


def test_iqn_ils_solves_the_linear_problem_in_the_15_evaluations_of_the_peers():
    problem = Linear()
    result = fixed_point(problem.G, problem.x0, IQNILS(), residual_rtol=1e-8)
    assert result.status == "converged"
    assert result.iterations <= 15
    # error <= |r| / min|1 - lambda| and every 1 - lambda >= 1
    assert np.linalg.norm(result.x - problem.solution()) <= 1e-8 * result.residual_norms[0]


@pytest.mark.parametrize(("scheme", "bound"), [(Aitken(), 24), (ConstantRelaxation(0.1), 176)])
def test_relaxations_need_the_evaluations_of_the_peers_on_the_linear_problem(scheme, bound):
    problem = Linear()
    # peers 22 and 175; b differs with the random numbers
    result = fixed_point(problem.G, problem.x0, scheme, residual_rtol=1e-8, max_iterations=bound)
    assert result.status == "converged", result.message


def test_badly_scaled_fields_converge_in_the_26_evaluations_of_precice():
    problem = BadlyScaledFields()
    result = fixed_point(problem.G, problem.x0, IQNILS(), rtol=1e-8, fields=problem.fields)
    assert result.status == "converged"
    assert result.iterations <= 26


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_counts_do_not_depend_on_units(scale):
    problem = BadlyScaledFields(s_u=1e-3 * scale)
    for scheme, plain in ((IQNILS(), IQNILS()), (Aitken(), Aitken())):
        linear = Linear()
        result = fixed_point(lambda x, G=linear.G: scale * G(x / scale), linear.x0, scheme, residual_rtol=1e-6)
        assert result.iterations == fixed_point(linear.G, linear.x0, plain, residual_rtol=1e-6).iterations
    assert fixed_point(problem.G, problem.x0, IQNILS(), rtol=1e-8, fields=problem.fields).iterations == 26


@pytest.mark.parametrize(("h", "bound"), [(0.1, 3.40), (1.0, 2.75)])
def test_added_mass_with_reuse_beats_precice(h, bound):
    assert march(AddedMass(h), IQNILS(), 20, residual_rtol=1e-8) <= bound


def test_added_mass_makes_the_explicit_scheme_unstable_for_a_light_wall_only():
    for h in (0.1, 20.0):  # rho_s h / (rho_f mu_max) = 0.015 and 3.0
        problem = AddedMass(h)
        result = fixed_point(problem.G, problem.x0, ConstantRelaxation(), residual_rtol=1e-8)
        stable = problem.rho_s * h / (problem.rho_f * problem.mu.max()) > 1.0
        assert result.status == ("converged" if stable else "diverged")


@pytest.mark.parametrize("h", [0.1, 1.0])
def test_constant_relaxation_bound_is_sharp(h):
    problem = AddedMass(h)
    below, above = (
        fixed_point(
            problem.G,
            problem.x0,
            ConstantRelaxation(f * problem.critical_omega),
            residual_rtol=1e-6,
            max_iterations=3000,
        )
        for f in (0.98, 1.02)
    )
    assert below.status == "converged", below.message
    assert above.status in ("diverged", "stalled"), above.message
    assert above.residual_norms[-1] > above.residual_norms.min()


def test_elastic_tube_takes_fewer_evaluations_than_in_precice():
    assert march(Tube(), IQNILS(), 100, residual_rtol=1e-5) <= 6.74


@pytest.mark.parametrize(("kappa", "tau", "frequency", "bound"), [(10, 0.01, 10, 6.25), (100, 0.001, 100, 5.15)])
def test_stiff_and_soft_tubes_take_fewer_evaluations_than_in_precice(kappa, tau, frequency, bound):
    problem = Tube(kappa, tau, lambda t: 10.0 + math.sin(frequency * math.pi * t))
    assert march(problem, IQNILS(), 60, residual_rtol=1e-6) <= bound


def test_parallel_tube_takes_fewer_evaluations_than_in_precice():
    problem = Tube()
    assert march(problem, IQNILS(), 100, parallel=True, rtol=1e-5, fields=problem.fields) <= 8.5


def test_relaxation_never_converges_on_the_tube():
    problem = Tube()
    result = fixed_point(problem.G, problem.x0, ConstantRelaxation(0.1), residual_rtol=1e-5)
    assert result.status in ("diverged", "stalled")


def test_history_of_earlier_steps_shortens_the_next_and_a_fresh_scheme_starts_clean():
    problem = Linear()
    scheme = IQNILS()
    first, second = (fixed_point(problem.G, problem.x0, scheme, residual_rtol=1e-8) for _ in range(2))
    fresh = fixed_point(problem.G, problem.x0, IQNILS(), residual_rtol=1e-8)
    assert fresh.iterations == first.iterations
    assert np.array_equal(fresh.x, first.x)
    assert second.iterations <= 3  # the same linear problem again: all its columns are known, 1e-8 is their accuracy


def test_without_reuse_every_step_is_the_first():
    problem = Linear()
    scheme = IQNILS(reuse=0)
    counts = [fixed_point(problem.G, problem.x0, scheme, residual_rtol=1e-8).iterations for _ in range(3)]
    assert len(set(counts)) == 1


def test_last_pair_of_a_converged_step_becomes_a_column():
    problem = Linear()
    scheme = IQNILS()
    result = fixed_point(problem.G, problem.x0, scheme, residual_rtol=1e-8)
    assert scheme.columns == result.iterations - 1


def test_an_unchanged_x_gives_no_column():
    scheme = IQNILS()
    x, r = np.array([1.0, 2.0]), np.array([0.1, -0.2])
    first = scheme.step(x, r)
    assert np.array_equal(scheme.step(x, r), first)
    assert scheme.columns == 0
    scheme.step(x, np.array([np.nan, 0.0]))
    assert scheme.columns == 0


def test_divergence_drops_the_columns():
    problem = Linear()
    scheme = IQNILS()
    fixed_point(problem.G, problem.x0, scheme, residual_rtol=1e-8)
    assert scheme.columns > 0
    fixed_point(lambda x: np.full_like(x, np.nan), problem.x0, scheme, residual_rtol=1e-8)
    assert scheme.columns == 0


@pytest.mark.parametrize("seed", range(3))
def test_a_noisy_nonlinear_map_with_slopes_from_minus_4_converges_within_13_evaluations(seed):
    rng = np.random.default_rng(seed)
    n = 333
    Q, _ = np.linalg.qr(rng.standard_normal((n, n)))
    slopes = np.concatenate(([-4.0, -1.0, -0.5, 0.3], 0.5 * 0.8 ** np.arange(n - 4)))
    x_star, start = rng.standard_normal((2, n))

    def G(x):
        y = Q.T @ (x - x_star)
        return x_star + Q @ (slopes * (y + 0.05 * y * np.tanh(y))) + 1e-8 * rng.standard_normal(n)

    result = fixed_point(G, x_star + start, IQNILS(), residual_rtol=1e-6)
    assert result.status == "converged"
    assert result.iterations <= 13


@pytest.mark.parametrize(
    "bad",
    [
        lambda: ConstantRelaxation(0.0),
        lambda: ConstantRelaxation(math.nan),
        lambda: Aitken(omega_max=-1.0),
        lambda: IQNILS(omega0=math.inf),
        lambda: IQNILS(reuse=-1),
        lambda: IQNILS(filter=1.0),
        lambda: IQNILS(stale=-1.0),
    ],
)
def test_impossible_settings_are_refused_in_one_sentence(bad):
    with pytest.raises(ValueError, match=r"\.$"):
        bad()


def test_columns_of_another_size_are_refused():
    scheme = IQNILS()
    fixed_point(Linear(20).G, np.zeros(20), scheme, residual_rtol=1e-6)
    with pytest.raises(ValueError, match="fresh IQNILS"):
        fixed_point(Linear(30).G, np.zeros(30), scheme, residual_rtol=1e-6)


def test_an_inexact_solver_that_answers_differently_at_the_same_x_gives_no_column():
    scheme = IQNILS()
    x = np.array([1.0, 2.0])
    scheme.step(x, np.array([0.1, -0.2]))
    scheme.step(x, np.array([0.1, -0.2 + 1e-7]))
    assert scheme.columns == 0
