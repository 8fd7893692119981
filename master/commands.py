"""What the commands of the command line do: from words to scenes, participants, runs and files."""

import contextlib
import shlex
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from master import restart
from master.coupling import checkpoint
from master.coupling.checkpoint import NO_FILES, Files
from master.coupling.convergence import required_count, required_number
from master.coupling.equilibrium import Coupling, require_structure
from master.coupling.exchange import ORDERS
from master.coupling.participants import FmuParticipant, InProcessParticipant, Participant
from master.coupling.participants.private_folder import PrivateFolder
from master.coupling.participants.zero_loads import ZeroLoads
from master.coupling.rigid import rigid_run
from master.coupling.run import Run, coupled_run
from master.coupling.schemes import SCHEMES, scheme
from master.coupling.start import with_start
from master.report import (
    LABELS,
    RESULTS,
    TABLES,
    drag_results,
    line_row_results,
    membrane_results,
    missing_libraries,
    print_table,
    print_written,
    summary,
    versions,
    wing_results,
    write_history,
    write_json,
    write_report,
    write_state,
)
from master.report.console import EXIT_CONVERGED, EXIT_NOT_CONVERGED
from master.report.live import progress
from master.report.results_folder import ResultsFolder
from master.restart import Job, fmu_names

BACKENDS = ("fmu", "in-process")
# What a run without a structure has no use for.
OF_COUPLING = ("scheme", "order", "relaxation", "tolerance", "force_tolerance", "max_iterations", "stability", "labels")
FOUND = {"trim_angle": "found for wind and weight,", "start_azimuth": "that of the wind,"}  # start values of parameters
OTHER_BINARY = (
    "kitecosim: note: FMUs built here carry PythonFMU's binary, as that of kitecosim was not compiled when it was "
    "installed (is there a C compiler?); a C or C++ host needs the variables of `kitecosim host-env --preload`."
)


def run_scene(
    name: str,
    choices: dict[str, Any],
    assigned: dict[str, str],
    out: Path | None,
    files: Files = NO_FILES,
    live: bool = False,
    motion: dict[str, Any] | None = None,
    chosen: Collection[str] | None = None,
    strict: bool = False,
    force: bool = False,
) -> int:
    """Run a scene, print its table, write its files; the exit code.

    `motion` are stop_time s, step s and the path inputs for a transient scene, None what it says itself. `chosen` are
    the names of the `choices` that a restart does not take from its checkpoint, None: all. `strict`: a result outside
    of what its models are known to be good for counts as not converged. `force`: files of others in `out` are replaced.
    """
    import scenes

    motion = {key: value for key, value in (motion or {}).items() if value is not None}
    files.require_writable()
    built, kept = assigned, list[str]()
    if files.restart is not None:
        asked = restart.Asked(choices, choices.keys() if chosen is None else chosen, motion, assigned)
        with checkpoint.damaged(files.restart):
            choices, built, kept = asked.remembered(files.restart, scenes.name_of(name))
            _checked(choices)
    _checked(choices)
    scene, given, cores = prepared(name, built)
    if files.restart is None:
        scene, cores, _ = at_rest(scene, given, cores)  # a run that finds no start says so by itself
    if files.restart is not None:
        with checkpoint.damaged(files.restart):
            motion, more = asked.remembered_motion(files.restart, scene)
        kept += more
    if motion and not scene.transient:
        option = {"stop_time": "--stop-time", "step": "--step", "inputs": "--inputs"}[next(iter(motion))]
        raise ValueError(f"{option} is for transient scenes; scene '{name}' is quasi-static.")
    if not scene.has_structure:
        _require_nothing_coupled(scene, () if chosen is None else chosen, files, live)
        choices = {name: value for name, value in choices.items() if name not in OF_COUPLING}
    out = out or Path("results") / scene.name
    names = [*_written(scene, choices["report"]), *fmu_names(scene.name)]
    with PrivateFolder() as built_in, ResultsFolder(out, names, force=force) as results:
        job = Job(scene, given, choices, results, built_in, files, assigned, kept, strict)
        if scene.transient:
            from master.transient import run_transient

            return run_transient(job, opened(scene, choices["backend"], given, job.built_in, cores), live, **motion)
        return _run_quasi_static(job, cores, live) if scene.has_structure else _run_rigid(job, cores)


