"""Checkpoint and restart of runs of scenes: what is written when, and what a restart may change."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from master.coupling import checkpoint
from master.coupling.acceleration import Scheme
from master.coupling.acceleration.scheme import adopt
from master.coupling.checkpoint import NO_FILES, Files
from master.coupling.equilibrium import CoupledResult, Coupling
from master.coupling.exchange import Exchange, StateSnapshot
from master.coupling.march import March
from master.coupling.participants.blocks import assignment_text
from master.coupling.steady import Search


@dataclass(frozen=True, eq=False)
class Job:
    """A run that is asked for: the `scene`, `given` parameters, `choices` of the command line, the folder `out`, the
    checkpoints, the texts `assigned` on the command line, and what a restart has `kept` besides.
    """

    scene: Any
    given: dict[str, Any]
    choices: dict[str, Any]
    out: Path
    files: Files = NO_FILES
    assigned: dict[str, str] = field(default_factory=dict)
    kept: list[str] = field(default_factory=list)

    @property
    def about(self) -> dict[str, Any]:
        """What a checkpoint says of the run."""
        scene = {"scene": self.scene.name, "scene_settings": self.scene.settings, "scene_files": digest(self.scene)}
        return {**scene, "parameters": _plain(self.given), **self.choices}

    def clear(self, names: Iterable[str]) -> None:
        """Remove files of these names, and FMUs that this run has not built: what stands in the folder is never of an
        earlier run. Called when all input is known to be good.
        """
        for name in names:
            (self.out / name).unlink(missing_ok=True)
        for side in ("structural", "aero") if self.choices["backend"] == "in-process" else ():
            (self.out / "fmus" / f"{self.scene.name}_{side}.fmu").unlink(missing_ok=True)

    @property
    def remembered(self) -> list[str]:
        """A remark on what a restart has from its checkpoint."""
        return [f"as in the checkpoint: {', '.join(self.kept)}"] if self.kept else []


def digest(scene: Any) -> str:
    """What stands for the contents of the files that a scene is made of."""
    total = hashlib.sha256()
    for name in sorted(set(scene.files)):
        content = (scene.folder / name).read_bytes()
        total.update(f"{name}\n{len(content)}\n".encode() + content)
    return total.hexdigest()[:16]


def _plain(given: dict[str, Any]) -> dict[str, Any]:
    """Parameters as numbers and lists, to be compared and written."""
    return {name: np.asarray(value, dtype=float).tolist() for name, value in given.items()}


def remembered(path: Path, scene: str, backend: str, assigned: Mapping[str, str]) -> dict[str, str]:
    """Settings and parameters with which to build the participants of a restart, as texts: those of the checkpoint,
    and the `assigned` ones before them.

    ValueError in one sentence for a checkpoint of another scene or backend, whose states do not fit.
    """
    about = checkpoint.head(path)
    _require_same(path, about, scene=scene, backend=backend)
    kept = {name: str(value) for name, value in about["scene_settings"].items()}
    kept |= {name: assignment_text(value) for name, value in about["parameters"].items()}
    return {**kept, **assigned}


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
        self._path, self._every, self._about = path, every, about
        self._coupling, self._scheme = coupling, scheme

    def __call__(self, search: Search, snapshot: StateSnapshot) -> None:
        """Before a coupling iteration."""
        if self._path is not None and len(search.history) % self._every == 0:
            about = {**self._about, "coupling_iterations": len(search.history), "status": "under way"}
            checkpoint.write(self._path, about, checkpoint.dump_search(self._coupling, self._scheme, search, snapshot))

    def end(self, result: CoupledResult) -> None:
        """After a solve that converged: another wind or tolerance may begin from here."""
        if self._path is not None:
            about = {**self._about, "coupling_iterations": result.iterations, "status": result.status}
            ended = Search(self._about["order"], self._coupling.present(self._about["order"]), history=result.history)
            checkpoint.write(self._path, about, checkpoint.dump_search(self._coupling, self._scheme, ended, None))


class StepCheckpointWriter:
    """Writes the checkpoints of a transient run: every so many communication steps, and at its end."""

    def __init__(self, files: Files, stop_time: float, about: Mapping[str, Any]) -> None:
        self._files, self._stop, self._about = files, stop_time, about

    def __call__(self, exchange: Exchange, scheme: Scheme | None, march: March) -> None:
        """After a communication step."""
        last = exchange.time > self._stop - 0.5 * exchange.dt
        if self._files.checkpoint is not None and (last or len(march.steps) % self._files.every == 0):
            about = {**self._about, "time": exchange.time, "steps": len(march.steps)}
            checkpoint.write(self._files.checkpoint, about, checkpoint.dump_march(exchange, scheme, march))


# What may change without ending the loop under way: it only says how long to continue and what to do afterwards.
HARMLESS = ("max_iterations", "stability", "report")


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
    return [k for k in keys if now.get(k) != was.get(k) and (k != "scene_files" or k in was)]


def _difference(key: str, was: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """What is another in a restart, in words."""
    if key == "scene_files":
        return "with other tables of the scene than then"
    return f"{key} {was.get(key)} -> {now[key]}"


def _give(exchange: Exchange, now: Mapping[str, Any], names: list[str]) -> None:
    """Set parameters of these names in all participants that have them."""
    for name in names:
        for participant in exchange.participants.values():
            if participant.causality.get(name) == "parameter":
                participant.set(name, now["parameters"][name])


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
        begun = checkpoint.load_march(exchange, content, scheme)
        begun.require_fields(exchange, about["order"])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    _give(exchange, now, given)
    changed = _others(was, now, ("scene_files", "scheme", "tolerance", "communication_step"))
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
        search = checkpoint.load_search(coupling, content)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
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
