"""Whether static equilibrium is found: hundreds of random structures that have one, judged by a force balance apart."""

import collections
import warnings

import numpy as np

from structural import Assembly, Beams, Chains, LinearSection, Loads, Structure, equilibrium, reference_axes

from .elastica import cantilever, tip
from .force_balance import out_of_balance
from .random_networks import random_network
from .registry import Table
from .text import lines, table

SEEDS = 60
ATOL = 1e-6  # N
# EA h^2 / EI of the beams; and what 20 elements or more may miss of the place of the tip, in parts of the length.
EXTENSION, BENT = 1e3, 1e-3
TITLES = {
    "net": "lines and ropes, 1 to 1e4 m",
    "large": "lines and ropes, 3 to 30 km",
    "built": "lines and ropes, equilibrium by construction",
    "cable": "cables of 60 to 500 short elements",
    "springs": "half of the lines may push",
    "beams": "cantilevers of 1 to 1e4 m",
}


def solved(network):
    """The equilibrium that the solver finds for a network."""
    groups = tuple(Chains(m.nodes, m.l0, m.k, m.two_way) for m in network.members)
    structure = Structure(network.nodes, np.repeat(network.held[:, None], 3, axis=1), groups)
    return equilibrium(Assembly(structure), Loads(network.loads), network.start, ATOL)


def judged(network, found):
    """ "right" if the positions balance to the tolerance and rounding, "wrong" if they do not but were said to, else
    "honest": the status says that none was found.
    """
    left, rounding = out_of_balance(network, found.x)
    if found.converged:
        # forces that a solver sees are rounded as much as the positions that it gives are
        return "right" if left <= ATOL + 2.0 * rounding else "wrong"
    return "honest"


def bent(beam):
    """The equilibrium that the solver finds for a cantilever, of hardly any extension."""
    n, h = beam.elements, beam.length / beam.elements
    nodes = np.linspace(0.0, beam.length, n + 1)[:, None] * beam.axis
    ends = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    section = LinearSection.of(n, EXTENSION * beam.EI / h**2, beam.EI, beam.EI)
    beams = Beams(ends, ends, reference_axes(nodes, ends), np.full(n, h), section)
    clamped = np.repeat(np.arange(n + 1)[:, None] == 0, 3, axis=1)
    structure = Structure(nodes, clamped, (beams,), {}, np.arange(n + 1), clamped)
    loads = np.zeros_like(nodes)
    loads[-1] = beam.P * beam.across
    return equilibrium(Assembly(structure), Loads(loads), nodes, 1e-9 * beam.P)


def bent_rightly(beam, found):
    """As `judged`, by the place of the tip."""
    if not found.converged:
        return "honest"
    return "right" if np.linalg.norm(found.x[-1] - tip(beam)) <= BENT * beam.length else "wrong"


def verdicts(kind, seeds):
    """Verdicts on the structures of a kind, counted, and Newton iterations; a warning is an exception."""
    counted, iterations = collections.Counter(), []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for seed in seeds:
            beams = kind == "beams"
            given = cantilever(seed) if beams else random_network(kind, seed)
            found = bent(given) if beams else solved(given)
            counted[bent_rightly(given, found) if beams else judged(given, found)] += 1
            iterations.append(found.iterations)
    return counted, iterations


def random(quick):
    """How solves of random structures end."""
    rows = []
    for kind in TITLES:
        counted, iterations = verdicts(kind, range(5 if quick else SEEDS))
        share = f"{100.0 * counted['right'] / counted.total():.0f} %"
        row = [TITLES[kind], counted.total(), counted["right"], share, counted["honest"], counted["wrong"]]
        rows.append([*row, *(f"{q:.0f}" for q in np.quantile(iterations, (0.5, 0.95)))])
    head = ["structures", "tried", "converged", "share", "without success, and said so", "wrong"]
    told = (
        "5 to 500 elements, stiffnesses EA up to 15 decades apart, loads of 0.01 N to 10 MN, starts up to the size of "
        f"the structure away. Asked for are {ATOL:g} N or what rounding leaves; judged in extended precision from the "
        "positions alone, cantilevers by Euler's elastica. All have an equilibrium; where springs may push it is one "
        "of many, at the ends of narrow curved valleys."
    )
    return lines(table([*head, "median iterations", "95 % below"], rows), told)


ENTRIES = (Table(name="structure.random", title="Static equilibrium of random structures", build=random),)
