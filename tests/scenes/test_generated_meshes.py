"""Generated meshes: areas and volumes in closed form, mirror images, shapes of triangles, and flat patterns."""

from dataclasses import replace

import numpy as np
import pytest

from interface.mirror import mirror_permutation
from scenes import SceneError
from scenes.builders import surfaces
from scenes.builders.mesh import TriangleMesh, joined, mirrored, quadratic, welded
from scenes.builders.mesh_checks import check_connected, check_no_loose_nodes, check_pattern, check_triangles
from scenes.builders.patterns import (
    fibre_angles,
    flat_pattern,
    laid_flat,
    pattern_areas,
    pattern_lengths,
    pattern_of_lengths,
    shortened,
)
from scenes.builders.topology import area_vectors, areas, enclosed_volume, is_closed

GENERATED = {
    "rectangle": lambda order: surfaces.rectangle(2.0, 1.0, (4, 3), order=order),
    "disc": lambda order: surfaces.disc(1.5, 4, order=order),
    "half disc": lambda order: surfaces.disc(1.5, 4, share="half", order=order),
    "quarter disc": lambda order: surfaces.disc(1.5, 4, 4, "quarter", order=order),
    "airbag": lambda order: surfaces.airbag(0.844, 3, order=order),
    "upper airbag": lambda order: surfaces.airbag(0.844, 3, "upper", order=order),
    "airbag eighth": lambda order: surfaces.airbag(0.844, 3, "eighth", order=order),
    "union-jack airbag": lambda order: surfaces.airbag(0.844, 3, diagonals="union-jack", order=order),
    "cylinder": lambda order: surfaces.cylinder(0.2, 1.0, (6, 12), order=order),
    "half cylinder": lambda order: surfaces.cylinder(0.2, 1.0, (6, 12), share="half", order=order),
    "tube": lambda order: surfaces.cylinder(0.2, 1.0, (6, 9), caps=False, diagonals="one-way", order=order),
    "sphere": lambda order: surfaces.sphere(1.5, 4, order=order),
    "sphere eighth": lambda order: surfaces.sphere(1.5, 4, "eighth", order=order),
    "rolled": lambda order: surfaces.rolled_cylinder(1.0, 2.0, (3, 8), order=order)[0],
    "wing": lambda order: surfaces.ruled(wing(), (2, 3), order=order),
}


def wing():
    """Three closed profiles along y, the last of half the chord: a bag with blunt tips."""
    t = np.linspace(0.0, 2.0 * np.pi, 17)
    section = np.stack([0.5 * np.cos(t), 0.0 * t, 0.1 * np.sin(t)], axis=1)
    return [c * section + [0.0, y, 0.0] for c, y in ((1.0, 0.0), (1.0, 1.0), (0.5, 2.0))]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", GENERATED)
def test_generated_meshes_pass_the_checks_of_read_ones(name, order):
    mesh = GENERATED[name](order)
    assert mesh.order == order
    check_triangles(mesh)
    check_no_loose_nodes(mesh)
    check_connected(mesh)
    named = [*mesh.triangle_parts.values()]
    assert np.array_equal(np.sort(np.concatenate(named)), np.arange(len(mesh.triangles)))  # each in one part
    for rows in mesh.line_parts.values():
        assert len(rows)
        assert rows.max() < len(mesh.lines)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", ["airbag", "union-jack airbag", "cylinder", "sphere"])
def test_bodies_are_closed_and_sheets_are_not(name, order):
    mesh = GENERATED[name](order)
    assert is_closed(mesh.triangles)
    assert enclosed_volume(mesh.nodes, mesh.triangles) >= -1e-15  # normals outward; an airbag is flat


def polygon(n, radius):
    return 0.5 * n * radius**2 * np.sin(2.0 * np.pi / n)


