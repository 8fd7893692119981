"""Checkpoint and restart of runs of scenes: what is written when, and what a restart may change."""

import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from master.coupling import checkpoint
from master.coupling.acceleration import Scheme
from master.coupling.acceleration.scheme import adopt
from master.coupling.checkpoint import NO_FILES, Files, Keeper
from master.coupling.equilibrium import CoupledResult, Coupling
from master.coupling.exchange import Exchange, StateSnapshot
from master.coupling.march import March
from master.coupling.participants.blocks import assignment_text
from master.coupling.steady import Search
from master.report.results_folder import ResultsFolder
from master.report.tables import write_whole


def fmu_names(scene: str) -> list[str]:
    """The FMUs that a run of a scene of this name may leave beside its results."""
    return [f"fmus/{scene}_{side}.fmu" for side in ("structural", "aero")]


@dataclass(frozen=True, eq=False)
class Job:
    """A run that is asked for: the `scene`, `given` parameters, `choices` of the command line, the folder for its
    `results`, one that FMUs are `built_in`, the checkpoints, the texts `assigned` on the command line, what a restart
    has `kept` besides, and whether it is `strict`: a result outside validity is no good one.
    """

    scene: Any
    given: dict[str, Any]
    choices: dict[str, Any]
    results: ResultsFolder
    built_in: Path
    files: Files = NO_FILES
    assigned: dict[str, str] = field(default_factory=dict)
    kept: list[str] = field(default_factory=list)
    strict: bool = False

    @property
    def out(self) -> Path:
        """Where files are written until `place`."""
        return self.results.path

    @property
    def about(self) -> dict[str, Any]:
        """What a checkpoint says of the run."""
        scene = {"scene": self.scene.name, "scene_settings": self.scene.settings}
        scene["scene_files"] = files_digest(self.scene.folder, self.scene.files)
        return {**scene, "parameters": _plain(self.given), **self.choices}

    def place(self) -> None:
        """Put what was written, with the FMUs of the run, into the folder of the results."""
        built = sorted(self.built_in.glob("fmus/*.fmu"))
        if built:
            (self.out / "fmus").mkdir(exist_ok=True)
        for path in built:
            write_whole(self.out / "fmus" / path.name, path.read_bytes())
        self.results.place()

    @property
    def remembered(self) -> list[str]:
        """A remark on what a restart has from its checkpoint."""
        return [f"as in the checkpoint: {', '.join(self.kept)}"] if self.kept else []


def files_digest(folder: Path, names: Iterable[str]) -> str:
    """What stands for names and contents of files of a folder."""
    total = hashlib.sha256()
    for name in sorted(set(names)):
        content = (folder / name).read_bytes()
        total.update(f"{name}\n{len(content)}\n".encode() + content)
    return total.hexdigest()[:16]


def _plain(given: dict[str, Any]) -> dict[str, Any]:
    """Parameters as numbers and lists, to be compared and written."""
    return {name: np.asarray(value, dtype=float).tolist() for name, value in given.items()}


MOTION = {"stop_time": "stop_time", "step": "communication_step"}  # option -> what a checkpoint calls it


@dataclass(frozen=True, eq=False)
class Asked:
    """What the command line asks of a restart: `choices`, of which those `chosen` were given, and as far as they were
    given `motion` (stop_time, step, inputs) and `assigned` settings and parameters, as texts.
    """

    choices: Mapping[str, Any]
    chosen: Collection[str]
    motion: Mapping[str, Any]
    assigned: Mapping[str, str]

    def remembered(self, path: Path, scene: str) -> tuple[dict[str, Any], dict[str, str], list[str]]:
        """Choices, and settings and parameters with which to build the participants of a scene of this name, where what
        was not given is as in a checkpoint; and what that is, in words, where it is not as without one.

        ValueError in one sentence for a checkpoint of another scene or backend, whose states do not fit.
        """
        about = head(path)
        same = {key: about[key] for key in self.choices if key in about and key not in self.chosen}
        if {**self.choices, **same}["scheme"] != about.get("scheme"):
            same.pop("relaxation", None)  # it was that of another scheme
        choices = {**self.choices, **same}
        _require_same(path, about, scene=scene, backend=choices["backend"])
        texts = {name: str(value) for name, value in about["scene_settings"].items()}
        texts |= {name: assignment_text(value) for name, value in about["parameters"].items()}
        untold = (*self.assigned, "trim_angle", "start_azimuth")
        kept = [f"{name} = {text}" for name, text in texts.items() if name not in untold]
        kept += [f"{name} = {value}" for name, value in same.items() if value != self.choices[name]]
        return choices, {**texts, **self.assigned}, kept

    def remembered_motion(self, path: Path, scene: Any) -> tuple[dict[str, Any], list[str]]:
        """Stop time, step and inputs likewise, and in words; ValueError in one sentence where the inputs are gone."""
        if scene.dynamics is None:
            return dict(self.motion), []
        about = head(path)
        motion = {option: about[key] for option, key in MOTION.items() if key in about}
        if about.get("inputs") is not None and "inputs" not in self.motion:
            motion["inputs"] = _inputs(path, about["inputs"])
        usual = {"stop_time": scene.dynamics.stop_time, "step": scene.communication_step}
        other = [name for name in motion if name not in self.motion and motion[name] != usual.get(name)]
        return {**motion, **self.motion}, [f"{name} = {motion[name]}" for name in other]


