"""Command line: `kitecosim`; what its commands do is in commands.py, transient.py, studies and fmu_coupling."""

import os
import signal
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # help without rich, which takes longer to load than all the rest
    help="Aero-structural co-simulation of soft kites: a structural and an aerodynamic FMU, coupled, in quasi-static "
    "and transient cases; rigid wings in a flow by themselves, and polars of wings.",
)

SceneArgument = Annotated[
    str, typer.Argument(help="Name of a built-in scene (see `kitecosim scenes`) or a scene folder.")
]
ToleranceOption = Annotated[float, typer.Option(help="Interface residual ||x~ - x|| in m that counts as converged.")]
ForceToleranceOption = Annotated[float, typer.Option(help="Out-of-balance force in N that counts as converged.")]
CheckpointOption = Annotated[
    Path | None, typer.Option(help="Checkpoint file to write, from which an interrupted run continues with --restart.")
]
ForceOption = Annotated[
    bool,
    typer.Option("--force", help="Replace files in the folder that are not known to be results of an earlier command."),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Setting or parameter of the scene; vectors as 1,0,0. Repeatable."
    ),
]


@app.command(short_help="Couple structure and flow of SCENE; solve a rigid wing's flow.")
def run(
    ctx: typer.Context,
    scene: SceneArgument,
    scheme: Annotated[
        str, typer.Option(help="explicit, relaxation, aitken, iqn-ils, iqn-imvj or newton-krylov (in-process only).")
    ] = "iqn-ils",
    order: Annotated[
        str,
        typer.Option(
            help="serial (Gauss-Seidel): flow, then structure; parallel (Jacobi): both at once, loads are iterated too."
        ),
    ] = "serial",
    backend: Annotated[str, typer.Option(help="fmu: build and load the FMUs; in-process: the same solvers.")] = "fmu",
    set_: SetOption = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the results; without it results/SCENE.")] = None,
    relaxation: Annotated[
        float | None, typer.Option(help="Relaxation factor; initial factor of aitken and the quasi-Newton schemes.")
    ] = None,
    tolerance: ToleranceOption = 1e-5,
    force_tolerance: ForceToleranceOption = 0.01,
    max_iterations: Annotated[int, typer.Option(help="Maximum number of coupling iterations.")] = 200,
    stability: Annotated[bool, typer.Option(help="Assess the static stability of the equilibrium found.")] = True,
    report: Annotated[bool, typer.Option(help="Write plots, VTK files and an HTML page too.")] = True,
    labels: Annotated[
        str | None,
        typer.Option(
            metavar="WHAT",
            help="Plot the bridle with names too, as labels.png and labels.svg on a large page: nodes, lines or both.",
        ),
    ] = None,
    checkpoint: CheckpointOption = None,
    checkpoint_every: Annotated[
        int, typer.Option(help="Coupling iterations between checkpoints; transient cases: communication steps.")
    ] = 1,
    restart: Annotated[
        Path | None,
        typer.Option(
            help="Continue from this checkpoint, one of your own. Scene, its settings, fixed parameters and backend "
            "stay; scheme, tolerances and tunable parameters may be others. Of the options that say how to "
            "solve, those that are not given are as in the checkpoint."
        ),
    ] = None,
    stop_time: Annotated[float | None, typer.Option(help="Transient cases: end of the run in s.")] = None,
    step: Annotated[float | None, typer.Option(help="Transient cases: communication step in s.")] = None,
    inputs: Annotated[
        Path | None,
        typer.Option(
            help="Transient cases: CSV file with a column time and columns of parameters, linearly interpolated."
        ),
    ] = None,
    strict: Annotated[
        bool,
        typer.Option("--strict", help="Exit code 1 too where the result is outside of what its models are good for."),
    ] = False,
    force: ForceOption = False,
    live: Annotated[bool, typer.Option("--live", help="Plot the residual in the terminal while it runs.")] = False,
) -> None:
    """Couple structure and flow of SCENE; print a table, write results and a report.

    A quasi-static case is iterated to equilibrium, a transient one integrated in time. A rigid wing, a scene without
    [structure], has nothing to couple: its flow is solved once. Its polars are those of `kitecosim polar`.

    The row `validity` says what lies beyond the limits of the models: line strain, load of tubes, stall, separation,
    and more.

    Exit code: 0 converged, 1 not converged or statically unstable, or with --strict outside validity (results are still
    written), 2 bad input, 130 interrupted. Results are written beside the folder, as FOLDER.partial, and take the place
    of earlier ones at the end, as a whole: what is refused, interrupted or killed takes nothing away.
    """
    from master.commands import run_scene
    from master.coupling.checkpoint import Files

    choices = {
        "scheme": scheme,
        "order": order,
        "backend": backend,
        "relaxation": relaxation,
        "tolerance": tolerance,
        "force_tolerance": force_tolerance,
        "max_iterations": max_iterations,
        "stability": stability,
        "report": report,
        "labels": labels,
    }
    _finish(
        lambda: run_scene(
            scene,
            choices,
            _assignments(set_),
            out,
            Files(checkpoint, checkpoint_every, restart),
            live,
            {"stop_time": stop_time, "step": step, "inputs": inputs},
            {name for name in choices if ctx.get_parameter_source(name).name != "DEFAULT"},  # type: ignore[union-attr]
            strict,
            force,
        )
    )


