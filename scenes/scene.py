"""A scene: tables turned into a structural model, a wing and the interface between them."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from aero import LinesInWind, Wing

from .description import read_description
from .interface import (
    Interface,
    arc_fraction,
    design_interface,
    grid_interface,
    lines_interface,
    structural_interface,
    with_lines,
)
from .members import Members, read_members
from .tables import SceneError, name, number, read_table

BUILT_IN = Path(__file__).resolve().parent


@dataclass(frozen=True, eq=False)
class Scene:
    """One loaded and checked scene.

    `content` is the checked scene.toml, `settings` the build-time choices, `members` the structural tables.
    """

    name: str
    folder: Path
    content: dict[str, Any]
    settings: dict[str, Any]
    members: Members = field(repr=False)
    struts: np.ndarray = field(repr=False)

    @cached_property
    def interface(self) -> Interface:
        """The interface mesh for the chosen chord and number of strips, with the lines where they have drag."""
        per_bay = int(self.settings.get("panels_per_section", 1))
        nodes = self.members.nodes
        if self.content["wing"] is None and self.members.wing is None:
            interface = lines_interface(nodes)
        elif self.members.wing is not None:
            interface = grid_interface(nodes, self.members.wing.grid)
        elif self.settings.get("chord", "structural") == "design":
            le, te = self._design()
            interface = design_interface(nodes, self.struts, le, te, per_bay)
        else:
            interface = structural_interface(nodes, self.struts, per_bay)
        legs, diameter = self.members.line_legs()
        if self.settings.get("line_drag", "off") == "on" and len(legs):
            return with_lines(interface, nodes, legs, diameter)
        return interface

    def _design(self):
        t = self._sections
        scale = float(self.settings.get("scale", 1.0))
        edge = [scale * np.array([t[f"{side}_{axis}_m"] for axis in "xyz"]).T for side in ("le", "te")]
        return edge[0], edge[1]

    @cached_property
    def _sections(self):
        columns = {"section": name, "polar": name}
        columns |= {f"{side}_{axis}_m": number for side in ("le", "te") for axis in "xyz"}
        table = read_table(self.folder / self.content["wing"]["sections"], columns)
        if len(table) < 2:
            raise SceneError(f"{table.path.parent.name}/{table.path.name} needs at least two sections; add one.")
        edge = np.array([table[f"le_{axis}_m"] for axis in "xyz"]).T
        same = np.flatnonzero(np.linalg.norm(np.diff(edge, axis=0), axis=1) == 0.0)
        if len(same):
            raise SceneError(f"{table.at(int(same[0]) + 1)}: the leading edge is that of the row above; move it.")
        if edge[0, 1] >= edge[-1, 1]:
            where = f"{table.path.parent.name}/{table.path.name}"
            raise SceneError(f"{where}: sections must go from the left tip (y < 0) to the right one; reverse the rows.")
        return table

    @property
    def files(self) -> list[str]:
        """The files in the scene's folder that it is made of, as scene.toml names them for the chosen settings."""
        structure, wing = self.content["structure"], self.content["wing"] or {}
        keys = ("nodes", "springs", "canopy", "lines", "masses", "ribs", "tubes", "attachments", "loads")
        tables = [structure[k] for k in keys] + list(wing.values())
        return ["scene.toml", *(t for t in tables if t)]

    @cached_property
    def pivot(self) -> int | None:
        """Index of the node that the structure is free to pitch about, None where scene.toml names none."""
        label = self.content["structure"]["pivot"]
        return None if label is None else self.members.node(label, f"{self.name}/scene.toml [structure] pivot")

    @property
    def moves(self) -> bool:
        """Whether the scene is a motion through time, with masses, and not one of equilibria."""
        return self.content["dynamics"] is not None

    @property
    def communication_step(self) -> float:
        """Usual communication step, s; in scenes of equilibria it is pseudo-time."""
        return float(self.content["dynamics"]["communication_step"]) if self.moves else 1.0

    def structural_core(self):
        """The structural solver core of this scene."""
        from .cores import Core

        if self.moves:
            from .cores.transient import Transient

            return Core(Transient(self))
        from .cores.statics import Statics

        return Core(Statics(self))

    @property
    def has_flow(self) -> bool:
        """Whether the scene has an aerodynamic side."""
        return self.content["aero"] is not None

    def cores(self):
        """Side -> solver core: structural, and aero where the scene has a flow."""
        return {"structural": self.structural_core()} | ({"aero": self.aero_core()} if self.has_flow else {})

    def aero_core(self):
        """The aerodynamic solver core of this scene."""
        if not self.has_flow:
            raise SceneError(f"scene '{self.name}' has no flow: its scene.toml has no [aero].")
        from .cores import Core
        from .cores.flow import FlowSolver

        if self.wing_model is None and self.lines_model is None:
            raise SceneError(
                f"{self.name}/scene.toml: [aero] without [wing] is wind on lines, and none stands in it; let the "
                'setting line_drag be "on" and give [structure] lines, or drop [aero].'
            )
        return Core(FlowSolver(self, self.wing_model, self.lines_model))

    @cached_property
    def wing_model(self):
        """The model of the flow around the wing, None where the scene has no wing in a flow."""
        if not self.has_flow or self.content["wing"] is None:
            return None
        from aero.methods import wing_model

        content, i = self.content["aero"], self.interface
        options = {**content, "camber": self.settings.get("camber_feedback", "off") == "on"}
        symmetric = self.content["structure"]["symmetric"]
        return wing_model(content["method"], Wing(i, options, symmetric, i.sections, i.fractions, self.strip_polars))

    @cached_property
    def loads(self) -> tuple[str, ...]:
        """Names of the loads that its flow puts on the interface; without a flow, those that may be set by hand."""
        from aero.methods import wing_loads

        content, wing = self.content["aero"], self.content["wing"] is not None
        on_panels = ("pressure",) if content is None or not wing else wing_loads(content["method"], content)
        panels = on_panels if len(self.interface.panels) else ()
        return (*panels, *(("line_load",) if len(self.interface.lines) else ()))

    def remarks(self, outputs: dict[str, np.ndarray]) -> list[str]:
        """What the models of the flow have to say of their outputs."""
        models = [m for m in (self.wing_model, self.lines_model) if m is not None]
        return [remark for model in models for remark in model.remarks(outputs)]

    @cached_property
    def lines_model(self):
        """The model of the drag of its exposed lines, None without any."""
        if not self.has_flow or not len(self.interface.lines):
            return None
        content, law = self.content["aero"], self.settings.get("line_area", "inclined")
        about = "origin" if self.pivot is None else "pivot"
        air = content["line_normal_drag"], content["line_friction"], about, self.moves
        return LinesInWind(self.interface.lines, self.interface.diameter, law, *air)

    def hints(self, parameters: dict[str, Any] | None = None) -> tuple[list[str], str]:
        """What looks odd in the structure with these parameters: elements far off their rest length in the design
        shape, and the first thing that breaks its symmetry ("" if nothing does).
        """
        from .checks import asymmetry, misfits

        core, given = self.structural_core(), parameters or {}
        for parameter in given.keys() & set(core.names):
            core.set(parameter, given[parameter])
        values = {block: core.get(block) for block in core.names}
        model = core.solver.model
        return misfits(self.members.nodes, model.chains(values)), asymmetry(self.members, model.groups(values))

    def section_polars(self):
        """Angles (k,) rad, tables cl, cd, cm (sections, k), and span positions (sections,) of the design sections."""
        sections = self._sections
        columns = {"polar": name, "alpha_deg": number, "cl": number, "cd": number, "cm": number}
        table = read_table(self.folder / self.content["wing"]["polars"], columns)
        polar = np.array(table["polar"])
        values = np.array([table[c] for c in ("alpha_deg", "cl", "cd", "cm")])
        label = f"{table.path.parent.name}/{table.path.name}"
        curves = {}
        grid = None
        for key in dict.fromkeys(table["polar"]):
            rows = np.flatnonzero(polar == key)
            alpha = values[0, rows]
            falling = np.flatnonzero(np.diff(alpha) <= 0.0)
            if len(alpha) < 2:
                raise SceneError(f"{table.at(int(rows[0]))}: polar '{key}' has one angle only; give it at least two.")
            if len(falling):
                row = table.at(int(rows[falling[0] + 1]))
                raise SceneError(f"{row}: alpha_deg of polar '{key}' does not increase; sort its rows by angle.")
            grid = alpha if grid is None else grid
            if len(alpha) != len(grid) or np.max(np.abs(alpha - grid)) > 1e-9:
                raise SceneError(f"{label}: polar '{key}' has other angles than the first one; use one list for all.")
            curves[key] = values[1:, rows]
        if (
            np.abs(grid).max() <= 3.2
            and max(np.abs(np.diff(c[0]) / np.diff(grid)).max() for c in curves.values()) > 1.0
        ):
            raise SceneError(
                f"{label}: alpha_deg goes from {grid[0]:g} to {grid[-1]:g} only; write degrees, not radians."
            )
        for row, key in enumerate(sections["polar"]):
            if key not in curves:
                raise SceneError(f"{sections.at(row)}: polar '{key}' is not in {label}; add it or correct the name.")
        stacked = np.array([curves[key] for key in sections["polar"]])
        span = arc_fraction(self._design()[0])
        return np.deg2rad(grid), stacked[:, 0], stacked[:, 1], stacked[:, 2], span

    def strip_polars(self):
        """The polars (`StripPolars`) of the lifting-line strips between the sections of the interface."""
        from aero.vortex_step.polars import StripPolars

        alpha, cl, cd, cm, sections = self.section_polars()
        span = self.interface.span
        return StripPolars.from_tables(alpha, cl, cd, cm, sections, 0.5 * (span[1:] + span[:-1]))

    def trim_angle(self, parameters: dict[str, Any] | None = None) -> float:
        """Rigid rotation (rad, nose-up) about the pivot with no pitching moment: where a coupled solve starts.

        Zero for a scene that is not free to pitch. `parameters` override the start values of the cores.
        """
        if self.content["trim"] is None:
            return 0.0
        from .cores.trim import trim_angle

        return trim_angle(self, parameters or {})

    def with_trim(self, parameters: dict[str, Any] | None = None) -> dict[str, Any]:
        """The parameters, and the trim angle that belongs to them where the scene has one and none is given."""
        given = dict(parameters or {})
        if self.content["trim"] is not None and "trim_angle" not in given:
            given["trim_angle"] = self.trim_angle(given)
        return given


