"""Checkpoints: where a coupled run stands, in one file, so that it can go on later as if it had never stopped.

The file has a line that says what it is, a line of JSON for people, and pickled content, checked by its SHA-256.
Pickles can run code when they are read: read only files of your own.
"""

import hashlib
import json
import os
import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from master.acceleration import Scheme
from master.coupling import Coupling, Search
from master.exchange import Exchange, Warmth
from master.march import March

MAGIC = b"kitecosim checkpoint 1\n"


def write(path: str | Path, about: Mapping[str, Any], content: Mapping[str, Any]) -> None:
    """Write a checkpoint, whole or not at all; `about` is what people read in its second line."""
    path = Path(path)
    data = pickle.dumps(dict(content), protocol=5)
    head = {**about, "sha256": hashlib.sha256(data).hexdigest()}
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(MAGIC + json.dumps(head, default=str).encode() + b"\n" + data)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def read(path: str | Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a checkpoint is about, and its content; ValueError in one sentence if it is not a sound one."""
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise ValueError(f"checkpoint {path} cannot be read ({(error.strerror or str(error)).lower()}).") from None
    if not raw.startswith(MAGIC):
        raise ValueError(f"{path} is not a checkpoint of this version of kitecosim.")
    head, _, data = raw[len(MAGIC) :].partition(b"\n")
    try:
        about = json.loads(head)
        if about.pop("sha256") != hashlib.sha256(data).hexdigest():
            raise ValueError
        content = pickle.loads(data)
    except (ValueError, KeyError, pickle.PickleError, AttributeError, ImportError, EOFError):
        raise ValueError(f"checkpoint {path} is damaged or of another version; begin without it.") from None
    return about, content


def participants(exchange: Exchange, states: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Clock, counters and serialised states of the participants: the present ones, or `states` saved before."""
    now = exchange.saved() if states is None else dict(states)
    kept = {name: exchange.participants[name].serialised(state) for name, state in now.items()}
    if states is None:
        exchange.freed(now)
    return {"time": exchange.time, "evaluations": exchange.evaluations, "states": kept}


def put_back(exchange: Exchange, kept: Mapping[str, Any]) -> None:
    """Return participants made alike to what `participants` kept; ValueError in one sentence if they are others."""
    if missing := sorted(kept["states"].keys() ^ exchange.saving()):
        raise ValueError(f"the checkpoint is of other participants: they differ in {', '.join(missing)}.")
    exchange.time, exchange.evaluations = kept["time"], kept["evaluations"]
    states = {n: exchange.participants[n].deserialised(data) for n, data in kept["states"].items()}
    try:
        exchange.put_back(states)
    finally:
        exchange.freed(states)


def of_search(coupling: Coupling, scheme: Scheme, search: Search, warmth: Warmth | None) -> dict[str, Any]:
    """Content of a checkpoint of a coupled solve; `warmth` None after its end."""
    best = None if warmth is None else participants(coupling, warmth.states)
    return {"search": search, "scheme": scheme, "participants": participants(coupling), "best": best}


def search_of(coupling: Coupling, content: Mapping[str, Any]) -> Search:
    """Put the participants back to where a coupled solve stood; what `solve` continues from."""
    search: Search = content["search"]
    put_back(coupling, content["participants"])
    if content["best"] is not None:
        best = content["best"]["states"]
        search.best = {n: coupling.participants[n].deserialised(data) for n, data in best.items()}
    return search


def of_march(exchange: Exchange, scheme: Scheme | None, begun: March) -> dict[str, Any]:
    """Content of a checkpoint of a run through time."""
    return {"march": begun, "scheme": scheme, "participants": participants(exchange)}
