"""Membranes in what a run leaves: rows of the result, tables, a plot, and what VTK files show of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.figures import WIDTH, axes_at, new_figure, style
from master.report.wing import largest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLOCKS = (
    *("membrane_stress_1", "membrane_stress_2", "membrane_cauchy_stress_1", "membrane_cauchy_stress_2"),
    *("membrane_strain", "wrinkle_state", "wrinkle_direction"),
)
SLACK, WRINKLED, TAUT = 0, 1, 2
STATES = ("slack", "wrinkled", "taut")
COLOURS = ("#b2182b", "#e9a33b", "#9fb8cf")  # of the states
QUARTERS = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))  # of a triangle of six nodes
# Columns of membranes.csv and fields of membranes.vtu: attribute of MembraneState.
FIELDS = {
    "stress_1_N_per_m": "stress_1", "stress_2_N_per_m": "stress_2",
    "cauchy_stress_1_N_per_m": "cauchy_1", "cauchy_stress_2_N_per_m": "cauchy_2",
    "strain": "strain", "state": "state", "direction": "direction", "area_m2": "area",
}  # fmt: skip
VIEWER = np.array([-0.5, -0.8, 0.75])  # to who looks at the plot
LIGHT = np.array([-0.2, -0.5, 1.0])  # to the lamp
MANY = 3000  # faces, beyond which a plot has them as pixels
TOP, BOTTOM, GAP, KEY, LONGEST = 0.6, 0.8, 0.3, 0.55, 0.5  # in; KEY under the surface, LONGEST of the axes in it


@dataclass(frozen=True, eq=False)
class MembraneState:
    """The membranes at the end of a run: `nodes` (e,3|6) at `position` (n,3) m, `reference` (n,3) m where they were
    drawn, `names` and `fabric` of the elements; (e,) larger and smaller principal stress `stress_1`, `stress_2` (2nd
    Piola-Kirchhoff), `cauchy_1`, `cauchy_2` N/m, larger principal `strain`, `state` 0 slack, 1 wrinkled, 2 taut,
    `direction` (e,3) of the larger stress, `area` m^2 of the pattern; `seams` name -> sides (k,2).
    """

    nodes: np.ndarray
    position: np.ndarray
    reference: np.ndarray
    names: tuple[str, ...]
    fabric: tuple[str, ...]
    stress_1: np.ndarray
    stress_2: np.ndarray
    cauchy_1: np.ndarray
    cauchy_2: np.ndarray
    strain: np.ndarray
    state: np.ndarray
    direction: np.ndarray
    area: np.ndarray
    seams: dict[str, np.ndarray]

    def fields(self) -> dict[str, np.ndarray]:
        """Values (e,) or (e,3) of the FIELDS."""
        return {name: getattr(self, own) for name, own in FIELDS.items()}

    @property
    def faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Flat triangles (f,3) of nodes and the element (f,) that each is a part of."""
        e = np.arange(len(self.nodes))
        if self.nodes.shape[1] == 3:
            return self.nodes, e
        return self.nodes[:, QUARTERS].reshape(-1, 3), np.repeat(e, 4)

    def share(self, state: int, rows: Any = slice(None)) -> float:
        """Share of the area of some elements that is in a state."""
        area = self.area[rows]
        return float(area[self.state[rows] == state].sum() / area.sum())


def membrane_state(members: Any, blocks: dict[str, np.ndarray]) -> MembraneState | None:
    """The membranes of a scene's `members` in the state `blocks`, None where there are none."""
    mesh = getattr(members, "membranes", None)
    if mesh is None or not {*BLOCKS, "position"} <= blocks.keys():
        return None
    group, fabric = mesh.group, tuple(mesh.fabrics[k] for k in mesh.fabric)
    values = {name: np.asarray(blocks[name]) for name in BLOCKS}
    values["wrinkle_state"] = np.rint(values["wrinkle_state"]).astype(np.int64)
    names = "stress_1", "stress_2", "cauchy_1", "cauchy_2", "strain", "state", "direction"
    own = dict(zip(names, values.values(), strict=True))
    shapes = np.asarray(blocks["position"]), members.nodes
    return MembraneState(
        group.nodes, *shapes, group.names, fabric, area=np.asarray(group.area), seams=mesh.seams, **own
    )  # fmt: skip


def membrane_results(members: Any, blocks: dict[str, np.ndarray]) -> dict[str, Any] | None:
    """Shares, largest values, volumes, forces on supports and of seams, as summary.json holds them."""
    found = membrane_state(members, blocks)
    if found is None:
        return None
    mesh = members.membranes
    out: dict[str, Any] = {
        "triangles": len(found.names),
        "slack_area_share": found.share(SLACK),
        "wrinkled_area_share": found.share(WRINKLED),
        "largest_stress_N_per_m": largest(found.cauchy_1, found.names),
        "largest_strain": largest(found.strain, found.names),
    }
    if "largest_fabric_utilisation" in blocks:
        place = int(blocks["largest_fabric_utilisation_at"])
        of = found.names[place - 1] if place else None
        out["largest_fabric_utilisation"] = {"value": float(blocks["largest_fabric_utilisation"]), "name": of}
    out["volume_m3"] = {p.name: float(blocks[f"{p.name}_volume"]) for p in mesh.pressures if p.encloses}
    if "support_group_force" in blocks:
        forces = zip(mesh.supports, blocks["support_group_force"], strict=True)
        out["support_force_N"] = {support.name: force for support, force in forces}
    if "seam_force" in blocks:
        out["largest_seam_force_N_per_m"] = {name: float(_size(f).max()) for name, f in seam_forces(found, blocks)}
    return out


