"""Membranes: triangles with straight (T3) or curved sides (T6) that carry force in their plane and none across it.

Total Lagrangian. Every element has a `pattern` of its own: where its nodes lie when it has no stress, in a plane (the
cut of the fabric) or in space. It is independent of the shape that a solve starts from, so that panels may be shorter
than they are mounted, or flat before they are rolled up. In orthonormal axes of the pattern, the first along the
fibres, with the shape functions N_a and positions x_a of the nodes,

    F = sum_a x_a (x) dN_a/dX,   E = 1/2 (F^T F - I),   f_a = int F S dN_a/dX dA,
    K_ab = int dN_a/dX . A . dN_b/dX dA,   A_iajb = delta_ij S_ab + F_ic C_cadb F_jd,

S the 2nd Piola-Kirchhoff stress in force per length of the pattern, C its derivative by E (see
`materials.membranes`). The relaxed energy of a wrinkled membrane is convex and rises with E, which is convex in F: so
the strain energy of membranes is a convex function of the node positions, as that of lines is.

T3 has constant strain and one point; T6 three points of integration, its nodes the corners and then the middles of the
sides 01, 12, 20.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from interface.mirror import canonical_faces
from interface.validity import Criterion
from interface.vectors import cross
from structural.triangles import DEGREE_2, t6_slopes

from .contract import ElementGroup

# Elements that a kernel treats at a time: its intermediate arrays then stay in the cache.
BLOCK = 2048
# How far lengths of mirror images may differ, relative to the element: rounding of rotated coordinates.
ALIKE = 1e-9
# Strains that are nothing but rounding of positions, over eps reach |dN/dX|: those of unloaded meshes, of T3 and T6 and
# anywhere in space, are smaller.
STRAIN_ROUNDING = 8.0 * float(np.finfo(float).eps)
# Forces that rounding of positions leaves, over eps stiffness reach; see `rounding`.
ROUNDING = 0.25

# Up to where the law is meant, and a fabric holds.
MEMBRANE_STRAIN = Criterion(
    "largest_membrane_strain", "membrane strain", 0.05, "up to there fabrics are taken to be linear, as the law is",
    percent=True,
)  # fmt: skip
UTILISATION = Criterion(
    "largest_fabric_utilisation", "fabric utilisation, larger principal force per length over strength", 1.0,
    "strength of the fabric, as the scene gives it",
)  # fmt: skip

# Derivatives of the shape functions by the two natural coordinates (points, nodes, 2), and weights of the points in the
# natural triangle of area 1/2.
_T3 = np.array([[[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]]), np.array([0.5])
_RULES = {3: _T3, 6: (t6_slopes(DEGREE_2[0]), DEGREE_2[1])}


@dataclass(frozen=True, eq=False)
class Membranes(ElementGroup):
    """Triangles `nodes` (e,3) or (e,6) with the stress-free `pattern` (e,3|6,2) m in a plane of their own, or
    (e,3|6,3) in space, `law` (see `materials.membranes`), `angle` (e,) rad of the fibres from the first axis of the
    pattern (in space: from the side 01) towards the second (None: 0), `mass` (e,) kg/m^2 of the pattern, `names` (e,),
    `strength` (e,) N/m of the fabric (None, and inf for an element: not known).

    ValueError in one sentence for a pattern without area, or one that lists its nodes clockwise.
    """

    nodes: np.ndarray
    pattern: np.ndarray
    law: Any
    angle: np.ndarray | None = None
    mass: np.ndarray | None = None
    names: tuple[str, ...] = field(default=())
    strength: np.ndarray | None = None
    counted: ClassVar[str] = "membrane element"

    def __post_init__(self):
        e, m = self.nodes.shape
        if m not in _RULES or self.pattern.shape[:2] != (e, m) or len(self.law) != e:
            raise ValueError(
                f"membranes have 3 or 6 nodes, a pattern point each and a law of as many elements; here nodes are "
                f"{self.nodes.shape}, the pattern is {self.pattern.shape} and the law has {len(self.law)}."
            )
        _, weights = self.geometry
        bad = ~(weights.min(axis=0) > 0.0)
        if bad.any():
            row = int(np.argmax(bad))
            raise ValueError(
                f"the pattern of membrane element {self.label(row)} has no area or lists its nodes clockwise; give "
                "three corners that are not on a line, counter-clockwise (and middles of sides near the middle)."
            )

    @cached_property
    def geometry(self):
        """dN/dX (p,m,2,e) 1/m at the points of integration, in the axes of the fibres, and their areas (p,e) m^2."""
        slopes, parts = _RULES[self.nodes.shape[1]]
        bases = np.einsum("emc,pma->pace", self.pattern, slopes)  # (p, 2, 2|3, e)
        bases = _in_plane(bases) if bases.shape[2] == 3 else bases
        if self.angle is not None:
            c, s = np.cos(self.angle), np.sin(self.angle)
            bases = np.stack([c * bases[:, :, 0] + s * bases[:, :, 1], c * bases[:, :, 1] - s * bases[:, :, 0]], axis=2)
        (a, b), (c, d) = ((bases[:, i, 0], bases[:, i, 1]) for i in (0, 1))
        area = a * d - b * c
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.stack([np.stack([d, -b]), np.stack([-c, a])]) / area  # (2 of the pattern, 2 natural, p, e)
            return np.einsum("pmi,aipe->pmae", slopes, inverse), parts[:, None] * area

    @property
    def area(self):
        """Area m^2 (e,) of the patterns."""
        return self.geometry[1].sum(axis=0)

    @staticmethod
    def canonical(nodes):
        """See ElementGroup: the corners as a set, then the middles."""
        return np.hstack([canonical_faces(nodes[:, :3]), canonical_faces(nodes[:, 3:])])

    def images(self, mirror, rotation_images):
        """See ElementGroup. Elements whose patterns or fibres are no mirror images of one another are none either."""
        rows = super().images(mirror, rotation_images)
        known = np.flatnonzero(rows >= 0)
        order = np.argsort(mirror[self.nodes[known]], axis=1), np.argsort(self.nodes[rows[known]], axis=1)
        own, other = (self._distances(r, o) for r, o in zip((known, rows[known]), order, strict=True))
        size = np.sqrt(own.max(axis=(0, 2, 3), initial=0.0))
        unlike = np.abs(np.sqrt(own) - np.sqrt(other)).max(axis=(0, 2, 3), initial=0.0) > ALIKE * size
        rows[known[unlike]] = -1
        return rows

    def _distances(self, rows, order):
        """Squared distances (1|2,e,m,m) m^2 between the pattern points of `rows`, in an `order` (e,m): along and across
        fibres where these matter.
        """
        points = np.take_along_axis(self.pattern[rows], order[..., None], axis=1)
        if self.pattern.shape[2] == 2 and not np.all(self.law.isotropic):
            turn = np.zeros(len(rows)) if self.angle is None else self.angle[rows]
            along = np.stack([np.cos(turn), np.sin(turn)], axis=1)
            across = np.stack([-along[:, 1], along[:, 0]], axis=1)
            parts = [np.einsum("emc,ec->em", points, axis)[..., None] for axis in (along, across)]
        else:
            parts = [points]
        return np.stack([((p[:, :, None] - p[:, None]) ** 2).sum(axis=3) for p in parts])

    def properties(self):
        """See ElementGroup. Patterns and fibres are compared by `images`."""
        law = self.law
        parts = {"stiffness 1": law.E1, "stiffness 2": law.E2, "contraction": law.nu12, "shear stiffness": law.G}
        return parts if self.mass is None else {**parts, "mass": self.mass}

    def deformation_gradients(self, x):
        """F (p,2,3,e): columns dx/dX_1, dx/dX_2 by the axes of the fibres, at node positions x (n,3)."""
        return _gradients(_corners(x, self.nodes), self.geometry[0])

    def fibre_patterns(self):
        """Corners (e,3,2) m of the patterns in the axes of their fibres, as if their sides were straight."""
        corners = self.pattern[:, :3]
        if corners.shape[2] == 3:
            corners = flat_patterns(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        if self.angle is None:
            return corners
        c, s = np.cos(self.angle), np.sin(self.angle)
        return corners @ np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)

    def strains(self, x):
        """Green-Lagrange strain (3,p,e): E11, E22, 2 E12 in the axes of the fibres, at node positions x (n,3)."""
        return _strains(self.deformation_gradients(x))

    def forces(self, at):
        """See ElementGroup."""
        out = np.empty((len(self), self.nodes.shape[1], 3))
        for rows, part, slopes, weights in self._blocks():
            f = _gradients(_corners(at.x, part.nodes), slopes)
            stress, _ = part.law.response(_strains(f), tangents=False)
            out[rows] = _forces(f, weights * stress, slopes).transpose(2, 0, 1)
        return out

    def forces_and_tangents(self, at):
        """See ElementGroup. At rest, where rounding alone would tell taut from slack, the tangents are those of a taut
        membrane: the path of a solve from there does not depend on the last digits of the mesh.
        """
        e, m = self.nodes.shape
        out, tangents = np.empty((e, m, 3)), np.empty((e, 3 * m, 3 * m))
        reach = float(np.abs(at.x).max(initial=0.0))
        for rows, part, slopes, weights in self._blocks():
            f = _gradients(_corners(at.x, part.nodes), slopes)
            rounding = STRAIN_ROUNDING * reach * np.abs(slopes).max(axis=(1, 2))
            stress, slope = part.law.response(_strains(f), rounding=rounding)
            stress *= weights
            out[rows] = _forces(f, stress, slopes).transpose(2, 0, 1)
            tangents[rows] = _tangents(f, stress, weights * slope, slopes).reshape(3 * m, 3 * m, -1).transpose(2, 0, 1)
        return out, tangents

    def energy(self, at):
        """See ElementGroup."""
        _, weights = self.geometry
        return float(np.sum(weights * self.law.energy(self.strains(at.x))))

    @property
    def criteria(self):
        """See ElementGroup."""
        return (MEMBRANE_STRAIN,) if self.strength is None else (MEMBRANE_STRAIN, UTILISATION)

    def measured(self, at):
        """See ElementGroup, and `membrane_results.MembraneState`: `stress` and `cauchy` (e,2) N/m, `direction` (e,3),
        `strain` (e,2), `state` (e,), `area` (e,) m^2.
        """
        from .membrane_results import membrane_state

        return vars(membrane_state(self, at.x))

    def judged(self, measured):
        """See ElementGroup. A strength is one per present length, as the Cauchy stress is."""
        found = {MEMBRANE_STRAIN.name: measured["strain"][:, 0]}
        if self.strength is not None:
            found[UTILISATION.name] = measured["cauchy"][:, 0] / self.strength
        return found

    @property
    def wrinkles(self):
        """See ElementGroup. Without a law of wrinkling they buckle, with as little stiffness."""
        return True

    def smoothing(self):
        """See ElementGroup: E h int dN_a/dX . dN_b/dX dA, the tangent of a prestress E h alike in all directions."""
        slopes, weights = self.geometry
        size = self.nodes.shape[1]
        coupling = np.einsum("pe,pmae,pnae->emn", weights * self.law.stiffest, slopes, slopes)
        out = np.zeros((len(self), size, 3, size, 3))
        for axis in range(3):
            out[:, :, axis, :, axis] = coupling
        return out.reshape(len(self), 3 * size, 3 * size)

    def stiffness(self, at):
        """See ElementGroup: E h times |dN/dX|^2 over the pattern, taut or not."""
        slopes, weights = self.geometry
        return self.law.stiffest * np.max(np.sum(weights * np.sum(slopes**2, axis=2).swapaxes(0, 1), axis=1), axis=0)

    def rounding(self, at, reach):
        """See ElementGroup. Measured on T3 and T6 of any size and shape, rounding of positions leaves 0.26 to 0.63 of
        eps ||stiffness reach|| (root of the sum of squares); solvers take four times what is given here.
        """
        return ROUNDING * self.stiffness(at) * reach

    def softenable(self):
        """See ElementGroup: E h times the width of all elements together. Those that may push keep their stiffness."""
        return float(self._width * np.max(self.law.stiffest)) if self.law.wrinkles and len(self) else 0.0

    def softened(self, load):
        """See ElementGroup: E h' = E h P / (P + E h width)."""
        if not self.law.wrinkles or not len(self):
            return self
        return replace(self, law=self.law.scaled(load / (load + self._width * self.law.stiffest)))

    @property
    def _width(self):
        """Root of the area of all elements, m."""
        return float(np.sqrt(self.area.sum()))

    def nodal_masses(self, node_count):
        """Mass kg (n,) of the nodes: shares of int mass dA, a third each with T3, a third at each middle with T6."""
        masses = np.zeros(node_count)
        if self.mass is not None:
            bearing = self.nodes if self.nodes.shape[1] == 3 else self.nodes[:, 3:]
            np.add.at(masses, bearing, (self.mass * self.area / 3.0)[:, None])
        return masses

    def _blocks(self):
        """Rows, elements, dN/dX and areas of BLOCK elements after BLOCK elements."""
        slopes, weights = self.geometry
        for begin in range(0, len(self), BLOCK):
            rows = slice(begin, begin + BLOCK)
            part = _Block(self.nodes[rows], self.law.select(rows))
            yield rows, part, slopes[..., rows], weights[:, rows]


