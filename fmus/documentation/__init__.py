"""The page documentation/index.html of an FMU: what it models, its variables, what indices count, how it is stepped."""

import contextlib
import html
import platform
import re
from collections.abc import Iterable, Sequence
from importlib import metadata
from typing import Any

import numpy as np

from fmus.adapter import CoreFmu
from fmus.description import PROJECT
from fmus.documentation import texts
from fmus.documentation.picture import drawing
from fmus.documentation.reference import INTERFACE, LOADS, RELATIVE, STEPS
from interface import Variable
from scenes import Scene
from scenes.members import Members, MembraneMesh

HOST_PACKAGES = ("numpy", "scipy")  # what an FMU imports and does not carry
Rows = Iterable[Sequence[Any]]


def page(
    instance: CoreFmu, scene: Scene | None = None, side: str = "", steps: int = 0, own_binary: bool = True, fmi: int = 2
) -> str:
    """The HTML text for the FMU of `instance`.

    With the `scene` and the `side` that it is of, what it models and what the indices count there; `steps` is how many
    the reference results have, `own_binary` whether the binary is that of this project, `fmi` the version of FMI.
    """
    variables = [v for v, _ in instance.blocks.values()]
    shown = [v for v in variables if v.causality == "input" or v.name in INTERFACE]
    title = html.escape(instance.description or instance.title)
    dt = 1.0 if scene is None else scene.communication_step
    script = texts.SCRIPT.format(identifier=instance.modelName, step=dt)
    short = "" if steps == STEPS else "; a solver could not complete the next step"
    commas = any(len(v.shape) > 1 for v in variables if v.causality == "input")
    reader = texts.NO_READER if commas else texts.READER.format(identifier=instance.modelName, stop=steps * dt, step=dt)
    reference = texts.REFERENCE.format(
        reader=reader,
        identifier=instance.modelName,
        steps=steps,
        step=dt,
        short=short,
        relative=RELATIVE,
        script=html.escape(script, quote=False),
    )
    text = texts.PAGE.format(
        title=title,
        version=f"{fmi}.0",
        naming=texts.SCALARS if fmi == 2 else texts.ARRAYS,
        discarded=texts.TERMINATED if fmi == 2 else "",
        model="" if scene is None else _model(instance, scene, side),
        interface=_rows([[v.name, _shape(v), v.causality, v.unit, _about(v)] for v in shown]),
        parameters=_rows([_parameter(instance, v) for v in variables if v.causality == "parameter"]),
        outputs=_rows(
            [[v.name, _shape(v), v.unit, _about(v)] for v in variables if v.causality == "output" and v not in shown]
        ),
        scene="" if scene is None else _scene(instance, scene, fmi),
        reference=reference if steps else "",
        binary=_other_binary(own_binary, fmi),
        dependencies=_dependencies(own_binary, fmi),
    )
    return text if fmi == 2 else text.replace("fmi2", "fmi3")


def external_dependencies() -> str:
    """The text of documentation/externalDependencies.txt, which FMI 3.0 names and FMI 2.0 leaves open: requirements as
    pip reads them, in the ranges of this project, and what the FMU was built with.
    """
    wanted: list[str] = []
    with contextlib.suppress(metadata.PackageNotFoundError):  # where the sources lie about, not installed
        wanted = metadata.requires(PROJECT) or []
    built = {name: metadata.version(name) for name in HOST_PACKAGES}
    ranges = [next((text for text in wanted if re.match(rf"{name}\b", text)), name) for name in built]
    return texts.DEPENDENCIES.format(
        python=platform.python_version(),
        built=" and ".join(f"{name} {version}" for name, version in built.items()),
        requirements="\n".join(ranges),
    )


def _other_binary(own_binary: bool, fmi: int) -> str:
    """What calls do differently where the binary is that of PythonFMU, and where that is; FMI 3.0 never has it."""
    if fmi == 3:
        return ""
    return texts.OTHER_ON_WINDOWS if own_binary else texts.OTHER_EVERYWHERE


def _dependencies(own_binary: bool, fmi: int) -> str:
    if not own_binary:
        return texts.PYTHONFMU_BINARY
    return texts.OWN_BINARY + (texts.ALSO_WINDOWS if fmi == 2 else texts.LINUX_ONLY)


def _about(variable: Variable) -> str:
    return variable.description + (" (each named below)" if variable.labels else "")


def _shape(variable: Variable) -> str:
    return " × ".join(map(str, variable.shape)) or "scalar"


def _parameter(instance: CoreFmu, variable: Variable) -> list[Any]:
    start = np.ravel(instance.start(variable.name)).tolist()
    if variable.kind == "boolean":
        shown, bounds = ", ".join("true" if x else "false" for x in start), ["–", "–"]
    else:
        shown = ", ".join(f"{x:.9g}" for x in start)
        bounds = ["–" if x is None else f"{x:g}" for x in (variable.minimum, variable.maximum)]
    return [variable.name, _shape(variable), variable.unit, shown, *bounds, variable.variability, variable.description]


