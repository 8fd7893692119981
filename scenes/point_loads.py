"""Dead loads on single nodes that a scene offers as parameters."""

import numpy as np

from .tables import SceneError, name, number, read_table

_COLUMNS = {"load": name, "node": name, "x": number, "y": number, "z": number}


def read_loads(scene):
    """Parameter name -> list of (node index, direction (3,)) from the table of [structure] loads; empty without one."""
    file = scene.content["structure"]["loads"]
    given = scene.content["structure"]["load_values"]
    if file is None:
        if given:
            raise SceneError(f"{scene.name}/scene.toml: [structure] load_values needs a table of 'loads'; add it.")
        return {}
    table = read_table(scene.folder / file, _COLUMNS)
    out: dict[str, list[tuple[int, np.ndarray]]] = {}
    for row, load in enumerate(table["load"]):
        if not load.isidentifier():
            raise SceneError(f"{table.at(row)}: '{load}' cannot name a parameter; use letters, digits and _.")
        node = scene.members.node(table["node"][row], table.at(row))
        direction = np.array([table[axis][row] for axis in "xyz"])
        if not direction.any():
            raise SceneError(f"{table.at(row)}: load '{load}' has no direction; correct x, y, z.")
        out.setdefault(load, []).append((node, direction / np.linalg.norm(direction)))
    if unknown := sorted(given.keys() - out.keys()):
        raise SceneError(
            f"{scene.name}/scene.toml: [structure] load_values names '{unknown[0]}', which is not in {file}; there "
            f"are: {', '.join(out)}."
        )
    return out


def content_load(scene, load):
    """Start value N of a load: what [structure.load_values] says, else none."""
    return float(scene.content["structure"]["load_values"].get(load, 0.0))