@app.command(short_help="Build the structural and the aerodynamic FMU of SCENE.")
def build(
    scene: SceneArgument,
    out: Annotated[Path, typer.Option(help="Folder for the FMUs.")] = Path("results/fmus"),
    set_: SetOption = None,
    ssp: Annotated[
        bool,
        typer.Option(
            "--ssp",
            help="Write SCENE.ssp too: the FMUs, connected, with their parameters in one SSP 1.0 file. A tool that "
            "opens it runs the explicit scheme at steps of 1 s.",
        ),
    ] = False,
    fmi: Annotated[
        int, typer.Option(help="Version of FMI, 2 or 3; with 3 variables are whole arrays, and fewer tools take them.")
    ] = 2,
    force: ForceOption = False,
) -> None:
    """Build the structural and the aerodynamic FMU of SCENE; --set values become their start values.

    A scene without a flow has a structural FMU alone, a rigid wing an aerodynamic one.
    """
    from master.commands import build_scene

    _finish(lambda: build_scene(scene, _assignments(set_), out, ssp, fmi, force))


@app.command(short_help="Compare coupling schemes on scenes or coupling files.")
def compare(
    scene: Annotated[
        list[str],
        typer.Argument(
            help="Names of built-in scenes (see `kitecosim scenes`), scene folders, or coupling files (.toml, .ssp)."
        ),
    ],
    schemes: Annotated[
        str | None, typer.Option(help="Comma-separated schemes; without it all that there are.", metavar="NAME,NAME")
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SCHEME.NAME=VALUE,VALUE",
            help="Values of a parameter of a scheme, as iqn-ils.omega0=0.1,0.35; without SCHEME of all that have it. "
            "Repeatable; all combinations are solved.",
        ),
    ] = None,
    sweep: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE,VALUE",
            help="Several values of a setting or parameter of the scenes, as wind_speed=8,12,20; vectors as "
            "1,0,0;1,0,0.1. Repeatable; all combinations are solved.",
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Setting or parameter of the scenes, as in run; of those that have it where there are several. "
            "SCENE.NAME keeps it (or a sweep) to one. Repeatable.",
        ),
    ] = None,
    order: Annotated[
        str, typer.Option(help="serial (Gauss-Seidel), parallel (Jacobi), or serial,parallel to compare them.")
    ] = "serial",
    backend: Annotated[
        str, typer.Option(help="in-process: the solvers without FMUs; fmu: build and load the FMUs of every cell.")
    ] = "in-process",
    tolerance: ToleranceOption = 1e-5,
    force_tolerance: ForceToleranceOption = 0.01,
    max_iterations: Annotated[
        int,
        typer.Option(help="Maximum number of coupling iterations of a cell; transient cases: of a communication step."),
    ] = 200,
    stop_time: Annotated[float | None, typer.Option(help="Transient cases: end of the run in s.")] = None,
    step: Annotated[float | None, typer.Option(help="Transient cases: communication step in s.")] = None,
    repeat: Annotated[int, typer.Option(help="Number of solves of each cell; wall times are those of the median.")] = 1,
    jobs: Annotated[
        int | None,
        typer.Option(
            help="Worker processes; without it one per core. 1: undisturbed wall times. 0: solve in this process."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("results/compare"),
    recompute: Annotated[
        bool, typer.Option("--recompute", help="Solve cells again that are finished in the folder.")
    ] = False,
    force: ForceOption = False,
    fresh: Annotated[bool, typer.Option("--fresh", hidden=True)] = False,  # its name in releases up to 0.1
) -> None:
    """Solve every SCENE with every scheme; print tables, write them with plots and a page.

    A cell is a scene with its settings and a scheme with its parameters. Finished cells are kept in the folder, so that
    the same command continues where it was interrupted. A scheme that does not converge is a result like any other.

    Exit code: 0 all cells ran, whatever came out; 1 a cell crashed; 2 bad input; 130 interrupted.
    """
    from master.studies.command import compare_scenes

    options = {
        "orders": [part.strip() for part in order.split(",") if part.strip()],
        "backend": backend,
        "tolerance": tolerance,
        "force_tolerance": force_tolerance,
        "max_iterations": max_iterations,
        "stop_time": stop_time,
        "step": step,
        "repeat": repeat,
        "jobs": jobs,
        "recompute": recompute or fresh,
        "force": force,
    }
    _finish(
        lambda: compare_scenes(
            scene, schemes, parameters or [], sweep or [], out, settings=_assignments(set_), **options
        )
    )


@app.command(short_help="Coefficients of the rigid wing of SCENE over angle of attack and sideslip.")
def polar(
    scene: SceneArgument,
    alpha: Annotated[
        str, typer.Option(metavar="ANGLES", help="Angles of attack in degrees, nose up: a:b:step or a,b,c.")
    ] = "-5:15:1",
    beta: Annotated[
        str,
        typer.Option(metavar="ANGLES", help="Angles of sideslip in degrees, wind from the right: a:b:step or a,b,c."),
    ] = "0",
    set_: SetOption = None,
    about: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="Point in m that moments are about; without it the pivot of a kite, [aero] reference_point, or the "
            "origin.",
        ),
    ] = None,
    derivatives: Annotated[
        bool,
        typer.Option(
            "--derivatives",
            help="Stability derivatives too, where CM falls through zero, else in the middle of the angles.",
        ),
    ] = False,
    derivatives_at: Annotated[
        float | None, typer.Option(metavar="ALPHA", help="Stability derivatives at this angle of attack in degrees.")
    ] = None,
    shape: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Results of a run of SCENE, whose shape the wing has; without it that of design."
        ),
    ] = None,
    warm: Annotated[
        bool, typer.Option("--warm/--cold", help="Whether points start from the state of the one before.")
    ] = True,
    report: Annotated[bool, typer.Option(help="Write plots too.")] = True,
    out: Annotated[Path | None, typer.Option(help="Folder for the results; without it results/polar/SCENE.")] = None,
    force: ForceOption = False,
) -> None:
    """Turn the wind about the rigid wing of SCENE; print a table, write it with loads, outputs and plots.

    The wing of a kite has its design shape, or that of a run. A point without an answer has a status and does not end
    the sweep; one that is outside of what the model is known to be good for is marked.

    Exit code: 0 all points were tried, whatever came out; 1 a point crashed, none has an answer, or derivatives were
    asked for and there are none; 2 bad input; 130 interrupted.
    """
    from master.studies.polar.command import polar_scene

    _finish(
        lambda: polar_scene(
            scene, alpha, beta, _assignments(set_), out, about, shape, derivatives, derivatives_at, warm, report, force
        )
    )


