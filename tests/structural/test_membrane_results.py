"""Stress, volume, reactions and seam forces of solved membranes against closed forms."""

import numpy as np
import pytest

from benchmarks.membrane_models import airbag, inflated, isotropic, quadratic, rectangle
from structural import Configuration, FaceLoad, Faces, Structure
from structural.elements.membrane_results import (
    Seams,
    enclosed_volume,
    membrane_state,
    nodal_forces,
    reactions,
)
from structural.elements.membranes import Membranes, flat_patterns
from structural.materials.membranes import SLACK, TAUT, WRINKLED, LinearMembrane


def stretched(first, second, m=3, angle=0.0):
    """A 2 m x 1 m sheet, stretched along x and y by factors: group and positions; E h 1000 N/m, nu 0.25."""
    nodes, triangles = rectangle((4, 3), (2.0, 1.0))
    if m == 6:
        nodes, triangles, _ = quadratic(nodes, triangles)
    group = isotropic(nodes, triangles, 1000.0, 0.25)
    group = Membranes(triangles, group.pattern, group.law, np.full(len(triangles), angle))
    return group, nodes * np.array([first, second, 1.0])


@pytest.mark.parametrize("m", [3, 6])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_stress_of_a_stretched_sheet_in_all_measures(m, angle):
    group, x = stretched(1.04, 1.02, m, angle)
    found = membrane_state(group, x)
    e1, e2 = 0.5 * (1.04**2 - 1.0), 0.5 * (1.02**2 - 1.0)
    s1, s2 = (1000.0 / (1.0 - 0.25**2) * (a + 0.25 * b) for a, b in ((e1, e2), (e2, e1)))
    assert np.all(found.state == TAUT)
    np.testing.assert_allclose(found.stress, np.tile([s1, s2], (len(group), 1)), rtol=1e-11)
    cauchy = s1 * 1.04 / 1.02, s2 * 1.02 / 1.04  # sigma = F S F^T / J
    np.testing.assert_allclose(found.cauchy, np.tile(cauchy, (len(group), 1)), rtol=1e-11)
    np.testing.assert_allclose(found.strain, np.tile([e1, e2], (len(group), 1)), rtol=1e-11)
    np.testing.assert_allclose(np.abs(found.direction), np.tile([1.0, 0.0, 0.0], (len(group), 1)), atol=1e-10)
    assert found.largest_strain == pytest.approx(e1)
    assert (found.slack_share, found.wrinkled_share) == (0.0, 0.0)
    assert found.area.sum() == pytest.approx(2.0)


def test_wrinkles_follow_the_tension():
    group, x = stretched(1.02, 0.9)
    found = membrane_state(group, x)
    assert np.all(found.state == WRINKLED)
    np.testing.assert_allclose(
        found.stress, np.tile([1000.0 * 0.5 * (1.02**2 - 1.0), 0.0], (len(group), 1)), atol=1e-10
    )
    np.testing.assert_allclose(np.abs(found.direction[:, 0]), 1.0, atol=1e-12)
    assert found.wrinkled_share == 1.0
    loose = membrane_state(*stretched(0.9, 0.8))
    assert np.all(loose.state == SLACK)
    assert (loose.slack_share, np.abs(loose.stress).max()) == (1.0, 0.0)


@pytest.mark.parametrize("m", [3, 6])
def test_volume_of_an_octahedron(m):
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    triangles = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    if m == 6:
        corners, triangles, _ = quadratic(corners, triangles)
    assert enclosed_volume(corners + np.array([5.0, 2.0, -1.0]), triangles) == pytest.approx(4.0 / 3.0, rel=1e-12)


