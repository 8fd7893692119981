"""Checkpoint and restart: the state of a coupled run in one file, so that it can continue as if it had never stopped.

The file has a line that says what it is, a line of JSON for people, and the content as npz with JSON in it
(`interface.records`), checked by its SHA-256. Nothing of it is run.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from interface import StepFailed, irregular
from master.coupling.acceleration import Scheme
from master.coupling.acceleration.scheme import adopt
from master.coupling.convergence import required_count
from master.coupling.exchange import Exchange, StateSnapshot
from master.coupling.kept import damage, dumps, loads
from master.coupling.march import March
from master.coupling.steady import Search

NUMBERS = ("time", "steps", "coupling_iterations", "stop_time", "communication_step")  # of what it says of a run
TABLES = ("scene_settings", "parameters", "models", "validity")
MAGIC = b"kitecosim checkpoint 4\n"


@dataclass(frozen=True)
class Files:
    """Where a run keeps a checkpoint, after how many coupling iterations (transient: steps) each, and which one it
    continues from. ValueError in one sentence for `every` below 1 and for a place that takes no file.
    """

    checkpoint: Path | None = None
    every: int = 1
    restart: Path | None = None

    def __post_init__(self) -> None:
        for name in ("checkpoint", "restart"):
            if not isinstance(getattr(self, name), Path | None):
                raise ValueError(f"{name} must be a pathlib.Path, not {getattr(self, name)!r}.")
        required_count("--checkpoint-every", self.every)
        if self.checkpoint is not None and (what := irregular(self.checkpoint)):
            raise ValueError(f"--checkpoint {self.checkpoint} is {what}; name a file.")
        if self.checkpoint is not None and not self.checkpoint.parent.is_dir():
            raise ValueError(
                f"--checkpoint {self.checkpoint}: there is no folder {self.checkpoint.parent}; make it first."
            )

    def absolute(self) -> "Files":
        """The same files, wherever the working directory will be."""
        places = (None if path is None else path.absolute() for path in (self.checkpoint, self.restart))
        checkpoint, restart = places
        return replace(self, checkpoint=checkpoint, restart=restart)

    def require_writable(self) -> None:
        """ValueError in one sentence where no checkpoint can be written."""
        if self.checkpoint is not None:
            try:
                with _part(self.checkpoint) as part:
                    part.write_bytes(b"")
            except OSError as error:
                raise ValueError(_unwritable(self.checkpoint, error)) from None
            for path in (self.checkpoint, _earlier(self.checkpoint)):
                if os.path.lexists(path) and not _is_checkpoint(path):
                    raise ValueError(f"--checkpoint {self.checkpoint}: {path} is there and no checkpoint; move it.")

    def begin(self) -> None:
        """Call the checkpoint of an earlier run NAME.earlier until there is one of the run that begins, so that none is
        taken for its; that which it continues from stays.
        """
        if self.checkpoint is None or not self.checkpoint.exists():
            return
        if self.restart is None or not self.checkpoint.samefile(self.restart):
            os.replace(self.checkpoint, _earlier(self.checkpoint))

    def written(self) -> None:
        """After a checkpoint was written: that of an earlier run is of no more use."""
        if self.checkpoint is not None and _is_checkpoint(_earlier(self.checkpoint)):
            with contextlib.suppress(OSError):
                _earlier(self.checkpoint).unlink()


NO_FILES = Files()


class Keeper:
    """Writes the checkpoints of a run. One that cannot be written is a remark, once, and the run goes on without it."""

    def __init__(self, files: Files) -> None:
        self._files = files
        self.remarks: list[str] = []

    def keep(
        self, number: int, when: str, about: Mapping[str, Any], content: Callable[[], Mapping[str, Any]],
        last: bool = False,
    ) -> None:  # fmt: skip
        """Write a checkpoint after so many iterations or steps, if it is time for one or this is the `last`; `when`
        says where the run is.
        """
        path = self._files.checkpoint
        if path is None or not (last or number % self._files.every == 0):
            return
        try:
            write(path, about, content())
            self._files.written()
        except Exception as error:  # whatever it is, results are worth more than a checkpoint
            if not self.remarks:
                reason = f"{type(error).__name__}: {error}" if not isinstance(error, _TOLD) else str(error)
                self.remarks.append(f"no checkpoint {when}: {reason.rstrip('.')}; the run went on without it")


_TOLD = (ValueError, RuntimeError, StepFailed)  # say in a sentence what is wrong


def write(path: str | Path, about: Mapping[str, Any], content: Mapping[str, Any]) -> None:
    """Write a checkpoint, whole or not at all; `about` is what people read in its second line. ValueError in one
    sentence if it cannot be written.
    """
    path = Path(path)
    try:
        data = dumps(dict(content))
    except TypeError as error:
        raise ValueError(f"checkpoint {path} cannot be written: {str(error).rstrip('.')}.") from error
    head = {**about, "sha256": hashlib.sha256(data).hexdigest()}
    try:
        with _part(path) as part:
            part.write_bytes(MAGIC + json.dumps(head, default=str).encode() + b"\n" + data)
            os.replace(part, path)
    except OSError as error:
        raise ValueError(_unwritable(path, error)) from None


def _earlier(path: Path) -> Path:
    """What the checkpoint of an earlier run is called meanwhile."""
    return path.with_name(f"{path.name}.earlier")


def _is_checkpoint(path: Path) -> bool:
    """Whether a file is a checkpoint of some version, or empty."""
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC) - 2) in (b"", MAGIC[:-2])
    except OSError:
        return False


def _unwritable(path: Path, error: OSError) -> str:
    return f"checkpoint {path} cannot be written ({(error.strerror or str(error)).lower()})."


@contextlib.contextmanager
def _part(path: Path) -> Iterator[Path]:
    """Where a file is written before it gets its name; what is left there goes at the end."""
    part = path.with_name(path.name + ".part")
    try:
        yield part
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def head(path: str | Path) -> dict[str, Any]:
    """What a checkpoint is about; ValueError in one sentence if it is not a sound one."""
    about, _ = _parts(path)
    return about


def read(path: str | Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a checkpoint is about, and its content; ValueError in one sentence if it is not a sound one."""
    about, data = _parts(path)
    with damaged(path):
        content = loads(data)
        if not isinstance(content, dict):
            raise TypeError
    return about, content


