"""The final state of a run as the arrays that the plots, VTK files and the page show."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.loading import SurfaceLoading, span_loading
from master.report.panels import PanelLoads, panel_loads
from master.report.views import wind_axes
from master.report.wing import TubeState, canopy_springs, tube_state

if TYPE_CHECKING:
    from master.coupling.run import Run


OF_ELEMENTS = ("tension", "rest_length", "length", "strain", "axial_stiffness")
LOOSE = 0.01  # of the largest line tension: below it a line holds little more than its own weight and the wind on it


def loose_lines(tension: np.ndarray, two_way: np.ndarray) -> np.ndarray:
    """Which tension-only elements are under tension, but below LOOSE times the largest of theirs, (e,) bool."""
    largest = tension[~two_way].max(initial=0.0)
    return ~two_way & (tension > 0.0) & (tension < LOOSE * largest)


@dataclass(frozen=True, eq=False)
class Frame:
    """Nodes and elements of the structure.

    `reference` (n,3) m is the design shape, `undeformed` (n,3) m the same turned to the attitude of the result,
    `position` (n,3) m the result; `chains` lists the nodes of each of the e elements; `tension` (e,) N, `two_way` (e,)
    bool, `rest_length` and `length` (e,) m, `strain` (e,) and `axial_stiffness` (e,) N, all as the structure says them;
    `supports` (n,) bool are nodes with a fixed direction. An inflatable wing has `tubes`, and elements that are its
    `canopy` (e,) bool, counted as two-way here because they are no lines: they go slack where the fabric wrinkles.
    """

    labels: tuple[str, ...]
    reference: np.ndarray
    undeformed: np.ndarray
    position: np.ndarray
    supports: np.ndarray
    names: tuple[str, ...]
    chains: list[np.ndarray]
    tension: np.ndarray
    two_way: np.ndarray
    rest_length: np.ndarray
    length: np.ndarray
    strain: np.ndarray
    axial_stiffness: np.ndarray
    canopy: np.ndarray
    tubes: TubeState | None

    @property
    def slack(self) -> np.ndarray:
        """Which elements are tension-only and without tension, (e,) bool."""
        return ~self.two_way & (self.tension <= 0.0)

    @property
    def loose(self) -> np.ndarray:
        """Which elements are tension-only and hardly under tension (see `loose_lines`), (e,) bool."""
        return loose_lines(self.tension, self.two_way)

    @property
    def taut(self) -> np.ndarray:
        """Which elements are tension-only and neither slack nor loose, (e,) bool."""
        return ~self.two_way & ~self.slack & ~self.loose

    @property
    def legs(self) -> tuple[np.ndarray, np.ndarray]:
        """Node pairs (l,2) of all legs and the element (l,) that each belongs to; a rope over k sheaves has k + 1."""
        pairs = [np.stack([chain[:-1], chain[1:]], axis=1) for chain in self.chains]
        return np.concatenate(pairs), np.repeat(np.arange(len(pairs)), [len(p) for p in pairs])

    @property
    def sheaves(self) -> np.ndarray:
        """Nodes that a rope runs over, (s,)."""
        return np.unique(np.concatenate([chain[1:-1] for chain in self.chains]))


@dataclass(frozen=True, eq=False)
class Surface:
    """The interface mesh: `reference` and `position` (n,3) m, `panels` (m,4) with their `loads`, and where the scene
    has them `lines` (k,2) with `diameter` (k,) m and `line_load` (k,3) N/m.
    """

    reference: np.ndarray
    position: np.ndarray
    panels: np.ndarray
    loads: PanelLoads
    lines: np.ndarray
    diameter: np.ndarray
    line_load: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Strips:
    """Loads of the lifting-line strips, left tip first.

    `arc` (s,) m along the quarter-chord line from mid-span, right wing positive, `width` (s,) m; `lift` (across the
    wind, upward), `side` (towards the right wing) and `drag` (along the wind), each (s,) N per m of arc; `alpha` (s,)
    deg is effective; `circulation` (s,) m2/s. Section polars, where there are some: `coefficients` (3,s) cl, cd, cm of
    the strips, `curves` (3,s,k) over `angles` (k,) deg.
    """

    arc: np.ndarray
    width: np.ndarray
    lift: np.ndarray
    side: np.ndarray
    drag: np.ndarray
    alpha: np.ndarray
    circulation: np.ndarray | None
    coefficients: np.ndarray | None
    angles: np.ndarray | None
    curves: np.ndarray | None


@dataclass(frozen=True, eq=False)
class FinalState:
    """What a run shows; parts that its participants do not give are None. `axes` (3,3) are those of its wind (see
    `wind_axes`). `turn` is the rigid nose-up rotation (deg) about the node `pivot` that fits the design shape, faced to
    the wind, to the wing, None for a scene that cannot pitch. `loading` is that of the surfaces of a closed body.
    """

    surface: Surface
    frame: Frame | None
    strips: Strips | None
    turn: float | None
    pivot: str | None
    axes: np.ndarray
    loading: tuple[SurfaceLoading, ...] = ()


def status_text(status: str) -> str:
    """The status of a run in words: converged, statically unstable, or not converged and why."""
    if status in ("converged", "statically_unstable"):
        return status.replace("_", " ")
    return f"not converged ({status.replace('_', ' ')})"


def final_state(scene: Any, run: "Run") -> FinalState:
    """The final state of a `run` of `scene`, see the classes above."""
    aero, structural = run.blocks["aero"], run.blocks["structural"]
    mesh, axes = scene.interface, wind_axes(run.blocks["aero"].get("wind_direction"))
    shown = (structural if scene.has_structure else aero)["displacement"]
    loaded = aero["displacement"] if scene.has_flow else shown  # the shape that the loads are for
    surface = Surface(
        mesh.nodes,
        mesh.nodes + shown,
        np.asarray(mesh.panels),
        panel_loads(mesh.nodes + loaded, mesh.panels, aero),
        mesh.lines,
        mesh.diameter,
        aero.get("line_load"),
    )
    turn = pivot = None
    if scene.pivot is not None:
        wing, heading = np.unique(mesh.panels), scene.heading
        x = heading.started(mesh.nodes[wing], {}) - heading.about
        q = (mesh.nodes + shown)[wing] - heading.about
        x, q = (heading.inward(v, values) for v, values in ((x, {}), (q, structural)))
        turn = float(np.arctan2(np.sum(x[:, 2] * q[:, 0] - x[:, 0] * q[:, 2]), np.sum(x[:, [0, 2]] * q[:, [0, 2]])))
        pivot = scene.members.labels[scene.pivot]
    frame = _frame(scene, structural, turn, axes) if {"position", *OF_ELEMENTS} <= structural.keys() else None
    strips, degrees = _strips(scene, aero, surface, axes), None if turn is None else np.rad2deg(turn)
    layout = None if scene.wing_model is None else scene.wing_model.edge_strips
    loading = span_loading(layout, mesh.nodes + loaded, aero)
    return FinalState(surface, frame, strips, degrees, pivot, axes, loading)


def _frame(scene: Any, blocks: dict[str, np.ndarray], turn: float | None, axes: np.ndarray) -> Frame | None:
    members, position = scene.members, blocks["position"]
    if not np.all(np.isfinite(position)):
        return None
    undeformed = members.nodes
    if turn is not None:
        undeformed = scene.heading.started(members.nodes, {**blocks, "trim_angle": turn})
    chains = [nodes for group in members.chains for nodes in group.nodes]
    two_way = ~members.lines  # what is no line of the bridle: springs, canopy
    supports = members.fixed.any(axis=1)
    return Frame(
        members.labels, members.nodes, undeformed, position, supports,
        members.names, chains, blocks["tension"], two_way, blocks["rest_length"], blocks["length"],
        blocks["strain"], blocks["axial_stiffness"], canopy_springs(members), tube_state(members, blocks),
    )  # fmt: skip


def _strips(scene: Any, aero: dict[str, np.ndarray], surface: Surface, axes: np.ndarray) -> Strips | None:
    """The strips of a lifting line: panels i, i + strips, ... belong to strip i."""
    layout = None if scene.wing_model is None else scene.wing_model.strips
    if layout is None or not np.all(np.isfinite(surface.position)) or np.any(np.isnan(aero[layout.angle])):
        return None
    sections, n, angle = layout.sections, len(layout.sections) - 1, aero[layout.angle]
    edge = surface.position[sections]
    quarter = edge[:, 0] + 0.25 * (edge[:, -1] - edge[:, 0])
    width = np.linalg.norm(np.diff(quarter, axis=0), axis=1)
    arc = np.cumsum(width) - 0.5 * width - 0.5 * width.sum()
    along = aero["wind_direction"] / np.linalg.norm(aero["wind_direction"])
    up = np.cross(along, axes[1])
    up /= np.linalg.norm(up)
    panel = surface.loads.force.reshape(-1, n, 3).sum(axis=0)
    lift, side, drag = (panel / width[:, None] @ np.array([up, np.cross(up, along), along]).T).T
    coefficients = angles = curves = None
    if layout.polars is not None:
        polars = layout.polars
        coefficients = polars.all(angle)
        # 15 deg to either side: what a gust or a turn may reach, and wide enough to show how far stall is
        low = max(polars.alpha[0], angle.min() - np.deg2rad(15.0))
        high = min(polars.alpha[-1], angle.max() + np.deg2rad(15.0))
        grid = np.linspace(min(low, high), max(low, high), 121)
        curves = np.stack([polars.all(np.full(n, a)) for a in grid], axis=-1)
        angles = np.rad2deg(grid)
    circulation = None if layout.circulation is None else aero[layout.circulation]
    return Strips(arc, width, lift, side, drag, np.rad2deg(angle), circulation, coefficients, angles, curves)
