"""Units of variables as FMUs declare them, and how a value in one becomes a value in another."""

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

BASE = ("kg", "m", "s", "A", "K", "mol", "cd")  # rad, the eighth of FMI, is 1 in SI and left to the models
NONE = ("", "1", "-")  # names of no unit
WORDS = {"Ohm": "ohm", "rev": "turn", "Nm": "N*m", "kNm": "kN*m"}  # what pint calls otherwise

# Units of cycles, and of angles: the same in base units, which have neither, and a factor of 2 pi apart.
CYCLES, ANGLE = re.compile(r"Hz\b|[Hh]ertz"), re.compile(r"rad|rpm|rev|turn|(deg|°)(?![CFKR])")


@dataclass(frozen=True)
class Unit:
    """A unit by base units of SI: a value in them is `factor` times the value in the unit plus `offset`."""

    exponents: tuple[float, ...]
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Measured:
    """The unit of a variable: its `name`, what that is (None if nobody says); `relative`: a difference, no offset."""

    name: str
    unit: Unit | None
    relative: bool = False


def units_of(root: ElementTree.Element) -> dict[str, Measured]:
    """The unit of every variable of a model description that has one, by its own definitions, else by the name."""
    defined = {u.get("name", ""): _defined(u) for u in root.iterfind("UnitDefinitions/Unit")}
    types: dict[str, Mapping[str, str]] = {}
    for simple in root.iterfind("TypeDefinitions/*"):
        types[simple.get("name", "")] = next((e.attrib for e in (simple, *simple) if "unit" in e.attrib), {})
    found = {}
    for variable in root.iterfind("ModelVariables/*"):
        own: dict[str, str] = {}
        for element in (variable, *variable):
            if element.tag in ("Real", "Float32", "Float64"):
                own = {**types.get(element.get("declaredType", ""), {}), **element.attrib}
        name = own.get("unit")
        if name is not None:
            unit = defined.get(name) or by_name(name)
            relative = own.get("relativeQuantity") in ("true", "1")
            found[variable.get("name", "")] = Measured(name, unit, relative)
    return found


def _defined(element: ElementTree.Element) -> Unit | None:
    base = element.find("BaseUnit")
    if base is None:
        return None
    number = {key: float(text) for key, text in base.attrib.items()}
    exponents = tuple(number.get(key, 0.0) for key in BASE)
    return Unit(exponents, number.get("factor", 1.0), number.get("offset", 0.0))


@functools.cache
def by_name(name: str) -> Unit | None:
    """What a name stands for, as Modelica (m/s2, N.m, degC) or others (m/s^2, °C) write it; None if unknown."""
    if name.strip() in NONE:
        return Unit((0.0,) * len(BASE))
    registry = _registry()
    if registry is None:
        return None
    try:
        text = re.sub(r"[A-Za-z]+", lambda word: WORDS.get(word[0], word[0]), name.strip())
        text = re.sub(r"([A-Za-z°µμΩ)])\^?([-+]?\d+)", r"\1**\2", text)
        text = re.sub(r"(?<=[\w)])\s*[.·⋅]\s*(?=[A-Za-z(])", "*", text).replace("%", "percent")
        unit = registry.parse_units(text)
        zero, one = (registry.Quantity(value, unit).to_base_units() for value in (0.0, 1.0))
        if zero.magnitude:  # a scale with a zero of its own
            one = registry.Quantity(1.0, f"delta_{unit}").to_base_units()
        else:
            zero = 0.0 * one
        powers = {_SI[str(key)]: float(power) for key, power in one.units._units.items() if str(key) != "radian"}
    except Exception:
        return None
    exponents = tuple(powers.get(key, 0.0) for key in BASE)
    return Unit(exponents, float(one.magnitude), float(zero.magnitude))


_SI = {"kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K", "mole": "mol", "candela": "cd"}


@functools.cache
def _registry() -> Any:
    """Units by name; it takes half a second, which only FMUs that do not define their units need."""
    try:
        import pint
    except ImportError:
        return None
    return pint.UnitRegistry()


def conversion(sent: Measured | None, wanted: Measured | None) -> tuple[float, float]:
    """Factor and offset from a value in one unit to that in another; 1 and 0 where a side declares none.

    ValueError with what to say of the two, without a full stop, where there is no such way.
    """
    if sent is None or wanted is None or (sent.name == wanted.name and sent.unit == wanted.unit):
        return 1.0, 0.0
    a, b = sent.unit, wanted.unit
    if a is None or b is None:
        if sent.name == wanted.name:
            return 1.0, 0.0
        unknown = " and ".join(dict.fromkeys(one.name for one in (sent, wanted) if one.unit is None))
        raise ValueError(f"and nothing says what {unknown} is in base units")
    if a.exponents != b.exponents:
        raise ValueError("which measure different things")
    if (CYCLES.search(sent.name) and ANGLE.search(wanted.name)) or (
        ANGLE.search(sent.name) and CYCLES.search(wanted.name)
    ):
        raise ValueError("of which one counts cycles and the other angles, both without a dimension")
    offset = (a.offset - b.offset) / b.factor
    if offset and sent.relative != wanted.relative:
        raise ValueError("of which one is a difference (relativeQuantity) and the other has a zero of its own")
    return a.factor / b.factor, 0.0 if sent.relative else offset
