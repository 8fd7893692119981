"""Static equilibrium: Newton on the true residual; where that takes long, by continuation in the stiffness of lines;
where that fails, from the shape of least energy. And its sensitivity to small changes of the loads.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from structural.assembly import Assembly, Prepared
from structural.elements import ElementGroup
from structural.model import Loads

from . import Singular
from .cones import ConvexShape
from .linear import ACCURATE_PIVOT, factorised, shifted
from .newton import Newton, rounding_force, stiffest

# No step moves a node by more than this part of the size of the structure, or by METRE: the limit of kites, which are
# some 10 m large, and no limit for what is much smaller, where the line search is enough.
PART_OF_SIZE, METRE = 0.05, 1.0
# Newton iterations after which lines and ropes that are stiff for their loads are softened (see `continuation_stages`);
# each stage takes SOFT_ITERATIONS at most, to SOFT_RTOL of the load.
DIRECT_ITERATIONS, SOFT_ITERATIONS, SOFT_RTOL = 200, 200, 1e-2
# Newton iterations after which a solve begins anew, and how many it then may take: some for every free node, within
# bounds.
BEGIN_ANEW, PER_NODE, FEWEST, MOST = 600, 20, 600, 3000
# A soft line is stretched to twice its length by SOFT times the load at first, then by STIFFENING times more each time;
# no load counts as less than SMALLEST_LOAD of the largest k l0. Chosen on random networks of ropes.
SOFT, STIFFENING, SMALLEST_LOAD = 3.0, 30.0, 1e-9
# Statuses of solves that another start may help.
SLOW = ("max_iterations", "stalled")
# Shift relative to each unknown's own stiffness where the tangent of a `LoadSensitivity` is exactly singular.
SHIFT = 1e-12


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Result of a static solve: `x` (n,3) m, `status` "converged" or why not, the residual norms N of all Newton
    iterations (also with softened lines), in how many directions the converged equilibrium is unstable under its loads
    (0: it is stable), and the nodal `rotations` (r,3,3), None without any. The norm takes moments in N m beside forces
    in N.
    """

    x: np.ndarray
    status: str
    iterations: int
    residuals: tuple[float, ...]
    unstable_modes: int = 0
    rotations: np.ndarray | None = None

    @property
    def converged(self):
        """Whether the residual met the tolerance."""
        return self.status == "converged"

    @property
    def residual(self):
        """Norm of the out-of-balance force over the free dofs, N."""
        return self.residuals[-1]


class StaticProblem:
    """Balance of an assembly under prepared elements and loads; the unknowns stand at (q, rotations). `damping` N/m
    pulls the positions back to where they `begin` (q,), see `equilibrium`.
    """

    def __init__(
        self,
        assembly: Assembly,
        prepared: Prepared,
        groups: Sequence[ElementGroup],
        begin: np.ndarray | None = None,
        damping: float = 0.0,
    ):
        self._assembly, self._prepared, self._groups = assembly, prepared, groups
        self._begin, self._damping = begin, damping_of(assembly, damping)
        unknowns = assembly.unknowns
        self.rotational, self.diagonal, self.norm = unknowns.rotational, assembly.diagonal, unknowns.norm
        self.stiffest = stiffest(groups, assembly.structure.reference)
        structure = assembly.structure
        self._reach = float(np.abs(structure.nodes).max(initial=0.0))
        self._free = np.array(~structure.fixed.all(axis=1))  # nodes that elements out of balance can be seen at
        self._free[np.concatenate([structure.rotation_nodes, structure.dependent_nodes])] = True

    def residual_and_tangent(self, at):
        """See Problem; the norm is that of the external forces."""
        q, rotations = at
        r, k, external = self._assembly.residual_and_tangent(q, self._prepared, rotations)
        if self._damping is None or self._begin is None:
            return r, k, external
        return r + self._damping * (q - self._begin), shifted(k, self.diagonal, self._damping), external

    def moved(self, at, step):
        """See Problem."""
        q, rotations = at
        return self._assembly.moved(q, rotations, step)

    def rounding(self, at):
        """See Problem."""
        return rounding_force(self._groups, self._assembly.configuration(*at), self._reach, self._free)

    # What `energy.EnergyNewton` asks besides

    @property
    def mean_stiffness(self):
        """See EnergyProblem."""
        reference = self._assembly.structure.reference
        values = [group.stiffness(reference) for group in self._groups if len(group)]
        return float(np.concatenate(values).mean()) if values else 0.0

    def smoothing(self, at):
        """See EnergyProblem."""
        data = self._assembly.smoothing(self._prepared, at[1])
        return None if data is None else self._assembly.matrix(data)

    def energy(self, at):
        """See EnergyProblem."""
        shape = self._assembly.configuration(*at)
        parts = [group.energy(shape) for group in self._groups]
        return None if None in parts else float(sum(parts))

    def external_work(self, at, step):
        """See EnergyProblem: by Simpson's rule, exact for pressure on triangles with straight sides."""
        work = 0.0
        for place, weight in ((0.0, 1.0), (0.5, 4.0), (1.0, 1.0)):
            q, rotations = self.moved(at, place * step)
            work += weight / 6.0 * float(self._assembly.external_forces(q, rotations, self._prepared) @ step)
        return work

    def residual(self, at):
        """See EnergyProblem."""
        q, rotations = at
        return self._assembly.residual(q, self._prepared, rotations)[0]