def _model(instance: CoreFmu, scene: Scene, side: str) -> str:
    """What the scene is, which of it the FMU holds, a drawing, and the settings."""
    of_structure = texts.OF_STRUCTURE + ("" if scene.members.wing is None else texts.OF_TUBES)
    of_structure += "" if scene.members.membranes is None else texts.OF_MEMBRANES
    physics = _structure(scene) if side == "structural" else _flow(scene)
    settings = ", ".join(f"<code>{html.escape(f'{key} = {value}')}</code>" for key, value in scene.settings.items())
    return texts.MODEL.format(
        name=html.escape(str(scene.title or scene.name)),
        about=html.escape(scene.description),
        physics=html.escape(physics),
        drawing=drawing(scene, side, _arrow(instance)),
        panels=texts.PANELS if scene.body is None else texts.OUTLINE,
        shown=of_structure if side == "structural" else texts.OF_FLOW if scene.body is None else "",
        settings=settings or "none",
    )


def _arrow(instance: CoreFmu) -> tuple[str, np.ndarray] | None:
    """What acts on the kite in this FMU from the start, and whereto."""
    if "wind_direction" in instance.blocks:
        return "wind", np.array(instance.start("wind_direction"))
    gravity = instance.start("gravity")[0] if "gravity" in instance.blocks else 0.0
    return ("gravity", np.array([0.0, 0.0, -gravity])) if gravity else None


def _structure(scene: Scene) -> str:
    members = scene.members
    two_way, membranes = _two_way(members), members.membranes
    over = [group.nodes.shape[1] > 2 for group in members.chains for _ in group.nodes]
    counts = {
        "nodes": len(members.nodes),
        "springs": int(np.count_nonzero(two_way)),
        "tension-only lines": int(np.count_nonzero(~two_way & ~np.array(over, dtype=bool))),
        "ropes over pulleys": int(np.count_nonzero(over)),
        "parts of inflatable tubes": 0 if members.wing is None else len(members.wing.tubes.ends),
        "triangles of membranes": 0 if membranes is None else len(membranes.group),
    }
    listed = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
    lines = "lines take tension only, and " if np.any(~two_way) else ""
    text = texts.TRANSIENT_STRUCTURE if scene.transient else texts.STRUCTURE
    text = text.format(counts=listed, weight=" and the weight", lines=lines)
    if membranes is None:
        return text
    return text + (texts.WRINKLING if membranes.group.law.wrinkles else texts.STIFF_MEMBRANES)


def _two_way(members: Members) -> np.ndarray:
    """Which elements push as well as pull, (e,) bool."""
    return np.concatenate([np.zeros(0, dtype=bool), *(group.two_way for group in members.chains)])


def _flow(scene: Scene) -> str:
    mesh = scene.interface
    relative = texts.RELATIVE_WIND if scene.transient else ""
    model = scene.wing_model
    if model is None:
        return texts.LINE_FLOW.format(lines=len(mesh.lines), relative=relative)
    strips = "" if model.strips is None else texts.ON_STRIPS.format(strips=len(model.strips.sections) - 1)
    lines = f"; and of {len(mesh.lines)} exposed pieces of lines" if len(mesh.lines) else ""
    return texts.FLOW.format(method=model.title, strips=strips, lines=lines, relative=relative)


def _scene(instance: CoreFmu, scene: Scene, fmi: int) -> str:
    """Order of exchange, signs, and a table for every kind of thing that an index counts."""
    blocks = instance.blocks
    loads = [f"<code>{name}</code>" for name in LOADS if name in blocks]
    order = texts.TRANSIENT_EXCHANGE if scene.transient else texts.EXCHANGE
    order = order if scene.has_flow else texts.ALONE
    text = (order if scene.has_structure else texts.RIGID).format(loads=", ".join(loads))
    if "trim_angle" in blocks and scene.pivot is not None:
        place = ", ".join(_cell(x) for x in scene.members.nodes[scene.pivot].tolist())
        pivot = html.escape(scene.members.labels[scene.pivot])
        value, azimuth = (instance.start(angle)[0] for angle in ("trim_angle", "start_azimuth"))
        text += texts.TRIM.format(value=value, azimuth=azimuth, pivot=pivot, place=place)
    if scene.start is not None:
        text += texts.START
    counted = texts.COUNTED if fmi == 2 else texts.COUNTED_IN_ARRAYS
    text += texts.SIGNS.format(shear=texts.SHEAR if "shear" in blocks else "", counted=counted)
    return text + "".join(_table(*table) for table in _tables(instance, scene))


