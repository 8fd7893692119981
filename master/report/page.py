"""The page report.html: everything that a run found and was given, in one file that needs no other."""

import base64
from collections.abc import Iterable, Mapping
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.membranes import SLACK, WRINKLED, membrane_state, seam_forces
from master.report.panels import FIELDS, PanelLoads
from master.report.state import FinalState, Frame, status_text
from master.report.tables import result_rows
from master.report.wing import TubeState

if TYPE_CHECKING:
    from master.coupling.run import Run

# Options of a run: unit and meaning.
OPTIONS = {
    "scheme": ("", "coupling scheme"),
    "backend": ("", "fmu: the two FMUs; in-process: the same solvers without them"),
    "relaxation": ("1", "relaxation factor; initial factor of aitken and iqn-ils (none: the scheme's own)"),
    "tolerance": ("m", "interface residual that counts as converged, 2-norm over all interface nodes"),
    "force_tolerance": ("N", "out-of-balance force that counts as converged, 2-norm over all free directions"),
    "max_iterations": ("1", "maximum number of coupling iterations"),
    "stability": ("", "whether the static stability of the equilibrium is judged"),
    "report": ("", "whether plots, VTK files and this page are written"),
    "labels": ("", "what is named in a plot of its own: nodes, lines or both (none: no such plot)"),
}
HISTORY = {
    "residual_m": "interface residual, m",
    "structural.imbalance_before_step": "out-of-balance force, N",
    "structural.newton_iterations": "Newton iterations, structure",
    "aero.newton_iterations": "Newton iterations, flow",
    "structural.slack_lines": "slack lines",
    "aero.CL": "C_L",
    "aero.CD": "C_D",
    "aero.alpha_mid": "angle of attack, deg",
}
COEFFICIENTS = ("CL", "CD", "CS")  # outputs that are the parts of one vector
MOST = 20  # rows of the table of the canopy
TIE = 9  # digits; what is equal to them keeps the order of the scene
ROUNDING = 1e-12  # of the size of a vector: what is left of a zero, and shown as such
Table = dict[str, Any]  # title, header, rows of cells, marked: rows that stand out


def page(
    scene: Any,
    run: "Run",
    content: dict[str, Any],
    state: FinalState,
    figures: dict[str, tuple[str, bytes]],
    cores: Mapping[str, Any] | None = None,
) -> str:
    """The HTML text. `content` is what summary.json holds; `figures` maps names to captions and SVG files; the `cores`
    of the scene, new ones without any, say what their variables mean.
    """
    sides = scene.cores() if cores is None else cores
    variables = {f"{label}.{v.name}": v for label, core in sides.items() for v in core.variables}
    tables = [
        _validity(run),
        _outputs(content, variables),
        *_structure(state.frame),
        *membrane_tables(scene.members, run.blocks["structural"]),
        _strips(state),
        _loading(state),
        *([_panels(state.surface.loads)] if scene.has_flow and len(state.surface.panels) else []),
        _history(run),
        _settings(scene, content),
        _parameters(run, content, variables),
        _table("Versions", ["package", "version"], content.get("versions", {}).items()),
    ]
    return html(
        "master.report",
        "page.html",
        figures,
        title=scene.title,
        description=scene.description,
        good=run.status == "converged",
        status=status_text(run.status),
        message=run.message,
        remarks=run.remarks,
        result=result_rows(scene, run, content),
        tables=[table for table in tables if table["rows"]],
    )


