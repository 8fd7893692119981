"""Follower pressure and dead-direction shear on panels."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from structural import (
    Assembly,
    FaceLoad,
    Faces,
    Loads,
    Structure,
    area_vectors,
    corner_shares,
    equilibrium,
    interface_groups,
    line_load_forces,
    line_load_forces_and_tangents,
    surface_forces,
    surface_forces_and_tangents,
)
from tests.structural.models import TANGENT_TOLERANCE, central_difference, chains, residual_of, structure

SQUARE = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 1.0, 0], [0, 1.0, 0]])


def _panel(rng, kind):
    """Corners (4,3) of a random panel; its area stays above 0.1 m2, so that loads are well scaled."""
    while True:
        if kind == "skewed":  # corner angles down to a few degrees
            x = SQUARE @ np.array([[1.0, 0, 0], [rng.uniform(3.0, 8.0), 0.5, 0], [0, 0, 1]])
            x = x + rng.normal(scale=0.02, size=(4, 3))
        else:
            x = SQUARE + rng.normal(scale=0.25, size=(4, 3))
        if kind == "triangle":
            x[3] = x[2]
        if np.linalg.norm(area_vectors(x[None])[0]) > 0.1:
            return Rotation.random(rng=rng).apply(x) + rng.uniform(-2, 2, 3)


def _box():
    """Corners (6,4,3) of a box of 1 x 2 x 3 m with outward normals, warped by a smooth map."""
    faces = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [1, 2, 6, 5], [3, 0, 4, 7]]
    unit = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
    return unit * [1.0, 2.0, 3.0], np.array(faces)


@pytest.mark.parametrize("shear", [False, True], ids=["pressure", "pressure+shear"])
@pytest.mark.parametrize("kind", ["warped", "triangle", "skewed"])
def test_load_stiffness_is_the_gradient_of_the_panel_forces(kind, shear):
    rng = np.random.default_rng(len(kind) + shear)
    for _ in range(100):
        x = _panel(rng, kind)
        p = rng.normal(scale=100.0, size=1)
        s = rng.normal(scale=50.0, size=(1, 3)) if shear else None
        force, tangent = surface_forces_and_tangents(x[None], p, s)
        slope = central_difference(lambda y, p=p, s=s: surface_forces(y[None], p, s), x)
        assert np.abs(slope - tangent[0]).max() <= TANGENT_TOLERANCE * np.abs(tangent).max()
        assert force == pytest.approx(surface_forces(x[None], p, s), rel=1e-12, abs=1e-12 * np.abs(force).max())


@pytest.mark.parametrize("kind", ["warped", "triangle", "skewed"])
def test_shares_of_a_panel_sum_to_one_and_its_force_is_pressure_times_area_vector(kind):
    rng = np.random.default_rng(7)
    x = np.array([_panel(rng, kind) for _ in range(200)])
    p, s = rng.normal(size=200), rng.normal(size=(200, 3))
    a = area_vectors(x)
    size = np.ptp(x, axis=1).max() ** 2
    rounding = 1e-13 * size / np.linalg.norm(a, axis=1).min()  # shares divide moments of that size by the area
    assert np.abs(corner_shares(x).sum(axis=1) - 1.0).max() <= rounding
    assert np.abs(surface_forces(x, p).sum(axis=1) - p[:, None] * a).max() <= rounding * size
    force = p[:, None] * a + s * np.linalg.norm(a, axis=1)[:, None]
    assert np.abs(surface_forces(x, p, s).sum(axis=1) - force).max() <= rounding * size


def test_shares_are_the_integrals_of_the_shape_functions_over_the_bilinear_panel():
    gauss, weight = np.polynomial.legendre.leggauss(4)  # exact to degree 7; the integrand has degree 3
    gauss, weight = 0.5 * (gauss + 1.0), 0.5 * weight
    rng = np.random.default_rng(2)
    for kind in ("warped", "triangle", "skewed"):
        x = _panel(rng, kind)
        integral = np.zeros((4, 3))
        for u, wu in zip(gauss, weight, strict=True):
            for v, wv in zip(gauss, weight, strict=True):
                shape = np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
                d_u = np.array([-(1 - v), 1 - v, v, -v]) @ x
                d_v = np.array([-(1 - u), -u, u, 1 - u]) @ x
                integral += wu * wv * np.outer(shape, np.cross(d_u, d_v))
        a = area_vectors(x[None])[0]
        assert integral.sum(axis=0) == pytest.approx(a, rel=1e-12, abs=1e-13)  # quadrature is exact: rounding
        assert corner_shares(x[None])[0] == pytest.approx(integral @ a / (a @ a), rel=1e-11, abs=1e-13)


def test_shares_of_a_parallelogram_are_quarters_and_of_a_triangle_thirds():
    parallelogram = SQUARE @ np.array([[2.0, 0.3, 0.1], [0.7, 1.5, -0.4], [0, 0, 1]])
    triangle = parallelogram[[0, 1, 2, 2]]
    assert corner_shares(parallelogram[None])[0] == pytest.approx([0.25] * 4, abs=1e-15)  # rounding
    share = corner_shares(triangle[None])[0]
    assert [share[0], share[1], share[2] + share[3]] == pytest.approx([1 / 3] * 3, abs=1e-15)


def test_pressure_on_a_closed_box_has_no_net_force_and_work_on_it_is_pressure_times_volume_change():
    nodes, faces = _box()
    rng = np.random.default_rng(4)
    warped = nodes + rng.normal(scale=0.2, size=nodes.shape)
    for x in (nodes, warped):
        f = surface_forces(x[faces], np.full(6, 1000.0))
        assert (
            np.abs(f.sum(axis=(0, 1))).max() <= 1e-11 * np.abs(f).sum()
        )  # area vectors of a closed surface cancel: rounding
    # growing the straight box as a whole by 1 + e does the work 3 p V e
    f = surface_forces(nodes[faces], np.full(6, 1000.0))
    assert np.sum(f * nodes[faces]) == pytest.approx(3.0 * 1000.0 * 6.0, rel=1e-13)
    moment = np.cross(nodes[faces], f).sum(axis=(0, 1))
    assert np.abs(moment).max() <= 1e-11 * np.abs(f).sum()


def test_pressure_turns_with_the_panel_and_shear_keeps_its_direction():
    rng = np.random.default_rng(5)
    x = np.array([_panel(rng, "warped") for _ in range(50)])
    p, s = rng.normal(size=50), rng.normal(size=(50, 3))
    none = np.zeros(50)
    for _ in range(5):
        turn = Rotation.random(rng=rng).as_matrix()
        y = x @ turn.T + rng.uniform(-5, 5, 3)
        rounding = 1e-12 * 10.0  # coordinates of up to 10 m
        assert np.abs(surface_forces(y, p) - surface_forces(x, p) @ turn.T).max() <= rounding
        assert np.abs(surface_forces(y, none, s) - surface_forces(x, none, s)).max() <= rounding


def test_reversing_a_panel_reverses_pressure_but_not_shear():
    rng = np.random.default_rng(6)
    x = np.array([_panel(rng, "warped") for _ in range(20)])
    back = [0, 3, 2, 1]
    p, s, none = rng.normal(size=20), rng.normal(size=(20, 3)), np.zeros(20)
    assert (
        np.abs(surface_forces(x[:, back], p) + surface_forces(x, p)[:, back]).max() <= 1e-13
    )  # rounding at forces of 1 N
    assert np.abs(surface_forces(x[:, back], none, s) - surface_forces(x, none, s)[:, back]).max() <= 1e-13


def test_load_stiffness_knows_translation_and_rotation():
    rng = np.random.default_rng(9)
    x = np.array([_panel(rng, "warped") for _ in range(50)])
    p = rng.normal(size=50)
    force, k = surface_forces_and_tangents(x, p)
    rounding = 1e-11 * np.abs(k).max()  # 144 products a panel at coordinates of 3 m
    assert np.abs(k @ np.tile(np.eye(3), (4, 1))).max() <= rounding
    spin = rng.normal(size=3)
    turned = np.einsum("pij,pj->pi", k, np.cross(spin, x).reshape(50, 12)).reshape(50, 4, 3)
    assert np.abs(turned - np.cross(spin, force)).max() <= rounding


def test_line_load_is_force_per_current_length_shared_by_both_ends_with_its_exact_stiffness():
    rng = np.random.default_rng(4)
    ends, load = rng.normal(size=(100, 2, 3)), rng.normal(scale=50.0, size=(100, 3))
    force, tangent = line_load_forces_and_tangents(ends, load)
    assert np.array_equal(force, line_load_forces(ends, load))
    assert np.array_equal(force[:, 0], force[:, 1])
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert force.sum(axis=1) == pytest.approx(length[:, None] * load, rel=1e-14)
    for x, w, k in zip(ends, load, tangent, strict=True):
        slope = central_difference(lambda y, w=w: line_load_forces(y[None], w[None]), x)
        assert np.abs(slope - k).max() <= TANGENT_TOLERANCE * np.abs(k).max()


def test_line_of_no_length_carries_nothing():
    force, tangent = line_load_forces_and_tangents(np.ones((1, 2, 3)), np.ones((1, 3)))
    assert not np.any(force)
    assert not np.any(tangent)


@pytest.mark.parametrize("shear", [False, True], ids=["pressure", "pressure+shear"])
def test_faces_of_three_corners_bear_what_panels_with_a_repeated_corner_do(shear):
    rng = np.random.default_rng(11)
    panels = np.array([_panel(rng, "triangle") for _ in range(100)])
    p = rng.normal(scale=100.0, size=100)
    load = FaceLoad(p, rng.normal(scale=50.0, size=(100, 3)) if shear else None)
    three = Faces(np.arange(300).reshape(100, 3))
    four = Faces(np.arange(400).reshape(100, 4))
    force, tangent, rates = three.forces_and_tangents(panels[:, :3], load)
    quads, stiffness, _ = four.forces_and_tangents(panels, load)
    assert rates is None  # pressure does not depend on velocities
    joined = np.zeros((12, 9))  # the last two corners are one
    joined[:9] = np.eye(9)
    joined[9:, 6:] = np.eye(3)
    size = np.abs(quads).max()
    assert force.reshape(100, 9) == pytest.approx(quads.reshape(100, 12) @ joined, abs=1e-13 * size)
    assert three.forces(panels[:, :3], load) == pytest.approx(force, abs=1e-14 * size)
    merged = joined.T @ stiffness @ joined
    assert tangent == pytest.approx(merged, abs=1e-12 * np.abs(merged).max())


def test_a_closed_net_is_blown_up_by_a_pressure_that_is_none_of_the_interface():
    """Octahedron of springs k, l0 with the circumradius r: 2/3 p r^2 = 2 sqrt(2) k (sqrt(2) r - l0) at every corner."""
    nodes = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]])
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    edges = np.array([(a, b) for a in range(6) for b in range(a + 1, 6) if b - a != 3])
    k, l0, p = 400.0, 1.4, 300.0
    fixed = np.zeros((6, 3), bool)
    fixed[0], fixed[3, 1:], fixed[1, 2] = True, True, True  # no more than holds it in place
    outer = interface_groups(sp.csr_array(np.eye(6)[:3]), np.array([[0, 1, 2, 2]]))
    s = Structure(nodes, fixed, (chains(edges, l0, k),), {**outer, "cell": Faces(faces)})
    assembly = Assembly(s)
    loads = Loads(np.zeros((6, 3)), {"cell": FaceLoad(np.full(8, p))})
    found = equilibrium(assembly, loads, nodes, atol=1e-9)
    assert found.converged
    r = 3.0 * k / p * (1.0 - np.sqrt(1.0 - np.sqrt(2.0) * p * l0 / (3.0 * k)))  # the smaller root is the stable one
    across = np.linalg.norm(found.x[:3] - found.x[3:], axis=1)
    assert across == pytest.approx(np.full(3, 2.0 * r), rel=1e-10)  # 1e-9 N on 400 N/m
    q = assembly.unknowns.restrict(found.x)
    residual, prepared = residual_of(assembly, s.groups, loads)
    exact = central_difference(residual, q)
    _, tangent, _ = assembly.residual_and_tangent(q, prepared)
    assert np.abs(tangent.toarray() - exact).max() <= TANGENT_TOLERANCE * np.abs(exact).max()
    # the panel of the interface bears on top of it, and takes the same net force as a face
    pushed = Loads(loads.dead, {**loads.on, "panels": FaceLoad(np.array([10.0]))})
    force = assembly.load_forces(nodes, pushed) - assembly.load_forces(nodes, loads)
    more = FaceLoad(np.array([10.0, *np.zeros(7)]))
    assert force == pytest.approx(assembly.load_forces(nodes, Loads(loads.dead, {"cell": more})), abs=1e-12)


def test_loads_on_a_place_that_a_structure_does_not_have_are_refused_by_name():
    s = structure([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [True, False, False], [chains([[0, 1], [0, 2]], 1.0, 10.0)])
    s = replace(s, load_groups={"cell": Faces(np.array([[0, 1, 2]]))})
    with pytest.raises(ValueError, match="no load group 'panels'; it has: cell"):
        Assembly(s).prepare(Loads(np.zeros((3, 3)), {"panels": FaceLoad(np.ones(1))}))
