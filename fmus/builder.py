"""Builds the structural and the aerodynamic FMU of a scene: one zip each, the same bytes for the same inputs."""

import functools
import hashlib
import importlib.util
import io
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

from fmus.adapter import CoreFmu
from fmus.aero_fmu import AeroFmu
from fmus.arrays import array_description
from fmus.description import xml_file
from fmus.documentation import external_dependencies, page
from fmus.documentation.licences import licences
from fmus.documentation.picture import icon
from fmus.documentation.reference import options, reference_tables
from fmus.private import (
    BINARIES,
    SCRIPT,
    libraries,
    private_code,
    private_name,
    pythonfmu_folder,
    script_of,
    sources,
    unchanged,
)
from fmus.stored_scene import scene_files
from fmus.structural_fmu import StructuralFmu
from scenes import Scene

NOTICES = ("SOURCES.md", "LICENSE*")  # what is carried of a scene's folder
# Methods for the flow whose needs are known, and where their code stands.
OWN_METHODS = {"vortex-step": "aero/vortex_step/", "panel": "aero/panel/"}
# What only scenes with membranes load, beginnings of paths.
MEMBRANES = (
    *("structural/elements/membrane", "structural/materials/membranes", "structural/loads/curved_faces"),
    *("structural/triangles", "scenes/cores/membranes"),
)
LINUX = {2: "linux64", 3: "x86_64-linux"}  # version of FMI -> what it calls the platform
EPOCH = (1980, 1, 1, 0, 0, 0)  # the first time that zip knows, given to every entry
LOADED: tuple[str, dict[str, bytes]] = ("", {})  # private name of this process's own code, and module -> content


def build(
    scene: Scene,
    out_dir: str | Path,
    parameters: Mapping[str, Any] | None = None,
    reference: bool = True,
    fmi: int = 2,
    cores: Mapping[str, Any] | None = None,
) -> tuple[Path, ...]:
    """Paths of `<scene>_structural.fmu` where the scene has a structure, and `<scene>_aero.fmu` where it has a flow,
    written to `out_dir` (made when missing).

    `parameters` (name -> number or array) become the start values of the parameters of that name in either FMU. A kite
    that is free to pitch starts from its trim angle unless they give one; where there is none, SceneError.
    `reference` solves some steps for the reference results that an FMU carries. With `fmi` = 3 they are FMUs of FMI
    3.0, `<scene>_structural_fmi3.fmu` and `<scene>_aero_fmi3.fmu`, without reference results. ValueError in one
    sentence for a parameter that neither has, for a value that a core refuses, and for another version of FMI. `cores`
    of this scene (side -> core) that made no step yet save building some.
    """
    if fmi not in (2, 3):
        raise ValueError(f"FMUs are built for FMI 2 or 3, not {fmi}.")
    given = dict(parameters or {})
    sides: tuple[tuple[str, type[CoreFmu]], ...] = (("structural", StructuralFmu), ("aero", AeroFmu))
    has = {"structural": scene.has_structure, "aero": scene.has_flow}
    sides = tuple((side, slave) for side, slave in sides if has[side])
    cores = dict(cores or {side: slave.scene_core(scene) for side, slave in sides})
    names = {side: {v.name for v in core.variables if v.causality == "parameter"} for side, core in cores.items()}
    if unknown := sorted(given.keys() - set().union(*names.values())):
        known = ", ".join(sorted(set().union(*names.values()))) or "none"
        raise ValueError(f"Scene {scene.name} has no parameter {unknown[0]!r}; its parameters are {known}.")
    given = scene.with_trim({name: _numbers(name, value) for name, value in given.items()}, cores)
    for side in cores:
        for name in given.keys() & names[side]:
            cores[side].set(name, np.array(given[name]))
    tables = reference_tables(scene, given, cores) if reference and fmi == 2 else {}
    contents = {}
    for side, slave in sides:
        own = {name: value for name, value in given.items() if name in names[side]}
        name = f"{scene.name}_{side}" + ("_fmi3" if fmi == 3 else "")
        instance = slave(cores[side], instance_name=name)
        instance.description = f"{slave.title} of the scene {scene.name}"
        files = _scene_files(scene, side, instance, own, name, tables.get(side), fmi)
        contents[name] = archive(name, instance, files, fmi, _unused(scene, side))
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
    found = [path for pattern in NOTICES for path in folder.glob(pattern)]
    notices = sorted({p.name for p in found if p.is_file() and p.resolve().parent == folder})  # none from elsewhere
    files = {f"documentation/scene/{name}": (folder / name).read_bytes() for name in notices}
    files |= {f"resources/{path}": content for path, content in scene_files(scene, side, parameters).items()}
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


