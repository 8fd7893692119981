"""An FMI 2.0 model description: where it comes from; and units, scalars, bounds, start values, structure."""

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from itertools import product
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from interface import Variable

# Exponents of the SI base units of the symbols that a unit may be made of (FMI 2.0.4, section 2.2.2).
BASE_UNITS: dict[str, dict[str, int]] = {
    "1": {},
    "m": {"m": 1},
    "kg": {"kg": 1},
    "s": {"s": 1},
    "K": {"K": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Hz": {"s": -1},
}
DISPLAY_UNITS = {"rad": ("deg", math.degrees(1.0))}  # what a person reads, and how many of it a unit is

PROJECT = "kitecosim"
ORIGIN = {
    "author": "kitecosim contributors",
    "copyright": "Copyright (c) 2026, kitecosim contributors",
    "license": "BSD-3-Clause; see documentation/licenses",
}


def describe_model(root: Element) -> None:
    """Say who made the model and with what, and nothing of when: the same content gives the same bytes."""
    root.attrib.pop("generationDateAndTime", None)
    root.attrib |= ORIGIN
    with contextlib.suppress(metadata.PackageNotFoundError):  # where the sources lie about, not installed
        root.set("version", metadata.version(PROJECT))
    tool = f"{PROJECT} {root.get('version', '')}".strip()
    root.set("generationTool", ", ".join(filter(None, (tool, root.get("generationTool")))))


def base_exponents(unit: str) -> dict[str, int]:
    """Exponents of the SI base units of e.g. "kg/m3", "N.m" or "m/s2"; a factor after a slash divides."""
    exponents: dict[str, int] = {}
    for sign, part in zip([1] + [-1] * unit.count("/"), unit.split("/"), strict=True):
        for factor in part.replace("*", ".").replace(" ", ".").split("."):
            symbol = factor.rstrip("0123456789") or factor
            if symbol not in BASE_UNITS:
                raise ValueError(f"Unit {unit!r} is not made of {', '.join(BASE_UNITS)}.")
            power = sign * int(factor[len(symbol) :] or 1)
            for base, exponent in BASE_UNITS[symbol].items():
                exponents[base] = exponents.get(base, 0) + power * exponent
    return {base: exponent for base, exponent in exponents.items() if exponent}


def scalar_names(variable: Variable) -> list[str]:
    """Names of the scalars of a block in row-major order: "gravity", "pressure[7]", "displacement[12,3]"."""
    if not variable.shape:
        return [variable.name]
    places = product(*(range(1, n + 1) for n in variable.shape))
    return [f"{variable.name}[{','.join(map(str, place))}]" for place in places]


def scalar_descriptions(variable: Variable) -> list[str]:
    """What each scalar of a block is: "tension of amain_right", "position of node 33, x" where the block has labels."""
    if not variable.labels:
        return [variable.description] * variable.size
    axes = [f", {axis}" for axis in "xyz"] if variable.shape[1:] == (3,) else [""]
    return [f"{variable.description} of {label}{axis}" for label in variable.labels for axis in axes]


def unit_definitions(variables: Sequence[Variable]) -> Element:
    """The units of variables with their SI base units, as FMI 2.0 and 3.0 have them."""
    units = Element("UnitDefinitions")
    for unit in sorted({variable.unit for variable in variables if variable.kind == "real"}):
        exponents = {base: str(exponent) for base, exponent in base_exponents(unit).items()}
        defined = SubElement(units, "Unit", name=unit)
        SubElement(defined, "BaseUnit", exponents)
        if unit in DISPLAY_UNITS:
            name, factor = DISPLAY_UNITS[unit]
            SubElement(defined, "DisplayUnit", name=name, factor=repr(factor))
    return units


def add_variables(
    root: Element, variables: Sequence[Variable], start: Mapping[str, list[float]], at_start: Sequence[str]
) -> None:
    """Fill units, variables and structure into a model description; `start` holds the values of each block in order.

    The value reference of a scalar is its place, blocks following each other.

    Outputs change in doStep only: at a communication point none depends on an input, so that no importer sees an
    algebraic loop between two FMUs. In initialization mode they follow what has a causality of `at_start`, in an FMU of
    a pair the parameters alone, so that there is no loop then either (FMI 2.0.4, section 2.2.8).
    """
    root.insert([child.tag for child in root].index("CoSimulation") + 1, unit_definitions(variables))
    listed, structure = root.find("ModelVariables"), root.find("ModelStructure")
    if listed is None or structure is None:
        raise ValueError("The model description lacks ModelVariables or ModelStructure.")
    known: list[int] = []
    unknown: list[int] = []
    count = 0
    for variable in variables:
        places = range(count + 1, count + 1 + variable.size)  # FMI counts from 1 here
        known.extend(places if variable.causality in at_start else [])
        unknown.extend(places if variable.causality == "output" else [])
        _add_scalars(listed, variable, count, start[variable.name])
        count += variable.size
    everything = {"parameter", "input"} <= set(at_start)  # then, by the standard, nothing need be listed
    initially = {} if everything else {"dependencies": " ".join(map(str, known))}
    for tag, dependencies in (("Outputs", {"dependencies": ""}), ("InitialUnknowns", initially)):
        parent = SubElement(structure, tag) if unknown else structure
        for index in unknown:
            SubElement(parent, "Unknown", {"index": str(index)} | dependencies)


def attributes_of(variable: Variable) -> tuple[dict[str, str], dict[str, str], Callable[[float], str]]:
    """What FMI says of a variable, unit and bounds, and how its values are written: 17 digits, to be read exactly."""
    variability = variable.variability
    if variable.causality == "parameter" and variability not in ("fixed", "tunable"):
        variability = "tunable"
    elif variable.kind != "real" and variability == "continuous":
        variability = "discrete"
    attributes: dict[str, str] = {"causality": variable.causality, "variability": variability}
    if variable.causality != "input":
        attributes["initial"] = "exact" if variable.causality == "parameter" else "calculated"
    text: Callable[[float], str] = {"real": repr, "integer": lambda x: str(round(x))}.get(
        variable.kind, lambda x: str(bool(x)).lower()
    )
    limits = {"unit": variable.unit} if variable.kind == "real" else {}
    if variable.kind == "real" and variable.unit in DISPLAY_UNITS:
        limits["displayUnit"] = DISPLAY_UNITS[variable.unit][0]
    if variable.kind != "boolean":
        bounds = {"min": variable.minimum, "max": variable.maximum}
        limits |= {name: text(float(bound)) for name, bound in bounds.items() if bound is not None}
    return attributes, limits, text


def _add_scalars(variables: Element, variable: Variable, first: int, start: list[float]) -> None:
    """Append the scalars of a block."""
    attributes, limits, text = attributes_of(variable)
    names, texts = scalar_names(variable), scalar_descriptions(variable)
    for offset, (name, description, value) in enumerate(zip(names, texts, start, strict=True)):
        identity = {"name": name, "valueReference": str(first + offset)}
        identity |= {"description": description} if description else {}
        scalar = SubElement(variables, "ScalarVariable", identity | attributes)
        given = {"start": text(value)} if variable.causality != "output" else {}
        SubElement(scalar, variable.kind.capitalize(), limits | given)


def xml_file(root: Element) -> bytes:
    """The content of an XML file."""
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text