def damaged(path: str | Path) -> contextlib.AbstractContextManager[None]:
    """What is not as a checkpoint has it becomes a ValueError in one sentence."""
    return damage(f"checkpoint {path} is damaged or of another version; begin without it.")


def _parts(path: str | Path) -> tuple[dict[str, Any], bytes]:
    """What a checkpoint is about, and its content as bytes that are whole."""
    if (what := irregular(path)) and what != "a folder":
        raise ValueError(f"checkpoint {path} cannot be read (it is {what}).")
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise ValueError(f"checkpoint {path} cannot be read ({(error.strerror or str(error)).lower()}).") from None
    if not raw.startswith(MAGIC):
        if raw.startswith(MAGIC[:-2]):
            raise ValueError(f"checkpoint {path} was written by another version of kitecosim; begin without it.")
        raise ValueError(f"{path} is not a checkpoint of kitecosim; name one, or begin without it.")
    line, _, data = raw[len(MAGIC) :].partition(b"\n")
    try:
        about: dict[str, Any] = json.loads(line)
        if about.pop("sha256") != hashlib.sha256(data).hexdigest():
            raise ValueError
        if not all(isinstance(about.get(key, 0.0), int | float) for key in NUMBERS):
            raise ValueError
        if not all(isinstance(about.get(key, {}), dict) for key in TABLES):
            raise ValueError
    except (ValueError, LookupError, TypeError, AttributeError):
        raise ValueError(f"checkpoint {path} is damaged or of another version; begin without it.") from None
    return about, data


def serialised(exchange: Exchange, states: Mapping[str, Any]) -> dict[str, bytes]:
    """States of the participants as bytes."""
    return {name: exchange.participants[name].serialised(state) for name, state in states.items()}


def dump_participants(exchange: Exchange) -> dict[str, Any]:
    """Clock, counters, blocks and serialised states of the participants as they are now."""
    now = exchange.save()
    try:
        kept = serialised(exchange, now)
    finally:
        exchange.free(now)
    found = {"clock": exchange.clock, "dt": exchange.dt, "evaluations": exchange.evaluations, "states": kept}
    return found | {"blocks": {name: _blocks(exchange, name) for name in kept}}


