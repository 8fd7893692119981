"""Membrane elements: patch test, objectivity, tangents, patterns of their own, images, follower pressure on them."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.membrane_models import isotropic, quadratic, rectangle
from interface.vectors import rotation
from structural import Assembly, Configuration, FaceLoad, Faces, Loads, Structure, equilibrium
from structural.dynamics import Motion
from structural.elements.membranes import Membranes, flat_patterns, prestressed_patterns
from structural.materials.membranes import LinearMembrane, isotropic_membrane
from structural.triangles import DEGREE_2, DEGREE_4
from tests.structural.models import MIRROR, central_difference

ROOT = Path(__file__).resolve().parents[2]
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
# Of tangents by central differences of 1e-6: the curvature of T6 with sides of 0.4 m times the step squared.
TOLERANCE = 1e-7


def scattered(m, space, count, seed):
    """`count` lone elements of m nodes with orthotropic laws and distorted patterns, in a shape where they are taut,
    wrinkled and slack: group and positions.
    """
    rng = np.random.default_rng(seed)
    pattern = np.zeros((count, m, space))
    pattern[..., :2] = CORNERS[:m]
    pattern += 0.05 * rng.normal(size=pattern.shape)
    ratio, one = rng.choice([1.0, 3.0, 30.0, 100.0], count), np.ones(count)
    law = LinearMembrane(one, one / ratio, 0.1 * one, rng.choice([0.4, 0.05, 0.005], count))
    group = Membranes(np.arange(count * m).reshape(count, m), pattern, law, rng.uniform(0.0, 0.5 * np.pi, count))
    x = np.zeros((count, m, 3))
    x[..., :space] = pattern
    x[..., :2] *= rng.uniform(0.8, 1.2, (count, 1, 2))
    x += 0.03 * rng.normal(size=x.shape)
    return group, (x @ rotation(np.array([0.3, -0.8, 0.5])).T).reshape(-1, 3)


@pytest.mark.parametrize(("m", "space"), [(3, 2), (3, 3), (6, 2), (6, 3)])
def test_forces_and_tangents_are_derivatives_of_the_energy(m, space):
    group, x = scattered(m, space, 60, m + space)
    forces, tangents = group.forces_and_tangents(Configuration(x))
    assert {0, 1, 2} == set(group.law.state(group.strains(x)).ravel())
    np.testing.assert_allclose(tangents, tangents.transpose(0, 2, 1), atol=1e-12)
    np.testing.assert_allclose(forces, group.forces(Configuration(x)), atol=1e-15)
    for e in range(len(group)):
        one, at = group.select(np.array([e])), x.reshape(-1, m, 3)[e]
        one = Membranes(np.arange(m)[None], one.pattern, one.law, one.angle)

        def force(p, one=one):
            return one.forces(Configuration(p))

        margin = np.ptp([one.law.state(one.strains(at + 1e-4 * d)) for d in np.eye(3 * m).reshape(-1, m, 3)], axis=0)
        if margin.any():  # a border of states is near: the tangent jumps there
            continue
        numbers = central_difference(force, at)
        np.testing.assert_allclose(tangents[e], numbers, atol=TOLERANCE * max(1.0, np.abs(numbers).max()))
        slope = central_difference(lambda p, one=one: np.array([one.energy(Configuration(p))]), at)[0]
        np.testing.assert_allclose(forces[e].ravel(), slope, atol=1e-8)


@pytest.mark.parametrize("m", [3, 6])
def test_a_uniform_strain_is_in_every_element_of_a_patch(m):
    nodes, triangles = rectangle((3, 2), (1.5, 1.0))
    nodes[:, :2] += 0.1 * np.random.default_rng(0).normal(size=(len(nodes), 2))
    if m == 6:
        nodes, triangles, _ = quadratic(nodes, triangles)
    law = LinearMembrane(*(np.full(len(triangles), v) for v in (900.0, 300.0, 0.2, 150.0)))
    patterns = nodes[triangles][:, :, :2]
    group = Membranes(triangles, patterns, law, np.full(len(triangles), 0.4))
    f = np.array([[1.02, 0.01], [0.02, 1.03], [0.3, -0.1]])  # taut: both principal stresses above zero
    held = np.zeros(len(nodes), bool)
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    outer, number = np.unique(edges, axis=0, return_counts=True)
    held[outer[number == 1].ravel()] = True
    if m == 6:
        sides = dict(zip(map(tuple, np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1).tolist()),
                         triangles[:, 3:].reshape(-1).tolist(), strict=True))  # fmt: skip
        held[[sides[tuple(pair)] for pair in outer[number == 1].tolist()]] = True
    target = nodes[:, :2] @ f.T
    start = np.where(held[:, None], target, target + 0.02 * np.random.default_rng(1).normal(size=target.shape))
    s = Structure(start, np.repeat(held[:, None], 3, axis=1), (group,))
    found = equilibrium(Assembly(s), Loads(np.zeros_like(nodes)), start, atol=1e-10)
    assert found.converged
    assert np.abs(found.x - target).max() <= 1e-10  # the tolerance over stiffnesses of some 100 N/m, times the mesh
    strain = group.strains(found.x)
    assert np.ptp(strain, axis=(1, 2)).max() <= 1e-9


@pytest.mark.parametrize("m", [3, 6])
def test_a_rigid_motion_turns_the_forces_and_changes_nothing_else(m):
    group, x = scattered(m, 2, 40, 9)
    turn = rotation(np.array([2.0, -1.5, 0.7]))
    moved = x @ turn.T + np.array([3.0, -2.0, 1.0])
    before, after = (group.forces(Configuration(p)) for p in (x, moved))
    np.testing.assert_allclose(after, before @ turn.T, atol=1e-14)  # rounding of coordinates of 3 m
    np.testing.assert_allclose(before.sum(axis=1), 0.0, atol=1e-15)
    arms = x[group.nodes] - x[group.nodes[:, :1]]
    np.testing.assert_allclose(np.cross(arms, before).sum(axis=1), 0.0, atol=1e-15)
    flat = np.zeros((len(x), 3))
    flat[:, :2] = group.pattern.reshape(-1, 2)
    at_rest = group.forces(Configuration(flat @ turn.T + 5.0))
    assert np.abs(at_rest).max() <= 1e-13  # eps times 5 m over sides of 0.3 m


@pytest.mark.parametrize("m", [3, 6])
def test_a_cylinder_rolled_from_its_flat_pattern_has_no_stress(m):
    # T3: facets between points on the circle; the flat pattern has their chords
    nodes, triangles = rectangle((24, 5), (2.0 * np.pi, 1.0))
    angle = nodes[:, 0].copy()
    pattern = nodes[:, :2].copy()
    if m == 3:
        pattern[:, 0] *= np.sin(np.pi / 24) / (np.pi / 24)
        rolled = np.column_stack([np.cos(angle), np.sin(angle), nodes[:, 1]])
    else:  # six nodes: the quadratic sides of a T6 measure their own length, and a pattern in space has it exactly
        nodes, triangles, _ = quadratic(nodes, triangles)
        angle = nodes[:, 0]
        rolled = np.column_stack([np.cos(angle), np.sin(angle), nodes[:, 1]])
    patterns = pattern[triangles] if m == 3 else flat_patterns(rolled, triangles)
    assert patterns.shape[2] == (2 if m == 3 else 3)
    group = isotropic(rolled, triangles, 1.0, 0.3, pattern=patterns)
    assert np.abs(group.strains(rolled)).max() <= 1e-13  # rounding of strains over sides of 0.2 m


def test_quadratic_elements_roll_up_with_strains_of_fourth_order():
    worst = []
    for cells in (12, 24, 48):
        nodes, triangles, _ = quadratic(*rectangle((cells, 4), (2.0 * np.pi, 1.0)))
        rolled = np.column_stack([np.cos(nodes[:, 0]), np.sin(nodes[:, 0]), nodes[:, 1]])
        group = isotropic(rolled, triangles, 1.0, 0.3, pattern=nodes[triangles][:, :, :2])
        worst.append(np.sqrt(np.sum(group.geometry[1] * group.strains(rolled) ** 2)))
    orders = np.log2(np.array(worst[:-1]) / worst[1:])
    assert np.all(orders > 1.9)  # second order: parabola against circle, at the points of integration


def test_a_panel_cut_short_is_stretched_where_it_is_mounted():
    nodes, triangles = rectangle((2, 2), (1.0, 1.0))
    patterns = flat_patterns(nodes, triangles) / 1.01
    group = isotropic(nodes, triangles, 1000.0, 0.3, pattern=patterns)
    e = 0.5 * (1.01**2 - 1.0)
    np.testing.assert_allclose(group.strains(nodes)[:2], e, rtol=1e-12)


def test_a_prestress_is_there_where_the_pattern_was_taken():
    nodes, triangles = rectangle((3, 2), (1.0, 0.7))
    e = len(triangles)
    law = LinearMembrane(*(np.full(e, v) for v in (9e4, 3e4, 0.2, 1e4)))
    angle = np.full(e, 0.6)
    stress = np.array([400.0, 150.0, 80.0])
    patterns = prestressed_patterns(flat_patterns(nodes, triangles), law, stress, angle)
    group = Membranes(triangles, patterns, law, angle)
    # the fibres of the pattern are those of the shape, stretched: F^-1 turns nothing
    np.testing.assert_allclose(
        law.response(group.strains(nodes))[0][:, 0], np.repeat(stress[:, None], e, axis=1), rtol=1e-9
    )
    with pytest.raises(ValueError, match="must not be negative"):
        prestressed_patterns(flat_patterns(nodes, triangles), law, np.array([100.0, -1.0, 0.0]))


def test_six_node_triangles_share_the_mass_among_their_middles():
    nodes, triangles = rectangle((2, 2), (1.0, 0.8))
    three = isotropic(nodes, triangles, 1.0, 0.3)
    three = Membranes(three.nodes, three.pattern, three.law, mass=np.full(8, 0.05))
    more, six, _ = quadratic(nodes, triangles)
    sixes = Membranes(six, flat_patterns(more, six), three.law, mass=np.full(8, 0.05))
    for group, n in ((three, len(nodes)), (sixes, len(more))):
        assert group.nodal_masses(n).sum() == pytest.approx(0.05 * 0.8, rel=1e-14)
        assert group.nodal_masses(n).min() >= 0.0


# Symmetry


def mirrored_pair(angle):
    """Two triangles that are mirror images in y = 0, orthotropic, the fibres of the second at an `angle`."""
    half = np.array([[0.0, 0.2, 0.0], [1.0, 0.3, 0.1], [0.3, 1.0, 0.2]])
    nodes = np.concatenate([half, half * MIRROR])
    triangles = np.array([[0, 1, 2], [3, 5, 4]])
    law = LinearMembrane(*(np.full(2, v) for v in (9.0, 1.0, 0.2, 1.0)))
    return nodes, Membranes(triangles, flat_patterns(nodes, triangles), law, np.array([0.5, angle]))


def test_fibres_of_a_mirror_image_are_mirrored_too():
    mirror, none = np.array([3, 4, 5, 0, 1, 2]), np.zeros(0, int)
    nodes, _ = mirrored_pair(0.0)
    side = nodes[1] - nodes[0], nodes[5] - nodes[3]  # first axes of both patterns
    across = [np.cross(np.cross(a, nodes[c] - nodes[o]), a) for a, c, o in zip(side, (2, 4), (0, 3), strict=True)]
    unit = [[v / np.linalg.norm(v) for v in pair] for pair in zip(side, across, strict=True)]
    fibre = (np.cos(0.5) * unit[0][0] + np.sin(0.5) * unit[0][1]) * MIRROR
    image = np.arctan2(fibre @ unit[1][1], fibre @ unit[1][0])
    assert mirrored_pair(image)[1].images(mirror, none).tolist() == [1, 0]
    assert mirrored_pair(image + np.pi)[1].images(mirror, none).tolist() == [1, 0]  # a fibre has no ends
    assert mirrored_pair(0.5)[1].images(mirror, none).tolist() == [-1, -1]


def sheet(m, cells=4):
    """A square sheet about y = 0 held on its edge, and the mirror permutation of its nodes."""
    nodes, triangles = rectangle((cells, cells), (1.0, 1.0), crossed=True)
    nodes[:, 1] -= 0.5
    if m == 6:
        nodes, triangles, _ = quadratic(nodes, triangles)
    held = np.isclose(nodes[:, 0] % 1.0, 0.0) | np.isclose(np.abs(nodes[:, 1]), 0.5)
    group = isotropic(nodes, triangles, 1e4, 0.3)
    return Structure(nodes, np.repeat(held[:, None], 3, axis=1), (group,), {"skin": Faces(triangles)})


@pytest.mark.parametrize("m", [3, 6])
def test_half_a_symmetric_sheet_gives_the_whole_answer(m):
    s = sheet(m)
    image = np.abs(s.nodes[:, None] - s.nodes * MIRROR).sum(axis=2).argmin(axis=1)
    loads = Loads(np.zeros_like(s.nodes), {"skin": FaceLoad(np.full(len(s.groups[0]), 200.0))})
    whole, half = (equilibrium(Assembly(s, k), loads, s.nodes, atol=1e-9) for k in (None, image))
    assert whole.converged
    assert half.converged
    assert np.abs(whole.x - half.x).max() <= 1e-9  # both to 1e-9 N over some 10 N/m


# Follower pressure


@pytest.mark.parametrize("shear", [False, True])
def test_pressure_on_curved_triangles_has_its_exact_unsymmetric_stiffness(shear):
    rng = np.random.default_rng(0)
    points = np.zeros((3, 6, 3))
    points[..., :2] = CORNERS
    points += 0.1 * rng.normal(size=points.shape)
    faces = Faces(np.arange(18).reshape(3, 6))
    load = FaceLoad(rng.normal(size=3), rng.normal(size=(3, 3)) if shear else None)
    forces, tangents, _ = faces.forces_and_tangents(points, load)
    np.testing.assert_allclose(forces, faces.forces(points, load), atol=1e-15)
    for p in range(3):
        one, on = faces.select(np.array([p])), load.select(np.array([p]))
        numbers = central_difference(lambda x, one=one, on=on: one.forces(x, on), points[p : p + 1])
        np.testing.assert_allclose(tangents[p], numbers, atol=1e-8)
    assert np.abs(tangents - tangents.transpose(0, 2, 1)).max() > 0.01


def test_flat_curved_triangles_carry_pressure_on_their_middles():
    # int N_i dA of the quadratic functions: nothing at the corners, a third at each middle
    points = np.zeros((1, 6, 3))
    points[..., :2] = CORNERS
    forces = Faces(np.arange(6)[None]).forces(points, FaceLoad(np.array([6.0])))
    np.testing.assert_allclose(forces[0, :, 2], [0.0, 0.0, 0.0, 1.0, 1.0, 1.0], atol=1e-14)


def test_points_of_integration_are_exact_to_their_degree():
    from math import factorial

    for degree, (points, weights) in ((2, DEGREE_2), (4, DEGREE_4)):
        for i in range(degree + 1):
            for j in range(degree + 1 - i):
                exact = factorial(i) * factorial(j) / factorial(i + j + 2)
                assert weights @ (points[:, 0] ** i * points[:, 1] ** j) == pytest.approx(exact, abs=1e-15)


@pytest.mark.parametrize("m", [3, 6])
def test_pressure_on_a_closed_surface_has_no_resultant(m):
    # an octahedron, its middles anywhere; a pressure has no moment either
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    triangles = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    nodes = corners
    if m == 6:
        nodes, triangles, _ = quadratic(corners, triangles)
    nodes = nodes + 0.1 * np.random.default_rng(0).normal(size=nodes.shape)
    forces = Faces(triangles).forces(nodes[triangles], FaceLoad(np.full(8, 3.0)))
    np.testing.assert_allclose(forces.sum(axis=(0, 1)), 0.0, atol=1e-14)
    np.testing.assert_allclose(np.cross(nodes[triangles], forces).sum(axis=(0, 1)), 0.0, atol=1e-14)


# What is refused


@pytest.mark.parametrize("wrong", [[[0, 0], [1, 0], [2, 0]], [[0, 0], [0, 1], [1, 0]]])
def test_patterns_without_area_or_clockwise_are_refused_by_name(wrong):
    pattern = np.array([[[0, 0], [1, 0], [0, 1]], wrong], float)
    with pytest.raises(ValueError, match="pattern of membrane element number 2 of Membranes has no area"):
        Membranes(np.array([[0, 1, 2], [1, 2, 3]]), pattern, isotropic_membrane(np.ones(2), np.full(2, 0.3)))


def test_quads_are_refused():
    law = isotropic_membrane(np.ones(1), np.full(1, 0.3))
    with pytest.raises(ValueError, match=r"3 or 6 nodes, .* nodes are \(1, 4\)"):
        Membranes(np.array([[0, 1, 2, 3]]), np.zeros((1, 4, 2)), law)


def test_membranes_in_motion_are_refused():
    s = sheet(3)
    with pytest.raises(ValueError, match="membranes have no dynamics yet"):
        Motion(Assembly(s), np.ones(len(s.nodes)), Loads(np.zeros_like(s.nodes)))


def test_a_structure_without_membranes_loads_none_of_their_code():
    script = (
        "import sys, numpy as np\n"
        "from structural import Assembly, Chains, Faces, FaceLoad, Loads, Structure, equilibrium\n"
        "nodes = np.array([[0.0, 0, 0], [1.0, 0, 0], [0.0, 1.0, 0], [0.3, 0.3, -1.0]])\n"
        "lines = Chains(np.array([[0, 3], [1, 3], [2, 3]]), np.ones(3), np.full(3, 1e3), np.zeros(3, bool))\n"
        "fixed = np.repeat(np.arange(4)[:, None] < 3, 3, axis=1)\n"
        "s = Structure(nodes, fixed, (lines,), {'skin': Faces(np.array([[0, 1, 3]]))})\n"
        "loads = Loads(np.zeros((4, 3)), {'skin': FaceLoad(np.array([50.0]))})\n"
        "assert equilibrium(Assembly(s), loads, nodes).converged\n"
        "print(*(m for m in sys.modules if any(w in m for w in ('membrane', 'energy', 'triangles', 'curved'))))"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert not done.stdout.split()


@pytest.mark.parametrize("m", [3, 6])
def test_at_rest_anywhere_in_space_tangents_are_those_of_a_taut_sheet(m):
    nodes, triangles = rectangle((6, 4), (1.5, 1.0), crossed=True)
    if m == 6:
        nodes, triangles, _ = quadratic(nodes, triangles)
    x = nodes @ rotation(np.array([0.3, -0.8, 0.5])).T + np.array([3.0, -2.0, 5.0])
    wrinkling, taut = (isotropic(x, triangles, 1e5, 0.3, wrinkles=on) for on in (True, False))
    assert len(set(wrinkling.law.state(wrinkling.strains(x)).ravel())) > 1  # by chance
    at = Configuration(x)
    stiff = wrinkling.forces_and_tangents(at)[1]
    # what rounding leaves of stress, 1e-13 of the modulus, is in the one and not in the other
    np.testing.assert_allclose(stiff, taut.forces_and_tangents(at)[1], atol=1e-11 * np.abs(stiff).max())


def test_softened_fabric_is_in_series_with_a_spring_as_wide_as_it_is():
    # E h' = E h P / (P + E h b): a load P over the width b stretches a soft fabric to about twice its length
    nodes, triangles = rectangle((4, 4), (2.0, 2.0))
    group, stiff = isotropic(nodes, triangles, 1e5, 0.0), isotropic(nodes, triangles, 1e5, 0.0, wrinkles=False)
    assert group.softenable() == pytest.approx(1e5 * 2.0)
    np.testing.assert_allclose(group.softened(10.0).law.E1, 1e5 * 10.0 / (10.0 + 1e5 * 2.0))
    np.testing.assert_allclose(group.softened(10.0).law.nu12, 0.0)
    assert stiff.softenable() == 0.0  # what may push is kept from buckling by its stiffness
    assert stiff.softened(10.0) is stiff
