"""Saddle nets from 13 to 1861 nodes: time of the structural solver, with springs that may push and with lines."""

import contextlib
import functools
from importlib.util import find_spec

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from structural import Assembly, Loads, equilibrium
from structural.solve import linear as solvers

from .nets import saddle
from .registry import Case, Curve, Fit, Outcome

TOLERANCE = 1e-8  # N
NETS = {
    "one linear solve, rest length 0": None,
    "rest length 0": (0.0, True),
    "two-way, 0.5": (0.5, True),
    "tension-only, 0.5": (0.5, False),
    "two-way, 0.9": (0.9, True),
    "tension-only, 0.9": (0.9, False),
}
# From how many unknowns PARDISO is taken: never, always.
SOLVERS = {"SuperLU": np.inf} | ({"PARDISO": 0} if find_spec("pypardiso") else {})


def linear(s):
    """Positions of a net of zero rest length by one sparse solve of its Laplacian: the exact equilibrium."""
    a, b = s.groups[0].nodes.T
    n, k, free = len(s.nodes), s.groups[0].k, ~s.fixed[:, 0]
    pull = sp.coo_array((np.concatenate([k, k]), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(n, n))
    laplace = sp.csr_array(sp.diags_array(np.asarray(pull.sum(axis=1))) - pull)
    x = s.nodes.copy()
    part = laplace[free]
    matrix = sp.csc_array(part[:, free])
    factors = spla.splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    x[free] = factors.solve(-(part[:, ~free] @ s.nodes[~free]))
    return x


@functools.cache
def net(series, g):
    """The net of a series, made once."""
    return saddle(g, *(NETS[series] or (0.0, True)))


@contextlib.contextmanager
def net_in_equilibrium(series, g):
    """Assembly and solve from the start of the thesis; the answer is the out-of-balance force."""
    s = net(series, g)
    loads = Loads(np.zeros_like(s.nodes))

    checked = Assembly(s)

    def direct():
        q = checked.unknowns.restrict(linear(s))
        left, _ = checked.residual(q, checked.prepare(loads))
        return Outcome(checked.unknowns.norm(left), columns(checked, 0))

    def newton():
        assembly = Assembly(s)
        result = equilibrium(assembly, loads, s.nodes, atol=TOLERANCE)
        return Outcome(result.residual, columns(assembly, result.iterations), result.status)

    def columns(assembly, iterations):
        return {"nodes": len(s.nodes), "unknowns": assembly.unknowns.count, "newton_iterations": iterations}

    yield direct if NETS[series] is None else newton


@contextlib.contextmanager
def solved_by(series, g):
    """The net with lines at half the initial length in equilibrium, all factors by one direct solver."""
    kept, solvers.LARGE = solvers.LARGE, SOLVERS[series]
    try:
        with net_in_equilibrium("tension-only, 0.5", g) as work:
            yield work
    finally:
        solvers.LARGE = kept


ENTRIES = (
    Case(
        name="saddle.nodes",
        title="Saddle net, assembly and equilibrium from the flat start: time over nodes",
        knob="g",
        values=(3, 5, 7, 9, 11, 13, 19, 25, 31),
        quick=(3, 5, 7),
        error="out-of-balance force",
        unit="N",
        reference="equilibrium: no force is out of balance",
        prepare=net_in_equilibrium,
        truth=lambda series, g: 0.0,
        bound=TOLERANCE,
        series=tuple(NETS),
        repeats=5,
        plot=Curve("nodes", "time_s"),
        fit=Fit("nodes", "time_s", "time ~ nodes", least=200.0),
        labels={"nodes": "nodes", "unknowns": "unknowns", "newton_iterations": "Newton iterations"},
        note="Rest length as a fraction of the initial length, springs of 10 N/m, g² + (g − 1)² nodes (LEI thesis "
        "5.4.1). With rest length 0 the problem is linear: one sparse solve is exact, without assembly of a tangent. "
        "Peers, g = 13: kite_fem 9.24 s and 921 iterations at 0.5, not converged in 3000 at 0.9 (13 to 28 s); PSM of "
        "the thesis 8.1 s at rest length 0.",
    ),
    Case(
        name="saddle.large",
        title="Large saddle nets, assembly and equilibrium from the flat start: time over nodes",
        knob="g",
        values=(51, 75, 101),
        quick=(51,),
        error="out-of-balance force",
        unit="N",
        reference="equilibrium: no force is out of balance",
        prepare=net_in_equilibrium,
        truth=lambda series, g: 0.0,
        bound=TOLERANCE,
        series=("two-way, 0.5", "tension-only, 0.5"),
        repeats=2,
        plot=Curve("nodes", "time_s"),
        fit=Fit("nodes", "time_s", "time ~ nodes"),
        labels={"nodes": "nodes", "unknowns": "unknowns", "newton_iterations": "Newton iterations"},
        note="The nets of `saddle.nodes` up to 20201 nodes. Rest length 0.9 is left out, because these nets wrinkle: "
        "with 20201 nodes the tension-only one takes 137 Newton iterations, the two-way one does not converge within "
        "600.",
    ),
    Case(
        name="saddle.solvers",
        title="Direct solvers on saddle nets, assembly and equilibrium from the flat start: time over nodes",
        knob="g",
        values=(7, 13, 25, 41, 51, 75, 101),
        quick=(7, 13),
        error="out-of-balance force",
        unit="N",
        reference="equilibrium: no force is out of balance",
        prepare=solved_by,
        truth=lambda series, g: 0.0,
        bound=TOLERANCE,
        series=tuple(SOLVERS),
        repeats=5,
        ratio_to="SuperLU",
        plot=Curve("nodes", "time_s"),
        fit=Fit("nodes", "time_s", "time ~ nodes", least=1000.0),
        labels={"nodes": "nodes", "unknowns": "unknowns", "newton_iterations": "Newton iterations"},
        note="Tension-only nets with lines at 0.5 of their initial length. PARDISO is measured where the extra "
        "`pardiso` is installed; here on one thread, as SuperLU. Solves take it from 15000 unknowns on.",
    ),
)
