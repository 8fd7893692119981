"""What `kitecosim couple` leaves behind: rows while it runs, and tables, a plot and a summary at its end."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from master.coupling.march import Steps
from master.fmu_coupling.document import Document
from master.report.record import POINTS, Curve, Rows
from master.report.tables import versions, write_json, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PLOTS = ("results.png", "results.svg")
TABLES = ("results.csv", "steps.csv", "summary.json")
RESULTS = (*TABLES, *PLOTS)  # all files that a run may write
PANELS = 6  # most blocks in the plot
NO_PLOT = "no plot, because matplotlib is not installed; pip install 'kitecosim[report]' brings it."
# Told after every communication step (steady: evaluation): its number, the time s, the residual norm, the blocks that
# are recorded by name.
Follower = Callable[[int, float, float, Mapping[str, np.ndarray]], object]


@dataclass(frozen=True, eq=False)
class CoupleResult:
    """End of a coupled run.

    `status` and `message` as in `MarchResult`; `time` s is how far it came, `steps` what every communication step took
    (steady: every evaluation is one), `values` the recorded blocks at the end, `seconds` the wall time of each
    participant, of all ("total") and of loading the FMUs ("set_up"), `logs` the last (status of FMI, sentence) of each,
    `remarks` what else is worth a line.
    """

    status: str
    message: str
    time: float
    steps: Steps
    evaluations: int
    values: dict[str, np.ndarray]
    seconds: dict[str, float]
    logs: dict[str, list[tuple[int, str]]]
    remarks: list[str] = field(default_factory=list)

    @property
    def converged(self) -> bool:
        """Whether every communication step was solved to tolerance."""
        return self.status == "converged"


class Recorder:
    """Follows a run of a document into a folder; as a context manager it leaves what there is if the run breaks off."""

    def __init__(self, folder: Path, document: Document) -> None:
        self.folder, self.document = folder, document
        self.steps: Steps | None = None
        self.written: list[str] = []
        self.remark = ""
        header = ["time_s"]
        for name, block in document.record:
            header += [f"{name}.{block}{index}" for index in _indices(document.described[name].blocks[block])]
        self._header = header
        self._rows: Rows | None = None  # from the first row on
        self.curves = {f"{name}.{block}": Curve() for name, block in document.record}

    def __call__(self, number: int, time: float, residual: float, values: Mapping[str, np.ndarray]) -> None:
        """See Follower."""
        row: list[Any] = [repr(time)]
        for name, value in values.items():
            flat = np.ravel(value)
            row += map(repr, flat.tolist())
            self.curves[name].add(time, flat if flat.size <= 3 else np.atleast_1d(np.linalg.norm(flat)))
        self._begun().add(row)

    def _begun(self) -> Rows:
        """The rows, from the first one on: all input is known to be good then."""
        if self._rows is None:
            self._rows = Rows(self.folder / "results.csv", self._header)
        return self._rows

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._close()
        if error is not None and self.steps is not None:
            _write_steps(self.folder / "steps.csv", self.steps, self.document)

    def _close(self) -> None:
        if self._rows is not None:
            self._rows.close()

    def finish(self, result: CoupleResult, report: bool = True) -> None:
        """Write what is left to write at the end of a run."""
        self._begun()
        self._close()
        _write_steps(self.folder / "steps.csv", result.steps, self.document)
        write_json(self.folder / "summary.json", summary(self.document, result))
        self.written = list(TABLES)
        if report and find_spec("matplotlib") is None:
            self.remark = NO_PLOT
        elif report and result.values:  # none where not even the start could be recorded
            from master.report.figures import rendered

            title = f"{Path(self.document.file).stem}, {result.status.replace('_', ' ')}"
            for kind, data in rendered(couple_figure(title, self.curves, result.steps, self.document)).items():
                write_whole(self.folder / f"results.{kind}", data)
            self.written += PLOTS


def _indices(shape: tuple[int, ...]) -> Iterator[str]:
    """[1,1], [1,2], ... in row-major order; nothing behind a single value."""
    for place in np.ndindex(shape):
        yield f"[{','.join(str(i + 1) for i in place)}]" if shape else ""


def _write_steps(path: Path, steps: Steps, document: Document) -> None:
    """A row a communication step (steady: an evaluation)."""
    rows = Rows(path, ["time_s", "status", "evaluations", "residual", "recoveries"])
    statuses = steps.statuses
    if document.settings.mode == "steady":
        statuses[:-1] = ["iterating"] * (len(statuses) - 1)
    try:
        columns = (steps.times, statuses, steps.iterations, steps.residuals, steps.recoveries)
        for t, status, evaluations, residual, recoveries in zip(*columns, strict=True):
            rows.add([repr(t), status, evaluations, repr(residual), recoveries])
    finally:
        rows.close()


def summary(document: Document, result: CoupleResult) -> dict[str, Any]:
    """The content of summary.json."""
    s, steps, seconds = document.settings, result.steps, result.seconds
    apart = {name: seconds[name] for name in document.participants}
    return {
        "file": document.file,
        "status": result.status,
        "message": result.message,
        "mode": s.mode,
        "scheme": s.scheme,
        "time": result.time,
        "steps": len(steps) if s.mode == "transient" else None,
        "steps_recovered": steps.count("recovered") if s.mode == "transient" else None,
        "steps_not_converged": _failed(steps) if s.mode == "transient" else None,
        "evaluations": result.evaluations,
        "recoveries": sum(steps.recoveries),
        "residual": steps.residuals[-1] if len(steps) else None,
        "messages": [{"step": number, "message": sentence} for number, sentence in steps.messages],
        "remarks": [*document.remarks, *result.remarks],
        "fmu_messages": {name: [text for _, text in log] for name, log in result.logs.items()},
        "wall_time_s": {
            "total": seconds["total"],
            "set_up": seconds["set_up"],
            **apart,
            "master": seconds["total"] - seconds["set_up"] - sum(apart.values()),
        },
        "outputs": result.values,
        "settings": {key: value for key, value in vars(s).items() if s.mode == "transient" or key not in STEPPING},
        "participants": {
            name: {
                "fmu": document.source(name),
                "model": document.described[name].model,
                "made_with": document.described[name].tool,
                "saves_state": document.described[name].saves_state,
                "memoryless": member.memoryless,
                "substeps": member.substeps,
                "start": dict(member.start),
                "blocks": {
                    block: {"variables": named.variables, "factor": named.factor, "shape": named.shape}
                    for block, named in document.described[name].named.items()
                },
            }
            for name, member in document.participants.items()
        },
        "connections": [
            {"from": c.field, "to": f"{c.target}.{c.input}", "factor": c.factor, "offset": c.offset}
            | ({"map": c.table} if c.table else {})
            for c in document.connections
        ],
        "inputs_without_source": document.unconnected(),
        "versions": versions(),
    }  # fmt: skip


STEPPING = ("stop", "predictor", "interpolation", "strict")  # settings that a steady run does not have


def _failed(steps: Steps) -> int:
    return len(steps) - steps.count("converged") - steps.count("recovered")


def result_rows(document: Document, result: CoupleResult) -> list[tuple[str, str]]:
    """What a run found, as names and texts with units."""
    s, steps, seconds = document.settings, result.steps, result.seconds
    rows = [("scheme, order", f"{s.scheme}, {s.order}")]
    if s.mode == "transient":
        n = np.array(steps.iterations)
        more = "".join(
            f", {count} {text}"
            for count, text in ((steps.count("recovered"), "recovered"), (_failed(steps), "not converged"))
            if count
        )
        rows.append(("time", f"{result.time:g} s of {s.stop:g} s"))
        rows.append(("communication steps", f"{len(steps)} of {s.count}{more}"))
        if len(n):
            rows.append(("evaluations", f"{result.evaluations}, {n.mean():.1f} a step, at most {n.max()}"))
    else:
        rows.append(("evaluations", f"{result.evaluations}"))
    if len(steps) and (s.scheme != "explicit" or s.mode == "steady"):
        rows.append(("last residual", f"{steps.residuals[-1]:.2e}"))
    for name, value in list(result.values.items())[:12]:
        flat = np.ravel(value)
        shown = ", ".join(f"{v:.6g}" for v in flat) if flat.size <= 3 else f"norm {np.linalg.norm(flat):.6g}"
        rows.append((name, shown))
    apart = ", ".join(f"{name} {seconds[name]:.3f}" for name in document.participants)
    rows.append(("wall time", f"{seconds['total']:.3f} s (set-up {seconds['set_up']:.3f}, {apart})"))
    return rows


def couple_figure(title: str, curves: Mapping[str, Curve], steps: Steps, document: Document) -> "Figure":
    """The recorded blocks over time, components of those of up to three values, norms of the others; below them the
    evaluations of each communication step, of steady runs the residual.
    """
    from master.report.figures import DARK, LIGHT, MIDDLE, legend_beside, stacked, style, wrapped

    looks: tuple[dict[str, Any], ...] = (
        {"color": DARK, "ls": "-"},
        {"color": MIDDLE, "ls": "--"},
        {"color": LIGHT, "ls": "-."},
    )
    shown = dict(list(curves.items())[:PANELS])
    steady = document.settings.mode == "steady"
    labels = ["" for _ in shown] + ["residual" if steady else "evaluations"]
    with style():
        axis = "pseudo-time, s" if steady else "time, s"
        figure, panels = stacked(title, [1.3] * len(shown) + [1.1], labels, axis)
        for panel, (name, curve) in zip(panels, shown.items(), strict=False):
            values = np.array(curve.values)
            name, _, block = name.partition(".")
            size = int(np.prod(document.described[name].blocks[block]))
            heading = wrapped(f"{name}.{block}", 1.1)
            for k, column in enumerate(values.T):
                label = heading if size == 1 else f"{k + 1}" if size <= 3 else f"norm of\n{heading}"
                panel.plot(curve.times, column, label=label, **looks[k])
            legend_beside(panel)
            legend = panel.get_legend()
            if legend is not None and 1 < size <= 3:
                legend.set_title(heading)
        t, values = _highest(np.array(steps.times), np.array(steps.residuals if steady else steps.iterations, float))
        if steady:
            values = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
            panels[-1].set_yscale("log")
            panels[-1].plot(t, values, "o-", color=DARK, ms=3.0)
        else:
            panels[-1].plot(t, values, drawstyle="steps-pre", color=DARK)
            panels[-1].set_ylim(0.0, 1.1 * max(values, default=1.0))
    return figure


def _highest(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At most POINTS of many values over time: the highest of equally many neighbours."""
    stride = -(-len(times) // POINTS)
    if stride <= 1:
        return times, values
    begins = np.arange(0, len(times), stride)
    return times[begins], np.maximum.reduceat(values, begins)