def test_a_disc_has_the_area_of_the_polygon_of_its_rim_and_in_second_order_nearly_that_of_the_circle():
    first, second = (
        [areas(m.nodes, m.triangles).sum() for m in (surfaces.disc(1.5, n, order=o) for n in (4, 8))] for o in (1, 2)
    )
    assert first == pytest.approx([polygon(24, 1.5), polygon(48, 1.5)], rel=1e-13)
    off = np.array(second) - np.pi * 1.5**2
    assert abs(off[0]) < 1e-5 * np.pi * 1.5**2
    assert off[0] / off[1] == pytest.approx(16.0, rel=0.05)  # parabolas for arcs: fourth order


def test_a_cylinder_has_the_volume_and_area_of_its_prism():
    mesh = surfaces.cylinder(0.2, 1.0, (6, 12), diagonals="one-way")
    assert enclosed_volume(mesh.nodes, mesh.triangles) == pytest.approx(polygon(12, 0.2), rel=1e-12)
    wall, caps = mesh.triangles_of("wall"), mesh.triangles_of("cap_start", "cap_end")
    area = areas(mesh.nodes, mesh.triangles)
    assert area[wall].sum() == pytest.approx(12 * 2 * 0.2 * np.sin(np.pi / 12), rel=1e-12)
    assert area[caps].sum() == pytest.approx(2 * polygon(12, 0.2), rel=1e-12)
    along = area_vectors(mesh.nodes, mesh.triangles)
    assert along[mesh.triangles_of("cap_start")].sum(axis=0) == pytest.approx([-polygon(12, 0.2), 0, 0], abs=1e-15)
    assert along[mesh.triangles_of("cap_end")].sum(axis=0) == pytest.approx([polygon(12, 0.2), 0, 0], abs=1e-15)


@pytest.mark.parametrize(("order", "rate"), [(1, 2.0), (2, 4.0)])
def test_volumes_of_spheres_and_cylinders_converge_with_their_order(order, rate):
    for make, exact in (
        (lambda n: surfaces.sphere(1.0, n, order=order), 4.0 / 3.0 * np.pi),
        (lambda n: surfaces.cylinder(1.0, 1.0, (n, 6 * n), order=order), np.pi),
    ):
        off = [abs(enclosed_volume(m.nodes, m.triangles) / exact - 1.0) for m in (make(3), make(6), make(12))]
        assert np.log2(off[1] / off[2]) == pytest.approx(rate, abs=0.15)  # towards the limit rate from 3 to 12 cells


SYMMETRIC = {
    "disc": ("disc", (0, 1)), "quarter disc": ("quarter disc", ()), "half disc": ("half disc", (0,)),
    "upper airbag": ("upper airbag", (0, 1)), "sphere": ("sphere", (0, 1, 2)), "cylinder": ("cylinder", (1, 2)),
}  # fmt: skip


def triangle_set(mesh):
    """The triangles as sets of corner points, to 9 digits."""
    return {frozenset(map(tuple, np.round(mesh.nodes[t], 9) + 0.0)) for t in mesh.corners}


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", SYMMETRIC)
def test_meshes_are_their_own_mirror_images(name, order):
    made, axes = SYMMETRIC[name]
    mesh = GENERATED[made](order)
    for axis in axes:
        assert triangle_set(mirrored(mesh, axis)) == triangle_set(mesh)
        swapped = mesh.nodes.copy()
        swapped[:, [1, axis]] = swapped[:, [axis, 1]]  # mirror_permutation is of y
        assert mirror_permutation(swapped) is not None


@pytest.mark.parametrize(("diagonals", "cells", "symmetric"), [("crossed", (3, 5), True), ("union-jack", (4, 6), True),
                                                               ("one-way", (4, 6), False)])  # fmt: skip
