"""Small participants for tests of the master: an oscillator with memory, an algebraic law, and ones with faults."""

import numpy as np

from master.coupling import StepFailed
from master.coupling.participants.blocks import Blocks, Limits


class Toy(Blocks):
    """A participant with blocks given as name -> (causality, start); subclasses write `advance(t, dt)`.

    `faults` maps the number of a step (from 1 on) to "nan", "raise" or "discard"; the number of steps counts on through
    restores, so that a fault comes once.
    """

    saves_state = True

    def __init__(self, name, blocks, faults=None):
        self.name = name
        self.values = {k: np.array(start, dtype=float) for k, (_, start) in blocks.items()}
        self.blocks = {k: v.shape for k, v in self.values.items()}
        self.limits = {k: Limits(c) for k, (c, _) in blocks.items()}
        self.faults = faults or {}
        self.steps = 0
        self.alive = 0  # saved states that are not freed
        self.most_alive = 0

    def set(self, block, values):
        self.values[block] = self.checked(block, values).copy()

    def get(self, block):
        return self.values[block].copy()

    def step(self, t, dt):
        self.steps += 1
        fault = self.faults.get(self.steps, self.faults.get("always"))
        if fault == "discard":
            raise StepFailed("the step was discarded")
        if fault == "raise":
            raise KeyError("a fault of the solver")
        self.advance(t, dt)
        if fault == "nan":
            for block, limits in self.limits.items():
                if limits.causality == "output":
                    self.values[block] = np.full(self.blocks[block], np.nan)

    def save(self):
        self.alive += 1
        self.most_alive = max(self.most_alive, self.alive)
        return {k: v.copy() for k, v in self.values.items()}

    def restore(self, state):
        self.values = {k: v.copy() for k, v in state.items()}

    def free(self, state):
        self.alive -= 1

    def serialised(self, state):
        return b"".join(np.ravel(v).tobytes() for v in state.values())

    def deserialised(self, data):
        self.alive += 1
        whole = np.frombuffer(data)
        out, at = {}, 0
        for name, shape in self.blocks.items():
            size = int(np.prod(shape))
            out[name] = whole[at : at + size].reshape(shape).copy()
            at += size
        return out


class Mass(Toy):
    """m x'' = f, with the trapezoidal rule: force in, position out."""

    def __init__(self, m, x=1.0, v=0.0, faults=None, forces=0.0):
        blocks = {"f": ("input", [forces]), "x": ("output", [x]), "v": ("local", [v]), "f_old": ("local", [forces])}
        super().__init__("mass", blocks, faults)
        self.m = m

    def advance(self, t, dt):
        a = 0.5 * (self.values["f"] + self.values["f_old"]) / self.m
        v = self.values["v"]
        self.values["x"] = self.values["x"] + dt * v + 0.5 * dt**2 * a
        self.values["v"] = v + dt * a
        self.values["f_old"] = self.values["f"].copy()


class Spring(Toy):
    """f = -k x - c x^3, without memory: position in, force out."""

    def __init__(self, k, c=0.0, x=1.0, faults=None):
        super().__init__("spring", {"x": ("input", [x]), "f": ("output", [-k * x - c * x**3])}, faults)
        self.k, self.c = k, c

    def advance(self, t, dt):
        x = self.values["x"]
        self.values["f"] = -self.k * x - self.c * x**3


class Faulty:
    """A participant wrapped so that it fails: `faults` and `steps` as in `Toy`; it counts saved states and repeats all
    else. "dead" makes every call fail from then on.
    """

    def __init__(self, inner, faults=None):
        self._inner = inner
        self.faults = faults or {}
        self.steps = self.alive = 0
        self._spoilt = self._dead = False

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def _live(self):
        if self._dead:
            raise ValueError("the solver is closed.")
        return self._inner

    def set(self, block, values):
        self._live().set(block, values)

    def step(self, t, dt):
        self.steps += 1
        fault = self.faults.get(self.steps, self.faults.get("always"))
        self._spoilt = fault == "nan"
        if fault == "dead":
            self._dead = True
            raise RuntimeError("the solver ended with fmi2Fatal")
        if fault == "discard":
            raise StepFailed("the step was discarded")
        if fault == "raise":
            raise KeyError("a fault of the solver")
        if fault == "interrupt":
            raise KeyboardInterrupt
        self._live().step(t, dt)

    def get(self, block):
        values = self._live().get(block)
        spoilt = self._spoilt and self._inner.causality[block] == "output" and values.ndim > 0
        return np.full_like(values, np.nan) if spoilt else values

    def save(self):
        state = self._live().save()
        self.alive += 1
        return state

    def restore(self, state):
        self._live().restore(state)
        self._spoilt = False

    def free(self, state):
        self.alive -= 1
        self._live().free(state)

    def deserialised(self, data):
        self.alive += 1
        return self._live().deserialised(data)