def seam_forces(found: MembraneState, blocks: dict[str, np.ndarray]) -> Iterator[tuple[str, np.ndarray]]:
    """Name and force per length N/m (k,3) of the sides of each seam."""
    ends = np.cumsum([0, *map(len, found.seams.values())])
    for name, begin, end in zip(found.seams, ends[:-1], ends[1:], strict=True):
        yield name, blocks["seam_force"][begin:end]


def _size(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(vectors, axis=1))


def membrane_rows(members: Any, blocks: dict[str, np.ndarray]) -> list[tuple[str, str]]:
    """The rows of the result on membranes, none where there are none."""
    found = membrane_results(members, blocks)
    if found is None:
        return []

    def most(values: list[dict[str, Any]], form: str, factor: float = 1.0) -> str:
        if not values:
            return "none"
        names = values[0]["names"]
        more = f" and {len(names) - 2} more" if len(names) > 2 else ""
        return f"{form.format(factor * values[0]['value'])} in {', '.join(names[:2])}{more}"

    shares = [f"{100.0 * found[f'{state}_area_share']:.1f} % of the area {state}" for state in ("slack", "wrinkled")]
    rows = [
        ("membranes", f"{found['triangles']} triangles, {', '.join(shares)}"),
        ("largest membrane stress", most(found["largest_stress_N_per_m"], "{:.4g} N/m")),
        ("largest membrane strain", most(found["largest_strain"], "{:.3g} %", 100.0)),
    ]
    if "largest_fabric_utilisation" in found:
        used = found["largest_fabric_utilisation"]
        rows.append(("fabric utilisation", f"{100.0 * used['value']:.3g} % of the strength in {used['name']}"))
    if found["volume_m3"]:
        volumes = [f"{volume:.5g} m3 under {name}" for name, volume in found["volume_m3"].items()]
        rows.append(("enclosed volume", "; ".join(volumes)))
    if "support_force_N" in found:
        forces = [f"{name} {_vector(force)} N" for name, force in found["support_force_N"].items()]
        rows.append(("force on support groups", ";\n".join(forces)))
    if "largest_seam_force_N_per_m" in found:
        seams = [f"{name} {force:.4g} N/m" for name, force in found["largest_seam_force_N_per_m"].items()]
        rows.append(("largest seam forces", ", ".join(seams)))
    return rows


def _vector(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{round(float(v), 2) + 0.0:.2f}" for v in values) + ")"


def element_table(found: MembraneState, labels: tuple[str, ...]) -> tuple[list[str], list[list[Any]]]:
    """Header and rows of membranes.csv; nodes by their labels."""
    header = ["element", "fabric", *(f"node_{k + 1}" for k in range(found.nodes.shape[1]))]
    columns: list[list[Any]] = []
    for name, values in found.fields().items():
        if values.ndim == 2:
            header += [f"{name}_{axis}" for axis in "xyz"]
            columns += [[repr(float(v)) for v in part] for part in values.T]
        else:
            header.append(name)
            whole = values.dtype.kind == "i"
            columns.append([int(v) if whole else repr(float(v)) for v in values])
    rows = []
    for i, (name, fabric, nodes) in enumerate(zip(found.names, found.fabric, found.nodes.tolist(), strict=True)):
        rows.append([name, fabric, *(labels[n] for n in nodes), *(column[i] for column in columns)])
    return header, rows


def seam_table(
    found: MembraneState, labels: tuple[str, ...], blocks: dict[str, np.ndarray]
) -> tuple[list[str], list[list[Any]]]:
    """Header and rows of seams.csv."""
    rows = [
        [name, k + 1, *(labels[n] for n in ends), *(repr(float(part)) for part in force)]
        for (name, forces), sides in zip(seam_forces(found, blocks), found.seams.values(), strict=True)
        for k, (ends, force) in enumerate(zip(sides.tolist(), forces, strict=True))
    ]
    return ["seam", "side", "node_1", "node_2", *(f"force_{axis}_N_per_m" for axis in "xyz")], rows


# The plot


