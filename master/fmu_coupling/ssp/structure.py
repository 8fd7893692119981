"""What SystemStructure.ssd says: a tree of systems and components, their connectors, connections and parameters."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from master.fmu_coupling.ssp.package import STRUCTURE, Files, local
from master.fmu_coupling.units import BASE, Measured, Unit, by_name

FMU = "application/x-fmu-sharedlibrary"
SET, MAPPING = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"
PICTURES = ("ElementGeometry", "ConnectorGeometry", "ConnectionGeometry", "SystemGeometry", "GraphicalElements")
IGNORED = (*PICTURES, "Annotations")
KINDS = ("input", "output", "parameter", "calculatedParameter")


@dataclass(frozen=True)
class Connector:
    """A connector: its kind, and its type and unit where they are given."""

    name: str
    kind: str
    type: str | None = None
    unit: str | None = None


@dataclass(frozen=True)
class Transformation:
    """target = factor * source + offset, or a table of (source, target) as texts; `kind` names the element."""

    kind: str
    factor: float = 1.0
    offset: float = 0.0
    entries: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Link:
    """A connection in a system: (element, or None for the system itself; connector) at both ends."""

    start: tuple[str | None, str]
    end: tuple[str | None, str]
    transformation: Transformation | None
    suppressed: bool  # conversion of units


@dataclass(frozen=True)
class Parameter:
    """A value for what is called `name`, as a text of a `type`, and how it is mapped."""

    name: str
    type: str
    value: str
    unit: Measured | None = None
    transformation: Transformation | None = None
    suppressed: bool = False


@dataclass
class Node:
    """A component (an FMU in `source`) or a system of `elements` with `links`; later `parameters` have priority."""

    name: str
    connectors: dict[str, Connector]
    parameters: list[Parameter]
    source: str = ""
    elements: dict[str, "Node"] = field(default_factory=dict)
    links: list[Link] = field(default_factory=list)

    @property
    def is_system(self) -> bool:
        """Whether it is a system."""
        return not self.source


@dataclass(frozen=True)
class Structure:
    """The content of a package; times in s, None where there are none."""

    system: Node
    units: Mapping[str, Unit]
    times: Mapping[str, float]  # start, stop, step


def read_structure(files: Files) -> Structure:
    """What the default structure of a package says; ValueError in one sentence for what is not supported."""
    root = files.xml(STRUCTURE, "SystemStructureDescription")
    parts = _Parts(files)
    for bus in (e for e in root.iter() if isinstance(e.tag, str) and e.tag.rpartition("}")[2] in ("Bus", "TLMBus")):
        raise files.refused(f"has the bus '{bus.get('name', '')}', and buses are not supported; connect its signals.")
    whole = parts.only(root, STRUCTURE, "System", "Enumerations", "Units", "DefaultExperiment")
    systems = whole["System"]
    if len(systems) != 1:
        raise files.refused(f"{STRUCTURE} has {len(systems)} systems at its top; there must be one.")
    times: dict[str, float] = {}
    for experiment in whole["DefaultExperiment"]:
        for key, name in (("start", "startTime"), ("stop", "stopTime")):
            if experiment.get(name) is not None:
                times[key] = parts.number(experiment, name, "DefaultExperiment")
    for tag, name in (("FixedStepMaster", "stepSize"), ("FixedStepAlgorithm", "baseStepSize")):
        for master in (e for e in root.iter() if isinstance(e.tag, str) and e.tag.rpartition("}")[2] == tag):
            if master.get(name) is not None:
                times.setdefault("step", parts.number(master, name, tag))
    return Structure(parts.system(systems[0]), parts.units(whole["Units"]), times)


class _Parts:
    """The parts of a structure; every refusal names them."""

    def __init__(self, files: Files) -> None:
        self.files = files

    def only(self, parent: Element, what: str, *known: str) -> dict[str, list[Element]]:
        """Children of an element by name; refused are those that are not known."""
        found: dict[str, list[Element]] = {name: [] for name in known}
        for child in parent:
            name = local(child)
            if name in found:
                found[name].append(child)
            elif name not in IGNORED:
                raise self.files.refused(f"{what} holds {name or child.tag!r}, which is not supported; take it out.")
        return found

    def given(self, element: Element, name: str, what: str) -> str:
        """An attribute that must be there."""
        value = element.get(name)
        if value is None:
            raise self.files.refused(f"{what} lacks the attribute {name}.")
        return value

    def number(self, element: Element, name: str, what: str, default: str | None = None) -> float:
        """An attribute that is a finite number."""
        text = element.get(name, default)
        try:
            value = float("nan" if text is None else text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.files.refused(f"{what} has {name} = {text!r}, which is no finite number.")
        return value

    def flag(self, element: Element, name: str, what: str) -> bool:
        """An attribute that is true or false, false where it is not there."""
        text = element.get(name, "false").strip()
        if text not in ("true", "false", "1", "0"):
            raise self.files.refused(f"{what} has {name} = {text!r}, which is neither true nor false.")
        return text in ("true", "1")

    def units(self, listed: list[Element]) -> dict[str, Unit]:
        """Units by name."""
        found = {}
        for unit in (u for each in listed for u in self.only(each, "Units", "Unit")["Unit"]):
            name = self.given(unit, "name", "a unit")
            for base in self.only(unit, f"unit '{name}'", "BaseUnit")["BaseUnit"]:
                exponents = tuple(self.number(base, key, f"unit '{name}'", "0") for key in BASE)
                scale = (
                    self.number(base, "factor", f"unit '{name}'", "1"),
                    self.number(base, "offset", f"unit '{name}'", "0"),
                )
                found[name] = Unit(exponents, *scale)
        return found

    def system(self, element: Element) -> Node:
        """A system with all that is in it."""
        name = self.given(element, "name", "a system")
        what = f"system '{name}'"
        parts = self.only(
            element, what, "Connectors", "ParameterBindings", "Elements", "Connections", "SignalDictionaries"
        )
        if parts["SignalDictionaries"]:
            raise self.files.refused(f"{what} has signal dictionaries, which are not supported; connect the signals.")
        node = self.node(name, what, parts)
        makers: dict[str, Callable[[Element], Node]] = {"System": self.system, "Component": self.component}
        for child in (c for each in parts["Elements"] for c in each):
            if local(child) == "SignalDictionaryReference":
                raise self.files.refused(
                    f"{what} refers to the signal dictionary '{child.get('dictionary', '')}', and signal dictionaries "
                    "are not supported; connect the signals."
                )
            if local(child) not in makers:
                raise self.files.refused(f"{what} has the element {child.tag!r}, which is not supported; take it out.")
            made = makers[local(child)](child)
            if made.name in node.elements:
                raise self.files.refused(f"{what} has two elements '{made.name}'; give one another name.")
            node.elements[made.name] = made
        links = [c for each in parts["Connections"] for c in self.only(each, what, "Connection")["Connection"]]
        node.links = [self.link(link, what) for link in links]
        return node

    def component(self, element: Element) -> Node:
        """A component, which must be an FMU for co-simulation."""
        name = self.given(element, "name", "a component")
        what = f"component '{name}'"
        kind = element.get("type", FMU)
        if kind != FMU:
            raise self.files.refused(
                f"{what} is of the type {kind}, which is not supported; put its FMUs in its place."
            )
        if element.get("implementation", "any") == "ModelExchange":
            raise self.files.refused(
                f"{what} asks for model exchange, which is not supported; export a co-simulation FMU."
            )
        node = self.node(name, what, self.only(element, what, "Connectors", "ParameterBindings"))
        node.source = self.files.found(self.given(element, "source", what), what)
        return node

    def node(self, name: str, what: str, parts: Mapping[str, list[Element]]) -> Node:
        """An element with its connectors and parameters."""
        connectors: dict[str, Connector] = {}
        for listed in parts["Connectors"]:
            for child in self.only(listed, what, "Connector")["Connector"]:
                made = self.connector(child, what)
                if made.name in connectors:
                    raise self.files.refused(f"{what} has two connectors '{made.name}'; give one another name.")
                connectors[made.name] = made
        bindings = [
            b
            for each in parts["ParameterBindings"]
            for b in self.only(each, what, "ParameterBinding")["ParameterBinding"]
        ]
        return Node(name, connectors, [p for binding in bindings for p in self.bound(binding, what)])

    def connector(self, element: Element, what: str) -> Connector:
        """A connector of an element."""
        name = self.given(element, "name", f"a connector of {what}")
        kind = self.given(element, "kind", f"connector '{name}' of {what}")
        if kind not in KINDS:
            raise self.files.refused(
                f"connector '{name}' of {what} is of the kind {kind}, which is not supported; take one of: "
                f"{', '.join(KINDS)}."
            )
        types = [child for child in element if local(child) and local(child) not in IGNORED]
        first = types[0] if types else None
        return Connector(
            name, kind, None if first is None else local(first), None if first is None else first.get("unit")
        )

    def link(self, element: Element, system: str) -> Link:
        """A connection of a system."""
        start, end = (
            (element.get(f"{end}Element"), self.given(element, f"{end}Connector", f"a connection of {system}"))
            for end in ("start", "end")
        )
        what = f"connection {_named(start)} - {_named(end)} of {system}"
        return Link(start, end, self.transformation(element, what), self.flag(element, "suppressUnitConversion", what))

    def transformation(self, parent: Element, what: str) -> Transformation | None:
        """The transformation of a connection or of an entry of a mapping."""
        for child in parent:
            kind = local(child)
            if kind == "LinearTransformation":
                factor, offset = self.number(child, "factor", what, "1"), self.number(child, "offset", what, "0")
                return Transformation(kind, factor, offset)
            if kind.endswith("MappingTransformation"):
                entries = self.only(child, what, "MapEntry")["MapEntry"]
                texts = [
                    (self.given(e, "source", what).strip(), self.given(e, "target", what).strip()) for e in entries
                ]
                return Transformation(kind, entries=tuple(texts))
            if kind not in IGNORED:
                raise self.files.refused(f"{what} holds {kind or child.tag!r}, which is not supported; take it out.")
        return None

    def bound(self, binding: Element, what: str) -> Iterator[Parameter]:
        """The parameters of a binding, mapped."""
        whose = f"a parameter binding of {what}"
        if binding.get("type", SET) != SET:
            raise self.files.refused(
                f"{whose} is of the type {binding.get('type')}, which is not supported; use {SET}."
            )
        parts = self.only(binding, whose, "ParameterValues", "ParameterMapping")
        values = self.referred(binding, parts["ParameterValues"], "ParameterSet", whose)
        prefix = binding.get("prefix", "")
        found = {p.name: p for p in (self.prefixed(p, prefix) for p in self.parameters(values, whose))}
        if not parts["ParameterMapping"]:
            yield from found.values()
            return
        mapping = parts["ParameterMapping"][0]
        if mapping.get("type", MAPPING) != MAPPING:
            raise self.files.refused(f"{whose} has a mapping of the type {mapping.get('type')}; use {MAPPING}.")
        for entry in self.only(self.referred(mapping, [mapping], "ParameterMapping", whose), whose, "MappingEntry")[
            "MappingEntry"
        ]:
            source, target = self.given(entry, "source", whose), self.given(entry, "target", whose)
            if source in found:
                p, how = found[source], self.transformation(entry, f"the mapping of parameter '{source}'")
                yield Parameter(target, p.type, p.value, p.unit, how, self.flag(entry, "suppressUnitConversion", whose))

    def referred(self, parent: Element, inline: list[Element], wanted: str, what: str) -> Element:
        """The root of a file that is referred to, or what stands in its place."""
        source = parent.get("source")
        if source is not None:
            if parent.get("sourceBase", "SSD") != "SSD":
                raise self.files.refused(
                    f"{what} has a source within its component, which is not supported; put it beside."
                )
            name = self.files.found(source, what)
            return self.files.xml(name, wanted)
        for child in (c for each in inline for c in each):
            self.files.require(child, wanted, what)
            return child
        raise self.files.refused(f"{what} has neither a source nor a {wanted}.")

    def prefixed(self, p: Parameter, prefix: str) -> Parameter:
        """A parameter under the name that a binding gives it."""
        return Parameter(prefix + p.name, p.type, p.value, p.unit)

    def parameters(self, root: Element, what: str) -> Iterator[Parameter]:
        """The parameters of a set."""
        parts = self.only(root, what, "Parameters", "Enumerations", "Units")
        units = self.units(parts["Units"])
        for child in (c for each in parts["Parameters"] for c in self.only(each, what, "Parameter")["Parameter"]):
            name = self.given(child, "name", f"a parameter of {what}")
            values = [c for c in child if local(c) and local(c) not in IGNORED]
            if len(values) != 1:
                raise self.files.refused(f"parameter '{name}' of {what} has {len(values)} values; it takes one.")
            unit = values[0].get("unit")
            value = self.given(values[0], "value", f"parameter '{name}' of {what}")
            yield Parameter(name, local(values[0]), value, None if unit is None else measured(unit, units))


def measured(name: str, units: Mapping[str, Unit]) -> Measured:
    """The unit with a name: as it is defined, else as the name is understood."""
    return Measured(name, units.get(name) or by_name(name))


def _named(end: tuple[str | None, str]) -> str:
    return ".".join(part for part in end if part)
