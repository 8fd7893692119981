"""The time loop: steps of a scheme, each solved to its tolerance, of fixed size or as an error estimate allows."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .motion import Motion, State
from .schemes import Scheme
from .steps import StepSolver

# A step that cannot be solved is halved so often before the run ends.
HALVINGS = 12
# Attempts in a row, each of half the size of the one before or its other half, that a run makes at steps that cannot be
# solved: what needs more is no jerk that passes but a load that is out of all proportion.
MAX_ATTEMPTS = 40
# Bounds and safety factor of the change of size from step to step, as usual for one-step error control.
SAFETY, SHRINK, GROW = 0.9, 0.2, 4.0
EPS = float(np.finfo(float).eps)
# Steps of the smallest size relative to the run that still count as progress.
SMALLEST = 1e-12
# A scheme that has made more than this part of all energy that there was or went in or out is no approximation of the
# motion any more. Its errors of second order are far less, and damping is a loss.
MADE = 1.0


@dataclass
class Balance:
    """Energies J since the beginning: put in by loads (`work`) and by reeling (`reeled`: rest lengths that change under
    tension, and line that comes in at the speed of its nodes), taken by dampers (`dissipated`), and what the scheme has
    lost (or, below zero, made) by itself: all that is missing from the sum, so that kinetic + elastic grow by exactly
    work + reeled - dissipated - numerical_loss. `exchanged` is what loads and reeling have put in or taken out in all
    steps, without regard to the sign.

    Each is the integral of its power from the values at both ends of every step: by the trapezoidal rule; of springs
    and dampers along straight paths of stretch and rest length, over the part in which a line is taut. Their errors are
    of second order in the step, and in the loss.
    """

    kinetic: float
    elastic: float
    work: float = 0.0
    reeled: float = 0.0
    dissipated: float = 0.0
    numerical_loss: float = 0.0
    exchanged: float = 0.0

    @property
    def begun_with(self) -> float:
        """Energy at the beginning, J."""
        return self.kinetic + self.elastic + self.numerical_loss - self.work - self.reeled + self.dissipated


@dataclass(frozen=True, eq=False)
class Integration:
    """End of a run: `state`, "finished" or why not ("newton_failed", "step_too_small", "energy_made": the scheme has
    made more of it than there was, which the balance tells where it is kept), and a sentence;
    steps made and refused, Newton iterations, energy `balance` if asked for, size s of the steps at the end.
    """

    state: State
    status: str
    message: str
    steps: int
    rejected: int
    newton_iterations: int
    balance: Balance | None
    step: float

    @property
    def finished(self) -> bool:
        """Whether the stop time was reached."""
        return self.status == "finished"


def integrate(
    motion: Motion,
    state: State,
    stop_time: float,
    scheme: Scheme,
    step: float | None = None,
    tolerance: float | None = None,
    atol: float = 1e-9,
    rtol: float = 1e-9,
    energy: bool | Balance = False,
    callback: Callable[[State], object] | None = None,
    max_steps: int | None = None,
) -> Integration:
    """Integrate from `state` to `stop_time` s.

    Steps are of equal size, `step` s at most; a step whose equations cannot be solved is made in halves. With
    `tolerance` m the size follows the estimate of the local error of the positions instead, `step` s at most if it is
    given. Newton's method ends at ||residual|| <= atol + rtol (||f_ext|| + ||M a||), in newtons. `energy` keeps the
    balance, or goes on with one; it costs one more evaluation of forces a step. `callback(state)` follows every step.

    ValueError in one sentence for a step or tolerance that is not above zero, or a stop before the start. A run that
    cannot go on ends with a status, and with the last good state.
    """
    for name, value in (("time step", step), ("error tolerance", tolerance)):
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"the {name} must be a number above zero; it is {value:g}.")
    if step is None and tolerance is None:
        raise ValueError("integration needs a time step or an error tolerance.")
    if not (np.isfinite(stop_time) and stop_time >= state.t):
        raise ValueError(f"the stop time {stop_time:g} s must not lie before the start, {state.t:g} s.")
    run = _Run(motion, scheme, state, stop_time, atol, rtol, energy, callback)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        if tolerance is None:
            run.fixed(step, max_steps)
        else:
            run.adaptive(tolerance, step, max_steps)
    return run.result()


class _Run:
    def __init__(self, motion, scheme, state, stop, atol, rtol, energy, callback):
        self.motion, self.scheme, self.state, self.stop = motion, scheme, state, stop
        self.callback = callback
        self._solve = StepSolver(motion, scheme, atol, rtol)
        self.steps = self.rejected = self.iterations = 0
        self.refused = 0  # attempts since a step of whole size went through
        self.status, self.message = "finished", ""
        self.step = stop - state.t
        self._energies: _EnergyBalance | None = None
        if isinstance(energy, Balance):
            self._energies = _EnergyBalance(motion, state, replace(energy))
        elif energy:
            begin = Balance(motion.kinetic_energy(state), motion.elastic_energy(state))
            self._energies = _EnergyBalance(motion, state, begin)

    def result(self):
        balance = None if self._energies is None else self._energies.balance
        parts = self.steps, self.rejected, self.iterations, balance, self.step
        return Integration(self.state, self.status, self.message, *parts)

    def _end(self, status, why):
        self.status, self.message = status, f"{why}."
        return False

    def _tried(self, h):
        new, count = self._solve(self.state, h)
        self.iterations += count
        if new is not None and not (np.all(np.isfinite(new.q)) and np.all(np.isfinite(new.v))):
            new = None
        return new

    def fixed(self, step, max_steps):
        left = self.stop - self.state.t
        count = max(1, int(np.ceil(left / step - 1e-9))) if left > 0.0 else 0
        begin, h = self.state.t, left / max(count, 1)
        self.step = h
        for k in range(count if max_steps is None else min(count, max_steps)):
            end = self.stop if k == count - 1 else begin + (k + 1) * h
            self.refused = 0
            if not self._reach(end, HALVINGS):
                return

    def _reach(self, end, halvings):
        """Go to the time `end` in one step, or in halves where that cannot be solved."""
        new = self._tried(end - self.state.t)
        if new is not None:
            return self._accept(replace(new, t=end))
        self.rejected += 1
        self.refused += 1
        if halvings == 0 or self.refused > MAX_ATTEMPTS:
            return self._end("newton_failed", "The equations of a step could not be solved, however small it was")
        middle = 0.5 * (self.state.t + end)
        return self._reach(middle, halvings - 1) and self._reach(end, halvings - 1)

    def adaptive(self, tolerance, longest, max_steps):
        longest = self.stop - self.state.t if longest is None else longest
        smallest = SMALLEST * max(abs(self.stop), self.stop - self.state.t)
        a = float(np.abs(self.state.a).max(initial=0.0))
        self.step = min(longest, (2.0 * tolerance / a) ** 0.5 if a > 0.0 else longest)
        while self.state.t < self.stop and (max_steps is None or self.steps < max_steps):
            left = self.stop - self.state.t
            parts = max(1, int(np.ceil(left / self.step - 1e-9)))
            h = left / parts if parts <= 2 else self.step
            new = self._tried(h)
            error = np.inf
            if new is not None:
                error = float(np.abs(self.scheme.local_error(self.state, new, h)).max(initial=0.0)) / tolerance
            factor = SAFETY * error ** (-1.0 / (self.scheme.order + 1)) if 0.0 < error < np.inf else GROW
            if error <= 1.0:
                if not self._accept(replace(new, t=self.stop) if parts == 1 else new):
                    return
                self.step = min(longest, h * min(max(factor, SHRINK), GROW))
                continue
            self.rejected += 1
            self.step = h * min(max(factor, SHRINK), SAFETY) if np.isfinite(error) else 0.25 * h
            if self.step < smallest:
                self._end("step_too_small", f"The step had to shrink below {smallest:.1g} s")
                return

    def _accept(self, new):
        if self._energies is not None:
            self._energies.add(self.state, new)
        self.state = new
        self.steps += 1
        if self.callback is not None:
            self.callback(new)
        if self._energies is None or not self._energies.made:
            return True
        b = self._energies.balance
        return self._end(
            "energy_made",
            f"The scheme has made {-b.numerical_loss:.3g} J by itself, where {b.begun_with + b.exchanged:.3g} J were "
            "there or went in or out; take a spectral radius of 0 (or bdf2), or a shorter step",
        )


class _EnergyBalance:
    """The energy `balance` of a run, kept from step to step with the loads and masses at the end of the last one."""

    def __init__(self, motion, state, balance: Balance):
        self._motion, self.balance = motion, balance
        self._external, self._mass = motion.external(state), motion.mass(state.t)
        at = motion.configuration(state.q, state.v)
        stiffness = sum(float(group.stiffness(at).sum()) for group in motion.groups(state.t))
        self._rounding = EPS * stiffness * float(np.abs(at.x).max(initial=0.0)) ** 2

    @property
    def made(self):
        """Whether the scheme has made more energy than there can be, and than rounding of positions makes."""
        b = self.balance
        return -b.numerical_loss > MADE * (b.begun_with + b.exchanged) + self._rounding

    def add(self, old, new):
        """Add the energies of the step between two states."""
        b, motion = self.balance, self._motion
        before, self._external = self._external, motion.external(new)
        work = 0.5 * float((before + self._external) @ (new.q - old.q))
        changed, lost = motion.element_work(old, new)
        reeled = changed + self._brought(old, new)
        held = b.kinetic + b.elastic + b.numerical_loss
        b.kinetic, b.elastic = motion.kinetic_energy(new), motion.elastic_energy(new)
        b.work, b.dissipated, b.reeled = b.work + work, b.dissipated + lost, b.reeled + reeled
        b.exchanged += abs(work) + abs(reeled)
        b.numerical_loss = held + work + reeled - lost - b.kinetic - b.elastic

    def _brought(self, old, new):
        """Kinetic energy J of mass that has come in at the speed of its node: the integral of v^2 dm / 2."""
        before, after = self._mass, self._motion.mass(new.t)
        self._mass = after
        if after is before:
            return 0.0
        return 0.25 * sum(float(v @ (after.times(v) - before.times(v))) for v in (old.v, new.v))
