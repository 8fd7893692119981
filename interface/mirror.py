"""Mirror symmetry in the plane y = 0: images of points and of elements that join them."""

import numpy as np

# What a mirror in y = 0 does to a polar vector; the axis of a rotation gets the opposite signs.
MIRROR = np.array([1.0, -1.0, 1.0])


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
    """Face nodes (p,m) in rising order, so that a face may begin at any corner and run either way round."""
    return np.sort(nodes, axis=1)


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
