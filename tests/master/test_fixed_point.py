"""The coupling loop: what counts as converged, and every other way to end."""

import pickle

import numpy as np
import pytest

from benchmarks.reference_problems import BadlyScaledFields
from master.coupling.acceleration import IQNILS, IQNIMVJ, Aitken, ConstantRelaxation
from master.coupling.fixed_point import fixed_point

EXPLICIT = ConstantRelaxation(1.0)


def contraction(slope):
    return lambda x: slope * x + 1.0


def test_the_tested_residual_belongs_to_x():
    G = contraction(0.5)
    result = fixed_point(G, np.zeros(3), EXPLICIT, atol=1e-6)
    assert np.array_equal(result.x_tilde, G(result.x))
    assert result.residual_norms[-1] == pytest.approx(np.linalg.norm(G(result.x) - result.x), rel=1e-12)  # rounding
    assert result.residual_norms.size == result.iterations


@pytest.mark.parametrize(
    ("tolerances", "evaluations"),
    # |r_k| = 2^(1-k), |x_tilde_k| = 2 - 2^(1-k): rtol = 2^-10 asks 2^(1-k) (1 + 2^-10) <= 2^-9, just missed at k = 10
    [
        ({"atol": 2.0**-10}, 11),
        ({"residual_rtol": 2.0**-10}, 11),
        ({"rtol": 2.0**-10}, 11),
        ({"rtol": 2.0**-10 * 1.01}, 10),
    ],
)
def test_evaluations_follow_from_the_contraction(tolerances, evaluations):
    result = fixed_point(contraction(0.5), np.zeros(1), EXPLICIT, **tolerances)
    assert (result.status, result.iterations) == ("converged", evaluations)


def test_converging_on_the_last_allowed_evaluation_is_converged():
    enough = fixed_point(contraction(0.5), np.zeros(1), EXPLICIT, atol=2.0**-10, max_iterations=11)
    short = fixed_point(contraction(0.5), np.zeros(1), EXPLICIT, atol=2.0**-10, max_iterations=10)
    assert (enough.status, enough.iterations) == ("converged", 11)
    assert (short.status, short.iterations) == ("max_iterations", 10)


@pytest.mark.parametrize("scheme", [EXPLICIT, Aitken(), IQNILS()])
def test_starting_at_the_solution_takes_one_evaluation(scheme):
    result = fixed_point(contraction(0.5), np.full(3, 2.0), scheme, residual_rtol=1e-6)
    assert (result.status, result.iterations) == ("converged", 1)


def test_every_field_must_converge_each_with_its_own_tolerance():
    slopes = np.array([0.1, 0.8])
    fields = {"displacement": slice(0, 1), "pressure": [1]}
    options = {"x0": np.zeros(2), "scheme": EXPLICIT, "fields": fields}
    both = fixed_point(contraction(slopes), atol={"displacement": 1e-3, "pressure": 1e-6}, **options)
    assert both.status == "converged"
    assert both.field_residual_norms["displacement"][-1] <= 1e-3
    assert both.field_residual_norms["pressure"][-1] <= 1e-6 < both.field_residual_norms["pressure"][-2]
    sequence = fixed_point(contraction(slopes), atol=[1e-3, 1e-6], **options)
    assert sequence.iterations == both.iterations


def test_a_field_with_zero_first_residual_is_measured_by_its_first_real_one():
    def G(x):  # b starts at rest and only a drives it
        return np.array([0.5 * x[0] + 1.0, 0.5 * (x[0] + x[1])])

    result = fixed_point(G, np.zeros(2), EXPLICIT, residual_rtol=1e-6, fields={"a": slice(0, 1), "b": slice(1, 2)})
    assert result.status == "converged"
    assert result.field_residual_norms["b"][0] == 0.0


def flawed(calls_that_fail, bad=np.nan, slope=0.9):
    """A contraction that answers `bad` at the calls with these numbers, from 1 on; `None` for all from 3 on."""
    calls = []

    def G(x):
        calls.append(1)
        fails = len(calls) >= 3 if calls_that_fail is None else len(calls) in calls_that_fail
        return np.full_like(x, bad) if fails else slope * x + np.arange(3)

    return G


SCHEMES = {"explicit": lambda: EXPLICIT, "aitken": Aitken, "iqn-ils": IQNILS, "iqn-imvj": IQNIMVJ}


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_values_that_stay_not_finite_end_in_a_status(scheme, bad):
    result = fixed_point(flawed(None, bad), np.zeros(3), SCHEMES[scheme](), residual_rtol=1e-20)
    assert (result.status, result.iterations) == ("diverged", 6)  # the third, and three recoveries
    assert len(result.recoveries) == 3
    assert not np.isfinite(result.residual_norms[-1])
    once = fixed_point(flawed(None, bad), np.zeros(3), SCHEMES[scheme](), residual_rtol=1e-20, recoveries=0)
    assert (once.status, once.iterations) == ("diverged", 3)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("call", [1, 2, 3])
