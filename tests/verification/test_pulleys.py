"""Ropes over pulleys: the nested pulleys of LEI thesis 5.4.2, and networks of ropes and lines drawn at random."""

import itertools

import numpy as np
import pytest
from scipy.optimize import brentq

from structural import Assembly, equilibrium
from structural.elements.chains import KNOB
from tests.structural.models import chains, dead, lengths, structure

REST, STIFFNESS = 2.2, 5e4  # m, as in the thesis; N/m, a rope of some 5 mm
NESTED = np.array([[0, 4, 1], [2, 5, 3], [4, 6, 5]])  # (n1, n5, n2), (n3, n6, n4), (n5, n7, n6), counted from 0
ACROSS = np.array([1.0, 0.0, 0.0])


def _nested(force):
    """Positions (7,3) m of the nested pulleys at rest under `force` (3,) N at the lowest one."""
    nodes = np.zeros((7, 3))
    nodes[:, 0] = 0.0, 1.0, 2.0, 3.0, 0.5, 2.5, 1.5
    nodes[4:, 1] = -1.0, -1.0, -1.5
    s = structure(nodes, np.arange(7) < 4, [chains(NESTED, REST, STIFFNESS)])
    loads = np.zeros((7, 3))
    loads[6] = force
    # every tension is at least a quarter of the force: 1e-10 of it turns no leg by more than 1e-9 rad
    result = equilibrium(Assembly(s), dead(loads), nodes, atol=1e-10 * float(np.linalg.norm(force)))
    assert result.converged, result.status
    return result.x


def _angle(a, b):
    """Angle between two vectors, rad, exact also where it is small."""
    return np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)


def _pull(x, rope):
    return STIFFNESS * (np.linalg.norm(np.diff(x[rope], axis=0), axis=1).sum() - REST)


def _forces():
    """The force of the thesis, 15 degrees from the y axis, and random ones of 1 N to 10 kN, all round the ropes."""
    tilt = np.radians(15.0)
    yield 100.0 * np.array([np.sin(tilt), -np.cos(tilt), 0.0])
    for seed in range(50):
        rng = np.random.default_rng(seed)
        # a sheave runs onto the end of its rope only for forces along the line of the supports: stay 20 degrees off
        tilt, round_ = np.radians(rng.uniform(-70.0, 70.0)), rng.uniform(0.0, 2.0 * np.pi)
        across = np.array([0.0, np.cos(round_), np.sin(round_)])
        yield 10.0 ** rng.uniform(0.0, 4.0) * (np.sin(tilt) * ACROSS + np.cos(tilt) * across)


FORCES = list(_forces())


def _sheave_on_ellipse(foci, pull, direction):
    """Where a sheave rests that is pulled with `pull` N along the unit vector `direction`, in the plane of the foci.

    Its rope of length L, ends at the foci, keeps it on an ellipse with a = L / 2 and c half the focal distance. The
    normal there is the direction of the pull and halves the angle 2 alpha of the legs: sin alpha = c m / a, m the
    direction's component across the line of the foci, and the tension is T = k (L - l0) with 2 T cos alpha = pull.
    """
    first, second = foci
    c, along = 0.5 * np.linalg.norm(second - first), (second - first) / np.linalg.norm(second - first)
    across = direction - (direction @ along) * along
    shadow = c * np.linalg.norm(across)

    def balance(a):
        return 2.0 * STIFFNESS * (2.0 * a - REST) * np.sqrt(1.0 - (shadow / a) ** 2) - pull

    a = brentq(balance, 0.5 * REST, REST + pull / STIFFNESS, xtol=1e-15, rtol=1e-14)
    axes = a * a * (direction - across) + (a * a - c * c) * across
    return 0.5 * (first + second) + axes / np.sqrt(a * a - shadow * shadow)


def _nested_by_ellipses(force):
    """Positions (7,3) m of the nested pulleys under `force`: one scalar equation, for the angle gamma at node 7.

    The legs leave node 7 at gamma on either side of the force with T = F / (2 cos gamma), which pulls nodes 5 and 6
    along these legs onto points of their ellipses. These must lie as far apart, across the force, as two legs at
    gamma with l0 + T / k between them span.
    """
    x = np.zeros((7, 3))
    x[:4, 0] = 0.0, 1.0, 2.0, 3.0
    size = np.linalg.norm(force)
    down = force / size
    side = ACROSS - (ACROSS @ down) * down
    side /= np.linalg.norm(side)

    def hung(gamma):
        pull = 0.5 * size / np.cos(gamma)
        inward = np.sin(gamma) * side
        x[4] = _sheave_on_ellipse(x[0:2], pull, np.cos(gamma) * down + inward)
        x[5] = _sheave_on_ellipse(x[2:4], pull, np.cos(gamma) * down - inward)
        return REST + pull / STIFFNESS

    def gap(gamma):
        length = hung(gamma)
        return (x[5] - x[4]) @ side - length * np.sin(gamma)

    gamma = brentq(gap, 0.0, 0.5 * np.pi - 1e-6, xtol=1e-15, rtol=1e-14)
    length = hung(gamma)
    # the legs end at different depths d below node 7 along the force: (d5 + d6) / cos gamma = length
    depth = 0.5 * (length * np.cos(gamma) + (x[5] - x[4]) @ down)
    x[6] = x[4] + depth * (down + np.tan(gamma) * side)
    return x


