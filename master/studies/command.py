"""The command `kitecosim compare`: options as texts, progress, the table, the exit code."""

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from master.report import print_written
from master.report.console import new_console
from master.studies import compare
from master.studies.files import FILES, lacking
from master.studies.tables import HEADER, LEGEND, WORDS, cases, shown, texts

PAGE_ONLY = ("calls", "newton", "CD")  # columns that a terminal has no room for
WIDE = 100  # columns of a terminal
EXIT_ALL_RAN, EXIT_CRASHED, EXIT_INTERRUPTED = 0, 1, 130


def compare_scenes(
    scenes: Sequence[str], schemes: str | None, values: Sequence[str], sweep: Sequence[str], out: Path, **options: Any
) -> int:
    """Compare, print a table, write files; the exit code."""
    names = None if schemes is None else [name.strip() for name in schemes.split(",") if name.strip()]
    parameters = _lists(values, "--parameters iqn-ils.omega0=0.1,0.35")
    swept = _lists(sweep, "--sweep wind_speed=8,12")
    try:
        with _progress(out) as progress:
            rows = compare(scenes, names, parameters, swept, out=out, progress=progress, **options)
    except KeyboardInterrupt:
        print(
            f"kitecosim: interrupted; finished cells are in {out}/cells, and the same command continues from there; "
            "tables of an earlier comparison stay.",
            file=sys.stderr,
        )
        return EXIT_INTERRUPTED
    print_comparison(rows)
    print_written(out, [name for name in FILES if (out / name).exists()], lacking())
    return EXIT_CRASHED if any(row["status"] == "crashed" for row in rows) else EXIT_ALL_RAN


def _lists(pairs: Sequence[str], example: str) -> dict[str, list[str]]:
    """Name -> values of NAME=VALUE,VALUE, comma-separated; vectors are semicolon-separated."""
    option = example.partition(" ")[0]
    out = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        values = [value.strip() for value in text.split(";" if ";" in text else ",")]
        if not equals or not name.strip() or not all(values):
            raise ValueError(f"{option} takes NAME=VALUE,VALUE, for example {example}; '{pair}' is not of that form.")
        if name.strip() in out:
            raise ValueError(f"{option} {name.strip()} is given twice; write all its values in one.")
        out[name.strip()] = values
    return out


@contextlib.contextmanager
def _progress(out: Path) -> Iterator[Callable[[int, int, dict[str, Any] | None], None]]:
    """A bar on a terminal; elsewhere a line where cells were there already, and where one crashes."""
    with contextlib.ExitStack() as stack:
        bar: Any = None
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

            columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
            bar = stack.enter_context(Progress(*columns, console=Console(stderr=True), transient=True))
        task = bar.add_task("", total=None) if bar is not None else None

        def progress(done: int, total: int, row: dict[str, Any] | None) -> None:
            if bar is not None:
                bar.update(
                    task, completed=done, total=total, description=f"{row['case']}, {row['label']}" if row else ""
                )
            if row is None and done:
                print(f"{done} of {total} cells were there already, in {out}/cells")
            if row is not None and row["status"] == "crashed":
                print(f"kitecosim: {row['case']}, {row['label']} crashed: {row['message']}", file=sys.stderr)

        yield progress


def print_comparison(rows: Sequence[dict[str, Any]]) -> None:
    """A table a scene on standard output, and what its columns mean."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    screen = new_console()
    left_out = PAGE_ONLY if screen.width >= WIDE else (*PAGE_ONLY, "tip_span")
    keys = [key for key in shown(rows) if key not in left_out]
    for case, members in cases(rows).items():
        table = Table(title=escape(case), title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for key in keys:
            table.add_column(HEADER[key], justify="left" if key in WORDS else "right", no_wrap=key != "label")
        for row in members:
            of = texts(row)
            table.add_row(*(escape(of[key]) for key in keys))
        screen.print(table)
    for key in keys:
        if HEADER[key] in LEGEND:
            screen.print(f"{HEADER[key]}: {LEGEND[HEADER[key]]}", soft_wrap=True, markup=False)
