"""Hencky's membrane, a disc under pressure, as a net of springs beside the series of Hencky and Fichter."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, nnls

from structural import Assembly, Chains, FaceLoad, Faces, Loads, Structure, equilibrium

from .particle_models import System

RADIUS = 0.1425  # m, PSM thesis table B.2
# Corner of the square core of a blocked mesh over the radius. The thesis does not say; 0.4 to 0.7 give the same within
# 1.5 %.
CORE = 0.7
# Series (thesis eq. B.9, B.12; Fichter 1997): W = q^(1/3) sum a_2n (1 - rho^(2n+2)), a_2n = A[n] / b0^(3n+1), and the
# condition (1 - nu) b0 = sum B[n] (2n + 3 - nu) / b0^(3n+2) of a clamped edge.
A = (1, 1/2, 5/9, 55/72, 7/6, 205/108, 17051/5292, 2864485/508032, 103863265/10287648, 27047983/1469664,
     42367613873/1244805408)  # fmt: skip
B = (1, 2/3, 13/18, 17/18, 37/27, 1205/567, 219241/63504, 6634069/1143072, 51523763/5143824,
     998796305/56582064)  # fmt: skip


def clamped_edge(nu):
    """b0 of the series for a Poisson's ratio: the root of the condition that the edge does not move."""

    def gap(b):
        return (1.0 - nu) * b - sum(f * (2 * n + 3 - nu) / b ** (3 * n + 2) for n, f in enumerate(B))

    return brentq(gap, 1.2, 3.0, xtol=1e-14)


def series(q, nu, rho=0.0):
    """Deflection over radius of Hencky's membrane under q = p a / (E w), at c / a = rho."""
    b = clamped_edge(nu)
    terms = (f / b ** (3 * n + 1) * (1.0 - np.asarray(rho) ** (2 * n + 2)) for n, f in enumerate(A))
    return q ** (1.0 / 3.0) * sum(terms)


def _square(n):
    """Places ((n+1)^2,2) on the square from -1 to 1 with n cells a side, and its quads (n^2,4)."""
    s = np.linspace(-1.0, 1.0, n + 1)
    u, v = (a.ravel() for a in np.meshgrid(s, s, indexing="ij"))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    first = i * (n + 1) + j
    return np.column_stack([u, v]), np.stack([first, first + n + 1, first + n + 2, first + 1], axis=1)


def _blocked(n):
    """A square core of n cells a side with rings of 4 n quads around it, 0.6 n of them."""
    square, quads = _square(n)
    nodes, blocks = [CORE * np.sqrt(0.5) * square], [quads]
    a, rings = np.arange(n), max(1, round(0.6 * n))
    loop = np.concatenate([a * (n + 1), n * (n + 1) + a, (n - a) * (n + 1) + n, n - a])
    angle = 0.5 * np.pi * np.arange(4 * n) / n - 0.75 * np.pi
    inner, circle = nodes[0][loop], np.column_stack([np.cos(angle), np.sin(angle)])
    for ring in range(1, rings + 1):
        now = len(square) + (ring - 1) * 4 * n + np.arange(4 * n)
        nodes.append((1.0 - ring / rings) * inner + ring / rings * circle)
        blocks.append(np.stack([loop, now, np.roll(now, -1), np.roll(loop, -1)], axis=1))
        loop = now
    return np.concatenate(nodes), np.concatenate(blocks)


def disc(n, layout="blocked", turn=0.0):
    """Nodes (m,3) of a unit disc and its quads (p,4), with n cells a side, turned by `turn` rad.

    "blocked": a square core and rings of quads around it; with n = 5 and 10 it has the 96 and 361 particles of the
    thesis. "mapped": the lines of a square become half ellipses, smoothly. "concentric": squares become circles, with
    kinks on the diagonals.
    """
    if layout == "blocked":
        xy, quads = _blocked(n)
    else:
        square, quads = _square(n)
        u, v = square.T
        if layout == "mapped":
            xy = np.column_stack([u * np.sqrt(1.0 - 0.5 * v * v), v * np.sqrt(1.0 - 0.5 * u * u)])
        else:
            size = np.maximum(np.abs(u), np.abs(v))
            away = np.hypot(u, v)
            xy = square * (size / np.where(away > 0.0, away, 1.0))[:, None]
    c, s = np.cos(turn), np.sin(turn)
    return np.column_stack([xy @ np.array([[c, s], [-s, c]]), np.zeros(len(xy))]), quads


def edge_springs(x, quads):
    """Inner edges (e,2) of quads, and the stiffness (e,) of the springs on them over that of the sheet, E w.

    k / E w = H / L with the mean height H and length L of the half quads beside the edge (PSM thesis eq. 7.2, without
    the factor 1/4 before its denominator, whose weights 1/4, 1/2, 1/4 sum to one already).
    """

    def distance(a, b):
        return float(np.linalg.norm(x[a] - x[b]))

    beside: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for quad in quads.tolist():
        for i in range(4):
            before, b, c, after = quad[i - 1], quad[i], quad[(i + 1) % 4], quad[(i + 2) % 4]
            height = 0.5 * (distance(b, before) + distance(c, after))
            beside.setdefault((min(b, c), max(b, c)), []).append((height, distance(before, after)))
    inner = {edge: np.array(both) for edge, both in beside.items() if len(both) == 2}
    k = [0.5 * both[:, 0].sum() / (0.5 * distance(*edge) + 0.25 * both[:, 1].sum()) for edge, both in inner.items()]
    return np.array(list(inner)), np.array(k)