def load(scene: str | Path, settings: dict[str, Any] | None = None) -> Scene:
    """The scene with this name or in this folder; raises `SceneError` with one sentence where anything is wrong."""
    folder = _folder(scene)
    if folder is None:
        known = ", ".join(available())
        shown = str(scene)[:80]
        raise SceneError(f"there is no scene '{shown}'; built-in are: {known} (or name a folder with a scene.toml).")
    content, chosen = read_description(folder, settings or {})
    scale = float(chosen.get("scale", 1.0))
    if scale <= 0.0:
        raise SceneError(f"{folder.name}/scene.toml: [settings.scale] must be above zero; it is {scale:g}.")
    if content["aero"] is not None:
        if content["wing"] is not None and content["aero"]["reference_area"] is None:
            raise SceneError(f"{folder.name}/scene.toml: [aero] lacks 'reference_area'; add it.")
        content["aero"]["reference_area"] = (content["aero"]["reference_area"] or 1.0) * scale**2
    members = read_members(folder, content["structure"], chosen)
    if members.wing is not None:
        struts = members.wing.grid[:, [0, -1]]
        if content["wing"] is not None:
            _check_ribs(folder, content, members, struts[:: int(chosen.get("canopy_subdivisions", 1))])
    elif content["wing"] is None:
        struts = np.zeros((0, 2), dtype=int)
        if content["aero"] is None and content["dynamics"] is None:
            raise SceneError(
                f"{folder.name}/scene.toml: a scene without [aero] needs tubes and ribs in [structure], or [dynamics]."
            )
    else:
        struts = _struts(folder, content, members)
    return Scene(folder.name, folder, content, chosen, members, struts)


