"""What a scene.toml may say: its sections as dataclasses, with what each value must be.

A key is a field: its annotation says what it is checked by, its default what a scene has without it; a field without a
default must be given. Values are in the units that the docstrings name. `readers.description` fills them.
"""

import math
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Annotated, Any

from interface.line_drag import FRICTION, NORMAL_DRAG

BODIES = ("wing", "parafoil", "box-wing", "mesh-file")
PROFILE_SPACINGS = ("cosine", "geometric", "uniform")
SHAPES = ("rectangle", "disc", "airbag", "cylinder", "sphere", "ruled", "body")
LARGEST = 1e100  # of a number in a scene, whose squares and cubes are numbers too; so are those of 1 / LARGEST
INTEGRATION = ("implicit-euler", "generalised-alpha", "bdf2")


class SceneError(ValueError):
    """Something in a scene or in the settings given for it is wrong; the message is one sentence with the remedy."""


class Wrong(ValueError):
    """What a value should have been."""


@dataclass(frozen=True)
class Number:
    """A finite number from `low` to `high`, or greater than `above`."""

    low: float = -math.inf
    above: float = -math.inf
    high: float = math.inf

    @property
    def meaning(self) -> str:
        """The kind of number, for a sentence."""
        if self.high < math.inf:
            return f"a number from {self.low:g} to {self.high:g}"
        if self.above > -math.inf:
            return f"a finite number above {self.above:g}"
        return "a finite number" if self.low == -math.inf else f"a finite number, {self.low:g} or more"

    def __call__(self, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise Wrong(self.meaning)
        try:
            number = float(value)
        except OverflowError:
            raise Wrong(self.meaning) from None
        if math.isfinite(number) and abs(number) > LARGEST:
            raise Wrong(f"{self.meaning}, of at most {LARGEST:g}")
        if not math.isfinite(number) or not self.low <= number <= self.high or number <= self.above:
            raise Wrong(self.meaning)
        return number


@dataclass(frozen=True)
class Whole:
    """A whole number from `low` to `high`."""

    low: int
    high: int

    def __call__(self, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not self.low <= value <= self.high:
            raise Wrong(f"a whole number from {self.low} to {self.high}")
        return value


@dataclass(frozen=True)
class OneOf:
    """One of some texts."""

    choices: tuple[str, ...]

    def __call__(self, value: Any) -> str:
        if not isinstance(value, str) or value not in self.choices:
            raise Wrong("one of: " + ", ".join(self.choices))
        return value


def a_file(value: Any) -> str:
    """The name of a file in the scene's folder."""
    if not isinstance(value, str) or not value.isprintable() or PurePath(value).name != value:
        raise Wrong("the name of a file in the scene's folder")
    return value


def a_node(value: Any) -> str:
    """The name of a node."""
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise Wrong("the name of a node")
    return str(value)


def a_flag(value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise Wrong("true or false")
    return value


def a_method(value: Any) -> str:
    """The name of a method for the flow."""
    from aero.methods import methods

    return OneOf(methods())(value)


def a_direction(value: Any) -> tuple[float, ...]:
    """A vector of any length above zero."""
    meaning = "three finite numbers that are not all zero"
    if not isinstance(value, list) or len(value) != 3:
        raise Wrong(meaning)
    try:
        numbers = tuple(Number()(v) for v in value)
    except Wrong:
        raise Wrong(meaning) from None
    if not any(numbers):
        raise Wrong(meaning)
    return numbers


def a_point(value: Any) -> tuple[float, ...]:
    """A point in space."""
    meaning = "three finite numbers"
    if not isinstance(value, list) or len(value) != 3:
        raise Wrong(meaning)
    try:
        return tuple(Number()(v) for v in value)
    except Wrong:
        raise Wrong(meaning) from None


def lists_of_lines(value: Any) -> dict[str, tuple[str, ...]]:
    """Parameter -> names of lines."""
    meaning = "a table of parameter names, each with a list of line names"
    if not isinstance(value, dict):
        raise Wrong(meaning)
    for name, lines in value.items():
        if not name.isidentifier() or not isinstance(lines, list) or not lines:
            raise Wrong(f"{meaning} ({name} has none)")
        if not all(isinstance(line, str) for line in lines):
            raise Wrong(meaning)
    return {name: tuple(lines) for name, lines in value.items()}


def named_numbers(value: Any) -> dict[str, float]:
    """Name -> number."""
    if not isinstance(value, dict):
        raise Wrong("a table of names, each with a number")
    try:
        return {name: Number()(v) for name, v in value.items()}
    except Wrong:
        raise Wrong("a table of names, each with a finite number") from None


def a_text(value: Any) -> str:
    """A text that is not empty."""
    if not isinstance(value, str) or not value:
        raise Wrong("a text")
    return value


def a_share(value: Any) -> float:
    """A number above -1 and below 1, Poisson's ratio of what is alike in all directions."""
    meaning = "a number between -1 and 1, both excluded"
    try:
        number = Number(above=-1.0)(value)
    except Wrong:
        raise Wrong(meaning) from None
    if number >= 1.0:
        raise Wrong(meaning)
    return number


def numbers(value: Any) -> tuple[float, ...]:
    """A list of numbers."""
    meaning = "a list of finite numbers"
    if not isinstance(value, list) or not value:
        raise Wrong(meaning)
    try:
        return tuple(Number()(v) for v in value)
    except Wrong:
        raise Wrong(meaning) from None


def shortenings(value: Any) -> tuple[tuple[float, float], ...]:
    """Pairs of numbers, none where the list is empty."""
    meaning = "a list of pairs, each a share of the chord and per cent"
    if not isinstance(value, list) or not all(isinstance(pair, list) and len(pair) == 2 for pair in value):
        raise Wrong(meaning)
    try:
        return tuple((Number()(share), Number()(percent)) for share, percent in value)
    except Wrong:
        raise Wrong(meaning) from None


def texts(value: Any) -> tuple[str, ...]:
    """One text or a list of some."""
    found = [value] if isinstance(value, str) else value
    if not isinstance(found, list) or not found or not all(isinstance(t, str) and t for t in found):
        raise Wrong("a name or a list of names")
    return tuple(found)


def texts_or_none(value: Any) -> tuple[str, ...]:
    """One text, a list of some, or none where it is empty."""
    return () if value in ("", []) else texts(value)


def named_directions(value: Any) -> dict[str, str]:
    """Name -> directions that are held."""
    meaning = 'a table of group names, each with the directions that are held, as "xyz" or "z"'
    if not isinstance(value, dict):
        raise Wrong(meaning)
    for name, axes in value.items():
        if not isinstance(axes, str) or not axes or set(axes) - set("xyz") or len(set(axes)) < len(axes):
            raise Wrong(f"{meaning} ({name} has {axes!r})")
    return dict(value)


@dataclass(frozen=True)
class TableOf:
    """One table, filled into a dataclass `kind` as sections are."""

    kind: type

    def __call__(self, value: Any) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise Wrong("a table")
        return value


@dataclass(frozen=True)
class Tables:
    """Tables by name, each of them filled into a dataclass `kind` as sections are."""

    kind: type

    def __call__(self, value: Any) -> dict[str, Any]:
        if not isinstance(value, dict) or not all(isinstance(table, dict) for table in value.values()):
            raise Wrong("tables with names of their own")
        return value


def a_tip_chord(value: Any) -> float:
    """A length above zero, of a tip that is no point."""
    try:
        return Number(above=0.0)(value)
    except Wrong as wanted:
        raise Wrong(f"{wanted} (cut a tip that ends in a point where its chord is a twentieth of that)") from None


Finite = Annotated[float, Number()]
Positive = Annotated[float, Number(above=0.0)]
NotNegative = Annotated[float, Number(low=0.0)]
File = Annotated[str, a_file]
Node = Annotated[str, a_node]
Flag = Annotated[bool, a_flag]
Lines = Annotated[dict[str, tuple[str, ...]], lists_of_lines]
Texts = Annotated[tuple[str, ...], texts]
Numbers = Annotated[dict[str, float], named_numbers]
NumberList = Annotated[tuple[float, ...], numbers]
Angle = Annotated[float, Number(low=-89.0, high=89.0)]
Percent = Annotated[float, Number(low=-50.0, high=50.0)]


@dataclass(frozen=True)
class StructureInput:
    """[structure]: tables of nodes and elements, and what all of them share.

    Tables are `nodes` (which a scene of membranes alone does without), `springs`, `canopy` quads, `lines`, point
    `masses`; `ribs`, `tubes` and `attachments` of an inflatable wing; `loads` on nodes. `line_modulus` Pa and
    `line_density` kg/m^3 of lines; `gravity` m/s^2 towards -z; `symmetric`: solve one half; `pivot` the node that the
    structure pitches about, `hold` that at which roll and yaw can be held. Of an inflatable wing: `tube_pressure` Pa
    above that of the air, `tube_stiffness` and `tube_shear_stiffness` N/m of the fabric of tubes, `wing_mass` kg,
    `canopy_stiffness` and `canopy_shear_stiffness` N/m, `canopy_density` kg/m^2, `canopy_bending_stiffness` N m.
    `tapes` and `reels` are parameters with the lines that they lengthen, `load_values` the start values N of the
    parameters in the table `loads`.
    """

    nodes: File | None = None
    springs: File | None = None
    canopy: File | None = None
    lines: File | None = None
    masses: File | None = None
    line_modulus: Positive | None = None
    line_density: NotNegative = 0.0
    gravity: Finite = 9.81
    symmetric: Flag = False
    pivot: Node | None = None
    hold: Node | None = None
    ribs: File | None = None
    tubes: File | None = None
    attachments: File | None = None
    tube_pressure: Finite | None = None
    tube_stiffness: Positive | None = None
    tube_shear_stiffness: Positive | None = None
    wing_mass: NotNegative | None = None
    canopy_bending_stiffness: Positive | None = None
    canopy_stiffness: Positive | None = None
    canopy_shear_stiffness: Positive | None = None
    canopy_density: NotNegative = 0.0
    loads: File | None = None
    load_values: Numbers = field(default_factory=dict)
    tapes: Lines = field(default_factory=dict)
    reels: Lines = field(default_factory=dict)


@dataclass(frozen=True)
class WingInput:
    """[wing]: tables of the lifting surface: `struts` that carry strips, design `sections`, and `polars` of these."""

    struts: File | None = None
    sections: File = field(kw_only=True)
    polars: File = field(kw_only=True)


@dataclass(frozen=True)
class LinearWindInput:
    """[aero.linear_wind]: a wind that grows along the line from the point `ground` (3,) m, where it has `ground_share`
    of its speed, to the point `kite` (3,) m, where it has all of it; none: the point that moments are about.
    """

    ground: Annotated[tuple[float, ...], a_point] = field(kw_only=True)
    kite: Annotated[tuple[float, ...], a_point] | None = None
    ground_share: Annotated[float, Number(low=0.0, high=10.0)] = 0.0


@dataclass(frozen=True)
class RotationInput:
    """[aero.rotation]: the flow that a kite meets as it turns at the angular velocity `rate` (3,) rad/s about the point
    `centre` (3,) m; none: the point that moments are about.
    """

    rate: Annotated[tuple[float, ...], a_point] = field(kw_only=True)
    centre: Annotated[tuple[float, ...], a_point] | None = None


@dataclass(frozen=True)
class AeroInput:
    """[aero]: the wind and the `method` for the flow around the wing.

    `wind_speed` m/s, `wind_direction` (3,) of any length, `air_density` kg/m^3, `reference_area` m^2 of the
    coefficients; `line_normal_drag` and `line_friction` are coefficients of lines in the wind. `reference_chord` and
    `reference_span` m are lengths of the moment coefficients of `kitecosim polar`; `reference_point` (3,) m is what
    moments are about in a scene without a pivot. `symmetric`: solve one half, in a scene without [structure], which
    says it else. `linear_wind` and `rotation` are tables: a wind that differs from place to place. `options` are the
    keys that only this method has.
    """

    method: Annotated[str, a_method] = "vortex-step"
    wind_speed: Positive = field(kw_only=True)
    wind_direction: Annotated[tuple[float, ...], a_direction] = (1.0, 0.0, 0.0)
    air_density: Positive = 1.225
    reference_area: Positive | None = None
    line_normal_drag: NotNegative = NORMAL_DRAG
    line_friction: NotNegative = FRICTION
    reference_chord: Positive | None = None
    reference_span: Positive | None = None
    reference_point: Annotated[tuple[float, ...], a_point] | None = None
    symmetric: Flag | None = None
    linear_wind: Annotated[LinearWindInput | None, TableOf(LinearWindInput)] = None
    rotation: Annotated[RotationInput | None, TableOf(RotationInput)] = None
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class TrimInput:
    """[trim]: the range of nose-up angles, `lowest_deg` to `highest_deg`, in which a kite is trimmed before a run."""

    lowest_deg: Finite = -5.0
    highest_deg: Finite = 25.0


@dataclass(frozen=True)
class DynamicsInput:
    """[dynamics]: what makes a scene a transient one.

    `scheme` of integration with its `spectral_radius`; `longest_step`, `communication_step` and `stop_time` s;
    `line_damping_time` and `spring_damping_time` s, damping over stiffness; `start_in_equilibrium`; gusts of
    `gust_speed` m/s from `gust_start` s, each for `gust_duration` s, every `gust_interval` s (0: one only).
    """

    scheme: Annotated[str, OneOf(INTEGRATION)] = "generalised-alpha"
    spectral_radius: Annotated[float, Number(low=0.0, high=1.0)] = 0.0
    longest_step: Positive = 0.01
    communication_step: Positive = 0.02
    stop_time: Positive = 10.0
    line_damping_time: NotNegative = 0.0
    spring_damping_time: NotNegative = 0.0
    start_in_equilibrium: Flag = False
    gust_speed: Finite = 0.0
    gust_start: NotNegative = 0.0
    gust_duration: Positive = 5.0
    gust_interval: NotNegative = 0.0


@dataclass(frozen=True)
class FabricInput:
    """[membranes.fabrics.NAME]: what the membranes of some `parts` (groups of triangles; none: all) are made of.

    Alike in all directions: `stiffness` E h N/m, or `modulus` Pa and `thickness` m, and `poisson`. Else
    `stiffness_warp`, `stiffness_weft` and `shear_stiffness` N/m, `poisson_warp` (contraction along the weft over
    stretch along the warp), and `warp_direction` (3,), whose trace on a triangle is its warp. `density` kg/m^2;
    `strength` N/m, up to which the larger principal force per length is borne; `shortening_along` and
    `shortening_across` the warp, per cent by which the cut is shorter than the mesh.
    """

    parts: Texts | None = None
    stiffness: Positive | None = None
    modulus: Positive | None = None
    thickness: Positive | None = None
    poisson: Annotated[float, a_share] | None = None
    stiffness_warp: Positive | None = None
    stiffness_weft: Positive | None = None
    shear_stiffness: Positive | None = None
    poisson_warp: Finite | None = None
    warp_direction: Annotated[tuple[float, ...], a_direction] | None = None
    density: NotNegative = 0.0
    strength: Positive | None = None
    shortening_along: Percent = 0.0
    shortening_across: Percent = 0.0


@dataclass(frozen=True)
class PressureInput:
    """[membranes.pressures.NAME]: a pressure that follows the membranes, a parameter.

    `value` Pa along the normals at first, on `parts` (groups of triangles; none: all); `closed`: that they close a
    volume is required.
    """

    value: Finite = 0.0
    parts: Texts | None = None
    closed: Flag = False


@dataclass(frozen=True)
class CableInput:
    """[membranes.cables.NAME]: cables along the lines of a `group`, NAME where it is not given.

    `axial_stiffness` EA N, `mass_per_length` kg/m, and `shortening`, per cent by which they are cut shorter than the
    lines are.
    """

    axial_stiffness: Positive = field(kw_only=True)
    group: Texts | None = None
    mass_per_length: NotNegative = 0.0
    shortening: Percent = 0.0


@dataclass(frozen=True)
class MembranesInput:
    """[membranes]: membranes on a mesh of triangles.

    The mesh is a file `mesh`, with `unit` of its lengths (none: m), the cell data `groups` that say what groups its
    elements are in (none: those of its format), `drop_loose_nodes` and `parts_may_be_apart`; or it is made: a `shape`
    of sizes `size`, the `share` of it ("whole", ...), how quads are cut by `diagonals`, ends of a cylinder with `caps`,
    and the table `profiles` of a ruled surface. The shape "body" is the skin of [body], two triangles a panel, with
    ribs; `attachments` are points of all ribs by name, on the lower side at a share of the chord, and the list
    `panel_shortening` of pairs, a share of the chord and per cent, says by how much its panels are cut narrower across
    the span. `order` 1 or 2 of the
    triangles. `patterns` is a table of triangles whose sides are cut in other lengths. `wrinkling`: folds instead of
    compression. `tie` m: nodes of the mesh this near to one of the table of nodes are that node. `fabrics`, `pressures`
    and `cables` are tables by name, `supports` groups with the directions that are held.
    """

    mesh: File | None = None
    unit: Annotated[str, OneOf(("m", "cm", "mm", "ft", "in"))] | None = None
    groups: Annotated[str, a_text] | None = None
    drop_loose_nodes: Flag = False
    parts_may_be_apart: Flag = False
    shape: Annotated[str, OneOf(SHAPES)] | None = None
    size: Numbers = field(default_factory=dict)
    share: Annotated[str, OneOf(("whole", "half", "quarter", "eighth", "upper"))] = "whole"
    diagonals: Annotated[str, OneOf(("crossed", "union-jack", "one-way", "shorter"))] = "crossed"
    caps: Flag = True
    profiles: File | None = None
    attachments: Numbers = field(default_factory=dict)
    panel_shortening: Annotated[tuple[tuple[float, float], ...], shortenings] = ()
    order: Annotated[int, Whole(1, 2)] = 1
    patterns: File | None = None
    wrinkling: Flag = True
    tie: NotNegative = 1e-6
    fabrics: Annotated[dict[str, FabricInput], Tables(FabricInput)] = field(default_factory=dict)
    supports: Annotated[dict[str, str], named_directions] = field(default_factory=dict)
    pressures: Annotated[dict[str, PressureInput], Tables(PressureInput)] = field(default_factory=dict)
    cables: Annotated[dict[str, CableInput], Tables(CableInput)] = field(default_factory=dict)


@dataclass(frozen=True)
class BodyInput:
    """[body]: the closed surface of a wing, or of another body, for a flow around bodies.

    `shape` "wing", "parafoil", "box-wing" or "mesh-file". All but the last have a `profile`: NACA digits ("naca 2412",
    "23012") or a file of coordinates; or weights of CST, `upper_weights` and `lower_weights` (none: those of the upper
    side), both away from the chord. `panels` round the profile, with `panel_spacing` along each side: "cosine",
    "uniform", or "geometric" where each panel is longer by `panel_growth` % than that before it, from the nose to the
    trailing edge.
    A wing has `span` m, along its arc if it has one, `chord` m in the middle and `tip_chord` m (none: as in the
    middle), the `planform` between them "tapered" or "elliptic"; `sweep` deg, back, of the line at the share `axis` of
    the chord, about which `twist` deg, nose up, of the tip turns; `dihedral` deg, tips up, or `arc` deg, half the angle
    of the circle that it follows, tips down. Or the table `stations` has places, chords and profiles. `strips` of each
    half, or between two stations of the table, spaced by `strip_spacing`: "uniform", or "cosine", close together at the
    tips; `tip` "flat", "round" of `tip_strips` panels, or "sewn".
    A parafoil is such a wing of `cells` in all, an even number, with `strips` each, ruled between its ribs: of each
    half the `equal_cells` in the middle (none: all) are as wide as each other, and the others narrow by equal steps to
    `last_cell` of that width at the tip. In its table `stations` each row is a rib, from y = 0 to the right tip.
    Its `inlets` must be "closed".
    A box wing has `span`, `chord`, `height` and `corner_radius` m, and in each half `strips` on each wing,
    `plate_strips` on the end plate and `corner_strips` in each corner.
    A file is a `mesh` with `unit` of its lengths (none: m) and the cell data `groups` that say what groups its elements
    are in; its lines in the groups `trailing_edges` are these (none: they are found; an empty text: there are none).
    The drag of strips is that of section `polars`, a file: of its only one, of the one named `polar`, or of those in
    the column polar of the table of stations.
    """

    shape: Annotated[str, OneOf(BODIES)] = field(kw_only=True)
    profile: Annotated[str, a_text] | None = None
    upper_weights: NumberList | None = None
    lower_weights: NumberList | None = None
    panels: Annotated[int, Whole(10, 1000)] | None = None
    panel_spacing: Annotated[str, OneOf(PROFILE_SPACINGS)] = "cosine"
    panel_growth: Annotated[float, Number(low=0.0, high=100.0)] = 5.0
    span: Positive | None = None
    chord: Positive | None = None
    tip_chord: Annotated[float, a_tip_chord] | None = None
    planform: Annotated[str, OneOf(("tapered", "elliptic"))] = "tapered"
    sweep: Angle = 0.0
    axis: Annotated[float, Number(low=0.0, high=1.0)] = 0.25
    twist: Angle = 0.0
    dihedral: Angle = 0.0
    arc: Annotated[float, Number(low=0.0, high=170.0)] = 0.0
    stations: File | None = None
    strips: Annotated[int, Whole(1, 1000)] | None = None
    strip_spacing: Annotated[str, OneOf(("uniform", "cosine"))] = "uniform"
    cells: Annotated[int, Whole(2, 1000)] | None = None
    equal_cells: Annotated[int, Whole(1, 500)] | None = None
    last_cell: Annotated[float, Number(above=0.0)] = 1.0
    inlets: Annotated[str, OneOf(("closed", "open"))] = "closed"
    tip: Annotated[str, OneOf(("flat", "round", "sewn"))] = "flat"
    tip_strips: Annotated[int, Whole(2, 100)] = 4
    height: Positive | None = None
    corner_radius: Positive | None = None
    plate_strips: Annotated[int, Whole(1, 1000)] | None = None
    corner_strips: Annotated[int, Whole(1, 100)] = 3
    mesh: File | None = None
    unit: Annotated[str, OneOf(("m", "cm", "mm", "ft", "in"))] | None = None
    groups: Annotated[str, a_text] | None = None
    trailing_edges: Annotated[tuple[str, ...], texts_or_none] | None = None
    polars: File | None = None
    polar: Annotated[str, a_text] | None = None


@dataclass(frozen=True)
class BridleInput:
    """[bridle]: the lines of a parafoil, straight from its ribs to the pilot point.

    `rows` are lines of all ribs by name, at a share of the chord on their lower side; the node `pilot` is `depth` m
    below the chord of the middle rib, normal to it, at `trim` per cent of it from the nose on. Lines have the
    `diameter` m, and modulus and density as [structure] has them. `cascade` ribs beside each other share a line of each
    row from the share `cascade_share` of the way up on (1: none do); lines of the `belt_ribs` outermost ribs on each
    side run into a belt at the share `belt_share` of it, of `belt_diameter` m (none: as the lines). `control_unit_mass`
    kg is at the pilot point. A tether of `tether_length` m (0: none, and the pilot point is held) in `tether_elements`
    has `tether_diameter` m.
    """

    rows: Numbers = field(kw_only=True)
    depth: Positive = field(kw_only=True)
    trim: Annotated[float, Number(low=-50.0, high=150.0)] = 42.0
    diameter: Positive = field(kw_only=True)
    cascade: Annotated[int, Whole(1, 100)] = 1
    cascade_share: Annotated[float, Number(low=0.05, high=0.95)] = 0.5
    belt_ribs: Annotated[int, Whole(0, 500)] = 0
    belt_share: Annotated[float, Number(low=0.05, high=0.95)] = 0.2
    belt_diameter: Positive | None = None
    control_unit_mass: NotNegative = 0.0
    tether_length: Annotated[float, Number(low=0.0, high=10e3)] = 0.0
    tether_diameter: Positive | None = None
    tether_elements: Annotated[int, Whole(1, 1000)] = 50


SECTIONS = {
    "structure": StructureInput,
    "membranes": MembranesInput,
    "body": BodyInput,
    "bridle": BridleInput,
    "wing": WingInput,
    "aero": AeroInput,
    "trim": TrimInput,
    "dynamics": DynamicsInput,
}


@dataclass(frozen=True)
class Choices:
    """What the settings of a scene choose when it is read; what it does not offer is as here.

    `chord` "structural" or "design": which chord carries the strips; `line_drag` "on" or "off"; `panels_per_section`
    strips between two struts; `variant` of scene.toml; `canopy_stations` cells along every chord and
    `canopy_subdivisions` between two ribs; `tube_law` of the bending of tubes; `camber_feedback` "on" or "off";
    `scale` of all lengths; `integration` the time integration scheme, None as [dynamics] says; `line_area` of lines in
    the wind: "inclined" or "projected". Of membranes: `cells` of a mesh that is made (0: as [membranes.size] says, in
    the proportions that are said there), `order` of its triangles (0: as [membranes] says), `wrinkling` "on" or "off"
    (None: likewise). Of a parafoil: `trim` of [bridle] (None: as is said there), and `start_angle` deg by which the
    wind of [aero] is turned upward, so that the wing has its nose up in it.
    """

    chord: str = "structural"
    line_drag: str = "off"
    panels_per_section: int = 1
    variant: str | None = None
    canopy_stations: int = 6
    canopy_subdivisions: int = 1
    tube_law: str = "breukels"
    camber_feedback: str = "off"
    scale: float = 1.0
    integration: str | None = None
    line_area: str = "inclined"
    cells: int = 0
    order: int = 0
    wrinkling: str | None = None
    trim: float | None = None
    start_angle: float = 0.0


@dataclass(frozen=True)
class Setting:
    """A choice that a scene offers: a text of `options`, or a number from `minimum` to `maximum`, whole where the
    `default` is.
    """

    default: Any
    options: tuple[str, ...] = ()
    minimum: float = 1
    maximum: float = 100
    description: str = ""