def equilibrium(
    assembly: Assembly,
    loads: Loads,
    x0: np.ndarray,
    atol: float = 1e-6,
    rtol: float = 0.0,
    groups: Sequence[ElementGroup] | None = None,
    rotations: np.ndarray | None = None,
    max_iterations: int | None = None,
    step_limit: float | None = None,
    damping: float = 0.0,
) -> Equilibrium:
    """Positions where internal and external forces balance: ||r|| <= atol + rtol ||f_ext||, in newtons.

    Where the elements are so stiff that rounding of their lengths and positions makes larger forces, that is the
    tolerance. `groups` replace those of the structure (rest lengths and sections may change), `x0` (n,3) m and
    `rotations` (r,3,3) are what to start from. No step moves a node by more than `step_limit` m at first (None: a part
    of the size of the structure, 1 m at least), and `max_iterations` are as many as a structure of its size may need.

    Full Newton steps are all that a warm start needs, and what stiff members need that turn by a large angle;
    otherwise steps are damped, with a line search (see `newton.Newton`; quadratic convergence at the end also with
    mechanisms). For tension-only members under dead loads that is a line search on a convex energy, and it needs no
    energy, so follower loads may take part.

    Stiff lines that turn far under light loads are a narrow curved valley, in which straight steps are short. So where
    all this takes long, it begins anew with soft lines, which are stiffened by degrees (continuation). Where that finds
    nothing either, structures of chains alone begin from the shape of least energy, which an interior-point method
    finds (`cones.ConvexShape`); others go on from the best shape so far, with steps that may grow.

    With `damping` N/m it is not the equilibrium, but one implicit Euler step towards it in pseudo-time, f_int - f_ext +
    damping (x - x0) = 0 (pseudo-transient continuation, Kelley and Keyes 1998): large enough it has one solution near
    x0, and repeated it leads to a stable equilibrium.
    """
    groups = tuple(assembly.structure.groups if groups is None else groups)
    most = _budget(assembly) if max_iterations is None else max_iterations
    limit = _step_limit(assembly.structure.nodes) if step_limit is None else step_limit
    task = _Task(assembly, loads, x0, assembly.start(rotations), groups, atol, rtol, limit, damping)
    direct = task.newton(groups)
    direct.run(min(BEGIN_ANEW if damping else DIRECT_ITERATIONS, most))
    solves, spent = [direct], direct.iterations
    if damping:
        most = spent
    if spent < most and direct.status in SLOW:
        more, spent = task.stiffened(direct, min(BEGIN_ANEW, most))
        solves += more
    solve = _better(direct, solves[-1])
    if spent < most and solve.status in SLOW:
        more, spent = task.begun_anew(solve, spent, most)
        solves += more
        solve = _better(solve, solves[-1])
    norms = [norm for one in solves for norm in one.norms]
    if solve is not solves[-1]:  # a new beginning has not helped
        norms.append(solve.norm)
    unstable = solve.negative_pivots() if solve.status == "converged" else 0
    x = assembly.positions(*solve.at)
    return Equilibrium(x, solve.status, spent, tuple(norms), unstable, solve.at[1])


def _better(first, second):
    """Of two solves the second, unless it has not converged and ends further out of balance."""
    return first if second.status != "converged" and second.norm > first.norm else second


