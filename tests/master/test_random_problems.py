"""The default scheme on random problems made to be hard, without tuning: it converges, quietly, or says why not."""

import numpy as np
import pytest

from benchmarks.random_problems import RandomProblem
from master.coupling import SCHEMES
from master.coupling.fixed_point import fixed_point

SEEDS = range(60)  # of the 1000 of the benchmark
SINGLE = [seed for seed in range(400) if RandomProblem(seed).n == 1][:8]


def solved(seed, name="iqn-ils", **options):
    """Result and problem of a seed."""
    problem = RandomProblem(seed)
    return fixed_point(problem.G, problem.x0, SCHEMES[name](), **(problem.options | options)), problem


@pytest.mark.parametrize("seed", SEEDS)
def test_the_default_scheme_converges_within_200_evaluations(seed):
    result, problem = solved(seed)  # floating-point warnings are errors here
    assert result.status == "converged", result.message
    # every field by its own tolerance, from the problem's own numbers
    r = result.x_tilde - result.x
    for name, f in problem.fields.items():
        first = result.field_residual_norms[name][0]
        bound = problem.tolerance * (first if problem.kind == "residual_rtol" else np.linalg.norm(result.x_tilde[f]))
        # a field that is zero to rounding has converged
        assert np.linalg.norm(r[f]) <= bound * (1.0 + 1e-12) + 1e-14 * np.linalg.norm(result.x_tilde[f])


@pytest.mark.parametrize("seed", SINGLE)
@pytest.mark.parametrize("name", ["aitken", "iqn-ils", "iqn-imvj"])
def test_one_unknown_converges_with_every_secant_scheme(seed, name):
    result, problem = solved(seed, name)
    assert problem.n == 1
    assert result.status == "converged", result.message
    assert result.iterations <= 30


@pytest.mark.parametrize("name", ["explicit", "aitken", "iqn-ils", "iqn-imvj"])
def test_what_does_not_converge_has_a_status_and_a_sentence(name):
    for seed in range(0, 60, 4):
        result, _ = solved(seed, name, max_iterations=12)
        assert result.status in ("converged", "max_iterations", "diverged", "stalled")
        assert result.message.endswith(".")
        assert len(result.residual_norms) == result.iterations <= 12
