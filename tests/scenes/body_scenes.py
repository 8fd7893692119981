"""[body] of scene.toml, written for a test and read."""

import tomllib
from pathlib import Path

from scenes.readers.bodies import read_body
from scenes.readers.description import _checked, _keys_of
from scenes.schema import BodyInput

WING = 'shape = "wing"\nprofile = "0012"\npanels = 24\nspan = 6.0\nchord = 1.0\nstrips = 6\n'
BOX = (
    'shape = "box-wing"\nprofile = "naca 0012"\npanels = 24\nspan = 12.0\nchord = 1.0\nheight = 2.4\n'
    "corner_radius = 0.15\nstrips = 5\nplate_strips = 2\n"
)
HEADER = "x_m,y_m,z_m,chord_m,twist_deg,roll_deg,profile\n"


def body(folder, text, **files):
    """What read_body makes of a section [body] in a folder `wing` with `files`, by name with `_` for the dot."""
    path = Path(folder) / "wing"
    path.mkdir(exist_ok=True)
    for name, content in files.items():
        (path / name.replace("_", ".")).write_text(content)
    given = _checked("wing/scene.toml", "body", _keys_of(BodyInput), tomllib.loads(text))
    return read_body(path, BodyInput(**given))