def test_every_nested_pulley_turns_its_legs_to_equal_angles_with_the_force_on_it():
    for force in FORCES:
        x = _nested(force)
        t = [_pull(x, rope) for rope in NESTED]
        assert min(t) > 0.25 * np.linalg.norm(force)  # all ropes carry, 0.25 seen and more
        for rope, pull in zip(NESTED, t, strict=True):
            before, sheave, after = x[rope]
            # the nested rope ends at sheaves 5 and 6: its leg is what pulls them
            on_it = force if rope[1] == 6 else t[2] * (x[6] - sheave) / np.linalg.norm(x[6] - sheave)
            first, second = _angle(before - sheave, -on_it), _angle(after - sheave, -on_it)
            assert first == pytest.approx(second, abs=1e-8)  # rad; rounding of 5e4 N/m x 2 m is 2e-10 of 1 N
            assert 2.0 * pull * np.cos(first) == pytest.approx(np.linalg.norm(on_it), rel=1e-8)  # the same rounding


def test_nested_pulleys_rest_on_the_ellipses_of_their_ropes():
    for force in FORCES:
        # swinging has about F / l of stiffness: 1e-10 F are 1e-10 m, rounding of 5e4 N/m x 2 m is 2e-10 of 1 N
        assert np.abs(_nested(force) - _nested_by_ellipses(force)).max() <= 1e-9, force


def _network(seed):
    """A random network of lines and ropes with dead forces on its nodes: structure, forces (n,3) N, start (n,3) m.

    Each free node is tied, by a line or as a sheave, to nodes that are tied to a support. So no node can go far without
    a member that grows with it, and the energy, convex and quadratic in the stretches, has a minimum: an equilibrium.
    """
    rng = np.random.default_rng(seed)
    anchors, free = rng.integers(3, 7), rng.integers(2, 9)
    n = anchors + free
    nodes = rng.uniform([-2.0, -2.0, 0.0], [2.0, 2.0, 1.0], (n, 3))
    nodes[anchors:, 2] -= rng.uniform(0.5, 4.0)
    rows = {2: [], 3: [], 4: [], 5: []}
    tied = list(range(anchors))
    waiting = list(range(anchors, n))
    while waiting:
        sheaves = min(int(rng.integers(0, 4)), len(waiting))
        inner, waiting = waiting[: max(sheaves, 1)], waiting[max(sheaves, 1) :]
        if sheaves:  # the ends may be supports or earlier sheaves: nested
            first, last = rng.choice(tied, 2, replace=False)
            rows[sheaves + 2].append([first, *inner, last])
        else:
            rows[2].append([rng.choice(tied), inner[0]])
        tied += inner
    for _ in range(rng.integers(0, n)):  # more members, which may compete with the first
        size = int(rng.choice([2, 2, 3, 4]))
        row = rng.choice(n, size, replace=False)
        if np.any(row[1:-1] >= anchors) or size == 2:
            rows[size].append(list(row))
    softest = rng.uniform(2.0, 5.0)
    groups = []
    for of in rows.values():
        if of:
            l0 = lengths(nodes, np.array(of)) * 10.0 ** rng.uniform(-0.5, 0.4, len(of))  # taut by far, slack by far
            groups.append(chains(np.array(of), l0, 10.0 ** rng.uniform(softest, softest + 1.5, len(of))))
    force = 10.0 ** rng.uniform(-1.0, 3.0) * rng.normal(size=(n, 3))
    force[rng.random(n) < 0.3] = 0.0  # nodes on which nothing pulls but their ropes
    return structure(nodes, np.arange(n) < anchors, groups), force


def _out_of_balance(s, x, force):
    """Force N left on the free nodes, (n,3): dead forces and, leg by leg, the pull of every line and rope."""
    left = force.copy()
    for group in s.groups:
        for nodes, l0, k in zip(group.nodes, group.l0, group.k, strict=True):
            # a rope has knobs, a line has none: shorter legs pull less and are (l^2 / knob + knob) / 2 long
            knob = KNOB * l0 if len(nodes) > 2 else 0.0
            legs = [x[b] - x[a] for a, b in itertools.pairwise(nodes)]
            long = [float(np.sqrt(d @ d)) for d in legs]
            length = sum(l if l >= knob else 0.5 * (l * l / knob + knob) for l in long)
            tension = k * max(length - l0, 0.0)
            for a, b, d, l in zip(nodes[:-1], nodes[1:], legs, long, strict=True):
                pull = tension * d / max(l, knob, 1e-300)
                left[a] += pull
                left[b] -= pull
    return left[~s.fixed[:, 0]]


def test_two_hundred_random_networks_of_ropes_and_lines_come_to_rest():
    slack = jammed = 0
    for seed in range(200):
        s, force = _network(seed)
        result = equilibrium(Assembly(s), dead(force), s.nodes)
        assert result.converged, (seed, result.status, result.residual)
        # what the solver promises is 1e-6 N; rounding of up to 3e6 N/m x 20 m adds some 1e-8 N to either sum
        assert np.linalg.norm(_out_of_balance(s, result.x, force)) <= 1.1e-6, seed
        slack += any(np.any(lengths(result.x, c.nodes) < c.l0) for c in s.groups)
        jammed += any(
            np.any(np.linalg.norm(np.diff(result.x[c.nodes], axis=1), axis=2) < KNOB * c.l0[:, None])
            for c in s.groups
            if c.nodes.shape[1] > 2
        )
    assert min(slack, jammed) >= 20  # both kinds are common, so both are tested
