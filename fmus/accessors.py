"""How values pass between a binary and a slave: as memory of the host, or as lists of numbers."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from fmus.buffer import Buffer

MEMORY = {"real": np.float64, "integer": np.int32, "boolean": np.int32}  # types of values in memory


class ValueSlave(Fmi2Slave):
    """A slave of PythonFMU over arrays of value references and values. What is refused is logged."""

    _buffer: Buffer
    _pending_error: str | None
    _time: float

    @abstractmethod
    def _put(
        self, references: np.ndarray, values: Sequence[float] | np.ndarray, kind: str, whole: bool = False
    ) -> None:
        """Set scalars of a kind, or whole blocks; what is refused is logged."""

    @abstractmethod
    def _take(self, references: np.ndarray, kind: str, whole: bool = False) -> np.ndarray | None:
        """Values of scalars of a kind, or of whole blocks; None, and a message, where that fails."""

    @abstractmethod
    def _logged(self, error: BaseException | str, status: Fmi2Status) -> str:
        """Log a sentence, and return it."""

    def drained(self) -> list[tuple[int, str, str]]:
        """Status, category and text of the messages logged so far, which are forgotten."""
        messages, self.log_queue[:] = self.log_queue[:], []
        return [(int(m.status), _utf8(m.category or "logStatusError"), _utf8(m.msg)) for m in messages]

    # As the binary of this project calls (fmus/binary/slave.c): memory that is valid during the call.

    def put(self, kind: str, references: memoryview, values: memoryview, whole: int) -> None:
        """Set scalars (FMI 2.0) or, where `whole`, variables (FMI 3.0)."""
        self._put(np.frombuffer(references, np.uint32), np.frombuffer(values, MEMORY[kind]), kind, bool(whole))

    def take(self, kind: str, references: memoryview, values: memoryview, whole: int) -> None:
        """Get scalars (FMI 2.0) or, where `whole`, variables (FMI 3.0), among them the time: its reference follows that
        of the last value.
        """
        wanted, room = np.frombuffer(references, np.uint32), np.frombuffer(values, MEMORY[kind])
        clock = (wanted == self._buffer.values.size) if whole and kind == "real" else np.zeros(0, bool)
        taken = self._take_with_time(wanted, clock) if clock.any() else self._take(wanted, kind, bool(whole))
        if taken is not None:
            if len(room) != len(taken):
                self._logged(
                    f"There is room for {len(room)} values, and {len(taken)} were asked for.", Fmi2Status.error
                )
            else:
                room[:] = taken

    def _take_with_time(self, wanted: np.ndarray, clock: np.ndarray) -> np.ndarray | None:
        """Values of reals where those that `clock` marks are the time; None where that fails."""
        time = np.array([self._time])
        parts = [time if c else self._take(wanted[k : k + 1], "real", whole=True) for k, c in enumerate(clock)]
        found = [part for part in parts if part is not None]
        return np.concatenate(found) if len(found) == len(parts) else None

    # As that of PythonFMU calls, which FMUs carry for other platforms than Linux: lists.

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        self._put(np.array(vrs), values, "real")

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._put(np.array(vrs), values, "integer")

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._put(np.array(vrs), values, "boolean")

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._pending_error = self._logged("There are no String variables.", Fmi2Status.error)

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
        self._logged("There are no String variables.", Fmi2Status.error)
        return [""] * len(vrs)


def _utf8(text: object) -> str:
    """A text, without what UTF-8 has no bytes for, as of the name of a file that is not in UTF-8."""
    return str(text).encode("utf-8", "backslashreplace").decode()
