"""Mesh files: what is read of them, and the one sentence for each that cannot be a membrane."""

import subprocess
import sys

import numpy as np
import pytest

from scenes import SceneError
from scenes.builders import surfaces
from scenes.builders.topology import area_vectors, areas, enclosed_volume, is_closed
from scenes.readers.meshes import read_mesh
from tests.scenes.mesh_files import HALVES, LINE3, SQUARE, TETRA, msh2, msh4, written


def same_surface(one, other, digits=1e-12):
    """Whether two meshes have the same corner points, triangle by triangle in their order."""
    return np.allclose(one.nodes[one.triangles], other.nodes[other.triangles], rtol=0.0, atol=digits)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("form", [2, 4])
@pytest.mark.parametrize("binary", [False, True])
def test_gmsh_2_and_4_bring_nodes_elements_and_physical_groups(tmp_path, order, form, binary):
    made = surfaces.airbag(0.844, 3, "eighth", order=order)
    path = tmp_path / "airbag.msh"
    if form == 4:
        msh4(path, made, binary)
    else:
        written(path, made, groups=True, file_format="gmsh22", binary=binary)
    read = read_mesh(path)
    assert same_surface(read, made)
    assert np.array_equal(read.triangles_of("upper"), np.arange(36))
    assert sorted(read.line_parts) == ["seam", "symmetry_x", "symmetry_y"]
    for name, rows in made.line_parts.items():
        expected, found = made.nodes[made.lines[rows]], read.nodes[read.lines[read.lines_of(name)]]
        assert np.allclose(found, expected, rtol=0.0, atol=1e-12)
    assert np.array_equal(read.line_numbers, 37 + np.arange(12))  # after the triangles, as in the file
    assert read.remarks == ()


