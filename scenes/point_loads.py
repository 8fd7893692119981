"""Dead loads on single nodes that a scene offers as parameters."""

import numpy as np

from .tables import SceneError, name, number, read_table

_COLUMNS = {"load": name, "node": name, "x": number, "y": number, "z": number}


def read_loads(scene):
    """Parameter name -> list of (node index, direction (3,)) from the table of [structure] loads; empty without one."""
    file = scene.content["structure"]["loads"]
    values = scene.content["structure"]["load_values"]
    if file is None:
        _check_values(scene, values, ())
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
    _check_values(scene, values, out)
    return out


def _check_values(scene, values, known):
    """`SceneError` for a value of a load that is not in the table."""
    for load in values:
        if load not in known:
            there = f"there are: {', '.join(known)}" if known else "there are none; name a table of 'loads'"
            raise SceneError(
                f"{scene.name}/scene.toml: [structure] load_values names the load '{load}', which is not in the table "
                f"of loads; {there}."
            )


def content_load(scene, load):
    """Start value N of a load: what [structure.load_values] says, else none."""
    return float(scene.content["structure"]["load_values"].get(load, 0.0))
