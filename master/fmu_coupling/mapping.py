"""Variables of any FMU under names and in units of our own, and the check of both against its model description."""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import platform, platform_tuple, read_model_description

from master.coupling.participants import FmuParticipant
from master.coupling.participants.blocks import NO_NUMBERS, Blocks, Limits, described_limits, grid, grouped
from master.coupling.participants.fmi3 import scalars_of
from master.coupling.participants.fmu import require_size
from master.fmu_coupling.archive import model_description, require_library
from master.fmu_coupling.entries import nearest
from master.fmu_coupling.units import Measured, units_of


@dataclass(frozen=True)
class Naming:
    """A block of our own: a variable, a pattern in which # stands for a number, or a list of variables.

    `shape` None: that of the variable, of the numbers in the pattern, or of the list. The value of the block is
    `factor` times the value in the FMU; None: it is that value, in the unit that the FMU declares.
    """

    variables: str | tuple[str, ...]
    factor: float | None = None
    shape: tuple[int, ...] | None = None


@dataclass(frozen=True)
class Named:
    """A naming that an FMU can follow: its variables in row-major order, their shape, their factor; `own` if that is of
    the file, which then knows the unit better than the FMU.
    """

    variables: tuple[str, ...]
    shape: tuple[int, ...]
    factor: float = 1.0
    own: bool = False


