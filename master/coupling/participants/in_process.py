"""A solver core in this process as a participant."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from interface import StepFailed, records
from master.coupling.participants.blocks import Blocks, Limits


class InProcessParticipant(Blocks):
    """A solver core in this process; `parameters` are set at once, fixed ones then no more, as for an FMU."""

    saves_state = True

    def __init__(self, core: Any, parameters: Mapping[str, Any] | None = None, name: str = "Solver") -> None:
        self.name = name
        self._core = core
        self.offers_derivatives = getattr(core, "offers_derivatives", hasattr(core, "directional_derivative"))
        self.refuses_derivatives = getattr(core, "refuses_derivatives", "")
        self.criteria = getattr(core, "criteria", ())
        self._look = getattr(core, "look", None)
        self.blocks = {v.name: tuple(v.shape) for v in core.variables}
        self.limits = {
            v.name: Limits(v.causality, v.variability, v.minimum, v.maximum, kind=v.kind) for v in core.variables
        }
        for block, value in (parameters or {}).items():
            core.set(block, self.checked(block, value, start=True))

    def set(self, block: str, values: Any) -> None:
        """See Participant."""
        self._core.set(block, self.checked(block, values))

    def step(self, t: float, dt: float) -> None:
        """See Participant."""
        try:
            self._core.step(t, dt)
        except StepFailed:
            raise
        except (RuntimeError, ArithmeticError, np.linalg.LinAlgError) as error:
            raise StepFailed(str(error)) from error

    def get(self, block: str) -> np.ndarray:
        """See Participant."""
        self.shape(block)
        if self._look is not None and self.limits[block].causality == "output":
            self._look()  # outputs before the first step, as an FMU has them after its initialisation
        return np.array(self._core.get(block), dtype=float)

    def directional_derivative(self, changes: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """See Blocks."""
        return dict(getattr(self._core, "directional_derivative", super().directional_derivative)(changes))

    def save(self) -> Any:
        """See Participant."""
        return self._core.save()

    def restore(self, state: Any) -> None:
        """See Participant."""
        self._core.restore(state)

    def free(self, state: Any) -> None:
        """See Participant."""

    def serialised(self, state: Any) -> bytes:
        """See Participant."""
        try:
            return records.dumps(state)
        except TypeError as error:
            raise ValueError(f"{self.name}: its state cannot be written to a file: {error}") from error

    def deserialised(self, data: bytes) -> Any:
        """See Participant."""
        return records.loads(data)