def _require_nothing_coupled(scene: Any, chosen: Collection[str], files: Files, live: bool) -> None:
    """ValueError in one sentence where options say how a rigid wing is to be coupled."""
    given = [f"--{name.replace('_', '-')}" for name in OF_COUPLING if name in chosen]
    given += [name for name, there in (("--checkpoint", files.checkpoint), ("--live", live)) if there]
    if given:
        raise ValueError(
            f"{given[0]} is for scenes with a structure; scene '{scene.name}' is a rigid wing, whose flow is solved "
            "once; leave it out."
        )


def _run_rigid(job: Job, cores: dict[str, Any]) -> int:
    """Solve the flow around a rigid wing; the exit code."""
    begin = time.perf_counter()
    with opened(job.scene, job.choices["backend"], job.given, job.built_in, cores) as sides:
        run = rigid_run(sides["aero"], job.scene.remarks)
        took = time.perf_counter() - begin
    _write(job, run, took - run.result.seconds["total"], cores)  # the initialisation of an FMU is part of the solve
    return _exit_code(job, run)


def _exit_code(job: Job, run: Run) -> int:
    good = run.status == "converged" and (not job.strict or all(j.within for j in run.validity))
    return EXIT_CONVERGED if good else EXIT_NOT_CONVERGED


def _written(scene: Any, report: bool) -> tuple[str, ...]:
    """The files that a run of a scene may write, with a report or without."""
    if scene.transient:
        from master.report.transient import PLOTS

        return (*RESULTS, *PLOTS) if report else TABLES
    return RESULTS if report else TABLES


def _run_quasi_static(job: Job, cores: dict[str, Any], live: bool) -> int:
    """Run a quasi-static scene; the exit code."""
    scene, given, choices, files = job.scene, job.given, job.choices, job.files
    options = {k: choices[k] for k in ("force_tolerance", "max_iterations")} | {"atol": choices["tolerance"]}
    options |= {"tie_tolerance": "solver_tolerance" not in given, "order": choices["order"]}
    begin = time.perf_counter()
    with (
        pair(scene, choices["backend"], given, job.built_in, cores) as coupling,
        progress(choices["tolerance"], live) as shown,
    ):
        ready = time.perf_counter()
        used = _scheme(choices, coupling)
        remarks: list[str] = []
        if files.restart is not None:
            options["search"], remarks = restart.resumed(files.restart, coupling, used, job.about, job.assigned)
            remarks += job.remembered
        files.begin()
        writer = restart.CheckpointWriter(files.checkpoint, files.every, coupling, used, job.about)
        run = coupled_run(coupling, used, choices["stability"], shown, scene.remarks, hold=writer, **options)
        if run.status in ("converged", "statically_unstable"):
            writer.end(run.result)
    run.remarks.extend(remarks + writer.remarks + scene.notes() + scene.trim_notes(given) + _hints(scene, given, run))
    _write(job, run, ready - begin, cores)
    return _exit_code(job, run)