def _unused(scene: Scene, side: str) -> tuple[str, ...]:
    """Beginnings of the paths of modules that the FMU of one side of a scene never loads: methods that it does not
    name, and what is known not to be needed, unless its method is not one of this project's own.
    """
    method = "" if scene.aero is None else scene.aero.method
    own = "__init__.py", f"{method.replace('-', '_')}.py"
    files = (path.name for path in (Path(__file__).parents[1] / "aero/methods").glob("*.py"))
    others = tuple(f"aero/methods/{name}" for name in files if name not in own)
    return others if method not in ("", *OWN_METHODS) else (*others, *_other_side(scene, side))


def _other_side(scene: Scene, side: str) -> tuple[str, ...]:
    method = "" if scene.aero is None or side != "aero" else scene.aero.method
    flow = tuple(folder for name, folder in OWN_METHODS.items() if name != method)
    if side == "aero":
        cores = "statics", "transient", "structur", "tapes", "holding", "symmetry"
        return (*flow, "structural/", *(f"scenes/cores/{name}" for name in cores))
    motion = "structural/dynamics/", "scenes/cores/transient"
    solved = ("scenes/cores/statics",) if scene.transient else motion
    return (
        "structural/solve/pardiso",
        "aero/polars",
        *flow,
        "scenes/cores/flow",
        *solved,
        *(() if scene.members.membranes else MEMBRANES),
    )


def archive(
    name: str, instance: CoreFmu, files: dict[str, bytes], fmi: int = 2, without: tuple[str, ...] = ()
) -> bytes:
    """A complete FMU that makes instances of the class of `instance`, whose start values go into its description.

    `files` (path -> content) are added to the project's packages, PythonFMU, binaries and licences; modules whose path
    begins with one of `without` are left out. ValueError in one sentence for FMI 3 where the binary of this project was
    not compiled.
    """
    instance.modelName = identifier = _identifier(name)
    root, code = _code()
    code = {path: content for path, content in code.items() if not path.partition("/")[2].startswith(without)}
    files = files | {f"resources/{path}": content for path, content in code.items()}
    stem, script = _script(type(instance), root)
    files |= {f"resources/{stem}.py": script, "resources/slavemodule.txt": stem.encode()}
    files |= {f"binaries/{path}": content for path, content in _binaries(identifier, fmi).items()}
    files.setdefault("documentation/index.html", page(instance, own_binary=own_binary() is not None, fmi=fmi).encode())
    files["documentation/externalDependencies.txt"] = external_dependencies().encode()
    files |= licences(files, {f"binaries/{LINUX[fmi]}/{identifier}.so"} if own_binary() is not None else set())
    description = _description(instance, "", fmi)
    digest = hashlib.sha256(description)
    for path in sorted(files):
        digest.update(path.encode() + b"\0" + hashlib.sha256(files[path]).digest())
    guid = f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"
    of_it = b'guid="' if fmi == 2 else b'instantiationToken="'
    described = description.replace(of_it + b'"', of_it + guid.encode() + b'"', 1)
    return zipped({"modelDescription.xml": described} | dict(sorted(files.items())))


