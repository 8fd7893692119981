"""The tables of a run: summary.json, history.csv and the final state, each written whole or not at all."""

import csv
import io
import json
import math
import os
import platform
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.drag import drag_rows
from master.report.line_rows import line_row_rows, line_row_table, line_rows
from master.report.loading import span_loading
from master.report.membranes import element_table, membrane_rows, membrane_state, seam_table
from master.report.panels import PanelLoads, panel_loads
from master.report.record import named
from master.report.ribs import rib_table, ribs
from master.report.sections import COLUMNS, wing_sections
from master.report.state import loose_lines
from master.report.validity import validity_row
from master.report.wing import wing_rows

if TYPE_CHECKING:
    from master.coupling.run import Run


# Block -> column of elements.csv.
ELEMENTS = {
    "tension": "tension_N",
    "strain": "strain",
    "rest_length": "rest_length_m",
    "length": "length_m",
    "axial_stiffness": "EA_N",
}


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file under a temporary name and rename it, so that no reader ever meets half of it. OSError that names
    it where that fails.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with named(path):
            temporary.write_bytes(content.encode() if isinstance(content, str) else content)
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Content as JSON, keys in the given order; NaN and infinity become null."""
    write_whole(path, json.dumps(plain(content), indent=2, allow_nan=False) + "\n")


def write_csv(path: Path, header: list[str], rows: list[list[Any]]) -> None:
    """A table with a header row; floats keep all their digits."""
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow(header)
    out.writerows(rows)
    write_whole(path, text.getvalue())


def write_history(path: Path, history: list[dict[str, float]]) -> None:
    """A row per coupling iteration."""
    header = list(history[0]) if history else ["iteration", "residual_m"]
    rows = [[int(row[k]) if k == "iteration" else repr(float(row[k])) for k in header] for row in history]
    write_csv(path, header, rows)


def write_state(
    folder: Path,
    blocks: dict[str, np.ndarray],
    names: dict[str, tuple[str, ...]],
    interface: Any,
    wing: Any = None,
    members: Any = None,
    edge_strips: Any = None,
) -> list[str]:
    """The final state as tables: nodes, elements, interface, panels and exposed lines, tubes and sections of an
    inflatable `wing`, membranes of the `members`, and the strips of a closed body with the layout `edge_strips`, as far
    as the blocks are there.

    `names` labels the rows of the blocks `position`, `tension` and `line_load`; `interface` has the reference `nodes`,
    `panels` and `lines`. Returns the names of the files.
    """
    rows: list[list[Any]]
    written = ["interface.csv", "panels.csv"]
    panels = np.asarray(interface.panels)
    if "position" in blocks:
        rows = [[n, *map(repr, map(float, p))] for n, p in zip(names["position"], blocks["position"], strict=True)]
        write_csv(folder / "nodes.csv", ["node", "x_m", "y_m", "z_m"], rows)
        written.append("nodes.csv")
    if "tension" in blocks:
        columns = {column: blocks[name] for name, column in ELEMENTS.items() if name in blocks}
        rows = [[n, *map(repr, map(float, v))] for n, *v in zip(names["tension"], *columns.values(), strict=True)]
        write_csv(folder / "elements.csv", ["element", *columns], rows)
        written.append("elements.csv")
    x = blocks["displacement"]
    rows = [
        [i + 1, *map(repr, map(float, (*p, *d)))] for i, (p, d) in enumerate(zip(interface.nodes + x, x, strict=True))
    ]
    write_csv(folder / "interface.csv", ["node", "x_m", "y_m", "z_m", "dx_m", "dy_m", "dz_m"], rows)
    loads = panel_loads(interface.nodes + x, panels, blocks)
    columns = loads.columns()
    cells = zip(*columns.values(), strict=True)
    rows = [[i + 1, *(panels[i] + 1), *map(repr, map(float, v))] for i, v in enumerate(cells)]
    write_csv(folder / "panels.csv", ["panel", "node_1", "node_2", "node_3", "node_4", *columns], rows)
    if "line_load" in blocks:
        lines = zip(names["line_load"], interface.lines + 1, interface.diameter, blocks["line_load"], strict=True)
        rows = [[i + 1, n, *ends, *map(repr, map(float, (d, *q)))] for i, (n, ends, d, q) in enumerate(lines)]
        header = ["line", "element", "node_1", "node_2", "diameter_m"]
        write_csv(folder / "line_loads.csv", [*header, *(f"load_{axis}_N_per_m" for axis in "xyz")], rows)
        written.append("line_loads.csv")
    if wing is not None and {"tube_load", "tube_strain"} <= blocks.keys():
        tubes = zip(wing.tubes.names, wing.tubes.radius, blocks["tube_load"], blocks["tube_strain"], strict=True)
        rows = [[n, *map(repr, map(float, values))] for n, *values in tubes]
        write_csv(folder / "tubes.csv", ["tube", "radius_m", "moment_over_collapse", "strain"], rows)
        written.append("tubes.csv")
    sections = wing_sections(wing, blocks.get("position"))
    if sections is not None:
        write_csv(
            folder / "sections.csv", list(COLUMNS), [[c, *map(repr, v), strut] for c, *v, strut in sections.rows()]
        )
        written.append("sections.csv")
    written += _write_ribs(folder, blocks, interface, members, loads)
    surfaces = [s.columns() for s in span_loading(edge_strips, interface.nodes + x, blocks)]
    if surfaces:
        rows = [[_plain(v) for v in row] for columns in surfaces for row in zip(*columns.values(), strict=True)]
        write_csv(folder / "strips.csv", [*surfaces[0]], rows)
        written.append("strips.csv")
    return written + _write_membranes(folder, blocks, members)


def _write_ribs(
    folder: Path, blocks: dict[str, np.ndarray], interface: Any, members: Any, loads: PanelLoads
) -> list[str]:
    """Tables of ribs of a ram-air wing and of the lines on them, where there are some; the names of the files."""
    written = []
    of_ribs = ribs(members, blocks, interface, interface.nodes + blocks["displacement"], loads)
    if of_ribs:
        header, of_sides = rib_table(of_ribs)
        write_csv(folder / "ribs.csv", header, list(of_sides))
        written.append("ribs.csv")
    of_rows = line_rows(members, blocks.get("tension"))
    if of_rows is not None:
        header, of_lines = line_row_table(of_rows)
        write_csv(folder / "rib_lines.csv", header, list(of_lines))
        written.append("rib_lines.csv")
    return written


def _plain(value: Any) -> Any:
    """A cell of a table, of numbers with a fraction all digits."""
    return repr(float(value)) if isinstance(value, float) else value


def _write_membranes(folder: Path, blocks: dict[str, np.ndarray], members: Any) -> list[str]:
    """Tables of the membranes and their seams, where there are some; the names of the files."""
    found = membrane_state(members, blocks)
    if found is None:
        return []
    tables = {"membranes.csv": element_table(found, members.labels)}
    if "seam_force" in blocks:
        tables["seams.csv"] = seam_table(found, members.labels, blocks)
    for name, (header, rows) in tables.items():
        write_csv(folder / name, header, rows)
    return list(tables)


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that make the numbers."""
    found = {"python": platform.python_version()}
    for package in ("kitecosim", "numpy", "scipy", "fmpy", "pythonfmu"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def plain(value: Any) -> Any:
    """The value in types that JSON has: arrays as lists, paths as texts, NaN and infinity as None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def summary(run: "Run", settings: dict[str, Any]) -> dict[str, Any]:
    """The content of summary.json; `settings` is what the caller chose (scene, scheme, backend, parameters, ...)."""
    result = run.result
    seconds = result.seconds
    judged = run.stability
    return {
        "scene": settings["scene"],
        "scheme": settings.get("scheme"),  # none for a rigid wing
        "backend": settings["backend"],
        "status": run.status,
        "message": run.message,
        "coupling_iterations": result.iterations,
        "residual": result.residual,
        "residual_N": result.residual_N,
        "shape_of_iteration": result.iterate,
        "first_residual": result.history[0]["residual_m"] if result.history else None,
        "statically_stable": None if judged is None else judged.statically_stable,
        "stability": None
        if judged is None
        else {
            "eigenvalue": judged.eigenvalue,
            "evaluations": judged.evaluations,
            "symmetric_motions_only": judged.symmetric_only,
        },
        "recoveries": [asdict(r) for r in result.recoveries],
        "validity": [judgement.record() for judgement in run.validity],
        "remarks": run.remarks,
        "solver_calls": {side: run.evaluations if run.blocks[side] else 0 for side in ("structural", "aero")},
        "wall_time_s": {
            "total": seconds["total"],
            "structural": seconds["structural"],
            "aero": seconds["aero"],
            "master": seconds["total"] - seconds["structural"] - seconds["aero"],
            "stability": seconds.get("stability", 0.0),
        },
        "outputs": _small_outputs(run),
        "settings": settings,
    }


def _small_outputs(run: "Run") -> dict[str, Any]:
    """Scalar and vector outputs by name; a name that both participants have carries the participant's in front."""
    out = {}
    for label, other in (("aero", "structural"), ("structural", "aero")):
        for block, values in run.blocks[label].items():
            if run.causality[label][block] == "output" and values.shape in ((), (3,)):
                shared = run.causality[other].get(block) == "output"
                out[f"{label}.{block}" if shared else block] = values
    return out


def result_rows(scene: Any, run: "Run", content: dict[str, Any]) -> list[tuple[str, str]]:
    """What a run found, as names and texts with units; `content` is what summary.json holds."""
    aero, structural, result = run.blocks["aero"], run.blocks["structural"], run.result
    if not scene.has_structure:
        return _rigid_rows(scene, run, content)
    how = f"{content['scheme']}, {content['settings'].get('order', 'serial')}, {content['backend']}"
    rows = [
        ("scheme, order, backend", how),
        ("coupling iterations", f"{result.iterations}"),
        ("interface residual", _residual(result.residual, "m")),
        ("out-of-balance force", _residual(result.residual_N, "N")),
        ("statically stable", _stability_text(run)),
        validity_row(run.validity),
        *(_flow_rows(scene, aero) if "wind_speed" in aero else []),
        ("force on supports", f"{_vector(structural['support_force'])} N, "
                              f"{np.linalg.norm(structural['support_force']):.2f} N in all"),
    ]  # fmt: skip
    if "line_force" in aero:
        rows.insert(-1, ("wind force on lines", _vector(aero["line_force"]) + " N"))
    mass = float(scene.members.mass_with(float(structural.get("wing_mass", scene.members.wing_mass.sum()))).sum())
    if mass > 0.0:
        gravity = float(structural.get("gravity", 0.0))
        upwards = " towards +z" if gravity < 0.0 else ""
        weight = f"{abs(gravity) * mass:.2f} N{upwards}, " if "gravity" in structural else ""
        rows.insert(-1, ("weight", f"{weight}{mass:.4g} kg"))
    if "glide_ratio" in aero:
        with_lines = ", with lines" if "line_force" in aero else ""
        after = 1 + [name for name, _ in rows].index("C_L, C_D")
        rows.insert(after, (f"lift over drag{with_lines}", f"{float(aero['glide_ratio']):.3f}"))
        rows[after + 1 : after + 1] = drag_rows(scene, aero)
    tension = structural.get("tension", np.zeros(0))
    lines = scene.members.names
    one_way = scene.members.lines
    two_way = ~one_way
    if one_way.any():
        # the first of those that are equal but for rounding, so that left and right do not take turns
        most = np.flatnonzero(one_way & (tension >= tension[one_way].max() * (1.0 - 1e-9)))[0]
        rows.append(("largest line tension", f"{tension[most]:.1f} N in {lines[most]}"))
        slack = [lines[i] for i in np.flatnonzero(one_way & (tension <= 0.0))]
        rows.append(("slack lines", ", ".join(slack) or "none"))
        loose = [f"{lines[i]} ({tension[i]:.2g} N)" for i in np.flatnonzero(loose_lines(tension, two_way))]
        rows.append(("loose lines", ", ".join(loose) or "none"))
        rows += line_row_rows(scene.members, tension)
    rows += wing_rows(scene.members, structural) + membrane_rows(scene.members, structural)
    if "holding_force" in structural and float(structural.get("hold_roll_and_yaw", 0.0)):
        held = (
            f"{float(structural['holding_force']):.2f} N sideways, moment {_vector(structural['holding_moment'])} N m"
        )
        rows.append(("holds roll and yaw", held))
    wall = content["wall_time_s"]
    rows.append(("solve", f"{wall['total']:.3f} s (structure {wall['structural']:.3f}, flow {wall['aero']:.3f})"))
    return rows


def _rigid_rows(scene: Any, run: "Run", content: dict[str, Any]) -> list[tuple[str, str]]:
    """The same of a rigid wing, whose flow was solved once."""
    aero = run.blocks["aero"]
    rows = [("rigid wing", f"no structure, {content['backend']}"), validity_row(run.validity)]
    if run.status == "converged":
        about, _ = scene.moments_about
        rows += _flow_rows(scene, aero)
        rows.append((f"moment about the {about}", _vector(aero["moment"]) + " N m"))
        rows.append(("lift over drag", f"{float(aero['glide_ratio']):.3f}"))
    return [*rows, ("solve", f"{content['wall_time_s']['total']:.3f} s")]


def _flow_rows(scene: Any, aero: dict[str, np.ndarray]) -> list[tuple[str, str]]:
    wind = [("wind speed", f"{float(aero['wind_speed']):g} m/s")]
    if "ground_wind_share" in aero:
        share, at = 100.0 * float(aero["ground_wind_share"]), _vector(aero["ground_point"])
        wind.append(("wind at the ground", f"{share:g} % of the speed, at {at} m; linear from there"))
    if "turn_rate" in aero:
        rate, at = ", ".join(f"{float(w):g}" for w in aero["turn_rate"]), _vector(aero["turn_centre"])
        wind.append(("rotation", f"({rate}) rad/s about {at} m"))
    if scene.wing_model is None:  # lines alone
        return wind
    area = f"area {scene.aero.reference_area:g} m2"
    return [
        *wind,
        ("C_L, C_D", f"{float(aero['CL']):.4f}, {float(aero['CD']):.4f} ({area})"),
        *scene.wing_model.rows(aero),
        *([("projected area", f"{float(aero['projected_area']):.2f} m2")] if "projected_area" in aero else []),
        ("aerodynamic force", _vector(aero["force"]) + " N"),
    ]


def _residual(value: float, unit: str) -> str:
    return f"{value:.2e} {unit}" if np.isfinite(value) else "not known, as a step was refused"


def _vector(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{round(float(v), 2) + 0.0:.2f}" for v in values) + ")"  # no -0.00


def _stability_text(run: "Run") -> str:
    judged = run.stability
    if judged is None:
        return "not judged"
    answer = {True: "yes", False: "no", None: "undecided"}[judged.statically_stable]
    if math.isnan(judged.eigenvalue):
        return answer
    scope = ", symmetric motions only" if judged.symmetric_only else ""
    return f"{answer} (rightmost eigenvalue of the coupled map {judged.eigenvalue:.3f}{scope})"
