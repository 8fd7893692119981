"""The code that FMUs carry, and its private name.

A process has a module of a name once. So that neither modules of the host nor those of an FMU of another version take
the place of an FMU's own, all its packages stand in one whose name is made of their content, and import each other by
that name: the same code has the same name, and is loaded once.
"""

import ast
import hashlib
import platform
import re
import sys
import sysconfig
from importlib.util import decode_source
from pathlib import Path
from typing import Any

import pythonfmu

from interface import LOADED_AT

PACKAGES = ("interface", "structural", "aero", "scenes", "fmus")
CARRIED = (*PACKAGES, "pythonfmu")
BINARIES = Path("resources", "binaries")
# What only reading scenes and building needs, and an FMU does not carry: beginnings of paths.
LEFT_OUT = (
    "scenes/readers/", "scenes/builders/", "scenes/checks.py", "fmus/documentation/",
    *(f"fmus/{name}.py" for name in ("arrays", "builder", "host", "private", "ssp")),
    *(f"pythonfmu/{name}" for name in ("__main__.py", "csvbuilder.py", "deploy.py", "tests/")),
)  # fmt: skip
ROOT = '''"""The solvers of kitecosim as this FMU carries them, under a name made of their content.

Files are read at once and kept: the folder of an FMU may be deleted while its modules are in use, and FMUs that carry
different parts of the same code complete each other. Code that was changed in an FMU gets a package of its own.
"""

import hashlib
import importlib
import importlib.abc
import importlib.util
import sys
from pathlib import Path

BUILT_AS = Path(__file__).parent.name  # what the modules call this package


class _Files(importlib.abc.MetaPathFinder, importlib.abc.InspectLoader, importlib.abc.ResourceLoader):
    """Finds and loads the modules of this package: name in it -> path, content, whether it is a package. Compiled
    libraries have their path in it for a name.
    """

    def __init__(self, known):
        self.known = known

    def find_spec(self, name, path=None, target=None):
        root, _, inner = name.partition(".")
        if root == __name__ and inner in self.known:
            place, _, package = self.known[inner]
            spec = importlib.util.spec_from_file_location(name, place, loader=self)
            spec.submodule_search_locations = [] if package else None  # its modules are found here, not in a folder
            return spec

    def is_package(self, name):
        return self.known[name.partition(".")[2]][2]

    def get_source(self, name):
        return self.known[name.partition(".")[2]][1].decode().replace(BUILT_AS, __name__)

    def get_code(self, name):
        return compile(self.get_source(name), self.known[name.partition(".")[2]][0], "exec", dont_inherit=True)

    def get_data(self, path):
        for place, content, _ in self.known.values():
            if place == path:
                return content
        raise FileNotFoundError(path)


def _read(folder):
    found = {}
    for path in sorted(folder.rglob("*.py")):
        *above, stem = path.relative_to(folder).with_suffix("").parts
        name = ".".join(above if stem == "__init__" else [*above, stem])
        found[name] = str(path), path.read_bytes(), stem == "__init__"
    for path in sorted(folder.rglob("*.so")):
        found[path.relative_to(folder).as_posix()] = str(path), path.read_bytes(), False
    return found


def package_of(resources):
    """The package with the code in the resources of an FMU."""
    folder = Path(resources, BUILT_AS)
    carried = _read(folder)
    if all(_files.known.get(name, file)[1] == file[1] for name, file in carried.items()):
        _files.known = carried | _files.known
        return sys.modules[__name__]
    digest = hashlib.sha256(b"".join(name.encode() + file[1] for name, file in carried.items()))
    name = f"{BUILT_AS}_{digest.hexdigest()[:8]}"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, folder / "__init__.py")
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


def require(resources):
    """Take in the code beside a script, whose imports name this package."""
    if package_of(resources) is not sys.modules[__name__]:
        raise ImportError(f"the code in {Path(resources, BUILT_AS)} was changed; build the FMU anew from its sources.")


def module(name):
    """A module of the solvers. A process that has built FMUs of the same code has it loaded, under its usual name."""
    built, code = getattr(sys.modules.get("fmus.builder"), "LOADED", ("", {}))
    loaded = built == __name__ and all(code.get(name, b"") == file[1] for name, file in _files.known.items())
    return importlib.import_module(name if loaded else f"{__name__}.{name}")


_files = _Files(_read(Path(__file__).parent))
__path__ = []
sys.meta_path.append(_files)
'''
SCRIPT = '''"""{title}: the class that a host makes instances of."""

from pathlib import Path

from {root} import package_of


def slave_class(resources):
    """The class, of the code in these resources."""
    return package_of(resources).module("{module}").{name}


class {name}(slave_class(Path(__file__).parent)):
    """See {module}."""

    def __new__(cls, **given):
        """An instance of the code in the given resources, which may be other than those of this file. PythonFMU's
        binary needs a class with a method of its own: without one it releases the module once too often.
        """
        return slave_class(given["resources"])(**given)
'''
LOOK = "__import__('{root}').require(__import__('os').path.dirname(__file__))\n"


def pythonfmu_folder() -> Path:
    """The folder of PythonFMU with its binaries; where an FMU brought a copy along, that has none."""
    for place in map(Path, pythonfmu.__path__):
        if (place / BINARIES).is_dir():
            return place
    raise ValueError("The binaries of PythonFMU are not found; install pythonfmu to build FMUs.")