def head(path: Path) -> dict[str, Any]:
    """What a checkpoint of a run of a scene is about; ValueError in one sentence for one of something else."""
    about = checkpoint.head(path)
    if "models" in about:
        raise ValueError(
            f"checkpoint {path} is of `kitecosim couple {about.get('document', '')}`; continue it with that command."
        )
    if missing := [key for key in ("scene", "scene_settings", "parameters") if key not in about]:
        raise ValueError(f"checkpoint {path} does not say of which {missing[0]} it is; name one of `kitecosim run`.")
    return about


def inputs_file(path: Path) -> dict[str, str]:
    """What a checkpoint says of a table of inputs: where it is, and its SHA-256."""
    return {"path": str(path.resolve()), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}


def _inputs(path: Path, kept: Mapping[str, str]) -> Path:
    """The table of inputs that a checkpoint was written with; ValueError in one sentence if it is another one now."""
    table, why = Path(kept["path"]), ""
    try:
        why = "" if inputs_file(table)["sha256"] == kept["sha256"] else "has changed since"
    except OSError as error:
        why = f"cannot be read ({(error.strerror or str(error)).lower()})"
    if why:
        raise ValueError(
            f"checkpoint {path} was written with --inputs {table}, which {why}; name a table with --inputs."
        )
    return table


def _require_same(path: Path, was: Mapping[str, Any], **now: str) -> None:
    for key, mine in now.items():
        if was.get(key) != mine:
            remedy = f"name that {key}" if key == "scene" else f"add --{key} {was.get(key)}"
            raise ValueError(f"checkpoint {path} is of {key} {was.get(key)}, this run of {mine}; {remedy}.")


class CheckpointWriter:
    """Writes the checkpoints of a coupled solve; without a path none."""

    def __init__(
        self, path: Path | None, every: int, coupling: Coupling, scheme: Scheme, about: Mapping[str, Any]
    ) -> None:
        self._keeper, self._about = Keeper(Files(path, every)), about
        self._coupling, self._scheme = coupling, scheme

    @property
    def remarks(self) -> list[str]:
        """What went wrong."""
        return self._keeper.remarks

    def __call__(self, search: Search, snapshot: StateSnapshot) -> None:
        """Before a coupling iteration."""
        count = len(search.history)
        about = {**self._about, "coupling_iterations": count, "status": "under way"}
        self._keeper.keep(
            count, f"before coupling iteration {count + 1}", about,
            lambda: checkpoint.dump_search(self._coupling, self._scheme, search, snapshot),
        )  # fmt: skip

    def end(self, result: CoupledResult) -> None:
        """After a solve that converged: another wind or tolerance may begin from here."""

        def content() -> dict[str, Any]:
            order = self._about["order"]
            ended = Search(order, self._coupling.present(order), history=result.history)
            return checkpoint.dump_search(self._coupling, self._scheme, ended, None)

        about = {**self._about, "coupling_iterations": result.iterations, "status": result.status}
        self._keeper.keep(result.iterations, "at the end", about, content, last=True)


class StepCheckpointWriter:
    """Writes the checkpoints of a transient run: every so many communication steps, and at its end."""

    def __init__(
        self, files: Files, stop_time: float, about: Mapping[str, Any], more: Callable[[], Mapping[str, Any]] = dict
    ) -> None:
        """`more` is what it says besides, at the time that it is written."""
        self._keeper, self._stop, self._about, self._more = Keeper(files), stop_time, about, more

    @property
    def remarks(self) -> list[str]:
        """What went wrong."""
        return self._keeper.remarks

    def __call__(self, exchange: Exchange, scheme: Scheme | None, march: March) -> None:
        """After a communication step."""
        last = exchange.time > self._stop - 0.5 * exchange.dt
        about = {**self._about, **self._more(), "time": exchange.time, "steps": len(march.steps)}
        self._keeper.keep(
            len(march.steps), f"at {exchange.time:g} s", about,
            lambda: checkpoint.dump_march(exchange, scheme, march), last,
        )  # fmt: skip


# What may change without ending the loop under way: it only says how long to continue and what to do afterwards.
HARMLESS = ("max_iterations", "stability", "report", "labels")