def _tables(instance: CoreFmu, scene: Scene) -> Iterable[tuple[str, str, Rows]]:
    """Title, header and rows of the tables; what no block of the FMU is indexed by is left out."""
    counted: dict[str, list[str]] = {}
    for variable, _ in instance.blocks.values():
        if variable.counts and variable.causality != "parameter":
            counted.setdefault(variable.counts, []).append(f"{variable.name}[i{',·' if variable.shape[1:] else ''}]")
    for kind, title, header, rows in _countable(scene):
        if kind in counted and rows:
            *first, last = counted[kind]
            indexed = f"{', '.join(first)} and {last}" if first else last
            yield title.format(indexed=indexed), f"i {header}", _numbered(rows)


def _countable(scene: Scene) -> Iterable[tuple[str, str, str, Sequence[Any]]]:
    """What an index may count: the word for it (`Variable.counts`), title, header and rows of its table."""
    mesh, m = scene.interface, scene.members
    yield "interface node", "Interface nodes: index i of {indexed}", "x y z", [*mesh.nodes]
    title = "Panels: index i of {indexed}; their corners are interface nodes"
    yield "panel", title, "c1 c2 c3 c4", [*(mesh.panels + 1)]
    legs = zip(mesh.lines + 1, mesh.diameter, m.leg_names, strict=False)
    title = "Exposed lines: index i of {indexed}; from interface node to interface node"
    yield "line", title, "from to diameter element", [(*ends, diameter, name) for ends, diameter, name in legs]
    for model in (scene.wing_model, scene.lines_model):
        for kind, header, rows in () if model is None else model.tables():
            yield kind, texts.OF_MODEL.get(kind, f"{kind.capitalize()}s: index i of {{indexed}}"), header, rows
    chains = [nodes for group in m.chains for nodes in group.nodes]
    paths = [" – ".join(m.labels[n] for n in chain) for chain in chains]
    kinds = np.where(_two_way(m), "spring", "tension only")
    title = "Elements: index i of {indexed}; with their structural nodes, by name"
    yield "element", title, "name kind nodes", [*zip(m.names, kinds, paths, strict=True)]
    if m.wing is not None:
        tubes = m.wing.tubes
        ends = (" – ".join(m.labels[n] for n in pair) for pair in tubes.ends)
        title = "Parts of tubes: index i of {indexed}; with their structural nodes, by name"
        yield "tube", title, "name diameter nodes", [*zip(tubes.names, 2.0 * tubes.radius, ends, strict=True)]
    if m.membranes is not None:
        yield from _of_membranes(m.membranes, m.labels)
    nodes = [(label, *place) for label, place in zip(m.labels, m.nodes, strict=True)]
    yield "structural node", "Structural nodes: index i of {indexed}", "name x y z", nodes


def _of_membranes(mesh: MembraneMesh, labels: Sequence[str]) -> Iterable[tuple[str, str, str, Sequence[Any]]]:
    """As `_countable`, of what membranes have."""

    def path(nodes: Iterable[int]) -> str:
        return " – ".join(labels[n] for n in nodes)

    title = "Membrane elements: index i of {indexed}; with their structural nodes, by name"
    elements = zip(mesh.group.names, mesh.fabric, mesh.group.nodes.tolist(), strict=True)
    yield "membrane element", title, "name fabric nodes", [(n, mesh.fabrics[k], path(at)) for n, k, at in elements]
    title = "Groups of supports: index i of {indexed}"
    axes = (", ".join(a for a, held in zip("xyz", s.held, strict=True) if held) for s in mesh.supports)
    supports = [(s.name, held, len(s.nodes)) for s, held in zip(mesh.supports, axes, strict=True)]
    yield "support", title, "group held nodes", supports
    title = "Sides of seams: index i of {indexed}; with their structural nodes, by name"
    yield "side of a seam", title, "seam nodes", [(n, path(at)) for n, sides in mesh.seams.items() for at in sides]


def _numbered(rows: Iterable[Iterable[Any]]) -> Rows:
    return [[i, *row] for i, row in enumerate(rows, 1)]


def _table(title: str, header: str, rows: Rows) -> str:
    heads = "".join(f"<th>{head}</th>" for head in header.split())
    return f"<details><summary>{title}</summary>\n<table><tr>{heads}</tr>\n{_rows(rows)}\n</table></details>\n"


def _rows(rows: Rows) -> str:
    return "\n".join("<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row) + "</tr>" for row in rows)


def _cell(value: Any) -> str:
    """Text of a cell; numbers in nine digits, and no finer than 1e-12, where zeros have their rounding."""
    return f"{round(value, 12) + 0.0:.9g}" if isinstance(value, float) else html.escape(str(value))
