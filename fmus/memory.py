"""The accessors that the binary of this project calls (fmus/front), with memory of the host, valid during the call."""

import numpy as np
from pythonfmu.enums import Fmi2Status

from fmus.buffer import Buffer
from fmus.lists import MEMORY, ListSlave


class MemorySlave(ListSlave):
    """A slave whose values pass as they lie in memory. What is refused is logged, and the binary returns an error."""

    _buffer: Buffer
    _time: float

    def put(self, kind: str, references: memoryview, values: memoryview) -> None:
        """Set scalars (FMI 2.0)."""
        self._put(np.frombuffer(references, np.uint32), np.frombuffer(values, MEMORY[kind]), kind)

    def take(self, kind: str, references: memoryview, values: memoryview) -> None:
        """Get scalars (FMI 2.0)."""
        taken = self._take(np.frombuffer(references, np.uint32), kind)
        if taken is not None:
            np.frombuffer(values, MEMORY[kind])[:] = taken

    def put_arrays(self, kind: str, references: memoryview, values: memoryview) -> None:
        """Set whole variables (FMI 3.0)."""
        self._put(np.frombuffer(references, np.uint32), np.frombuffer(values, MEMORY[kind]), kind, whole=True)

    def take_arrays(self, kind: str, references: memoryview, values: memoryview) -> None:
        """Get whole variables (FMI 3.0); the reference after that of the last value is the time's."""
        wanted, room = np.frombuffer(references, np.uint32), np.frombuffer(values, MEMORY[kind])
        clock = (wanted == self._buffer.values.size) & (kind == "real")
        taken = self._take_with_time(wanted, clock) if clock.any() else self._take(wanted, kind, whole=True)
        if taken is not None:
            if len(room) != len(taken):
                self._say(f"There is room for {len(room)} values, and {len(taken)} were asked for.", Fmi2Status.error)
            else:
                room[:] = taken

    def _take_with_time(self, wanted: np.ndarray, clock: np.ndarray) -> np.ndarray | None:
        """Values of reals where those that `clock` marks are the time; None where they cannot be told."""
        time = np.array([self._time])
        parts = [time if c else self._take(wanted[k : k + 1], "real", whole=True) for k, c in enumerate(clock)]
        told = [part for part in parts if part is not None]
        return np.concatenate(told) if len(told) == len(parts) else None