def _changed(
    path: Path, was: Mapping[str, Any], now: Mapping[str, Any], chosen: Mapping[str, Any], exchange: Exchange
) -> list[str]:
    """The `chosen` parameters that are others than in a checkpoint; ValueError in one sentence for one of another scene
    or with other settings of it, and for a fixed parameter that shall change.
    """
    _require_same(path, was, scene=now["scene"])
    for name, value in now["scene_settings"].items():
        if was["scene_settings"].get(name) != value:
            raise ValueError(
                f"checkpoint {path} has {name} = {was['scene_settings'].get(name)}, this run {value}; a setting of the "
                "scene cannot change in a restart."
            )
    given = [k for k in chosen if k in now["parameters"] and now["parameters"][k] != was["parameters"].get(k)]
    for name in given:
        if name in exchange.fixed():
            raise ValueError(f"{name} is fixed once a run has begun; leave it out in a restart.")
    return given


def _others(was: Mapping[str, Any], now: Mapping[str, Any], keys: Iterable[str]) -> list[str]:
    """Which of the keys are others than in a checkpoint."""

    def value(about: Mapping[str, Any], key: str) -> Any:
        found = about.get(key)
        return found["sha256"] if key == "inputs" and found is not None else found

    return [k for k in keys if value(now, k) != value(was, k) and (k != "scene_files" or k in was)]


def _difference(key: str, was: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """What is another in a restart, in words."""
    if key == "scene_files":
        return "with other tables of the scene than then"
    if key == "inputs":
        old, new = ("none" if about.get(key) is None else about[key]["path"] for about in (was, now))
        return f"inputs {old} -> {new}" if old != new else f"inputs {new}, which has changed"
    return f"{key} {was.get(key)} -> {now[key]}"


def _give(exchange: Exchange, now: Mapping[str, Any], names: list[str]) -> None:
    """Set parameters of these names in all participants that have them."""
    for name in names:
        for participant in exchange.participants.values():
            if participant.causality.get(name) == "parameter":
                participant.set(name, now["parameters"][name])


def _said(path: Path, error: ValueError) -> ValueError:
    """The error with the path of the checkpoint in its sentence."""
    return error if str(path) in str(error) else ValueError(f"{path}: {error}")


def resumed_march(
    path: Path, exchange: Exchange, scheme: Scheme | None, about: Mapping[str, Any], chosen: Mapping[str, Any]
) -> tuple[March, str]:
    """Where a transient run continues from a checkpoint, and a remark on what is different now.

    With the settings as they were it continues bitwise as if it had not stopped; scheme, tolerances, stop time and
    tunable parameters among the `chosen` may be others. ValueError as for `resumed`.
    """
    was, content = checkpoint.read(path)
    now = json.loads(json.dumps(dict(about), default=str))
    given = _changed(path, was, now, chosen, exchange)
    try:
        with checkpoint.damaged(path):
            begun = checkpoint.load_march(exchange, content, scheme)
            begun.require_fields(exchange, about["order"])
    except ValueError as error:
        raise _said(path, error) from error
    _give(exchange, now, given)
    changed = _others(was, now, ("scene_files", "scheme", "relaxation", "tolerance", "communication_step", "inputs"))
    remark = f"restarted from {path.name} at {was['time']:g} s"
    remark += "".join(f", {_difference(key, was, now)}" for key in changed)
    for name in given:
        remark += f", {name} {was['parameters'].get(name, 'as in the scene')} -> {now['parameters'][name]}"
    return begun, remark


def resumed(
    path: Path, coupling: Coupling, scheme: Scheme, about: Mapping[str, Any], chosen: Mapping[str, Any]
) -> tuple[Search, list[str]]:
    """Where a coupled solve continues from a checkpoint, and a remark on what is different now.

    With the settings as they were the loop continues bitwise as if it had not stopped. With others (scheme, tolerances,
    tunable parameters among the `chosen`) a new loop begins at the shape and with the solvers' states of the
    checkpoint, and with its quasi-Newton history where the scheme is of the same kind. ValueError in one sentence for
    a checkpoint of another scene, with other settings of it or of the other backend, and for a fixed parameter that
    shall change.
    """
    was, content = checkpoint.read(path)
    now = json.loads(json.dumps(dict(about), default=str))
    given = _changed(path, was, now, chosen, coupling)
    try:
        with checkpoint.damaged(path):
            search = checkpoint.load_search(coupling, content)
    except ValueError as error:
        raise _said(path, error) from error
    adopted = was.get("order") == about["order"] and adopt(scheme, content["scheme"])  # else the unknowns are others
    changed = _others(was, now, [k for k in now if k not in (*HARMLESS, "parameters")])
    remark = f"restarted from {path.name} after {was['coupling_iterations']} coupling iterations"
    if not changed and not given and search.loop is not None:
        return search, [remark]
    if search.best is not None:
        coupling.free(search.best[0])
    _give(coupling, now, given)
    remark += "".join(f", {_difference(key, was, now)}" for key in changed)
    for name in given:
        remark += f", {name} {was['parameters'].get(name, 'as in the scene')} -> {now['parameters'][name]}"
    remark += "; coupling iterations are counted from 1 again"
    remark += "" if adopted else ", without the history of another scheme"
    return Search(about["order"], coupling.present(about["order"])), [remark]