def html(package: str, template: str, figures: Mapping[str, tuple[str, bytes]], **values: Any) -> str:
    """A page from a template file of a package, which may import the macros of parts.html.

    `figures` maps names to captions and SVG files; the template gets them embedded, and the `values` by their names.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    def source(name: str, of: str = "master.report") -> str:
        return files(of).joinpath(name).read_text(encoding="utf-8")

    embedded = [
        {"name": name, "caption": caption, "data": base64.b64encode(svg).decode("ascii")}
        for name, (caption, svg) in figures.items()
    ]
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, loader=FunctionLoader(source)
    )
    return environment.from_string(source(template, package)).render(figures=embedded, **values)


def cell(value: Any) -> tuple[str, bool]:
    """Text of a table cell and whether it is a number: up to six digits, vectors in brackets, switches in words."""
    if isinstance(value, str):
        return value, False
    if value is None:
        return "none", False
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no", False
    array = np.asarray(value, dtype=float)
    if array.ndim:
        array = _rounded(array, array)
        return "(" + ", ".join(cell(v)[0] for v in array) + ")", True
    return f"{float(array) + 0.0:.6g}", True


def _rounded(values: np.ndarray, of: np.ndarray) -> np.ndarray:
    """The values, zero where they are rounding of the largest value `of` which they are a part."""
    return np.where(np.abs(values) <= ROUNDING * np.abs(of).max(initial=0.0), 0.0, values)


def _table(title: str, header: Iterable[str], rows: Iterable[Iterable[Any]], marked: Iterable[Any] = ()) -> Table:
    cells = [[cell(value) for value in row] for row in rows]
    return {"title": title, "header": list(header), "rows": cells, "marked": {int(i) for i in marked}}


def _about(value: Any, variable: Any) -> tuple[str, str]:
    """Unit and description of a solver's variable, empty where it is not known; an angle in degrees too."""
    if variable is None:
        return "", ""
    degrees = f" ({np.rad2deg(float(value)):.3f} deg)" if variable.unit == "rad" and not variable.shape else ""
    return variable.unit + degrees, variable.description


def _shown(value: Any, variable: Any) -> Any:
    """A value as its variable means it: switches as such."""
    return bool(value) if variable is not None and variable.kind == "boolean" else value


def _outputs(content: dict[str, Any], variables: dict[str, Any]) -> Table:
    rows = []
    outputs = dict(content.get("outputs", {}))
    parts = [outputs[name] for name in COEFFICIENTS if name in outputs]
    outputs |= {name: _rounded(outputs[name], np.array(parts)) for name in COEFFICIENTS if name in outputs}
    for name, value in outputs.items():
        known = [variables[key] for key in (name, f"aero.{name}", f"structural.{name}") if key in variables]
        variable = known[0] if known else None
        rows.append([name, _shown(value, variable), *_about(value, variable)])
    return _table("Outputs", ["output", "value", "unit", "meaning"], rows)


def _validity(run: "Run") -> Table:
    header = ["quantity", "largest value", "limit", "where", "verdict", "source of the limit"]
    rows = [
        [j.criterion.quantity, j.criterion.text(j.value), j.criterion.text(j.criterion.limit), j.where,
         "within" if j.within else "outside", j.criterion.source]
        for j in run.validity
    ]  # fmt: skip
    marked = [i for i, j in enumerate(run.validity) if not j.within]
    return _table("Validity: up to where the models are known to be good", header, rows, marked)


def _settings(scene: Any, content: dict[str, Any]) -> Table:
    given = content.get("settings", {})
    rows = [[name, given[name], *about] for name, about in OPTIONS.items() if name in given]
    for name, value in given.get("scene_settings", scene.settings).items():
        rows.append([name, value, "", scene.offers[name].description])
    return _table("Settings", ["setting", "value", "unit", "meaning"], rows)


def _parameters(run: "Run", content: dict[str, Any], variables: dict[str, Any]) -> Table:
    given = content.get("settings", {}).get("parameters_set", {})
    rows = []
    for label, causality in run.causality.items():
        for block in (b for b, c in causality.items() if c == "parameter"):
            variable = variables.get(f"{label}.{block}")
            origin = "set" if block in given else "start value"
            value = run.blocks[label][block]
            rows.append([f"{label}.{block}", _shown(value, variable), *_about(value, variable), origin])
    return _table("Parameters", ["parameter", "value", "unit", "meaning", "origin"], rows)