def test_diagonals_decide_whether_a_rectangle_is_symmetric_about_its_middle(diagonals, cells, symmetric):
    mesh = surfaces.rectangle(2.0, 3.0, cells, diagonals)
    middle = TriangleMesh(mesh.nodes - [1.0, 1.5, 0.0], mesh.triangles)
    assert len(mesh.triangles) == (4 if diagonals == "crossed" else 2) * cells[0] * cells[1]
    for axis in (0, 1):
        assert (triangle_set(mirrored(middle, axis)) == triangle_set(middle)) == symmetric


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(
    ("part", "whole", "axes"),
    [
        (lambda o: surfaces.disc(1.0, 5, share="half", order=o), lambda o: surfaces.disc(1.0, 5, order=o), (1,)),
        (lambda o: surfaces.disc(1.0, 5, 4, "quarter", o), lambda o: surfaces.disc(1.0, 5, 4, order=o), (0, 1)),
        (
            lambda o: surfaces.airbag(1.0, 3, "eighth", order=o),
            lambda o: surfaces.airbag(1.0, 3, "upper", order=o),
            (0, 1),
        ),
        (
            lambda o: surfaces.cylinder(1.0, 2.0, (4, 12), share="half", order=o),
            lambda o: surfaces.cylinder(1.0, 2.0, (4, 12), order=o),
            (1,),
        ),
        (lambda o: surfaces.sphere(1.0, 3, "eighth", o), lambda o: surfaces.sphere(1.0, 3, order=o), (0, 1, 2)),
    ],
    ids=["half disc", "quarter disc", "airbag", "half cylinder", "eighth of a sphere"],
)
def test_a_part_and_its_mirror_images_are_the_whole(part, whole, axes, order):
    mesh = part(order)
    assert all(np.any(mesh.nodes[:, a] == 0.0) and mesh.nodes[:, a].min() == 0.0 for a in axes)  # exactly
    for a in axes:
        plane = "symmetry_" + "xyz"[a]
        assert np.array_equal(mesh.nodes_of(plane), np.flatnonzero(mesh.nodes[:, a] == 0.0))
    for a in axes:
        mesh = joined([mesh, mirrored(mesh, a)], 1e-9)
    assert triangle_set(mesh) == triangle_set(whole(order))
    assert len(mesh.nodes) == len(whole(order).nodes)


@pytest.mark.parametrize("sectors", [4, 6])
@pytest.mark.parametrize("rings", [2, 5, 18])
def test_discs_have_no_slender_triangles(sectors, rings):
    """Beside the sector lines of fine meshes triangles have legs of one ring and 2 pi / sectors of it."""
    mesh = surfaces.disc(1.0, rings, sectors)
    assert len(mesh.triangles) == sectors * rings**2
    limit = np.degrees(np.arctan(sectors / (2.0 * np.pi)))
    assert 0.0 < smallest_angle(mesh) - limit < 20.0 / rings  # chords for arcs: first order in the angle of a base


def smallest_angle(mesh):
    """Degrees."""
    x = mesh.nodes[mesh.corners]
    sides = [(x[:, (k + 1) % 3] - x[:, k], x[:, (k + 2) % 3] - x[:, k]) for k in range(3)]
    cosines = [np.einsum("mk,mk->m", a, b) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1) for a, b in sides]
    return np.degrees(np.arccos(np.max(cosines)))


def test_the_airbag_has_the_triangles_and_points_of_the_thesis():
    for cells, count in ((2, 16), (4, 64), (6, 144), (10, 400), (50, 10000)):
        mesh = surfaces.airbag(0.844, cells, "eighth")
        assert len(mesh.triangles) == count
    places = {"centre": (0, 0), "mid_x": (0.422, 0), "mid_y": (0, 0.422), "corner": (0.422, 0.422)}
    for name, (x, y) in places.items():
        assert mesh.nodes[mesh.point_parts[name]] == pytest.approx(np.array([[x, y, 0.0]]), abs=1e-15)
    seam = mesh.nodes[mesh.nodes_of("seam")]
    assert np.all(np.abs(np.max(seam[:, :2], axis=1) - 0.422) < 1e-15)


def test_the_sheets_of_an_airbag_share_their_seam_only():
    mesh = surfaces.airbag(1.0, 4)
    upper, lower = (np.unique(mesh.triangles[mesh.triangles_of(name)]) for name in ("upper", "lower"))
    assert np.array_equal(np.intersect1d(upper, lower), mesh.nodes_of("seam"))
    up, down = (area_vectors(mesh.nodes, mesh.triangles[mesh.triangles_of(n)])[:, 2] for n in ("upper", "lower"))
    assert up.min() > 0.0 > down.max()


