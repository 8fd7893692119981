"""Rows of particles with bending springs: strips of EI against closed forms of beams."""

import numpy as np
import pytest

from benchmarks.cantilevers import elastica
from structural import (
    Assembly,
    BendingSprings,
    Chains,
    Loads,
    Structure,
    bending_energy,
    equilibrium,
    quad_rows,
    row_bending,
)
from structural.elements.bending import bending_forces, bending_forces_and_tangents, triple_bending

from .models import TANGENT_TOLERANCE, central_difference

EI, EA = 1.0, 1e6  # N m^2, N, of a strip of 1 m
ROUNDING = 2e-8  # N, of coordinates of 1 m (1e-16) times EA over a segment (3e7 N/m), a few times


def turned(x):
    """x after a rotation about an oblique axis by 2 rad, and a shift."""
    axis = np.array([1.0, 2.0, -0.5]) / np.sqrt(5.25)
    w = np.cross(np.eye(3), axis)
    rotation = np.eye(3) + np.sin(2.0) * w + (1.0 - np.cos(2.0)) * w @ w
    return x @ rotation.T + np.array([0.3, -0.2, 5.0])


def springs(x, links):
    """Two-way springs of EA that are at rest in x."""
    l0 = np.linalg.norm(x[links[:, 1]] - x[links[:, 0]], axis=1)
    return Chains(links, l0, EA / l0, np.ones(len(links), dtype=bool))


def strip(count, load):
    """Equilibrium of a cantilever of 1 m in `count` segments under a tip load N along z.

    Clamped by two particles, one before the root and one at it: the bend at the root is that of half a segment, as the
    other half of it lies in the wall, so its spring is twice as stiff.
    """
    h = 1.0 / count
    x = np.zeros((count + 2, 3))
    x[:, 0] = h * (np.arange(count + 2) - 1.0)
    n = len(x)
    links = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    fixed = np.zeros((n, 3), dtype=bool)
    fixed[:2] = True
    fixed[:, 1] = True
    rows = row_bending(np.arange(n), x, EI)
    k = np.where(np.arange(count) == 0, 2.0, 1.0) * rows.k
    rows = BendingSprings(rows.nodes, rows.arms, k, rows.rest)
    chains = (springs(x, links),)
    s = Structure(x, fixed, (*chains, rows))
    dead = np.zeros((n, 3))
    dead[-1, 2] = load
    found = equilibrium(Assembly(s), Loads(dead), x, atol=ROUNDING)
    assert found.converged
    return found.x[-1]


