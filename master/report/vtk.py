"""The final state as VTK files (.vtu) for ParaView: wing surface, structure, exposed lines.

Points are those of the result; `displacement_m` leads there from the design shape (Warp By Vector with factor -1 goes
back). `node`, `panel`, `element` and `line` count from 1, as the rows of the CSV tables do.
"""

from itertools import groupby
from typing import Any

import numpy as np

from master.coupling.participants.private_folder import PrivateFolder
from master.report.membranes import MembraneState
from master.report.state import Frame, Surface

KINDS = {"spring": 0, "line": 1, "rope over sheaves": 2, "tube": 3, "canopy": 4}  # numbers of the cell data `kind`


def wing_file(surface: Surface) -> bytes:
    """The wing: quads (triangles where a panel repeats its last index) with the fields of `PanelLoads`.

    Points are the interface nodes that panels use, cells keep the order of the panels.
    """
    nodes, corners = np.unique(surface.panels, return_inverse=True)
    corners = corners.reshape(surface.panels.shape)
    triangle = corners[:, 2] == corners[:, 3]
    blocks = [list(rows) for _, rows in groupby(range(len(corners)), key=lambda i: bool(triangle[i]))]
    cells = [("triangle", corners[rows, :3]) if triangle[rows[0]] else ("quad", corners[rows]) for rows in blocks]
    data = {"panel": np.arange(1, len(corners) + 1)} | surface.loads.fields()
    return _vtu(
        surface.position[nodes],
        cells,
        {"node": nodes + 1, "displacement_m": (surface.position - surface.reference)[nodes]},
        {name: [values[rows] for rows in blocks] for name, values in data.items()},
    )


def structure_file(frame: Frame) -> bytes:
    """The elements as lines, a rope over sheaves as its legs: tension_N, slack (1 or 0), kind (0 spring, two-way;
    1 line; 2 rope over sheaves; 4 canopy, tension only), rest_length_m, length_m, strain and axial_stiffness_N (EA) of
    the whole element, its number.

    With the parts of the tubes of an inflatable wing behind them (kind 3; `tube` counts them, `element` is 0):
    tube_load, the bending moment over that of collapse, and tube_strain, both 0 elsewhere.
    """
    legs, element = frame.legs
    sheaves = np.array([len(chain) > 2 for chain in frame.chains])
    kind = np.where(frame.two_way, KINDS["spring"], np.where(sheaves, KINDS["rope over sheaves"], KINDS["line"]))
    kind = np.where(frame.canopy, KINDS["canopy"], kind)
    data = {
        "element": np.arange(1, len(frame.chains) + 1),
        "tension_N": frame.tension,
        "slack": frame.slack.astype(np.int64),
        "kind": kind,
        "rest_length_m": frame.rest_length,
        "length_m": frame.length,
        "strain": frame.strain,
        "axial_stiffness_N": frame.axial_stiffness,
    }
    points = {
        "node": np.arange(1, len(frame.position) + 1),
        "displacement_m": frame.position - frame.reference,
        "fixed": frame.supports.astype(np.int64),
    }
    cells = {name: values[element] for name, values in data.items()}
    if frame.tubes is not None:
        tubes = frame.tubes
        cells |= dict.fromkeys(("tube", "tube_load", "tube_strain"), np.zeros(len(legs)))
        own = {
            "tube": np.arange(1, len(tubes.names) + 1),
            "kind": np.full(len(tubes.names), KINDS["tube"]),
            "rest_length_m": tubes.rest_length,
            "length_m": tubes.length,
            "tube_load": tubes.load,
            "tube_strain": tubes.strain,
        }
        cells["tube"] = cells["tube"].astype(np.int64)
        legs, none = np.concatenate([legs, tubes.ends]), np.zeros(len(tubes.names))
        cells = {k: np.concatenate([v, own.get(k, none.astype(v.dtype))]) for k, v in cells.items()}
    return _vtu(frame.position, [("line", legs)], points, {name: [values] for name, values in cells.items()})


def lines_file(surface: Surface) -> bytes:
    """The lines that stand in the wind with diameter_m, and line_load_N_per_m if there is one."""
    nodes, ends = np.unique(surface.lines, return_inverse=True)
    data = {"line": [np.arange(1, len(surface.lines) + 1)], "diameter_m": [surface.diameter]}
    if surface.line_load is not None:
        data["line_load_N_per_m"] = [surface.line_load]
    points = {"node": nodes + 1, "displacement_m": (surface.position - surface.reference)[nodes]}
    return _vtu(surface.position[nodes], [("line", ends.reshape(surface.lines.shape))], points, data)


def membranes_file(found: MembraneState) -> bytes:
    """The membranes as triangles, of six nodes where they are curved, with the columns of membranes.csv; `fabric`
    counts the fabrics from 1.
    """
    nodes, corners = np.unique(found.nodes, return_inverse=True)
    kind = "triangle" if found.nodes.shape[1] == 3 else "triangle6"
    fabrics = {name: k + 1 for k, name in enumerate(dict.fromkeys(found.fabric))}
    data = {
        "element": np.arange(1, len(found.nodes) + 1),
        "fabric": np.array([fabrics[name] for name in found.fabric]),
        **found.fields(),
    }
    points = {"node": nodes + 1, "displacement_m": (found.position - found.reference)[nodes]}
    cells = [(kind, corners.reshape(found.nodes.shape))]
    return _vtu(found.position[nodes], cells, points, {name: [values] for name, values in data.items()})


def _vtu(points: np.ndarray, cells: Any, point_data: dict[str, np.ndarray], cell_data: dict[str, Any]) -> bytes:
    """Content of a .vtu file, binary and compressed."""
    import meshio

    mesh = meshio.Mesh(np.asarray(points, float), cells, point_data, cell_data)
    with PrivateFolder() as folder:  # meshio writes to paths only
        path = folder / "mesh.vtu"
        mesh.write(path, file_format="vtu")
        return path.read_bytes()
