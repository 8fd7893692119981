"""What a run leaves behind: tables always; plots, VTK files and a page where the libraries for them are installed.

Every file is written whole or not at all. The same run gives the same bytes, whenever it is written.
"""

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.console import print_table, print_written
from master.report.drag import drag_results
from master.report.line_rows import line_row_results
from master.report.membranes import membrane_results
from master.report.state import final_state, status_text
from master.report.tables import result_rows, summary, versions, write_history, write_json, write_state, write_whole
from master.report.views import wind_of
from master.report.wing import wing_results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from master.coupling.run import Run
    from master.report.state import FinalState

__all__ = [
    "LABELS",
    "RESULTS",
    "drag_results",
    "final_state",
    "line_row_results",
    "membrane_results",
    "missing_libraries",
    "print_table",
    "print_written",
    "result_rows",
    "summary",
    "versions",
    "wing_results",
    "write_history",
    "write_json",
    "write_report",
    "write_state",
    "write_whole",
]

LABELS = ("nodes", "lines", "both")  # what may be named in a plot
LIBRARIES = ("matplotlib", "meshio", "jinja2")
TABLES = (
    *("summary.json", "history.csv", "nodes.csv", "elements.csv", "interface.csv", "panels.csv", "line_loads.csv"),
    *("tubes.csv", "sections.csv", "membranes.csv", "seams.csv", "ribs.csv", "rib_lines.csv", "strips.csv"),
)
ANGLE = (
    "Effective angle: chord to the local flow with induced velocity, hence closer to zero lift than the angle to the "
    "free stream (in strip theory, without induced velocity, equal)"
)
CAPTIONS = {
    "shape": "Flown shape with line tensions, three views to one scale",
    "labels": "Names of nodes and lines of the bridle as flown, on a large page: open labels.svg to read them",
    "billowing": "Billowing of the canopy: sections between the struts and, thin and grey, at the struts, each along "
    "its own chord, and camber, the largest distance of a section from its chord, along the span",
    "membranes": "Membranes as deformed, in parallel projection: larger principal stress in force per present length, "
    "and where they are taut, wrinkled (strokes along the tension) and slack",
    "ribs": "Two ribs: the profile as flown over that drawn, the pressure coefficient outside along the chord, and in "
    "the cell towards the right tip the Cauchy stress across the span, in force per length, beside Barlow's formula",
    "rib_lines": "Tension of the lines that begin on the ribs, row by row, over the ribs along the span, and its "
    "share of the sum at each rib",
    "convergence": "Convergence of the coupling: interface residual, out-of-balance force and Newton iterations",
    "strips": f"Loads, effective angle of attack and circulation along the span. {ANGLE}",
    "loading": "Span loading of the surfaces: c cl and cl, in the Trefftz plane and by the pressure on each strip, and "
    "the angle of the chords; positive upwards, of end plates and fins outwards",
    "polars": "Operating points of the strips on their section polars, coloured by distance from mid-span; left and "
    f"right half of a diamond coincide where the kite is symmetric. {ANGLE}",
}
AT_REST = "Shape at rest in still air with line tensions, three views to one scale"
RIGID = "Shape of the rigid wing, three views to one scale"
MESHES = ("wing.vtu", "structure.vtu", "lines.vtu", "membranes.vtu")
PAGE = "report.html"
REPORT = (*(f"{name}.{kind}" for name in CAPTIONS for kind in ("png", "svg")), *MESHES, PAGE)
RESULTS = (*TABLES, *REPORT)  # all files that a run may write


def missing_libraries() -> str:
    """One sentence on what to install for `write_report`, empty if all is there; nothing is loaded."""
    missing = [name for name in LIBRARIES if find_spec(name) is None]
    if not missing:
        return ""
    verb = "is" if len(missing) == 1 else "are"
    return (
        f"no plots, VTK files and HTML report, because {', '.join(missing)} {verb} not installed; "
        "pip install 'kitecosim[report]' brings what they need."
    )