def sources() -> dict[str, bytes]:
    """Path -> content of the Python files of the solver packages and of PythonFMU that an FMU needs to run."""
    found = {}
    for name in CARRIED:
        root = pythonfmu_folder() if name == "pythonfmu" else Path(__file__).parents[1] / name
        if not root.is_dir():
            raise ValueError(f"The sources in {root} are gone, so that no FMU can carry them; start a new process.")
        for path in root.rglob("*.py"):
            inside = f"{name}/{path.relative_to(root).as_posix()}"
            if not inside.startswith(LEFT_OUT) and "__pycache__" not in inside and not path.name.startswith("."):
                found[inside] = path.read_bytes()
    return dict(sorted(found.items()))


def libraries() -> dict[str, Path]:
    """Path among the sources -> file of what is compiled with the project and loaded by its solvers, where it was: the
    kernels of the panel method (aero/panel/kernels.py) for Linux.
    """
    path = Path(__file__).parents[1] / f"aero/panel/_kernels{sysconfig.get_config_var('EXT_SUFFIX')}"
    here = sys.platform == "linux" and platform.machine() == "x86_64" and path.is_file()
    return {"aero/panel/_kernels.so": path} if here else {}


def unchanged() -> bool:
    """Whether this process has loaded the code as its files are now, as far as the times of these tell."""
    folders = [Path(__file__).parents[1] / name for name in PACKAGES]
    files = [*(path for folder in folders for path in folder.rglob("*.py")), *libraries().values()]
    return all(path.stat().st_mtime < LOADED_AT for path in files)


def private_name(code: dict[str, bytes]) -> str:
    """The name of the package that holds this code."""
    digest = hashlib.sha256(ROOT.encode())
    for path, content in code.items():
        digest.update(path.encode() + b"\0" + hashlib.sha256(content).digest())
    return f"kitecosim_{digest.hexdigest()[:8]}"


def private_code(code: dict[str, bytes], root: str) -> dict[str, bytes]:
    """Path -> content of the code under its private name."""
    inside = {f"{root}/{path}": rewritten(content, root, path) for path, content in code.items()}
    return {f"{root}/__init__.py": ROOT.encode(), **inside}


# Lines that import something; of these, what is carried: from it, by its own name, or under another.
_NAME = rf"(?:{'|'.join(CARRIED)})"
_LINE = re.compile(r"^[ \t]*(?:from|import)[ \t].*$", re.MULTILINE)
_FROM = re.compile(rf"([ \t]*)from ({_NAME}(?:\.\w+)*) import ")
_PLAIN = re.compile(rf"([ \t]*)import ({_NAME})(?=[ \t]*(?:#.*)?$)")
_RENAMED = re.compile(rf"([ \t]*)import ({_NAME}(?:\.\w+)*) as ")
# What the lines above may miss.
_PUBLIC = re.compile(rf"[ \t]*(?:from|import)[ \t]+(?!\.).*\b{_NAME}\b")
_INNER = re.compile(r"[;:][ \t]*(?:import|from)[ \t]|import_module\([\"']")


def rewritten(source: bytes, root: str, path: str = "a module") -> bytes:
    """A module, in UTF-8, whose imports of packages that FMUs carry are those of the private ones. ValueError, with
    file and line, for an import that has no private form of one statement.
    """
    missed = False

    def private(line: re.Match[str]) -> str:
        nonlocal missed
        for pattern, form in ((_FROM, rf"\1from {root}.\2 import "), (_PLAIN, rf"\1from {root} import \2"),
                              (_RENAMED, rf"\1import {root}.\2 as ")):  # fmt: skip
            text, count = pattern.subn(form, line[0], count=1)
            if count:
                return text
        missed = missed or _PUBLIC.match(line[0]) is not None
        return line[0]

    text = _LINE.sub(private, decode_source(source))
    if missed or _INNER.search(text):  # perhaps; the syntax tree knows
        for node in ast.walk(ast.parse(text)):
            row = getattr(node, "lineno", 1)
            if names := [name for name in _imported(node) if name.partition(".")[0] in CARRIED]:
                raise ValueError(
                    f"{path} line {row}: no FMU can carry this import of '{names[0]}'; write it as "
                    f"'from {names[0]} import NAME' on a line of its own."
                )
    return text.encode()


def _imported(node: Any) -> list[str]:
    """What a statement, or a call of import_module, imports by absolute names."""
    match node:
        case ast.ImportFrom(module=str(module), level=0):
            return [module]
        case ast.Import(names=names):
            return [name.name for name in names]
        case ast.Call(func=ast.Attribute(attr="import_module") | ast.Name(id="import_module" | "__import__"),
                      args=[ast.Constant(value=str(name)), *_]):  # fmt: skip
            return [name]
    return []


def script_of(source: bytes, root: str) -> bytes:
    """A script that uses packages which FMUs carry, as it stands in an FMU."""
    source = decode_source(source).encode()
    tree = ast.parse(source)
    first = 1 if ast.get_docstring(tree, clean=False) is not None else 0
    while isinstance(tree.body[first], ast.ImportFrom) and getattr(tree.body[first], "module", "") == "__future__":
        first += 1
    lines = rewritten(source, root).decode().splitlines(keepends=True)
    at = tree.body[first].lineno - 1
    return "".join([*lines[:at], LOOK.format(root=root), *lines[at:]]).encode()