def _write(job: Job, run: Run, set_up: float, cores: dict[str, Any]) -> None:
    """Print the table of a run and write its files; `set_up` s is what went before."""
    scene, choices, out = job.scene, job.choices, job.out
    settings = {
        "scene": scene.name,
        **choices,
        "scene_settings": scene.settings,
        "parameters_set": job.given,
        "parameters": {
            f"{label}.{block}": run.blocks[label][block]
            for label, causality in run.causality.items()
            for block in causality
            if causality[block] == "parameter"
        },
    }
    content = summary(run, settings)
    wing = wing_results(scene.members, run.blocks["structural"])
    if wing is not None:
        content["wing"] = wing
    membranes = membrane_results(scene.members, run.blocks["structural"])
    if membranes is not None:
        content["membranes"] = membranes
    drag = drag_results(scene, run.blocks["aero"])
    if drag is not None:
        content["drag"] = drag
    of_rows = line_row_results(scene.members, run.blocks["structural"].get("tension"))
    if of_rows is not None:
        content["line_rows"] = of_rows
    content["versions"] = versions()
    content["wall_time_s"]["set_up"] = set_up
    blocks = {**run.blocks["structural"], **run.blocks["aero"]}  # loads as the flow sends them for the reported shape
    if not scene.has_flow:  # what stands in for it knows no shape
        blocks["displacement"] = run.blocks["structural"]["displacement"]
    labels = {"position": scene.members.labels, "tension": scene.members.names, "line_load": scene.members.leg_names}
    written, layout = ["summary.json"], None if scene.wing_model is None else scene.wing_model.edge_strips
    if scene.has_structure:
        write_history(out / "history.csv", run.result.history)
        written.append("history.csv")
    written += [
        *write_state(out, blocks, labels, scene.interface, scene.members.wing, scene.members, layout),
    ]
    write_json(out / "summary.json", content)
    lacking = missing_libraries() if choices["report"] else ""
    if choices["report"] and not lacking:
        written += write_report(out, scene, run, content, cores)
    job.place()
    print_table(scene, run, content)
    print_written(job.results.named, written, lacking)


def _hints(scene: Any, given: dict[str, Any], run: Any) -> list[str]:
    """Where to look in the tables of a scene after a run that ended badly or without the symmetry it was to have."""
    lost = "symmetry_used" in run.blocks["structural"] and not run.blocks["structural"]["symmetry_used"]
    lost = lost and bool(run.blocks["structural"]["symmetric"])
    if run.status == "converged" and not lost:
        return []
    misfits, asymmetry = scene.hints(given)
    out = [f"not symmetric: {asymmetry}"] if lost and asymmetry else []
    if misfits and run.status not in ("converged", "statically_unstable"):
        more = f" and {len(misfits) - 6} more" if len(misfits) > 6 else ""
        out.append(f"off their rest length in the design shape by more than 5 %: {', '.join(misfits[:6])}{more}")
    return out


def list_scenes(name: str | None = None) -> int:
    """Print what a scene, or each built-in one, needs; the exit code."""
    import scenes

    for scene in [scenes.load(one) for one in ([name] if name else scenes.available())]:
        print(f"{scene.name}: {scene.title}")
        print(f"  {scene.description}")
        print(f"  interface: {len(scene.interface.nodes)} nodes, {len(scene.interface.panels)} panels")
        if not scene.has_structure:
            print("  rigid: a flow around the wing alone, without a structure")
        if scene.dynamics is not None:
            stop = scene.dynamics.stop_time
            print(f"  transient: to {stop:g} s in communication steps of {scene.communication_step:g} s")
        for key, option in scene.offers.items():
            choices = f" ({' | '.join(option.options)})" if option.options else ""
            print(f"  setting   {key} = {option.default}{choices}  {option.description}")
        shown = set()
        for core in scene.cores().values():
            for v in core.variables:
                if v.causality == "parameter" and v.name not in shown:
                    shown.add(v.name)
                    start = ",".join(f"{x:g}" for x in np.atleast_1d(np.broadcast_to(v.start, v.shape)))
                    start = FOUND.get(v.name, start)
                    unit = "" if v.unit == "1" else f" {v.unit}"
                    print(f"  parameter {v.name} = {start}{unit}  {v.description}")
    return 0


def build_scene(
    name: str, assigned: dict[str, str], out: Path, ssp: bool = False, fmi: int = 2, force: bool = False
) -> int:
    """Build the FMUs of a scene, one for each side that it has, and its SSP if wanted; the exit code."""
    from fmus.builder import build, own_binary
    from fmus.ssp import package

    if ssp and fmi != 2:
        raise ValueError("--ssp connects FMUs of FMI 2; leave --fmi out.")
    scene, given, cores = prepared(name, assigned)
    scene, cores, lacking = at_rest(scene, given, cores)
    mark = "_fmi3" if fmi == 3 else ""
    names = [f"{scene.name}{end}" for end in (f"_structural{mark}.fmu", f"_aero{mark}.fmu", *([".ssp"] if ssp else []))]
    try:
        with ResultsFolder(out, names, "build", force, keep=True) as results:
            paths = build(scene, results.path, given, fmi=fmi, cores=cores)
            if ssp:
                package(scene.name, paths, results.path)
            placed = set(results.place())
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ValueError(f"--out {out} cannot be written to ({reason}); name another one.") from None
    for name in names:
        if name in placed:
            print(out / name)
    if own_binary() is None:
        print(OTHER_BINARY, file=sys.stderr)
    if lacking:
        print(f"kitecosim: note: {lacking}; the FMUs start in the shape of the tables.", file=sys.stderr)
    return 0


