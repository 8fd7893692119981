"""The rooms of the project and which way imports run between them, read from the sources with ast."""

import ast
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("interface", "structural", "aero", "scenes", "fmus", "master")
COMMAND_LINE = ("master.cli", "master.commands", "master.__main__")
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
# The rooms within master: packages and modules that belong to each (the longest name that fits decides), and what each
# may import of the others, anywhere in a module.
MASTER_ROOMS = {
    "participants": {"master.coupling.participants"},
    "acceleration": {"master.coupling.acceleration"},
    "coupling": {"master.coupling"},
    "report": {"master.report"},
    "fmu_coupling": {"master.fmu_coupling"},
    "commands": {"master.commands", "master.transient", "master.restart"},
    "studies": {"master.studies"},
    "cli": {"master.cli", "master.__main__", "master.isolated", "master.moved"},  # and master itself
}
LEAVES = {"participants", "acceleration"}  # of coupling; who may import it may import them
MASTER_NEIGHBOURS = {
    "participants": set(),
    "acceleration": set(),
    "coupling": {"participants", "acceleration"},
    "report": {"coupling"},
    "fmu_coupling": {"coupling", "report"},
    "commands": {"coupling", "report"},
    "studies": {"coupling", "fmu_coupling", "report", "commands"},
    "cli": {"coupling", "fmu_coupling", "commands", "studies"},
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
    """One import: what it names (a module, or a name in one), where it stands, whether loading the module loads it."""

    name: str
    line: int
    at_load: bool

    @property
    def package(self):
        """The top-level package."""
        return self.name.partition(".")[0]


def _names(node, package):
    """Dotted names that a statement or a call imports; `package` (dotted) resolves relative imports."""
    match node:
        case ast.Import(names=names):
            return [name.name for name in names]
        case ast.ImportFrom(module=module, level=0, names=names):
            return [f"{module}.{name.name}" for name in names]
        case ast.ImportFrom(module=module, level=level, names=names):
            above = package.split(".")[: len(package.split(".")) - level + 1]
            base = ".".join([*above, *([module] if module else [])])
            return [f"{base}.{name.name}" for name in names]
        case ast.Call(func=ast.Name(id="import_module" | "__import__"), args=[ast.Constant(value=str(name)), *_]):
            return [name]
        case ast.Call(func=ast.Attribute(attr="import_module"), args=[ast.Constant(value=str(name)), *_]):
            return [name]
    return []


def _is_type_checking(node):
    return isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


def imports(source, package="room"):
    """All imports of a module, in order of their place in the tree; those in functions are not made at load."""
    found = []

    def walk(node, at_load):
        found.extend(Import(name, node.lineno, at_load) for name in _names(node, package))
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


def master_room(name):
    """The rooms within master that a dotted name belongs to, one if all is well."""
    fits = {
        len(of): room for room, members in MASTER_ROOMS.items() for of in members if f"{name}.".startswith(f"{of}.")
    }
    return fits[max(fits)] if fits else "cli" if name == "master" else None


def test_every_module_of_master_is_in_one_room_within_it():
    homeless = [name for name in modules("master") if master_room(name) is None]
    assert not homeless, f"name a room within master for {homeless}"
    assert {master_room(name) for name in modules("master")} == set(MASTER_ROOMS)
    members = [name for names in MASTER_ROOMS.values() for name in names]
    assert len(members) == len(set(members))
    assert set(members) <= set(modules("master"))


def test_imports_within_master_run_one_way():
    wrong = []
    for name, place, found in room_imports("master"):
        own, other = master_room(name), (master_room(found.name) or "cli") if found.package == "master" else None
        allowed = {own} | MASTER_NEIGHBOURS[own]
        allowed |= LEAVES if "coupling" in allowed else set()
        if other is not None and other not in allowed:
            wrong.append(f"{place}: {own} imports {found.name} of {other}")
    assert not wrong, wrong


def test_the_rooms_within_master_have_no_circle():
    left = dict(MASTER_NEIGHBOURS)
    while free := [room for room, to in left.items() if not to & left.keys()]:
        left = {room: to for room, to in left.items() if room not in free}
    assert not left, f"arrows run in a circle: {left}"


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
