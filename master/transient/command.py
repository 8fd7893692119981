"""`kitecosim run` of a scene in motion: through time, into a folder of results."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from master.participants import Participant
from master.report import missing_libraries, print_written, versions, write_json, write_state
from master.report.console import print_rows
from master.restart import NO_FILES, Files
from master.schemes import SCHEMES
from master.transient.inputs import Inputs
from master.transient.record import Recorder
from master.transient.results import NO_PLOTS, RESULTS, result_rows, summary, write_plots
from master.transient.simulation import PARAMETERS, Simulation, simulate

EXIT_FINISHED, EXIT_NOT_FINISHED = 0, 1


def run_moving(
    scene: Any,
    given: dict[str, Any],
    choices: dict[str, Any],
    participants: contextlib.AbstractContextManager[dict[str, Participant]],
    out: Path,
    files: Files = NO_FILES,
    live: bool = False,
    stop_time: float | None = None,
    step: float | None = None,
    inputs: Path | None = None,
) -> int:
    """Run a `scene` in motion with `given` parameters, print its table, write its files; the exit code.

    `choices` are those of the command line; `participants` gives {"aero": ..., "structural": ...}, the flow only where
    there is one. ValueError in one sentence for bad input, before anything is written.
    """
    _require(choices, files, live)
    factor = choices["relaxation"]
    parameters = dict(PARAMETERS.get(choices["scheme"], {}))
    parameters |= {} if factor is None else {SCHEMES[choices["scheme"]].relaxation: factor}
    dynamics = scene.content["dynamics"]
    stop = float(dynamics["stop_time"] if stop_time is None else stop_time)
    dt = float(dynamics["communication_step"] if step is None else step)
    for name, value in (("--stop-time", stop), ("--step", dt)):
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be a number of seconds above zero, not {value:g}.")
    count = round(stop / dt)
    if count < 1 or abs(count * dt - stop) > 1e-6 * dt:
        raise ValueError(f"--stop-time {stop:g} s is no whole number of communication steps of {dt:g} s; change one.")
    table = None if inputs is None else Inputs.read(inputs)
    begin = time.perf_counter()
    with participants as pair:
        if table is not None:
            table.require(pair)
        for name in RESULTS:  # so that what stands there is never of an earlier run
            (out / name).unlink(missing_ok=True)
        ready = time.perf_counter()
        with Recorder(out, pair, scene) as recorder, _progress(count) as shown:

            def follow(at: float, run: Simulation) -> None:
                recorder(at, run)
                shown(at, run)

            run = simulate(
                pair, stop, dt, choices["scheme"], choices["order"], choices["tolerance"], choices["max_iterations"],
                table, follow, **parameters,
            )  # fmt: skip
            blocks = run.blocks
        seconds = {"set_up": ready - begin, "total": time.perf_counter() - ready}
    settings = {k: choices[k] for k in ("scheme", "order", "backend", "tolerance", "max_iterations")}
    settings |= {"stop_time": stop, "communication_step": dt}
    settings |= {"inputs": None if inputs is None else str(inputs), "scene_settings": scene.settings}
    settings |= {"parameters_set": given, "scheme_parameters": parameters}
    content = summary(scene, run, blocks, settings, seconds)
    content["versions"] = versions()
    merged = {**blocks["structural"], **blocks.get("aero", {})}
    labels = {"position": scene.members.labels, "tension": scene.members.names, "line_load": scene.members.leg_names}
    merged.setdefault("pressure", np.zeros(len(scene.interface.panels)))
    written = ["summary.json", "history.csv", *write_state(out, merged, labels, scene.interface, None)]
    write_json(out / "summary.json", content)
    lacking = ""
    if choices["report"]:
        lacking = missing_libraries() if find_spec("matplotlib") is None else ""
        if not lacking:
            written += write_plots(out, scene, run, blocks, recorder)
        else:
            lacking = NO_PLOTS
    notes = [f"note: step {number}: {sentence}" for number, sentence in list(run.steps.messages)[-3:]]
    if not run.finished:
        notes.append(f"{run.status}: {run.message}")
    print_rows(f"{scene.content['title']}: {run.status}", result_rows(content), notes)
    print_written(out, written, lacking)
    return EXIT_FINISHED if run.finished else EXIT_NOT_FINISHED


def _require(choices: dict[str, Any], files: Files, live: bool) -> None:
    if files.checkpoint is not None or files.restart is not None:
        raise ValueError("scenes in motion have no checkpoints; leave --checkpoint and --restart out.")
    if live:
        raise ValueError("--live shows the iterations of one equilibrium; leave it out for a scene in motion.")
    if SCHEMES[choices["scheme"]].exact:
        raise ValueError(f"--scheme {choices['scheme']} takes derivatives of equilibria; choose another one.")


@contextlib.contextmanager
def _progress(count: int) -> Iterator[Callable[[float, Simulation], None]]:
    """A bar on a terminal, nothing elsewhere."""
    if not sys.stderr.isatty():
        yield lambda at, run: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.fields[at]:9.3f} s"), BarColumn(), TextColumn("{task.completed} steps"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=count, at=0.0)
        yield lambda at, run: bar.update(task, advance=1 if at > 0.0 else 0, at=at)
