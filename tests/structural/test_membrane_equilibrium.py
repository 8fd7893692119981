"""Equilibria with membranes: what steps the solver with does not show in the answer, and other elements beside them."""

import numpy as np
import pytest

from benchmarks.membrane_models import airbag, hencky, inflated, isotropic, quadratic, rectangle
from structural import (
    Assembly,
    Beams,
    Chains,
    Configuration,
    FaceLoad,
    Faces,
    LinearSection,
    Loads,
    LoadSensitivity,
    Structure,
    equilibrium,
    reference_axes,
)
from structural.elements.membrane_results import membrane_state
from structural.elements.membranes import flat_patterns, prestressed_patterns
from structural.materials.membranes import isotropic_membrane
from structural.solve import energy, linear
from structural.solve.newton import EPS, rounding_force, rounding_of_positions
from tests.structural.models import chains

TAUT_SHEET = 200.0  # N/m of the sheets below at rest


@pytest.mark.parametrize(("smoothing", "shift"), [(0.0, 1e-3), (0.0, 1.0), (1e4, 1e-3)])
def test_shift_and_smoothing_of_steps_leave_no_trace_in_the_answer(monkeypatch, smoothing, shift):
    def answers():
        nodes, fixed, group = airbag(4)
        return hencky(6, 0.0046, 0.3)[0], inflated(nodes, fixed, group, 5000.0)[0]

    before = answers()
    monkeypatch.setattr(energy, "SMOOTHING", smoothing)
    monkeypatch.setattr(energy, "FIRST_SHIFT", shift)
    for a, b in zip(before, answers(), strict=True):
        assert b.converged
        assert a.residuals != b.residuals  # another way to
        assert np.abs(a.x - b.x).max() <= 1e-9  # the same place: 1e-9 of the load over the least stiffness, p times 1 m


def test_the_residual_of_a_flat_start_converges_quadratically_with_its_own_tangent():
    nodes, fixed, group = airbag(6)
    found, assembly, loads = inflated(nodes, fixed, group, 5000.0, rtol=1e-6)
    prepared, q = assembly.prepare(loads), assembly.unknowns.restrict(found.x)
    norms = []
    for _ in range(3):  # plain Newton, no engine
        r, k, external = assembly.residual_and_tangent(q, prepared)
        norms.append(np.linalg.norm(r) / external)
        q = q + np.linalg.solve(k.toarray(), -r)
    assert norms[0] <= 1e-6
    assert norms[2] <= 1e-11  # rounding; what is left of 1e-6 squared is less


def test_rounding_of_positions_makes_the_forces_that_the_family_says():
    rng = np.random.default_rng(0)
    for m, offset in ((3, 0.0), (6, 0.0), (3, 10.0), (6, 10.0)):
        nodes, triangles = rectangle((10, 10), (1.0, 2.0), crossed=True)
        if m == 6:
            nodes, triangles, _ = quadratic(nodes, triangles)
        group = isotropic(nodes, triangles, 1.0, 0.3)
        x = 1.003 * nodes + offset + np.array([0.0, 0.0, 0.1])

        def total(x, group=group):
            f = np.zeros_like(x)
            np.add.at(f, group.nodes, group.forces(Configuration(x)))
            return f

        off = [np.linalg.norm(total(x + np.spacing(x) * rng.integers(-1, 2, x.shape)) - total(x)) for _ in range(5)]
        made = 0.354 * np.mean(off)  # of errors up to half a unit in the last place
        floor = rounding_force((group,), Configuration(nodes), float(np.abs(x).max()))
        assert 0.2 * floor <= made <= floor


@pytest.mark.parametrize("cells", [17, 18, 21])
def test_the_last_digits_of_a_mesh_do_not_decide_where_the_rim_folds(cells):
    # with tangents at rest that rounding decides, these come to equilibria that are up to 12 mm apart
    nodes, fixed, group = airbag(cells)
    first, *_ = inflated(nodes, fixed, group, 5000.0)
    over = np.argsort(np.lexsort(nodes.T)), np.lexsort(nodes[:, [1, 0, 2]].T)  # image in the diagonal
    assert np.abs(first.x[over[1]][over[0]][:, [1, 0, 2]] - first.x).max() <= 1e-9
    rng = np.random.default_rng(cells)
    for _ in range(2):
        start = nodes * (1.0 + EPS * rng.integers(-1, 2, nodes.shape))
        again, *_ = inflated(nodes, fixed, group, 5000.0, start=start)
        assert again.iterations == first.iterations
        assert np.abs(again.x - first.x).max() <= 1e-7  # 1e-9 of the load over the least stiffness of the rim, 1 N/m


