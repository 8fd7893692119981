"""Units as SSP and FMI define them, and the conversion between two of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Unit:
    """A unit: value in base units = `factor` * value + `offset`; `exponents` None where it has no definition."""

    name: str
    exponents: tuple[float, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0
    KEYS: ClassVar = (*BASES, "factor", "offset")  # attributes of a definition

    @classmethod
    def of(cls, name: str, numbers: Mapping[str, float]) -> "Unit":
        """The unit with exponents, factor and offset as its definition lists them."""
        exponents = tuple(float(numbers.get(base, 0.0)) for base in BASES)
        return cls(name, exponents, float(numbers.get("factor", 1.0)), float(numbers.get("offset", 0.0)))


def conversion(given: Unit | None, wanted: Unit | None, relative: bool = False) -> tuple[float, float]:
    """(factor, offset) of a value in `wanted`, from one in `given`; without the offset for a `relative` quantity.

    (1, 0) where one of the two has no unit, or both have the same name and not both a definition. ValueError in one
    sentence where they cannot be converted.
    """
    if given is None or wanted is None:
        return 1.0, 0.0
    if given.exponents is None or wanted.exponents is None:
        if given.name == wanted.name:
            return 1.0, 0.0
        unknown = given if given.exponents is None else wanted
        raise ValueError(
            f"'{given.name}' cannot be converted to '{wanted.name}', as '{unknown.name}' has no definition"
        )
    if given.exponents != wanted.exponents:
        raise ValueError(f"'{given.name}' is no unit of what '{wanted.name}' measures")
    offset = 0.0 if relative else (given.offset - wanted.offset) / wanted.factor
    return given.factor / wanted.factor, offset
