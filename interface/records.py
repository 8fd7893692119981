"""Plain data as npz and JSON: what solver states and prepared scenes are stored as. No code comes back from it.

A value is made of None, numbers, texts, tuples, lists, dicts, sets, enumerations, dataclasses, numpy arrays and sparse
arrays (CSR). It becomes a tree that JSON holds, and arrays, those of one type joined into one. What is read is bitwise
what was written, with the order of arrays in memory and arrays that stand in two places shared.
"""

import io
import json
import math
import sys
import zipfile
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, cached_property
from typing import Any

import numpy as np

ROOT = __name__.removesuffix("interface.records")  # the package that this one is in, with its dot, or ""
TREE = "tree"  # of the arrays of a record, the bytes of its JSON


class _Writer:
    """Arrays written so far, and the tree of what holds them."""

    def __init__(self) -> None:
        self._parts: dict[str, list[np.ndarray]] = {}
        self._lengths: dict[str, int] = {}
        self._memo: dict[int, tuple[np.ndarray, dict[str, Any]]] = {}  # arrays are kept, so that no id comes twice

    def arrays(self) -> dict[str, np.ndarray]:
        return {name: np.concatenate(parts, dtype=parts[0].dtype) for name, parts in self._parts.items()}

    def tree(self, value: Any) -> Any:
        kind: Any = type(value)
        if value is None or kind in (bool, int, str):
            return value
        if kind is float:
            return value if math.isfinite(value) else {"float": str(value)}
        if kind is complex:
            return {"complex": [self.tree(value.real), self.tree(value.imag)]}
        if kind is bytes:
            return {"bytes": self._array(np.frombuffer(value, np.uint8))}
        if kind is tuple:
            return [self.tree(v) for v in value]
        if kind in (list, set, frozenset):
            items = value if kind is list else sorted(value, key=lambda v: (type(v).__name__, repr(v)))
            return {kind.__name__: [self.tree(v) for v in items]}
        if kind is dict:
            return {"dict": [[self.tree(k), self.tree(v)] for k, v in value.items()]}
        if kind is np.ndarray:
            return self._array(value)
        if isinstance(value, np.generic):
            return {"scalar": self._array(np.asarray(value))}
        if isinstance(value, Enum) and kind.__members__.get(value.name) is value:
            return {"enum": _place(kind), "member": value.name}
        if is_dataclass(value) and not isinstance(value, type):
            return {"of": _place(kind), "fields": self._fields(value)}
        if kind.__name__ == "csr_array":
            return {"csr": [self._array(np.asarray(a)) for a in (value.data, value.indices, value.indptr)],
                    "shape": list(value.shape)}  # fmt: skip
        raise TypeError(
            f"a {kind.__name__} cannot be stored; states are numbers, texts, arrays, tuples, lists, dicts, sets and "
            "dataclasses."
        )

    def _fields(self, value: Any) -> dict[str, Any]:
        held, kind = {f.name for f in fields(value)}, type(value)
        for name in vars(value).keys() - held if hasattr(value, "__dict__") else ():
            if not isinstance(getattr(kind, name, None), cached_property):
                raise TypeError(f"a {kind.__name__} with '{name}' beside its fields cannot be stored; make it a field.")
        return {name: self.tree(getattr(value, name)) for name in (f.name for f in fields(value))}

    def _array(self, value: np.ndarray) -> dict[str, Any]:
        if value.dtype.hasobject or value.dtype.names:
            raise TypeError(f"an array of {value.dtype} cannot be stored; take numbers or texts.")
        if id(value) in self._memo:
            return self._memo[id(value)][1]
        name, columns = value.dtype.str.lstrip("<=|"), value.flags.f_contiguous and not value.flags.c_contiguous
        begin = self._lengths.get(name, 0)
        self._parts.setdefault(name, []).append(value.reshape(-1, order="F" if columns else "C"))
        self._lengths[name] = begin + value.size
        at = {"array": name, "at": begin, "shape": list(value.shape)} | ({"order": "F"} if columns else {})
        self._memo[id(value)] = value, at
        return at


@cache
def _place(kind: Any) -> str:
    """Module and name of a class; TypeError where it is not found there again."""
    found: Any = sys.modules.get(kind.__module__)
    for part in kind.__qualname__.split("."):
        found = getattr(found, part, None)
    if found is not kind or (kind.__new__ is not object.__new__ and not issubclass(kind, Enum)):
        raise TypeError(f"a {kind.__name__} cannot be stored; its class must be a plain one at the top of a module.")
    return f"{kind.__module__.removeprefix(ROOT)}:{kind.__qualname__}"