@dataclass(frozen=True, eq=False)
class _Block:
    """Some of the elements, as kernels need them."""

    nodes: np.ndarray
    law: Any


def flat_patterns(x, nodes):
    """Patterns (e,m,2) m of elements `nodes` (e,m) that have no stress in the positions x (n,3), if their sides are
    straight: the first axis along the side 01, the origin in node 0. Curved sides keep their nodes: (e,m,3), in space.
    """
    points = x[nodes]
    arms = points - points[:, :1]
    first = arms[:, 1] / np.linalg.norm(arms[:, 1], axis=1)[:, None]
    normal = cross(arms[:, 1], arms[:, 2])
    size = np.linalg.norm(normal, axis=1)[:, None]
    normal = normal / np.where(size > 0.0, size, 1.0)
    if np.abs(np.einsum("emc,ec->em", arms, normal)).max(initial=0.0) > ALIKE * np.abs(arms).max(initial=0.0):
        return points
    return np.stack([np.einsum("emc,ec->em", arms, axis) for axis in (first, cross(normal, first))], axis=2)


def prestressed_patterns(pattern, law, stress, angle=None):
    """Patterns (e,m,2) of elements that have the stress (e,3) N/m, or one (3,), along 1, 2 and in shear of the fibres,
    where they lie in their `pattern` (e,m,2); `angle` (e,) rad of the fibres there.

    The new fabric F^-1 X has the strain E of the stress for F = (I + 2 E)^1/2. ValueError for a stress that presses.
    """
    stress = np.broadcast_to(np.asarray(stress, float), (len(pattern), 3)).T
    if np.any(stress[0] + stress[1] < 0.0) or np.any(stress[0] * stress[1] < stress[2] ** 2):
        raise ValueError("a prestress must not be negative in any direction: membranes do not carry compression.")
    e1, e2, gamma = law.strain(stress)
    c = np.ones(len(pattern)) if angle is None else np.cos(angle)
    s = np.zeros(len(pattern)) if angle is None else np.sin(angle)
    turn = np.stack([np.stack([c, s], axis=1), np.stack([-s, c], axis=1)], axis=1)  # rows: axes of the fibres
    square = np.stack([np.stack([1.0 + 2.0 * e1, gamma], axis=1), np.stack([gamma, 1.0 + 2.0 * e2], axis=1)], axis=1)
    values, vectors = np.linalg.eigh(square)
    shrink = np.einsum("eij,ej,ekj->eik", vectors, 1.0 / np.sqrt(values), vectors)
    return np.einsum("eji,ejk,ekl,eml->emi", turn, shrink, turn, pattern)


