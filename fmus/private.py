"""The code that FMUs carry, and its private name.

A process has a module of a name once. So that neither modules of the host nor those of an FMU of another version take
the place of an FMU's own, all its packages stand in one whose name is made of their content, and import each other by
that name: the same code has the same name, and is loaded once.
"""

import ast
import hashlib
import re
from pathlib import Path

import pythonfmu

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


class _Files(importlib.abc.MetaPathFinder, importlib.abc.InspectLoader):
    """Finds and loads the modules of this package: name in it -> path, content, whether it is a package."""

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


def _read(folder):
    found = {}
    for path in sorted(folder.rglob("*.py")):
        *above, stem = path.relative_to(folder).with_suffix("").parts
        name = ".".join(above if stem == "__init__" else [*above, stem])
        found[name] = str(path), path.read_bytes(), stem == "__init__"
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
'''
LOOK = "__import__('{root}').package_of(__import__('os').path.dirname(__file__))\n"


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
            if not inside.startswith(LEFT_OUT) and "__pycache__" not in inside:
                found[inside] = path.read_bytes()
    return dict(sorted(found.items()))


def private_name(code: dict[str, bytes]) -> str:
    """The name of the package that holds this code."""
    digest = hashlib.sha256(ROOT.encode())
    for path, content in code.items():
        digest.update(path.encode() + b"\0" + hashlib.sha256(content).digest())
    return f"kitecosim_{digest.hexdigest()[:8]}"


def private_code(code: dict[str, bytes], root: str) -> dict[str, bytes]:
    """Path -> content of the code under its private name."""
    inside = {f"{root}/{path}": rewritten(content, root) for path, content in code.items()}
    return {f"{root}/__init__.py": ROOT.encode(), **inside}


# Statements that import what is carried, one package each: from it, by its own name, or under another.
_NAME = rf"(?:{'|'.join(CARRIED)})"
_FROM = re.compile(rf"^([ \t]*)from ({_NAME}(?:\.\w+)*) import ", re.MULTILINE)
_PLAIN = re.compile(rf"^([ \t]*)import ({_NAME})(?=[ \t]*(?:#.*)?$)", re.MULTILINE)
_RENAMED = re.compile(rf"^([ \t]*)import ({_NAME}(?:\.\w+)*) as ", re.MULTILINE)
_OTHER = re.compile(rf"^[ \t]*import (?:[\w., \t]+,[ \t]*)?{_NAME}\b", re.MULTILINE)


def rewritten(source: bytes, root: str) -> bytes:
    """A module whose imports of packages that FMUs carry are those of the private ones. ValueError for an import that
    binds such a package by a dotted name, or beside others, which has no private form of one statement.
    """
    text = _FROM.sub(rf"\1from {root}.\2 import ", source.decode())
    text = _PLAIN.sub(rf"\1from {root} import \2", text)
    text = _RENAMED.sub(rf"\1import {root}.\2 as ", text)
    if left := _OTHER.search(text):
        raise ValueError(f"'{left[0].strip()}' cannot be made private: import one package a line, or from it.")
    return text.encode()


def script_of(source: bytes, root: str) -> bytes:
    """A script that uses packages which FMUs carry, as it stands in an FMU."""
    tree = ast.parse(source)
    first = 1 if ast.get_docstring(tree, clean=False) is not None else 0
    while isinstance(tree.body[first], ast.ImportFrom) and getattr(tree.body[first], "module", "") == "__future__":
        first += 1
    lines = rewritten(source, root).decode().splitlines(keepends=True)
    at = tree.body[first].lineno - 1
    return "".join([*lines[:at], LOOK.format(root=root), *lines[at:]]).encode()
