"""The accessors that PythonFMU's binary calls, with lists of numbers; FMUs carry it for other platforms than Linux."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

MEMORY = {"real": np.float64, "integer": np.int32, "boolean": np.int32}  # types of FMI 2.0 in memory


class ListSlave(Fmi2Slave):
    """A slave of PythonFMU over arrays of value references and values."""

    _refused: str | None

    @abstractmethod
    def _put(
        self, references: np.ndarray, values: Sequence[float] | np.ndarray, kind: str, whole: bool = False
    ) -> None:
        """Set scalars of a kind, or whole blocks; what is refused is logged."""

    @abstractmethod
    def _take(self, references: np.ndarray, kind: str, whole: bool = False) -> np.ndarray | None:
        """Values of scalars of a kind, or of whole blocks; None, and a message, where they cannot be told."""

    @abstractmethod
    def _say(self, error: BaseException | str, status: Fmi2Status) -> str:
        """Log a sentence, and return it."""

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        self._put(np.array(vrs), values, "real")

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._put(np.array(vrs), values, "integer")

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._put(np.array(vrs), values, "boolean")

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._refused = self._say("There are no String variables.", Fmi2Status.error)

    def _listed(self, vrs: list[int], kind: str, bad: Any) -> list[Any]:
        taken = self._take(np.array(vrs), kind) if vrs else np.array([])
        return [bad] * len(vrs) if taken is None else taken.astype(MEMORY[kind]).tolist()

    def get_real(self, vrs: list[int]) -> list[float]:
        return self._listed(vrs, "real", math.nan)

    def get_integer(self, vrs: list[int]) -> list[int]:
        return self._listed(vrs, "integer", 0)

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return [bool(value) for value in self._listed(vrs, "boolean", False)]

    def get_string(self, vrs: list[int]) -> list[str]:
        self._say("There are no String variables.", Fmi2Status.error)
        return [""] * len(vrs)
