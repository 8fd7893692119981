"""Newton-Krylov: its order of convergence, from an analytic Jacobian and from the solvers' directional derivatives."""

import numpy as np
import pytest

from benchmarks.problems import as_fmus, in_process, plate_wind, twist
from master.coupling import SCHEMES, CoupledStepFailed, Coupling, coupled_run, scheme, solve
from master.coupling.acceleration import NewtonKrylov
from master.coupling.fixed_point import fixed_point
from tests.master.toys import Faulty


class Fields:
    """u <- s_u (A sin(p/s_p) + b_u), p <- s_p (u/s_u - (u/s_u)^3/3 + b_p), with the product G' v."""

    def __init__(self, n=30, s_u=1e-3, s_p=1e5, seed=0):
        rng = np.random.default_rng(seed)
        self.n, self.s_u, self.s_p = n, s_u, s_p
        self.A = 0.7 * rng.standard_normal((n, n)) / np.sqrt(n)
        self.b = 0.3 * rng.standard_normal((2, n))
        self.fields = {"u": slice(0, n), "p": slice(n, 2 * n)}
        self.x = None  # where G was evaluated last
        self.products = 0

    def G(self, x):
        self.x = x.copy()
        u, p = x[: self.n] / self.s_u, x[self.n :] / self.s_p
        return np.concatenate(
            (self.s_u * (self.A @ np.sin(p) + self.b[0]), self.s_p * (u - u**3 / 3.0 + self.b[1]))
        )  # fmt: skip

    def product(self, v):
        self.products += 1
        u, p = self.x[: self.n] / self.s_u, self.x[self.n :] / self.s_p
        du, dp = v[: self.n] / self.s_u, v[self.n :] / self.s_p
        return np.concatenate((self.s_u * (self.A @ (np.cos(p) * dp)), self.s_p * ((1.0 - u**2) * du)))


def order(errors):
    """Observed order log(e_k+1 / e_k) / log(e_k / e_k-1) of the last steps."""
    e = np.log(np.asarray(errors))
    return np.diff(e)[1:] / np.diff(e)[:-1]


@pytest.mark.parametrize("scales", [(1e-3, 1e5), (1.0, 1.0), (1e6, 1e-6)])
def test_convergence_is_quadratic_in_two_badly_scaled_fields(scales):
    problem = Fields(s_u=scales[0], s_p=scales[1])
    newton = NewtonKrylov(problem.product)
    result = fixed_point(problem.G, np.zeros(60), newton, rtol=1e-12, fields=problem.fields)
    assert result.status == "converged"
    # relative to the sizes of the fields, while above rounding of 1e-14
    r = result.field_residual_norms["u"] / scales[0] + result.field_residual_norms["p"] / scales[1]
    r = r[r > 1e-13]
    # the forcing term 0.9 (r / r_before)^2 lets the linear error in at the size of the quadratic one
    assert order(r)[-1] > 1.7
    assert result.iterations <= 9


def test_a_linear_problem_takes_one_step_of_full_tightness():
    rng = np.random.default_rng(1)
    A, b = rng.standard_normal((20, 20)), rng.standard_normal(20)
    newton = NewtonKrylov(lambda v: A @ v, eta=1e-12)
    result = fixed_point(lambda x: A @ x + b, np.zeros(20), newton, residual_rtol=1e-9)
    assert (result.status, result.iterations) == ("converged", 2)
    # residual times the condition of I - A, 1e2
    assert np.abs(result.x - np.linalg.solve(np.eye(20) - A, b)).max() < 1e-6


def test_directions_bound_the_products_of_a_step():
    problem = Fields()
    newton = NewtonKrylov(problem.product, directions=5)
    problem.G(np.zeros(60))
    newton.begin([slice(0, 30), slice(30, 60)])
    newton.step(np.zeros(60), problem.G(np.zeros(60)))
    # GMRES checks its result with one more
    assert problem.products <= 6
    assert newton.record["products"] == problem.products


