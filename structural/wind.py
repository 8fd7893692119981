"""Wind on the legs of lines that stand in it: drag with its derivatives, for structures that carry their own air."""

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True, eq=False)
class Wind:
    """Uniform wind on the exposed legs of a structure: `velocity` (3,) m/s, `density` kg/m^3, drag coefficients.

    `law` "inclined": the cylinder across and along its axis, w = rho d / 2 (C_n |v_n| v_n + C_f |v| v), v_n the part
    of the apparent wind v across the leg (ram-air thesis eq. 2.11 and 2.12). "projected": along the wind on the area
    d l (1 - |cos theta|) of the PSM thesis (eq. 4.7; the area that a cylinder shows is d l sin theta), with
    `normal_drag` only.
    """

    velocity: np.ndarray
    density: float = 1.225
    normal_drag: float = 1.1
    friction: float = 0.02
    law: Literal["inclined", "projected"] = "inclined"

    def __post_init__(self):
        if self.law not in ("inclined", "projected"):
            raise ValueError(f"the drag of lines is inclined or projected, not '{self.law}'.")


def _outer(a, b):
    return a[:, :, None] * b[:, None, :]


def _shares(force, by_axis, by_air):
    """Half the force at each end (k,2,3), and derivatives (k,6,6) by the ends and by their velocities."""
    k = len(force)
    half = 0.5 * force
    by_ends = 0.5 * np.concatenate([-by_axis, by_axis], axis=2)
    by_speed = np.concatenate([-0.25 * by_air, -0.25 * by_air], axis=2)
    ends = [np.concatenate([b, b], axis=1).reshape(k, 6, 6) for b in (by_ends, by_speed)]
    return np.stack([half, half], axis=1), *ends


def drag_forces_and_tangents(ends, velocities, diameter, wind):
    """Wind forces N on the ends of legs (k,2,3), and their derivatives (k,6,6) by positions N/m and velocities N s/m.

    `ends` (k,2,3) m, `velocities` (k,2,3) m/s of the ends, `diameter` (k,) m. A leg meets the wind minus the mean
    velocity of its ends (PSM thesis eq. 4.5 and 4.6) and gives half of its drag to each.
    """
    axis = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(axis, axis=1)
    u = axis / np.where(length > 0.0, length, 1.0)[:, None]
    v = wind.velocity - 0.5 * (velocities[:, 0] + velocities[:, 1])
    speed = np.linalg.norm(v, axis=1)
    v_unit = v / np.where(speed > 0.0, speed, 1.0)[:, None]
    along = np.einsum("kc,kc->k", v, u)
    q = 0.5 * wind.density * diameter
    eye = np.eye(3)
    whole = speed[:, None, None] * (eye + _outer(v_unit, v_unit))  # d(|v| v)/dv
    if wind.law == "projected":
        cosine = np.where(speed > 0.0, along / np.where(speed > 0.0, speed, 1.0), 0.0)
        shown = 1.0 - np.abs(cosine)
        sign = np.sign(cosine)[:, None]
        c = (wind.normal_drag * q)[:, None, None]
        flow = speed[:, None] * v
        force = c[:, 0] * (length * shown)[:, None] * flow
        by_axis = c * _outer(flow, shown[:, None] * u - sign * (v_unit - cosine[:, None] * u))
        turned = sign * (u - cosine[:, None] * v_unit) / np.where(speed > 0.0, speed, 1.0)[:, None]
        by_air = c * length[:, None, None] * (shown[:, None, None] * whole - _outer(flow, turned))
        return _shares(force, by_axis, by_air)
    across = v - along[:, None] * u
    fast = np.linalg.norm(across, axis=1)
    n = across / np.where(fast > 0.0, fast, 1.0)[:, None]
    per_length = q[:, None] * (wind.normal_drag * fast[:, None] * across + wind.friction * speed[:, None] * v)
    plane = eye - _outer(u, u)
    # |v_n| v_n with v_n = P v: by v_n it is |v_n| (I + n n^T), and d v_n = P dv - (u v_n^T + (v.u) P) du
    steep = (wind.normal_drag * q * fast)[:, None, None] * (eye + _outer(n, n))
    by_air = length[:, None, None] * (steep @ plane + (wind.friction * q)[:, None, None] * whole)
    by_axis = _outer(per_length, u) - steep @ (_outer(u, across) + along[:, None, None] * plane)
    return _shares(length[:, None] * per_length, by_axis, by_air)


def drag_forces(ends, velocities, diameter, wind):
    """The forces of `drag_forces_and_tangents` alone, (k,2,3) N."""
    axis = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(axis, axis=1)[:, None]
    u = axis / np.where(length > 0.0, length, 1.0)
    v = wind.velocity - 0.5 * (velocities[:, 0] + velocities[:, 1])
    speed = np.linalg.norm(v, axis=1)[:, None]
    along = np.einsum("kc,kc->k", v, u)[:, None]
    q = (0.5 * wind.density * diameter)[:, None]
    if wind.law == "projected":
        shown = 1.0 - np.abs(along) / np.where(speed > 0.0, speed, 1.0)
        force = wind.normal_drag * q * length * shown * speed * v
    else:
        across = v - along * u
        fast = np.linalg.norm(across, axis=1)[:, None]
        force = q * length * (wind.normal_drag * fast * across + wind.friction * speed * v)
    return np.stack([0.5 * force, 0.5 * force], axis=1)
