"""What a model of the flow promises: a displaced interface and a wind in, interface loads and named outputs out.

A model is one class with `solve`. It keeps nothing between calls: what one step hands to the next is in its state,
which the caller keeps, saves and restores. It says itself what it has (`variables`, `strips`, `remarks`, `tables`), so
that cores, FMU pages and reports need not know which model they have.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as of_default
from typing import Any

import numpy as np

from interface import Criterion, SurfaceMesh, Variable

from .wind import LinearField

Values = Mapping[str, np.ndarray]
Derivative = Callable[[np.ndarray], dict[str, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Flow:
    """What a model is to answer: interface `nodes` (n,3) m as displaced, in a wind of `speed` m/s to the `direction`
    (3,), a unit vector, of air of `density` kg/m^3; moments are about the point `about` (3,) m. Moving nodes have a
    `velocity` (n,3) m/s; `dt` s is the length of the step that ends here, 0 to look only. A wind that is not the same
    everywhere has a `field` beside; `speed` and `direction` are those of its uniform part.
    """

    nodes: np.ndarray
    direction: np.ndarray
    speed: float
    density: float = 1.225
    about: np.ndarray = of_default(default_factory=lambda: np.zeros(3))
    velocity: np.ndarray | None = None
    dt: float = 0.0
    field: LinearField | None = None

    @property
    def wind(self) -> np.ndarray:
        """Velocity (3,) m/s of the undisturbed air, of its uniform part where it has a field."""
        return self.speed * self.direction

    @property
    def motion(self) -> np.ndarray | None:
        """Velocity (n,3) m/s of the nodes against air in which `wind` blows everywhere: their own less that of the
        field at them; None where they are at rest in such air.
        """
        if self.field is None:
            return self.velocity
        beside = self.field.velocity(self.nodes)
        return -beside if self.velocity is None else self.velocity - beside

    def air(self, points: np.ndarray) -> np.ndarray:
        """Velocity (...,3) m/s of the undisturbed air at points (...,3) m."""
        return self.wind if self.field is None else self.wind + self.field.velocity(points)


@dataclass(frozen=True, eq=False)
class Response:
    """Answer of a model: `outputs` by name, interface loads (see LOADS) among them, the `force` (3,) N and `moment`
    (3,) N m of all its loads, the `state` for the next step (None, numbers, texts, arrays, and tuples, lists, dicts or
    dataclasses of these: see `interface.records`), and whether one half was solved and mirrored.
    """

    outputs: dict[str, Any]
    force: np.ndarray
    moment: np.ndarray
    state: Any = None
    symmetric: bool = False


@dataclass(frozen=True)
class Option:
    """What [aero] in scene.toml may say of a method: a key with a `default` that is true or false, one of `choices`,
    or a number within bounds.
    """

    default: bool | float | str
    choices: tuple[str, ...] = ()
    minimum: float = -np.inf
    maximum: float = np.inf


# Interface loads: pressure (m,) and shear (m,3) Pa on the panels, line_load (k,3) N/m on the lines.
LOADS = ("pressure", "shear", "line_load")


@dataclass(frozen=True, eq=False)
class StripLayout:
    """Strips of a wing on the interface mesh: `sections` (n+1, k+1) node indices of the stations of each section; the
    names of the outputs that are the effective `angle` of attack (n,) rad and the `circulation` (n,) m^2/s, if any; and
    the section `polars` of the n strips, None without.
    """

    sections: np.ndarray
    angle: str
    circulation: str | None = None
    polars: Any = None


@dataclass(frozen=True, eq=False)
class LiftingSurface:
    """Strips of a closed body that follow each other: a `name`, their indices `strips` (k,) in order, from left to
    right or, where the surface is `upright`, from below upwards, and the `sign` of lift: 1 where the upper side of the
    strips is up, or outside of what is upright, -1 where it is down.
    """

    name: str
    strips: np.ndarray
    upright: bool
    sign: float


@dataclass(frozen=True, eq=False)
class EdgeStrips:
    """Strips of a closed body: `ends` (s,2) nodes of the trailing edges that they leave from, and the `surfaces` that
    they are of. Outputs say the rest: `strip_width` and `strip_chord` m, `span_loading` and `pressure_span_loading` m,
    `strip_lift`, `strip_side_force`, `strip_pressure_load`, `circulation`, `alpha`, `separation`.
    """

    ends: np.ndarray
    surfaces: tuple[LiftingSurface, ...]


@dataclass(frozen=True, eq=False)
class Wing:
    """What a model of the flow around a wing is made of.

    `mesh` is the interface, open or closed; where it is made of strips, `sections` (n+1, k+1) are node indices of the
    stations of each section at the `fractions` (k+1,) of the chord, and `polars` reads the section polars of the n
    strips. `trailing_edges` (t,2) are pairs of nodes of a closed wing, None where they are to be found or it is open.
    `options` are those of [aero] in scene.toml, `symmetric` whether one half is to be solved at the start, and
    `transient` whether the wing moves.
    """

    mesh: SurfaceMesh
    options: Mapping[str, Any]
    symmetric: bool = False
    sections: np.ndarray | None = None
    fractions: np.ndarray | None = None
    polars: Callable[[], Any] | None = None
    transient: bool = False
    trailing_edges: np.ndarray | None = None


class AeroModel:
    """A model of the flow. Subclasses give `variables` and `solve`; all else has an answer that suits most."""

    title: str = ""  # what it is, as a sentence about it would call it
    variables: tuple[Variable, ...] = ()  # parameters that it takes and outputs that it gives
    strips: StripLayout | None = None  # strips along the span, where it has some
    smooth: bool = False  # whether its loads change evenly over tens of degrees of the angle of attack: no stall
    edge_strips: EdgeStrips | None = None  # those of a closed body, where it has some with a chord
    criteria: tuple[Criterion, ...] = ()  # what its answer is judged by, of its outputs: up to where it is good

    def solve(self, flow: Flow, values: Values, state: Any = None) -> Response:
        """Loads and outputs for a flow, with the `values` of its parameters and the state that the step before left
        (None: there was none). `StepFailed` in one sentence where it has no answer.
        """
        raise NotImplementedError

    def history_dependent(self, values: Values) -> bool:
        """Whether its answer depends on the step before, so that the same flow twice is not the same answer."""
        return False

    def repeated(self, values: Values) -> dict[str, Any]:
        """Outputs that are others where the same flow is asked for again and nothing has to be solved."""
        return {}

    @property
    def differentiable(self) -> bool:
        """Whether there are directional derivatives: whether it has a `derivative` of its own."""
        return type(self).derivative is not AeroModel.derivative

    def derivative(self, flow: Flow, values: Values, state: Any) -> Derivative:
        """Derivatives of the loads at a solved flow and its state, a function of directions (n,3) m of the nodes;
        ValueError in one sentence where there are none.
        """
        raise ValueError(f"{self.title} has no directional derivatives; use a scheme that needs none.")

    def remarks(self, outputs: Values) -> list[str]:
        """Sentences on what is worth a warning in its outputs."""
        return []

    def rows(self, outputs: Values) -> list[tuple[str, str]]:
        """Rows, name and text with unit, that a table of results is to have of its outputs."""
        return []

    def tables(self) -> Sequence[tuple[str, str, list[list[Any]]]]:
        """What its own indices count: a word (see `Variable.counts`), names of columns, rows."""
        return ()
