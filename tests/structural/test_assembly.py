"""Residual and tangent of whole structures, with and without mirror symmetry."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import scenes
from structural import (
    Assembly,
    Loads,
    Structure,
    equilibrium,
    interface_groups,
    interface_loads,
    line_load_forces,
    mirror_permutation,
    surface_forces,
)
from structural.assembly import MANY, Scatter, pattern
from structural.elements.chains import chain_forces
from tests.structural.models import (
    TANGENT_TOLERANCE,
    central_difference,
    chains,
    clear_of_kinks,
    dead,
    random_mirrored,
    residual_of,
    structure,
)


def _surface(s):
    """Weights of the nodes of the loaded surface."""
    return s.load_groups["panels"].weights


def _states(rng, assembly, groups, scale, count):
    """Random deformed unknowns whose elements all keep clear of the slack kink."""
    q0 = assembly.unknowns.restrict(assembly.structure.nodes)
    while count:
        q = q0 + rng.normal(scale=scale, size=len(q0))
        if clear_of_kinks(assembly.unknowns.expand(q), groups):
            count -= 1
            yield q


def _kite():
    """Structure of the V3 kite, its mirror permutation and loads of the size met in flight, mirror-symmetric."""
    scene = scenes.load("v3_kite")
    m, i = scene.members, scene.interface
    s = Structure(m.nodes, m.fixed, m.chains, interface_groups(i.weights, i.panels, i.lines))
    rng = np.random.default_rng(1)
    half = len(i.panels) // 4 + 1  # 9 strips: the middle one is its own image
    p, t = rng.uniform(50, 300, (2, half)), rng.uniform(-20, 20, (2, half, 3))
    t[:, -1, 1] = 0.0
    pressure = np.concatenate([p, p[:, -2::-1]], axis=1).ravel()
    shear = np.concatenate([t, t[:, -2::-1] * [1, -1, 1]], axis=1).reshape(-1, 3)
    weight = m.mass[:, None] * np.array([0.0, 0.0, -9.81])
    line_load = np.tile([0.2, 0.0, -0.05], (len(i.lines), 1))  # N/m: lines of 2 mm in 12 m/s
    return s, mirror_permutation(m.nodes), Loads(weight, interface_loads(pressure, shear, line_load))


def _kite_at_trim():
    """The V3 kite turned to its trim angle under the air loads met there at 12 m/s: nine tenths as dead loads, so that
    a frozen load leaves the kite an equilibrium, one tenth as pressure that follows it."""
    s, mirror, loads = _kite()
    scene = scenes.load("v3_kite")
    c, w = (f(scene.trim_angle()) for f in (np.cos, np.sin))
    start = s.nodes @ np.array([[c, 0.0, -w], [0.0, 1.0, 0.0], [w, 0.0, c]])
    air = scene.aero_core()
    air.set("displacement", _surface(s) @ start - scene.interface.nodes)
    air.step(0.0, 0.0)
    pressure, shear = air.get("pressure"), air.get("shear")
    force = surface_forces((_surface(s) @ start)[s.load_groups["panels"].nodes], pressure, shear).reshape(-1, 3)
    on_nodes = _surface(s)[s.load_groups["panels"].nodes.ravel()].T @ force
    return s, mirror, start, Loads(loads.dead + 0.9 * on_nodes, interface_loads(0.1 * pressure, 0.1 * shear))


@pytest.mark.parametrize("symmetric", [False, True], ids=["full", "half"])
def test_tangent_of_random_structures_is_the_gradient_of_the_residual(symmetric):
    rng = np.random.default_rng(20 + symmetric)
    slack = taut = 0
    for _ in range(25):
        s, loads, mirror = random_mirrored(rng)
        assembly = Assembly(s, mirror if symmetric else None)
        r, prepared = residual_of(assembly, s.groups, loads)
        for q in _states(rng, assembly, s.groups, 0.2, 4):
            x = assembly.unknowns.expand(q)
            pulls = np.concatenate([np.abs(chain_forces(x, c)).max(axis=(1, 2)) > 0 for c in s.groups])
            slack, taut = slack + np.count_nonzero(~pulls), taut + np.count_nonzero(pulls)
            residual, k, _ = assembly.residual_and_tangent(q, prepared)
            assert residual == pytest.approx(r(q), abs=1e-10)  # the same sums in another order, forces of 1e3 N
            slope = central_difference(r, q)
            # held to the largest entry, as panels that a random state has nearly folded have large third derivatives
            assert np.abs(slope - k.toarray()).max() <= TANGENT_TOLERANCE * np.abs(slope).max()
    assert min(slack, taut) > 300  # both kinds were met


@pytest.mark.parametrize("symmetric", [False, True], ids=["full", "half"])
def test_tangent_of_the_kite_is_the_gradient_of_the_residual(symmetric):
    s, mirror, loads = _kite()
    assembly = Assembly(s, mirror if symmetric else None)
    r, prepared = residual_of(assembly, s.groups, loads)
    rng = np.random.default_rng(symmetric)
    for n, q in enumerate(_states(rng, assembly, s.groups, 0.1, 100)):
        _, k, _ = assembly.residual_and_tangent(q, prepared)
        scale = np.abs(k.data).max()
        if n % 10 == 0:
            assert np.abs(central_difference(r, q) - k.toarray()).max() <= TANGENT_TOLERANCE * scale
        else:  # one random direction says as much about a wrong entry as all columns, at a hundredth of the time
            d = rng.normal(size=(1, len(q)))
            slope = central_difference(lambda t, d=d, q=q: r(q + t @ d), np.zeros(1)).ravel()
            assert np.abs(slope - k @ d[0]).max() <= TANGENT_TOLERANCE * scale


def test_half_model_is_the_full_model_restricted_to_mirror_symmetric_shapes():
    rng = np.random.default_rng(3)
    for case in range(20):
        s, loads, mirror = (*_kite()[::2], _kite()[1]) if case == 0 else random_mirrored(rng)
        full, half = Assembly(s), Assembly(s, mirror)
        identity = np.eye(half.unknowns.count)
        base = half.unknowns.expand(np.zeros(half.unknowns.count))
        columns = [full.unknowns.restrict(half.unknowns.expand(e) - base) for e in identity]
        t = np.array(columns).T
        q = next(_states(rng, half, s.groups, 0.1, 1))
        x = half.unknowns.expand(q)
        assert np.abs(x[mirror] * [1, -1, 1] - x).max() <= 1e-15  # it is a copy
        r_half, k_half, _ = half.residual_and_tangent(q, half.prepare(loads))
        r_full, k_full, _ = full.residual_and_tangent(full.unknowns.restrict(x), full.prepare(loads))
        assert r_half == pytest.approx(t.T @ r_full, abs=1e-12 * np.abs(r_full).max() * len(r_full))  # rounding of sums
        reference = t.T @ k_full.toarray() @ t
        assert np.abs(k_half.toarray() - reference).max() <= 1e-12 * np.abs(reference).max() * len(r_full) ** 0.5
        # and the full residual of a symmetric shape under symmetric loads has no antisymmetric part
        f = full.unknowns.expand(r_full) - full.unknowns.expand(np.zeros(len(r_full)))
        free = full.unknowns.index.reshape(-1, 3) >= 0
        f[~free] = 0.0
        assert np.abs(f[mirror] * [1, -1, 1] - f).max() <= 1e-12 * np.abs(r_full).max() * len(r_full)


def test_half_model_of_the_kite_has_the_solution_of_the_full_model():
    s, mirror, start, loads = _kite_at_trim()
    half = equilibrium(Assembly(s, mirror), loads, start, atol=1e-9)
    assert half.converged
    full = Assembly(s)
    r, _ = full.residual(full.unknowns.restrict(half.x), full.prepare(loads))
    # the unknowns of the half model collect the forces of both sides: its norm bounds sqrt(2) times the full one; the
    # rest is rounding of forces of 1e3 N in 37 nodes
    assert np.linalg.norm(r) <= 1e-9
    wobble = 1e-3 * np.sin(np.arange(s.nodes.size)).reshape(-1, 3)
    whole = equilibrium(full, loads, half.x + wobble, atol=1e-9)
    assert whole.converged
    # the kite swings on its bridle like a pendulum with some 100 N/m; nodes of slack lines hang on less than 1 N/m
    assert np.abs(whole.x - half.x).max() <= 1e-6


def test_half_model_of_a_taut_net_finds_the_solution_of_the_full_model():
    rng = np.random.default_rng(11)
    right = rng.uniform([-1, 0.2, -1], [1, 2, 1], (8, 3))
    nodes = np.concatenate([right, right * [1, -1, 1], [[-2.0, 0, 0], [2.0, 0, 0], [0, 0, 0.5]]])
    mirror = np.concatenate([np.arange(8, 16), np.arange(8), [16, 17, 18]])
    every = np.array([(i, j) for i in range(19) for j in range(i)])
    net = chains(every, 0.0, 100.0, True)  # zero rest length: convex, one solution
    fixed = np.zeros(19, bool)
    fixed[[0, 8, 16]] = True
    s = structure(nodes, fixed, [net])
    force = rng.normal(scale=50.0, size=(19, 3))
    loads = dead(force + force[mirror] * [1, -1, 1])
    solutions = [equilibrium(Assembly(s, m), loads, nodes, atol=1e-9) for m in (None, mirror)]
    assert all(e.converged for e in solutions)
    # every free node has stiffness of at least 100 N/m, so 1e-9 N is 1e-11 m
    assert np.abs(solutions[0].x - solutions[1].x).max() <= 1e-10


@pytest.mark.parametrize("symmetric", [False, True], ids=["full", "half"])
def test_surface_loads_reach_the_nodes_with_their_force_moment_and_virtual_work(symmetric):
    rng = np.random.default_rng(5)
    s, loads, mirror = random_mirrored(rng)
    slack = chains([[0, 1], mirror[[0, 1]]], 1e3, 1.0)
    panels, lines = (s.load_groups[name].nodes for name in ("panels", "lines"))
    s = replace(s, fixed=np.zeros_like(s.fixed), groups=(slack,))  # only the surface bears
    assembly = Assembly(s, mirror if symmetric else None)
    q = assembly.unknowns.restrict(s.nodes)
    r, _ = residual_of(assembly, s.groups, loads)
    dq = rng.normal(size=len(q))
    x = assembly.unknowns.expand(q)
    dx = assembly.unknowns.expand(q + dq) - x
    places, moved = (
        np.concatenate([(_surface(s) @ a)[panels.ravel()], (_surface(s) @ a)[lines.ravel()]]) for a in (x, dx)
    )
    on_panels = surface_forces((_surface(s) @ x)[panels], loads.on["panels"].pressure, loads.on["panels"].shear)
    on_lines = line_load_forces((_surface(s) @ x)[lines], loads.on["lines"].per_length)
    force = np.concatenate([on_panels.reshape(-1, 3), on_lines.reshape(-1, 3)])
    size = np.abs(force).sum() * 10.0  # arms and displacements of some metres
    assert -r(q) @ dq == pytest.approx(np.sum(force * moved), abs=1e-14 * size)  # rounding
    if not symmetric:
        on_nodes = -assembly.unknowns.expand(r(q))
        assert on_nodes.sum(axis=0) == pytest.approx(force.sum(axis=0), abs=1e-14 * size)
        moment = np.cross(places, force).sum(axis=0)
        assert np.cross(x, on_nodes).sum(axis=0) == pytest.approx(moment, abs=1e-14 * size)


@pytest.mark.parametrize("seed", range(5))
def test_energy_gradient_is_the_internal_force(seed):
    rng = np.random.default_rng(seed)
    s, loads, _ = random_mirrored(rng)
    assembly = Assembly(s)
    unloaded = Loads(loads.dead, interface_loads(0.0 * loads.on["panels"].pressure))
    r, _ = residual_of(assembly, s.groups, unloaded)
    q = next(_states(rng, assembly, s.groups, 0.2, 1))
    gradient = central_difference(lambda y: assembly.energy(assembly.configuration(y), s.groups), q)
    # energies of 1e3 to 1e4 J, rounded in every term of the sum: up to 2.5 eps E / h over 60 seeds, h = 1e-6 m
    energy = assembly.energy(assembly.configuration(q), s.groups)
    assert gradient[0] == pytest.approx(r(q), abs=3.0 * np.finfo(float).eps * energy / 1e-6)


@pytest.mark.parametrize("symmetric", [False, True], ids=["full", "half"])
def test_unknowns_are_numbered_so_that_factors_fill_in_little(symmetric):
    # A net of 15 x 15 nodes row by row: a band of 2 x 15 nodes fills in, about 45 x 45 x 15 x 15; elimination in an
    # order of minimum degree leaves about a third.
    g = 15
    y, x = (a.ravel() for a in np.meshgrid(np.linspace(-1.0, 1.0, g), np.linspace(0.0, 1.0, g), indexing="ij"))
    nodes = np.column_stack([x, y, 0.1 * np.cos(y)])
    place = np.arange(g * g).reshape(g, g)
    ends = [(place[:-1], place[1:]), (place[:, :-1], place[:, 1:]), (place[:-1, :-1], place[1:, 1:])]
    ends.append((place[:-1, 1:], place[1:, :-1]))
    links = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in ends])
    s = structure(nodes, x == 0.0, [chains(links, 0.0, 100.0, True)])
    assembly = Assembly(s, mirror_permutation(nodes) if symmetric else None)
    q = assembly.unknowns.restrict(nodes)
    _, k, _ = assembly.residual_and_tangent(q, assembly.prepare(dead(0.0 * nodes)))
    fill = spla.splu(k, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).L.nnz
    best = spla.splu(k, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).L.nnz
    rng = np.random.default_rng(0)
    shuffled = rng.permutation(len(q))
    worst = spla.splu(
        sp.csc_array(k[shuffled][:, shuffled]),
        permc_spec="NATURAL",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    ).L.nnz
    assert fill <= 1.2 * best  # SuperLU's own minimum degree, on dofs instead of nodes
    assert fill < 0.5 * worst


def test_structure_without_elements_is_assembled_and_solved():
    nodes = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    for fixed in ([True, True], [True, False]):
        s = structure(nodes, fixed, [])
        result = equilibrium(Assembly(s), dead(0.0 * nodes), nodes)
        assert result.converged
        assert np.array_equal(result.x, nodes)


def test_structure_without_free_nodes_is_in_equilibrium_at_once():
    nodes = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    s = structure(nodes, [True, True], [chains([0, 1], 0.5, 10.0)])
    result = equilibrium(Assembly(s), dead(np.ones((2, 3))), nodes)
    assert result.converged
    assert result.iterations == 0
    assert np.array_equal(result.x, nodes)


def test_coincident_nodes_are_mirrored_one_to_one():
    rng = np.random.default_rng(7)
    right = rng.uniform(0.1, 1, (5, 3))
    points = np.concatenate([right, right, right * [1, -1, 1], right * [1, -1, 1], np.zeros((2, 3))])
    order = rng.permutation(len(points))
    points = points[order]
    image = mirror_permutation(points)
    assert np.array_equal(np.sort(image), np.arange(len(points)))
    assert np.array_equal(image[image], np.arange(len(points)))
    assert np.array_equal(points[image], points * [1, -1, 1])
    assert mirror_permutation(points + np.array([0, 0.1, 0])) is None


def test_surface_that_is_not_mirror_symmetric_is_refused_for_the_half_model():
    s, _, mirror = random_mirrored(np.random.default_rng(8))
    panels = interface_groups(sp.csr_array(_surface(s)[:5]), s.load_groups["panels"].nodes[:1])
    asymmetric = Structure(s.nodes, s.fixed, s.groups, panels)
    with pytest.raises(ValueError, match="not mirror-symmetric"):
        Assembly(asymmetric, mirror)


@pytest.mark.parametrize("count", [MANY - 1, MANY, 3 * MANY])
def test_scattered_values_are_summed_in_the_order_of_the_elements_to_the_last_bit(count):
    rng = np.random.default_rng(count)
    size = count // 4
    target, sign = rng.integers(0, size + 1, count), rng.choice([-1.0, 1.0, 2.0], count)
    values = rng.normal(size=(count, 1)) * 10.0 ** rng.integers(-8, 8, (count, 1))
    sums = [0.0] * (size + 1)
    for place, s, v in zip(target, sign, values[:, 0], strict=True):
        sums[place] += s * v
    assert np.array_equal(Scatter(target, sign, size)(values), sums[:size])  # pads are left out


@pytest.mark.parametrize("n", [0, 1, 7, 300])
def test_a_pattern_has_every_entry_inside_once_with_rising_keys(n):
    rng = np.random.default_rng(n)
    rows, columns = rng.integers(-1, max(n, 0), (2, 5 * n))
    keys, where = pattern(rows, columns, n)
    inside = (rows >= 0) & (columns >= 0)
    assert np.all(np.diff(keys) > 0)
    assert np.array_equal(keys[where[inside]], columns[inside] * n + rows[inside])
    assert set(where[inside]) == set(range(len(keys)))
    assert np.all(where[~inside] == len(keys))