@dataclass(frozen=True, eq=False)
class _Task:
    """What `equilibrium` is asked for, with the ways to it: each gives further solves, and iterations in all."""

    assembly: Assembly
    loads: Loads
    x0: np.ndarray
    rotations: np.ndarray | None
    groups: tuple[ElementGroup, ...]
    atol: float
    rtol: float
    limit: float
    damping: float

    def newton(self, members, at=None, rtol=None, method=None, growing=False):
        """Newton's method with these members, from the start unless `at` is given."""
        begin = self.assembly.unknowns.restrict(self.x0)
        at = (begin, self.rotations) if at is None else at
        prepared = self.assembly.prepare(self.loads, members)
        problem = StaticProblem(self.assembly, prepared, members, begin, self.damping)
        method = engine(members) if method is None else method
        return method(problem, at, self.atol, self.rtol if rtol is None else rtol, self.limit, growing)

    def stiffened(self, direct, most):
        """Continuation in the stiffness of lines; without any the `direct` solve goes on itself."""
        stages = continuation_stages(self.groups, direct.external)
        if not stages:
            direct.run(most)
            return [], direct.iterations
        solves, at, spent = [], None, direct.iterations
        for members in (*stages, self.groups):
            left = max(most - spent, 0)
            soft = members is not self.groups
            solve = self.newton(members, at, max(self.rtol, SOFT_RTOL) if soft else None)
            solve.run(min(SOFT_ITERATIONS, left) if soft else left)
            spent += solve.iterations
            at = solve.at
            solves.append(solve)
        return solves, spent

    def begun_anew(self, best, spent, most):
        """From the shape of least energy of chains, else from the `best` shape so far."""
        pulling = [group.only_pulling() for group in self.groups]
        if pulling and None not in pulling:
            return self._by_energy(pulling, spent, most)
        solve = self.newton(self.groups, best.at, growing=True)
        solve.run(most - spent)
        return [solve], spent + solve.iterations

    def _by_energy(self, pulling, spent, most):
        """From the shape of least energy of the elements as if they could only pull; where some can push, half of the
        way goes downhill in energy: they have many equilibria, and Newton's method may circle between these.
        """
        shape = ConvexShape(self.assembly, self.loads, self.x0, pulling)
        spent += shape.iterations
        solve = self.newton(self.groups, (self.assembly.unknowns.restrict(shape.x), self.rotations), growing=True)
        left, pushing = max(most - spent, 0), any(group.two_way.any() for group in pulling)
        solve.run(left // 2 if pushing else left)
        spent += solve.iterations
        if not pushing or solve.status not in SLOW:
            return [solve], spent
        from .energy import EnergyNewton  # not loaded where Newton's method does

        downhill = self.newton(self.groups, solve.at, method=EnergyNewton)
        downhill.run(max(most - spent, 0))
        return [solve, downhill], spent + downhill.iterations


def damping_of(assembly, damping):
    """Of each unknown (q,) `damping` N/m for positions, as often as a dof has images, and none for rotations; None for
    none at all.
    """
    unknowns = assembly.unknowns
    return np.where(unknowns.rotational, 0.0, damping * unknowns.shares) if damping else None


def _step_limit(nodes):
    """Largest step m of a node of a structure with these nodes (n,3) m."""
    return max(METRE, PART_OF_SIZE * float(np.ptp(nodes, axis=0).max())) if len(nodes) else METRE


def _budget(assembly):
    """Newton iterations that a solve may take in all."""
    return BEGIN_ANEW + min(max(PER_NODE * assembly.unknowns.count // 3, FEWEST), MOST)


def engine(groups):
    """The Newton's method that suits the elements: one that watches the energy where some of them wrinkle."""
    if not any(group.wrinkles for group in groups):
        return Newton
    from .energy import EnergyNewton

    return EnergyNewton


def continuation_stages(groups, load):
    """The groups with lines and ropes that are softer than they are by degrees, the softest first; none without load.

    A soft line has a spring in series, k' = k P / (P + k l0), P the load N that stretches that spring by l0.
    """
    largest = max((group.softenable() for group in groups), default=0.0)
    stages = []
    spring = SOFT * max(load, SMALLEST_LOAD * largest)
    while 0.0 < load < float("inf") and spring < largest:
        stages.append(tuple(group.softened(spring) for group in groups))
        spring *= STIFFENING
    return stages


class LoadSensitivity:
    """Derivative of the positions of an equilibrium with respect to its loads.

    r(q, f) = f_int(q) - f_ext(q, f) = 0 at every load, so that K dq = (df_ext/df) df with the consistent tangent K of
    elements, links and follower loads. `x` (n,3) m and `rotations` (r,3,3) are the equilibrium, found by
    `equilibrium`, with the same `damping`; `reaction` (r,3) N m are the reactions of fixed rotations, which stiffen
    their other axes.
    No shift, softening or damping is in it, but where K is exactly singular: directions without any stiffness then
    get (nearly) no displacement, as in the steps of the solver.
    """

    def __init__(self, assembly, loads, x, groups=None, rotations=None, reaction=None, damping=0.0):
        self._assembly, self._x, self._rotations = assembly, x, rotations
        if reaction is not None:
            loads = replace(loads, moment=reaction if loads.moment is None else loads.moment + reaction)
        prepared = assembly.prepare(loads, groups)
        _, k, _ = assembly.residual_and_tangent(assembly.unknowns.restrict(x), prepared, rotations)
        self._factors = None
        if not k.shape[0]:
            return
        if (pulling := damping_of(assembly, damping)) is not None:
            k = shifted(k, assembly.diagonal, pulling)
        try:
            self._factors = factorised(k, ACCURATE_PIVOT)
        except Singular:
            diagonal = np.abs(k.data[assembly.diagonal])
            shift = SHIFT * np.maximum(diagonal, diagonal.mean() or 1.0)
            self._factors = factorised(shifted(k, assembly.diagonal, shift), ACCURATE_PIVOT)

    def __call__(self, change):
        """Displacements (n,3) m of the nodes for a small change of the loads, a `Loads` of these changes.

        Where the assembly solves one half, the change has to be mirror-symmetric.
        """
        if self._factors is None:
            return np.zeros_like(self._x)
        force = self._assembly.load_forces(self._x, change, self._rotations)
        return self._assembly.displacements(self._factors.solve(force), self._rotations)