def print_host_environment(preload: bool) -> int:
    """Print what a host without Python needs in its environment, as lines of a shell."""
    from fmus.builder import own_binary
    from fmus.host import host_environment

    for name, value in host_environment(preload).items():
        print(f"export {name}={shlex.quote(value)}")
    if own_binary() is None and not preload:
        print(OTHER_BINARY, file=sys.stderr)
    return 0


def _checked(choices: dict[str, Any]) -> None:
    if choices["scheme"] not in SCHEMES:
        raise ValueError(f"there is no scheme '{choices['scheme']}'; choose one of: {', '.join(SCHEMES)}.")
    if choices["backend"] not in BACKENDS:
        raise ValueError(f"there is no backend '{choices['backend']}'; choose one of: {', '.join(BACKENDS)}.")
    if choices["order"] not in ORDERS:
        raise ValueError(f"there is no order '{choices['order']}'; choose one of: {', '.join(ORDERS)}.")
    if SCHEMES[choices["scheme"]].exact and choices["backend"] == "fmu":
        raise ValueError(f"--scheme {choices['scheme']} takes directional derivatives; add --backend in-process.")
    for key in ("tolerance", "force_tolerance"):
        required_number(f"--{key.replace('_', '-')}", choices[key])
    required_count("--max-iterations", choices["max_iterations"])
    if (labels := choices.get("labels")) is not None:
        if labels not in LABELS:
            raise ValueError(f"--labels takes {', '.join(LABELS[:-1])} or {LABELS[-1]}, not '{labels}'.")
        if not choices["report"]:
            raise ValueError("--labels asks for a plot, which --no-report leaves out; drop one of the two.")
    factor = choices["relaxation"]
    if factor is not None:
        required_number("--relaxation", factor)
    if factor is not None and not SCHEMES[choices["scheme"]].relaxation:
        raise ValueError(f"--relaxation does not go with the {choices['scheme']} scheme; use --scheme relaxation.")


def _scheme(choices: dict[str, Any], coupling: Coupling) -> Any:
    name, factor = choices["scheme"], choices["relaxation"]
    given = {} if factor is None else {SCHEMES[name].relaxation: factor}
    return scheme(name, coupling, choices["order"], **given)


def prepared(name: str, assigned: dict[str, str]) -> tuple[Any, dict[str, Any], dict[str, Any]]:
    """The scene with its settings, its parameters: the assigned ones, checked, and the trim angle if it has one; and
    its cores, side -> core, with these parameters.
    """
    scene, parameters, made = assigned_cores(name, assigned, lambda scene: scene.cores())
    return scene, scene.with_trim(parameters, made), made


def assigned_cores(
    name: str, assigned: dict[str, str], cores_of: Callable[[Any], dict[str, Any]]
) -> tuple[Any, dict[str, Any], dict[str, Any]]:
    """The scene with its assigned settings, its assigned parameters, checked, and the cores that `cores_of` makes of
    it, with these parameters.
    """
    import scenes

    offers = scenes.settings_of(name)
    settings = {k: v for k, v in assigned.items() if k in offers}
    scene = scenes.load(name, settings)
    made = cores_of(scene)
    cores = tuple(made.values())
    parameters: dict[str, Any] = {}
    for key, text in assigned.items():
        if key in settings:
            continue
        owners = [(c, v) for c in cores for v in c.variables if v.name == key and v.causality == "parameter"]
        if not owners:
            known = sorted({v.name for c in cores for v in c.variables if v.causality == "parameter"})
            chosen = ", ".join([*offers, *known])
            raise ValueError(f"scene '{scene.name}' has no setting or parameter '{key}'; it has: {chosen}.")
        value = _number(key, text, owners[0][1])
        for core, _ in owners:
            core.set(key, value)
        parameters[key] = value
    return scene, parameters, made