def diagonals(x, quads):
    """Both diagonals (2p,2) of quads, and stiffness d^2 / 2A (2p,) over G w: rectangles shear as a sheet does."""
    area = 0.5 * np.linalg.norm(np.cross(x[quads[:, 2]] - x[quads[:, 0]], x[quads[:, 3]] - x[quads[:, 1]]), axis=1)
    links = np.concatenate([quads[:, [0, 2]], quads[:, [1, 3]]])
    d = np.linalg.norm(x[links[:, 1]] - x[links[:, 0]], axis=1)
    return links, 0.5 * d * d / np.concatenate([area, area])


def fitted(x, quads):
    """Edges and diagonals (6p,2) of quads, and the stiffness (6p,) over E w that makes them a sheet of nu = 1/3.

    In uniform strain springs along t with k l^2 sum up to stiffness A C = sum k l^2 t t t t. That has C_1122 = C_1212
    whatever the springs (Cauchy's relation), so nu = 1/3 where it is isotropic: C_1111 = 9/8 E w, C_1122 = C_1212 =
    3/8 E w. Stiffness that is not negative comes nearest to it by least squares in every quad.
    """
    ends = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)]
    links = np.stack([quads[:, pair] for pair in ends], axis=1)
    d = x[links[:, :, 1]] - x[links[:, :, 0]]
    l2 = np.einsum("pec,pec->pe", d, d)
    c, s = d[..., 0] / np.sqrt(l2), d[..., 1] / np.sqrt(l2)
    rows = np.stack([c**4, s**4, 2.0 * c * c * s * s, 2.0 * c**3 * s, 2.0 * c * s**3], axis=1)
    wanted = np.array([9.0, 9.0, 6.0, 0.0, 0.0]) / 8.0
    area = 0.5 * np.linalg.norm(np.cross(x[quads[:, 2]] - x[quads[:, 0]], x[quads[:, 3]] - x[quads[:, 1]]), axis=1)
    k = [a * nnls(row, wanted)[0] / lengths for row, a, lengths in zip(rows, area, l2, strict=True)]
    return links.reshape(-1, 2), np.concatenate(k)


@dataclass(frozen=True)
class Net:
    """What a net is made of: edges after eq. 7.2, diagonals of so much G w / E w, or fitted; pressure times this."""

    diagonal: float = 0.0
    fitted: bool = False
    pressure: float = 1.0


@dataclass(frozen=True, eq=False)
class Inflated:
    """A net in equilibrium: node positions `flat` and `x` (m,3) m, `status`, Newton iterations, unstable directions."""

    flat: np.ndarray
    x: np.ndarray
    status: str
    iterations: int
    unstable_modes: int

    @property
    def centre(self):
        """Deflection m of the node in the middle, or the mean of the nodes around it."""
        away = np.hypot(*self.flat[:, :2].T)
        return float(self.x[away < away.min() + 1e-9, 2].mean())

    def deflection(self, rho, angle):
        """Deflection m of the inflated net at c / a = rho, in a direction `angle` rad that nodes lie in."""
        along = self.flat[:, :2] @ np.array([np.cos(angle), np.sin(angle)])
        across = self.flat[:, :2] @ np.array([-np.sin(angle), np.cos(angle)])
        ray = np.flatnonzero((np.abs(across) < 1e-9) & (along > -1e-9))
        ray = ray[np.argsort(along[ray])]
        return float(np.interp(rho * RADIUS, np.hypot(*self.x[ray, :2].T), self.x[ray, 2]))


def membrane(n, q, net, layout="blocked", turn=0.0, stiffness=1.0):
    """The disc as a particle system of E w = `stiffness` N/m under q = p a / (E w), pressure on its quads upwards.

    It starts from the shape of the series, nu = 0.
    """
    unit, quads = disc(n, layout, turn)
    x = RADIUS * unit
    groups = [fitted(x, quads)] if net.fitted else [edge_springs(x, quads)]
    if net.diagonal:
        links, k = diagonals(x, quads)
        groups.append((links, net.diagonal * k))
    links = np.concatenate([g[0] for g in groups])
    k = stiffness * np.concatenate([g[1] for g in groups])
    links, k = links[k > 0.0], k[k > 0.0]
    l0 = np.linalg.norm(x[links[:, 1]] - x[links[:, 0]], axis=1)
    chains = (Chains(links, l0, k, np.ones(len(k), dtype=bool)),)
    rho = np.hypot(*unit[:, :2].T)
    edge = np.repeat((rho > 1.0 - 1e-9)[:, None], 3, axis=1)
    s = Structure(x, edge, chains, {"panels": Faces(quads)})
    loads = Loads(np.zeros_like(x), {"panels": FaceLoad(np.full(len(quads), net.pressure * q * stiffness / RADIUS))})
    start = x.copy()
    start[:, 2] = np.where(edge[:, 0], 0.0, RADIUS * series(net.pressure * q, 0.0, rho))
    return System(Assembly(s), chains, loads, start, np.ones(len(x)))


def inflated(n, q, net, layout="blocked", turn=0.0, stiffness=1.0):
    """The net of `membrane` in equilibrium."""
    s = membrane(n, q, net, layout, turn, stiffness)
    found = equilibrium(s.assembly, s.loads, s.x, atol=1e-9 * stiffness, groups=s.groups)
    return Inflated(s.assembly.structure.nodes, found.x, found.status, found.iterations, found.unstable_modes)
