"""The FMUs of a scene, connected, in one file: System Structure and Parameterization (SSP) 1.0.

What is written is what the model descriptions of the FMUs say. Two limits of importers decide how:

* Parameters are bound at each component, in one set without prefixes. libcosim reads no other binding, and of several
  sets at a component the first alone.
* An input that nothing is connected to has no connector. fmpy would connect it to some output, and libcosim knows no
  connectors of the system that it could be led out to.
"""

import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from fmus.builder import written, zipped
from fmus.description import xml_file

SIDES = ("structural", "aero")  # names of the components
NAMESPACES = {
    "xmlns:ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "xmlns:ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "xmlns:ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "xmlns:osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "xmlns:oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}
TOLERANCE = "0.0001"  # OMSimulator's own for a master of fixed step, which has no use for it


@dataclass(frozen=True)
class _Scalar:
    """A scalar variable of an FMU, as its model description has it."""

    name: str
    causality: str
    kind: str  # Real, Integer or Boolean
    unit: str | None
    start: str | None


@dataclass(frozen=True)
class _Fmu:
    """An FMU file and what its model description says."""

    content: bytes
    scalars: tuple[_Scalar, ...]
    units: Mapping[str, Mapping[str, str]]  # unit -> exponents of SI base units
    experiment: Mapping[str, str]
    tool: str

    def names(self, causality: str) -> list[str]:
        return [scalar.name for scalar in self.scalars if scalar.causality == causality]


def package(name: str, paths: Sequence[Path], out_dir: str | Path) -> Path:
    """Path of `NAME.ssp`, written to `out_dir` (which exists) from the structural and the aerodynamic FMU in `paths`,
    or the one that there is, as `fmus.builder.build` returns them. The same FMUs give the same bytes.

    The FMUs go in as they are. Every input of one that is an output of the other by name is connected to it.
    """
    fmus = {side: _read(path) for side in SIDES for path in paths if path.stem.endswith(f"_{side}")}
    connections = []
    for start, end in permutations(fmus, 2):
        inputs = set(fmus[end].names("input"))
        connections += [(start, end, name) for name in fmus[start].names("output") if name in inputs]
    files = {"SystemStructure.ssd": xml_file(_structure(name, fmus, connections))}
    for side, fmu in fmus.items():
        files[f"resources/{side}.fmu"] = fmu.content
        files[f"resources/{side}.ssv"] = xml_file(_parameters(side, fmu))
    return written(Path(out_dir) / f"{name}.ssp", zipped(files))


def _read(path: Path) -> _Fmu:
    content = path.read_bytes()
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    scalars = []
    for variable in root.iterfind("ModelVariables/ScalarVariable"):
        kind = variable[0]
        identity = variable.attrib["name"], variable.attrib["causality"]
        scalars.append(_Scalar(*identity, kind.tag, kind.get("unit"), kind.get("start")))
    units = {unit.attrib["name"]: unit[0].attrib for unit in root.iterfind("UnitDefinitions/Unit")}
    experiment = next(root.iterfind("DefaultExperiment")).attrib
    return _Fmu(content, tuple(scalars), units, experiment, root.attrib["generationTool"])


def _structure(name: str, fmus: Mapping[str, _Fmu], connections: Sequence[tuple[str, str, str]]) -> Element:
    """The content of SystemStructure.ssd; `connections` are (from component, to component, scalar)."""
    first = next(iter(fmus.values()))
    about = {"version": "1.0", "name": name, "generationTool": first.tool}
    root = Element("ssd:SystemStructureDescription", NAMESPACES | about)
    system = SubElement(root, "ssd:System", name=name)
    connected = {(end, shared) for _, end, shared in connections}
    elements = SubElement(system, "ssd:Elements")
    for side, fmu in fmus.items():
        source = {"source": f"resources/{side}.fmu", "implementation": "CoSimulation"}
        component = SubElement(elements, "ssd:Component", {"name": side} | source)
        component.set("type", "application/x-fmu-sharedlibrary")
        connectors = SubElement(component, "ssd:Connectors")
        for scalar in fmu.scalars:
            if scalar.causality != "input" or (side, scalar.name) in connected:
                connector = SubElement(connectors, "ssd:Connector", name=scalar.name, kind=scalar.causality)
                SubElement(connector, f"ssc:{scalar.kind}", {"unit": scalar.unit} if scalar.unit else {})
        bindings = SubElement(component, "ssd:ParameterBindings")
        SubElement(bindings, "ssd:ParameterBinding", source=f"resources/{side}.ssv")
    if connected:
        listed = SubElement(system, "ssd:Connections")
        for start, end, shared in connections:
            ends = {"startElement": start, "startConnector": shared, "endElement": end, "endConnector": shared}
            SubElement(listed, "ssd:Connection", ends)
    step = first.experiment["stepSize"]
    master = {"description": "oms-ma", "stepSize": step, "absoluteTolerance": TOLERANCE, "relativeTolerance": TOLERANCE}
    information = SubElement(_annotation(system, "org.openmodelica"), "oms:Annotations")
    SubElement(SubElement(information, "oms:SimulationInformation"), "oms:FixedStepMaster", master)
    _units(root, "ssd:Units", {unit: base for fmu in fmus.values() for unit, base in fmu.units.items()})
    times = {time: first.experiment[time] for time in ("startTime", "stopTime")}
    experiment = SubElement(root, "ssd:DefaultExperiment", times)
    algorithm = SubElement(_annotation(experiment, "com.opensimulationplatform"), "osp:Algorithm")
    SubElement(algorithm, "osp:FixedStepAlgorithm", baseStepSize=step)
    return root


def _parameters(side: str, fmu: _Fmu) -> Element:
    """The content of the parameter set of a component: start values and units of its parameters."""
    spaces = {key: NAMESPACES[key] for key in ("xmlns:ssc", "xmlns:ssv")}
    root = Element("ssv:ParameterSet", spaces | {"version": "1.0", "name": side, "generationTool": fmu.tool})
    listed = SubElement(root, "ssv:Parameters")
    used: set[str] = set()
    for scalar in fmu.scalars:
        if scalar.causality == "parameter" and scalar.start is not None:
            parameter = SubElement(listed, "ssv:Parameter", name=scalar.name)
            unit = {"unit": scalar.unit} if scalar.unit else {}
            SubElement(parameter, f"ssv:{scalar.kind}", {"value": scalar.start} | unit)
            used.update(unit.values())
    _units(root, "ssv:Units", {unit: base for unit, base in fmu.units.items() if unit in used})
    return root


def _annotation(parent: Element, owner: str) -> Element:
    """An empty annotation of a tool, named as SSP has it: by the domain of its maker."""
    return SubElement(SubElement(parent, "ssd:Annotations"), "ssc:Annotation", type=owner)


def _units(root: Element, tag: str, units: Mapping[str, Mapping[str, str]]) -> None:
    if units:
        listed = SubElement(root, tag)
        for name in sorted(units):
            SubElement(SubElement(listed, "ssc:Unit", name=name), "ssc:BaseUnit", dict(units[name]))