def _elements(title: str, frame: Frame, chosen: np.ndarray, state_of: Any) -> Table:
    header = ["element", "nodes", "rest length, m", "length, m", "strain, %", "EA, N", "tension, N", "state"]
    rows = []
    for i in chosen:
        rest = frame.rest_length[i]
        stretch = 100.0 * frame.strain[i] if rest > 0.0 else "\u2013"
        path = " \u2013 ".join(frame.labels[n] for n in frame.chains[i])
        rows.append([frame.names[i], path, rest, frame.length[i], stretch])
        rows[-1] += [frame.axial_stiffness[i], frame.tension[i], state_of(i)]
    return _table(title, header, rows, np.flatnonzero(frame.slack[chosen]))


def _structure(frame: Frame | None) -> list[Table]:
    """Tables of lines, tubes, springs and canopy."""
    if frame is None:
        return []

    def line(i: int) -> str:
        return "slack" if frame.slack[i] else "loose" if frame.loose[i] else "taut"

    def spring(i: int) -> str:
        return "tension" if frame.tension[i] >= 0.0 else "compression"

    springs, canopy = frame.two_way & ~frame.canopy, np.flatnonzero(frame.canopy)
    most = canopy[np.argsort(-np.round(frame.strain[canopy], TIE), kind="stable")[:MOST]]
    slack = np.count_nonzero(frame.tension[canopy] <= 0.0)
    return [
        _elements("Lines", frame, np.flatnonzero(~frame.two_way), line),
        _tubes(frame.tubes),
        _elements("Springs (two-way)", frame, np.flatnonzero(springs), spring),
        _elements(
            f"Canopy (the {len(most)} most stretched of {len(canopy)} springs, {slack} of them slack)",
            frame, most, lambda i: "tension" if frame.tension[i] > 0.0 else "slack",
        ),
    ]  # fmt: skip


def _tubes(tubes: TubeState | None) -> Table:
    """A row per tube with what the most loaded of its parts carries, those closest to collapse first."""
    header = ["tube", "parts", "radius, m", "moment / collapse moment", "in part", "strain, %", "collapsed parts"]
    if tubes is None:
        return _table("Tubes", header, [])
    of, parts = np.array(tubes.tube), {name: np.flatnonzero(np.array(tubes.tube) == name) for name in tubes.tube}
    most = {name: own[np.argmax(np.round(tubes.load[own], TIE))] for name, own in parts.items()}
    # equal but for rounding: in the order of the scene, so that left and right do not take turns
    order = sorted(parts, key=lambda name: -round(float(tubes.load[most[name]]), TIE))
    rows = []
    for name in order:
        own, i = parts[name], most[name]
        fallen = ", ".join(tubes.names[k] for k in own[tubes.collapsed[own]]) or "none"
        strain = 100.0 * tubes.strain[own].max()
        rows.append([name, len(own), tubes.radius[own].mean(), tubes.load[i], tubes.names[i], strain, fallen])
    marked = [k for k, name in enumerate(order) if tubes.collapsed[of == name].any()]
    return _table("Tubes (largest values of their parts; all parts: tubes.csv)", header, rows, marked)


