"""Where the drag of a flown closed wing comes from: pressure, friction, bridle lines, tether (ram-air thesis 2.3.3)."""

from typing import Any

import numpy as np

from master.report.views import wind_of

TETHER = "tether_"  # what names of its elements begin with


def drag_results(scene: Any, aero: dict[str, np.ndarray]) -> dict[str, Any] | None:
    """Drag N of the parts of a kite with a closed wing on lines, and glide ratios, as summary.json holds them; None
    for any other scene.

    `tether_N` is the wind on all of the tether along the wind, the difference of its end forces there less its weight;
    `tether_at_kite_N` the force at the kite that has the same moment about the ground, by which the glide ratio of the
    system counts it (equations 2.13 and 2.14): an eighth of rho d L C_D V^2 in a wind that grows from nothing, where
    the former is a sixth of it. That is the drag alone, a weight of the tether apart.

    `glide_ratio` is lift over drag, the lift that of the wing alone: lines that lean have lift of their own, which the
    output `glide_ratio` of the solver, "lift over drag, with lines", counts.
    """
    wind, load = wind_of(aero), aero.get("line_load")
    if scene.body is None or wind is None or load is None or "pressure_drag" not in aero:
        return None
    along = wind / np.linalg.norm(wind)
    nodes = scene.interface.nodes + aero["displacement"]
    ends = nodes[scene.interface.lines]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    drag = (load @ along) * length
    force = np.asarray(aero["force"]) + 0.0
    lift = float(np.linalg.norm(force - (force @ along) * along))
    of_tether = np.array([name.startswith(TETHER) for name in scene.members.leg_names], dtype=bool)
    wing, bridle = float(force @ along), float(drag[~of_tether].sum())
    out: dict[str, Any] = {
        "wing_by_pressure_N": float(aero["pressure_drag"]),
        "wing_in_trefftz_plane_N": float(aero["induced_drag"]),
        "profile_N": float(aero.get("profile_drag", 0.0)),
        "bridle_N": bridle,
    }
    glide = {"wing": _ratio(lift, wing), "kite": _ratio(lift, wing + bridle)}
    if of_tether.any():
        share = _share(ends[of_tether])
        at_kite = float(drag[of_tether] @ share)
        out |= {"tether_N": float(drag[of_tether].sum()), "tether_at_kite_N": at_kite}
        glide["system"] = _ratio(lift, wing + bridle + at_kite)
    return out | {"glide_ratio": glide}


def _share(ends: np.ndarray) -> np.ndarray:
    """How far up the tether the middle of each of its elements (t,2,3) m is, over the way from its lowest to its
    highest end.
    """
    points = ends.reshape(-1, 3)
    low, high = points[np.argmin(points[:, 2])], points[np.argmax(points[:, 2])]
    way = high - low
    return (ends.mean(axis=1) - low) @ way / (way @ way)


def _ratio(lift: float, drag: float) -> float:
    return lift / drag if drag != 0.0 else float("nan")


def drag_rows(scene: Any, aero: dict[str, np.ndarray]) -> list[tuple[str, str]]:
    """The rows of the result on drag, none of other scenes."""
    found = drag_results(scene, aero)
    if found is None:
        return []
    parts = [f"wing {found['wing_by_pressure_N']:.5g} N by pressure"]
    if found["profile_N"]:
        parts.append(f"profile {found['profile_N']:.4g} N")
    parts.append(f"bridle {found['bridle_N']:.4g} N")
    glide = found["glide_ratio"]
    ratios = f"wing {glide['wing']:.3f}, with bridle {glide['kite']:.3f}"
    if "tether_N" in found:
        parts.append(f"tether {found['tether_N']:.4g} N, at the kite {found['tether_at_kite_N']:.4g} N by its moment")
        ratios += f", with tether {glide['system']:.3f}"
    return [("drag", ", ".join(parts)), ("glide ratios", ratios)]
