"""`kitecosim run` of a transient scene: in time, into a folder of results."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from master.coupling import checkpoint
from master.coupling.acceleration import Scheme
from master.coupling.convergence import required_number
from master.coupling.exchange import Exchange
from master.coupling.march import MOST_STEPS, March
from master.coupling.participants import Participant
from master.coupling.schemes import SCHEMES
from master.coupling.simulation import PARAMETERS, Inputs, Simulation, simulate
from master.report import missing_libraries, print_written, versions, write_json, write_state
from master.report.console import print_rows
from master.report.transient import NO_PLOTS, Recorder, nothing_on, result_rows, summary, write_plots
from master.report.validity import validity_row
from master.restart import Job, StepCheckpointWriter, inputs_file, resumed_march

EXIT_FINISHED, EXIT_NOT_FINISHED = 0, 1
MOST_SUBSTEPS = 1e6  # of the integration within a communication step; the solver refuses more


def run_transient(
    job: Job,
    participants: contextlib.AbstractContextManager[dict[str, Participant]],
    live: bool = False,
    stop_time: float | None = None,
    step: float | None = None,
    inputs: Path | None = None,
) -> int:
    """Run a transient scene, print its table, write its files; the exit code.

    `participants` gives {"aero": ..., "structural": ...}, the flow only where there is one. ValueError in one sentence
    for bad input, before anything is written.
    """
    scene, choices, out = job.scene, job.choices, job.out
    _require(choices, live)
    was = {} if job.files.restart is None else checkpoint.head(job.files.restart)
    begun, before = float(was.get("time", 0.0)), was.get("validity", {})
    stop, dt = transient_times(scene, stop_time, step, begun, job.given.get("longest_step"))
    table = None if inputs is None else Inputs.read(inputs)
    about = {**job.about, "stop_time": stop, "communication_step": dt}
    about["inputs"] = None if inputs is None else inputs_file(inputs)
    remarks, kept = [*job.remembered, *scene.notes()], dict[str, Any]()  # what a checkpoint says besides
    begin = time.perf_counter()
    with participants as pair:
        if table is not None:
            table.require(pair)
        ready = time.perf_counter()
        with Recorder(out, pair, scene) as recorder, _progress(stop) as shown:

            def follow(at: float, run: Simulation) -> None:
                if recorder.fresh:
                    run.peaks.restore(before)
                    job.files.begin()
                kept["validity"] = run.peaks.record()
                recorder(at, run)
                shown(at, run)

            def resumed(exchange: Exchange, scheme: Scheme | None) -> March:
                restart = job.files.restart or Path()
                march, remark = resumed_march(restart, exchange, scheme, about, job.assigned)
                remarks.insert(0, remark)
                return march

            writer = StepCheckpointWriter(job.files, stop, about, lambda: kept)
            run = simulate(
                pair, stop, dt, choices["scheme"], choices["order"], choices["tolerance"], choices["max_iterations"],
                table, follow, writer, None if job.files.restart is None else resumed,
                **scheme_parameters(choices),
            )  # fmt: skip
            blocks, remarks = run.blocks, remarks + writer.remarks
        seconds = {"set_up": ready - begin, "total": time.perf_counter() - ready}
    settings = {k: choices[k] for k in ("scheme", "order", "backend", "tolerance", "max_iterations")}
    settings |= {"stop_time": stop, "communication_step": dt}
    settings |= {"inputs": None if inputs is None else str(inputs), "scene_settings": scene.settings}
    settings |= {"parameters_set": job.given, "scheme_parameters": scheme_parameters(choices)}
    content = summary(scene, run, blocks, settings, seconds) | {"versions": versions()}
    _write(job, run, blocks, content, recorder, remarks)
    good = run.finished and (not job.strict or all(j.within for j in run.validity))
    return EXIT_FINISHED if good else EXIT_NOT_FINISHED


def scheme_parameters(choices: dict[str, Any]) -> dict[str, Any]:
    """The parameters of a scheme for transient scenes with the choices of the command line."""
    factor = choices["relaxation"]
    given = {} if factor is None else {SCHEMES[choices["scheme"]].relaxation: factor}
    return PARAMETERS.get(choices["scheme"], {}) | given


def transient_times(
    scene: Any, stop_time: float | None, step: float | None, begun: float = 0.0, longest: float | None = None
) -> tuple[float, float]:
    """Stop time and communication step s, the scene's own where they are None, of a run that begins at `begun` s and
    integrates in steps of at most `longest` s.
    """
    dynamics = scene.dynamics
    stop = required_number("--stop-time", dynamics.stop_time if stop_time is None else stop_time)
    dt = required_number("--step", dynamics.communication_step if step is None else step)
    longest = float(dynamics.longest_step if longest is None else longest)
    if dt > MOST_SUBSTEPS * longest:
        raise ValueError(
            f"--step {dt:g} s takes more than {MOST_SUBSTEPS:g} steps of the integration, which are of {longest:g} s "
            "at most (longest_step); take a shorter one."
        )
    if not (stop - begun) / dt < MOST_STEPS:
        raise ValueError(
            f"--stop-time {stop:g} s takes more than {MOST_STEPS:g} communication steps of {dt:g} s; change one."
        )
    count = round((stop - begun) / dt)
    if count < 0:
        raise ValueError(f"--stop-time {stop:g} s lies before the {begun:g} s of the checkpoint; take a later one.")
    if (count < 1 and not begun) or abs(count * dt - (stop - begun)) > 1e-6 * dt:
        after = f" after the {begun:g} s of the checkpoint" if begun else ""
        raise ValueError(
            f"--stop-time {stop:g} s is no whole number of communication steps of {dt:g} s{after}; change one."
        )
    return stop, dt


def _write(
    job: Job,
    run: Simulation,
    blocks: dict[str, dict[str, np.ndarray]],
    content: dict[str, Any],
    recorder: Recorder,
    remarks: list[str],
) -> None:
    """Print the table of a run and write its files but history.csv, which is there."""
    scene, out = job.scene, job.out
    merged = {**blocks["structural"], **blocks.get("aero", {})}
    if not run.finished and "displacement" in blocks["structural"]:  # the flow may have seen another iterate
        merged["displacement"] = blocks["structural"]["displacement"]
        last = f"the last coupling iteration of step {len(run.steps)}" if len(run.steps) else "the start"
        remarks = [*remarks, f"not finished: the tables are of one shape of the structure, that of {last}"]
    labels = {"position": scene.members.labels, "tension": scene.members.names, "line_load": scene.members.leg_names}
    merged = nothing_on(scene.interface) | merged
    written = ["summary.json", "history.csv"]
    if all(blocks.values()):  # else a participant has ended, and what it had is not known
        written += write_state(out, merged, labels, scene.interface, None)
    write_json(out / "summary.json", content | {"remarks": remarks})
    lacking = ""
    if job.choices["report"]:
        lacking = missing_libraries() if find_spec("matplotlib") is None else ""
        if not lacking:
            written += write_plots(out, scene, run, blocks, recorder, job.choices.get("labels"))
        else:
            lacking = NO_PLOTS
    job.place()
    notes = [f"note: {remark}" for remark in remarks]
    notes += [f"note: step {number}: {sentence}" for number, sentence in list(run.steps.messages)[-3:]]
    if not run.finished:
        notes.append(f"{run.status}: {run.message}")
    print_rows(f"{scene.title}: {run.status}", [*result_rows(content), validity_row(run.validity)], notes)
    print_written(job.results.named, written, lacking)


def _require(choices: dict[str, Any], live: bool) -> None:
    if live:
        raise ValueError(
            "--live shows the coupling iterations of a quasi-static scene; leave it out for a transient one."
        )
    if SCHEMES[choices["scheme"]].exact:
        raise ValueError(f"--scheme {choices['scheme']} takes derivatives of quasi-static solves; choose another one.")


@contextlib.contextmanager
def _progress(stop: float) -> Iterator[Callable[[float, Simulation], None]]:
    """A bar on a terminal, nothing elsewhere."""
    if not sys.stderr.isatty():
        yield lambda at, run: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.completed:9.3f} s"), BarColumn(), TextColumn("{task.fields[steps]} steps"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=stop, steps=0)
        yield lambda at, run: bar.update(task, completed=at, steps=len(run.steps))
