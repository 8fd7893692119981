"""Quasi-Newton schemes against what they stand for, written out densely; what they keep, and what units do to them."""

import copy
import pickle

import numpy as np
import pytest

from benchmarks.reference_problems import AddedMass, BadlyScaledFields, Linear
from master.coupling.acceleration import IQNILS, IQNIMVJ, Aitken, ConstantRelaxation, NewtonKrylov
from master.coupling.fixed_point import fixed_point

EVERY = {"explicit": ConstantRelaxation, "aitken": Aitken, "iqn-ils": IQNILS, "iqn-imvj": IQNIMVJ}
LEARNING = {"iqn-ils": IQNILS, "iqn-imvj": IQNIMVJ}


class Record:
    """Pairs (x, r) of a call, and the weights 1/s_f that residual-sum scaling gives after each."""

    def __init__(self, fields, n):
        self.fields, self.n, self.pairs, self.sums = fields, n, [], np.zeros(len(fields))

    def add(self, x, r):
        self.pairs.append((x.copy(), r.copy()))
        self.sums += [np.linalg.norm(r[f]) / np.linalg.norm(r) for f in self.fields]

    def differences(self):
        """V and W, newest last."""
        x, r = (np.array(a) for a in zip(*self.pairs, strict=True))
        return np.diff(r, axis=0).T, np.diff(x + r, axis=0).T

    def weights(self):
        D = np.empty(self.n)
        for f, s in zip(self.fields, self.sums / len(self.pairs), strict=True):
            D[f] = 1.0 / s
        return D