def at_rest(scene: Any, given: dict[str, Any], cores: dict[str, Any]) -> tuple[Any, dict[str, Any], str]:
    """A prepared scene and its cores with the equilibrium of structure and flow for their start, where they are to
    start in one, and "" or why there is none; see `master.coupling.with_start`.
    """
    started, lacking = with_start(scene, given, cores) if scene.transient else (scene, "")
    return (scene, cores, lacking) if started is scene else (started, started.cores(), lacking)


def _number(key: str, text: str, variable: Any) -> Any:
    words = {"true": 1.0, "yes": 1.0, "on": 1.0, "false": 0.0, "no": 0.0, "off": 0.0}
    try:
        if variable.kind == "boolean" and text.lower() in words:
            return words[text.lower()]
        values = [float(part) for part in text.split(",")]
    except ValueError:
        kind = "true or false" if variable.kind == "boolean" else "a number"
        raise ValueError(f"--set {key}={text}: {key} takes {kind} (vectors as 1,0,0).") from None
    return values[0] if variable.shape == () and len(values) == 1 else np.array(values)


@contextlib.contextmanager
def opened(
    scene: Any, backend: str, parameters: dict[str, Any], out: Path, cores: Mapping[str, Any] | None = None
) -> Iterator[dict[str, Participant]]:
    """The participants of a scene, "structural" where it has a structure and "aero" where it has a flow; they are
    closed at the end. FMUs are built in the folder `out`/fmus.

    `cores` of the scene (side -> core), where there are some, become the participants or make their FMUs.
    """
    with contextlib.ExitStack() as stack:
        if backend == "fmu":
            from fmus.builder import build, guid

            paths = build(scene, out / "fmus", parameters, reference=False, cores=cores)
            guids = [guid(path) for path in paths]
            fmus = [stack.enter_context(FmuParticipant(path)) for path in paths]
            of_sides = cores or scene.cores()
            for fmu, path, built in zip(fmus, paths, guids, strict=True):
                _require_own(fmu, path, built, parameters)
            for fmu, core in zip(fmus, of_sides.values(), strict=True):
                fmu.criteria = core.criteria  # an FMU has their outputs, and their limits in words only
            yield dict(zip(of_sides, fmus, strict=True))
        else:
            yield {
                side: InProcessParticipant(core, {k: v for k, v in parameters.items() if k in core.names})
                for side, core in (cores or scene.cores()).items()
            }


def _require_own(fmu: FmuParticipant, path: Path, guid: str, parameters: Mapping[str, Any]) -> None:
    """RuntimeError in one sentence where an FMU is not the one that was built, with these parameters."""
    given = {name: value for name, value in parameters.items() if fmu.causality.get(name) == "parameter"}
    wrong = [name for name, value in given.items() if not np.array_equal(fmu.get(name), np.asarray(value, float))]
    if fmu.guid != guid or wrong:
        what = f"has {wrong[0]} = {fmu.get(wrong[0])}" if wrong else f"has the guid {fmu.guid}"
        raise RuntimeError(f"{path} is not the FMU that was built for this run: it {what}; run it again.")


@contextlib.contextmanager
def pair(
    scene: Any, backend: str, parameters: dict[str, Any], out: Path, cores: Mapping[str, Any] | None = None
) -> Iterator[Coupling]:
    """The two participants of a quasi-static scene, coupled; they are closed at the end. ValueError in one sentence
    where it has no structure.
    """
    if backend != "fmu":
        yield Coupling.in_process(scene, parameters, cores)
        return
    require_structure(scene)
    with opened(scene, backend, parameters, out, cores) as sides:
        coupling = Coupling(sides["structural"], sides.get("aero") or ZeroLoads.beside(sides["structural"]))
        yield coupling.of_scene(scene)