def _in_plane(bases):
    """Bases (p,2,2,e) in orthonormal axes of their own plane, the first along the first, of (p,2,3,e) in space."""
    first, second = bases[:, 0], bases[:, 1]
    length = np.sqrt(np.sum(first**2, axis=1))
    along = np.sum(first * second, axis=1) / length
    normal = cross(first.swapaxes(0, 1), second.swapaxes(0, 1), axis=0)
    across = np.sqrt(np.sum(normal**2, axis=0)) / length
    return np.stack([np.stack([length, np.zeros_like(length)], axis=1), np.stack([along, across], axis=1)], axis=1)


def _corners(x, nodes):
    """Positions (m,3,e) of the nodes of the elements, from those of the first."""
    points = x[nodes].transpose(1, 2, 0)
    return points - points[0]


def _gradients(points, slopes):
    """F (p,2,3,e): columns dx/dX_1, dx/dX_2, from `points` (m,3,e) relative to the first node."""
    f = np.zeros((slopes.shape[0], 2, *points.shape[1:]))
    for p in range(slopes.shape[0]):
        for a in (0, 1):
            for m in range(1, len(points)):
                f[p, a] += slopes[p, m, a] * points[m]
    return f


def _strains(f):
    """E11, E22, 2 E12 (3,p,e) of F (p,2,3,e)."""
    dot = lambda a, b: a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]  # noqa: E731
    first, second = f[:, 0], f[:, 1]
    return np.stack([0.5 * (dot(first, first) - 1.0), 0.5 * (dot(second, second) - 1.0), dot(first, second)])


