"""What stands in for the flow where a scene has none: no loads, whatever the shape."""

from collections.abc import Mapping
from typing import Any

import numpy as np


class ZeroLoads:
    """A participant that takes displacements and gives zero for the `loads` (block -> shape) that a structure needs."""

    offers_derivatives = True

    def __init__(self, displacement: tuple[int, ...], loads: Mapping[str, tuple[int, ...]]) -> None:
        self.blocks: dict[str, tuple[int, ...]] = {"displacement": displacement, **loads}
        self.causality = {"displacement": "input"} | dict.fromkeys(loads, "output")

    @classmethod
    def beside(cls, structural: Any) -> "ZeroLoads":
        """The stand-in for the flow of a structural participant."""
        inputs = [b for b, c in structural.causality.items() if c == "input"]
        return cls(structural.blocks["displacement"], {b: structural.blocks[b] for b in inputs})

    def set(self, block: str, values: Any) -> None:
        """Nothing depends on it."""

    def step(self, t: float, dt: float) -> None:
        """Nothing happens."""

    def get(self, block: str) -> np.ndarray:
        """Zeros."""
        return np.zeros(self.blocks[block])

    def save(self) -> None:
        """There is no state."""

    def restore(self, state: None) -> None:
        """There is no state."""

    def free(self, state: None) -> None:
        """There is no state."""

    def serialised(self, state: None) -> bytes:
        """There is no state."""
        return b""

    def deserialised(self, data: bytes) -> None:
        """There is no state."""

    def directional_derivative(self, changes: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """No load changes."""
        return {b: np.zeros(self.blocks[b]) for b, c in self.causality.items() if c == "output"}

    def close(self) -> None:
        """There is nothing to close."""


StillAir = ZeroLoads  # its name in releases up to 0.1