@app.command(short_help="List scenes and what each one needs.")
def scenes(
    scene: Annotated[
        str | None, typer.Argument(help="Name or folder of one scene; all built-in ones without it.")
    ] = None,
) -> None:
    """List settings, parameters and interface sizes of SCENE, or of all built-in scenes."""
    from master.commands import list_scenes

    _finish(lambda: list_scenes(scene))


@app.command(short_help="Couple any co-simulation FMUs as a TOML file or an SSP says.")
def couple(
    file: Annotated[Path, typer.Argument(help="TOML file (docs/couple.md), or package of SSP 1.0 (.ssp).")],
    out: Annotated[Path | None, typer.Option(help="Folder for the results; without it results/NAME of FILE.")] = None,
    report: Annotated[bool, typer.Option(help="Write plots too.")] = True,
    checkpoint: CheckpointOption = None,
    checkpoint_every: Annotated[int, typer.Option(help="Communication steps between checkpoints.")] = 10,
    restart: Annotated[
        Path | None,
        typer.Option(help="Continue from this checkpoint (of your own); scheme, tolerances, step, stop may be others."),
    ] = None,
    mode: Annotated[str | None, typer.Option(help="In place of that in FILE: transient or steady.")] = None,
    start: Annotated[float | None, typer.Option(help="Start time in place of that in FILE, s.")] = None,
    stop: Annotated[float | None, typer.Option(help="Stop time in place of that in FILE, s.")] = None,
    step: Annotated[float | None, typer.Option(help="Communication step in place of that in FILE, s.")] = None,
    scheme: Annotated[
        str | None, typer.Option(help="Scheme in place of that in FILE; iqn-ils where it has none.")
    ] = None,
    order: Annotated[str | None, typer.Option(help="In place of that in FILE: serial or parallel.")] = None,
    rtol: Annotated[float | None, typer.Option(help="Relative tolerance in place of that in FILE.")] = None,
    atol: Annotated[float | None, typer.Option(help="Absolute tolerance in place of that in FILE.")] = None,
    force: ForceOption = False,
) -> None:
    """Couple two or more co-simulation FMUs (FMI 2.0, 3.0) of any maker as FILE says; print a table, write results.

    Everything in FILE is checked before anything is run. Exit code: 0 every communication step converged, 1 not
    (results up to there are still written), 2 bad input, 130 interrupted. The FMUs run in a process of their own: what
    one that ends it has left is told.
    """
    from master.isolated import isolated

    given = {
        "time": {"mode": mode, "start": start, "stop": stop, "step": step},
        "coupling": {"scheme": scheme, "order": order, "rtol": rtol, "atol": atol},
    }
    settings = {name: {key: value for key, value in keys.items() if value is not None} for name, keys in given.items()}

    def work(watch: Any) -> int:
        from master.coupling.checkpoint import Files
        from master.fmu_coupling.command import couple_file

        files = Files(checkpoint, checkpoint_every, restart)
        return couple_file(file, out, report, files, force, settings, watch)

    _finish(lambda: isolated(work, (out or Path("results") / file.stem).absolute()))