TWO_SURFACES = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 "canopy"
2 2 "inflated"
$EndPhysicalNames
$Entities
0 0 2 0
1 0 0 0 1 1 0 2 1 2 0
2 0 0 0 1 1 0 1 1 0
$EndEntities
$Nodes
1 4 10 40
2 1 0 4
10
20
30
40
0 0 0
1 0 0
1 1 0
0 1 0
$EndNodes
$Elements
2 2 1 2
2 1 2 1
1 10 20 30
2 2 2 1
2 10 30 40
$EndElements
"""


def test_an_element_of_gmsh_4_may_be_in_two_groups(tmp_path):
    path = tmp_path / "two.msh"
    path.write_text(TWO_SURFACES)
    read = read_mesh(path)
    assert read.triangles_of("canopy").tolist() == [0, 1]
    assert read.triangles_of("inflated").tolist() == [0]


def test_gmsh_2_writes_an_element_once_for_each_of_its_groups(tmp_path):
    names = [(2, 1, "canopy"), (2, 2, "inflated"), (1, 3, "rim"), (1, 4, "held")]
    elements = [(3, (1, 2)), (4, (1, 2)), (1, (1, 2, 3)), (2, (1, 2, 3)), (1, (1, 3, 4))]
    read = read_mesh(msh2(tmp_path / "m.msh", SQUARE, elements, names))
    assert read.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert read.triangle_numbers.tolist() == [3, 5]
    assert read.triangles_of("canopy").tolist() == [0, 1]
    assert read.triangles_of("inflated").tolist() == [0]
    assert read.lines_of("rim").tolist() == read.lines_of("held").tolist() == [0]
    for twice in ((1, (1, 2, 3)), (2, (2, 3, 1)), (0, (1, 2, 3))):  # in one group, from another corner, in none
        with pytest.raises(SceneError, match=r"stands? on the corners of another triangle"):
            read_mesh(msh2(tmp_path / "m.msh", SQUARE, [*HALVES, twice]))


def test_gmsh_4_with_elements_in_no_group_is_answered_with_the_remedy(tmp_path):
    path = tmp_path / "two.msh"
    path.write_text(TWO_SURFACES.replace("2 0 0 0 1 1 0 1 1 0", "2 0 0 0 1 1 0 0 0"))
    with pytest.raises(
        SceneError, match="some elements are in a physical group and others in none; save only those in g"
    ):
        read_mesh(path)


@pytest.mark.parametrize(("ending", "digits"), [(".vtu", 1e-12), (".vtk", 1e-12), (".stl", 1e-6), (".obj", 1e-12),
                                                (".inp", 1e-12), (".ply", 1e-12)])  # fmt: skip
def test_a_sphere_keeps_its_volume_in_every_format(tmp_path, ending, digits):
    made = surfaces.sphere(1.5, 4)
    read = read_mesh(written(tmp_path / f"ball{ending}", made))
    assert is_closed(read.triangles)
    # STL may have single precision
    assert enclosed_volume(read.nodes, read.triangles) == pytest.approx(
        enclosed_volume(made.nodes, made.triangles), rel=digits
    )


def test_triangles_of_six_nodes_come_through_vtk_with_their_curved_sides(tmp_path):
    made = surfaces.disc(2.0, 3, order=2)
    read = read_mesh(written(tmp_path / "disc.vtu", made))
    assert same_surface(read, made)
    assert areas(read.nodes, read.triangles).sum() == pytest.approx(np.pi * 4.0, rel=2e-4)  # parabolas for arcs of 20°


def test_cell_data_of_vtk_name_the_groups_when_asked(tmp_path):
    import meshio

    made = surfaces.rectangle(1.0, 1.0, (2, 2))
    which = np.where(np.arange(16) < 4, 7, 9)
    path = tmp_path / "sheet.vtu"
    meshio.Mesh(made.nodes, [("triangle", made.triangles)], cell_data={"fabric": [which]}).write(path)
    assert read_mesh(path).triangle_parts == {}
    assert read_mesh(path, groups="fabric").triangles_of("7").tolist() == [0, 1, 2, 3]
    with pytest.raises(SceneError, match=r"sheet.vtu has no cell data 'cloth'; there are: 'fabric' \(correct the name"):
        read_mesh(path, groups="cloth")


def test_named_sets_of_abaqus_are_groups(tmp_path):
    path = tmp_path / "sheet.inp"
    path.write_text(
        "*NODE\n1, 0., 0., 0.\n2, 1., 0., 0.\n3, 1., 1., 0.\n4, 0., 1., 0.\n"
        "*ELEMENT, TYPE=S3, ELSET=all\n1, 1, 2, 3\n2, 1, 3, 4\n*ELSET, ELSET=patch\n2\n*NSET, NSET=held\n1, 4\n"
    )
    read = read_mesh(path)
    assert read.triangles_of("patch").tolist() == [1]
    assert read.nodes_of("held").tolist() == [0, 3]


def test_a_group_of_points_holds_their_nodes(tmp_path):
    path = msh2(tmp_path / "m.msh", SQUARE, [(5, (3,)), *HALVES], [(0, 5, "pulley"), (2, 1, "sheet")])
    read = read_mesh(path)
    assert read.point_parts["pulley"].tolist() == [2]
    assert read.triangle_numbers.tolist() == [2, 3]  # as Gmsh counts, the point is element 1


def test_a_group_without_a_name_has_its_number_and_no_number_is_no_group(tmp_path):
    read = read_mesh(msh2(tmp_path / "m.msh", SQUARE, [(4, (1, 2, 3)), (0, (1, 3, 4))]))
    assert {k: v.tolist() for k, v in read.triangle_parts.items()} == {"4": [0]}


def test_a_group_that_is_missing_is_answered_with_those_that_are_there(tmp_path):
    read = read_mesh(msh2(tmp_path / "m.msh", SQUARE, [(2, (1, 2)), *HALVES], [(1, 2, "edge"), (2, 1, "sheet")]))
    with pytest.raises(SceneError, match=r"m\.msh has no surface group 'canopy'; there are: 'sheet' \(name it in the"):
        read.triangles_of("canopy")
    with pytest.raises(SceneError, match=r"m\.msh has no line group 'rim'; there are: 'edge' "):
        read.lines_of("rim")
    with pytest.raises(SceneError, match=r"m\.msh has no group 'rim'; there are: 'edge', 'sheet' "):
        read.nodes_of("rim")


def test_lengths_are_in_the_unit_that_is_said(tmp_path):
    big = msh2(tmp_path / "m.msh", 1000.0 * np.array(SQUARE), HALVES)
    with pytest.raises(
        SceneError, match=r'm\.msh is 1000 m across: its lengths look like mm; say unit = "mm", or unit'
    ):
        read_mesh(big)
    assert np.ptp(read_mesh(big, unit="m").nodes) == pytest.approx(1000.0, rel=1e-15)
    assert np.ptp(read_mesh(big, unit="mm").nodes) == pytest.approx(1.0, rel=1e-15)
    small = msh2(tmp_path / "s.msh", 0.1 * np.array(SQUARE), HALVES)
    with pytest.raises(SceneError, match=r's\.msh is 0\.0001 m across with unit = "mm"; its lengths look like m'):
        read_mesh(small, unit="mm")
    with pytest.raises(SceneError, match=r"unit cannot be 'km'; choose one of: m, cm, mm, ft, in\."):
        read_mesh(small, unit="km")


def test_a_triangle_against_its_neighbours_is_turned_over_and_said(tmp_path):
    nodes = np.array([[i, j, 0.0] for j in range(3) for i in range(3)])
    cells = [(j * 3 + i + 1, j * 3 + i + 2, j * 3 + i + 5, j * 3 + i + 4) for j in range(2) for i in range(2)]
    faces = [(1, t) for a, b, c, d in cells for t in ((a, b, c), (a, c, d))]
    faces[2] = (1, faces[2][1][::-1])
    read = read_mesh(msh2(tmp_path / "m.msh", nodes, faces))
    assert np.all(area_vectors(read.nodes, read.triangles)[:, 2] > 0.0)
    assert len(read.remarks) == 1
    assert "1 of 8 triangles was turned over" in read.remarks[0]
    assert "(element 3)" in read.remarks[0]


def test_a_closed_surface_comes_with_its_normals_outward(tmp_path):
    made = surfaces.sphere(1.0, 2)
    inside_out = written(tmp_path / "ball.vtu", made.__class__(made.nodes, made.triangles[:, ::-1]))
    read = read_mesh(inside_out)
    assert enclosed_volume(read.nodes, read.triangles) > 0.0
    assert "32 of 32 triangles were turned over" in read.remarks[0]


TRIANGLE6 = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]]
BAD = {
    "zero area": ([*SQUARE, [2, 0, 0]], [*HALVES, (1, (1, 2, 5))],
                  "m.msh: element 3 has no area (corners on one line or at one point); mend the mesh there."),
    "zero length": ([*SQUARE, [1, 1, 0]], [*HALVES, (1, (3, 5))], "m.msh: line element 3 has no length; mend"),
    "duplicate": (SQUARE, [*HALVES, (1, (3, 1, 2))],
                  "m.msh: element 3 stands on the corners of another triangle (the first on those of element 1)"),
    "loose": ([*SQUARE, [5, 5, 5], [6, 6, 6]], HALVES,
              "m.msh: nodes 5 and 6 of 6 belong to no triangle and no line; delete such nodes, or drop them by drop_l"),
    "apart": ([*SQUARE, [5, 0, 0], [6, 0, 0], [6, 1, 0]], [*HALVES, (1, (5, 6, 7))],
              "m.msh falls into 2 parts that share no node (2 triangles with element 1; 1 triangle with element 3); "),
    "quad": (SQUARE, [(1, (1, 2, 3, 4))], "m.msh: element 1 is a quad where triangles are asked"),
    "volume": (SQUARE, [*HALVES, (1, (1, 2, 3, 4), TETRA)], "m.msh: element 3 is of the type tetra"),
    "cubic": (np.random.default_rng(0).random((10, 3)), [(1, tuple(range(1, 11)))],
              "m.msh: element 1 is of the type triangle10; "),
    "no triangle": (SQUARE, [(1, (1, 2))], "m.msh has no triangles; a membrane is a surface of triangles"),
    "unknown node": (SQUARE, [(1, (1, 2, 9))], "m.msh is not a readable .msh file"),
    "not finite": ([*SQUARE[:3], [0, np.nan, 0]], HALVES, "m.msh: node 4 is at no finite place within 1e+09 m; "),
    "far off": ([*SQUARE[:3], [0, 1e200, 0]], HALVES, "m.msh: node 4 is at no finite place within 1e+09 m; correct"),
    "mixed order": ([*TRIANGLE6, [1, 1, 0]], [(1, (1, 2, 3, 4, 5, 6)), (1, (2, 7, 3))],
                    "m.msh mixes elements of first and second order (1 triangle, 1 triangle6); save all of one order."),
    "middle off": (TRIANGLE6, [(1, (1, 2, 3, 5, 4, 6))],
                   "m.msh: a middle node of element 1 is off its side (node 5, 0.5 of the length from the middle)"),
    "quarter point": ([*TRIANGLE6[:3], [0.25, 0, 0], *TRIANGLE6[4:]], [(1, (1, 2, 3, 4, 5, 6))],
                      "m.msh: a middle node of element 1 is off its side (node 4, 0.25 of the length from the middle)"),
    "middle not shared": ([*TRIANGLE6, [1, 1, 0], [1, 0.5, 0], [0.5, 1, 0], [0.5, 0.5, 0]],
                          [(1, (1, 2, 3, 4, 5, 6)), (1, (2, 7, 3, 8, 9, 10))],
                          "have a side with the corners of a neighbour's but another middle node"),
    "line of three nodes": ([*SQUARE, [0.5, 0, 0]], [*HALVES, (1, (1, 2, 5), LINE3)],
                            "m.msh mixes elements of first and second order (1 line3, 2 triangle)"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_a_bad_mesh_is_refused_in_one_sentence(tmp_path, what):
    nodes, elements, sentence = BAD[what]
    with pytest.raises(SceneError) as refused:
        read_mesh(msh2(tmp_path / "m.msh", nodes, elements))
    text = str(refused.value)
    assert sentence in text
    assert text.endswith(".")
    assert "\n" not in text
    assert text.startswith(f"{tmp_path.name}/m.msh")


def test_an_element_with_a_node_that_gmsh_skipped_is_named(tmp_path):
    path = msh2(tmp_path / "m.msh", SQUARE, [*HALVES, (1, (1, 2, 7))])
    path.write_text(path.read_text().replace("\n4 0.0 1.0", "\n8 0.0 1.0").replace("1 3 4\n", "1 3 8\n"))
    with pytest.raises(SceneError, match="element 3 has a node that the file does not list; add the node"):
        read_mesh(path)


@pytest.mark.parametrize("ending", [".msh", ".vtu", ".stl", ".obj", ".vtk", ".inp"])
@pytest.mark.parametrize("content", [b"", b"solid nothing\n", b"\x00\xff" * 200, b"$MeshFormat\n2.2 0 8\n"])
def test_a_file_that_is_no_mesh_is_refused_in_one_sentence(tmp_path, ending, content, capsys):
    path = tmp_path / f"m{ending}"
    path.write_bytes(content)
    with pytest.raises(SceneError, match=rf"m\{ending} (is not a readable \{ending} file|has no triangles)"):
        read_mesh(path)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("form", [2, 4])
@pytest.mark.parametrize("binary", [False, True])
def test_a_file_that_ends_too_early_is_refused(tmp_path, form, binary):
    path, made = tmp_path / "m.msh", surfaces.disc(1.0, 4)
    if form == 4:
        msh4(path, made, binary)
    else:
        written(path, made, file_format="gmsh22", binary=binary)
    content = path.read_bytes()
    for share in (0.3, 0.6, 0.9):
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(SceneError, match=r"m\.msh is not a readable \.msh file"):
            read_mesh(path)


def test_a_missing_end_line_costs_nothing_but_a_remark(tmp_path):
    path = msh2(tmp_path / "m.msh", SQUARE, HALVES)
    path.write_text(path.read_text().replace("$EndElements\n", ""))
    read = read_mesh(path)
    assert len(read.triangles) == 2
    assert "its last section has no end line" in read.remarks[0]


def test_unknown_formats_and_missing_files_are_refused(tmp_path):
    (tmp_path / "wing.step").write_text("x")
    with pytest.raises(SceneError, match=r"wing\.step: '\.step' is no format of meshes; save it as \.msh"):
        read_mesh(tmp_path / "wing.step")
    with pytest.raises(SceneError, match=r"wing\.msh does not exist; add the file or correct its name"):
        read_mesh(tmp_path / "wing.msh")


def test_loose_nodes_and_parts_apart_are_taken_where_they_are_allowed(tmp_path):
    nodes, elements, _ = BAD["loose"]
    read = read_mesh(msh2(tmp_path / "m.msh", nodes, elements), drop_loose_nodes=True)
    assert np.array_equal(read.nodes, SQUARE)
    nodes, elements, _ = BAD["apart"]
    assert len(read_mesh(msh2(tmp_path / "m.msh", nodes, elements), parts_may_be_apart=True).triangles) == 3


def test_a_line_keeps_two_sheets_together(tmp_path):
    nodes, elements, _ = BAD["apart"]
    assert len(read_mesh(msh2(tmp_path / "m.msh", nodes, [*elements, (2, (2, 5))])).lines) == 1


def test_meshio_loads_when_a_mesh_file_is_read_and_is_asked_for_where_it_is_missing(tmp_path):
    path = msh2(tmp_path / "m.msh", SQUARE, HALVES)
    script = (
        "import sys\nimport scenes.readers.meshes as r, scenes.builders.surfaces as s\n"
        "s.disc(1.0, 3)\nassert 'meshio' not in sys.modules\n"
        "sys.modules['meshio'] = None\n"
        f"try: r.read_mesh({str(path)!r})\nexcept r.SceneError as e: print(e)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.strip().endswith("is not installed; install it by pip install 'kitecosim[mesh]'.")
    assert len(read_mesh(path).triangles) == 2


def test_no_package_under_the_gpl_is_imported():
    """gmsh makes meshes, but is GPL: reading loads none of it."""
    script = "import sys, scenes.readers.meshes, meshio; print('gmsh' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.parametrize("ending", [".msh", ".vtu", ".stl", ".obj"])
def test_a_damaged_file_is_read_or_refused_in_one_sentence(tmp_path, ending):
    if ending == ".msh":
        path = written(
            tmp_path / "m.msh", surfaces.airbag(1.0, 2, "eighth"), groups=True, file_format="gmsh22", binary=False
        )
    else:
        path = written(tmp_path / f"m{ending}", surfaces.sphere(1.0, 1))
    whole, rng = path.read_bytes(), np.random.default_rng(5)
    refused = []
    for _ in range(100):
        content = bytearray(whole)
        at = rng.integers(len(content))
        if rng.random() < 0.5:
            content[at] = rng.integers(256)
        else:
            del content[at : at + rng.integers(1, 40)]
        path.write_bytes(content)
        try:
            read_mesh(path, unit="m", parts_may_be_apart=True)
        except SceneError as error:
            refused.append(str(error))
    for sentence in refused:
        assert sentence.startswith(f"{tmp_path.name}/m{ending}")
        assert sentence.endswith(".")
        assert "\n" not in sentence
    assert len(refused) > 30  # the rest is a digit of a coordinate, or a comment
