"""Particle systems of the PSM thesis: its validation cases and the three cases of its benchmark."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from structural import Assembly, Chains, Legs, Loads, Structure, Wind

from .nets import saddle

G = 9.807  # m/s^2, table A.1
# Validation 3 (section 7.4, table A.1); diameter and modulus are not given: these reproduce k_S = 2933.3 N/m.
LENGTH, DIAMETER, MODULUS, DRAG, SPEED, AIR = 300.0, 0.004, 70e9, 1.22, 6.0, 1.225


@dataclass(frozen=True, eq=False)
class System:
    """A particle system: `assembly`, `groups` of elements, `loads`, positions `x` (n,3) m to start from, masses (n,)
    kg.
    """

    assembly: Assembly
    groups: tuple[Chains, ...]
    loads: Loads
    x: np.ndarray
    mass: np.ndarray


def row(x, k, l0, c=0.0, two_way=True, dead=None, wind=None, mass=1.0, free_end=False):
    """Particles at x (n,3) m, each tied to the next by a spring of k N/m and l0 m with a damper of c N s/m.

    The ends are fixed, or the first only with a `free_end`; `wind` blows on all springs, DIAMETER thick.
    """
    n = len(x)
    fixed = np.zeros((n, 3), dtype=bool)
    fixed[[0] if free_end else [0, -1]] = True
    links, e = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1), n - 1
    full = [np.broadcast_to(np.asarray(v), e).copy() for v in (float(l0), float(k), two_way)]
    chains = (Chains(links, *full, (), np.full(e, float(c))),)
    s = Structure(x, fixed, chains, {} if wind is None else {"legs": Legs(links, np.full(e, DIAMETER))})
    loads = Loads(np.zeros((n, 3)) if dead is None else dead, {} if wind is None else {"legs": wind})
    return System(Assembly(s), chains, loads, x, np.broadcast_to(mass, n))


def straight(n, span, axis=0):
    """n points (n,3) m at equal distances along an axis."""
    x = np.zeros((n, 3))
    x[:, axis] = np.linspace(0.0, span, n)
    return x


def hanging(n, k, c, two_way=True):
    """b2: 10 m of tether over a span of 8 m under gravity, 1 kg a particle; each spring has k (thesis section 8.2)."""
    weight = np.tile([0.0, 0.0, -G], (n, 1))
    return row(straight(n, 8.0), k, 10.0 / (n - 1), c, two_way, dead=weight)


def blown(n, k, c, two_way=True, law="inclined"):
    """b3: 300 m of tether across a wind of 6 m/s without gravity, 1 kg a particle; each spring has k."""
    return row(straight(n, LENGTH, 2), k, LENGTH / (n - 1), c, two_way, wind=wind(law=law))


def wind(factor=1.0, law="inclined"):
    """The wind of validation 3, or with a `factor` on its drag."""
    return Wind(np.array([SPEED, 0.0, 0.0]), AIR, factor * DRAG, 0.0, law)


def net(n, k, c, two_way=True):
    """b4: the self-stressed net of section 6.4 as a saddle of n = 13, 41, 85, 181 particles, rest lengths halved."""
    g = {13: 3, 41: 5, 85: 7, 181: 10}[n]
    s = saddle(g, 0.5, two_way)
    chains = tuple(replace(a, k=np.full(len(a.k), k), c=np.full(len(a.k), c)) for a in s.groups)
    loads = Loads(np.zeros_like(s.nodes))
    return System(Assembly(s), chains, loads, s.nodes.copy(), np.ones(len(s.nodes)))


def elastic_catenary(length, span, weight, stiffness, s):
    """Points (k,2) m, along the span and up, of a cable of `length` m and `weight` N/m per unstretched length with
    EA = `stiffness` N between ends of one height, at unstretched arc lengths s (k,) m (Irvine 1981, section 2.2).
    """

    def place(h, at):
        v = weight * (at - 0.5 * length)
        begin = -0.5 * weight * length
        x = h * at / stiffness + h / weight * (np.arcsinh(v / h) - np.arcsinh(begin / h))
        y = (v**2 - begin**2) / (2.0 * weight * stiffness) + (np.hypot(h, v) - np.hypot(h, begin)) / weight
        return x, y

    w = weight * length
    h = brentq(lambda h: place(h, length)[0] - span, 1e-6 * w, 1e6 * w)
    return np.stack(place(h, np.asarray(s, float)), axis=-1)


def tether_in_wind(factor=1.0, law="inclined", modulus=MODULUS, nodes=201):
    """Deflection m of validation 3 as a continuous elastic cable: a boundary-value problem, independent of particles.

    With the unstretched arc length s, the tension (X, Z) and lambda = 1 + T / EA: dr/ds = lambda t, d(X, Z)/ds =
    -lambda w, t = (X, Z)/T, w the drag per current length. `factor` multiplies the drag, `law` see `structural.Wind`.
    """
    ea = modulus * 0.25 * np.pi * DIAMETER**2
    q = 0.5 * AIR * DIAMETER * factor * DRAG * SPEED**2

    def slope(s, y):
        _, _, tx, tz = y
        t = np.hypot(tx, tz)
        ux, uz, stretch = tx / t, tz / t, 1.0 + t / ea
        if law == "projected":
            load = np.array([q * (1.0 - np.abs(ux)), 0.0 * ux])
        else:  # across: v - (v.u) u, of length |uz| v
            load = np.array([q * np.abs(uz) * (1.0 - ux * ux), -q * np.abs(uz) * ux * uz])
        return np.array([stretch * ux, stretch * uz, -stretch * load[0], -stretch * load[1]])

    def ends(a, b):
        return np.array([a[0], a[1], b[0], b[1] - LENGTH])

    s = np.linspace(0.0, LENGTH, nodes)
    sag, pull = 3.0, q * LENGTH**2 / 24.0
    guess = [4 * sag * s / LENGTH * (1 - s / LENGTH), s, pull * 4 * sag * (1 - 2 * s / LENGTH) / LENGTH, 0 * s + pull]
    found = solve_bvp(slope, ends, s, np.array(guess), tol=1e-9, max_nodes=20_000)
    if not found.success:
        raise RuntimeError(found.message)
    return float(found.sol(0.5 * LENGTH)[0])
