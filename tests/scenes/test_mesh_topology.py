"""What hangs together in a mesh: Euler characteristics, orientation, volumes, rigid modes in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from scenes import SceneError
from scenes.builders import surfaces
from scenes.builders.mesh import TriangleMesh, joined, quadratic, turned
from scenes.builders.mesh_checks import check_closed, check_connected, check_pressurised, check_supports
from scenes.builders.topology import (
    area_vectors,
    areas,
    boundary_edges,
    connected_triangles,
    edges,
    enclosed_volume,
    euler_characteristic,
    is_closed,
    neighbours,
    orientation,
    outward_flips,
    rigid_modes,
)


def torus(n=8, k=6, order=1):
    """A torus of radii 2 and 0.5 m, normals outward."""
    u, v = np.meshgrid(2 * np.pi * np.arange(n + 1) / n, 2 * np.pi * np.arange(k + 1) / k, indexing="ij")
    ring = 2.0 + 0.5 * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), 0.5 * np.sin(v)], axis=2)
    return surfaces.ruled(list(points), diagonals="union-jack", order=order)


def moebius(n=12):
    """A strip of n cells with half a turn."""
    t = 2.0 * np.pi * np.arange(n + 1) / n
    axis = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    across = 0.2 * np.stack([np.cos(t / 2) * np.cos(t), np.cos(t / 2) * np.sin(t), np.sin(t / 2)], axis=1)
    return surfaces.ruled([axis - across, axis + across], diagonals="one-way")


def two_spheres():
    far = surfaces.sphere(0.5, 3)
    return joined([surfaces.sphere(1.0, 3), replace(far, nodes=far.nodes + np.array([5.0, 0.0, 0.0]))])


@pytest.mark.parametrize(
    ("mesh", "chi", "closed"),
    [
        (surfaces.sphere(1.0, 4), 2, True),
        (surfaces.airbag(1.0, 2), 2, True),
        (surfaces.cylinder(1.0, 3.0, (3, 8)), 2, True),
        (torus(), 0, True),
        (surfaces.cylinder(1.0, 3.0, (3, 8), caps=False), 0, False),
        (moebius(), 0, False),
        (surfaces.disc(1.0, 4), 1, False),
        (surfaces.rectangle(1.0, 2.0, (3, 4)), 1, False),
        (two_spheres(), 4, True),
    ],
    ids=["sphere", "airbag", "cylinder", "torus", "tube", "moebius", "disc", "rectangle", "spheres"],
)
def test_euler_characteristic_is_that_of_the_surface(mesh, chi, closed):
    assert euler_characteristic(mesh.triangles) == chi
    assert euler_characteristic(quadratic(mesh).triangles) == chi
    assert is_closed(mesh.triangles) == closed
    assert (len(boundary_edges(mesh.triangles)) == 0) == closed


def test_every_edge_of_a_closed_surface_has_two_triangles_and_every_triangle_three_neighbours():
    mesh = torus()
    found, across = edges(mesh.triangles), neighbours(mesh.triangles)
    assert np.all(found.count == 2)
    assert 2 * len(found.ends) == 3 * len(mesh.triangles)
    assert across.min() >= 0
    back = across[across]  # neighbours of neighbours: each triangle is among those of its own
    assert np.all(np.any(back == np.arange(len(across))[:, None, None], axis=2))


def test_open_edges_run_round_the_rim_in_the_sense_of_the_sheet():
    mesh = surfaces.disc(2.0, 5)
    rim = boundary_edges(mesh.triangles)
    assert len(rim) == 30
    assert np.all(np.cross(mesh.nodes[rim[:, 0]], mesh.nodes[rim[:, 1]])[:, 2] > 0.0)
    assert np.array_equal(np.sort(np.unique(rim)), np.sort(mesh.nodes_of("rim")))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("mesh", [torus, lambda order: surfaces.sphere(1.0, 5, order=order)], ids=["torus", "sphere"])
def test_triangles_turned_at_random_are_turned_back(mesh, order):
    right = mesh(order=order)
    rng = np.random.default_rng(3)
    for share in (0.1, 0.5, 0.9, 1.0):
        wrong = turned(right, np.flatnonzero(rng.random(len(right.triangles)) < share))
        again = turned(wrong, outward_flips(wrong.nodes, wrong.triangles))
        assert np.array_equal(again.triangles[:, :3].min(axis=1), right.triangles[:, :3].min(axis=1))
        assert is_closed(again.triangles)
        assert enclosed_volume(again.nodes, again.triangles) == pytest.approx(
            enclosed_volume(right.nodes, right.triangles), rel=1e-12
        )


def test_an_open_sheet_keeps_the_side_of_most_of_its_triangles():
    flat = surfaces.rectangle(1.0, 1.0, (4, 4))
    wrong = turned(flat, np.array([3, 17, 40]))
    assert outward_flips(wrong.nodes, wrong.triangles).tolist() == [3, 17, 40]


def test_each_of_two_bodies_is_turned_outward_by_itself():
    mesh = two_spheres()
    half = len(mesh.triangles) // 2
    inward = turned(mesh, half + np.arange(half))
    assert np.array_equal(outward_flips(inward.nodes, inward.triangles), half + np.arange(half))
    assert connected_triangles(mesh.triangles).tolist() == [0] * half + [1] * half


def test_a_moebius_strip_has_one_side():
    found = orientation(moebius().triangles)
    assert not found.orientable.any()
    assert not found.flip.any()
    with pytest.raises(SceneError, match="has one side only, like a Moebius strip; cut it open"):
        check_pressurised(moebius())


def test_patches_end_where_a_rib_meets_the_skin():
    mesh = skin_and_rib()
    found = orientation(mesh.triangles)
    assert found.patch.max() == 2  # the skin on either side of the rib, and the rib
    with pytest.raises(
        SceneError,
        match=r"3 triangles under pressure meet at the edge of nodes \d+ and \d+ \(elements \d+, \d+ and \d+\) and 1 "
        "more edges; leave all but two of each out of the group",
    ):
        check_pressurised(mesh)
    check_pressurised(mesh, mesh.triangles_of("skin"))


def skin_and_rib():
    skin = surfaces.rectangle(2.0, 1.0, (2, 2), diagonals="one-way")
    rib = surfaces.ruled(
        [[[1, 0, 0], [1, 0.5, 0], [1, 1, 0]], [[1, 0, -1], [1, 0.5, -1], [1, 1, -1]]], diagonals="one-way"
    )
    skin = replace(skin, triangle_parts={"skin": skin.triangle_parts["sheet"]})
    return joined([skin, replace(rib, triangle_parts={"rib": rib.triangle_parts["gap_1"]})], 1e-9)


def test_volume_does_not_depend_on_where_the_body_stands():
    mesh = torus()
    polygon = 0.5 * 6 * 0.25 * np.sin(2 * np.pi / 6)  # area of the section, moved round the axis by chords
    here = enclosed_volume(mesh.nodes, mesh.triangles)
    assert here == pytest.approx(polygon * 2.0 * 8 * np.sin(2 * np.pi / 8), rel=0.02)  # union-jack saddles
    there = enclosed_volume(mesh.nodes + np.array([300.0, -200.0, 100.0]), mesh.triangles)
    assert there == pytest.approx(here, rel=1e-10)  # 300^3 over 10 times the rounding of doubles
    assert enclosed_volume(mesh.nodes, mesh.triangles[:, ::-1]) == pytest.approx(-here, rel=1e-12)


def test_volume_of_curved_triangles_is_that_of_the_paraboloids_they_are():
    """z = 1 - x^2 - y^2 over a square of side 1 around the origin, whose triangles of second order are exact."""
    flat = surfaces.rectangle(1.0, 1.0, (3, 3), order=2)
    nodes = flat.nodes - [0.5, 0.5, 0.0]
    nodes[:, 2] = 1.0 - nodes[:, 0] ** 2 - nodes[:, 1] ** 2
    under = (nodes[flat.triangles][:, :3, 2]).mean(axis=1)
    vectors = area_vectors(nodes, flat.triangles)
    assert vectors.sum(axis=0) == pytest.approx([0.0, 0.0, 1.0], abs=1e-14)  # its projections
    # 1/3 int x . n dA = 1/3 int (z - x z_x - y z_y) dx dy = 1/3 (1 + 1/6), about the middle of the nodes
    middle = nodes[np.unique(flat.triangles)].mean(axis=0)
    expected = (1.0 + 1.0 / 6.0 - middle[2]) / 3.0
    assert enclosed_volume(nodes, flat.triangles) == pytest.approx(expected, rel=1e-13)
    assert under.min() > 0.0


def test_a_gap_in_a_closed_volume_is_named_by_its_elements():
    mesh = surfaces.sphere(1.0, 3)
    assert check_closed(mesh) == pytest.approx(enclosed_volume(mesh.nodes, mesh.triangles), rel=1e-15)
    left = np.delete(np.arange(72), 10)
    with pytest.raises(
        SceneError, match=r"sphere: the surface of a closed volume is open at elements \d+, \d+ and \d+; "
    ):
        check_closed(mesh, left)
    with pytest.raises(
        SceneError, match=r"the normals of the closed volume of elements 1, 2, .* point inward; turn them"
    ):
        check_closed(turned(mesh, np.arange(72)))
    with pytest.raises(
        SceneError, match="the normal of element 8 points to the other side than the neighbours'; turn it"
    ):
        check_closed(turned(mesh, np.array([7])))
    with pytest.raises(SceneError, match="the surface of a closed volume has no triangles"):
        check_closed(mesh, np.zeros(0, dtype=int))


def test_parts_that_share_no_node_are_counted_with_their_sizes():
    many = joined(
        [
            replace(m, nodes=m.nodes + np.array([3.0 * k, 0.0, 0.0]))
            for k, m in enumerate([surfaces.disc(1.0, n) for n in range(1, 7)])
        ]
    )
    with pytest.raises(
        SceneError,
        match=r"falls into 6 parts that share no node \(216 triangles with element 331; 150 triangles with element "
        r"181; 96 triangles with element 85; 54 triangles with element 31 and 2 more\); merge the nodes",
    ):
        check_connected(many)


def texts(nodes, fixed):
    return [str(m) for m in rigid_modes(np.asarray(nodes, float), np.asarray(fixed, bool))]


CUBE = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]


def test_a_free_body_has_three_translations_and_three_rotations():
    assert texts(CUBE, np.zeros((8, 3))) == [
        *(f"translation along {axis}" for axis in "xyz"),
        *(f"rotation about the axis along {axis} through (0.5, 0.5, 0.5) m" for axis in "xyz"),
    ]


def test_a_body_held_at_one_node_turns_about_it_and_at_two_about_their_line():
    held = np.zeros((8, 3))
    held[0] = 1
    # each axis goes through the node, and is told at its point nearest to the middle of the cube
    through = ("(0.5, 0, 0)", "(0, 0.5, 0)", "(0, 0, 0.5)")
    axes = zip("xyz", through, strict=True)
    assert texts(CUBE, held) == [f"rotation about the axis along {a} through {point} m" for a, point in axes]
    held[1] = 1  # the node above
    assert texts(CUBE, held) == ["rotation about the axis along z through (0, 0, 0.5) m"]
    held[2, 0] = 1
    assert texts(CUBE, held) == []


def test_symmetry_planes_leave_the_motions_within_them():
    plane = np.zeros((8, 3))
    plane[:4, 0] = 1  # x = 0 holds x
    found = texts(CUBE, plane)
    assert found[:2] == ["translation along y", "translation along z"]
    assert len(found) == 3
    assert found[2].startswith("rotation about the axis along x")


def test_nodes_on_one_line_have_no_spin_to_hold():
    line = [[0, 0, 0], [1, 1, 0], [2, 2, 0]]
    assert len(texts(line, np.zeros((3, 3)))) == 5
    assert texts(line, [[1, 1, 1], [0, 0, 0], [1, 1, 1]]) == []


def test_a_screw_is_told_with_its_pitch():
    """The screw of pitch h about (1, 1, 1) moves by (z - y + h, x - z + h, y - x + h).

    It does not move along x where y - z = h, along y where z - x = h, along z where x - y = h; five supports there
    leave nothing else.
    """
    h = 0.3
    nodes = np.array(
        [[0.0, h, 0.0], [2.0, h - 1.0, -1.0], [1.0, 5.0, 1.0 + h], [-2.0, 1.0, h - 2.0], [1.0, 1.0 - h, 4.0]]
    )
    held = np.array([[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [0, 0, 1]], dtype=bool)
    (mode,) = rigid_modes(nodes, held)
    assert np.allclose(np.abs(mode.direction), np.sqrt(1.0 / 3.0), rtol=0.0, atol=1e-12)
    assert np.allclose(np.cross(mode.about, mode.direction), 0.0, rtol=0.0, atol=1e-12)  # an axis through the origin
    assert mode.pitch == pytest.approx(h, rel=1e-12)
    assert "with 0.3 m/rad along it" in str(mode)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_rigid_modes_do_not_depend_on_size_place_or_number_of_nodes(size):
    mesh = surfaces.sphere(1.0, 12)
    nodes = size * (mesh.nodes + np.array([10.0, -20.0, 5.0]))
    fixed = np.zeros((len(nodes), 3), dtype=bool)
    pole = mesh.point_parts["pole_z"]
    fixed[pole] = True
    (mode,) = rigid_modes(nodes, fixed)
    assert np.allclose(np.abs(mode.direction), [0, 0, 1], atol=1e-9)
    assert np.allclose(mode.about[:2], size * np.array([10.0, -20.0]), atol=1e-8 * size)


def test_motions_left_are_zero_at_every_support():
    rng = np.random.default_rng(1)
    for _ in range(50):
        nodes = rng.normal(size=(6, 3))
        fixed = rng.random((6, 3)) < 0.15
        held = []
        for mode in rigid_modes(nodes, fixed):
            u = np.broadcast_to(mode.direction, nodes.shape)
            if mode.about is not None:
                u = np.cross(mode.direction, nodes - mode.about) + mode.pitch * mode.direction
            held.append(np.abs(u[fixed]).max(initial=0.0))
        assert max(held, default=0.0) < 1e-9  # rounding over singular values above 1e-8 of random supports
        assert len(held) >= 6 - fixed.sum()


def test_an_airbag_on_its_symmetry_planes_is_held():
    mesh = surfaces.airbag(0.844, 4, "eighth")
    fixed = np.zeros((len(mesh.nodes), 3), dtype=bool)
    fixed[mesh.nodes_of("symmetry_x"), 0] = True
    fixed[mesh.nodes_of("symmetry_y"), 1] = True
    # all of it lies in z = 0, so what moves it along z is free in the first instant
    with pytest.raises(
        SceneError,
        match=r"airbag: the supports leave 3 rigid modes \(translation along z; rotation about the axis along x through"
        r" \(0\.211, 0\.211, 0\) m; rotation about the axis along y .*\); hold more nodes or directions\.",
    ):
        check_supports(mesh, fixed)
    fixed[mesh.nodes_of("seam"), 2] = True
    check_supports(mesh, fixed)


def test_the_part_that_is_loose_is_named():
    mesh = two_spheres()
    fixed = np.zeros((len(mesh.nodes), 3), dtype=bool)
    fixed[mesh.nodes[:, 0] < 2.0] = True
    with pytest.raises(SceneError, match=r"leave 6 rigid modes to the part with element 73 \(translation along x; "):
        check_supports(mesh, fixed)
    near, far = np.argmax(np.where(fixed[:, 0], mesh.nodes[:, 0], -9.0)), np.argmax(mesh.nodes[:, 0])
    with pytest.raises(SceneError, match="leave 3 rigid modes"):  # an anchor on one node at least
        check_supports(mesh, fixed | (np.arange(len(fixed)) == far)[:, None])
    check_supports(mesh, fixed, [np.array([[near, far]])])  # one body with the other, rigidly


def test_a_mesh_of_hundred_thousand_triangles_is_oriented_without_a_loop():
    mesh = surfaces.cylinder(1.0, 20.0, (500, 60))
    assert len(mesh.triangles) > 120000
    wrong = turned(mesh, np.arange(0, len(mesh.triangles), 3))
    assert np.array_equal(outward_flips(wrong.nodes, wrong.triangles), np.arange(0, len(mesh.triangles), 3))


def test_second_order_has_one_middle_node_an_edge():
    mesh = quadratic(torus())
    assert len(mesh.nodes) == len(torus().nodes) + len(edges(mesh.triangles).ends)
    assert areas(mesh.nodes, mesh.triangles).sum() == pytest.approx(
        areas(torus().nodes, torus().triangles).sum(), rel=1e-13
    )


def test_an_empty_mesh_has_no_edges_parts_or_volume():
    none = TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))
    assert len(edges(none.triangles).ends) == 0
    assert not is_closed(none.triangles)
    assert enclosed_volume(none.nodes, none.triangles) == 0.0
    assert len(connected_triangles(none.triangles)) == 0
