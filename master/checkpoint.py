"""Checkpoints: where a coupled run stands, in one file, so that it can go on later as if it had never stopped.

The file has a line that says what it is, a line of JSON for people, and pickled content, checked by its SHA-256.
Pickles can run code when they are read: read only files of your own.
"""

import contextlib
import hashlib
import json
import os
import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from master.acceleration import Scheme
from master.acceleration.scheme import adopt
from master.coupling import CoupledResult, Coupling, Search
from master.exchange import CoupledStepFailed, Exchange
from master.march import March
from master.recovery import Warmth

MAGIC = b"kitecosim checkpoint 1\n"


def write(path: str | Path, about: Mapping[str, Any], content: Mapping[str, Any]) -> None:
    """Write a checkpoint, whole or not at all; `about` is what people read in its second line. ValueError in one
    sentence if it cannot be written.
    """
    path = Path(path)
    data = pickle.dumps(dict(content), protocol=5)
    head = {**about, "sha256": hashlib.sha256(data).hexdigest()}
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(MAGIC + json.dumps(head, default=str).encode() + b"\n" + data)
        os.replace(part, path)
    except OSError as error:
        raise ValueError(f"checkpoint {path} cannot be written ({(error.strerror or str(error)).lower()}).") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def head(path: str | Path) -> dict[str, Any]:
    """What a checkpoint is about; ValueError in one sentence if it is not a sound one. Nothing is unpickled."""
    about, _ = _parts(path)
    return about