def test_a_solve_that_ends_at_a_saddle_of_the_fabric_goes_down_from_it(monkeypatch):
    nodes, fixed, group = airbag(36)

    def potential(found):
        corners = found.x[group.nodes]
        volume = np.einsum("ec,ec->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
        return group.energy(Configuration(found.x)) - 5000.0 * volume

    stable, assembly, loads = inflated(nodes, fixed, group, 5000.0)
    monkeypatch.setattr(energy, "SADDLES", 0)
    saddle = equilibrium(assembly, loads, nodes, atol=0.0, rtol=1e-9)
    assert (saddle.converged, saddle.unstable_modes) == (True, 2)  # one on either side of the diagonal
    assert (stable.converged, stable.unstable_modes) == (True, 0)
    assert potential(stable) < potential(saddle) - 1e-3  # 2.1 mJ of 76 J
    assert stable.x[0, 2] == pytest.approx(0.2152, abs=0.3e-3)


def test_fabric_that_is_blown_the_other_way_comes_back_or_says_not():
    # a small pressure turns a stiff bag inside out, a long way: it is softened for that
    nodes, fixed, group = airbag(4)
    back, *_ = inflated(nodes, fixed, group, -3000.0)
    found, assembly, loads = inflated(nodes, fixed, group, 1e-3, start=back.x)
    residual, external = assembly.residual(assembly.unknowns.restrict(found.x), assembly.prepare(loads))
    assert found.converged
    assert found.iterations < 500
    rounding = [f((group,), Configuration(nodes), float(nodes.max())) for f in (rounding_force, rounding_of_positions)]
    assert assembly.unknowns.norm(residual) <= 1e-9 * external + max(rounding)


def taut_sheet():
    """A square sheet of 1 m that a frame holds under TAUT_SHEET: nodes, held nodes, membranes."""
    nodes, triangles = rectangle((4, 4), (1.0, 1.0), crossed=True)
    law = isotropic_membrane(np.full(len(triangles), 1e5), np.full(len(triangles), 0.3))
    stress = np.array([TAUT_SHEET, TAUT_SHEET, 0.0])
    pattern = prestressed_patterns(flat_patterns(nodes, triangles), law, stress)
    held = np.any(np.isclose(nodes[:, :2] % 1.0, 0.0), axis=1)
    return nodes, held, isotropic(nodes, triangles, 1e5, 0.3, pattern=pattern)


def test_a_strut_that_buckles_beside_a_membrane_is_an_instability():
    nodes, held, group = taut_sheet()
    strut = np.array([[3.0, 0.0, 0.0], [3.9, 0.0, 0.0], [4.8, 0.0, 0.0]])  # pressed to 0.9 of its length
    n = len(nodes)
    springs = chains([[n, n + 1], [n + 1, n + 2]], 1.0, 1e3, True)
    fixed = np.repeat(np.concatenate([held, [True, False, True]])[:, None], 3, axis=1)
    s = Structure(np.concatenate([nodes, strut]), fixed, (group, springs))
    assert equilibrium(Assembly(s), Loads(np.zeros_like(s.nodes)), s.nodes).unstable_modes == 2


def test_a_wrinkled_sheet_is_none():
    nodes, held, group = taut_sheet()
    x = nodes.copy()
    x[held] = nodes[held] * np.array([1.003, 0.97, 1.0])
    s = Structure(x, np.repeat(held[:, None], 3, axis=1), (group,))
    found = equilibrium(Assembly(s), Loads(np.zeros_like(x)), x, atol=1e-7)
    assert found.converged
    assert membrane_state(group, found.x).wrinkled_share == 1.0
    assert found.unstable_modes == 0


def test_cables_along_the_edges_and_a_mast_hold_a_sail():
    # sides of the sail are cables (C2), one corner stands on a cantilever (Timoshenko), which has no energy of its own
    n = 6
    nodes, triangles = rectangle((n, n), (1.0, 1.0), crossed=True)
    top = (n + 1) ** 2 - 1
    mast = np.array([[1.0, 1.0, -0.5]])
    nodes = np.concatenate([nodes, mast])
    foot = len(nodes) - 1
    corner = [0, n, n * (n + 1)]
    side = np.arange(n + 1)
    rows = [side, side * (n + 1), n * (n + 1) + side, side * (n + 1) + n]
    ends = np.concatenate([np.stack([r[:-1], r[1:]], axis=1) for r in rows])
    cables = Chains(ends, np.full(len(ends), 1.0 / n), np.full(len(ends), 5e4 * n), np.zeros(len(ends), bool))
    group = isotropic(nodes, triangles, 1e5, 0.3)
    beam = np.array([[foot, top]])
    axes = reference_axes(nodes, beam)
    section = LinearSection.of(1, 1e6, 100.0, 50.0)
    beams = Beams(beam, np.array([[0, 1]]), axes, np.array([0.5]), section)
    fixed = np.zeros(nodes.shape, bool)
    fixed[[*corner, foot]] = True
    s = Structure(
        nodes,
        fixed,
        (group, cables, beams),
        {"skin": Faces(triangles)},
        rotation_nodes=np.array([foot, top]),
        fixed_rotations=np.array([[True] * 3, [False] * 3]),
    )
    assembly = Assembly(s)
    loads = Loads(np.zeros_like(nodes), {"skin": FaceLoad(np.full(len(group), 50.0))})
    found = equilibrium(assembly, loads, nodes, atol=0.0, rtol=1e-9)
    assert found.converged
    r, external = assembly.residual(assembly.unknowns.restrict(found.x), assembly.prepare(loads), found.rotations)
    assert assembly.unknowns.norm(r) <= 1e-9 * external
    assert found.x[:-1, 2].max() > 0.02  # it bellies
    assert found.x[top, :2].max() < 1.0  # and pulls at its mast


@pytest.mark.parametrize("load", ["pressure", "pressures", "forces"])
def test_a_linear_answer_of_a_large_wrinkled_bag_is_that_of_two_solves(load):
    nodes, fixed, group = airbag(20)
    found, assembly, loads = inflated(nodes, fixed, group, 5000.0, rtol=1e-11)
    state = membrane_state(group, found.x)
    assert len(group) == 1600
    assert state.wrinkled_share > 0.6
    rng = np.random.default_rng(1)
    dead, pressure = np.zeros_like(nodes), np.zeros(len(group))
    if load == "forces":
        dead = 1e-4 * rng.standard_normal(nodes.shape)
    else:
        pressure = np.ones(len(group)) if load == "pressure" else rng.uniform(-1.0, 1.0, len(group))
    slope = LoadSensitivity(assembly, loads, found.x)(Loads(dead, {"skin": FaceLoad(pressure)}))
    step, moved = 0.1, []
    for h in (step, -step):
        changed = Loads(loads.dead + h * dead, {"skin": FaceLoad(loads.on["skin"].pressure + h * pressure)})
        moved.append(equilibrium(assembly, changed, found.x, atol=0.0, rtol=1e-11).x)
    numbers = (moved[0] - moved[1]) / (2.0 * step)
    # curvature, seen to fall with the square of the step: 1e-6 at 1, 1e-8 at 0.1
    np.testing.assert_allclose(slope, numbers, atol=1e-7 * np.abs(slope).max())


def test_a_linear_answer_to_a_change_of_pressure_is_that_of_two_solves():
    nodes, fixed, group = airbag(6)
    found, assembly, loads = inflated(nodes, fixed, group, 5000.0, rtol=1e-11)
    change = Loads(np.zeros_like(nodes), {"skin": FaceLoad(np.full(len(group), 1.0))})
    slope = LoadSensitivity(assembly, loads, found.x)(change)
    up, down = (inflated(nodes, fixed, group, 5000.0 + d, start=found.x, rtol=1e-11)[0].x for d in (1.0, -1.0))
    np.testing.assert_allclose(slope, 0.5 * (up - down), atol=2e-3 * np.abs(slope).max())  # curvature over 1 Pa


def test_the_order_of_elimination_is_found_once_for_all_newton_iterations(monkeypatch):
    orders = []
    plain = linear.spla.splu

    def watched(matrix, permc_spec, **how):
        orders.append((permc_spec, matrix.indices, matrix.indptr))
        return plain(matrix, permc_spec=permc_spec, **how)

    monkeypatch.setattr(linear.spla, "splu", watched)
    nodes, fixed, group = airbag(4)
    found, _, _ = inflated(nodes, fixed, group, 5000.0)
    (first, *_), *factorisations = orders
    assert first == "MMD_AT_PLUS_A"
    assert len(factorisations) >= found.iterations
    # the pressure makes the values unsymmetric; the pattern is one, and it is factorised as it is numbered
    assert {name for name, _, _ in factorisations} == {"NATURAL"}
    assert all(i is factorisations[0][1] and p is factorisations[0][2] for _, i, p in factorisations)
