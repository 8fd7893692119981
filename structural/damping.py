"""Kelvin-Voigt damping of springs, lines and ropes: viscous resistance to the rate of their lengths."""

import numpy as np

from .chains import length_gradient, stretched

# The damping of an element that cannot push grows from zero over this stretch, relative to its rest length: the force
# of a line that becomes taut at speed would jump else, and an implicit step over the jump would have no solution.
ONSET = 1e-5


def _rates(x, v, chains):
    """Everything about lengths and their rates that forces and tangents need."""
    u, length, safe, jammed, stretch = stretched(x, chains)
    dv = np.diff(v[chains.nodes], axis=1)
    rate = np.einsum("eik,eik->e", u, dv)
    if chains.l0_rate is not None:
        rate = rate - chains.l0_rate
    return u, length, safe, jammed, stretch, dv, rate


def _viscous(stretch, rate, chains):
    """Damping forces N (e,) and their derivatives by stretch N/m and rate N s/m.

    A two-way element resists with c times its rate. One that cannot push does so only while it is taut, and never to
    the point of pushing: k s + c rate >= 0.
    """
    onset = ONSET * np.where(chains.l0 > 0.0, chains.l0, 1.0)
    part = np.where(chains.two_way, 1.0, np.clip(stretch / onset, 0.0, 1.0))
    growing = ~chains.two_way & (stretch > 0.0) & (stretch < onset)
    force = chains.c * part * rate
    by_stretch = np.where(growing, chains.c * rate / onset, 0.0)
    by_rate = chains.c * part
    pushing = ~chains.two_way & (force < -chains.k * np.maximum(stretch, 0.0))
    taut = stretch > 0.0
    force = np.where(pushing, np.where(taut, -chains.k * stretch, 0.0), force)
    by_stretch = np.where(pushing, np.where(taut, -chains.k, 0.0), by_stretch)
    return force, by_stretch, np.where(pushing, 0.0, by_rate)


def damping_forces(x, v, chains):
    """Internal damping forces N (e,m,3) on the nodes of every element at positions x and velocities v (n,3).

    F = c (dL/dt - dl0/dt) dL/dx along the legs (PSM thesis eq. 4.4, for a whole rope).
    """
    u, _, _, _, stretch, _, rate = _rates(x, v, chains)
    return _viscous(stretch, rate, chains)[0][:, None, None] * length_gradient(u)


def reeling_power(x, v, chains):
    """Power W that changes of rest length put into the dampers, -F dl0/dt, all of which these turn into heat."""
    if chains.c is None or chains.l0_rate is None:
        return 0.0
    _, _, _, _, stretch, _, rate = _rates(x, v, chains)
    return -float(_viscous(stretch, rate, chains)[0] @ chains.l0_rate)


def damping_forces_and_tangents(x, v, chains, isotropic=False):
    """Forces N (e,m,3), and derivatives (e,3m,3m) by positions N/m and by velocities N s/m.

    With F = T(s, ds/dt) g, g = dL/dx and H = d2L/dx2: dF/dv = T_r g g^T, dF/dx = g (T_s g + T_r H v)^T + T H. The first
    is along the element only. `isotropic` takes c I between neighbouring nodes instead and no dF/dx, as the PSM thesis
    does (eq. 5.16).
    """
    u, length, safe, jammed, stretch, dv, rate = _rates(x, v, chains)
    force, by_stretch, by_rate = _viscous(stretch, rate, chains)
    g = length_gradient(u)
    e, m, _ = g.shape
    if isotropic:
        legs = chains.c[:, None, None, None] * np.broadcast_to(np.eye(3), (e, m - 1, 3, 3))
        return force[:, None, None] * g, np.zeros((e, 3 * m, 3 * m)), _between(legs)
    flat = g.reshape(e, 3 * m)
    along = np.where(jammed, 0.0, 1.0)[..., None]
    turning = np.where((length > 0.0)[..., None], dv - along * np.einsum("eik,eik->ei", u, dv)[..., None] * u, 0.0)
    swing = length_gradient(turning / safe[..., None]).reshape(e, 3 * m)  # H v
    gradient = by_stretch[:, None] * flat + by_rate[:, None] * swing
    across = np.where(length > 0.0, force[:, None] / safe, 0.0)[..., None, None]
    legs = across * (np.eye(3) - along[..., None] * (u[..., :, None] * u[..., None, :]))
    by_x = flat[:, :, None] * gradient[:, None, :] + _between(legs)
    return force[:, None, None] * g, by_x, by_rate[:, None, None] * (flat[:, :, None] * flat[:, None, :])


def _between(legs):
    """Matrices (e,3m,3m) that resist the relative displacement of neighbouring nodes with blocks (e,m-1,3,3)."""
    e, count, _, _ = legs.shape
    m = count + 1
    out = np.zeros((e, m, 3, m, 3))
    for i in range(count):
        out[:, i, :, i] += legs[:, i]
        out[:, i + 1, :, i + 1] += legs[:, i]
        out[:, i, :, i + 1] -= legs[:, i]
        out[:, i + 1, :, i] -= legs[:, i]
    return out.reshape(e, 3 * m, 3 * m)
