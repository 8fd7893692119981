"""Section polars, each on its own list of angles, and all of them at common ones."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..schema import SceneError
from .tables import name, number, read_table

# Angles of two polars, deg, that are near enough to be one: it keeps lists that are all different of bounded length
# together. ROUNDING is how far lists may differ by the way they were written.
SAME_ANGLE, ROUNDING = 0.01, 1e-9


def read_curves(path: Path) -> dict[str, np.ndarray]:
    """Polar -> alpha deg, cl, cd, cm (4,k), each on its own list of angles; SceneError in one sentence."""
    table = read_table(path, {"polar": name, "alpha_deg": number, "cl": number, "cd": number, "cm": number})
    values = np.array([table[c] for c in ("alpha_deg", "cl", "cd", "cm")])
    rows_of: dict[str, list[int]] = {}
    for row, key in enumerate(table["polar"]):
        rows_of.setdefault(key, []).append(row)
    curves = {}
    for key, rows in rows_of.items():
        curve = values[:, rows]
        alpha = curve[0]
        falling = np.flatnonzero(np.diff(alpha) <= ROUNDING)
        far = np.flatnonzero(np.abs(alpha) > 360.0)
        if len(alpha) < 2:
            raise SceneError(f"{table.at(rows[0])}: polar '{key}' has one angle only; give it at least two.")
        if len(falling):
            at = table.at(rows[int(falling[0]) + 1])
            raise SceneError(f"{at}: alpha_deg of polar '{key}' does not increase; sort its rows by angle.")
        if len(far):
            at = table.at(rows[int(far[0])])
            raise SceneError(f"{at}: alpha_deg of polar '{key}' is beyond 360 degrees; correct the cell.")
        if np.abs(alpha).max() <= 3.2 and np.abs(np.diff(curve[1]) / np.diff(alpha)).max() > 1.0:
            raise SceneError(
                f"{table.at(rows[0])}: alpha_deg of polar '{key}' goes from {alpha[0]:g} to {alpha[-1]:g} only; write "
                "degrees, not radians."
            )
        curves[key] = curve
    return curves


def at_common_angles(curves: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Polars (4,k), each on its own angles, at those of all together: alpha (n,) rad, cl, cd, cm (p,n), and the ends
    (p,2) rad of the range in which each has data.
    """
    grid = _common_angles([curve[0] for curve in curves])
    cl, cd, cm = np.array([_at_angles(curve, grid) for curve in curves]).transpose(1, 0, 2)
    return np.deg2rad(grid), cl, cd, cm, np.deg2rad([curve[0, [0, -1]] for curve in curves])


def _common_angles(lists):
    """The angles of the first list, and of every further one those that are not among them to SAME_ANGLE deg."""
    grid = lists[0]
    for angles in lists[1:]:
        after = np.searchsorted(grid, angles)
        below, above = grid[np.maximum(after - 1, 0)], grid[np.minimum(after, len(grid) - 1)]
        new = angles[np.minimum(np.abs(angles - below), np.abs(angles - above)) > SAME_ANGLE]
        grid = np.sort(np.concatenate([grid, new])) if len(new) else grid
    return grid


def _at_angles(curve, grid):
    """Coefficients (3,n) of a polar `curve` (4,k), angles first, at the angles `grid` (n,) deg: its own points and the
    monotone cubic between them, beyond them the end values.
    """
    alpha, values = curve[0], curve[1:]
    if len(alpha) == len(grid) and np.abs(alpha - grid).max() <= ROUNDING:
        return values
    from scipy.interpolate import PchipInterpolator  # not loaded by scenes without a wing

    return PchipInterpolator(alpha, values, axis=1)(np.clip(grid, alpha[0], alpha[-1]))