def test_one_evaluation_that_fails_is_overcome_and_reported(scheme, call):
    result = fixed_point(flawed([call], slope=-0.6), np.zeros(3), SCHEMES[scheme](), residual_rtol=1e-10)
    assert result.status == "converged"
    assert [r.iteration for r in result.recoveries] == ([call] if result.iterations > call else [])
    assert result.x == pytest.approx(np.arange(3) / 1.6, abs=1e-9)  # error = residual / 1.6, |r_1| = 2.2
    sound = fixed_point(flawed([], slope=-0.6), np.zeros(3), SCHEMES[scheme](), residual_rtol=1e-10)
    assert result.iterations <= sound.iterations + 3


def test_growth_makes_a_scheme_begin_anew_from_the_best_point():
    def G(x):  # contracts near the solution 0, grows fast beyond 1: a long first step runs away
        return np.where(np.abs(x) < 1.0, 0.5 * x, 1e6 * x**3)

    x0 = np.array([0.9, 0.5])
    result = fixed_point(G, x0, IQNILS(omega0=20.0), residual_rtol=1e-8)
    assert result.status == "converged"
    assert "grew" in result.recoveries[0].reason
    assert fixed_point(G, x0, ConstantRelaxation(20.0), residual_rtol=1e-8).status == "diverged"


def test_the_anchor_goes_back_to_the_state_of_the_best_point():
    seen = []

    class Anchor:
        def mark(self):
            seen.append("mark")

        def restore(self):
            seen.append("restore")

    fixed_point(flawed([2], slope=-0.6), np.zeros(3), EXPLICIT, residual_rtol=1e-2, anchor=Anchor())
    assert seen[:3] == ["mark", "restore", "mark"]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_loop_that_is_taken_up_again_goes_on_bitwise(scheme):
    G = BadlyScaledFields().G
    options = {"rtol": 1e-8, "max_iterations": 40}
    x0 = BadlyScaledFields().x0
    made, copies = SCHEMES[scheme](), []
    whole = fixed_point(G, x0, made, hold=lambda p: copies.append(pickle.dumps((p, made))), **options)
    for at in (0, 1, 7, len(copies) - 1):
        progress, scheme_then = pickle.loads(copies[at])
        again = fixed_point(G, x0, scheme_then, progress=progress, **options)
        assert np.array_equal(again.x, whole.x)
        assert np.array_equal(again.residual_norms, whole.residual_norms)
        assert again.status == whole.status


