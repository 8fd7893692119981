"""Angles of a polar: lists and ranges of them as texts, and the wind that they stand for."""

from collections.abc import Sequence

import numpy as np

MOST = 10_000  # points of a polar
DIGITS = 10  # of an angle in a range, so that 0.1 + 0.2 is 0.3
LIMITS = {"alpha": (-180.0, 180.0), "beta": (-90.0, 90.0)}  # deg


def angles(option: str, text: str) -> list[float]:
    """Angles deg of `a`, `a,b,c` or `a:b:step`, whose end b belongs to it if a step leads there. ValueError in one
    sentence for anything else, and for angles that are none or stand twice.
    """
    name = option.lstrip("-")
    example = f"{option}=-5:20:1 or {option}=0,4,8"
    parts = [part.strip() for part in text.split(":")]
    if len(parts) == 1:
        return checked(name, [_number(option, part, example) for part in text.split(",")])
    if len(parts) != 3:
        raise ValueError(f"{option} takes angles in degrees as {example}; '{text}' is not of that form.")
    first, last, step = (_number(option, part, example) for part in parts)
    if step == 0.0 or (last - first) * step < 0.0:
        raise ValueError(f"{option} {text}: a step of {step:g} does not lead from {first:g} to {last:g}; correct it.")
    count = int(np.floor((last - first) / step * (1.0 + 1e-12) + 1e-9)) + 1
    if count > MOST:
        raise ValueError(f"{option} {text} are {count} angles; take no more than {MOST}.")
    return checked(name, [round(first + k * step, DIGITS) for k in range(count)])


def checked(name: str, given: Sequence[float]) -> list[float]:
    """The angles deg, ValueError in one sentence where there are none, or one of them is none or stands twice."""
    low, high = LIMITS[name]
    found = [float(value) + 0.0 for value in given]  # no -0
    if not found:
        raise ValueError(f"{name} has no angles; give at least one.")
    for value in found:
        if not low <= value <= high or abs(value) == 90.0 == high:
            bounds = f"between {low:g} and {high:g}" if name == "beta" else f"from {low:g} to {high:g}"
            raise ValueError(f"{name} must be {bounds} degrees; it is {value:g}.")
    twice = next((value for i, value in enumerate(found) if value in found[:i]), None)
    if twice is not None:
        raise ValueError(f"{name} {twice:g} is given twice; give every angle once.")
    return found


def _number(option: str, text: str, example: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise ValueError(f"{option} takes angles in degrees as {example}; '{text}' is none.")
    return value


def wind_axes(alpha: float, beta: float) -> np.ndarray:
    """Unit vectors (3,3) as rows in the axes of the wing: along the wind (drag), across it in the wing's plane of
    symmetry (lift), and their normal to the right (side force), at angles deg.

    alpha = atan2(w, u), beta = asin(v / V) with the velocity (u, v, w) of the wing in the air, forward, to the right
    and down (ISO 1151): the axes of the wing are x backward, y to the right and z up, so that the wind blows to
    (cos alpha cos beta, -sin beta, sin alpha cos beta).
    """
    (ca, sa), (cb, sb) = ((np.cos(a), np.sin(a)) for a in np.deg2rad([alpha, beta]))
    drag, lift = np.array([ca * cb, -sb, sa * cb]), np.array([-sa, 0.0, ca])
    return np.array([drag, lift, np.cross(lift, drag)])
