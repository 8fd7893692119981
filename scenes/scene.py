"""A scene as it is solved: arrays and plain data, from which the solver cores are made."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from .interface import Interface
from .members import Members, PointLoad
from .schema import (
    AeroInput,
    BodyInput,
    Choices,
    DynamicsInput,
    SceneError,
    Setting,
    StructureInput,
    TrimInput,
    WingInput,
)

if TYPE_CHECKING:
    from aero.model import AeroModel
    from aero.trim import Trims

    from .cores import Core
    from .cores.heading import Heading

    Cores = dict[str, Core]


SAME = 1e-9  # m, by which turned shapes differ with the machine that turned them, and more


@dataclass(frozen=True, eq=False)
class SectionPolars:
    """Polars `cl`, `cd`, `cm` (p,k) over `alpha` (k,) rad, their end values beyond the `ends` (p,2) rad of their data.

    `polar` (sections,) is the one that each design section has, at `span` (sections,) m along the line of their
    quarter-chord points; `strips` (n,) m is the place on this line that is nearest to the quarter-chord point of each
    strip.
    """

    alpha: np.ndarray
    cl: np.ndarray
    cd: np.ndarray
    cm: np.ndarray
    ends: np.ndarray
    polar: np.ndarray
    span: np.ndarray
    strips: np.ndarray


@dataclass(frozen=True)
class Source:
    """Where a scene was read: its `folder`, the `files` in it that it is made of, and the settings that it `offers`."""

    folder: Path
    files: tuple[str, ...]
    offers: dict[str, Setting]


@dataclass(frozen=True, eq=False)
class Start:
    """A shape at rest to start from instead of the one that is `drawn`, the design shape as it is turned for the start:
    positions (n,3) m of the nodes and displacements (m,3) m of the interface, of either shape.
    """

    drawn_nodes: np.ndarray
    drawn_displacement: np.ndarray
    nodes: np.ndarray
    displacement: np.ndarray

    def of_nodes(self, x: np.ndarray) -> np.ndarray:
        """Positions (n,3) m to start from, where x were drawn: those of this start, if it belongs to them."""
        return self.nodes if np.allclose(x, self.drawn_nodes, rtol=0.0, atol=SAME) else x

    def of_interface(self, displacement: np.ndarray) -> np.ndarray:
        """The same of displacements (m,3) m of the interface."""
        same = np.allclose(displacement, self.drawn_displacement, rtol=0.0, atol=SAME)
        return self.displacement if same else displacement


def _key(parameters: Mapping[str, Any]) -> str:
    """One word for parameters, whatever their order."""
    return repr(sorted((name, np.asarray(value, dtype=float).tolist()) for name, value in parameters.items()))


@dataclass(frozen=True, eq=False)
class Scene:
    """One checked scene, quasi-static or transient.

    `settings` are the choices that it offers, as they are chosen, and `choices` all choices; then the sections of
    scene.toml, None where it lacks one: without `structure` the wing is rigid and has an aerodynamic side alone.
    `members` is the structure, `interface` the mesh that structure and flow share, `struts` (s,2) leading and trailing
    edge nodes, `polars` those of its sections, `pivot` the node that the structure pitches about, `start` where
    a transient scene starts if that is known. `source` is not known of a scene that an FMU carries.
    """

    name: str
    title: str
    description: str
    settings: dict[str, Any]
    choices: Choices
    structure: StructureInput | None
    wing: WingInput | None
    aero: AeroInput | None
    trim: TrimInput | None
    dynamics: DynamicsInput | None
    members: Members = field(repr=False)
    interface: Interface = field(repr=False)
    struts: np.ndarray = field(repr=False)
    polars: SectionPolars | None = field(repr=False)
    point_loads: tuple[PointLoad, ...] = field(repr=False)
    pivot: int | None
    source: Source | None = field(repr=False, default=None)
    start: Start | None = field(repr=False, default=None)
    body: BodyInput | None = None

    @property
    def folder(self) -> Path:
        """The folder that the scene was read from; SceneError where that is not known."""
        return self._read_from.folder

    @property
    def files(self) -> tuple[str, ...]:
        """The files in its folder that the scene is made of, for the chosen settings."""
        return self._read_from.files

    @property
    def offers(self) -> dict[str, Setting]:
        """The settings that the scene offers."""
        return self._read_from.offers

    @property
    def _read_from(self) -> Source:
        if self.source is None:
            raise SceneError(f"scene '{self.name}' comes from an FMU; its tables and settings are not known.")
        return self.source

    @property
    def transient(self) -> bool:
        """Whether the scene is transient, with masses and integrated in time; quasi-static else."""
        return self.dynamics is not None

    @property
    def moves(self) -> bool:
        """`transient` by its former name, until the next release."""
        return self.transient

    @property
    def has_flow(self) -> bool:
        """Whether the scene has an aerodynamic side."""
        return self.aero is not None

    @property
    def has_structure(self) -> bool:
        """Whether the scene has a structural side; without one its wing is rigid."""
        return self.structure is not None

    @property
    def has_wing(self) -> bool:
        """Whether it has a wing or another body in the flow, not lines alone."""
        return self.wing is not None or self.body is not None

    @property
    def symmetric(self) -> bool:
        """Whether one half is to be solved at the start."""
        if self.structure is not None:
            return self.structure.symmetric
        return self.aero is not None and bool(self.aero.symmetric)

    @property
    def inflates(self) -> bool:
        """Whether it is a closed wing of membranes, flat as drawn, which the first loads inflate."""
        membranes = self.members.membranes
        return membranes is not None and membranes.skin is not None and self.has_flow

    @property
    def moments_about(self) -> tuple[str, np.ndarray]:
        """What the moments of the flow are about, in a word, and the place (3,) m."""
        if self.pivot is not None:
            return "pivot", self.members.nodes[self.pivot]
        if self.aero is not None and self.aero.reference_point is not None:
            return "reference point", np.array(self.aero.reference_point)
        return "origin", np.zeros(3)

    @property
    def communication_step(self) -> float:
        """Usual communication step, s; in quasi-static scenes it is pseudo-time."""
        return 1.0 if self.dynamics is None else self.dynamics.communication_step

    def starting_at(self, drawn: tuple[np.ndarray, np.ndarray], found: tuple[np.ndarray, np.ndarray]) -> "Scene":
        """The scene that starts in a shape `found` where another was `drawn`: nodes and displacement, see `Start`."""
        return replace(self, start=Start(*drawn, *found))

    def carried(self, side: str) -> "Scene":
        """The scene with what the core of one side needs and no more, "structural" or "aero", as its FMU carries it."""
        if side == "structural":
            return replace(self, source=None, polars=None, members=self.members.meshed())
        interface = replace(self.interface, weights=csr_array((0, 0)))
        return replace(self, source=None, point_loads=(), members=self.members.bare(), interface=interface)

    def structural_core(self) -> "Core":
        """The structural solver core of this scene; SceneError where it has no structure."""
        if not self.has_structure:
            raise SceneError(f"scene '{self.name}' has no structure: its scene.toml has no [structure].")
        from .cores import Core

        if self.transient:
            from .cores.transient import Transient

            return Core(Transient(self))
        from .cores.statics import Statics

        return Core(Statics(self))

    def aero_core(self) -> "Core":
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

    def cores(self) -> "Cores":
        """Side -> solver core: structural where the scene has a structure, aero where it has a flow."""
        structural = {"structural": self.structural_core()} if self.has_structure else {}
        return structural | ({"aero": self.aero_core()} if self.has_flow else {})

    @cached_property
    def heading(self) -> "Heading":
        """The axes of its kite, which turn with it about the upright axis."""
        from .cores.heading import Heading

        return Heading(self)

    @cached_property
    def wing_model(self) -> "AeroModel | None":
        """The model of the flow around the wing, None where the scene has no wing in a flow."""
        if self.aero is None or not self.has_wing:
            return None
        from aero.methods import wing_model
        from aero.model import Wing

        options = {**self.aero.options, "camber": self.choices.camber_feedback == "on"}
        i, symmetric = self.interface, self.symmetric
        if self.body is not None:
            polars = None if self.polars is None else self.strip_polars
            whole = Wing(i, options, symmetric, None, None, polars, self.transient, i.trailing_edges)
            return wing_model(self.aero.method, whole)
        of_strips = i.sections, i.fractions, self.strip_polars
        return wing_model(self.aero.method, Wing(i, options, symmetric, *of_strips, self.transient))

    @cached_property
    def lines_model(self) -> "AeroModel | None":
        """The model of the drag of its exposed lines, None without any."""
        if self.aero is None or not len(self.interface.lines):
            return None
        from aero.line_drag import LinesInWind

        about, _ = self.moments_about
        air = self.aero.line_normal_drag, self.aero.line_friction, about, self.transient
        return LinesInWind(self.interface.lines, self.interface.diameter, self.choices.line_area, *air)

    @cached_property
    def loads(self) -> tuple[str, ...]:
        """Names of the loads that its flow puts on the interface; without a flow, those that may be set by hand."""
        from aero.methods import wing_loads

        on_panels: tuple[str, ...] = ("pressure",)
        if self.aero is not None and self.has_wing:
            on_panels = wing_loads(self.aero.method, self.aero.options)
        panels = on_panels if len(self.interface.panels) else ()
        return (*panels, *(("line_load",) if len(self.interface.lines) else ()))

    def strip_polars(self) -> Any:
        """The polars (`StripPolars`) of the strips of a wing: between the sections of the interface, or of a body."""
        from aero.polars import StripPolars

        if self.polars is None:
            raise SceneError(f"scene '{self.name}' has no polars: neither [wing] nor [body] in scene.toml names any.")
        p = self.polars
        tables = p.cl[p.polar], p.cd[p.polar], p.cm[p.polar]
        return StripPolars.from_tables(p.alpha, *tables, p.span, p.strips, p.ends[p.polar])

    def remarks(self, outputs: dict[str, np.ndarray]) -> list[str]:
        """What the models of the flow have to say of their outputs."""
        models = [m for m in (self.wing_model, self.lines_model) if m is not None]
        return [remark for model in models for remark in model.remarks(outputs)]

    def notes(self) -> list[str]:
        """What is worth a line of its tables in every run."""
        if self.structure is None:
            return list(self.interface.remarks)
        from .checks import bare_line_ends

        membranes = self.members.membranes
        notes = [] if membranes is None else list(membranes.remarks)
        bare = bare_line_ends(self.members, self.point_loads, self.structure.line_density / self.choices.scale)
        if not bare:
            return notes
        more = f" and {len(bare) - 6} more" if len(bare) > 6 else ""
        return [
            *notes,
            f"lines that end free, where nothing but their own weight and the wind pulls: {', '.join(bare[:6])}{more}",
        ]

    def hints(self, parameters: Mapping[str, Any] | None = None) -> tuple[list[str], str]:
        """What looks odd in the structure with these parameters: elements far off their rest length in the design
        shape, and the first thing that breaks its symmetry ("" if nothing does).
        """
        if not self.has_structure:
            return [], ""
        from .checks import asymmetry, prestrained
        from .cores.structure import StructuralModel

        core, given = self.structural_core(), parameters or {}
        for parameter in given.keys() & set(core.names):
            core.set(parameter, given[parameter])
        values = {block: core.get(block) for block in core.names}
        model = StructuralModel(self)
        return prestrained(self.members.nodes, model.chains(values)), asymmetry(model.members, model.groups(values))

    def trim_angle(self, parameters: Mapping[str, Any] | None = None, cores: "Cores | None" = None) -> float:
        """Rigid rotation (rad, nose-up) about the pivot with no pitching moment: where a coupled solve starts.

        Zero for a scene that is not free to pitch; else the start of `trims`, with its arguments.
        """
        if self.trim is None:
            return 0.0
        start = self.trims(parameters, cores).start
        assert start is not None
        return start.angle

    def trims(self, parameters: Mapping[str, Any] | None = None, cores: "Cores | None" = None) -> "Trims":
        """All rotations (rad, nose-up) about the pivot between those of [trim] at which the rigid wing does not pitch.

        `parameters` override the start values of the cores; `cores` of this scene, where there are some, take them and
        are as they were otherwise. SceneError where none is stable and lifts, and for a scene that is not free to
        pitch.
        """
        if self.trim is None:
            raise SceneError(f"scene '{self.name}' is not free to pitch: its scene.toml has no [trim].")
        from .cores.trim import trim_points

        given = dict(parameters or {})
        found = trim_points(self, given, cores or self.cores())
        self._trims[_key(given)] = found
        return found

    @cached_property
    def _trims(self) -> "dict[str, Trims]":
        """What was found for parameters."""
        return {}

    def _require_held(self, fixed: np.ndarray) -> None:
        """SceneError for a kite that hangs on a tether, which would be turned with it."""
        if not fixed.all():
            raise SceneError(
                f"{self.name}: a kite on a tether starts as it is drawn, in a wind that is turned to it; give "
                "start_angle in deg (the trim that it finds with tether_length = 0 is a good one), or trim_angle."
            )

    def trim_notes(self, parameters: Mapping[str, Any]) -> list[str]:
        """A sentence on further attitudes in which the rigid wing would not pitch, where a start was looked for with
        these parameters and there are some.
        """
        found = self._trims.get(_key({k: v for k, v in parameters.items() if k != "trim_angle"}))
        if found is None or found.start is None or len(found.points) < 2:
            return []
        more = [
            f"{np.rad2deg(p.angle):.2f} deg ({'' if p.stable else 'un'}stable{'' if p.lift > 0.0 else ', no lift'})"
            for p in found.points
            if p is not found.start
        ]
        at = f"{np.rad2deg(found.start.angle):.2f} deg"
        return [f"started where the rigid wing does not pitch, turned by {at}; it does not at {', '.join(more)} either"]

    def with_trim(self, parameters: Mapping[str, Any] | None = None, cores: "Cores | None" = None) -> dict[str, Any]:
        """The parameters, and where the scene is a kite that is free to turn, what makes it start in their wind: the
        azimuth at which it looks into it and the trim angle, each where it is not given.
        """
        given = dict(parameters or {})
        if self.trim is None or self.aero is None:
            return given
        if "start_azimuth" not in given:
            from .cores.heading import start_azimuth

            turned = start_azimuth(self, given.get("wind_direction", self.aero.wind_direction))
            given |= {"start_azimuth": turned} if turned else {}
        if "trim_angle" not in given:
            turned = self.choices.start_angle  # of the wind: the wing starts in it as it is drawn
            if not turned and self.body is not None and self.pivot is not None:
                self._require_held(self.members.fixed[self.pivot])
            given["trim_angle"] = 0.0 if turned else self.trim_angle(given, cores)
        return given