def test_ruled_surfaces_have_the_area_of_the_trapezoids_between_their_profiles():
    left, right = np.array([[0.0, 0, 0], [2, 0, 0]]), np.array([[0.5, 3.0, 0], [1.5, 3.0, 0]])
    mesh = surfaces.ruled([left, right], 5, stations=4)
    assert areas(mesh.nodes, mesh.triangles).sum() == pytest.approx(4.5, rel=1e-13)
    assert len(mesh.lines_of("profile_1")) == 4
    assert len(mesh.lines_of("first")) == 5


def test_a_ruled_surface_that_ends_in_a_point_loses_its_collapsed_triangles():
    base, tip = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.tile([1.0, 2.0, 0.0], (3, 1))
    mesh = surfaces.ruled([base, tip], 2, diagonals="one-way")
    assert areas(mesh.nodes, mesh.triangles).sum() == pytest.approx(2.0, rel=1e-13)
    assert len(mesh.triangles) == 6
    assert "profile_2" not in {k for k, rows in mesh.line_parts.items() if len(rows)}


def test_closed_profiles_close_and_profiles_with_other_points_meet_by_arc_length():
    t = np.linspace(0.0, 2.0 * np.pi, 9)
    square = np.array([[1.0, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1], [1, 0, 1]])
    circle = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    mesh = surfaces.ruled([circle, square], 3, stations=8)
    assert len(mesh.line_parts["profile_1"]) == 8
    assert np.array_equal(mesh.nodes_of("first"), mesh.nodes_of("last"))
    with pytest.raises(ValueError, match="profiles have 9, 5 points; give all the same number, two or more, or say st"):
        surfaces.ruled([circle, square], 3)


def test_conforming_strips_share_the_nodes_of_the_profile_between_them():
    mesh = surfaces.ruled(wing(), (2, 3))
    one, other = (np.unique(mesh.triangles[mesh.triangle_parts[name]]) for name in ("gap_1", "gap_2"))
    assert np.array_equal(np.intersect1d(one, other), mesh.nodes_of("profile_2"))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("diagonals", ["crossed", "one-way", "union-jack"])
def test_a_cylinder_rolled_from_its_flat_pattern_keeps_all_lengths(diagonals, order):
    mesh, pattern = surfaces.rolled_cylinder(1.0, 2.0, (4, 8), diagonals, order)
    flat, rolled = (np.linalg.norm(p[:, :, None] - p[:, None], axis=3) for p in (pattern, mesh.nodes[mesh.triangles]))
    assert rolled == pytest.approx(flat, rel=1e-12, abs=1e-15)
    assert pattern_areas(pattern).sum() == pytest.approx(2.0, rel=1e-12)
    assert np.allclose(area_vectors(mesh.nodes, mesh.triangles).sum(axis=0), 0.0, atol=1e-12)
    middle = mesh.nodes[mesh.corners].mean(axis=1) * [0.0, 1.0, 1.0]
    assert np.all(np.einsum("mk,mk->m", middle, area_vectors(mesh.nodes, mesh.triangles)) > 0.0)  # outward


@pytest.mark.parametrize("order", [1, 2])
def test_a_triangle_laid_flat_keeps_its_sides_and_area(order):
    mesh = surfaces.sphere(1.0, 3, order=order)
    pattern = laid_flat(mesh.nodes, mesh.triangles)
    assert pattern.shape == (72, 3 * order, 2)
    corners = mesh.nodes[mesh.corners]
    assert pattern_lengths(pattern) == pytest.approx(np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2), rel=1e-13)
    assert pattern_areas(pattern) == pytest.approx(areas(mesh.nodes, mesh.corners), rel=1e-12)
    assert np.all(pattern[:, 0] == 0.0)
    assert np.all(np.abs(pattern[:, 1, 1]) < 1e-15)
    again = pattern_of_lengths(pattern_lengths(pattern))
    assert again == pytest.approx(pattern[:, :3], abs=1e-14)


