"""Mirror symmetry in the plane y = 0: images of points and of elements that join them; other upright planes."""

from dataclasses import dataclass

import numpy as np

# What a mirror in y = 0 does to a polar vector; the axis of a rotation gets the opposite signs.
MIRROR = np.array([1.0, -1.0, 1.0])
# Of unit vectors, and of lengths over the span.
ROUNDING = 1e-12


def mirror_permutation(points, tolerance=1e-6):
    """Index of the mirror image in the plane y = 0 of every point (n,), or None if one has none within `tolerance` m.

    Points that coincide are paired with those at the image in the order of their indices.
    """
    from scipy.spatial import cKDTree  # not loaded where nothing is mirrored

    tree = cKDTree(points)
    own = tree.query_ball_point(points, tolerance, return_sorted=True)
    there = tree.query_ball_point(points * MIRROR, tolerance, return_sorted=True)
    if any(len(a) != len(b) for a, b in zip(own, there, strict=True)):
        return None
    return np.array([b[a.index(i)] for i, (a, b) in enumerate(zip(own, there, strict=True))], dtype=int)


def canonical_chains(nodes):
    """Chain nodes (e,m) read from the end with the smaller index, so that a rope and its reverse are one."""
    return np.where((nodes[:, :1] <= nodes[:, -1:]), nodes, nodes[:, ::-1])


def canonical_faces(nodes):
    """Face nodes (p,m) in rising order, so that a face may begin at any corner, run either way round and, where it is a
    triangle, repeat any corner.
    """
    rising = np.sort(nodes, axis=1)
    repeated = rising[:, 1:] == rising[:, :-1]
    if not repeated.any():
        return rising
    last = np.where(repeated, rising[:, -1:], rising[:, 1:])
    return np.sort(np.concatenate([rising[:, :1], last], axis=1), axis=1)


def mirror_rows(nodes, mirror, canonical=canonical_chains):
    """Row of the mirror image of each element (e,) with `nodes` (e,m), -1 where there is none; twins pair in order."""
    return paired_rows(canonical(nodes), canonical(mirror[nodes]))


def paired_rows(keys, images):
    """Row of `keys` (e,m) that each row of `images` (e,m) equals, -1 where none does; equal ones pair in order."""
    places: dict[tuple[int, ...], list[int]] = {}
    for row, key in enumerate(map(tuple, keys.tolist())):
        places.setdefault(key, []).append(row)
    rows, taken = [], dict.fromkeys(places, 0)
    for key in map(tuple, images.tolist()):
        nth = taken.get(key, 0)
        rows.append(places[key][nth] if nth < len(places.get(key, ())) else -1)
        taken[key] = nth + 1
    return np.array(rows, dtype=int)


def unique_half(images):
    """Rows of the elements that stay under mirror symmetry, and how often each counts (1 or 2), from `mirror_rows`
    where every element has an image.
    """
    rows = np.flatnonzero(np.arange(len(images)) <= images)
    return rows, np.where(images[rows] == rows, 1.0, 2.0)


def symmetrised(values, image):
    """The symmetric part of vectors (n,...,3) or scalars (n,) with the mirror `image` (n,) of each."""
    return 0.5 * (values + values[image] * (MIRROR if values.ndim > 1 else 1.0))


@dataclass(frozen=True, eq=False)
class UprightPlane:
    """An upright plane of symmetry, which `inward` brings to y = 0.

    `axes` (3,3) have as columns the directions aft, across the plane and up, None where they are x, y, z; `offset` m is
    how far the plane is from the origin, along its normal.
    """

    axes: np.ndarray | None
    offset: float

    @classmethod
    def between(cls, left, right):
        """The plane half way between two sets of points (k,3) m, the tips of a wing; None where one is above the other.

        A plane that is y = 0 but for rounding is y = 0.
        """
        left, right = np.mean(left, axis=0), np.mean(right, axis=0)
        across, middle = right - left, 0.5 * (left + right)
        length = np.hypot(across[0], across[1])
        if not length > 1e-6 * np.abs(across[2]):
            return None
        normal = np.array([across[0], across[1], 0.0]) / length
        offset = float(normal @ middle)
        if normal[1] > 0.0 and abs(normal[0]) <= ROUNDING and abs(offset) <= ROUNDING * length:
            return cls(None, 0.0)
        axes = np.array([[normal[1], normal[0], 0.0], [-normal[0], normal[1], 0.0], [0.0, 0.0, 1.0]])
        return cls(axes, offset)

    def inward(self, vectors, point=False):
        """Vectors (...,3), or points, in axes where the plane is y = 0."""
        if self.axes is None:
            return vectors
        turned = vectors @ self.axes
        return turned - np.array([0.0, self.offset, 0.0]) if point else turned

    def outward(self, vectors):
        """Vectors (...,3) in the axes of `inward`, back in the axes where the plane is upright only."""
        return vectors if self.axes is None else vectors @ self.axes.T