def smooth(n, seed=0, scale=None):
    """A nonlinear contraction-free map whose columns stay independent, in the units `scale` of each entry."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n)) / np.sqrt(n)
    b = rng.standard_normal(n)
    scale = np.ones(n) if scale is None else scale
    return lambda x: scale * (np.tanh(A @ (x / scale)) - 0.5 * (x / scale) + b)


@pytest.mark.parametrize(
    "fields",
    [
        [slice(None)],
        [slice(0, 7), slice(7, 30)],
        [np.arange(0, 30, 3), np.setdiff1d(np.arange(30), np.arange(0, 30, 3))[::-1].copy()],
    ],
    ids=["one", "slices", "index arrays"],
)
def test_iqn_ils_is_the_weighted_least_squares_over_all_columns(fields):
    n = 30
    scale = np.ones(n)
    scale[fields[0]] = 1.0 if len(fields) == 1 else 1e-4
    G = smooth(n, scale=scale)
    scheme = IQNILS(filter=0.0, curved=0.0, stale=0.0)
    scheme.begin(fields)
    record = Record(fields, n)
    x = np.zeros(n)
    for k in range(12):
        r = G(x) - x
        record.add(x, r)
        x_next = scheme.step(x, r)
        if k:
            V, W = record.differences()
            D = record.weights()
            c = np.linalg.lstsq(D[:, None] * V, -D * r, rcond=None)[0]
            # rounding 1e-16 times the condition of D V, at most 1e4 here, and its square for the residual of the fit
            assert np.abs((x_next - (x + r + W @ c)) / scale).max() < 1e-9
        x = x_next


def test_columns_of_earlier_calls_take_part_with_the_weights_of_the_present_one():
    n, fields = 24, [slice(0, 4), slice(4, 24)]
    scale = np.where(np.arange(n) < 4, 1e3, 1.0)
    G = smooth(n, 1, scale)
    scheme = IQNILS(filter=0.0, curved=0.0, stale=0.0)
    records, x = [], np.zeros(n)
    for _ in range(3):
        scheme.begin(fields)
        record = Record(fields, n)
        records.append(record)
        for _ in range(5):
            r = G(x) - x
            record.add(x, r)
            x_next = scheme.step(x, r)
            if scheme.columns:
                known = [q.differences() for q in records if len(q.pairs) > 1]
                V, W = (np.hstack(parts) for parts in zip(*known, strict=True))
                floor = records[-2].sums / len(records[-2].pairs) if len(records) > 1 else 0.0
                D = np.empty(n)
                for f, s in zip(fields, np.maximum(record.sums / len(record.pairs), floor), strict=True):
                    D[f] = 1.0 / s
                c = np.linalg.lstsq(D[:, None] * V, -D * r, rcond=None)[0]
                assert np.abs((x_next - (x + r + W @ c)) / scale).max() < 1e-8  # as above, with more columns
            x = x_next
        r = G(x) - x
        record.add(x, r)
        scheme.end("converged", x, r)
        record.sums -= [np.linalg.norm(r[f]) / np.linalg.norm(r) for f in fields]  # the last pair went through no step
        record.sums *= len(record.pairs) / (len(record.pairs) - 1)


def test_other_fields_sort_the_columns_anew_and_lose_none():
    n = 20
    G = smooth(n, 2)
    kept, fresh = IQNILS(filter=0.0), IQNILS(filter=0.0)
    parts = [np.arange(0, n, 2), np.arange(1, n, 2)]
    for scheme, first in ((kept, [slice(0, 5), slice(5, n)]), (fresh, parts)):
        x = np.zeros(n)
        scheme.begin(first)
        for _ in range(6):
            scheme._learn(x, G(x) - x)  # the same pairs, whatever the weights make of them
            x = x + 0.3 * (G(x) - x)
        scheme._last = None
    kept.begin(parts)
    fresh.begin(parts)
    fresh._floor = np.zeros(2)
    assert kept.columns == fresh.columns == 5
    r = G(x) - x
    assert np.abs(kept.step(x, r) - fresh.step(x, r)).max() < 1e-11  # rounding times the condition of five columns


@pytest.mark.parametrize("name", LEARNING)
def test_a_call_with_other_fields_in_between_still_solves(name):
    problem = BadlyScaledFields()
    scheme = LEARNING[name]()
    whole = {"all": np.arange(100)}
    for fields in (problem.fields, whole, problem.fields, None, problem.fields):
        result = fixed_point(problem.G, problem.x0, scheme, rtol=1e-8, fields=fields)
        assert result.status == "converged", result.message


def test_the_newest_columns_are_kept_and_the_oldest_go():
    n, most = 15, 6
    rng = np.random.default_rng(3)
    scheme = IQNILS(max_columns=most, reuse=2)
    expected = []
    for length in (3, 4, 1, 5, 9, 2):
        scheme.begin([slice(0, 4), slice(4, n)])
        x, r = rng.standard_normal((2, n))
        scheme._learn(x, r)
        block = []
        for _ in range(length):
            dx, dr = rng.standard_normal((2, n))
            x, r = x + dx, r + dr
            scheme._learn(x, r)
            block.append(dr)
        expected = [*expected[-2:], block]
        newest = [v for b in expected for v in b][-most:]
        V = np.empty((scheme.columns, n))
        V[:, :4], V[:, 4:] = (part.matrix() for part in scheme._V)
        assert scheme.columns == len(newest)
        assert np.abs(V - newest).max() < 1e-12  # rounding of the decompositions
        kept, at = [], len(newest)
        for b in reversed(expected):
            kept.append([*newest[max(0, at - len(b)) : at]])
            at = max(0, at - len(b))
        expected = kept[::-1]


@pytest.mark.parametrize("linear", [True, False])
def test_iqn_imvj_is_the_update_of_the_full_inverse_jacobian(linear):
    n = 8
    G = Linear(n).G if linear else smooth(n, 4)
    scheme = IQNIMVJ(filter=0.0, curved=0.0)
    J_old = np.zeros((n, n))
    for start in (0.0, 0.4, -0.3):
        x = np.full(n, start)
        scheme.begin([slice(None)])
        record = Record([slice(None)], n)
        for k in range(3 if linear else 5):  # the linear one is solved in 8 columns, what follows is rounding
            r = G(x) - x
            record.add(x, r)
            known = bool(scheme.columns) or k > 0
            x_next = scheme.step(x, r)
            if known:
                J = J_old
                if k:
                    V, W = record.differences()
                    J = J_old + (W - J_old @ V) @ np.linalg.pinv(V)
                    # rounding times the condition of V, 1e4 for the linear problem
                    assert np.abs(J @ V - W).max() < 1e-9  # secant conditions of the reference itself
                assert np.abs(x_next - (x + r - J @ r)).max() < 1e-9
            x = x_next
        r = G(x) - x
        record.add(x, r)
        scheme.end("max_iterations", x, r)
        V, W = record.differences()
        J_old = J_old + (W - J_old @ V) @ np.linalg.pinv(V)


@pytest.mark.parametrize("name", LEARNING)
def test_the_secant_conditions_hold_for_the_last_call(name):
    n, fields = 40, [slice(0, 15), slice(15, 40)]
    G = smooth(n, 5)
    scheme = LEARNING[name](filter=0.0, curved=0.0)
    scheme.begin(fields)
    record = Record(fields, n)
    x = np.zeros(n)
    for _ in range(7):
        r = G(x) - x
        record.add(x, r)
        x = scheme.step(x, r)
    V, W = record.differences()
    for v, w in zip(V.T, W.T, strict=True):
        # J v = w, where the update applies -J; rounding times a condition of about 1e3
        assert np.abs(scheme._quasi_newton(v)[0] + w).max() < 1e-11 * max(1.0, np.abs(w).max())


@pytest.mark.parametrize("name", LEARNING)
def test_no_more_than_max_columns_are_ever_kept(name):
    n, most = 60, 12
    scheme = LEARNING[name](max_columns=most)
    G = smooth(n, 6)
    for start in range(8):
        x = np.full(n, 0.1 * start)
        scheme.begin([slice(0, 20), slice(20, n)])
        for _ in range(9):
            r = G(x) - x
            x = scheme.step(x, r)
            assert scheme.columns <= most
        scheme.end("max_iterations", x, G(x) - x)
        assert scheme.columns <= most


@pytest.mark.parametrize("name", LEARNING)
def test_a_scheme_with_columns_of_another_size_is_refused_in_one_sentence_with_any_fields(name):
    scheme = LEARNING[name]()
    fixed_point(Linear(20).G, np.zeros(20), scheme, residual_rtol=1e-6)
    for n in (10, 30):
        for fields in (None, {"a": slice(0, 5), "b": slice(5, n)}, {"a": np.arange(5), "b": np.arange(5, n)}):
            with pytest.raises(ValueError, match=r"pass a fresh IQN\w+\.$"):
                fixed_point(Linear(n).G, np.zeros(n), copy.deepcopy(scheme), residual_rtol=1e-6, fields=fields)


@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1e160, 1e290])
@pytest.mark.parametrize("name", ["aitken", "iqn-ils", "iqn-imvj"])
def test_numbers_near_the_ends_of_double_precision_take_the_same_way(name, scale):
    problem = Linear(12)
    plain = fixed_point(problem.G, problem.x0, EVERY[name](), residual_rtol=1e-6)
    scaled = fixed_point(lambda x: scale * problem.G(x / scale), problem.x0, EVERY[name](), residual_rtol=1e-6)
    assert (scaled.status, scaled.iterations) == (plain.status, plain.iterations)


@pytest.mark.parametrize("factors", [(1e-12, 1.0), (1.0, 1e-12), (1e12, 1.0), (1e12, 1e-12), (1e-12, 1e12)])
@pytest.mark.parametrize("name", ["iqn-ils", "iqn-imvj", "newton-krylov"])
def test_units_of_a_field_change_neither_counts_nor_iterates(name, factors):
    problem = BadlyScaledFields(n=20, s_u=1.0, s_p=1.0)
    n = 20
    scale = np.repeat(factors, n)
    runs = []
    for s in (np.ones(2 * n), scale):
        seen = []

        def G(x, s=s, seen=seen):
            seen.append(x / s)
            return s * problem.G(x / s)

        def product(v, s=s, seen=seen):
            u, p = seen[-1][:n], seen[-1][n:]
            du, dp = v[:n] / s[:n], v[n:] / s[n:]
            M = problem.M
            return s * np.concatenate((M @ (dp / np.cosh(0.05 * p) ** 2), -M @ du)) + 0.0 * np.sum(u)

        scheme = NewtonKrylov(product) if name == "newton-krylov" else LEARNING[name]()
        # atol 0: a tolerance with a unit would change with it
        runs.append((fixed_point(G, problem.x0, scheme, rtol=1e-7, fields=problem.fields), seen))
    (plain, own), (scaled, seen) = runs
    assert plain.status == scaled.status == "converged"
    if name == "newton-krylov" or factors[0] == factors[1]:
        assert scaled.iterations == plain.iterations
        tolerance = 1e-7
        for a, b in zip(own, seen, strict=True):
            assert np.abs(a - b).max() < tolerance * max(1.0, np.abs(a).max())
    else:  # weights are mean shares of the whole residual, whose ratio depends on the units by less than a factor of 2
        assert abs(scaled.iterations - plain.iterations) <= 2


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1e6, 1e12])
@pytest.mark.parametrize("name", EVERY)
def test_units_of_one_field_leave_the_iterates_as_they_are(name, scale):
    problem = Linear(30, first=-0.8)
    seen = {1.0: [], scale: []}
    counts = []
    for s in seen:

        def G(x, s=s):
            seen[s].append(x / s)
            return s * problem.G(x / s)

        counts.append(fixed_point(G, problem.x0, EVERY[name](), residual_rtol=1e-6).iterations)
    assert counts[0] == counts[1]
    for a, b in zip(*seen.values(), strict=True):
        # rounding of the products with s, grown by the condition of the columns (1e-8, the filter, at worst)
        assert np.abs(a - b).max() < 1e-7 * np.abs(a).max() + 1e-12


@pytest.mark.parametrize("name", EVERY)
def test_a_scheme_begun_anew_before_it_was_used_works(name):
    scheme = EVERY[name]()
    scheme.restart()
    problem = Linear(10, first=-0.8)
    assert fixed_point(problem.G, problem.x0, scheme, residual_rtol=1e-8).status == "converged"


@pytest.mark.parametrize("name", EVERY)
def test_a_pickled_scheme_goes_on_bitwise(name):
    problem = AddedMass(20.0)
    scheme = EVERY[name]()
    for _ in range(3):
        result = fixed_point(problem.G, problem.x0, scheme, residual_rtol=1e-8)
        problem.advance(result.x)
    twin = pickle.loads(pickle.dumps(scheme))
    one, two = (fixed_point(problem.G, problem.x0, s, residual_rtol=1e-8) for s in (scheme, twin))
    assert np.array_equal(one.residual_norms, two.residual_norms)


@pytest.mark.parametrize("name", EVERY)
def test_one_unknown_is_enough(name):
    result = fixed_point(lambda x: np.cos(x), np.zeros(1), EVERY[name](), residual_rtol=1e-10)
    assert result.status == "converged"
    # Dottie's number; the error is the residual over 1 + sin x
    assert result.x[0] == pytest.approx(0.7390851332151607, abs=1e-10)


@pytest.mark.parametrize("name", EVERY)
def test_a_map_that_answers_with_a_view_of_what_it_was_given_is_its_own_fixed_point(name):
    result = fixed_point(lambda x: x[::-1][::-1], np.arange(1.0, 4.0), EVERY[name](), residual_rtol=1e-10)
    assert (result.status, result.iterations) == ("converged", 1)
    swapped = fixed_point(lambda x: -0.5 * x[::-1], np.arange(1.0, 4.0), EVERY[name](), atol=1e-10)
    assert swapped.status == "converged"
    assert np.abs(swapped.x).max() < 1e-9  # residual over 1 - |lambda| = 1/2


@pytest.mark.parametrize("name", LEARNING)
def test_nothing_is_learnt_from_the_first_updates_where_there_are_several(name):
    """x <- x_tilde is what two updates with the factor 1 do, and the third follows the one secant from there on."""

    def G(x):  # curved, with the fixed point 1
        return x - 0.5 * (x**3 - 1.0)

    scheme, x = LEARNING[name](omega0=1.0, relaxed=2), np.array([0.4])
    scheme.begin([slice(None)])
    points = [x]
    for _ in range(3):
        points.append(scheme.step(points[-1], G(points[-1]) - points[-1]))
    np.testing.assert_array_equal(points[1], G(points[0]))
    np.testing.assert_array_equal(points[2], G(points[1]))
    (r1, r2), (x1, x2) = (G(p) - p for p in points[1:3]), points[1:3]
    np.testing.assert_allclose(points[3], x2 - r2 * (x2 - x1) / (r2 - r1), rtol=1e-12)
    assert scheme.columns == 1


@pytest.mark.parametrize("name", LEARNING)
def test_after_a_restart_the_first_step_is_a_careful_relaxation(name):
    scheme = LEARNING[name](omega0=0.4)
    problem = Linear(10)
    fixed_point(problem.G, problem.x0, scheme, residual_rtol=1e-6)
    assert scheme.columns
    x, r = np.zeros(10), np.ones(10)
    for within in (True, False):  # within a call, or between two as for a communication step that is restarted
        if within:
            scheme.begin([slice(None)])
        assert scheme.restart()
        if not within:
            scheme.begin([slice(None)])
        assert scheme.columns == 0
        assert np.allclose(scheme.step(x, r), 0.25 * 0.4 * r, rtol=1e-15, atol=0.0)
        scheme.end("max_iterations", x, r)
    scheme.begin([slice(None)])
    assert np.allclose(scheme.step(x, r), 0.4 * r, rtol=1e-15, atol=0.0)