def test_volume_is_the_potential_of_pressure():
    rng = np.random.default_rng(0)
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    triangles = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    x, six, _ = quadratic(corners, triangles)
    x = x + 0.1 * rng.normal(size=x.shape)
    forces = np.zeros_like(x)
    np.add.at(forces, six, Faces(six).forces(x[six], FaceLoad(np.ones(8))))
    d = rng.normal(size=x.shape)
    slope = (enclosed_volume(x + 1e-5 * d, six) - enclosed_volume(x - 1e-5 * d, six)) / 2e-5
    assert slope == pytest.approx(float(np.sum(forces * d)), rel=1e-8)  # cubic in x: the difference errs by h^2


def test_reactions_of_an_airbag_bear_its_pressure():
    nodes, fixed, group = airbag(6)
    found, _, loads = inflated(nodes, fixed, group, 5000.0)
    s = Structure(nodes, fixed, (group,), {"skin": Faces(group.nodes)})
    force = reactions(s, found.x, loads)
    pressed = np.zeros_like(nodes)
    np.add.at(pressed, group.nodes, s.load_groups["skin"].forces(found.x[group.nodes], loads.on["skin"]))
    np.testing.assert_allclose(force.sum(axis=0), -pressed.sum(axis=0), atol=1e-7)  # residual 1e-9 of 900 N
    free = nodal_forces((group,), Configuration(found.x)) - pressed - force
    assert np.linalg.norm(free) <= 1e-9 * np.linalg.norm(pressed) * 1.01
    plane = np.isclose(nodes[:, 0], 0.0)  # across the plane of symmetry the sheet pulls with its stress alone
    assert force[plane, 0].sum() < 0.0


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_a_seam_passes_on_the_stress_across_it(angle):
    nodes, triangles = rectangle((2, 2), (1.0, 1.0))
    law = LinearMembrane(*(np.full(8, v) for v in (1000.0, 300.0, 0.25, 200.0)))
    group = Membranes(triangles, flat_patterns(nodes, triangles), law, np.full(8, angle))
    nodes2 = nodes @ np.array([[1.02, 0.004, 0.0], [0.004, 1.03, 0.0], [0.0, 0.0, 1.0]])
    middle = np.flatnonzero(np.isclose(nodes[:, 0], 0.5))
    seams = np.stack([middle[:-1], middle[1:]], axis=1)
    pull = Seams.of(group, seams).forces(nodes2)
    half = Membranes(*(a[nodes[triangles].mean(axis=1)[:, 0] < 0.5] for a in (group.nodes, group.pattern)),
                     law.select(np.arange(4)),
                     np.array([group.angle[0]] * 4))  # fmt: skip
    passed = nodal_forces((half,), Configuration(nodes2))[middle].sum(axis=0)
    np.testing.assert_allclose(np.abs(pull.mean(axis=0)), np.abs(passed), rtol=1e-9, atol=1e-9)  # 1 m of seam
    with pytest.raises(ValueError, match="no membrane element has a side between the nodes 0 and 8"):
        Seams.of(group, np.array([[0, 8]]))


def test_a_seam_of_three_sheets_passes_on_what_the_first_pulls_against_both_others():
    """Three strips in a plane, one to the left of the seam and two, each half as stiff, on each other to its right."""
    nodes = np.array(
        [[-1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
    )
    left, right = [[0, 2, 3], [0, 3, 1]], [[2, 4, 5], [2, 5, 3]]
    triangles = np.array([*left, *right, *right])
    stiffness = np.repeat([1000.0, 500.0], [2, 4])
    law = LinearMembrane(stiffness, stiffness, np.zeros(6), 0.5 * stiffness)
    group = Membranes(triangles, flat_patterns(nodes, triangles), law)
    stretch = 1.02
    pull = Seams.of(group, np.array([[2, 3]])).forces(nodes * [stretch, 1.0, 1.0])
    # F S = stretch E (stretch^2 - 1) / 2 per length of the pattern
    np.testing.assert_allclose(pull, [[stretch * 1000.0 * 0.5 * (stretch**2 - 1.0), 0.0, 0.0]], rtol=1e-12, atol=1e-12)
