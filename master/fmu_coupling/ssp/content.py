"""An SSP as the content of a coupling file: participants, connections, start values and times."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

import numpy as np

from interface import misnamed
from master.fmu_coupling.mapping import Described
from master.fmu_coupling.ssp.fmus import ComponentFmu
from master.fmu_coupling.ssp.package import Files
from master.fmu_coupling.ssp.parameters import start_values
from master.fmu_coupling.ssp.signals import Path, Port, Signal, Signals, Way, nodes
from master.fmu_coupling.ssp.structure import Node, Structure, read_structure

SHOWN = 8  # names in a remark
TABLES = (  # of a coupling file, as messages have them -> what they are in a package
    (r"\[\[connections\]\] \d+:", "a connection:"),
    (r"\[participants\.(.+?)\.start\] (\S+)", r"parameter \2 of component \1"),
    (r"\[participants\.(.+?)\]", r"component \1"),
)


@dataclass(frozen=True)
class Package:
    """A package as the content of a coupling file; FMUs are relative to `files.folder`, which lives as long as `files`.

    `remarks` are sentences about what of it does not matter here.
    """

    content: dict[str, Any]
    files: Files
    remarks: tuple[str, ...]

    def refused(self, sentence: str) -> ValueError:
        """The refusal of the content, in the words of the package: it has no tables and keys."""
        for table, words in TABLES:
            sentence = re.sub(table, words, sentence)
        return self.files.refused(sentence)


def opened_package(path: str | File, taken: tuple[str, ...] = ()) -> Package:
    """The package in a file; ValueError in one sentence if it cannot be coupled. Names in `taken` are given to none."""
    files = Files(path)
    try:
        structure = read_structure(files)
        sources = {at: node.source for at, node in _components(structure).items()}
        described = {source: _described(files, source) for source in dict.fromkeys(sources.values())}
        fmus = {at: described[source] for at, source in sources.items()}
        if len(fmus) < 2:
            raise files.refused(f"has {len(fmus)} component{'s' * (len(fmus) != 1)}; two or more can be coupled.")
        signals = Signals(files, structure, fmus)
        return _Content(files, structure, fmus, signals, taken).package()
    except BaseException:
        files.close()
        raise


def _components(structure: Structure) -> dict[Path, Node]:
    return {path: node for path, node in nodes(structure.system) if not node.is_system}


def _described(files: Files, source: str) -> ComponentFmu:
    try:
        return ComponentFmu(Described(files.folder / source))
    except ValueError as error:
        raise files.refused(str(error)) from None


class _Content:
    """The parts of a content."""

    def __init__(
        self,
        files: Files,
        structure: Structure,
        fmus: Mapping[Path, ComponentFmu],
        signals: Signals,
        taken: tuple[str, ...],
    ) -> None:
        self.files, self.structure, self.fmus, self.signals = files, structure, fmus, signals
        self.names = _names(list(fmus), taken)
        self.blocks: dict[Path, dict[str, str]] = {path: {} for path in fmus}

    def package(self) -> Package:
        """All of it."""
        connections = [c for group in self._grouped(list(self.signals.all())) for c in self._connections(*group)]
        found, left = start_values(self.signals)
        starts = {path: self._start(path, found) for path in self.fmus}
        participants = {
            name: {
                "fmu": self.signals.nodes[path].source,
                "start": starts[path],
                "blocks": self.blocks[path],
            }
            for path, name in self.names.items()
        }
        connected = {c[end].partition(".")[0] for c in connections for end in ("from", "to")}
        for path, name in self.names.items():
            if name not in connected:
                raise self.files.refused(
                    f"component {'.'.join(path)} is connected to no other; connect it, or take it out."
                )
        time = {key: value for key, value in self.structure.times.items() if not math.isnan(value)}
        content = {"time": time, "participants": participants, "connections": connections}
        shown = [self._named(port) for port in self.signals.shown()]
        if shown:
            content["results"] = {"record": list(dict.fromkeys([*(c["from"] for c in connections), *shown]))}
        return Package(content, self.files, tuple(self._remarks(left)))

    def _remarks(self, left: list[str]) -> list[str]:
        renamed = [f"{'.'.join(p)} is called {n}" for p, n in self.names.items() if ".".join(p) != n]
        remarks = [f"of its components {_some(renamed)}"] if renamed else []
        return remarks + ([f"parameters that nothing takes: {_some(left)}"] if left else [])

    def _block(self, path: Path, name: str) -> str:
        """The block of a name in an FMU, made where it is an entry of an array."""
        if name not in self.fmus[path].described.blocks:
            self.blocks[path][name] = name
        return name

    def _named(self, port: Port) -> str:
        return f"{self.names[port[0]]}.{self._block(*port)}"

    def _grouped(self, signals: list[Signal]) -> list[tuple[Signal, list[Signal]]]:
        """Signals between the same entries of two arrays that are passed on alike, under the first of them."""
        groups: dict[Any, list[Signal]] = {}
        for number, signal in enumerate(signals):
            (source, output), (target, input_) = signal.source, signal.target
            a, b = self.fmus[source].places.get(output), self.fmus[target].places.get(input_)
            alike = a is not None and b is not None and a[1] == b[1]
            key = (source, target, a[0], b[0], signal.way) if alike and a and b else (number,)
            groups.setdefault(key, []).append(signal)
        return [(group[0], group) for group in groups.values()]

    def _connections(self, first: Signal, group: list[Signal]) -> list[dict[str, Any]]:
        """A connection of whole arrays where all their entries are connected, else one of each entry."""
        (source, output), (target, input_) = first.source, first.target
        a, b = self.fmus[source].places.get(output), self.fmus[target].places.get(input_)
        if a is not None and b is not None:
            shapes = self.fmus[source].described.blocks[a[0]], self.fmus[target].described.blocks[b[0]]
            if shapes[0] == shapes[1] and len(group) == int(np.prod(shapes[0])):
                return [self._connection((source, a[0]), (target, b[0]), first.way)]
        return [self._connection(signal.source, signal.target, signal.way) for signal in group]

    def _connection(self, source: Port, target: Port, way: Way) -> dict[str, Any]:
        link: dict[str, Any] = {"from": self._named(source), "to": self._named(target)}
        if way.table:
            return link | {"map": [list(pair) for pair in way.table]}
        return link | {"factor": way.factor, "offset": way.offset}

    def _start(self, path: Path, found: Mapping[Port, Any]) -> dict[str, Any]:
        """Start values of a component: whole arrays where all entries have one."""
        fmu, own = self.fmus[path], {name: value for (at, name), value in found.items() if at == path}
        start: dict[str, Any] = {}
        for block in dict.fromkeys(fmu.places[name][0] for name in own if name in fmu.places):
            scalars = fmu.described.scalars(block)
            if all(scalar in own for scalar in scalars):
                values = np.reshape([own.pop(scalar) for scalar in scalars], fmu.described.blocks[block])
                start[block] = values.tolist()
        for name, value in own.items():
            variable = fmu.variable(name)
            if variable.type == "String" or isinstance(value, str):
                start[name] = str(value)
            else:
                start[self._block(path, name)] = value
        return start


def _names(paths: list[Path], taken: tuple[str, ...]) -> dict[Path, str]:
    """A name of its own for each component: its path with / where results have a dot behind the name."""
    names: dict[Path, str] = {}
    for path in paths:
        name = re.sub(r'[."]', "_", "/".join(path))
        name = f"_{name}" if misnamed(name) else name
        while name in taken or name in names.values():
            name += "_"
        names[path] = name
    return names


def _some(names: list[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"{', '.join(names[:SHOWN])}{more}"
