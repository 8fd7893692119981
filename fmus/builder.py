"""Builds the structural and the aerodynamic FMU of a scene: one zip each, the same bytes for the same inputs."""

import hashlib
import importlib.util
import io
import json
import os
import platform
import re
import sys
import sysconfig
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pythonfmu

from fmus.adapter import SCENE_FILE, CoreFmu
from fmus.aero_fmu import AeroFmu
from fmus.arrays import array_description
from fmus.description import xml_file
from fmus.documentation import external_dependencies, page
from fmus.documentation.licences import licences
from fmus.documentation.picture import icon
from fmus.documentation.reference import options, reference_tables
from fmus.sharing import PACKAGES
from fmus.structural_fmu import StructuralFmu
from scenes import Scene

NOTICES = ("SOURCES.md", "LICENSE*")  # what is carried of a scene's folder beside the files that it is made of
BINARIES = Path("resources", "binaries")
LINUX = {2: "linux64", 3: "x86_64-linux"}  # version of FMI -> what it calls the platform
# What only building needs, and an FMU does not carry.
BUILDING = {f"fmus/{name}.py" for name in ("arrays", "builder", "host", "ssp")}
BUILDING |= {f"pythonfmu/{name}.py" for name in ("__main__", "csvbuilder", "deploy")}
EPOCH = (1980, 1, 1, 0, 0, 0)  # the first time that zip knows, given to every entry


def build(
    scene: Scene,
    out_dir: str | Path,
    parameters: Mapping[str, Any] | None = None,
    reference: bool = True,
    fmi: int = 2,
) -> tuple[Path, ...]:
    """Paths of `<scene>_structural.fmu` and, where the scene has a flow, `<scene>_aero.fmu`, written to `out_dir` (made
    when missing).

    `parameters` (name -> number or array) become the start values of the parameters of that name in either FMU. A kite
    that is free to pitch starts from its trim angle unless they give one; where there is none, SceneError.
    `reference` solves some steps for the reference results that an FMU carries. With `fmi` = 3 they are FMUs of FMI
    3.0, `<scene>_structural_fmi3.fmu` and `<scene>_aero_fmi3.fmu`, without reference results. ValueError in one
    sentence for a parameter that neither has, for a value that a core refuses, and for another version of FMI.
    """
    if fmi not in (2, 3):
        raise ValueError(f"FMUs are built for FMI 2 or 3, not {fmi}.")
    given = dict(parameters or {})
    sides: tuple[tuple[str, type[CoreFmu]], ...] = (("structural", StructuralFmu), ("aero", AeroFmu))
    sides = sides if scene.has_flow else sides[:1]
    cores = {side: slave.scene_core(scene) for side, slave in sides}
    names = {side: {v.name for v in core.variables if v.causality == "parameter"} for side, core in cores.items()}
    if unknown := sorted(given.keys() - set().union(*names.values())):
        known = ", ".join(sorted(set().union(*names.values()))) or "none"
        raise ValueError(f"Scene {scene.name} has no parameter {unknown[0]!r}; its parameters are {known}.")
    given = scene.with_trim({name: _numbers(name, value) for name, value in given.items()})
    for side in cores:
        for name in given.keys() & names[side]:
            cores[side].set(name, np.array(given[name]))
    tables = reference_tables(scene, given) if reference and fmi == 2 else {}
    contents = {}
    for side, slave in sides:
        own = {name: value for name, value in given.items() if name in names[side]}
        name = f"{scene.name}_{side}" + ("_fmi3" if fmi == 3 else "")
        instance = slave(cores[side], instance_name=name)
        instance.description = f"{slave.title} of the scene {scene.name}"
        files = _scene_files(scene, side, instance, own, name, tables.get(side), fmi)
        contents[name] = archive(name, instance, files, fmi, _unused(scene))
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    return tuple(written(out / f"{name}.fmu", content) for name, content in contents.items())


def _numbers(name: str, value: Any) -> Any:
    """A number or nested lists of numbers, as JSON takes them."""
    try:
        return np.asarray(value, dtype=float).tolist()
    except (TypeError, ValueError):
        raise ValueError(f"Parameter {name!r} takes a number, not {value!r}.") from None


def _scene_files(
    scene: Scene,
    side: str,
    instance: CoreFmu,
    parameters: Mapping[str, Any],
    name: str,
    tables: tuple[str, str] | None,
    fmi: int,
) -> dict[str, bytes]:
    """What the FMU of one side of a scene carries of it: data, documentation, reference results, icon."""
    folder = Path(scene.folder).resolve()
    notices = {path.name for pattern in NOTICES for path in folder.glob(pattern)}
    data = {folder / file for file in {*scene.files, *notices}}
    files = {f"resources/scene/{folder.name}/{path.relative_to(folder).as_posix()}": path.read_bytes() for path in data}
    content = {"folder": f"scene/{folder.name}", "settings": scene.settings, "parameters": parameters}
    text = json.dumps(content, indent=1, sort_keys=True, default=lambda value: value.tolist())
    files[f"resources/{SCENE_FILE}"] = text.encode()
    name = instance.modelName = _identifier(name)
    steps = 0
    if tables is not None:
        steps = tables[0].count("\n") - 1
        files |= {f"documentation/{name}_{k}.csv": t.encode() for k, t in zip(("in", "ref"), tables, strict=True)}
        files[f"documentation/{name}_ref.opt"] = options(steps, scene.communication_step).encode()
    files["documentation/index.html"] = page(instance, scene, side, steps, own_binary() is not None, fmi).encode()
    files["model.png" if fmi == 2 else "terminalsAndIcons/icon.png"] = icon(scene, side)
    return files


