"""The result of a run on standard output."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from master.report.tables import result_rows

if TYPE_CHECKING:
    from master.coupling.run import Run

EXIT_CONVERGED, EXIT_NOT_CONVERGED = 0, 1  # of the commands that solve


def print_table(scene: Any, run: "Run", content: dict[str, Any]) -> None:
    """The result of a run as a table on standard output, with its remarks and, if it failed, why."""
    from rich.markup import escape
    from rich.table import Table

    title = escape(f"{scene.title}: {run.status}")
    table = Table(title=title, show_header=False, title_justify="left")
    for row in result_rows(scene, run, content):
        table.add_row(*map(escape, row))
    console = new_console()
    console.print(table)
    for remark in run.remarks:
        console.print(f"note: {remark}", soft_wrap=True, markup=False)
    if run.status != "converged":
        console.print(f"{run.status}: {run.message}", soft_wrap=True, markup=False)


def print_rows(title: str, rows: Iterable[tuple[str, str]], notes: Iterable[str] = ()) -> None:
    """Names and texts as a table with a title on standard output, and notes below it."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(title), show_header=False, title_justify="left")
    for row in rows:
        table.add_row(*map(escape, row))
    console = new_console()
    console.print(table)
    for note in notes:
        console.print(note, soft_wrap=True, markup=False)


def print_written(folder: Path, names: Iterable[str], remark: str = "") -> None:
    """Which files a run has left, and a remark on those it has not."""
    if remark:
        new_console().print(f"note: {remark}", soft_wrap=True, markup=False)
    new_console().print(f"written: {folder}/{', '.join(names)}", soft_wrap=True, markup=False)


def new_console() -> Any:
    """A console on standard output, as wide as the terminal or 110 columns."""
    from rich.console import Console

    return Console(highlight=False, width=None if sys.stdout.isatty() else 110)
