"""Loads on the panels of the wing: the net load, whichever way it travelled from the flow to the structure.

A flow sends `pressure` along the normals and `shear` with a direction of its own. How a load is divided between the two
says what shall turn with the surface, not what is pressure: strips of a lifting line send nothing but their pitching
couple as pressure. So neither is the load; their sum is.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from interface import area_vectors
from master.report.views import wind_at

# Fields of wing.vtu and panels.csv: attribute of PanelLoads, unit, meaning.
FIELDS = {
    "load_Pa": ("load", "Pa", "net load per area, global frame: exchanged pressure along the normal + exchanged shear"),
    "delta_p_Pa": ("delta_p", "Pa", "pressure difference: load along the normal, above zero towards suction"),
    "C_p": (
        "C_p",
        "1",
        "sheets: delta_p over the dynamic pressure of the wind that the panel meets; closed bodies: pressure outside "
        "over it, 1 where the air comes to rest, below zero in suction",
    ),
    "tangential_Pa": ("tangential", "Pa", "load along the surface: load less delta_p along the normal"),
    "area_m2": ("area", "m2", "size of the area vector, half the cross product of the diagonals"),
    "exchanged_pressure_Pa": ("pressure", "Pa", "what the flow sends along the normal; turns with it, is not the load"),
    "exchanged_shear_Pa": ("shear", "Pa", "what the flow sends in a direction of its own; is not the load"),
}


@dataclass(frozen=True, eq=False)
class PanelLoads:
    """Loads of m panels on the shape for which the flow gave them.

    `vectors` (m,3) m2 are their area vectors, `pressure` (m,) and `shear` (m,3) Pa what was exchanged (None: no shear),
    `dynamic_pressure` (m,) Pa that of the wind which each panel meets, None without a wind; `outside` (m,) the pressure
    coefficient that a flow around a closed body gives, None of a sheet.
    """

    vectors: np.ndarray
    pressure: np.ndarray
    shear: np.ndarray | None
    dynamic_pressure: np.ndarray | None
    outside: np.ndarray | None = None

    @property
    def area(self) -> np.ndarray:
        """(m,) m2."""
        return np.asarray(np.linalg.norm(self.vectors, axis=1))

    @property
    def normal(self) -> np.ndarray:
        """Unit normals (m,3) to suction; zero for a panel without area."""
        area = self.area[:, None]
        return self.vectors / np.where(area == 0.0, 1.0, area)

    @property
    def force(self) -> np.ndarray:
        """p a + s |a| with the area vectors a, (m,3) N."""
        force = self.pressure[:, None] * self.vectors
        return force if self.shear is None else force + self.shear * self.area[:, None]

    @property
    def load(self) -> np.ndarray:
        """p n + s, (m,3) Pa."""
        load = self.pressure[:, None] * self.normal
        return load if self.shear is None else load + self.shear

    @property
    def delta_p(self) -> np.ndarray:
        """Load along the normal, (m,) Pa."""
        return np.einsum("mk,mk->m", self.load, self.normal)

    @property
    def tangential(self) -> np.ndarray:
        """Load along the surface, (m,3) Pa."""
        return self.load - self.delta_p[:, None] * self.normal

    @property
    def C_p(self) -> np.ndarray | None:
        """(m,), NaN for a panel that meets no wind; None without a wind. Of a closed body the pressure coefficient
        outside, without that inside; of a sheet delta_p over the dynamic pressure.
        """
        q = self.dynamic_pressure
        if q is None:
            return None
        if self.outside is not None:
            return np.where(q > 0.0, self.outside, np.nan)
        return np.divide(self.delta_p, q, out=np.full(len(q), np.nan), where=q > 0.0)

    def fields(self) -> dict[str, np.ndarray]:
        """Values (m,) or (m,3) of the FIELDS that there are."""
        with np.errstate(invalid="ignore", over="ignore"):  # of a shape that blew up
            found = {name: getattr(self, own) for name, (own, *_) in FIELDS.items()}
        return {name: values + 0.0 for name, values in found.items() if values is not None}  # no -0.0

    def columns(self) -> dict[str, np.ndarray]:
        """The fields as columns (m,) of a table, vectors by their parts: load_x_Pa and so on."""
        out = {}
        for name, values in self.fields().items():
            if values.ndim == 1:
                out[name] = values
            else:  # Pa, all of them
                stem = name.removesuffix("_Pa")
                out |= {f"{stem}_{axis}_Pa": part for axis, part in zip("xyz", values.T, strict=True)}
        return out


def panel_loads(nodes: np.ndarray, panels: np.ndarray, blocks: Mapping[str, np.ndarray]) -> PanelLoads:
    """The loads in the `blocks` of a flow on `panels` (m,4) between `nodes` (n,3) m as displaced for it.

    The dynamic pressure is rho |U - v|^2 / 2 with the wind U of the moment, gusts included, where the panel is, and in
    a transient scene the velocity v of the panel, mean of its corners. Flows around closed bodies say
    `pressure_coefficient` themselves.
    """
    panels = np.asarray(panels, int).reshape(-1, 4)
    dynamic = None
    with np.errstate(invalid="ignore", over="ignore"):
        met = wind_at(blocks, nodes[panels].mean(axis=1))
        vectors = area_vectors(nodes[panels])
        if met is not None and "air_density" in blocks:
            if "velocity" in blocks:
                met = met - blocks["velocity"][panels].mean(axis=1)
            dynamic = 0.5 * float(blocks["air_density"]) * np.einsum("mk,mk->m", met, met)
    pressure = blocks.get("pressure", np.zeros(len(panels)))  # none of a flow around lines alone
    return PanelLoads(vectors, pressure, blocks.get("shear"), dynamic, blocks.get("pressure_coefficient"))