def test_a_strip_deflects_as_a_beam_does_with_the_square_of_its_segments():
    # small enough that the elastica is linear: its next term is of relative size (P L^2 / EI)^2
    load = 1e-3
    exact = load / (3.0 * EI)
    errors = [abs(strip(count, load)[2] / exact - 1.0) for count in (4, 8, 16, 32)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.allclose(orders, 2.0, atol=0.05)
    assert errors[-1] < 1e-3


@pytest.mark.parametrize("load", [1.0, 10.0])
def test_a_strip_bends_far_as_the_elastica_does(load):
    w, u, _ = elastica(load)
    errors = []
    for count in (10, 20, 40):
        tip = strip(count, load)
        errors.append(np.hypot(tip[2] - w, 1.0 - tip[0] - u))
    # of second order; EA = 1e6 EI / L^2 leaves 1e-5 of stretch
    assert np.allclose(np.log2(np.array(errors[:-1]) / np.array(errors[1:])), 2.0, atol=0.15)
    assert errors[-1] < 1e-3


def test_a_row_bent_to_a_circle_has_the_energy_of_the_beam():
    # EI / 2 R^2 per length; a chord of angle a bends by 2 sin(a/2), so 1 - a^2 / 12, and there are n - 2 bends
    n, radius = 41, 2.0
    phi = np.linspace(0.0, 1.0, n)
    flat = np.zeros((n, 3))
    flat[:, 0] = 2.0 * radius * np.sin(0.5 * phi[1]) * np.arange(n)
    rows = row_bending(np.arange(n), flat, EI)
    bent = radius * np.column_stack([np.sin(phi), 0.0 * phi, 1.0 - np.cos(phi)])
    length = (n - 2) * flat[1, 0]
    assert bending_energy(bent, rows) == pytest.approx(0.5 * EI / radius**2 * length, rel=1e-4)


@pytest.mark.parametrize("curved", [False, True])
def test_a_rigid_motion_makes_no_force(curved):
    rng = np.random.default_rng(1)
    x = np.column_stack([np.arange(6.0), np.zeros(6), np.zeros(6)])
    if curved:
        x = x + 0.3 * rng.standard_normal(x.shape)
    rows = row_bending(np.arange(6), x, 100.0)
    # rounding of coordinates of 10 m over arms of 1 m, times 100 N m
    assert np.abs(bending_forces(turned(x), rows)).max() < 1e-11
    assert bending_energy(turned(x), rows) < 1e-20


def test_forces_of_a_bent_row_have_neither_sum_nor_moment_and_turn_with_it():
    rng = np.random.default_rng(2)
    rest = np.cumsum(np.abs(rng.standard_normal((7, 3))) + 0.2, axis=0)
    rows = row_bending(np.arange(7), rest, 10.0)
    x = rest + 0.2 * rng.standard_normal(rest.shape)
    f, total = bending_forces(x, rows), np.zeros_like(x)
    np.add.at(total, rows.nodes, f)
    assert np.abs(total.sum(axis=0)).max() < 1e-12
    moved = np.zeros_like(x)
    np.add.at(moved, rows.nodes, bending_forces(turned(x), rows))
    assert np.allclose(turned(total) - turned(0.0 * total), moved, atol=1e-11)
    # the energy does not change in a rotation, so its gradient has no moment, however stretched the arms are
    assert np.abs(np.cross(x, total).sum(axis=0)).max() < 1e-11


@pytest.mark.parametrize("curved", [False, True])
def test_tangent_is_the_derivative_of_the_forces_and_these_of_the_energy(curved):
    rng = np.random.default_rng(3)
    rest = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    rest = rest + (0.3 * rng.standard_normal(rest.shape) if curved else 0.0)
    rows = row_bending(np.arange(5), rest, np.array([3.0, 5.0, 7.0]))
    x = rest + 0.2 * rng.standard_normal(rest.shape)

    def forces(y):
        f = np.zeros_like(y)
        np.add.at(f, rows.nodes, bending_forces(y, rows))
        return f

    slope = central_difference(lambda y: bending_energy(y, rows), x)
    assert np.allclose(slope.ravel(), forces(x).ravel(), atol=1e-7)
    f, k = bending_forces_and_tangents(x, rows)
    assert np.array_equal(f, bending_forces(x, rows))
    whole = np.zeros((15, 15))
    for nodes, block in zip(rows.nodes, k, strict=True):
        at = (3 * nodes[:, None] + np.arange(3)).ravel()
        whole[np.ix_(at, at)] += block
    assert np.abs(central_difference(forces, x) - whole).max() < TANGENT_TOLERANCE * np.abs(whole).max()


def test_neighbouring_quads_continue_the_edges_they_share():
    # 2 x 2 quads on 3 x 3 nodes: three rows each way, of three nodes
    quads = np.array([[0, 3, 4, 1], [1, 4, 5, 2], [3, 6, 7, 4], [4, 7, 8, 5]])
    found = {tuple(sorted(t)) for t in quad_rows(quads).tolist()}
    assert found == {(0, 1, 2), (3, 4, 5), (6, 7, 8), (0, 3, 6), (1, 4, 7), (2, 5, 8)}
    assert len(quad_rows(quads)) == 6
    middles = {t[1] for t in quad_rows(quads).tolist()}
    assert middles == {1, 3, 4, 5, 7}


def test_a_strip_of_quads_bends_as_its_rows_do_together():
    # a canopy strip two quads wide, clamped by two rows of particles: three rows that bend, each a third of the EI
    count, load = 16, 1e-3
    h, wide = 1.0 / count, 3
    i, j = (a.ravel() for a in np.meshgrid(np.arange(count + 2), np.arange(wide), indexing="ij"))
    x = np.column_stack([h * (i - 1.0), h * j, 0.0 * i])
    a = np.flatnonzero((i <= count) & (j < wide - 1))
    quads = np.stack([a, a + wide, a + wide + 1, a + 1], axis=1)
    triples = quad_rows(quads)
    along = i[triples[:, 0]] != i[triples[:, 1]]
    at_root = along & (i[triples[:, 1]] == 1)
    stiffness = np.where(at_root, 2.0, 1.0) * EI / wide  # see `strip`
    sides = np.concatenate([quads[:, [0, 1]], quads[:, [1, 2]], quads[:, [2, 3]], quads[:, [3, 0]], quads[:, [0, 2]]])
    chains = (springs(x, np.unique(np.sort(sides, axis=1), axis=0)),)
    fixed = np.repeat((i < 2)[:, None], 3, axis=1)
    rows = triple_bending(triples, x, stiffness)
    s = Structure(x, fixed, (*chains, rows))
    dead = np.zeros_like(x)
    dead[-wide:, 2] = load / wide
    found = equilibrium(Assembly(s), Loads(dead), x, atol=ROUNDING)
    assert found.converged
    tip = strip(count, load)[2]
    # an out-of-balance force of ROUNDING over the load is 2e-5 of the deflection
    assert np.ptp(found.x[-wide:, 2]) < 5e-5 * tip  # no twist
    assert found.x[-1, 2] == pytest.approx(tip, rel=5e-5)
