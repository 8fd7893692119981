"""The command `kitecosim polar`: angles as texts, progress, tables on the console, the exit code."""

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from master.report import print_written
from master.report.console import new_console, print_rows
from master.studies.polar import COEFFICIENTS, Derivatives, Point, Polar, Progress, polar
from master.studies.polar.angles import angles
from master.studies.polar.files import FILES, lacking

EXIT_TRIED, EXIT_FAILED = 0, 1
SHOWN = (("CL_alpha", "CL", "by_alpha"), ("CM_alpha", "CM", "by_alpha"), ("CS_beta", "CS", "by_beta"),
         ("Cl_beta", "Cl", "by_beta"), ("Cn_beta", "Cn", "by_beta"))  # fmt: skip


def polar_scene(
    name: str,
    alpha: str,
    beta: str,
    assigned: dict[str, str],
    out: Path | None,
    about: str | None = None,
    shape: Path | None = None,
    with_derivatives: bool = False,
    derivatives_at: float | None = None,
    warm: bool = True,
    report: bool = True,
    force: bool = False,
) -> int:
    """Solve a polar, print its table, write its files; the exit code."""
    given = {"alpha": angles("--alpha", alpha), "beta": angles("--beta", beta)}
    out = out or Path("results/polar") / Path(name).resolve().name
    with _progress() as progress:
        found = polar(
            name, **given, settings=assigned, about=None if about is None else _point(about), shape=shape,
            with_derivatives=with_derivatives, derivatives_at=derivatives_at, warm=warm, out=out, report=report,
            force=force, progress=progress,
        )  # fmt: skip
    print_polar(found)
    print_written(out, [file for file in FILES if (out / file).exists()], lacking(report))
    crashed = any(p.status == "crashed" for p in found.points)
    failed = crashed or not any(p.converged for p in found.points) or found.lacking
    return EXIT_FAILED if failed else EXIT_TRIED


def _point(text: str) -> list[float]:
    try:
        point = [float(part) for part in text.split(",")]
    except ValueError:
        point = []
    if len(point) != 3 or not np.all(np.isfinite(point)):
        raise ValueError(f"--about takes a point in m as 0.25,0,0; '{text}' is none.")
    return point


@contextlib.contextmanager
def _progress() -> Iterator[Progress]:
    """A bar on a terminal; nothing elsewhere."""
    with contextlib.ExitStack() as stack:
        if not sys.stderr.isatty():
            yield lambda done, total, point: None
            return
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
        bar = stack.enter_context(Progress(*columns, console=Console(stderr=True), transient=True))
        task = bar.add_task("", total=None)

        def shown(done: int, total: int, point: Point | None) -> None:
            text = "" if point is None else f"alpha {point.alpha:g}, beta {point.beta:g} deg"
            bar.update(task, completed=done, total=total, description=text)

        yield shown


def print_polar(found: Polar) -> None:
    """The table of a polar on standard output, with its reference values and, if there are, its derivatives."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    screen, ref = new_console(), found.reference
    table = Table(
        title=escape(f"{found.title}, rigid"), title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    for name in ("alpha, deg", "beta, deg", *COEFFICIENTS, "CL/CD"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("status")
    for p in found.points:
        values = [p.coefficients[name] for name in COEFFICIENTS]
        ratio = values[0] / values[1] if values[1] else np.nan
        cells = [f"{round(v, 4) + 0.0:.4f}" if np.isfinite(v) else "–" for v in values]  # no -0.0000
        status = "outside validity" if p.converged and not p.within else "" if p.converged else p.status
        table.add_row(f"{p.alpha:g}", f"{p.beta:g}", *cells, f"{ratio:.2f}" if np.isfinite(ratio) else "–", status)
    screen.print(table)
    where = ", ".join(f"{float(x) + 0.0:.6g}" for x in ref.about)
    lines = [
        f"reference area {ref.area:.6g} m2, chord {ref.chord:.6g} m, span {ref.span:.6g} m; moments about the "
        f"{ref.about_what} ({where}) m",
        "alpha > 0: nose up; beta > 0: wind from the right; CM nose up, Cl right wing down, Cn nose right",
    ]
    for line in lines:
        screen.print(line, soft_wrap=True, markup=False)
    for p in (p for p in found.points if not p.converged):
        screen.print(f"alpha {p.alpha:g}, beta {p.beta:g} deg {p.status}: {p.message}", soft_wrap=True, markup=False)
    if found.derivatives is not None:
        print_rows("stability derivatives, per rad", _derivative_rows(found.derivatives))
    if found.lacking:
        screen.print(f"note: {found.lacking}", soft_wrap=True, markup=False)


def _derivative_rows(found: Derivatives) -> list[tuple[str, str]]:
    rows = [("at", f"alpha {found.alpha:.4f} deg, {found.why}; beta {found.beta:g} deg")]
    rows += [("CL, CD, CM", ", ".join(f"{found.at[name]:.4f}" for name in ("CL", "CD", "CM")))]
    rows += [(label, f"{getattr(found, by)[name]:.4f}") for label, name, by in SHOWN]
    where = ", ".join(f"{float(x) + 0.0:.4f}" for x in found.neutral_point)
    stable = "stable in pitch" if found.static_margin > 0.0 else "unstable in pitch"
    rows.append(("static margin", f"{100.0 * found.static_margin:.2f} % of the reference chord, {stable}"))
    return [*rows, ("neutral point", f"({where}) m")]
