"""The FMU of a component as a structure asks for it: kinds, types, units and items of its variables by name."""

import math
from typing import Any

from master.fmu_coupling.entries import nearest
from master.fmu_coupling.mapping import Described
from master.fmu_coupling.units import Measured


class ComponentFmu:
    """What an FMU says of itself: `described`, and about the variable or the whole array with a name."""

    def __init__(self, described: Described) -> None:
        self.described = described
        # where each scalar stands in an array: scalar -> (array, number)
        self.places = {
            scalar: (block, k)
            for block, shape in described.blocks.items()
            if shape
            for k, scalar in enumerate(described.scalars(block))
        }

    def variable(self, name: str) -> Any:
        """The variable, or the first entry of an array; None where there is none."""
        if name in self.described.variables:
            return self.described.variables[name]
        return self.described.variables[self.described.scalars(name)[0]] if name in self.described.blocks else None

    def unknown(self, name: str) -> str:
        """The sentence about a name that there is not."""
        return f"{self.described.name} has no variable '{name}'; {nearest(name, self.described.variables)}"

    def unit(self, name: str) -> Measured | None:
        """The unit of a variable."""
        units = self.described.measured(name) if self.described.knows(name) else []
        return units[0] if units else None

    def items(self, name: str) -> dict[str, int]:
        """The items of an enumeration."""
        declared = getattr(self.variable(name), "declaredType", None)
        return {item.name: int(item.value) for item in getattr(declared, "items", None) or ()}


def number(text: str, kind: str, items: dict[str, int]) -> float | int | bool:
    """The value of a text of a type of SSP; ValueError in a few words where it is none."""
    text = text.strip()
    if kind == "Boolean":
        if text not in ("true", "false", "1", "0"):
            raise ValueError(f"'{text}' is neither true nor false")
        return text in ("true", "1")
    if kind == "Enumeration":
        if text not in items:
            raise ValueError(f"'{text}' is no item of its enumeration; {nearest(text, items)}".rstrip("."))
        return items[text]
    try:
        value = int(text) if kind == "Integer" else float(text)
    except ValueError:
        raise ValueError(f"'{text}' is no {'whole ' if kind == 'Integer' else ''}number") from None
    if not math.isfinite(value):
        raise ValueError(f"'{text}' is no finite number")
    return value
