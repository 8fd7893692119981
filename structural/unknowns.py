"""Which degrees of freedom are solved for: supports, mirror symmetry, rigid links, and the order of elimination."""

from dataclasses import dataclass

import numpy as np

from .rotations import MIRROR


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Positions x = base + sign * q[index] where index >= 0, so that x.flat = expand(q); then the spins of the frames.

    Without symmetry `index` counts the free dofs. With it only the half y >= 0 is unknown: the other half follows with
    the sign of y turned (of x and z for spins), and y = 0 in the plane itself is a consequence, not a support.
    """

    index: np.ndarray  # (3n + 3r,) int, -1 for known dofs
    sign: np.ndarray  # (3n + 3r,) +-1
    base: np.ndarray  # (3n,) m, known positions
    first: np.ndarray  # (q,) the dof that stands for each unknown
    shares: np.ndarray  # (q,) how many dofs each unknown moves: 2 with a mirror image, else 1

    @property
    def count(self):
        """Number of unknowns."""
        return len(self.first)

    @property
    def turning(self):
        """Which unknowns are spins, (q,) bool."""
        return self.first >= len(self.base)

    def expand(self, q):
        """Node positions (n,3) from the unknowns (q,)."""
        return self.base.reshape(-1, 3) + self.moves(q)

    def moves(self, step):
        """Displacements (n,3) m of the nodes in a `step` (q,) of the unknowns."""
        index = self.index[: len(self.base)]
        free = index >= 0
        dx = np.zeros(len(index))
        dx[free] = self.sign[: len(index)][free] * step[index[free]]
        return dx.reshape(-1, 3)

    def spins(self, step):
        """Spins (r,3) rad of the frames in a `step` (q,) of the unknowns."""
        n = len(self.base)
        index = self.index[n:]
        return np.where(index >= 0, self.sign[n:] * step[index], 0.0).reshape(-1, 3)

    def restrict(self, x):
        """Unknowns (q,) of node positions (n,3); zero for spins, which start wherever the frames are."""
        turning = self.turning
        return np.where(turning, 0.0, x.reshape(-1)[np.where(turning, 0, self.first)])

    def norm(self, r):
        """Euclidean norm over the free dofs of the whole structure of forces N and moments N m, from the generalised
        values r (q,).

        A dof and its mirror image share r equally, so that the pair adds r^2 / 2.
        """
        return float(np.sqrt(np.sum(r * r / self.shares)))

    def gather(self, f):
        """Generalised forces (q,) of nodal forces (n,3), and of moments on frames where they follow, (n + r, 3)."""
        f = f.reshape(-1)
        index = self.index[: len(f)]
        free = index >= 0
        return np.bincount(index[free], (self.sign[: len(f)] * f)[free], minlength=self.count)


def unknowns(structure, mirror=None, order=None, with_riders=False):
    """Unknowns of a structure, with its `mirror` permutation of nodes if any; those of one node stand together, nodes
    of lower `order` (n,) first.

    Riders have none of their own, or, `with_riders`, stand behind all others as if they were free.
    """
    nodes, frames = structure.nodes, structure.frames
    n, r = len(nodes), len(frames)
    of_node = np.concatenate([np.arange(n), frames])
    dof = np.arange(3 * (n + r)).reshape(-1, 3)
    sign = np.ones((n + r, 3))
    master = dof.copy()
    known = np.concatenate([structure.fixed, structure.clamped])
    riding = np.zeros(n + r, dtype=bool)
    riding[structure.riders] = True
    known[riding] = not with_riders
    if mirror is not None:
        image = np.concatenate([mirror, n + frame_images(frames, mirror)])
        y = nodes[of_node, 1]
        other = (y < 0.0) | ((y == 0.0) & (image < np.arange(n + r)))
        in_plane = mirror[of_node] == of_node
        flip = np.concatenate([np.tile(MIRROR, (n, 1)), np.tile(-MIRROR, (r, 1))])
        master[other] = dof[image[other]]
        sign[other] = flip[other]
        known |= known[image]
        known |= in_plane[:, None] & (flip < 0.0)
    own = (~known) & (master == dof)
    first = dof[own]
    place = np.zeros(n) if order is None else order
    key = np.where(riding[first // 3], np.inf, place[of_node[first // 3]])
    if order is not None or with_riders:
        first = first[np.argsort(key, kind="stable")]
    number = np.full(3 * (n + r), -1)
    number[first] = np.arange(len(first))
    index = np.where(known, -1, number[master])
    base = np.where(known[:n], nodes, 0.0)
    shares = np.bincount(index[index >= 0].reshape(-1), minlength=len(first))
    return Unknowns(index.reshape(-1), sign.reshape(-1), base.reshape(-1), first, shares)


def frame_images(frames, mirror):
    """Frame (r,) at the mirror image of the node of each frame; several at one node pair in the order of their rows."""
    places: dict[int, list[int]] = {}
    for row, node in enumerate(frames.tolist()):
        places.setdefault(node, []).append(row)
    nth = {row: k for rows in places.values() for k, row in enumerate(rows)}
    try:
        return np.array([places[mirror[node]][nth[row]] for row, node in enumerate(frames.tolist())], dtype=int)
    except (KeyError, IndexError):
        raise ValueError("a frame has no mirror image although the structure is to be halved") from None
