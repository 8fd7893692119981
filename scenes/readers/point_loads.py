"""Dead loads on single nodes that a scene offers as parameters."""

from pathlib import Path

import numpy as np

from ..members import Members, PointLoad
from ..schema import SceneError, StructureInput
from .tables import name, number, read_table

_COLUMNS = {"load": name, "node": name, "x": number, "y": number, "z": number}


def read_loads(folder: Path, structure: StructureInput, members: Members) -> tuple[PointLoad, ...]:
    """The loads of the table of [structure] loads, in the order in which it names them first; none without one."""
    where, file, given = f"{folder.name}/scene.toml", structure.loads, structure.load_values
    if file is None:
        if given:
            raise SceneError(f"{where}: [structure] load_values needs a table of 'loads'; add it.")
        return ()
    table = read_table(folder / file, _COLUMNS)
    rows: dict[str, list[tuple[int, np.ndarray]]] = {}
    for row, load in enumerate(table["load"]):
        if not load.isidentifier():
            raise SceneError(f"{table.at(row)}: '{load}' cannot name a parameter; use letters, digits and _.")
        node = members.node(table["node"][row], table.at(row))
        direction = np.array([table[axis][row] for axis in "xyz"])
        if not direction.any():
            raise SceneError(f"{table.at(row)}: load '{load}' has no direction; correct x, y, z.")
        rows.setdefault(load, []).append((node, direction / np.linalg.norm(direction)))
    if unknown := sorted(given.keys() - rows.keys()):
        raise SceneError(
            f"{where}: [structure] load_values names '{unknown[0]}', which is not in {file}; there are: "
            f"{', '.join(rows)}."
        )
    return tuple(
        PointLoad(load, np.array([n for n, _ in on]), np.array([d for _, d in on]), given.get(load, 0.0))
        for load, on in rows.items()
    )
