"""The command `kitecosim couple`: a file coupled with a progress bar, a table and results."""

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from master.coupling.checkpoint import NO_FILES, Files
from master.coupling.participants import fmu
from master.fmu_coupling.document import Document
from master.fmu_coupling.results import NO_PLOT, RESULTS, Follower, result_rows
from master.fmu_coupling.run import couple
from master.report.console import EXIT_CONVERGED, EXIT_NOT_CONVERGED, print_rows, print_written

SHOWN = 8  # sentences about steps, and inputs without a source, on the terminal


def couple_file(
    path: Path,
    out: Path | None = None,
    report: bool = True,
    files: Files = NO_FILES,
    force: bool = False,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    watch: Callable[[str], Any] | None = None,
) -> int:
    """Couple the FMUs of a file with some `settings` in place of its own, print its table, write its results; the exit
    code. `watch` is told whose code is called.
    """
    fmu.WATCH = watch
    document = Document.read(path, settings)
    out = out or Path("results") / path.stem
    with _progress(document) as follow:
        result = couple(document, out, report, follow, files, force)
    left = document.unconnected()
    more = f" and {len(left) - SHOWN} more" if len(left) > SHOWN else ""
    notes = [f"note: inputs without a source keep their start values: {', '.join(left[:SHOWN])}{more}"] if left else []
    notes += [f"note: {remark}" for remark in (*document.remarks, *result.remarks)]
    events = list(result.steps.messages)
    notes += [f"note: step {number}, {sentence}" for number, sentence in events[:SHOWN]]
    notes += [f"note: {len(events) - SHOWN} more such notes are in summary.json"] if len(events) > SHOWN else []
    if not result.converged:
        notes.append(f"{result.status}: {result.message}")
    print_rows(f"{path.stem}: {result.status}", result_rows(document, result), notes)
    written = [name for name in RESULTS if (out / name).exists()]
    print_written(out, written, NO_PLOT if report and find_spec("matplotlib") is None else "")
    return EXIT_CONVERGED if result.converged else EXIT_NOT_CONVERGED


@contextlib.contextmanager
def _progress(document: Document) -> Iterator[Follower | None]:
    """A bar of communication steps, or a line about the residual of a steady run, on a terminal; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console, s = Console(stderr=True), document.settings
    if s.mode == "steady":
        with console.status("coupling ...") as status:

            def tell(number: int, time: float, residual: float, values: Mapping[str, np.ndarray]) -> None:
                status.update(f"evaluation {number}: residual {residual:.3e}")

            yield tell
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("communication steps", total=s.count)

        def advance(number: int, time: float, residual: float, values: Mapping[str, np.ndarray]) -> None:
            bar.update(task, completed=number)

        yield advance