def _folder(scene: str | Path) -> Path | None:
    """The folder of a scene given by path or by the name of a built-in one, if there is one."""
    for folder in (Path(scene), BUILT_IN / str(scene)):
        try:
            if str(scene) and (folder / "scene.toml").exists():
                return folder.resolve()
        except (OSError, ValueError):  # names that no file can have
            return None
    return None


def available() -> list[str]:
    """Names of the built-in scenes."""
    return sorted(p.parent.name for p in BUILT_IN.glob("*/scene.toml"))


def _upwind(content, edges):
    """Rows of the `edges` (s,2,3) m, leading and trailing, of which the second lies upwind of the first."""
    wind, chord = np.array(content["aero"]["wind_direction"]), edges[:, 1] - edges[:, 0]
    return np.flatnonzero(chord @ wind < -0.1 * np.linalg.norm(chord, axis=1) * np.linalg.norm(wind))


def _check_ribs(folder, content, members, ribs):
    where = f"{folder.name}/{content['structure']['ribs']}"
    if content["wing"]["struts"] is not None:
        raise SceneError(f"{folder.name}/scene.toml: [wing] struts means nothing to a wing of tubes and ribs; drop it.")
    for row in _upwind(content, members.nodes[ribs]):
        le, te = (members.labels[n] for n in ribs[row])
        raise SceneError(
            f"{where}: the trailing edge '{te}' lies upwind of the leading edge '{le}'; swap the two nodes or turn "
            "wind_direction in scene.toml."
        )


def _struts(folder, content, members):
    columns = {"leading_edge_node": name, "trailing_edge_node": name}
    if content["wing"]["struts"] is None:
        raise SceneError(f"{folder.name}/scene.toml: [wing] lacks 'struts'; add it.")
    table = read_table(folder / content["wing"]["struts"], columns)
    if len(table) < 2:
        raise SceneError(f"{table.path.parent.name}/{table.path.name} needs at least two struts; add one.")
    pairs = [[members.node(table[column][row], table.at(row)) for column in columns] for row in range(len(table))]
    struts = np.array(pairs)
    chord = np.linalg.norm(members.nodes[struts[:, 1]] - members.nodes[struts[:, 0]], axis=1)
    if np.any(chord == 0.0):
        row = int(np.flatnonzero(chord == 0.0)[0])
        raise SceneError(f"{table.at(row)}: leading and trailing edge are one point; name two nodes apart.")
    for row in _upwind(content, members.nodes[struts]):
        raise SceneError(
            f"{table.at(int(row))}: the trailing edge lies upwind of the leading edge; swap the two nodes or turn "
            "wind_direction in scene.toml."
        )
    y = members.nodes[struts, 1].mean(axis=1)
    if np.any(np.diff(y) <= 0.0):
        row = int(np.flatnonzero(np.diff(y) <= 0.0)[0]) + 1
        raise SceneError(
            f"{table.at(row)}: struts must go from the left tip (y < 0) to the right one; reorder the rows."
        )
    return struts