def test_arithmetic_errors_and_overflow_in_G_end_in_a_status_and_other_errors_pass():
    assert fixed_point(lambda x: x + np.exp(1e3 + x), np.zeros(2), EXPLICIT, atol=1.0).status == "diverged"
    assert fixed_point(lambda x: x + 1.0 // int(x[0]), np.zeros(2), EXPLICIT, atol=0.1).status == "diverged"
    with pytest.raises(KeyError):
        fixed_point(lambda x: {}["solver"], np.zeros(2), EXPLICIT, atol=1.0)


def test_growing_residuals_diverge():
    result = fixed_point(contraction(-1.5), np.zeros(2), EXPLICIT, residual_rtol=1e-6)
    # never below the first residual, within the 30 evaluations of the window 1.5^30 above it
    assert (result.status, result.iterations) == ("diverged", 32)
    # 10^(k-1) > 1e6 first at k = 8
    assert fixed_point(contraction(-10.0), np.zeros(2), EXPLICIT, residual_rtol=1e-6).iterations == 8


@pytest.mark.parametrize("G", [lambda x: -x, lambda x: np.cos(1e9 * x), lambda x: x + 1.0])
def test_no_progress_is_a_stall(G):
    result = fixed_point(G, np.ones(2), EXPLICIT, residual_rtol=1e-6)
    assert result.status == "stalled"
    assert result.iterations < 60


TOLERANCES = [{"atol": 1e-9}, {"rtol": 1e-6}, {"residual_rtol": 1e-6}, {"atol": 1e-9, "rtol": 1e-6}]


@pytest.mark.parametrize("scheme", [Aitken, IQNILS, IQNIMVJ, lambda: ConstantRelaxation(0.5)])
@pytest.mark.parametrize("tolerances", TOLERANCES)
@pytest.mark.parametrize("drift", [1e-3, 1.0, 1e8])
def test_a_map_without_a_fixed_point_never_converges_however_far_its_unknown_is_driven(scheme, tolerances, drift):
    # x + c, alone and beside a field that converges: updates may drive x to 1e30, where x + c = x in double precision
    for start in (np.zeros(3), np.ones(1), np.full(2, -7.0)):
        found = fixed_point(lambda x: x + drift, start, scheme(), **tolerances)
        assert found.status in ("diverged", "stalled")
    fields = {"good": slice(0, 1), "drifting": slice(1, 2)}
    beside = fixed_point(lambda x: np.array([0.5, 1.0]) * x + drift, np.zeros(2), scheme(), fields=fields, **tolerances)
    assert beside.status in ("diverged", "stalled", "max_iterations")


@pytest.mark.parametrize("scheme", [Aitken, IQNILS, IQNIMVJ])
@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
def test_a_fixed_point_far_beyond_the_data_is_found(scheme, gap):
    found = fixed_point(lambda x: (1.0 - gap) * x + 1.0, np.zeros(1), scheme(), rtol=1e-12)
    assert found.status == "converged"
    # the residual is rounding of x, 1 / gap; so its error is eps / gap of x, and a few times that
    assert found.x[0] == pytest.approx(1.0 / gap, rel=1e-12 / gap + 8.0 * np.finfo(float).eps / gap)


def test_complex_values_are_refused_and_not_cut():
    with pytest.raises(ValueError, match="must return real numbers, but returned complex ones at evaluation 1"):
        fixed_point(lambda x: 0.5 * x + 1j, np.zeros(2), IQNILS(), rtol=1e-6)


def test_a_floor_of_solver_noise_is_a_stall():
    rng = np.random.default_rng(1)
    result = fixed_point(lambda x: 0.5 * x + 1e-6 * rng.standard_normal(5), np.ones(5), IQNILS(), residual_rtol=1e-12)
    assert result.status == "stalled"


@pytest.mark.parametrize("slope", [0.94, -0.94, 0.99])
def test_slow_but_sure_contraction_is_no_stall(slope):
    result = fixed_point(contraction(slope), np.zeros(1), EXPLICIT, residual_rtol=1e-6, max_iterations=3000)
    assert result.status == "converged"


def test_a_transient_that_grows_twentyfold_before_it_decays_is_neither_stall_nor_divergence():
    A = np.array([[0.9, 10.0, 0.0], [0.0, 0.9, 10.0], [0.0, 0.0, 0.9]])
    result = fixed_point(lambda x: A @ x, np.array([0.0, 0.0, 1.0]), EXPLICIT, residual_rtol=1e-6, max_iterations=500)
    assert result.residual_norms.max() > 20.0 * result.residual_norms[0]
    assert result.status == "converged"


@pytest.mark.parametrize("scheme", [EXPLICIT, Aitken(), IQNILS()])
def test_the_shape_of_x_is_kept_and_G_may_reuse_or_overwrite_its_arrays(scheme):
    buffer = np.zeros((4, 3))

    def G(x):
        assert x.shape == (4, 3)
        buffer[:] = 0.5 * x + 1.0
        x[:] = np.nan
        return buffer

    result = fixed_point(G, np.zeros((4, 3)), scheme, residual_rtol=1e-10)
    assert result.status == "converged"
    assert result.x == pytest.approx(np.full((4, 3), 2.0), abs=4e-10)  # error = residual / (1 - 1/2), |r_1| = 3.5


def test_the_callback_sees_every_evaluation():
    seen = []
    result = fixed_point(
        contraction(0.5),
        np.zeros(2),
        EXPLICIT,
        atol=1e-3,
        callback=lambda k, x, x_tilde, r: seen.append((k, x, x_tilde, r)),
    )
    assert [k for k, *_ in seen] == list(range(1, result.iterations + 1))
    assert all(np.array_equal(x_tilde - x, r) for _, x, x_tilde, r in seen)


@pytest.mark.parametrize(
    "change",
    [
        {"atol": 0.0},
        {"atol": -1.0},
        {"rtol": np.nan},
        {"max_iterations": 0},
        {"x0": np.array([0.0, np.nan])},
        {"fields": {"a": slice(0, 1)}},
        {"fields": {"a": slice(0, 2), "b": slice(1, 2)}},
        {"fields": {"a": slice(0, 2), "b": slice(2, 3)}},
        {"fields": {"a": slice(0, 1), "b": [5]}},
        {"fields": {"a": slice(0, 1), "b": slice(1, 2)}, "atol": {"a": 1.0}},
        {"fields": {"a": slice(0, 1), "b": slice(1, 2)}, "atol": [1.0, 0.0]},
        {"atol": [1.0, 1.0]},
        {"G": lambda x: x[:1]},
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(change):
    arguments = {"G": contraction(0.5), "x0": np.zeros(2), "scheme": EXPLICIT, "atol": 1.0} | change
    with pytest.raises(ValueError, match=r"\.$"):
        fixed_point(**arguments)


def test_a_lucky_dip_of_the_residual_early_in_a_convergent_run_is_no_stall():
    A = np.array([[0.8, 100.0], [0.0, 0.8]])  # the residual passes near zero once and comes back a hundredfold
    result = fixed_point(lambda x: A @ x, np.array([0.0, 1.0]), EXPLICIT, residual_rtol=1e-6)
    dip = int(np.argmin(result.residual_norms[:10]))
    assert result.residual_norms[dip + 1] > 50.0 * result.residual_norms[dip]
    assert result.status == "converged"
