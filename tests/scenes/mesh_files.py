"""Meshes written to files in the formats that users have."""

import numpy as np

GMSH = {1: 15, 2: 1, 3: 2, 4: 3, 6: 9, 10: 21}  # nodes of an element -> Gmsh's number of its type; tetra below
TETRA, LINE3 = 4, 8


def msh2(path, nodes, elements, names=()):
    """A Gmsh 2.2 file of `nodes` (n,3) and `elements`, (group number, nodes from 1) or (group, nodes, Gmsh's type),
    with the `names` of groups as (dimension, number, name).
    """
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    if names:
        text += ["$PhysicalNames", str(len(names)), *(f'{d} {k} "{name}"' for d, k, name in names), "$EndPhysicalNames"]
    text += ["$Nodes", str(len(nodes))]
    text += [f"{k + 1} {x!r} {y!r} {z!r}" for k, (x, y, z) in enumerate(np.asarray(nodes, float).tolist())]
    text += ["$EndNodes", "$Elements", str(len(elements))]
    for k, (group, of, *kind) in enumerate(elements):
        number = kind[0] if kind else GMSH[len(of)]
        text.append(f"{k + 1} {number} 2 {group} 1 {' '.join(map(str, of))}")
    path.write_text("\n".join([*text, "$EndElements", ""]))
    return path


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
HALVES = [(1, (1, 2, 3)), (1, (1, 3, 4))]


def written(path, mesh, **options):
    """A file of a TriangleMesh by meshio, in the format of the path's ending."""
    import meshio

    cells = [("triangle6" if mesh.order == 2 else "triangle", mesh.triangles)]
    data = {}
    if len(mesh.lines):
        cells.append(("line3" if mesh.order == 2 else "line", mesh.lines))
    if options.pop("groups", False):
        blocks, fields = [], {}
        for d, (parts, count) in (
            (2, (mesh.triangle_parts, len(mesh.triangles))),
            (1, (mesh.line_parts, len(mesh.lines))),
        ):
            tags = np.zeros(count, dtype=int)
            for name, rows in parts.items():
                fields[name] = np.array([len(fields) + 1, d])
                tags[rows] = len(fields)
            blocks.append(tags)
        data = {"cell_data": {"gmsh:physical": blocks, "gmsh:geometrical": blocks}, "field_data": fields}
    meshio.Mesh(mesh.nodes, cells, **data).write(path, **options)
    return path


def msh4(path, mesh, binary):
    """A Gmsh 4.1 file of a TriangleMesh as Gmsh writes it: one entity with one physical group for each of its parts."""
    kinds = ((2, mesh.triangles, mesh.triangle_parts, {3: 2, 6: 9}), (1, mesh.lines, mesh.line_parts, {2: 1, 3: 8}))
    parts = [(d, of[rows], codes[of.shape[1]], name) for d, of, named, codes in kinds for name, rows in named.items()]
    out = []

    def put(*blocks, newline=True):
        for values, kind in blocks:
            values = np.atleast_1d(np.asarray(values))
            out.append(
                values.astype(kind).tobytes() if binary else " ".join(map(repr, values.tolist())).encode() + b" "
            )
        if newline or not binary:
            out.append(b"" if binary else b"\n")

    def section(name, *texts):
        out.append(f"${name}\n".encode() + b"".join(t.encode() + b"\n" for t in texts))

    def end(name):
        out.append(b"\n" * binary + f"$End{name}\n".encode())

    section("MeshFormat", f"4.1 {int(binary)} 8")
    if binary:
        put((1, "i4"))
    end("MeshFormat")
    section("PhysicalNames", str(len(parts)), *(f'{d} {k + 1} "{n}"' for k, (d, _, _, n) in enumerate(parts)))
    end("PhysicalNames")
    section("Entities")
    lines, surfaces = ([k for k, part in enumerate(parts) if part[0] == d] for d in (1, 2))
    put(([0, len(lines), len(surfaces), 0], "u8"))
    for k in [*lines, *surfaces]:
        put((k + 1, "i4"), (np.zeros(6), "f8"), (1, "u8"), (k + 1, "i4"), (0, "u8"))
    end("Entities")
    n = len(mesh.nodes)
    section("Nodes")
    put(([1, n, 1, n], "u8"))
    put(([2, surfaces[0] + 1, 0], "i4"), (n, "u8"))
    put((1 + np.arange(n), "u8"))
    put((mesh.nodes.ravel(), "f8"))
    end("Nodes")
    count = sum(len(of) for _, of, _, _ in parts)
    section("Elements")
    put(([len(parts), count, 1, count], "u8"))
    number = 0
    for k, (d, of, code, _) in enumerate(parts):
        put(([d, k + 1, code], "i4"), (len(of), "u8"))
        tags = number + 1 + np.arange(len(of))
        put((np.column_stack([tags, of + 1]).ravel(), "u8"))
        number += len(of)
    end("Elements")
    path.write_bytes(b"".join(out))
    return path