def test_shortening_changes_lengths_in_its_direction_only():
    mesh = surfaces.rectangle(2.0, 1.0, (2, 2))
    pattern = flat_pattern(mesh.nodes, mesh.triangles)
    cut = shortened(pattern, 0.96)
    assert np.ptp(cut[:, :, 0]) == pytest.approx(0.96 * 2.0, rel=1e-14)
    assert cut[:, :, 1] == pytest.approx(pattern[:, :, 1], rel=1e-14)
    turned = shortened(pattern, 0.96, 1.02, 0.5 * np.pi)
    assert np.ptp(turned[:, :, 1]) == pytest.approx(0.96, rel=1e-14)
    assert np.ptp(turned[:, :, 0]) == pytest.approx(1.02 * 2.0, rel=1e-14)
    slanted = shortened(pattern, 0.9, 1.1, np.full(16, 0.3))
    assert pattern_areas(slanted) == pytest.approx(0.99 * pattern_areas(pattern), rel=1e-13)
    line = np.array([np.cos(0.3), np.sin(0.3)])
    assert shortened(np.array([[[0.0, 0.0], line, [-line[1], line[0]]]]), 0.9, 1.1, 0.3)[0, 1:] == pytest.approx(
        np.array([0.9 * line, 1.1 * np.array([-line[1], line[0]])]), rel=1e-14
    )
    some = shortened(pattern, np.where(np.arange(16) < 8, 1.0, 0.97))
    assert np.array_equal(some[:8], pattern[:8])
    with pytest.raises(ValueError, match="factors of a pattern must be above zero; the least is -1"):
        shortened(pattern, -1.0)


def test_lengths_that_make_no_triangle_are_refused_with_their_elements():
    mesh = surfaces.rectangle(1.0, 1.0, (2, 2))
    lengths = pattern_lengths(laid_flat(mesh.nodes, mesh.triangles))
    lengths[[4, 7], 0] = 3.0
    with pytest.raises(
        SceneError,
        match=r"rectangle: the pattern of elements 5 and 8 is no triangle \(sides of 3, 0\.3536 and 0\.3536 m of the "
        r"first: each must be shorter than the other two together\); correct",
    ):
        pattern_of_lengths(lengths, mesh)
    for bad in ([0.0, 1.0, 1.0], [1.0, np.nan, 1.0], [1.0, 2.0, 3.0]):
        with pytest.raises(SceneError, match=r"pattern: the pattern of element 1 is no triangle"):
            pattern_of_lengths(np.array([bad]))


def test_an_inverted_or_empty_pattern_is_refused_with_its_elements():
    mesh = surfaces.rectangle(1.0, 1.0, (2, 2))
    pattern = laid_flat(mesh.nodes, mesh.triangles)
    check_pattern(mesh, pattern)
    wrong = pattern.copy()
    wrong[3] = wrong[3, ::-1]
    with pytest.raises(SceneError, match="rectangle: the pattern of element 4 has its corners clockwise; correct it"):
        check_pattern(mesh, wrong)
    wrong[6, 2] = wrong[6, 1]
    with pytest.raises(SceneError, match="rectangle: the pattern of element 7 has no area; correct it"):
        check_pattern(mesh, wrong)


def test_a_fibre_direction_goes_with_the_material_into_the_pattern():
    mesh, pattern = surfaces.rolled_cylinder(1.0, 2.0, (4, 8))
    assert fibre_angles(mesh, pattern, [1.0, 0.0, 0.0]) == pytest.approx(0.0, abs=1e-13)  # the axis is x of the sheet
    middle = mesh.nodes[mesh.corners].mean(axis=1)
    around = np.stack([0.0 * middle[:, 0], middle[:, 2], -middle[:, 1]], axis=1)
    assert fibre_angles(mesh, pattern, around) == pytest.approx(0.5 * np.pi, abs=0.14)  # chords: within their own turn
    flat = surfaces.rectangle(1.0, 1.0, (2, 2))
    own = laid_flat(flat.nodes, flat.triangles)
    weave = np.array([np.cos(0.4), np.sin(0.4), 0.0])
    first = flat.nodes[flat.triangles[:, 1]] - flat.nodes[flat.triangles[:, 0]]
    side = np.arctan2(first[:, 1], first[:, 0])
    found = fibre_angles(flat, own, weave)
    assert np.cos(found + side - 0.4) == pytest.approx(1.0, rel=1e-12)


