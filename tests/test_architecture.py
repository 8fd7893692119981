"""The rooms of the project and which way imports run between them, read from the sources with ast."""

import ast
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("interface", "structural", "aero", "scenes", "fmus", "master")
COMMAND_LINE = ("master.cli", "master.commands", "master.building", "master.__main__")
LONGEST_FUNCTION = 60  # lines of its body; a module is as long as its subject
STANDARD_LIBRARY = sys.stdlib_module_names | {"__future__"}

# What a room may import of the other rooms, anywhere in a module.
NEIGHBOURS = {
    "interface": set(),
    "structural": {"interface"},
    "aero": {"interface"},
    "scenes": {"interface", "structural", "aero"},
    "fmus": {"interface", "scenes"},
    "master": {"interface"},
}
# What a room may import from outside at module level, that is, whenever it is loaded.
THIRD_PARTY = {
    "interface": {"numpy"},
    "structural": {"numpy", "scipy"},
    "aero": {"numpy", "scipy"},
    "scenes": {"numpy", "scipy"},
    "fmus": {"numpy", "pythonfmu"},
    "master": {"numpy", "scipy", "fmpy"},
}
# What the command line may import on top: the first at module level, the second inside its functions.
COMMAND_LINE_THIRD_PARTY = {"typer", "rich"}
COMMAND_LINE_LAZY_ROOMS = {"scenes", "fmus"}
# What loads only when something is drawn, shown or hot.
ON_DEMAND = ("matplotlib", "meshio", "jinja2", "numba", "rich", "typer")


@dataclass(frozen=True)
class Import:
    """One imported module: its top-level package, where it stands, and whether loading the module loads it."""

    package: str
    line: int
    at_load: bool


def _packages(node, package):
    """Top-level packages that a statement or a call imports; `package` (dotted) resolves relative imports."""
    match node:
        case ast.Import(names=names):
            return [name.name.partition(".")[0] for name in names]
        case ast.ImportFrom(module=module, level=0):
            return [module.partition(".")[0]]
        case ast.ImportFrom(module=module, level=level):
            above = package.split(".")[: len(package.split(".")) - level + 1]
            return [above[0]] if above else [(module or "").partition(".")[0]]
        case ast.Call(func=ast.Name(id="import_module" | "__import__"), args=[ast.Constant(value=str(name)), *_]):
            return [name.partition(".")[0]]
        case ast.Call(func=ast.Attribute(attr="import_module"), args=[ast.Constant(value=str(name)), *_]):
            return [name.partition(".")[0]]
    return []


def _is_type_checking(node):
    return isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


def imports(source, package="room"):
    """All imports of a module, in order of their place in the tree; those in functions are not made at load."""
    found = []

    def walk(node, at_load):
        found.extend(Import(name, node.lineno, at_load) for name in _packages(node, package))
        lazy = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        body_only = node.body if lazy or _is_type_checking(node) else []
        inside = set(map(id, body_only if isinstance(body_only, list) else [body_only]))
        for child in ast.iter_child_nodes(node):
            walk(child, at_load and id(child) not in inside)

    walk(ast.parse(source), True)
    return found


def modules(room):
    """Dotted name -> path of every module of a room, subpackages included."""
    names = {}
    for path in sorted((ROOT / room).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        names[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return names


def room_imports(room):
    """(module name, place as file:line, import) for every import of a room."""
    for name, path in modules(room).items():
        package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        for found in imports(path.read_text(encoding="utf-8"), package):
            yield name, f"{path.relative_to(ROOT)}:{found.line}", found


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_is_a_package_with_modules(room):
    assert room in modules(room), f"{room}/__init__.py is missing"
    assert len(modules(room)) > 1, f"{room}/ holds no module: the rules below would hold for nothing"


@pytest.mark.parametrize(
    ("source", "package", "at_load"),
    [
        ("import numpy as np", "numpy", True),
        ("from scipy.sparse import linalg", "scipy", True),
        ("try:\n    import numba\nexcept ImportError:\n    pass", "numba", True),
        ("class A:\n    import rich", "rich", True),
        ("def f():\n    import scenes", "scenes", False),
        ("def f():\n    if True:\n        from fmus import builder", "fmus", False),
        ("f = lambda: __import__('aero')", "aero", False),
        ("def f(x=__import__('aero')): ...", "aero", True),
        ("if TYPE_CHECKING:\n    import matplotlib", "matplotlib", False),
        ("importlib.import_module('fmus.builder')", "fmus", True),
        ("from . import elements", "room", True),
        ("from .. import aero", "", True),  # leaves the room, and no rule allows ""
    ],
)
def test_the_walk_tells_imports_at_load_from_lazy_ones(source, package, at_load):
    assert [(found.package, found.at_load) for found in imports(source)] == [(package, at_load)]


@pytest.mark.parametrize("room", ROOMS)
def test_imports_between_rooms_run_one_way(room):
    wrong = []
    for name, place, found in room_imports(room):
        allowed = {room} | NEIGHBOURS[room]
        if name in COMMAND_LINE and not found.at_load:
            allowed |= COMMAND_LINE_LAZY_ROOMS
        if found.package in ROOMS and found.package not in allowed:
            wrong.append(f"{place} imports {found.package}")
    assert not wrong, f"{room} may import {sorted(NEIGHBOURS[room]) or 'no other room'}: {wrong}"


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_loads_only_the_libraries_it_always_needs(room):
    wrong = []
    for name, place, found in room_imports(room):
        allowed = STANDARD_LIBRARY | THIRD_PARTY[room] | set(ROOMS)  # rooms: see the test above
        if name in COMMAND_LINE:
            allowed = allowed | COMMAND_LINE_THIRD_PARTY
        if found.at_load and found.package not in allowed:
            wrong.append(f"{place} imports {found.package or 'from outside its package'}")
    assert not wrong, f"{room} may load {sorted(THIRD_PARTY[room])}, the rest goes into the function using it: {wrong}"


@pytest.mark.parametrize("room", ["interface", "structural", "aero", "scenes", "master"])
def test_loading_a_room_loads_no_other_room_and_nothing_that_draws_shows_or_compiles(room):
    names = [name for name in modules(room) if name not in COMMAND_LINE]
    script = (
        "import importlib, sys\n"
        f"for name in {names!r}: importlib.import_module(name)\n"
        "print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    assert not loaded.intersection(ON_DEMAND)
    assert {room} <= loaded.intersection(ROOMS) <= {room} | NEIGHBOURS[room]


def functions(tree):
    """Name and length in lines of the body of every function, without its docstring and what is nested in it."""
    kinds = ast.FunctionDef, ast.AsyncFunctionDef
    for node in ast.walk(tree):
        if isinstance(node, kinds):
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            inner = [n for n in ast.walk(node) if n is not node and isinstance(n, kinds)]
            lines = body[-1].end_lineno - body[0].lineno + 1 if body else 0
            yield node.name, lines - sum(n.end_lineno - n.lineno + 1 for n in inner)


@pytest.mark.parametrize("room", ROOMS)
def test_every_function_is_short_enough_to_read_at_once(room):
    long = {
        f"{path.relative_to(ROOT)}: {name}": lines
        for path in modules(room).values()
        for name, lines in functions(ast.parse(path.read_text(encoding="utf-8")))
        if lines > LONGEST_FUNCTION
    }
    assert not long, f"longer than {LONGEST_FUNCTION} lines, split by what they do: {long}"