def membrane_tables(members: Any, blocks: dict[str, np.ndarray]) -> list[Table]:
    """Tables of fabrics, supports and seams of membranes, none where there are none."""
    found = membrane_state(members, blocks)
    if found is None:
        return []
    fabrics = []
    for name in dict.fromkeys(found.fabric):
        rows = np.flatnonzero(np.array(found.fabric) == name)
        most = rows[np.argmax(np.round(found.cauchy_1[rows], TIE))]
        shares = [100.0 * found.share(state, rows) for state in (SLACK, WRINKLED)]
        stress = found.cauchy_1[most], found.names[most], found.cauchy_2[rows].min()
        strain = 100.0 * found.strain[rows].max()
        fabrics.append([name, len(rows), found.area[rows].sum(), *stress, strain, *shares])
    header = ["fabric", "triangles", "area, m\u00b2", "largest stress, N/m", "in", "least stress, N/m"]
    header += ["largest strain, %", "slack, %", "wrinkled, %"]
    tables = [_table("Membranes (principal Cauchy stress; every triangle: membranes.csv)", header, fabrics)]
    if "support_group_force" in blocks:
        forces = blocks["support_group_force"]
        shown = [
            [s.name, len(s.nodes), _rounded(f, forces)] for s, f in zip(members.membranes.supports, forces, strict=True)
        ]
        tables.append(_table("Forces on groups of supports", ["group", "nodes", "force, N"], shown))
    if "seam_force" in blocks:
        sizes = [(name, np.linalg.norm(f, axis=1)) for name, f in seam_forces(found, blocks)]
        seams = [[name, len(f), f.min(), f.mean(), f.max()] for name, f in sizes]
        header = ["seam", "sides", "least, N/m", "mean, N/m", "largest, N/m"]
        tables.append(_table("Forces of seams (every side: seams.csv)", header, seams))
    return tables


def _strips(state: FinalState) -> Table:
    s = state.strips
    columns: dict[str, Any] = {}
    if s is not None:
        columns = {
            "strip": np.arange(1, len(s.arc) + 1),
            "arc length from mid-span, m": s.arc,
            "width, m": s.width,
            "lift, N/m": s.lift,
            "drag, N/m": s.drag,
            "side force, N/m": _rounded(s.side, s.lift),
            "effective angle of attack, deg": s.alpha,
            "circulation, m\u00b2/s": s.circulation,
        }
        if s.coefficients is not None:
            columns |= dict(zip(("cl", "cd", "cm"), s.coefficients, strict=True))
    columns = {name: _rounded(values, values) for name, values in columns.items() if values is not None}
    return _table("Strips (left tip first)", columns, zip(*columns.values(), strict=True))


def _loading(state: FinalState) -> Table:
    """The strips of a closed body, surface by surface."""
    shown = {
        "strip": "strip", "surface": "surface", "arc_m": "arc length from its middle, m", "width_m": "width, m",
        "chord_m": "chord, m", "alpha_deg": "angle of the chord, deg", "c_cl_m": "c cl, m",
        "pressure_c_cl_m": "c cl by pressure, m", "cl": "cl", "lift_N_per_m": "lift, N/m",
        "side_force_N_per_m": "side force, N/m", "circulation_m2_per_s": "circulation, m\u00b2/s",
    }  # fmt: skip
    rows = [
        [columns[key][k] for key in shown]
        for columns in (surface.columns() for surface in state.loading)
        for k in range(len(columns["strip"]))
    ]
    return _table("Strips of the surfaces (all columns: strips.csv)", [*shown.values()], rows)


def _panels(loads: PanelLoads) -> Table:
    """Range and meaning of every field of the panels, of vectors that of their size; their sum."""
    rows = []
    for name, values in loads.fields().items():
        _, unit, meaning = FIELDS[name]
        sizes = values if values.ndim == 1 else np.linalg.norm(values, axis=1)
        rows.append([name, sizes.min(), sizes.max(), unit, meaning + ("" if values.ndim == 1 else "; its size")])
    rows += [["sum of load times area", "", cell(loads.force.sum(axis=0))[0], "N", "force on the wing"]]
    return _table("Loads on the panels (wing.vtu, panels.csv)", ["field", "least", "most", "unit", "meaning"], rows)


def _history(run: "Run") -> Table:
    rows = [{k: np.rad2deg(v) if k == "aero.alpha_mid" else v for k, v in row.items()} for row in run.result.history]
    shown = {key: head for key, head in HISTORY.items() if rows and key in rows[0]}
    cells = [[row["iteration"], *(row[key] for key in shown)] for row in rows]
    return _table("Coupling iterations", ["coupling iteration", *shown.values()], cells)
