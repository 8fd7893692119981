"""Skin and ribs of a ram-air wing: one conforming mesh that fills every profile and mirrors like the wing."""

import numpy as np
import pytest

from interface.mirror import canonical_faces, mirror_permutation, mirror_rows
from scenes.builders.ram_air import ram_air_mesh
from scenes.builders.topology import edges


def wing(points, stations=5, taper=0.3):
    """Nodes, quads and profile loops of a tapered wing, open at its tips."""
    turn = np.arange(points) * 2.0 * np.pi / points
    x, z = 0.5 * (1.0 + np.cos(turn)), 0.1 * np.sin(turn) * (1.2 - 0.5 * (1.0 + np.cos(turn)))
    y = np.linspace(-2.0, 2.0, stations)
    chord = 1.0 - taper * np.abs(y) / 2.0
    nodes = np.stack([chord[:, None] * x, np.repeat(y[:, None], points, 1), chord[:, None] * z], axis=2).reshape(-1, 3)
    at = np.arange(stations * points).reshape(stations, points)
    after = np.roll(at, -1, axis=1)
    quads = np.stack([at[:-1], at[1:], after[1:], after[:-1]], axis=2).reshape(-1, 4)
    return nodes, quads, at


def areas(mesh, part):
    corners = mesh.nodes[mesh.triangles[mesh.triangle_parts[part]]]
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


@pytest.mark.parametrize("points", [4, 5, 8, 9, 34, 55, 80])
@pytest.mark.parametrize("rows", [1, 4])
def test_ribs_fill_their_profiles_once_and_meet_the_skin_side_by_side(points, rows):
    nodes, quads, loops = wing(points)
    mesh = ram_air_mesh(nodes, quads, loops, rows)
    for k, loop in enumerate(loops):
        c = nodes[loop]
        polygon = 0.5 * abs(np.sum(c[:, 0] * np.roll(c[:, 2], -1) - np.roll(c[:, 0], -1) * c[:, 2]))
        found = areas(mesh, f"rib_{k + 1}")
        assert np.linalg.norm(found, axis=1).sum() == pytest.approx(polygon, rel=1e-12)  # rounding
        assert np.linalg.norm(found.sum(axis=0)) == pytest.approx(polygon, rel=1e-12)  # none is turned over
        border = edges(mesh.triangles[mesh.triangle_parts[f"rib_{k + 1}"]])
        open_sides = border.ends[border.count == 1]
        assert sorted(map(tuple, open_sides)) == sorted(map(tuple, np.sort(np.stack([loop, np.roll(loop, -1)], 1), 1)))


def test_the_skin_is_two_triangles_a_quad_on_its_nodes():
    nodes, quads, loops = wing(12)
    mesh = ram_air_mesh(nodes, quads, loops[1:-1])
    skin = mesh.triangles[mesh.triangle_parts["skin"]]
    assert np.array_equal(mesh.nodes[: len(nodes)], nodes)
    for k, quad in enumerate(quads):
        assert set(skin[2 * k : 2 * k + 2].ravel()) == set(quad)
    corner = nodes[quads]
    vector = 0.5 * np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    both = areas(mesh, "skin").reshape(-1, 2, 3).sum(axis=1)
    assert both == pytest.approx(vector, abs=1e-15)  # whichever diagonal: the area vector is that of the border


def test_panels_that_are_triangles_stay_so():
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh = ram_air_mesh(nodes, np.array([[0, 1, 2, 2], [0, 2, 3, 3]]), [])
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("taper", [0.0, 0.5])
def test_a_mirrored_wing_has_a_mirrored_mesh(taper):
    nodes, quads, loops = wing(14, taper=taper)
    mesh = ram_air_mesh(nodes, quads, loops)
    images = mirror_permutation(mesh.nodes)
    assert np.all(mirror_rows(mesh.triangles, images, canonical_faces) >= 0)


@pytest.mark.parametrize(("rows", "points"), [(0, 8), (2, 3)])
def test_ribs_that_cannot_be_are_one_sentence(rows, points):
    nodes, quads, loops = wing(points)
    with pytest.raises(ValueError, match="four nodes round their profile and one row"):
        ram_air_mesh(nodes, quads, loops, rows)