class Described(Blocks):
    """What an FMU says of itself, without an instance: its blocks, ours included, before anything is run.

    ValueError in one sentence for what is no co-simulation FMU of FMI 2.0 or 3.0, and for a naming that does not fit.
    """

    def __init__(self, path: str | Path, names: Mapping[str, Naming] | None = None) -> None:
        self.name = Path(path).name
        if not Path(path).is_file():
            raise ValueError(f"there is no FMU {path}.")
        try:
            require_size(path)
            root = model_description(path)
            version = root.get("fmiVersion")
            read = version == "2.0" or str(version).startswith("3.")
            description = read_model_description(str(path), validate=False) if read else None
            scalars = [] if description is None else scalars_of(description, path)
        except Exception as error:
            if isinstance(error, ValueError) and str(error).startswith(str(path)):
                raise
            raise ValueError(f"{path} is not a readable FMU: {' '.join(str(error).split()).rstrip('.')}.") from error
        if description is None or description.coSimulation is None:
            what = "not for co-simulation" if description is not None else f"of FMI {version}"
            raise ValueError(f"{path} is {what}; export it as a co-simulation FMU of FMI 2.0 or 3.0.")
        here = platform if version == "2.0" else platform_tuple
        require_library(path, description.coSimulation.modelIdentifier, here)
        self.units, self.known = units_of(root), (description, scalars)
        self.saves_state = bool(description.coSimulation.canGetAndSetFMUstate)
        self.only_once = bool(description.coSimulation.canBeInstantiatedOnlyOncePerProcess)
        self.model, self.tool = description.modelName, description.generationTool
        self._variables = {variable.name: variable for variable in scalars}
        blocks = grouped(scalars)
        self._arrays = {name: tuple(v.name for v in listed) for name, (listed, _) in blocks.items()}
        self._shapes = {name: shape for name, (_, shape) in blocks.items()}
        # FMI 3.0 declares an array, of which its entries have their unit
        self._declared = {v.name: v.array.name for v in scalars if hasattr(v, "array")}
        self.elements: dict[str, Named] = {}  # of arrays, which are blocks by themselves too
        self.named = {name: self._found(name, naming) for name, naming in (names or {}).items()}
        blocks |= {n: ([self._variables[v] for v in block.variables], block.shape) for n, block in self.named.items()}
        self.blocks = {name: shape for name, (_, shape) in blocks.items()}
        self.limits = {name: described_limits(*block) for name, block in blocks.items()}

    @property
    def variables(self) -> Mapping[str, Any]:
        """The scalar variables of the FMU by name, as fmpy describes them."""
        return self._variables

    def scalars(self, block: str) -> tuple[str, ...]:
        """The variables of the FMU that make a block."""
        return self.named[block].variables if block in self.named else self._arrays[block]

    def unknown(self, block: str) -> str:
        """The sentence about a name that there is not."""
        what = NO_NUMBERS.get(self._variables[block].type) if block in self._variables else None
        if what is not None:
            return f"{self.name} has '{block}' as {what}, and only numbers can be exchanged; leave it out."
        return f"{self.name} has no variable or block '{block}'; {nearest(block, self._names())}"

    def knows(self, name: str) -> bool:
        """Whether there is a block of a name; an element of an array becomes one when it is asked for by its name."""
        if name in self.blocks:
            return True
        variable = self._variables.get(name)
        if variable is None or variable.type in NO_NUMBERS:
            return False
        self.named[name] = self.elements[name] = Named((name,), ())
        self.blocks[name], self.limits[name] = (), described_limits([variable], ())
        return True

    def measured(self, block: str) -> list[Measured | None]:
        """The unit of each variable of a block, None where the FMU declares none; one for all if they are alike. Empty
        where the file has a unit of its own for the block.
        """
        if block in self.named and self.named[block].own:
            return []
        units = [self.units.get(self._declared.get(variable, variable)) for variable in self.scalars(block)]
        return units[:1] if all(unit == units[0] for unit in units) else units

    def raw(self, block: str, values: Any) -> np.ndarray:
        """Start values of a block in the unit of the FMU; ValueError in one sentence if it does not take them.

        Truth values may be 1 and 0 too, items of an enumeration are numbers or names.
        """
        if not self.knows(block):
            raise ValueError(self.unknown(block))
        limits, flat = self.limits[block], list(_flat(values))
        if limits.kind != "boolean" and any(isinstance(value, bool | np.bool_) for value in flat):
            takes = limits.takes() if limits.kind != "real" else "numbers"
            raise ValueError(f"{self.name}: block {block!r} takes {takes}, not true or false.")
        if limits.items and any(isinstance(value, str) for value in flat):
            for value in flat:
                if isinstance(value, str) and value not in limits.items:
                    raise ValueError(f"{self.name}: block {block!r} takes {limits.takes()}, not '{value}'.")
            values = _replaced(values, limits.items)
        try:
            array = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            raise ValueError(f"{self.name}: block {block!r} takes numbers of shape {self.blocks[block]}.") from None
        if (
            limits.kind in ("integer", "enumeration")
            and not self._declared
            and np.any((array < -(2.0**31)) | (array >= 2.0**31))
        ):
            raise ValueError(f"{self.name}: block {block!r} takes whole numbers of 32 bits.")
        factor = self.named[block].factor if block in self.named else 1.0
        return self.checked(block, array / factor, start=True)

    def items(self, name: str) -> Mapping[str, int]:
        """The items of a variable or block that is of an enumeration, name -> value."""
        return self.limits[name].items if self.knows(name) else {}

    def require_text(self, name: str) -> None:
        """ValueError in one sentence if a variable takes no text as its start value."""
        variable = self._variables.get(name)
        if variable is None or variable.type != "String":
            known = [v.name for v in self._variables.values() if v.type == "String"]
            what = (
                "takes numbers"
                if name in self.blocks
                else "is not there"
                if variable is None
                else (f"is {NO_NUMBERS[variable.type]}")
            )
            raise ValueError(f"{self.name}: '{name}' {what}; texts go to: {', '.join(known) or 'none'}.")
        if variable.causality not in ("input", "parameter"):
            raise ValueError(f"{self.name}: '{name}' cannot be set, its causality is {variable.causality}.")

    def _names(self) -> list[str]:
        """All names that can be used, each once."""
        return list(dict.fromkeys([*getattr(self, "named", ()), *self._shapes, *self._variables]))

    def _found(self, name: str, naming: Naming) -> Named:
        listed, shape = self._listed(name, naming.variables)
        if name in self._variables and name not in listed:
            raise ValueError(f"block '{name}' has the name of another variable of {self.name}; choose another name.")
        if naming.shape is not None:
            if int(np.prod(naming.shape)) != len(listed):
                raise ValueError(
                    f"block '{name}' has {len(listed)} variables, which do not fill the shape {list(naming.shape)}."
                )
            shape = naming.shape
        twice = [v for k, v in enumerate(listed) if v in listed[:k]] if len(set(listed)) < len(listed) else []
        if twice:
            raise ValueError(f"block '{name}' lists the variable '{twice[0]}' twice; list it once.")
        first = self._variables[listed[0]]
        for other in (self._variables[v] for v in listed):
            for kind in ("type", "causality", "variability"):
                a, b = getattr(first, kind), getattr(other, kind)
                if a != b:
                    raise ValueError(
                        f"block '{name}' mixes variables of different {kind}: {first.name} is {a}, {other.name} "
                        f"is {b}; make two blocks of them."
                    )
        if first.type in NO_NUMBERS:
            raise ValueError(self.unknown(first.name))
        if naming.factor not in (None, 1.0) and first.type != "Real":
            raise ValueError(f"block '{name}' has a factor, but '{first.name}' is no Real; leave the factor out.")
        factor = 1.0 if naming.factor is None else naming.factor
        return Named(tuple(listed), shape, factor, naming.factor is not None)

    def _listed(self, name: str, variables: str | Sequence[str]) -> tuple[list[str], tuple[int, ...]]:
        """Names of the variables of a block, and their shape."""
        if isinstance(variables, str) and variables not in self._variables and "#" in variables:
            return self._matching(name, variables)
        listed: list[str] = []
        for one in [variables] if isinstance(variables, str) else variables:
            if one not in self._variables and one not in self._arrays:
                raise ValueError(f"block '{name}': {self.unknown(one)}")
            listed += [one] if one in self._variables else self._arrays[one]
        if isinstance(variables, str):
            return listed, () if variables in self._variables else self._shapes[variables]
        return listed, (len(listed),)

    def _matching(self, name: str, pattern: str) -> tuple[list[str], tuple[int, ...]]:
        """The variables that a pattern names, sorted by their numbers, and the shape that those numbers span."""
        expression = re.compile(r"(\d+)".join(map(re.escape, pattern.split("#"))), re.DOTALL)
        hits = [(m, v) for v in self._variables if (m := expression.fullmatch(v))]
        members = sorted((tuple(map(int, m.groups())), v) for m, v in hits)
        if not members:
            raise ValueError(f"block '{name}': no variable of {self.name} matches '{pattern}'; {self._like(pattern)}")
        places, found = [place for place, _ in members], [v for _, v in members]
        for a, b in itertools.pairwise(members):
            if a[0] == b[0]:
                raise ValueError(f"block '{name}': '{a[1]}' and '{b[1]}' both match '{pattern}'; list the variables.")
        if len(places[0]) == 1:
            return found, (len(found),)
        shape = grid(places)
        if shape is None:
            raise ValueError(
                f"block '{name}': the numbers of the variables that match '{pattern}' leave gaps; list the variables."
            )
        return found, shape

    def _like(self, pattern: str) -> str:
        """Where to look when a pattern finds nothing: the patterns of the variables that there are."""
        return nearest(pattern, dict.fromkeys(re.sub(r"\d+", "#", v) for v in self._variables))