def _forces(f, stress, slopes):
    """Forces (m,3,e) N of stress times area (3,p,e)."""
    m = slopes.shape[1]
    out = np.zeros((m, *f.shape[2:]))
    for p in range(len(f)):
        first = stress[0, p] * f[p, 0] + stress[2, p] * f[p, 1]
        second = stress[2, p] * f[p, 0] + stress[1, p] * f[p, 1]
        for a in range(1, m):
            out[a] += slopes[p, a, 0] * first + slopes[p, a, 1] * second
    out[0] = -out[1:].sum(axis=0)
    return out


def _tangents(f, stress, slope, slopes):
    """Tangents (m,3,m,3,e) N/m of stress (3,p,e) and its derivative (6,p,e), both times area."""
    m = slopes.shape[1]
    out = np.zeros((m, 3, m, 3, f.shape[3]))
    for p in range(len(f)):
        moduli = _moduli(f[p], stress[:, p], slope[:, p])
        for b in range(1, m):
            g1, g2 = slopes[p, b]
            to_first = g1 * moduli[0] + g2 * moduli[1]
            to_second = g1 * moduli[1].swapaxes(0, 1) + g2 * moduli[2]
            for a in range(1, b + 1):
                out[a, :, b] += slopes[p, a, 0] * to_first + slopes[p, a, 1] * to_second
    for b in range(1, m):
        for a in range(1, b):
            out[b, :, a] = out[a, :, b].swapaxes(0, 1)
    for b in range(1, m):
        out[0, :, b] = -out[1:, :, b].sum(axis=0)
        out[b, :, 0] = out[0, :, b].swapaxes(0, 1)
    out[0, :, 0] = -out[0, :, 1:].sum(axis=1)
    return out


def _moduli(f, stress, slope):
    """A_i1j1, A_i1j2, A_i2j2, each (3,3,e), of F (2,3,e): derivatives of the columns of F S by those of F."""
    d11, d12, d13, d22, d23, d33 = slope
    first, second = f
    parts = []
    for (aa, ab, ba, bb), s in (((d11, d13, d13, d33), 0), ((d13, d12, d33, d23), 2), ((d33, d23, d23, d22), 1)):
        left = aa * first + ab * second  # C F^T by rows of the left index
        right = ba * first + bb * second
        block = first[:, None] * left[None] + second[:, None] * right[None]
        for i in range(3):
            block[i, i] += stress[s]
        parts.append(block)
    return parts