def write_report(
    folder: str | Path, scene: Any, run: "Run", content: dict[str, Any], cores: Mapping[str, Any] | None = None
) -> list[str]:
    """Write plots (PNG, SVG), VTK files and report.html of a `run` (see `coupled_run`) of `scene`; their names.

    `content` is `summary(run, settings)`, with "versions" if the page shall name them; its setting "labels" says what
    has names in a plot of its own (None: no such plot). What the scene lacks is left out. `cores` of the scene save
    making some. ModuleNotFoundError with the sentence of `missing_libraries` where they are not installed.
    """
    sentence = missing_libraries()
    if sentence:
        raise ModuleNotFoundError(sentence)
    from master.report import figures, membranes, vtk
    from master.report.page import page

    state = final_state(scene, run)
    drawn = _drawn(scene, run, content.get("settings", {}), state)
    skin = membranes.membrane_state(scene.members, run.blocks["structural"])
    images = {name: figures.rendered(figure) for name, figure in drawn.items()}
    content_of: dict[str, str | bytes] = {f"{n}.{kind}": data for n, i in images.items() for kind, data in i.items()}
    if len(state.surface.panels):
        content_of["wing.vtu"] = vtk.wing_file(state.surface)
    if skin is not None:
        content_of["membranes.vtu"] = vtk.membranes_file(skin)
    if state.frame is not None:
        content_of["structure.vtu"] = vtk.structure_file(state.frame)
    if len(state.surface.lines):
        content_of["lines.vtu"] = vtk.lines_file(state.surface)
    captions = CAPTIONS if scene.has_flow else {**CAPTIONS, "shape": AT_REST}
    captions = captions if scene.has_structure else {**captions, "shape": RIGID}
    shown = {name: (captions[name], image["svg"]) for name, image in images.items()}
    content_of[PAGE] = page(scene, run, content, state, shown, cores)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in content_of.items():
        write_whole(folder / name, data)
    return list(content_of)


def _drawn(scene: Any, run: "Run", settings: Mapping[str, Any], state: "FinalState") -> dict[str, "Figure"]:
    """Name -> figure of what there is to draw of a run with these settings in its final state."""
    from master.report import billowing, figures, line_rows, membranes, ribs, shape
    from master.report.convergence import convergence_figure
    from master.report.sections import wing_sections

    status = status_text(run.status)
    aero = run.blocks["aero"]
    title, wind = scene.title, wind_of(aero)
    if wind is not None:
        title += f", wind {float(aero['wind_speed']):g} m/s"
    elif not scene.has_flow:
        title += ", in still air"
    gravity = np.array([0.0, 0.0, -float(run.blocks["structural"].get("gravity", 0.0))])
    drawn = {"shape": shape.shape_figure(state, title, status, wind, gravity)}
    if settings.get("labels") is not None:
        from master.report.labels import labels_figure

        named = labels_figure(state, f"{title}, {status}", settings["labels"], wind is not None)
        drawn |= {} if named is None else {"labels": named}
    sections = wing_sections(scene.members.wing, None if state.frame is None else state.frame.position)
    if sections is not None:
        drawn["billowing"] = billowing.billowing_figure(sections, f"{title}, {status}")
    skin = membranes.membrane_state(scene.members, run.blocks["structural"])
    if skin is not None and np.all(np.isfinite(skin.position)):
        drawn["membranes"] = membranes.membrane_figure(skin, f"{title}, {status}", run.status)
    surface = state.surface
    of_ribs = ribs.ribs(scene.members, run.blocks["structural"], scene.interface, surface.position, surface.loads)
    if of_ribs:
        drawn["ribs"] = ribs.rib_figure(of_ribs, f"{title}, {status}")
    of_rows = line_rows.line_rows(scene.members, run.blocks["structural"].get("tension"))
    if of_rows is not None and np.all(np.isfinite(run.blocks["structural"]["tension"])):
        drawn["rib_lines"] = line_rows.line_row_figure(of_rows, f"{title}, {status}")
    if scene.has_structure:
        drawn["convergence"] = convergence_figure(
            run.result.history,
            f"{title}, {status}",
            settings.get("tolerance"),
            settings.get("force_tolerance"),
            run.result.residual_N if scene.has_flow else None,  # no flow to evaluate again
        )
    if state.loading:
        from master.report.loading_plot import loading_figure

        drawn["loading"] = loading_figure(state.loading, f"{title}, {status}")
    if state.strips is not None:
        drawn["strips"] = figures.strip_figure(state.strips, f"{title}, {status}")
        if state.strips.coefficients is not None:
            drawn["polars"] = figures.polar_figure(state.strips, f"{title}, {status}")
    return drawn
