"""Our schemes beside those of peers on the reference problems, and how the accelerators of Kratos are driven."""

import numpy as np
import pytest

from benchmarks import kratos
from benchmarks.coupling_reference import LIMITS, SETTINGS, candidates
from benchmarks.coupling_reference import reference as table_of_schemes
from benchmarks.reference_problems import REFERENCES, Linear
from master.coupling.acceleration import IQNILS
from master.coupling.fixed_point import fixed_point

# iqnils of Kratos 10.4.4: mean evaluations of G a step, iteration_horizon, timestep_horizon, alpha; the best of those
# tried for each problem. Source: `.venv/bin/python -m benchmarks run coupling.reference`, docs/benchmarks.md.
KRATOS_IQNILS = {
    "linear": (15, 12, 3, 0.125),
    "two badly scaled fields": (28, 12, 3, 0.125),
    "added mass, h = 0.1": (2.95, 20, 6, 0.125),
    "added mass, h = 1": (2.50, 10, 3, 0.125),
    "elastic tube": (10.79, 12, 3, 0.125),
    "elastic tube, parallel": (9.59, 20, 10, 1.0),
    "elastic tube, κ = 10": (7.85, 10, 6, 0.125),
    "elastic tube, κ = 100": (5.10, 10, 10, 0.125),
    "tube with ring wall": (3.71, 12, 15, 0.125),
}
# Where our default first factor, 0.35, is not the one for the problem: 17 evaluations in the first of 20 steps, against
# 15 with the 0.125 that was best for Kratos there.
FIRST_STEP = {"added mass, h = 0.1": 2.0 / 20.0}
with_kratos = pytest.mark.skipif(kratos.version() is None, reason=kratos.NOT_INSTALLED)
by_name = pytest.mark.parametrize("reference", REFERENCES, ids=lambda reference: reference.name)


@by_name
def test_default_iqn_ils_takes_no_more_evaluations_than_its_bound_and_than_kratos(reference):
    march = reference.march(IQNILS())
    assert not march.failed, march.message
    assert march.mean <= reference.bound
    assert march.mean <= KRATOS_IQNILS[reference.name][0] + FIRST_STEP.get(reference.name, 0.0) + 1e-12  # rounding


@with_kratos
@by_name
def test_default_iqn_ils_takes_no_more_evaluations_than_kratos_side_by_side(reference):
    _, iterations, steps, alpha = KRATOS_IQNILS[reference.name]
    iqnils = kratos.KratosAccelerator("iqnils", iteration_horizon=iterations, timestep_horizon=steps, alpha=alpha)
    theirs = reference.march(iqnils, **LIMITS)
    more = FIRST_STEP.get(reference.name, 0.0) + 1e-12  # rounding
    assert theirs.failed or reference.march(IQNILS(), **LIMITS).mean <= theirs.mean + more


@with_kratos
@pytest.mark.parametrize(
    ("kind", "count"), [("iqnils", 15), ("mvqn", 15), ("anderson", 25), ("aitken", 22), ("constant_relaxation", 140)]
)
def test_accelerators_of_kratos_solve_the_linear_problem_in_the_evaluations_their_method_needs(kind, count):
    problem = Linear()
    result = fixed_point(problem.G, problem.x0, kratos.KratosAccelerator(kind), residual_rtol=1e-8)
    assert result.status == "converged", result.message
    assert result.iterations <= count
    assert np.linalg.norm(result.x - problem.solution()) <= 1e-8 * result.residual_norms[0]  # every 1 - lambda >= 1


class Recorder:
    """An accelerator with relaxation 0.5 that writes down how it was called."""

    def __init__(self, calls):
        self.calls = calls

    def UpdateSolution(self, r, x):
        self.calls.append(f"UpdateSolution {r.size}")
        return 0.5 * r

    def __getattr__(self, name):
        return lambda: self.calls.append(name)


@pytest.mark.parametrize(("separately", "updates"), [(False, [2]), (True, [1, 1])])
def test_kratos_is_called_in_the_order_of_its_own_coupled_solver(monkeypatch, separately, updates):
    calls = []
    monkeypatch.setattr(kratos, "_creator", lambda kind: lambda settings: Recorder(calls))
    scheme = kratos.KratosAccelerator("any", separately)
    fields = {"a": slice(0, 1), "b": slice(1, 2)}
    for _ in range(2):
        # x = 0.5 x + 1 relaxed by 0.5 has a residual 3/4 of the last: two evaluations to 0.8
        result = fixed_point(lambda x: 0.5 * x + 1.0, np.zeros(2), scheme, residual_rtol=0.8, fields=fields)
        assert result.iterations == 2
    step = ["InitializeSolutionStep", "InitializeNonLinearIteration", "FinalizeNonLinearIteration"]
    step += [f"UpdateSolution {n}" for n in updates]
    step += ["InitializeNonLinearIteration", "FinalizeNonLinearIteration", "FinalizeSolutionStep"]
    expected = ["Initialize", *step, *step]
    each = len(updates)
    assert calls == [c for call in expected for c in [call] * (1 if call.startswith("Update") else each)]


def test_a_singular_matrix_in_kratos_is_a_status(monkeypatch):
    class Singular(Recorder):
        def UpdateSolution(self, r, x):
            raise np.linalg.LinAlgError("singular matrix")

    monkeypatch.setattr(kratos, "_creator", lambda kind: lambda settings: Singular([]))
    result = fixed_point(lambda x: 0.5 * x + 1.0, np.zeros(2), kratos.KratosAccelerator("any"), residual_rtol=1e-6)
    assert result.status == "diverged"


def test_without_kratos_one_sentence_says_so(monkeypatch):
    monkeypatch.setattr(kratos, "version", lambda: None)
    with pytest.raises(ModuleNotFoundError, match="Kratos is not installed; pip install"):
        kratos.KratosAccelerator("iqnils")


def test_without_kratos_its_columns_say_so(monkeypatch):
    monkeypatch.setattr(kratos, "version", lambda: None)
    text = table_of_schemes(True)
    assert text.count("not installed |") == len(SETTINGS) * len(REFERENCES)
    assert "Kratos is not installed; `pip install" in text


def test_kratos_is_tried_with_all_combinations_of_settings_and_with_fields_also_one_accelerator_a_field(monkeypatch):
    monkeypatch.setattr(kratos, "_creator", lambda kind: lambda settings: Recorder([]))
    count = np.prod([len(values) for values in SETTINGS["iqnils"].values()])
    assert len({str(scheme) for scheme in candidates("iqnils", None)}) == count
    assert len({str(scheme) for scheme in candidates("iqnils", {"a": slice(None)})}) == 2 * count