def _flat(values: Any) -> Iterator[Any]:
    """The entries of nested lists."""
    if isinstance(values, list | tuple):
        for value in values:
            yield from _flat(value)
    else:
        yield values


def _replaced(values: Any, items: Mapping[str, int]) -> Any:
    """Nested lists with numbers in the place of the names of items."""
    if isinstance(values, list | tuple):
        return [_replaced(value, items) for value in values]
    return items[values] if isinstance(values, str) else values


def _scaled(limits: Limits, factor: float) -> Limits:
    """The limits of what is `factor` times the value in an FMU; a factor below zero exchanges the bounds."""
    low, high = (None if b is None else factor * b for b in (limits.minimum, limits.maximum))
    return replace(limits, minimum=low if factor > 0.0 else high, maximum=high if factor > 0.0 else low)


class MappedParticipant(Blocks):
    """An FMU under names and in units of our own (Participant); `start` holds start values of blocks in our units."""

    def __init__(
        self,
        path: str | Path,
        names: Mapping[str, Naming] | None = None,
        start: Mapping[str, Any] | None = None,
        start_time: float = 0.0,
        stop_time: float | None = None,
        described: Described | None = None,
        instance: str | None = None,
        initialise: bool = True,
    ) -> None:
        described = described or Described(path, names)
        texts = {n: value for n, value in (start or {}).items() if isinstance(value, str) and not described.items(n)}
        for name in texts:
            described.require_text(name)
        raw = {block: described.raw(block, value) for block, value in (start or {}).items() if block not in texts}
        named = {name: (block.variables, block.shape) for name, block in described.named.items()}
        self._factors = {name: block.factor for name, block in described.named.items() if block.factor != 1.0}
        self.fmu = FmuParticipant(path, raw, start_time, stop_time, named, texts, instance, initialise, described.known)
        self.name, self.blocks = self.fmu.name, self.fmu.blocks
        own = {name: _scaled(self.fmu.limits[name], factor) for name, factor in self._factors.items()}
        self.limits = {**self.fmu.limits, **own}  # in our units
        self.own_blocks = self.fmu.own_blocks
        self.saves_state, self.serialises_state = self.fmu.saves_state, self.fmu.serialises_state
        self.enter_initialization = self.fmu.enter_initialization
        self.exit_initialization = self.fmu.exit_initialization
        self.step, self.save, self.restore, self.free = self.fmu.step, self.fmu.save, self.fmu.restore, self.fmu.free
        self.serialised, self.deserialised = self.fmu.serialised, self.fmu.deserialised

    def set(self, block: str, values: Any) -> None:
        """See Participant."""
        factor = self._factors.get(block)
        self.fmu.set(block, values if factor is None else np.asarray(values, dtype=float) / factor)

    def receive(self, block: str, values: Any) -> None:
        """See FmuParticipant."""
        factor = self._factors.get(block)
        self.fmu.receive(block, values if factor is None else np.asarray(values, dtype=float) / factor)

    def get(self, block: str) -> np.ndarray:
        """See Participant."""
        factor = self._factors.get(block)
        values = self.fmu.get(block)
        return values if factor is None else factor * values

    def close(self) -> None:
        """See FmuParticipant."""
        self.fmu.close()
