"""Vectors and finite rotations: products over the last axis, and spins that turn rotation matrices."""

import numpy as np


def spin(v):
    """Matrices [v]x with [v]x w = v x w, (..., 3, 3)."""
    s = np.zeros((*v.shape[:-1], 3, 3))
    s[..., 0, 1], s[..., 0, 2], s[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    s[..., 1, 0], s[..., 2, 0], s[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return s


def cross(a, b, axis=-1):
    """a x b over the last axis or the first (0), real or complex; several times faster than numpy.cross if small."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    x, y, z = (0, 1, 2) if axis == 0 else ((..., 0), (..., 1), (..., 2))
    out[x] = a[y] * b[z] - a[z] * b[y]
    out[y] = a[z] * b[x] - a[x] * b[z]
    out[z] = a[x] * b[y] - a[y] * b[x]
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


def rotated(points, angle, about):
    """Points (n,3) turned nose-up by `angle` rad about the y axis through `about` (3,)."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return about + (points - about) @ turn.T


def azimuth_axes(angle):
    """Rotation matrix (3,3) about z by `angle` rad, from above anticlockwise: its columns are the turned axes."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def azimuth(direction):
    """Angle rad from the x axis to the horizontal part of a vector (3,), anticlockwise from above; 0 where upright."""
    x, y = float(direction[0]), float(direction[1])
    return float(np.arctan2(y, x)) if np.hypot(x, y) > 1e-9 * np.linalg.norm(direction) else 0.0
