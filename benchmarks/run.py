"""Runs entries of the registry and writes what they leave: `NAME.csv`, `NAME.svg` and `NAME.md`, and machine.json."""

import json
import sys
import time
import traceback
from contextlib import contextmanager
from pathlib import Path

from .harness import machine, measured, write_csv, wrong
from .plots import draw
from .registry import Case
from .text import case_fragment, command


def run(entries, out: Path, quick=False, memory=True):
    """Run the entries one after the other; sentences about what failed, empty if nothing did.

    An entry that fails leaves no files, also no old ones, and does not keep the others from running.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "machine.json").write_text(json.dumps(machine(quick), indent=2) + "\n")
    failed = []
    with _shown(len(entries)) as show:
        for k, entry in enumerate(entries):
            begin = time.perf_counter()
            for old in (out / f"{entry.name}{suffix}" for suffix in (".csv", ".svg", ".md")):
                old.unlink(missing_ok=True)
            show.begin(k, entry.name)
            try:
                problems = _one(entry, out, quick, memory, show.part)
            except Exception as error:
                traceback.print_exc()
                problems = [f"{entry.name} raised {type(error).__name__}: {error}"]
            failed += problems
            show.end(k, entry.name, time.perf_counter() - begin, problems)
    return failed


def _one(entry, out, quick, memory, progress):
    problems = []
    if isinstance(entry, Case):
        rows = measured(entry, quick, memory, progress)
        problems = wrong(entry, rows)
        write_csv(out / f"{entry.name}.csv", rows)
        if problems:
            return problems
        draw(entry, rows, out / f"{entry.name}.svg")
        text = case_fragment(entry, rows)
    else:
        text = f"{entry.title}.\n\n{entry.build(quick)}"
        if entry.draw:
            entry.draw(out / f"{entry.name}.svg")
    (out / f"{entry.name}.md").write_text(f"{text}\n\n{command(entry.name)}\n", encoding="utf-8")
    return problems


@contextmanager
def _shown(total):
    """A progress bar on a terminal, a line an entry otherwise."""
    if not sys.stderr.isatty():
        yield _Lines(total)
        return
    from rich.console import Console
    from rich.progress import BarColumn as Bar
    from rich.progress import Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), Bar(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        yield _Bars(total, progress)


class _Lines:
    """What ran and how long it took, a line each."""

    def __init__(self, total):
        self.total = total

    def begin(self, k, name):
        print(f"[{k + 1}/{self.total}] {name}", file=sys.stderr, flush=True)

    def part(self, done, of):
        pass

    def end(self, k, name, seconds, problems):
        word = "failed" if problems else "done"
        print(f"[{k + 1}/{self.total}] {name} {word}, {seconds:.1f} s", file=sys.stderr, flush=True)


class _Bars(_Lines):
    """Two bars: all entries, and the points of this one."""

    def __init__(self, total, progress):
        super().__init__(total)
        self.progress = progress
        self.whole = progress.add_task("all", total=total)
        self.task = progress.add_task("", total=None)

    def begin(self, k, name):
        self.progress.reset(self.task, description=name, total=None)

    def part(self, done, of):
        self.progress.update(self.task, completed=done, total=of)

    def end(self, k, name, seconds, problems):
        word = "failed" if problems else "done"
        self.progress.console.print(f"{name} {word}, {seconds:.1f} s", highlight=False)
        self.progress.update(self.whole, completed=k + 1)
