"""Wind loads on a line: the inclined cylinder, one law for whoever needs it."""

import numpy as np

# Hoerner's cylinder with the coefficients of the ram-air thesis, section 2.3.3: drag across the line, for Reynolds
# numbers of 1e3 to 1e5 (lines of millimetres in 10 to 50 m/s), and friction along it, both on the area d l.
NORMAL_DRAG, FRICTION = 1.1, 0.02
LAWS = ("inclined", "projected")


def line_drag(axis, velocity, diameter, density=1.225, normal_drag=NORMAL_DRAG, friction=FRICTION, law="inclined"):
    """Load N/m (k,3) per length of cylinders along `axis` (k,3), any length, in air that passes with `velocity` m/s.

    w = rho d / 2 (C_tau |v_n| v_n + C_f |v| v), v_n the part of v across the line. Along v and across it that is
    C_D = C_tau sin^3 Theta + C_f and C_L = C_tau sin^2 Theta cos Theta (ram-air thesis eq. 2.11 and 2.12), without
    an angle that would be undefined for lines along the wind.

    `diameter` (k,) m; `velocity` (3,) or (k,3), of the air relative to each line; `density` kg/m^3. The `law`
    "projected" is the PSM thesis' (eq. 4.7): w = rho d / 2 C_tau (1 - |cos Theta|) |v| v along the wind, without
    friction (the area that a line shows is d sin Theta per length; 1 - |cos Theta| is less, by half at 53 degrees).
    Axes and velocities may be complex (complex steps). ValueError for another law.
    """
    require_law(law)
    length2 = np.einsum("kc,kc->k", axis, axis)
    v = np.broadcast_to(velocity, axis.shape)
    along = np.einsum("kc,kc->k", v, axis) / np.where(length2 > 0.0, length2, 1.0)
    across = v - along[:, None] * axis
    speed_across, speed = (np.sqrt(np.einsum("kc,kc->k", a, a))[:, None] for a in (across, v))
    if law == "projected":
        cosine = along * np.sqrt(length2) / np.where(speed[:, 0] > 0.0, speed[:, 0], 1.0)
        shown = 1.0 - np.where(cosine.real < 0.0, -cosine, cosine)  # numpy.abs has no complex steps
        return (0.5 * density * normal_drag * np.asarray(diameter) * shown)[:, None] * speed * v
    pressure_width = (0.5 * density * np.asarray(diameter))[:, None]
    return pressure_width * (normal_drag * speed_across * across + friction * speed * v)


def line_force_and_slopes(
    axis, velocity, diameter, density=1.225, normal_drag=NORMAL_DRAG, friction=FRICTION, law="inclined"
):
    """Force N (k,3) on lines of axis d = `axis`, |d| times `line_drag`, and its derivatives (k,3,3) by the axis N/m and
    by the velocity N s/m; a line without length has none by its axis.
    """
    length = np.linalg.norm(axis, axis=1)
    u = axis / np.where(length > 0.0, length, 1.0)[:, None]
    v = np.broadcast_to(velocity, axis.shape)
    speed = np.linalg.norm(v, axis=1)
    v_unit = v / np.where(speed > 0.0, speed, 1.0)[:, None]
    along = np.einsum("kc,kc->k", v, u)
    q = 0.5 * density * np.asarray(diameter)
    eye = np.eye(3)
    whole = speed[:, None, None] * (eye + _outer(v_unit, v_unit))  # d(|v| v)/dv
    per_length = line_drag(axis, v, diameter, density, normal_drag, friction, law)
    if law == "projected":
        cosine = np.where(speed > 0.0, along / np.where(speed > 0.0, speed, 1.0), 0.0)
        shown = 1.0 - np.abs(cosine)
        sign = np.sign(cosine)[:, None]
        c = (normal_drag * q)[:, None, None]
        flow = speed[:, None] * v
        by_axis = c * _outer(flow, shown[:, None] * u - sign * (v_unit - cosine[:, None] * u))
        turned = sign * (u - cosine[:, None] * v_unit) / np.where(speed > 0.0, speed, 1.0)[:, None]
        by_air = c * length[:, None, None] * (shown[:, None, None] * whole - _outer(flow, turned))
        return length[:, None] * per_length, by_axis, by_air
    across = v - along[:, None] * u
    fast = np.linalg.norm(across, axis=1)
    n = across / np.where(fast > 0.0, fast, 1.0)[:, None]
    plane = eye - _outer(u, u)
    # |v_n| v_n with v_n = P v: by v_n it is |v_n| (I + n n^T), and d v_n = P dv - (u v_n^T + (v.u) P) du
    steep = (normal_drag * q * fast)[:, None, None] * (eye + _outer(n, n))
    by_air = length[:, None, None] * (steep @ plane + (friction * q)[:, None, None] * whole)
    by_axis = _outer(per_length, u) - steep @ (_outer(u, across) + along[:, None, None] * plane)
    return length[:, None] * per_length, by_axis, by_air


def _outer(a, b):
    return a[:, :, None] * b[:, None, :]


def require_law(law):
    """ValueError in one sentence for a law that there is not."""
    if law not in LAWS:
        raise ValueError(f"there is no law '{law}' for lines in the wind; there are: {', '.join(LAWS)}.")
