"""Loads of the strips of a closed body along the span of its surfaces."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from master.report.views import wind_axes

NEEDED = ("strip_width", "strip_chord", "span_loading", "pressure_span_loading", "strip_pressure_load", "alpha")


@dataclass(frozen=True, eq=False)
class SurfaceLoading:
    """Strips of one surface in order, from left to right or of one that is `upright` from below upwards.

    `strips` (k,) from 1; the nodes `ends` (k,2) from 1 of their trailing edges and the `middle` (k,3) m of these; `arc`
    (k,) m along the trailing edge from the middle of the surface; `width` across the wind and `chord` (k,) m. Upwards,
    of what is upright outwards, are positive: `loading` c c_l m in the Trefftz plane and `by_pressure` m, `alpha` rad
    and `circulation` m^2/s, (k,) each. `lift` and `side` (k,) N/m are in the Trefftz plane, `pressure` (k,3) N/m
    upwards, to the side and along the wind; `separation` (k,).
    """

    name: str
    upright: bool
    strips: np.ndarray
    ends: np.ndarray
    middle: np.ndarray
    arc: np.ndarray
    width: np.ndarray
    chord: np.ndarray
    loading: np.ndarray
    by_pressure: np.ndarray
    alpha: np.ndarray
    circulation: np.ndarray
    lift: np.ndarray
    side: np.ndarray
    pressure: np.ndarray
    separation: np.ndarray

    def columns(self) -> dict[str, Any]:
        """Column of a table -> its values (k,)."""
        upwards, aside, along = self.pressure.T
        return {
            "strip": self.strips,
            "surface": [self.name] * len(self.strips),
            "node_a": self.ends[:, 0],
            "node_b": self.ends[:, 1],
            **dict(zip(("x_m", "y_m", "z_m"), self.middle.T, strict=True)),
            "arc_m": self.arc,
            "width_m": self.width,
            "chord_m": self.chord,
            "alpha_deg": np.rad2deg(self.alpha),
            "circulation_m2_per_s": self.circulation,
            "c_cl_m": self.loading,
            "pressure_c_cl_m": self.by_pressure,
            "cl": self.loading / self.chord,
            "pressure_cl": self.by_pressure / self.chord,
            "lift_N_per_m": self.lift,
            "side_force_N_per_m": self.side,
            "pressure_lift_N_per_m": upwards,
            "pressure_side_force_N_per_m": aside,
            "pressure_drag_N_per_m": along,
            "separation": self.separation,
        }


def span_loading(layout: Any, nodes: np.ndarray, blocks: Mapping[str, np.ndarray]) -> tuple[SurfaceLoading, ...]:
    """The loading of every surface of a `layout` (`EdgeStrips`) on `nodes` (n,3) m, from the blocks of its flow; none
    without a layout and without finite values.
    """
    if layout is None or not set(NEEDED) <= blocks.keys():
        return ()
    if not all(np.all(np.isfinite(blocks[name])) for name in NEEDED) or not np.all(np.isfinite(nodes)):
        return ()
    along = blocks["wind_direction"] / np.linalg.norm(blocks["wind_direction"])
    up = np.cross(along, wind_axes(along)[1])
    up /= np.linalg.norm(up)
    axes = np.array([up, np.cross(up, along), along])
    found = []
    for surface in layout.surfaces:
        at, sign, ends = surface.strips, surface.sign, layout.ends[surface.strips]
        length = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
        arc = np.cumsum(length) - 0.5 * length - 0.5 * length.sum()
        names = "span_loading", "pressure_span_loading", "alpha", "circulation"
        loading, by_pressure, alpha, circulation = (sign * blocks[name][at] + 0.0 for name in names)
        found.append(
            SurfaceLoading(
                surface.name, surface.upright, at + 1, ends + 1, nodes[ends].mean(axis=1), arc,
                blocks["strip_width"][at], blocks["strip_chord"][at], loading, by_pressure, alpha, circulation,
                blocks["strip_lift"][at], blocks["strip_side_force"][at], blocks["strip_pressure_load"][at] @ axes.T,
                blocks["separation"][at],
            )
        )  # fmt: skip
    return tuple(found)
