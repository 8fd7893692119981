"""Finite rotations of nodes: spins that turn rotation matrices, and their mirror images in the plane y = 0."""

import numpy as np

# What a mirror in y = 0 does to a polar vector and to the axis of a rotation.
MIRROR = np.array([1.0, -1.0, 1.0])


def spin(v):
    """Matrices [v]x with [v]x w = v x w, (..., 3, 3)."""
    s = np.zeros((*v.shape[:-1], 3, 3))
    s[..., 0, 1], s[..., 0, 2], s[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    s[..., 1, 0], s[..., 2, 0], s[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return s


def cross(a, b):
    """a x b over the last axis; several times faster than numpy.cross on small arrays."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def rotation(vectors):
    """Rotation matrices (..., 3, 3) about `vectors` (..., 3) by their length, rad; any length (Rodrigues)."""
    angle = np.sqrt(np.einsum("...k,...k->...", vectors, vectors))[..., None, None]
    s = spin(vectors)
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.eye(3) + first * s + second * (s @ s)


def turned(rotations, spins):
    """Rotation matrices (s,3,3) turned by the `spins` (s,3) rad about fixed axes, orthonormal to rounding.

    One Newton step towards the nearest rotation removes what products of rounded matrices gather.
    """
    new = rotation(spins) @ rotations
    return 0.5 * new @ (3.0 * np.eye(3) - new.transpose(0, 2, 1) @ new)


def mirrored(rotations):
    """Images (s,3,3) of rotation matrices in the plane y = 0."""
    return rotations * MIRROR[:, None] * MIRROR[None, :]
