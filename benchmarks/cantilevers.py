"""Cantilevers of beams along a straight line or an arc, and the closed form of their large deflections in a plane."""

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from structural import Assembly, Beams, Loads, Structure, equilibrium, reference_axes


def cantilever(nodes, section, across=None):
    """Beams along the `nodes` (n,3), clamped at the first; n next to `across` (3,) where it is given."""
    n = len(nodes)
    ends = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    l0 = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    fixed = np.zeros((n, 3), dtype=bool)
    fixed[0] = True
    beams = Beams(ends, ends, reference_axes(nodes, ends, across), l0, section)
    return Structure(nodes, fixed, (beams,), rotation_nodes=np.arange(n), fixed_rotations=fixed.copy())


def straight(count, length=1.0):
    """Nodes (count + 1, 3) m along x."""
    nodes = np.zeros((count + 1, 3))
    nodes[:, 0] = np.linspace(0.0, length, count + 1)
    return nodes


def arc(count, radius=100.0, angle=0.25 * np.pi):
    """Nodes (count + 1, 3) m of a circular arc in the plane z = 0 that leaves the origin along x."""
    phi = np.linspace(0.0, angle, count + 1)
    return radius * np.column_stack([np.sin(phi), 1.0 - np.cos(phi), 0.0 * phi])


def tip_loaded(structure, force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), steps=1, **how):
    """Equilibrium under dead load N and moment N m at the last node, raised in equal `steps`; `how` as for it."""
    assembly = Assembly(structure)
    dead, moments = np.zeros_like(structure.nodes), np.zeros((len(structure.rotation_nodes), 3))
    dead[-1], moments[-1] = force, moment
    x, rotations = structure.nodes, None
    for k in range(1, steps + 1):
        loads = Loads(k / steps * dead, moment=k / steps * moments)
        found = equilibrium(assembly, loads, x, **how, rotations=rotations)
        x, rotations = found.x, found.rotations
    return found


def elastica(load):
    """Tip deflection w / L, shortening u / L and angle rad of an inextensible cantilever, load = P L^2 / EI.

    From elliptic integrals: with k^2 = (1 + sin theta) / 2 and sin phi = 1 / (k sqrt 2), sqrt(load) = K(k) - F(phi, k),
    w = 1 - 2 (E(k) - E(phi, k)) / sqrt(load) and u = 1 - sqrt(2 sin(theta) / load) (Mattiasson 1981 tabulates them).
    """

    def integrals(theta):
        m = 0.5 * (1.0 + np.sin(theta))
        return m, np.arcsin(1.0 / np.sqrt(2.0 * m))

    def gap(theta):
        m, phi = integrals(theta)
        return ellipk(m) - ellipkinc(phi, m) - np.sqrt(load)

    theta = brentq(gap, 1e-9, 0.5 * np.pi - 1e-9, xtol=1e-15, rtol=1e-14)
    m, phi = integrals(theta)
    w = 1.0 - 2.0 / np.sqrt(load) * (ellipe(m) - ellipeinc(phi, m))
    return np.array([w, 1.0 - np.sqrt(2.0 * np.sin(theta) / load), theta])
