"""Particle systems with closed forms, for the tests of motion."""

import numpy as np

from structural import Assembly, Chains, Legs, Loads, Structure
from structural.dynamics import Motion


def particles(nodes, fixed, chains, dead=None, mass=1.0, wind=None, diameter=None):
    """Motion of particles at `nodes` (n,3) with dead loads (n,3) N; `fixed` node numbers; wind on all two-node legs."""
    nodes = np.asarray(nodes, float)
    held = np.zeros(nodes.shape, dtype=bool)
    held[list(fixed)] = True
    legs = {} if diameter is None else {"legs": Legs(chains[0].nodes, np.full(len(chains[0].l0), diameter))}
    assembly = Assembly(Structure(nodes, held, tuple(chains), legs))
    loads = Loads(np.zeros(nodes.shape) if dead is None else dead, {} if wind is None else {"legs": wind})
    return Motion(assembly, np.broadcast_to(mass, len(nodes)), loads, tuple(chains)), nodes


def row(n, k, l0, c=None, two_way=True):
    """n - 1 elements between n nodes that follow one another."""
    e, links = n - 1, np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    damping = None if c is None else np.full(e, c)
    return (Chains(links, np.full(e, l0), np.full(e, k), np.full(e, two_way), (), damping),)


def oscillator(k=100.0, m=1.0, c=None):
    """A particle at 1 m on a spring of no rest length: x'' + (c/m) x' + (k/m) x = 0."""
    return particles([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0], row(2, k, 0.0, c), mass=m)


def oscillation(t, k=100.0, m=1.0, c=0.0):
    """Position m of the oscillator that starts at 1 m and rest: with gamma = c / 2m and w0^2 = k / m."""
    gamma, w2 = 0.5 * c / m, k / m - (0.5 * c / m) ** 2
    if w2 > 0.0:
        w = np.sqrt(w2)
        return np.exp(-gamma * t) * (np.cos(w * t) + gamma / w * np.sin(w * t))
    if w2 == 0.0:
        return np.exp(-gamma * t) * (1.0 + gamma * t)
    w = np.sqrt(-w2)
    return np.exp(-gamma * t) * (np.cosh(w * t) + gamma / w * np.sinh(w * t))
