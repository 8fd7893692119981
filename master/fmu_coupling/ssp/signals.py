"""Nested systems made flat: from which output each input of a component comes, and what happens to it on the way."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from master.fmu_coupling.entries import nearest, one_valued
from master.fmu_coupling.ssp.fmus import ComponentFmu, number
from master.fmu_coupling.ssp.package import Files
from master.fmu_coupling.ssp.structure import Link, Node, Structure, Transformation, measured
from master.fmu_coupling.units import Measured, conversion

Path = tuple[str, ...]  # names of the systems and the component from the top, the system there not counted
Port = tuple[Path, str]
SENT = ("output", "calculatedParameter")
TABLES = {"Boolean": "BooleanMappingTransformation", "Integer": "IntegerMappingTransformation"}


@dataclass(frozen=True)
class Way:
    """What arrives is `factor` * value + `offset`, or what `table` has for the value."""

    factor: float = 1.0
    offset: float = 0.0
    table: tuple[tuple[float, float], ...] = ()

    def scaled(self, factor: float, offset: float) -> "Way":
        """The way with factor * value + offset after it."""
        if (factor, offset) == (1.0, 0.0):
            return self
        if self.table:
            return Way(table=tuple((a, factor * b + offset) for a, b in self.table))
        return Way(factor * self.factor, factor * self.offset + offset)

    def looked_up(self, table: Mapping[float, float]) -> "Way":
        """The way with a table after it."""
        begun = self.table or tuple(((a - self.offset) / self.factor, a) for a in table)
        return Way(table=tuple((a, table[b]) for a, b in begun if b in table))

    def arriving(self, value: float) -> float:
        """What arrives of a value; KeyError where the table does not have it."""
        return dict(self.table)[value] if self.table else self.factor * value + self.offset


@dataclass(frozen=True)
class Signal:
    """An output that arrives at an input: (component, variable) of both, and the way between."""

    source: Port
    target: Port
    way: Way


def nodes(node: Node, path: Path = ()) -> Iterator[tuple[Path, Node]]:
    """All systems and components below and with one, in the order of the file."""
    yield path, node
    for child in node.elements.values():
        yield from nodes(child, (*path, child.name))


class Signals:
    """The connections of all systems, each end known as what sends or what takes."""

    def __init__(self, files: Files, structure: Structure, fmus: Mapping[Path, ComponentFmu]) -> None:
        self.files, self.structure, self.fmus = files, structure, fmus
        self.nodes = dict(nodes(structure.system))
        self.into: dict[Port, tuple[Port, Link]] = {}
        self.onward: dict[Port, list[tuple[Port, Link]]] = {}
        for path, node in self.nodes.items():
            for link in node.links:
                self._add(path, node, link)

    def _add(self, path: Path, system: Node, link: Link) -> None:
        ends = [self._end(path, system, end) for end in (link.start, link.end)]
        named = " and ".join(self.name(port) for port, _ in ends)
        if ends[0][1] == ends[1][1]:
            what = "both send" if ends[0][1] else "both take a value"
            raise self.files.refused(f"a connection of system '{system.name}' joins {named}, which {what}; join an "
                                     "output and an input.")  # fmt: skip
        (source, _), (target, _) = sorted(ends, key=lambda end: not end[1])
        if target in self.into:
            raise self.files.refused(f"{self.name(target)} has two sources, {self.name(self.into[target][0])} and "
                                     f"{self.name(source)}; take one of the two away.")  # fmt: skip
        self.into[target] = source, link
        self.onward.setdefault(source, []).append((target, link))

    def _end(self, path: Path, system: Node, end: tuple[str | None, str]) -> tuple[Port, bool]:
        """An end of a connection in a system, and whether it sends there."""
        element, name = end
        if element is not None and element not in system.elements:
            raise self.files.refused(
                f"a connection of system '{system.name}' names no element '{element}'; "
                f"{nearest(element, system.elements, 'there are')}"
            )
        port = (path if element is None else (*path, element)), name
        sends = self.kind(port) in SENT
        return port, sends if element is not None else not sends

    def name(self, port: Port) -> str:
        """What messages call a connector."""
        return ".".join((*port[0], port[1]))

    def kind(self, port: Port) -> str:
        """The kind of a connector; what its FMU says where it is one of a component."""
        path, name = port
        node = self.nodes[path]
        given = node.connectors.get(name)
        if node.is_system:
            if given is None:
                raise self.files.refused(
                    f"system '{node.name}' has no connector '{name}'; {nearest(name, node.connectors, 'it has')}"
                )
            return given.kind
        variable = self.fmus[path].variable(name)
        if variable is None:
            raise self.files.refused(f"component '{node.name}': {self.fmus[path].unknown(name)}")
        if given is not None and given.kind != variable.causality:
            raise self.files.refused(
                f"connector {self.name(port)} is of the kind {given.kind}, but its FMU says {variable.causality}; "
                "correct it."
            )
        if given is not None and given.type is not None and given.type != variable.type:
            raise self.files.refused(
                f"connector {self.name(port)} is of the type {given.type}, but its FMU says {variable.type}; "
                "correct it."
            )
        return str(variable.causality)

    def unit(self, port: Port) -> Measured | None:
        """The unit of a connector: its own, or that of its FMU."""
        path, name = port
        given = self.nodes[path].connectors.get(name)
        its = self.fmus[path].unit(name) if path in self.fmus else None
        if given is None or given.unit is None:
            return its
        own = measured(given.unit, self.structure.units)
        if its is None or own.unit is None:
            return its or own
        try:
            same = its.unit is None or conversion(own, its) == (1.0, 0.0)
        except ValueError:
            same = False
        if not same:
            raise self.files.refused(f"connector {self.name(port)} has the unit '{own.name}', but its FMU "
                                     f"'{its.name}', which is another; correct one.")  # fmt: skip
        return replace(own, relative=its.relative)

    def all(self) -> Iterator[Signal]:
        """Every input of a component with the output that it comes from."""
        for target in self.into:
            if target[0] not in self.fmus or self.kind(target) != "input":
                continue
            if signal := self._traced(target):
                yield signal

    def shown(self) -> list[Port]:
        """The outputs that the system at the top shows."""
        return [
            signal.source
            for name, connector in self.structure.system.connectors.items()
            if connector.kind == "output" and (signal := self._traced(((), name)))
        ]

    def _traced(self, target: Port) -> Signal | None:
        """The signal that arrives at a port; None where it comes from outside."""
        hops: list[tuple[Port, Link]] = []
        port = target
        while port in self.into:
            source, link = self.into[port]
            hops.append((port, link))
            port = source
            if len(hops) > len(self.into):
                raise self.files.refused(
                    f"{self.name(target)} comes from itself; take a connection of the systems away."
                )
        if port[0] not in self.fmus:
            return None
        if self.kind(port) != "output":
            raise self.files.refused(f"{self.name(port)} is a calculated parameter, and only outputs are passed on; "
                                     f"take the connection to {self.name(target)} away.")  # fmt: skip
        way, unit = Way(), self.unit(port)
        for at, link in reversed(hops):
            way, unit = self.passed(way, unit, at, link.suppressed, link.transformation, (port, target))
        return Signal(port, target, way)

    def passed(
        self,
        way: Way,
        unit: Measured | None,
        at: Port,
        suppressed: bool,
        transformation: Transformation | None,
        ends: tuple[Port | None, Port],
    ) -> tuple[Way, Measured | None]:
        """A way and the unit behind a connector: units are converted first, then it is transformed."""
        wanted = self.unit(at)
        if not suppressed:
            try:
                way = way.scaled(*conversion(unit, wanted))
            except ValueError as error:
                names = " and taken in ".join(one.name for one in (unit, wanted) if one is not None)
                raise self.files.refused(
                    f"what arrives at {self.name(at)} is in {names}, {error}; define the units, or give a "
                    "transformation with suppressUnitConversion."
                ) from None
        if transformation is not None:
            way = self._transformed(way, at, transformation, ends)
        return way, wanted or unit

    def _transformed(self, way: Way, at: Port, how: Transformation, ends: tuple[Port | None, Port]) -> Way:
        """A way with a transformation after it."""
        if how.kind == "LinearTransformation":
            if how.factor == 0.0:
                raise self.files.refused(
                    f"the factor of what arrives at {self.name(at)} is zero; nothing would arrive."
                )
            return way.scaled(how.factor, how.offset)
        kind = how.kind.removesuffix("MappingTransformation")
        items = [self.fmus[end[0]].items(end[1]) if end is not None and end[0] in self.fmus else {} for end in ends]
        try:
            pairs = [
                (float(number(a, kind, items[0] or items[1])), float(number(b, kind, items[1]))) for a, b in how.entries
            ]
            through = way.looked_up(one_valued(pairs))
            if not through.table:
                raise ValueError("nothing that is sent is in it")
        except ValueError as error:
            raise self.files.refused(
                f"the mapping of what arrives at {self.name(at)} does not suit: {error}."
            ) from None
        return through