class _Reader:
    def __init__(self, arrays: dict[str, np.ndarray]) -> None:
        self._arrays = arrays
        self._memo: dict[tuple[str, int, tuple[int, ...]], np.ndarray] = {}

    def value(self, tree: Any) -> Any:
        if tree is None or isinstance(tree, bool | int | float | str):
            return tree
        if isinstance(tree, list):
            return tuple(self.value(v) for v in tree)
        tag = next(iter(tree))
        read: Callable[[Any], Any] = getattr(self, f"_{tag}", self._unknown)
        return read(tree)

    @staticmethod
    def _unknown(tree: Any) -> Any:
        raise ValueError(f"there is nothing of the kind {next(iter(tree))!r} in a record.")

    @staticmethod
    def _float(tree: Any) -> float:
        return float(tree["float"])

    def _complex(self, tree: Any) -> complex:
        return complex(*(self.value(part) for part in tree["complex"]))

    def _bytes(self, tree: Any) -> bytes:
        return self._array(tree["bytes"]).tobytes()

    def _list(self, tree: Any) -> list[Any]:
        return [self.value(v) for v in tree["list"]]

    def _set(self, tree: Any) -> set[Any]:
        return {self.value(v) for v in tree["set"]}

    def _frozenset(self, tree: Any) -> frozenset[Any]:
        return frozenset(self.value(v) for v in tree["frozenset"])

    def _dict(self, tree: Any) -> dict[Any, Any]:
        return {self.value(k): self.value(v) for k, v in tree["dict"]}

    def _enum(self, tree: Any) -> Any:
        return _kind(tree["enum"], lambda kind: issubclass(kind, Enum))[tree["member"]]

    def _array(self, tree: Any) -> np.ndarray:
        name, begin, shape = tree["array"], tree["at"], tuple(tree["shape"])
        if (name, begin, shape) not in self._memo:
            flat = self._arrays[name][begin : begin + math.prod(shape)]
            self._memo[name, begin, shape] = flat.reshape(shape, order=tree.get("order", "C")).copy(order="K")
        return self._memo[name, begin, shape]

    def _scalar(self, tree: Any) -> Any:
        return self._array(tree["scalar"])[()]

    def _csr(self, tree: Any) -> Any:
        from scipy.sparse import csr_array

        data, indices, indptr = (self._array(a) for a in tree["csr"])
        return csr_array((data, indices, indptr), shape=tuple(tree["shape"]))

    def _of(self, tree: Any) -> Any:
        kind = _kind(tree["of"], is_dataclass)
        if {f.name for f in fields(kind)} != tree["fields"].keys():
            raise ValueError(f"{kind.__name__} has other fields than the record of it.")
        made = object.__new__(kind)
        for name, value in tree["fields"].items():
            object.__setattr__(made, name, self.value(value))
        return made


def _kind(place: str, fits: Callable[[Any], bool]) -> Any:
    """A class of this project or of a script that is loaded, if it fits: nothing else is looked up, no code is run but
    that of the project's own modules.
    """
    from importlib import import_module

    module, _, name = place.partition(":")
    own = module.partition(".")[0] in ("interface", "structural", "aero", "scenes", "fmus")
    found: Any = import_module(f"{ROOT}{module}") if own else sys.modules.get(module)
    for part in name.split("."):
        found = getattr(found, part, None)
    if not (isinstance(found, type) and fits(found)):
        raise ValueError(f"there is no kind of record {place!r}.")
    return found


def packed(value: Any) -> tuple[Any, dict[str, np.ndarray]]:
    """The tree of a value, for JSON, and the arrays (type -> values in a row) that it points into. TypeError for what
    cannot be stored.
    """
    writer = _Writer()
    try:
        return writer.tree(value), writer.arrays()
    except RecursionError:
        raise TypeError("what contains itself, or is nested too deeply, cannot be stored.") from None


def unpacked(tree: Any, arrays: dict[str, np.ndarray]) -> Any:
    """The value of a tree and its arrays; ValueError, LookupError or TypeError where they are none."""
    return _Reader(arrays).value(tree)


def npz(arrays: dict[str, np.ndarray]) -> bytes:
    """The bytes of an npz file, the same for the same arrays."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def from_npz(data: bytes) -> dict[str, np.ndarray]:
    """The arrays of an npz file; ValueError where it is none."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            return dict(file)
    except (OSError, zipfile.BadZipFile, EOFError, LookupError) as error:
        raise ValueError(f"no npz file: {error}") from None


def dumps(value: Any) -> bytes:
    """A value as the bytes of one npz file with its tree in it."""
    tree, arrays = packed(value)
    text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
    return npz({TREE: np.frombuffer(text, np.uint8), **arrays})


def loads(data: bytes) -> Any:
    """The value that `dumps` made bytes of; ValueError, LookupError or TypeError where they are none."""
    arrays = from_npz(data)
    return unpacked(json.loads(arrays.pop(TREE).tobytes()), arrays)