@app.command("host-env", short_help="Print the environment in which C and C++ hosts run the FMUs.")
def host_env(
    preload: Annotated[
        bool,
        typer.Option(
            "--preload",
            help="LD_PRELOAD, PYTHONHOME and PYTHONPATH instead, as other FMUs of PythonFMU need them, and FMUs of "
            "this project that were built without a C compiler at installation.",
        ),
    ] = False,
) -> None:
    """Print the environment variables that a host without Python (C, C++) needs to run the FMUs with this Python.

    In a shell: eval "$(kitecosim host-env)". Hosts that are Python programs need nothing but numpy and scipy; a host
    that finds such a Python as python3 in its PATH needs nothing either.
    """
    from master.commands import print_host_environment

    _finish(lambda: print_host_environment(preload))


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
        sys.stdout.flush()
    except BrokenPipeError:  # who reads has heard enough, as `head` does; nothing more can be said there
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(141) from None  # as a shell calls it: 128 and SIGPIPE
    except OSError as error:
        _say(f"{_told(error)}{_noted(error)}")
        raise typer.Exit(2) from None
    except ValueError as error:
        _say(f"{error}{_noted(error)}")
        raise typer.Exit(2) from None
    except KeyboardInterrupt as error:
        _say(f"interrupted; a run with --checkpoint continues with --restart.{_noted(error)}")
        raise typer.Exit(130) from None
    except (RuntimeError, ArithmeticError) as error:  # an FMU that ended with fmi2Fatal, a solver that gave up
        from interface import StepFailed

        if isinstance(error, ArithmeticError) and not isinstance(error, StepFailed):
            raise
        _say(f"{error}{_noted(error)}")
        raise typer.Exit(1) from None
    if code:
        raise typer.Exit(code)


def _say(sentence: str) -> None:
    """A sentence on standard error, whose control characters are written out: names of files may have some."""
    from interface import unprintable

    shown = "".join(repr(c)[1:-1] if c != "\n" and unprintable(c) else c for c in sentence)
    typer.echo(f"kitecosim: {shown}", err=True)


def _told(error: OSError) -> str:
    """What failed at which file, in one sentence."""
    reason = (error.strerror or str(error)).lower()
    where = error.filename if error.filename is not None else "a file"
    return f"{os.fsdecode(where)} cannot be read or written ({reason}); mend that and run it again."


def _noted(error: BaseException) -> str:
    """What is to be said besides."""
    return "".join(f" {note[:1].upper()}{note[1:]}." for note in getattr(error, "__notes__", ()))


def main() -> None:
    """The command line; exit code 130 whenever there was an interrupt (Ctrl-C), wherever that has been caught."""
    came: list[int] = []

    def interrupt(number: int, frame: Any) -> None:
        came.append(number)
        raise KeyboardInterrupt

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    try:
        app(prog_name="kitecosim")
    except (SystemExit, KeyboardInterrupt) as end:
        exec("")  # else Python, had the interrupt come within an exec or eval, would end by the signal all the same
        if came or isinstance(end, KeyboardInterrupt):
            sys.unraisablehook = lambda _: None  # threads of a pool that was cut short may meet what is gone already
            raise SystemExit(130) from None
        raise
    finally:
        if signal.getsignal(signal.SIGINT) is interrupt:
            signal.signal(signal.SIGINT, lambda *_: os._exit(130))  # nothing is left to clean up
