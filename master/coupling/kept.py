"""The objects of a coupling loop as plain data and back, so that a checkpoint is made of npz and JSON (`records`).

Only classes of this package come back, each with the attributes that it had; nothing of a file is run.
"""

import contextlib
import sys
from array import array
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from interface import records

PACKAGE = __name__.partition(".")[0]
DAMAGE = (ValueError, TypeError, AttributeError, LookupError, ArithmeticError, RecursionError, MemoryError, EOFError)


@dataclass
class Kept:
    """An object of a `kind`: "slice", "deque", "array", or the place of a class; `state` is what makes it again."""

    kind: str
    state: Any


def dumps(content: Any) -> bytes:
    """Content as bytes; TypeError in one sentence for what cannot be stored."""
    return records.dumps(_plain(content))


def loads(data: bytes) -> Any:
    """The content that `dumps` made bytes of; one of the errors of DAMAGE where they are none."""
    return _made(records.loads(data))


@contextlib.contextmanager
def damage(sentence: str) -> Iterator[None]:
    """What goes wrong with content of another make becomes a ValueError with this sentence; others pass."""
    try:
        yield
    except DAMAGE as error:
        if isinstance(error, ValueError) and str(error).endswith("."):  # a sentence already
            raise
        raise ValueError(sentence) from error


def _plain(value: Any) -> Any:
    kind = type(value)
    if kind is dict:
        return {key: _plain(v) for key, v in value.items()}
    if kind in (list, tuple):
        return kind(_plain(v) for v in value)
    if kind is slice:
        return Kept("slice", (value.start, value.stop, value.step))
    if kind is deque:
        return Kept("deque", (value.maxlen, [_plain(v) for v in value]))
    if kind is array:
        return Kept("array", (value.typecode, np.array(value)))
    if kind.__module__.partition(".")[0] == PACKAGE and not issubclass(kind, Kept):
        return Kept(f"{kind.__module__}:{kind.__qualname__}", _plain(dict(value.__getstate__() or {})))
    return value


def _made(value: Any) -> Any:
    kind = type(value)
    if kind is dict:
        return {key: _made(v) for key, v in value.items()}
    if kind in (list, tuple):
        return kind(_made(v) for v in value)
    if not isinstance(value, Kept):
        return value
    if value.kind == "slice":
        return slice(*value.state)
    if value.kind == "deque":
        most, content = value.state
        return deque(_made(content), most)
    if value.kind == "array":
        return array(value.state[0], value.state[1].tolist())
    return _object(value.kind, _made(value.state))


def _object(place: str, state: dict[str, Any]) -> Any:
    """An object of a class of this package, as it was."""
    module, _, name = place.partition(":")
    found = getattr(sys.modules.get(module), name, None) if module.partition(".")[0] == PACKAGE else None
    if not isinstance(found, type) or found.__module__ != module or "__new__" in vars(found):
        raise ValueError(f"there is no class {place!r} of a coupling loop")
    made: Any = object.__new__(found)
    if hasattr(made, "__setstate__"):
        made.__setstate__(state)
    else:
        vars(made).update(state)
    return made