def _code() -> tuple[str, dict[str, bytes]]:
    """The name of the private package, and path -> content of the files in it."""
    global LOADED
    found = sources()
    compiled = {path: _without_search_path(file.read_bytes()) for path, file in libraries().items()}
    root = private_name(found | compiled)
    code = _private(root, tuple(found.items())) | {f"{root}/{path}": content for path, content in compiled.items()}
    if not LOADED[0] and unchanged():
        LOADED = root, {_module_name(path): content for path, content in code.items()}
    return root, code


def _module_name(path: str) -> str:
    """What the private package calls a file: the name of a module, the path in it of others."""
    name = path.partition("/")[2]
    if not name.endswith(".py"):
        return name
    return name.removesuffix(".py").removesuffix("__init__").rstrip("/").replace("/", ".")


@functools.lru_cache(maxsize=1)
def _private(root: str, code: tuple[tuple[str, bytes], ...]) -> dict[str, bytes]:
    return private_code(dict(code), root)


def _script(slave: type[CoreFmu], root: str) -> tuple[str, bytes]:
    """Name and content of the module that a host makes instances from. What has other content has another name, since
    a process has a module of a name once.
    """
    package, _, stem = slave.__module__.rpartition(".")
    if package == "fmus":
        text = SCRIPT.format(title=slave.title, root=root, module=slave.__module__, name=slave.__name__)
        return f"{stem}_{root.rpartition('_')[2]}", text.encode()
    module = importlib.util.find_spec(slave.__module__)
    if module is None or module.origin is None:
        raise ValueError(f"The source file of {slave.__name__} is not found.")
    content = script_of(Path(module.origin).read_bytes(), root)
    return f"{stem}_{hashlib.sha256(content).hexdigest()[:8]}", content


def _binaries(identifier: str, fmi: int) -> dict[str, bytes]:
    """Path -> content of what a host loads; on Linux that of this project, where it was compiled with the project."""
    own = own_binary()
    if fmi == 3:
        if own is None:
            raise ValueError(
                "FMUs of FMI 3 need the binary of this project, which is compiled when it is installed on Linux; "
                "install a C compiler (Debian: gcc), then kitecosim again."
            )
        return {f"{LINUX[fmi]}/{identifier}.so": _without_search_path(own.read_bytes())}
    found = {}
    for binary in (pythonfmu_folder() / BINARIES).glob("*/*"):
        found[f"{binary.parent.name}/{identifier}{binary.suffix}"] = binary
    content = {path: binary.read_bytes() for path, binary in found.items()}
    if own is not None:
        content[f"{LINUX[fmi]}/{identifier}.so"] = _without_search_path(own.read_bytes())
    return content


def _without_search_path(binary: bytes) -> bytes:
    """A binary without the folders of this machine that its Python was told to look for libraries in."""
    flags = " ".join(str(sysconfig.get_config_var(name) or "") for name in ("LDSHARED", "LDFLAGS"))
    for folder in re.findall(r"-Wl,-rpath[,=]([^\s,]+)", flags):
        binary = binary.replace(folder.encode() + b"\0", b"\0" * (len(folder) + 1))
    return binary


def own_binary() -> Path | None:
    """The binary of this project (fmus/binary); None where it was not compiled."""
    path = Path(__file__).with_name(f"_binary{sysconfig.get_config_var('EXT_SUFFIX')}")
    return path if sys.platform == "linux" and platform.machine() == "x86_64" and path.is_file() else None


def _description(instance: CoreFmu, guid: str, fmi: int) -> bytes:
    instance.guid = guid
    return xml_file(instance.to_xml() if fmi == 2 else array_description(instance, guid))


def guid(path: Path) -> str:
    """The guid of an FMU that was built here."""
    with zipfile.ZipFile(path) as file:
        found = re.search(rb'(?:guid|instantiationToken)="([^"]*)"', file.read("modelDescription.xml"))
    return found[1].decode() if found else ""


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
    except OSError as error:  # of a full disk it does not say where
        raise type(error)(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        part.unlink(missing_ok=True)
    return path
