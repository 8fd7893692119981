"""`python -m benchmarks list | run | docs`."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Cases of run time against error and tables of comparison: list them, run them, put them into docs/.",
)
Names = Annotated[
    list[str] | None, typer.Argument(help="Names as `list` shows them, or their first parts; all if none.")
]
RESULTS, QUICK = Path("results/bench"), Path("results/bench-quick")


@app.command("list")
def list_() -> None:
    """List cases and tables."""
    from .registry import Case, registered

    for name, entry in registered().items():
        what = f"case, {len(entry.points())} points over {entry.knob}" if isinstance(entry, Case) else "table"
        typer.echo(f"{name:27} {what:46} {entry.title}")


@app.command()
def run(
    names: Names = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few points and rounds, to see that all work.")] = False,
    memory: Annotated[bool, typer.Option(help="Measure memory too, one process a point.")] = True,
    out: Annotated[Path | None, typer.Option(help="Folder; results/bench, with --quick results/bench-quick.")] = None,
) -> None:
    """Run cases and tables and write NAME.csv, NAME.svg and NAME.md of each; exit code 1 if any failed."""
    from .registry import chosen
    from .run import run as run_entries

    failed = run_entries(_checked(chosen, names), out or (QUICK if quick else RESULTS), quick, memory)
    for sentence in failed:
        typer.echo(f"failed: {sentence}", err=True)
    if failed:
        raise typer.Exit(1)


@app.command()
def docs(
    names: Names = None,
    results: Annotated[Path, typer.Option(help="Folder that `run` has written.")] = RESULTS,
) -> None:
    """Replace what stands between the `generated` markers of README.md and docs/*.md by the results."""
    from .docs import write

    for page in _checked(write, results, names or ()):
        typer.echo(f"written: {page}")


def _checked(call, *arguments):
    """The result of a call; bad input becomes a sentence and exit code 2."""
    try:
        return call(*arguments)
    except ValueError as error:
        typer.echo(f"benchmarks: {error}", err=True)
        raise typer.Exit(2) from None


if __name__ == "__main__":
    app(prog_name="python -m benchmarks")
