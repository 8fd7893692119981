"""Equations of motion of particles: masses on the nodes of a structure, with its elements, dampers and loads."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from structural.assembly import Assembly, Prepared
from structural.elements import Configuration, ElementGroup
from structural.model import Loads
from structural.solve.linear import factorised

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class State:
    """Time `t` s, positions `q` m, velocities `v` m/s and accelerations `a` m/s^2 of the unknowns, (u,) each.

    `past` is what a two-step scheme keeps of the step before: its size s, q and v then.
    """

    t: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    past: tuple[float, np.ndarray, np.ndarray] | None = None


def _function(given: Callable[[float], T] | T) -> tuple[Callable[[float], T], bool]:
    if callable(given):
        return given, True
    return (lambda _t: given), False


class Mass:
    """Inertia of the unknowns of an assembly, from masses (n,) kg or (n,3,3) kg on its nodes.

    ValueError in one sentence for a free node without mass, or a negative one.
    """

    def __init__(self, assembly: Assembly, mass: np.ndarray):
        n, u = len(assembly.structure.nodes), assembly.unknowns
        if mass.shape not in ((n,), (n, 3, 3)) or not np.all(np.isfinite(mass)):
            raise ValueError(f"masses must be finite numbers, one for each of the {n} nodes.")
        least = mass if mass.ndim == 1 else np.linalg.eigvalsh(mass)[:, 0]
        free = (u.index.reshape(-1, 3) >= 0).any(axis=1)
        bad = np.flatnonzero(least < 0.0)
        bad = bad if len(bad) else np.flatnonzero((least == 0.0) & free)
        if len(bad):
            what = "negative mass" if least[bad[0]] < 0.0 else "no mass but is free to move"
            raise ValueError(f"node number {bad[0]} has {what}; in dynamics every free node needs a mass above zero.")
        self._diagonal = self._matrix = None
        if mass.ndim == 1:
            index = u.index >= 0
            self._diagonal = np.bincount(u.index[index], np.repeat(mass, 3)[index], minlength=u.count)
        else:
            self._data = assembly.node_blocks(mass)
            self._matrix = assembly.matrix(self._data)

    def times(self, a):
        """M a."""
        return self._matrix @ a if self._diagonal is None else self._diagonal * a

    def solve(self, f):
        """M^-1 f."""
        if self._diagonal is not None:
            return f / self._diagonal
        return factorised(self._matrix, pivot=1.0).solve(f)  # few and small: pivots as they come

    def add_to(self, data, diagonal, factor):
        """Add factor M to the data of a tangent, whose `diagonal` has these places."""
        if self._diagonal is None:
            data += factor * self._data
        else:
            data[diagonal] += factor * self._diagonal


class Motion:
    """M a + f_int(x, v) - f_ext(x, v, t) = 0 for the free nodes of an assembly without rotational dofs.

    `mass` (n,) kg on the nodes, or (n,3,3) where inertia has a direction as that of the air around a wing; `loads`;
    `groups` the elements with their damping (None: those of the structure); each is constant or a function of the time.
    ValueError in one sentence for a free node without mass, negative masses, membranes, and structures with rotational
    dofs.
    """

    def __init__(
        self,
        assembly: Assembly,
        mass: Callable[[float], np.ndarray] | np.ndarray,
        loads: Callable[[float], Loads] | Loads,
        groups: Callable[[float], Sequence[ElementGroup]] | Sequence[ElementGroup] | None = None,
    ):
        if len(assembly.structure.rotation_nodes):
            raise ValueError(
                "nodes with rotational dofs (beams) have no place in a particle system; leave the beams out."
            )
        if any(group.wrinkles for group in assembly.structure.groups):
            raise ValueError("membranes have no dynamics yet; solve the structure for static equilibrium.")
        self.assembly, self.unknowns = assembly, assembly.unknowns
        self._mass, mass_varies = _function(mass)
        self._loads, loads_vary = _function(loads)
        self._groups, self.elements_change = _function(assembly.structure.groups if groups is None else groups)
        self._constant = not (mass_varies or loads_vary or self.elements_change)
        self._at: tuple[float, Any] | None = None

    def mass(self, t: float) -> "Mass":
        """The masses of the unknowns; one that stands for its mirror image too has the mass of both."""
        return self._present(t)[0]

    def prepared(self, t: float) -> Prepared:
        """Elements and loads at time t."""
        return self._present(t)[1]

    def groups(self, t: float) -> Sequence[ElementGroup]:
        """The elements at time t."""
        return self._groups(t)

    def _present(self, t):
        if self._at is None or (self._at[0] != t and not self._constant):
            mass, groups = np.asarray(self._mass(t), float), self._groups(t)
            self._at = t, (Mass(self.assembly, mass), self.assembly.prepare(self._loads(t), groups))
        return self._at[1]

    def at(self, x: np.ndarray, v: np.ndarray | None = None, t: float = 0.0) -> State:
        """The state with node positions x m and velocities v m/s (None: at rest), (n,3) each, at time t s."""
        q = self.unknowns.restrict(np.asarray(x, float))
        speed = np.zeros_like(q) if v is None else self.unknowns.restrict(np.asarray(v, float))
        return State(t, q, speed, self.acceleration(q, speed, t))

    def restarted(self, state: State) -> State:
        """The state after loads or elements have jumped: with the acceleration that they give now, and no past."""
        return State(state.t, state.q, state.v, self.acceleration(state.q, state.v, state.t))

    def acceleration(self, q, v, t) -> np.ndarray:
        """Accelerations (u,) m/s^2 by Newton's second law."""
        elastic, damping, external = self.forces(q, v, t)
        return self.mass(t).solve(external - elastic - damping)

    def forces(self, q, v, t):
        """Elastic, damping and external generalised forces (u,) N; the first two are internal, so act against."""
        at, p, a = self.configuration(q, v), self.prepared(t), self.assembly
        return a.elastic(at, p), a.damping(at, p), a.external(at, p)

    def external(self, state: State) -> np.ndarray:
        """Generalised forces (u,) N of the loads."""
        return self.assembly.external(self.configuration(state.q, state.v), self.prepared(state.t))

    def configuration(self, q, v) -> Configuration:
        """The moving shape of the whole structure."""
        return Configuration(self.positions(q), None, self.velocities(v))

    def positions(self, q) -> np.ndarray:
        """Node positions (n,3) m."""
        return self.unknowns.expand(q)

    def velocities(self, v) -> np.ndarray:
        """Node velocities (n,3) m/s."""
        return self.unknowns.displacements(v)

    def evaluated(self, q, v, t, isotropic=False):
        """Residual f_int - f_ext (u,) N, data of its derivatives by q and by v (None: zero), norm of f_ext N."""
        x, moving = self.positions(q), self.velocities(v)
        return self.assembly.moving_residual_and_tangents(x, moving, self.prepared(t), isotropic)

    def kinetic_energy(self, state: State) -> float:
        """m v^2 / 2 of all nodes, J."""
        return 0.5 * float(state.v @ self.mass(state.t).times(state.v))

    def elastic_energy(self, state: State) -> float:
        """Strain energy of all elements, J."""
        return self.assembly.energy(Configuration(self.positions(state.q)), self.groups(state.t))

    def element_work(self, state: State, new: State) -> tuple[float, float]:
        """Work J that changes of the elements put into them between two states, and heat J of their dampers. Of the
        first are rest lengths that change, -T dl0 with that of the dampers in T, and the stiffness that goes with them,
        by which line that is reeled in takes its strain energy along.
        """
        before = self.groups(state.t)
        after = self.groups(new.t) if self.elements_change else before
        begin, end = (self.configuration(s.q, s.v) for s in (state, new))
        put_in = heat = 0.0
        for a, b in zip(before, after, strict=True):
            taken, heated = a.damper_work(b, begin, end)
            heat += taken
            put_in += heated + (a.changing_work(b, begin, end) if self.elements_change else 0.0)
        return put_in, heat
