"""Wind loads on lines: the inclined cylinder."""

import numpy as np

# Hoerner's cylinder with the coefficients of the ram-air thesis, section 2.3.3: drag across the line, for Reynolds
# numbers of 1e3 to 1e5 (lines of millimetres in 10 to 50 m/s), and friction along it, both on the area d l.
NORMAL_DRAG, FRICTION = 1.1, 0.02
LAWS = ("inclined", "projected")


def line_loads(ends, diameter, velocity, density=1.225, normal_drag=NORMAL_DRAG, friction=FRICTION, law="inclined"):
    """Load N/m (k,3) per length of straight lines between `ends` (k,2,3) m in air that passes with `velocity` m/s.

    w = rho d / 2 (C_tau |v_n| v_n + C_f |v| v), v_n the part of v across the line. Along v and across it that is
    C_D = C_tau sin^3 Theta + C_f and C_L = C_tau sin^2 Theta cos Theta (ram-air thesis eq. 2.11 and 2.12), without
    an angle that would be undefined for lines along the wind.

    `diameter` (k,) m; `velocity` (3,) or (k,3), of the air relative to each line; `density` kg/m^3. The `law`
    "projected" is the PSM thesis' (eq. 4.7): w = rho d / 2 C_tau (1 - |cos Theta|) |v| v along the wind, without
    friction (the area that a line shows is d sin Theta per length; 1 - |cos Theta| is less, by half at 53 degrees).
    ValueError for another law.
    """
    if law not in LAWS:
        raise ValueError(f"there is no law '{law}' for lines in the wind; there are: {', '.join(LAWS)}.")
    d = ends[:, 1] - ends[:, 0]
    length2 = np.einsum("kc,kc->k", d, d)
    v = np.broadcast_to(velocity, d.shape)
    along = np.einsum("kc,kc->k", v, d) / np.where(length2 > 0.0, length2, 1.0)
    across = v - along[:, None] * d
    speed_across, speed = (np.sqrt(np.einsum("kc,kc->k", a, a))[:, None] for a in (across, v))
    if law == "projected":
        cosine = along * np.sqrt(length2) / np.where(speed[:, 0] > 0.0, speed[:, 0], 1.0)
        shown = 1.0 - np.where(cosine.real < 0.0, -cosine, cosine)  # numpy.abs has no complex steps
        return (0.5 * density * normal_drag * np.asarray(diameter) * shown)[:, None] * speed * v
    pressure_width = (0.5 * density * np.asarray(diameter))[:, None]
    return pressure_width * (normal_drag * speed_across * across + friction * speed * v)