def test_a_fibre_normal_to_its_element_is_refused():
    mesh = surfaces.cylinder(1.0, 1.0, (2, 4), caps=True)
    pattern = laid_flat(mesh.nodes, mesh.triangles)
    with pytest.raises(
        SceneError, match=r"cylinder: the fibre direction is normal to elements \d+, .*, so it has no angle there; give"
    ):
        fibre_angles(mesh, pattern, [1.0, 0.0, 0.0])


def test_welding_leaves_loose_nodes_and_parts_as_they_were():
    flat = surfaces.rectangle(1.0, 1.0, (2, 2))
    lonely = replace(flat, nodes=np.concatenate([flat.nodes, [[9.0, 9.0, 9.0]]]))
    same = welded(lonely, 1e-9)
    assert np.array_equal(same.nodes, lonely.nodes)
    assert np.array_equal(same.triangles, lonely.triangles)
    assert all(np.array_equal(same.line_parts[k], rows) for k, rows in lonely.line_parts.items())


def test_meshes_of_different_order_are_not_joined():
    with pytest.raises(ValueError, match="elements of first and of second order cannot be joined"):
        joined([surfaces.disc(1.0, 2), surfaces.disc(1.0, 2, order=2)])


def test_middle_nodes_go_where_they_are_projected():
    flat = surfaces.rectangle(1.0, 1.0, (3, 3))

    def bowl(middle, ends):
        assert middle == pytest.approx(flat.nodes[ends].mean(axis=1), abs=1e-15)
        return middle + np.array([0.0, 0.0, 0.1])

    mesh = quadratic(flat, bowl)
    assert np.all(mesh.nodes[mesh.triangles[:, 3:]][:, :, 2] == 0.1)
    assert np.all(mesh.nodes[mesh.corners][:, :, 2] == 0.0)
    assert quadratic(mesh) is mesh


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: surfaces.rectangle(0.0, 1.0, (1, 1)), "length must be a finite number above zero; it is 0"),
        (lambda: surfaces.rectangle(1.0, 1.0, (0, 1)), "cells must be whole numbers of 1 or more; there is 0"),
        (lambda: surfaces.rectangle(1.0, 1.0, (1, 1), "best"), "diagonals cannot be 'best'; choose one of: crossed"),
        (lambda: surfaces.rectangle(1.0, 1.0, (1, 1), order=3), "the order of triangles is 1 or 2, not 3"),
        (lambda: surfaces.disc(1.0, 3, 5, "half"), "sectors of a half disc must be 4 or more, even; there are 5"),
        (lambda: surfaces.disc(1.0, 3, 6, "quarter"), "sectors of a quarter disc must be a multiple of four"),
        (lambda: surfaces.disc(1.0, 3, 2), "sectors of a whole disc must be 4 or more; there are 2"),
        (lambda: surfaces.disc(1.0, 3, share="third"), "share cannot be 'third'; choose one of: whole, half, quarter"),
        (lambda: surfaces.airbag(1.0, 2, diagonals="one-way"), "diagonals of a whole airbag must be crossed or union"),
        (lambda: surfaces.cylinder(1.0, 1.0, (2, 7)), "a cylinder with caps needs a multiple of 4, 6 or 10"),
        (lambda: surfaces.cylinder(1.0, 1.0, (2, 3), False), "a cylinder needs four cells around it or more"),
        (lambda: surfaces.cylinder(1.0, 1.0, (2, 7), False, "half"), "half a cylinder needs an even number of cells"),
        (lambda: surfaces.ruled([[[0, 0, 0], [1, 0, 0]]]), "a ruled surface needs two profiles or more"),
        (lambda: surfaces.ruled(wing(), (1, 2, 3)), "strips has 3 numbers for 2 gaps between profiles"),
    ],
)  # fmt: skip
def test_sizes_that_make_no_mesh_are_refused(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()
