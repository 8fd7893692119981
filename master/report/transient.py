"""What a transient run leaves: rows, curves and shapes as it advances, tables and plots at its end."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace, TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from interface import StepFailed
from master.coupling.participants import Participant
from master.coupling.simulation import Simulation
from master.report import RESULTS as STATIC_RESULTS
from master.report.record import Curve, Rows
from master.report.tables import write_whole
from master.report.views import FROM_LEFT, FROM_UPWIND, View, axis_labels, wind_axes, wind_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from master.report.state import FinalState

PLOTS = tuple(f"{name}.{kind}" for name in ("motion", "shapes") for kind in ("png", "svg"))
RESULTS = (*STATIC_RESULTS, *PLOTS)  # all files that a run may write
NO_PLOTS = "no plots, because matplotlib is not installed; pip install 'kitecosim[report]' brings it."
ENERGIES = ("kinetic_energy", "elastic_energy", "external_work", "reeling_work", "dissipated_energy", "numerical_loss")
SHAPES, SHOWN = 48, 9  # most shapes kept, and in the plot


class Recorder:
    """Follows a run into `folder`; as a context manager it leaves what there is if the run breaks off.

    `curves` name -> values over time of every scalar and vector output; `shapes` (time s, positions (n,3) m), thinned
    out by half whenever there are more than SHAPES.
    """

    def __init__(self, folder: Path, participants: dict[str, Participant], scene: Any) -> None:
        self._folder, self._scene = folder, scene
        self._names = dict(_outputs(participants))
        self.curves = {name: Curve() for name in self._names}
        self.shapes: list[tuple[float, np.ndarray]] = []
        self._every = self._seen = 0
        self._rows: Rows | None = None

    @property
    def fresh(self) -> bool:
        """Whether nothing has been taken down yet."""
        return self._rows is None

    def __call__(self, at: float, run: Simulation) -> None:
        """Take down a communication step, or the start."""
        steps = run.steps
        known = len(steps) > 0 and at > 0.0
        row: list[Any] = [repr(at), steps.statuses[-1] if known else "start"]
        row += [steps.iterations[-1] if known else 0, repr(steps.residuals[-1]) if known else ""]
        found = {name: _given(run, side, block) for name, (side, block) in self._names.items()}
        position = _given(run, "structural", "position")
        for name, values in found.items():
            self.curves[name].add(at, np.ravel(values))
            row += map(repr, np.ravel(values).tolist())
        if self._rows is None:
            self._rows = Rows(self._folder / "history.csv", self._header())
        self._rows.add(row)
        self._keep(at, position)

    def _keep(self, at: float, position: np.ndarray) -> None:
        self._every = self._every or 1
        if self._seen % self._every == 0:
            self.shapes.append((at, position))
            if len(self.shapes) > SHAPES:
                self.shapes, self._every = self.shapes[::2], 2 * self._every
        self._seen += 1

    def _header(self) -> list[str]:
        header = ["time_s", "status", "evaluations", "residual"]
        for name, (side, block) in self._names.items():
            size = self._sizes[side, block]
            header += [name] if size == 1 else [f"{name}[{k + 1}]" for k in range(size)]
        return header

    @property
    def _sizes(self) -> dict[tuple[str, str], int]:
        return {(side, block): len(np.atleast_1d(self.curves[n].values[0])) for n, (side, block) in self._names.items()}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._rows is not None:
            self._rows.close()


def _given(run: Simulation, side: str, block: str) -> np.ndarray:
    """The present values of a block; StepFailed, which ends the run with its status, if they cannot be had."""
    try:
        return run.participants[side].get(block)
    except (ValueError, RuntimeError) as error:
        raise StepFailed(f"the {side} solver could not give {block}: {str(error).rstrip('.')}") from error


def _outputs(participants: dict[str, Participant]) -> Iterator[tuple[str, tuple[str, str]]]:
    """Name -> side and block of every output of one or three values; with the side in front where both have it."""
    names = [b for p in participants.values() for b, c in p.causality.items() if c == "output"]
    for side in ("structural", "aero"):
        participant = participants.get(side)
        if participant is None:
            continue
        for block, causality in participant.causality.items():
            if causality == "output" and participant.blocks[block] in ((), (3,)):
                yield (f"{side}.{block}" if names.count(block) > 1 else block), (side, block)


def summary(
    scene: Any,
    run: Simulation,
    blocks: dict[str, dict[str, np.ndarray]],
    settings: dict[str, Any],
    seconds: dict[str, float],
) -> dict[str, Any]:
    """The content of summary.json."""
    steps, n = run.steps, np.array(run.steps.iterations)
    outputs = {
        f"{side}.{block}": values
        for side, participant in run.participants.items()
        for block, values in blocks[side].items()
        if participant.causality[block] == "output" and values.shape in ((), (3,))
    }
    apart = {side: float(run.seconds.get(side, 0.0)) for side in run.participants}
    return {
        "scene": scene.name,
        "scheme": settings["scheme"],
        "backend": settings["backend"],
        "status": run.status,
        "message": run.message,
        "time": run.time,
        "steps": len(steps),
        "steps_recovered": steps.count("recovered"),
        "evaluations": run.evaluations,
        "evaluations_per_step": {"mean": float(n.mean()) if len(n) else None, "max": int(n.max()) if len(n) else None},
        "messages": [{"step": number, "message": sentence} for number, sentence in steps.messages],
        "real_time_factor": (run.time - run.start) / seconds["total"] if seconds["total"] > 0.0 else None,
        "wall_time_s": {**seconds, **apart, "master": seconds["total"] - sum(apart.values())},
        "validity": [judgement.record() for judgement in run.validity],
        "outputs": outputs,
        "settings": settings,
    }


def result_rows(content: dict[str, Any]) -> list[tuple[str, str]]:
    """What a run found, as names and texts with units."""
    s, wall = content["settings"], content["wall_time_s"]
    per_step = content["evaluations_per_step"]
    rows = [
        ("scheme, order", f"{s['scheme']}, {s['order']}"),
        ("time", f"{content['time']:g} s of {s['stop_time']:g} s"),
    ]
    recovered = f", {content['steps_recovered']} recovered" if content["steps_recovered"] else ""
    rows.append(("communication steps", f"{content['steps']} of {s['communication_step']:g} s{recovered}"))
    if per_step["max"] is not None:
        rows.append(
            ("evaluations", f"{content['evaluations']}, {per_step['mean']:.1f} a step, at most {per_step['max']}")
        )
    units = {"kinetic_energy": "J", "elastic_energy": "J", "numerical_loss": "J", "present_wind_speed": "m/s"}
    units |= {
        "support_force": "N",
        "line_force": "N",
        "force": "N",
        "tip_span": "m",
        "CL": "",
        "CD": "",
        "alpha_mid": "rad",
    }
    for name, value in content["outputs"].items():
        block = name.partition(".")[2]
        if block in units:
            shown = ", ".join(f"{v:.5g}" for v in np.ravel(value))
            rows.append((block, f"{shown} {units[block]}".rstrip()))
    factor = content["real_time_factor"]
    parts = ", ".join(f"{side} {wall[side]:.2f}" for side in ("structural", "aero") if side in wall)
    rows.append(("wall time", f"{wall['total']:.2f} s ({parts}), set-up {wall['set_up']:.2f} s"))
    rows.append(("speed", f"{factor:.1f} x real time"))
    return rows


def write_plots(
    folder: Path,
    scene: Any,
    run: Simulation,
    blocks: dict[str, dict[str, np.ndarray]],
    recorder: Recorder,
    labels: str | None = None,
) -> list[str]:
    """Write the plots of a run, one of its end with names of nodes, lines or both as `labels` says, and VTK files of
    its end where meshio is there; the names of the files.
    """
    from importlib.util import find_spec

    from master.report.figures import rendered

    title = f"{scene.title}, {run.status.replace('_', ' ')}"
    wind = wind_of(blocks.get("aero", {}))
    figures = {
        "motion": motion_figure(title, recorder, run),
        "shapes": shapes_figure(title, recorder, scene, wind),
    }
    state = _end(scene, blocks) if all(blocks.values()) else None
    if labels is not None and state is not None:
        from master.report.labels import labels_figure

        named = labels_figure(state, f"{title}, at {run.time:g} s", labels, wind is not None)
        figures |= {} if named is None else {"labels": named}
    written = []
    for name, figure in figures.items():
        for kind, data in rendered(figure).items():
            write_whole(folder / f"{name}.{kind}", data)
            written.append(f"{name}.{kind}")
    if find_spec("meshio") is not None and state is not None:
        written += _meshes(folder, state)
    return written


def nothing_on(mesh: Any) -> dict[str, np.ndarray]:
    """No displacement and no pressure on an interface mesh: of a scene that lacks the blocks or the flow for them."""
    return {"displacement": np.zeros(mesh.nodes.shape), "pressure": np.zeros(len(mesh.panels))}


def _end(scene: Any, blocks: dict[str, dict[str, np.ndarray]]) -> "FinalState":
    """The state at the end of a run."""
    from master.report.state import final_state

    none = nothing_on(scene.interface)
    at_end = SimpleNamespace(blocks={side: none | blocks.get(side, {}) for side in ("structural", "aero")})
    return final_state(scene, at_end)  # type: ignore[arg-type]


def _meshes(folder: Path, state: "FinalState") -> list[str]:
    from master.report import vtk

    files = {}
    if len(state.surface.panels):
        files["wing.vtu"] = vtk.wing_file(state.surface)
    if state.frame is not None:
        files["structure.vtu"] = vtk.structure_file(state.frame)
    if len(state.surface.lines):
        files["lines.vtu"] = vtk.lines_file(state.surface)
    for name, data in files.items():
        write_whole(folder / name, data)
    return list(files)


def motion_figure(title: str, recorder: Recorder, run: Simulation) -> "Figure":
    """Forces, energies, wind and what else there is over time; below them the evaluations of each step."""
    from master.report.figures import DARK, LIGHT, MIDDLE, legend_beside, stacked, style

    curves = recorder.curves
    panels: list[tuple[str, list[tuple[str, str, np.ndarray]]]] = []

    def picked(label: str, *wanted: tuple[str, str, float]) -> None:
        found = [(text, name, factor * _size(curves[name])) for name, text, factor in wanted if name in curves]
        if found:
            panels.append((label, found))

    picked("force, N", ("support_force", "on supports", 1.0), ("line_force", "of wind on lines", 1.0))
    picked("wind, m/s", ("present_wind_speed", "wind speed", 1.0))
    picked("angle, deg", ("alpha_mid", "angle of attack\nat mid span", 180.0 / np.pi))
    picked("span, m", ("tip_span", "between tips", 1.0))
    picked("energy, J", ("elastic_energy", "elastic", 1.0), ("external_work", "work of loads", 1.0))
    picked(
        "energy, J",
        ("kinetic_energy", "kinetic", 1.0),
        ("dissipated_energy", "dissipated", 1.0),
        ("numerical_loss", "numerical loss", 1.0),
    )
    looks: tuple[dict[str, Any], ...] = (
        {"color": DARK, "ls": "-"}, {"color": MIDDLE, "ls": "--"}, {"color": LIGHT, "ls": "-."},
    )  # fmt: skip
    labels = [label for label, _ in panels] + ["evaluations"]
    with style():
        figure, axes = stacked(title, [1.2] * len(panels) + [0.9], labels, "time, s")
        for axis, (_, lines) in zip(axes, panels, strict=False):
            for k, (text, name, values) in enumerate(lines):
                axis.plot(curves[name].times[1:], values[1:], label=text, **looks[k])  # before the first step: nothing
            legend_beside(axis)
        n = np.array(run.steps.iterations, float)
        stride = max(1, len(n) // 2000)
        axes[-1].plot(np.array(run.steps.times)[::stride], n[::stride], drawstyle="steps-pre", color=DARK)
        axes[-1].set_ylim(0.0, 1.1 * max(n, default=1.0))
    return figure


def _size(curve: Curve) -> np.ndarray:
    values = np.array(curve.values)
    return values[:, 0] if values.shape[1] == 1 else np.linalg.norm(values, axis=1)


def shapes_figure(title: str, recorder: Recorder, scene: Any, wind: np.ndarray | None = None) -> "Figure":
    """The structure at some times, light first and dark at the end, from the side and from upwind.

    The views are those of the `wind` (3,) m/s; without one they are along the axes.
    """
    from master.report.figures import WIDTH, axes_at, new_figure, style

    picked = [recorder.shapes[k] for k in np.unique(np.linspace(0, len(recorder.shapes) - 1, SHOWN).astype(int))]
    legs = np.concatenate(
        [np.stack([g.nodes[:, :-1], g.nodes[:, 1:]], axis=2).reshape(-1, 2) for g in scene.members.chains]
    )
    axes_of_wind = wind_axes(wind)
    if not np.array_equal(axes_of_wind, np.eye(3)):
        picked = [(at, x @ axes_of_wind.T) for at, x in picked]
    names = axis_labels(axes_of_wind)
    span = np.maximum(np.ptp(np.concatenate([x for _, x in picked]), axis=0), 1e-3)
    views = (FROM_LEFT, FROM_UPWIND) if span[1] > 1e-2 * span[2] else (FROM_LEFT,)
    flat = span[0] < 0.1 * span[2] and len(views) == 1  # a bow that would not be seen to scale
    height = 4.2
    with style():
        figure = new_figure(height, title)
        width = (WIDTH - 0.9 - 0.7 * (len(views) - 1)) / len(views) - 0.3
        for place, view in enumerate(views):
            axes: Axes = axes_at(figure, 0.65 + place * (width + 0.7), 0.5, width, height - 1.1)
            _shapes(axes, view, picked, legs)
            axes.set_title((view.still if wind is None else view.title) + (", not to scale" if flat else ""))
            axes.set_xlabel(names[view.h])
            axes.set_ylabel(names[view.v])
            if not flat:
                axes.set_aspect("equal", adjustable="datalim")
            if view.leftward:
                axes.invert_xaxis()
            if place == 0:
                axes.legend(loc="best", fontsize=7.0)
    return figure


def _shapes(axes: "Axes", view: View, picked: list[tuple[float, np.ndarray]], legs: np.ndarray) -> None:
    """The `legs` (l,2) at all times in one view, the last one darkest."""
    for k, (at, x) in enumerate(picked):
        shade = str(0.85 * (1.0 - k / max(len(picked) - 1, 1)))
        ends = x[legs]
        lines = np.concatenate([ends, np.full((len(ends), 1, 3), np.nan)], axis=1).reshape(-1, 3)
        axes.plot(lines[:, view.h], lines[:, view.v], color=shade, lw=0.9, label=f"{at:.4g} s")
