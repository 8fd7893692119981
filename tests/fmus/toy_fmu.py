"""A solver core with a hidden memory and every kind of trouble, and its FMU. Inside the FMU this is the script."""

import copy
import weakref
from dataclasses import dataclass

import numpy as np

from fmus.adapter import CoreFmu
from interface import StepFailed, Variable

TROUBLES = (None, StepFailed("The rope is torn at 100 % load."), TypeError("a bug"), KeyboardInterrupt("by a user"))
SAVED = weakref.WeakSet()  # states that are alive


@dataclass(frozen=True, eq=False)
class Saved:
    """A saved state, of which a weak reference can be taken."""

    values: dict
    memory: np.ndarray


class Toy:
    """memory <- memory/2 + gain load;  position = sin(memory),  offset = scale gain, also before the first step."""

    def __init__(self):
        self.variables = (
            Variable("gain", (), "parameter", "tunable", unit="m/N", start=0.1 + 0.2, minimum=0.0),
            Variable("scale", (3,), "parameter", "fixed", unit="N", start=np.array([1.0, 2.0, 4.0]), maximum=9.0),
            Variable("active", (), "parameter", "tunable", "boolean", start=1.0),
            Variable("load", (2, 3), unit="N", description="load < limit"),
            Variable("trouble", (), "input", "discrete", "integer", minimum=0, maximum=3),
            Variable("position", (2, 3), "output", unit="m"),
            Variable("offset", (3,), "output", unit="m"),
            Variable("steps", (), "output", "discrete", "integer"),
            Variable("loaded", (2,), "output", kind="boolean"),
        )
        self.values = {v.name: np.broadcast_to(np.asarray(v.start, float), v.shape).copy() for v in self.variables}
        self.memory = np.zeros((2, 3))

    def set(self, block, values):
        if not np.isfinite(values).all() or (block == "gain" and values > 1000.0):
            raise ValueError(f"{block} must be finite and a gain at most 1000.")
        self.values[block] = np.array(values, dtype=float)

    def get(self, block):
        return self.values["scale"] * self.values["gain"] if block == "offset" else self.values[block]

    def look(self):
        pass

    def step(self, t, dt):
        v = self.values
        if trouble := TROUBLES[int(v["trouble"])]:
            raise trouble
        self.memory = 0.5 * self.memory + v["active"] * v["gain"] * v["load"]
        v["position"], v["steps"], v["loaded"] = np.sin(self.memory), v["steps"] + 1.0, v["load"].any(axis=1) * 1.0

    def save(self):
        state = Saved(copy.deepcopy(self.values), self.memory.copy())
        SAVED.add(state)
        return state

    def restore(self, state):
        self.values, self.memory = copy.deepcopy(state.values), state.memory.copy()


class ToyFmu(CoreFmu):
    """The toy as an FMU."""

    title = "Toy"

    def __init__(self, core=None, **kwargs):
        super().__init__(core or Toy(), **kwargs)
