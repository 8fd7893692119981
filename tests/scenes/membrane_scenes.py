"""Small scenes with membranes, written for a test."""

from pathlib import Path

import numpy as np

import scenes

ISOTROPIC = "[membranes.fabrics.sheet]\nstiffness = 1e5\npoisson = 0.0\n"


def written(folder, membranes, structure="gravity = 0.0", **files):
    """The folder of a scene `sheet` whose scene.toml has this [membranes] and [structure]; further files by name, with
    `_csv` for .csv.
    """
    path = Path(folder) / "sheet"
    path.mkdir(exist_ok=True)
    (path / "scene.toml").write_text(f"[structure]\n{structure}\n\n[membranes]\n{membranes}\n")
    for name, content in files.items():
        (path / name.replace("_csv", ".csv")).write_text(content)
    return path


def solved(folder, settings=None, **parameters):
    """The structural core of a scene after a step with these parameters or inputs."""
    core = scenes.load(folder, settings or {}).structural_core()
    for name, value in parameters.items():
        core.set(name, np.broadcast_to(value, core.get(name).shape))
    core.step(0.0, 1.0)
    return core


def rectangle(cells=4, length=2.0, width=1.0, keys="", fabric=ISOTROPIC, more=""):
    """[membranes] of a rectangle with `keys` of its own, its fabric and `more` tables."""
    size = f"[membranes.size]\nlength = {length}\nwidth = {width}\ncells = {cells}\n"
    return f'shape = "rectangle"\n{keys}\n{size}{fabric}{more}'


def held(*groups, axes="xyz"):
    """[membranes.supports] of groups that are held."""
    return "[membranes.supports]\n" + "".join(f'{group} = "{axes}"\n' for group in groups)