def _identifier(name: str) -> str:
    """A C identifier."""
    identifier = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"_{identifier}" if identifier[:1].isdigit() else identifier


def _unused(scene: Scene) -> tuple[str, ...]:
    """Beginnings of the paths of modules that the FMUs of a scene never load."""
    motion = "structural/dynamics/", "scenes/cores/transient"
    return ("structural/solve/pardiso", *(("scenes/cores/statics",) if scene.moves else motion))


def archive(
    name: str, instance: CoreFmu, files: dict[str, bytes], fmi: int = 2, without: tuple[str, ...] = ()
) -> bytes:
    """A complete FMU that makes instances of the class of `instance`, whose start values go into its description.

    `files` (path -> content) are added to the project's packages, PythonFMU, binaries and licences; modules whose path
    begins with one of `without` are left out. ValueError in one sentence for FMI 3 where the binary of this project was
    not compiled.
    """
    instance.modelName = identifier = _identifier(name)
    carried = {path: content for path, content in _package_sources().items() if not path.startswith(without)}
    files = files | {f"resources/{path}": content for path, content in carried.items()}
    script = _script(type(instance))
    stem = script.rpartition("/")[2].removesuffix(".py")
    files[f"resources/{stem}.py"] = files.get(f"resources/{script}") or Path(script).read_bytes()
    files["resources/slavemodule.txt"] = stem.encode()
    files |= {f"binaries/{path}": content for path, content in _binaries(identifier, fmi).items()}
    files.setdefault("documentation/index.html", page(instance, own_binary=own_binary() is not None, fmi=fmi).encode())
    files["documentation/externalDependencies.txt"] = external_dependencies().encode()
    files |= licences(files, {f"binaries/{LINUX[fmi]}/{identifier}.so"} if own_binary() is not None else set())
    digest = hashlib.sha256(_description(instance, "", fmi))
    for path in sorted(files):
        digest.update(path.encode() + b"\0" + hashlib.sha256(files[path]).digest())
    guid = f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"
    return zipped({"modelDescription.xml": _description(instance, guid, fmi)} | dict(sorted(files.items())))


def _pythonfmu() -> Path:
    """The folder of PythonFMU with its binaries; where an FMU brought a copy along, that has none."""
    for place in map(Path, pythonfmu.__path__):
        if (place / BINARIES).is_dir():
            return place
    raise ValueError("The binaries of PythonFMU are not found; install pythonfmu to build FMUs.")


def _script(slave: type[CoreFmu]) -> str:
    """Where the source of a class of slaves is: among the packages that FMUs carry, or elsewhere."""
    package, _, name = slave.__module__.rpartition(".")
    if package == "fmus":
        return f"fmus/{name}.py"
    module = importlib.util.find_spec(slave.__module__)
    if module is None or module.origin is None:
        raise ValueError(f"The source file of {slave.__name__} is not found.")
    return module.origin


def _binaries(identifier: str, fmi: int) -> dict[str, bytes]:
    """Path -> content of what a host loads; on Linux that of this project, where it was compiled with the project."""
    own = own_binary()
    if fmi == 3:
        if own is None:
            raise ValueError(
                "FMUs of FMI 3 need the binary of this project, which is compiled when it is installed on Linux; "
                "install a C compiler (Debian: gcc), then kitecosim again."
            )
        return {f"{LINUX[fmi]}/{identifier}.so": own.read_bytes()}
    found = {}
    for binary in (_pythonfmu() / BINARIES).glob("*/*"):
        found[f"{binary.parent.name}/{identifier}{binary.suffix}"] = binary
    if own is not None:
        found[f"{LINUX[fmi]}/{identifier}.so"] = own
    return {path: binary.read_bytes() for path, binary in found.items()}


def own_binary() -> Path | None:
    """The binary of this project (fmus/binary); None where it was not compiled."""
    path = Path(__file__).with_name(f"_binary{sysconfig.get_config_var('EXT_SUFFIX')}")
    return path if sys.platform == "linux" and platform.machine() == "x86_64" and path.is_file() else None


def _package_sources() -> dict[str, bytes]:
    """Path -> content of the Python files of the solver packages and of PythonFMU that an FMU needs to run."""
    sources = {}
    for name in (*PACKAGES, "pythonfmu"):
        root = _pythonfmu() if name == "pythonfmu" else Path(__file__).parents[1] / name
        if not root.is_dir():
            raise ValueError(f"The sources in {root} are gone, so that no FMU can carry them; start a new process.")
        for path in root.glob("*.py") if name == "pythonfmu" else root.rglob("*.py"):
            inside = f"{name}/{path.relative_to(root).as_posix()}"
            if inside not in BUILDING and not {"tests", "__pycache__", "documentation"} & set(inside.split("/")):
                sources[inside] = path.read_bytes()
    return sources


def _description(instance: CoreFmu, guid: str, fmi: int) -> bytes:
    instance.guid = guid
    return xml_file(instance.to_xml() if fmi == 2 else array_description(instance, guid))


def zipped(files: Mapping[str, bytes]) -> bytes:
    """A zip archive of `files` (path -> content) in their order: the same bytes whenever and wherever it is made."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files.items():
            entry = zipfile.ZipInfo(path, EPOCH)
            entry.create_system = 3  # Unix, also when built elsewhere
            entry.external_attr = (0o755 if path.startswith("binaries/") else 0o644) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return buffer.getvalue()


def written(path: Path, content: bytes) -> Path:
    """Write under a temporary name, then rename, so that no half-written file is ever seen."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
    return path