def read(path: str | Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a checkpoint is about, and its content; ValueError in one sentence if it is not a sound one."""
    about, data = _parts(path)
    try:
        return about, pickle.loads(data)
    except (ValueError, LookupError, TypeError, pickle.PickleError, AttributeError, ImportError, EOFError):
        raise ValueError(f"checkpoint {path} is damaged or of another version; begin without it.") from None


def _parts(path: str | Path) -> tuple[dict[str, Any], bytes]:
    """What a checkpoint is about, and its content as bytes that are whole."""
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise ValueError(f"checkpoint {path} cannot be read ({(error.strerror or str(error)).lower()}).") from None
    if not raw.startswith(MAGIC):
        raise ValueError(f"{path} is not a checkpoint of this version of kitecosim.")
    line, _, data = raw[len(MAGIC) :].partition(b"\n")
    try:
        about: dict[str, Any] = json.loads(line)
        if about.pop("sha256") != hashlib.sha256(data).hexdigest():
            raise ValueError
    except (ValueError, LookupError, TypeError, AttributeError):
        raise ValueError(f"checkpoint {path} is damaged or of another version; begin without it.") from None
    return about, data


def serialised(exchange: Exchange, states: Mapping[str, Any]) -> dict[str, bytes]:
    """States of the participants as bytes."""
    return {name: exchange.participants[name].serialised(state) for name, state in states.items()}


def participants(exchange: Exchange) -> dict[str, Any]:
    """Clock, counters and serialised states of the participants as they are now."""
    now = exchange.saved()
    try:
        kept = serialised(exchange, now)
    finally:
        exchange.freed(now)
    return {"clock": exchange.clock, "dt": exchange.dt, "evaluations": exchange.evaluations, "states": kept}


def put_back(exchange: Exchange, kept: Mapping[str, Any]) -> None:
    """Return participants made alike to what `participants` kept; ValueError in one sentence if they are others."""
    if missing := sorted(kept["states"].keys() ^ exchange.saving()):
        raise ValueError(f"the checkpoint is of other participants: they differ in {', '.join(missing)}.")
    (begin, count), dt = kept["clock"], kept["dt"]
    exchange.clock = (begin, count) if dt == exchange.dt else (begin + count * dt, 0)
    exchange.evaluations = kept["evaluations"]
    states: dict[str, Any] = {}
    try:
        for name, data in kept["states"].items():
            states[name] = exchange.participants[name].deserialised(data)
        exchange.put_back(states)
    except CoupledStepFailed as error:
        raise ValueError(f"the checkpoint does not fit: {error}.") from error
    finally:
        exchange.freed(states)


def of_search(coupling: Coupling, scheme: Scheme, search: Search, warmth: Warmth | None) -> dict[str, Any]:
    """Content of a checkpoint of a coupled solve; `warmth` None after its end."""
    best = None if warmth is None else {"states": serialised(coupling, warmth.states), "clock": warmth.clock}
    return {"search": search, "scheme": scheme, "participants": participants(coupling), "best": best}


def search_of(coupling: Coupling, content: Mapping[str, Any]) -> Search:
    """Put the participants back to where a coupled solve stood; what `solve` continues from."""
    if "search" not in content:
        raise ValueError("the checkpoint is not of a coupled equilibrium.")
    search: Search = content["search"]
    put_back(coupling, content["participants"])
    if content["best"] is not None:
        best = content["best"]["states"]
        states = {n: coupling.participants[n].deserialised(data) for n, data in best.items()}
        search.best = states, content["best"]["clock"]
    return search


def of_march(exchange: Exchange, scheme: Scheme | None, begun: March) -> dict[str, Any]:
    """Content of a checkpoint of a run through time."""
    return {"march": begun, "scheme": scheme, "participants": participants(exchange)}


def march_of(exchange: Exchange, content: Mapping[str, Any], scheme: Scheme | None = None) -> March:
    """Put the participants back to where a run through time stood; what `march` continues from as `begun`.

    A `scheme` of the kind of then takes over its history. ValueError in one sentence for a checkpoint of something
    else or of other participants.
    """
    if "march" not in content:
        raise ValueError("the checkpoint is not of a run through time.")
    put_back(exchange, content["participants"])
    if scheme is not None:
        adopt(scheme, content["scheme"])
    begun: March = content["march"]
    return begun


@dataclass(frozen=True)
class Files:
    """Where a run keeps a checkpoint, after how many coupling iterations (through time: steps) each, and which one it
    goes on from. ValueError in one sentence for `every` below 1 and for a place that takes no file.
    """

    checkpoint: Path | None = None
    every: int = 1
    restart: Path | None = None

    def __post_init__(self) -> None:
        if self.every < 1:
            raise ValueError(f"--checkpoint-every must be at least 1, not {self.every}.")
        if self.checkpoint is not None and self.checkpoint.is_dir():
            raise ValueError(f"--checkpoint {self.checkpoint} is a folder; name a file.")
        if self.checkpoint is not None and not self.checkpoint.parent.is_dir():
            raise ValueError(
                f"--checkpoint {self.checkpoint}: there is no folder {self.checkpoint.parent}; make it first."
            )


NO_FILES = Files()


def remembered(path: Path, scene: str, backend: str, assigned: Mapping[str, str]) -> dict[str, str]:
    """Settings and parameters with which to build the participants of a restart, as texts: those of the checkpoint,
    and the `assigned` ones before them.

    ValueError in one sentence for a checkpoint of another scene or backend, whose states do not fit.
    """
    about = head(path)
    _require_same(path, about, scene=scene, backend=backend)
    kept = {name: str(value) for name, value in about["scene_settings"].items()}
    kept |= {name: _text(value) for name, value in about["parameters"].items()}
    return {**kept, **assigned}


def _require_same(path: Path, was: Mapping[str, Any], **now: str) -> None:
    for key, mine in now.items():
        if was.get(key) != mine:
            remedy = f"name that {key}" if key == "scene" else f"add --{key} {was.get(key)}"
            raise ValueError(f"checkpoint {path} is of {key} {was.get(key)}, this run of {mine}; {remedy}.")


def _text(value: Any) -> str:
    return ",".join(map(repr, value)) if isinstance(value, list) else repr(value)


class Keeper:
    """Writes the checkpoints of a coupled solve; without a path none."""

    def __init__(
        self, path: Path | None, every: int, coupling: Coupling, scheme: Scheme, about: Mapping[str, Any]
    ) -> None:
        self._path, self._every, self._about = path, every, about
        self._coupling, self._scheme = coupling, scheme

    def __call__(self, search: Search, warmth: Warmth) -> None:
        """Before a coupling iteration."""
        if self._path is not None and len(search.history) % self._every == 0:
            about = {**self._about, "coupling_iterations": len(search.history), "status": "under way"}
            write(self._path, about, of_search(self._coupling, self._scheme, search, warmth))

    def end(self, result: CoupledResult) -> None:
        """After a solve that converged: another wind or tolerance may begin from here."""
        if self._path is not None:
            about = {**self._about, "coupling_iterations": result.iterations, "status": result.status}
            ended = Search(self._about["order"], self._coupling.present(self._about["order"]), history=result.history)
            write(self._path, about, of_search(self._coupling, self._scheme, ended, None))


# What may change without ending the loop under way: it only says how long to go on and what to do afterwards.
HARMLESS = ("max_iterations", "stability", "report")


def restart(
    path: Path, coupling: Coupling, scheme: Scheme, about: Mapping[str, Any], chosen: Mapping[str, Any]
) -> tuple[Search, list[str]]:
    """Where a coupled solve goes on from a checkpoint, and a remark on what is different now.

    With the settings as they were the loop goes on bitwise as if it had not stopped. With others (scheme, tolerances,
    tunable parameters among the `chosen`) a new loop begins at the shape and with the solvers' states of the
    checkpoint, and with its quasi-Newton history where the scheme is of the same kind. ValueError in one sentence for
    a checkpoint of another scene, with other settings of it or of the other backend, and for a fixed parameter that
    shall change.
    """
    was, content = read(path)
    _require_same(path, was, scene=about["scene"])
    now = json.loads(json.dumps(dict(about), default=str))
    for name, value in now["scene_settings"].items():
        if was["scene_settings"].get(name) != value:
            raise ValueError(
                f"checkpoint {path} has {name} = {was['scene_settings'].get(name)}, this run {value}; a setting of the "
                "scene cannot change in a restart."
            )
    given = [k for k in chosen if k in now["parameters"] and now["parameters"][k] != was["parameters"].get(k)]
    for name in given:
        if name in coupling.fixed():
            raise ValueError(f"{name} is fixed once a run has begun; leave it out in a restart.")
    try:
        search = search_of(coupling, content)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    adopted = was.get("order") == about["order"] and adopt(scheme, content["scheme"])  # else the unknowns are others
    changed = [k for k in now if k not in (*HARMLESS, "parameters") and now[k] != was.get(k)]
    remark = f"went on from {path.name} after {was['coupling_iterations']} coupling iterations"
    if not changed and not given and search.loop is not None:
        return search, [remark]
    if search.best is not None:
        coupling.freed(search.best[0])
    for name in given:
        for participant in (coupling.structural, coupling.aero):
            if participant.causality.get(name) == "parameter":
                participant.set(name, now["parameters"][name])
    for key in changed:
        remark += f", {key} {was.get(key)} -> {now[key]}"
    for name in given:
        remark += f", {name} {was['parameters'].get(name, 'as in the scene')} -> {now['parameters'][name]}"
    remark += "; coupling iterations are counted anew"
    remark += "" if adopted else ", without the history of another scheme"
    return Search(about["order"], coupling.present(about["order"])), [remark]
