"""Command line: `kitecosim run|build|scenes|couple`. What the commands do is in commands.py and couple_command.py."""

from pathlib import Path
from typing import Annotated, Any

import typer

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # help without rich, which takes longer to load than all the rest
    help="Aero-structural co-simulation of soft kites: a structural and an aerodynamic FMU, coupled to equilibrium.",
)

SceneArgument = Annotated[
    str, typer.Argument(help="Name of a built-in scene (see `kitecosim scenes`) or a scene folder.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Setting or parameter of the scene; vectors as 1,0,0. Repeatable."
    ),
]


@app.command(short_help="Couple structure and flow of SCENE to equilibrium.")
def run(
    scene: SceneArgument,
    scheme: Annotated[str, typer.Option(help="explicit, relaxation, aitken or iqn-ils.")] = "iqn-ils",
    backend: Annotated[
        str, typer.Option(help="fmu: build and load the two FMUs; in-process: the same solvers.")
    ] = "fmu",
    set_: SetOption = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the results; without it results/SCENE.")] = None,
    relaxation: Annotated[
        float | None, typer.Option(help="Factor of relaxation; first factor of aitken and iqn-ils.")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Interface residual ||x~ - x|| in m that counts as converged.")
    ] = 1e-5,
    force_tolerance: Annotated[float, typer.Option(help="Out-of-balance force in N that counts as converged.")] = 0.01,
    max_iterations: Annotated[int, typer.Option(help="Most coupling iterations.")] = 200,
    stability: Annotated[bool, typer.Option(help="Judge the static stability of the equilibrium found.")] = True,
    report: Annotated[bool, typer.Option(help="Write plots, VTK files and an HTML page too.")] = True,
) -> None:
    """Couple structure and flow of SCENE to equilibrium; print a table, write results and a report.

    Exit code: 0 converged, 1 not converged or statically unstable (results are still written), 2 bad input.
    """
    from master.commands import run_scene

    choices = {
        "scheme": scheme,
        "backend": backend,
        "relaxation": relaxation,
        "tolerance": tolerance,
        "force_tolerance": force_tolerance,
        "max_iterations": max_iterations,
        "stability": stability,
        "report": report,
    }
    _finish(lambda: run_scene(scene, choices, _assignments(set_), out))


@app.command(short_help="Build the structural and the aerodynamic FMU of SCENE.")
def build(
    scene: SceneArgument,
    out: Annotated[Path, typer.Option(help="Folder for the FMUs.")] = Path("results/fmus"),
    set_: SetOption = None,
) -> None:
    """Build the structural and the aerodynamic FMU of SCENE; --set values become their start values."""
    from master.commands import build_scene

    _finish(lambda: build_scene(scene, _assignments(set_), out))


@app.command(short_help="List scenes and what each one needs.")
def scenes(
    scene: Annotated[
        str | None, typer.Argument(help="Name or folder of one scene; all built-in ones without it.")
    ] = None,
) -> None:
    """List settings, parameters and interface sizes of SCENE, or of all built-in scenes."""
    from master.commands import list_scenes

    _finish(lambda: list_scenes(scene))


@app.command(short_help="Couple any FMI 2.0 co-simulation FMUs as a TOML file says.")
def couple(
    file: Annotated[Path, typer.Argument(help="TOML file: time, scheme, participants, connections (docs/couple.md).")],
    out: Annotated[Path | None, typer.Option(help="Folder for the results; without it results/NAME of FILE.")] = None,
    report: Annotated[bool, typer.Option(help="Write plots too.")] = True,
) -> None:
    """Couple two or more FMI 2.0 co-simulation FMUs, of whatever maker, as FILE says; print a table, write results.

    Everything in FILE is checked before anything is run. Exit code: 0 every communication step converged, 1 not
    (results up to there are still written), 2 bad input.
    """
    from master.couple_command import couple_file

    _finish(lambda: couple_file(file, out, report))


def _assignments(pairs: list[str] | None) -> dict[str, str]:
    assigned = {}
    for pair in pairs or []:
        name, equals, value = pair.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise ValueError(f"--set takes NAME=VALUE, for example --set wind_speed=12; '{pair}' is not of that form.")
        assigned[name.strip()] = value.strip()
    return assigned


def _finish(command: Any) -> None:
    """Run a command; bad input becomes one sentence on standard error and exit code 2."""
    try:
        code = command()
    except (ValueError, OSError) as error:
        typer.echo(f"kitecosim: {error}", err=True)
        raise typer.Exit(2) from None
    except RuntimeError as error:  # an FMU that ended with fmi2Fatal
        typer.echo(f"kitecosim: {error}", err=True)
        raise typer.Exit(1) from None
    if code:
        raise typer.Exit(code)


def main() -> None:
    """Entry point of the `kitecosim` script."""
    app(prog_name="kitecosim")
