"""The licences that an FMU carries, and the page that says which of them covers what."""

import contextlib
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

from fmus.description import PROJECT
from fmus.private import PACKAGES

# Package -> its licence and the name of the file with the text.
TEXTS = {PROJECT: ("BSD-3-Clause", f"{PROJECT}.txt"), "pythonfmu": ("MIT", "pythonfmu.txt")}
FOLDER = "documentation/licenses"
ENTRY = """Which licence covers what in this FMU

{rows}

All paths are those inside the FMU.
"""


def licences(paths: Iterable[str], own_binaries: Iterable[str]) -> dict[str, bytes]:
    """Path -> content: license.txt, where FMI has one begin, and the texts of the project and of PythonFMU as far as
    they are installed with them.

    `paths` is what the FMU has else, `own_binaries` those of its binaries that are compiled from this project.
    """
    paths, own = sorted(paths), set(own_binaries)
    found = {name: text for name in TEXTS if (text := _text(name)) is not None}
    named = {name: licence + (f", {FOLDER}/{file}" if name in found else "") for name, (licence, file) in TEXTS.items()}
    code = [path for path in paths if path.startswith("resources/") and path.endswith(".py")]
    inside = {"/".join(path.split("/")[:3]) for path in code if path.count("/") > 2}
    solvers = sorted(path for path in inside if path.rpartition("/")[2] in PACKAGES)
    scripts = [path for path in code if path.count("/") == 1]
    binaries = [path for path in paths if path.startswith("binaries/")]
    rows = [
        (f"the solvers ({', '.join(solvers)})", named[PROJECT]),
        *((path, named[PROJECT]) for path in (*scripts, *(path for path in binaries if path in own))),
        *((f"PythonFMU ({path})", named["pythonfmu"]) for path in sorted(inside) if path.endswith("/pythonfmu")),
        *((f"{path}, of PythonFMU", named["pythonfmu"]) for path in binaries if path not in own),
        *_scene(paths),
        ("modelDescription.xml, documentation and picture", f"made from the above; the texts are {named[PROJECT]}"),
    ]
    files = {f"{FOLDER}/{TEXTS[name][1]}": text for name, text in found.items()}
    entry = ENTRY.format(rows="\n".join(f"* {what}: {how}" for what, how in rows))
    return files | {f"{FOLDER}/license.txt": entry.encode()}


def _scene(paths: list[str]) -> list[tuple[str, str]]:
    """The data of a scene, and the notices that came with it."""
    data = [path for path in paths if path.startswith("resources/scene.")]
    notices = [path for path in paths if path.startswith("documentation/scene/")]
    how = ", ".join(notices) or "no notice came with it; ask who made it"
    return [(f"the scene's data ({', '.join(data)})", how)] if data else []


def _text(package: str) -> bytes | None:
    with contextlib.suppress(metadata.PackageNotFoundError):
        for file in metadata.distribution(package).files or []:
            if file.name == "LICENSE" and ".dist-info" in str(file.parent):
                return Path(str(file.locate())).read_bytes()
    return None