def test_begun_anew_it_takes_the_products_at_the_best_point():
    class Memory:  # the participants, which know the point of their last evaluation
        def __init__(self):
            self.at = self.marked = self.asked = None

        def G(self, x):
            self.at = float(x[0])
            return np.where(np.abs(x) < 1.6, x - 3.0 * np.arctan(x), 1e9)

        def product(self, v):
            self.asked = self.at
            return (1.0 - 3.0 / (1.0 + self.at**2)) * v

        def mark(self):
            self.marked = self.at

        def restore(self):
            self.at = self.marked

    memory = Memory()
    asked = []

    def callback(k, x, x_tilde, r):
        asked.append((memory.asked, float(x[0])))

    start = np.array([1.5])  # Newton's method for arctan leaps to -1.69, and beyond 1.39 ever further
    result = fixed_point(memory.G, start, NewtonKrylov(memory.product), atol=1e-10, anchor=memory, callback=callback)
    assert "grew" in result.recoveries[0].reason
    assert asked[2][0] == start[0]  # the products were those at the best point, not at the worst
    assert result.status == "converged"


def test_a_product_that_fails_makes_it_begin_anew_and_then_ends_in_a_status():
    problem = Fields()
    calls = []

    def product(v, fails):
        calls.append(1)
        if fails(len(calls)):
            raise CoupledStepFailed("participant a has no derivative here")
        return problem.product(v)

    options = {"rtol": 1e-8, "fields": problem.fields}
    once = fixed_point(problem.G, np.zeros(60), NewtonKrylov(lambda v: product(v, lambda k: k == 9)), **options)
    assert once.status == "converged"
    assert "no derivative" in once.recoveries[0].reason
    calls.clear()
    never = fixed_point(problem.G, np.zeros(60), NewtonKrylov(lambda v: product(v, lambda k: k > 8)), **options)
    assert never.status == "diverged"
    assert "no derivative" in never.message


@pytest.mark.parametrize("speed", [8.0, 12.0, 20.0])
def test_the_v3_kite_takes_at_most_six_evaluations(speed):
    coupling = in_process("v3_kite", wind_speed=speed)
    result = solve(coupling, scheme("newton-krylov", coupling))
    assert result.status == "converged"
    assert result.iterations <= 6
    r = np.array([row["residual_m"] for row in result.history])
    r = r[r > 1e-9]  # beyond it the structural tolerance of 1e-8 N takes over
    # lines that go slack or taut between two iterates bend the map; the last step is free of them
    assert order(r)[-1] > 1.6


@pytest.mark.parametrize(("variant", "theta"), [("divergent", 0.02), ("divergent", -0.04), ("restoring", -0.004)])
def test_the_typical_section_converges_quadratically_below_and_beyond_divergence(variant, theta):
    coupling = in_process("typical_section", {"variant": variant}, **plate_wind(variant, theta))
    result = solve(coupling, scheme("newton-krylov", coupling, eta=1e-6), atol=1e-9, force_tolerance=1e-6)
    assert result.status == "converged"
    assert result.iterations <= 6
    assert twist(result.displacement) == pytest.approx(theta, abs=1e-8)  # closed form, to what is asked for


def test_it_is_refused_for_fmus_in_one_sentence():
    with (
        as_fmus("typical_section") as coupling,
        pytest.raises(ValueError, match=r"^the \w+ solver offers no directional derivatives: use .* scheme\.$"),
    ):
        scheme("newton-krylov", coupling)
    with pytest.raises(ValueError, match=r"needs the participants.*\.$"):
        scheme("newton-krylov")


def test_derivatives_of_a_solver_that_raises_end_in_a_status():
    class NoDerivative(Faulty):
        offers_derivatives = True

        def directional_derivative(self, changes):
            raise np.linalg.LinAlgError("Singular matrix")

    whole = in_process("typical_section", wind_speed=10.0)
    coupling = Coupling(NoDerivative(whole.structural), whole.aero)
    run = coupled_run(coupling, scheme("newton-krylov", coupling))
    assert run.status == "diverged"
    assert "Singular matrix" in run.message


def test_parallel_order_needs_the_same_products_to_the_same_solution():
    ends = []
    for order_ in ("serial", "parallel"):
        coupling = in_process("v3_kite", wind_speed=12.0)
        result = solve(coupling, scheme("newton-krylov", coupling, order=order_), order=order_)
        assert result.status == "converged"
        ends.append(result.displacement)
    # both within the tolerance of 1e-5 m in the norm of the residual, and the inverse of I - G' is below 10 here
    assert np.abs(ends[0] - ends[1]).max() < 1e-4
    assert SCHEMES["newton-krylov"].exact