def _blocks(exchange: Exchange, name: str) -> dict[str, tuple[int, ...]]:
    """Block -> shape of a participant; names that a user has given do not count."""
    participant = exchange.participants[name]
    return {block: tuple(shape) for block, shape in getattr(participant, "own_blocks", participant.blocks).items()}


def load_participants(exchange: Exchange, kept: Mapping[str, Any]) -> None:
    """Restore participants made alike from what `dump_participants` gave; ValueError in one sentence for others, which
    stay as they are.
    """
    if missing := sorted(kept["states"].keys() ^ exchange.saving()):
        raise ValueError(f"the checkpoint is of other participants: they differ in {', '.join(missing)}.")
    for name, blocks in kept.get("blocks", {}).items():
        _require_blocks(name, blocks, _blocks(exchange, name))
    states: dict[str, Any] = {}
    try:
        for name, data in kept["states"].items():
            states[name] = exchange.participants[name].deserialised(data)
        exchange.restore(states)
    except StepFailed as error:
        raise ValueError(f"the checkpoint does not fit: {error}.") from error
    finally:
        exchange.free(states)
    (begin, count), dt = kept["clock"], kept["dt"]
    exchange.clock = (begin, count) if dt == exchange.dt else (begin + count * dt, 0)
    exchange.evaluations = kept["evaluations"]


def _require_blocks(name: str, was: Mapping[str, tuple[int, ...]], here: Mapping[str, tuple[int, ...]]) -> None:
    """ValueError in one sentence where the blocks of a participant are not those of the checkpoint."""
    other = [block for block in {**was, **here} if was.get(block) != here.get(block)]
    if other:
        then, now = (f"shape {blocks[other[0]]}" if other[0] in blocks else "none" for blocks in (was, here))
        more = f" ({len(other) - 1} more differ)" if len(other) > 1 else ""
        raise ValueError(
            f"the checkpoint does not fit, as the tables or settings it was written with were others: {other[0]} of "
            f"{name} has {then} there and {now} here{more}; begin without it."
        )


def dump_search(coupling: Exchange, scheme: Scheme, search: Search, snapshot: StateSnapshot | None) -> dict[str, Any]:
    """Content of a checkpoint of a coupled solve; `snapshot` None after its end."""
    best = None if snapshot is None else {"states": serialised(coupling, snapshot.states), "clock": snapshot.clock}
    return {"search": search, "scheme": scheme, "participants": dump_participants(coupling), "best": best}


def load_search(coupling: Exchange, content: Mapping[str, Any]) -> Search:
    """Restore the participants of a coupled solve; what `solve` continues from."""
    if "search" not in content:
        raise ValueError("the checkpoint is not of a coupled equilibrium.")
    search = content["search"]
    if not isinstance(search, Search):
        raise ValueError("the checkpoint is not of a coupled equilibrium.")
    _require_unknowns(search.x, coupling.present(search.order))
    load_participants(coupling, content["participants"])
    if content["best"] is not None:
        best = content["best"]["states"]
        states = {n: coupling.participants[n].deserialised(data) for n, data in best.items()}
        search.best = states, content["best"]["clock"]
    return search


def dump_march(exchange: Exchange, scheme: Scheme | None, begun: March) -> dict[str, Any]:
    """Content of a checkpoint of a transient run."""
    return {"march": begun, "scheme": scheme, "participants": dump_participants(exchange)}


def load_march(exchange: Exchange, content: Mapping[str, Any], scheme: Scheme | None = None) -> March:
    """Restore the participants of a transient run; what `march` continues from as `begun`.

    A `scheme` of the kind of then takes over its history. ValueError in one sentence for a checkpoint of something
    else or of other participants.
    """
    if "march" not in content:
        raise ValueError("the checkpoint is not of a transient run.")
    begun = content["march"]
    if not isinstance(begun, March):
        raise ValueError("the checkpoint is not of a transient run.")
    load_participants(exchange, content["participants"])
    if scheme is not None:
        adopt(scheme, content["scheme"])
    return begun


def _require_unknowns(x: np.ndarray, here: np.ndarray) -> None:
    """ValueError in one sentence where the unknowns are not as many numbers."""
    if np.shape(x) != here.shape or not np.all(np.isfinite(x)):
        raise ValueError(f"the checkpoint has {np.size(x)} unknowns, and here are {here.size}; begin without it.")


# Their names in releases up to 0.1
of_search, search_of, of_march, march_of = dump_search, load_search, dump_march, load_march