def membrane_figure(found: MembraneState, title: str, status: str = "converged") -> "Figure":
    """The deformed membranes from above and aside, shaded: left in the colour of the larger principal Cauchy stress in
    force per length N/m, right in that of their state, wrinkles drawn along the tension; one scale, in parallel
    projection.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize, to_rgb
    from matplotlib.patches import Patch

    faces, element = found.faces
    right, up, _ = screen = _screen()
    flat = found.position[np.unique(faces)] @ np.array([right, up]).T
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = np.maximum(high - low, 1e-9) * 1.06
    width = 0.5 * (WIDTH - 0.24 - GAP)
    scale = min(width / size[0], 3.6 / size[1])  # in per m
    height = max(size[1] * scale, 0.8) + KEY
    total = TOP + height + BOTTOM
    light = _light(found.position[faces])[:, None]
    colours = ScalarMappable(Normalize(0.0, float(found.cauchy_1.max()) or 1.0), colormaps["viridis"])
    by_state = np.array([to_rgb(c) for c in COLOURS])[found.state[element]]
    with style():
        figure = new_figure(total, title)
        if status != "converged":
            figure.text(0.12 / WIDTH, 1.0 - 0.28 / total, status.upper(), va="top", color=COLOURS[SLACK])
        middle = 0.5 * (low + high) - [0.0, 0.5 * KEY / scale]
        half = 0.5 * np.array([width, height]) / scale
        panels = (colours.to_rgba(found.cauchy_1[element])[:, :3], False), (by_state, True)
        for k, (rgb, wrinkles) in enumerate(panels):
            axes = axes_at(figure, 0.12 + k * (width + GAP), BOTTOM, width, height)
            axes.set_title(("larger principal stress", "state")[k], loc="left", pad=3.0)
            axes.set_axis_off()
            axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
            axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
            axes.add_collection(_surface(found, rgb * light, screen, wrinkles), autolim=False)
            _draw_scale(axes, middle - half, scale, screen)
        bar = axes_at(figure, 0.3, 0.5, width - 0.6, 0.12)
        figure.colorbar(colours, cax=bar, orientation="horizontal").set_label("force per present length, N/m")
        shown = [
            Patch(fc=COLOURS[s], ec="none", label=f"{STATES[s]} ({100.0 * found.share(s):.1f} % of the area)")
            for s in (TAUT, WRINKLED, SLACK)
        ]
        place = (0.12 + width + GAP) / WIDTH, 0.1 / total
        figure.legend(handles=shown, loc="lower left", bbox_to_anchor=place, ncols=1, borderaxespad=0.0)
    return figure


def _screen() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors to the right of the picture, up in it, and to who looks."""
    viewer = VIEWER / np.linalg.norm(VIEWER)
    right = np.cross([0.0, 0.0, 1.0], viewer)
    right /= np.linalg.norm(right)
    return right, np.cross(viewer, right), viewer


def _light(corners: np.ndarray) -> np.ndarray:
    """Brightness (f,) of triangles (f,3,3), seen from either side."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    lit = np.abs(normal @ LIGHT) / np.where(size > 0.0, size, 1.0) / np.linalg.norm(LIGHT)
    return 0.55 + 0.45 * lit


def _surface(found: MembraneState, colours: np.ndarray, screen: Any, wrinkles: bool) -> Any:
    """The faces in their colours (f,3), the nearest last, and with `wrinkles` a stroke along the tension on each
    element that has some, which what is nearer hides.
    """
    from matplotlib.collections import PolyCollection

    faces, element = found.faces
    right, up, viewer = screen
    shapes, widths = list(found.position[faces]), np.full(len(faces), 0.2)
    depth = found.position[faces].mean(axis=1) @ viewer
    if wrinkles:
        rows = np.flatnonzero(found.state == WRINKLED)
        middle = found.position[found.nodes[rows, :3]].mean(axis=1)
        half = 0.3 * np.sqrt(found.area[rows])[:, None] * found.direction[rows]
        shapes += list(np.stack([middle - half, middle + half], axis=1))
        nearest = np.full(len(found.nodes), -np.inf)
        np.maximum.at(nearest, element, depth)
        depth = np.concatenate([depth, nearest[rows]])  # sorted behind its own element, as the sort is stable
        colours = np.concatenate([colours, np.full((len(rows), 3), 0.15)])
        widths = np.concatenate([widths, np.full(len(rows), 0.5)])
    order = np.argsort(depth, kind="stable")
    flat = [shapes[i] @ np.array([right, up]).T for i in order]
    look: dict[str, Any] = {"fc": colours[order], "ec": colours[order], "lw": widths[order]}
    return PolyCollection(flat, gid="membranes", rasterized=len(faces) > MANY, **look)


def _draw_scale(axes: Any, corner: np.ndarray, scale: float, screen: Any) -> None:
    """The directions of x, y and z, each as long as a round length, beside the lower left `corner` (2,) of axes of
    `scale` in per m.
    """
    longest = LONGEST / scale
    decade = 10.0 ** np.floor(np.log10(longest))
    length = max(m * decade for m in (1.0, 2.0, 5.0) if m * decade <= longest)
    start = corner + np.array([0.45, 0.17]) / scale
    for name, axis in zip("xyz", np.eye(3), strict=True):
        end = start + length * np.array([axis @ screen[0], axis @ screen[1]])
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-", "color": "0.2", "lw": 0.9})
        axes.text(
            *(start + (1.0 + 0.1 / (length * scale)) * (end - start)), name, ha="center", va="center", color="0.2"
        )
    axes.text(start[0], start[1] - 0.03 / scale, f"{length:g} m", ha="center", va="top", color="0.2")
