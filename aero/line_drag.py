"""Lines in the wind: the drag of each, and the model of a flow around lines alone or beside a wing."""

from functools import partial

import numpy as np

from interface import Variable
from interface.line_drag import FRICTION, LAWS, NORMAL_DRAG, line_drag

from .added_mass import line_inertia
from .complex_steps import STEP, moved
from .model import AeroModel, Flow, Response

__all__ = ["FRICTION", "LAWS", "NORMAL_DRAG", "LinesInWind", "line_loads", "line_loads_derivative"]

MEAN_POINTS = 0.5 - np.sqrt(1.0 / 12.0), 0.5 + np.sqrt(1.0 / 12.0)  # of Gauss, of the way along a line


def line_loads(ends, diameter, velocity, density=1.225, normal_drag=NORMAL_DRAG, friction=FRICTION, law="inclined"):
    """Load N/m (k,3) per length of straight lines between `ends` (k,2,3) m in air that passes with `velocity` m/s.

    `diameter` (k,) m; `velocity` (3,) or (k,3), of the air relative to each line; see `interface.line_drag`.
    """
    return line_drag(ends[:, 1] - ends[:, 0], velocity, diameter, density, normal_drag, friction, law)


def line_loads_derivative(ends, direction, *air):
    """Derivative N/m (k,3) of `line_loads` for ends (k,2,3) m moving along `direction` (k,2,3) m; `air` as there."""
    stepped, size = moved(ends, direction)
    return line_loads(stepped, *air).imag / STEP * size


class LinesInWind(AeroModel):
    """Drag of the `lines` (k,2) of an interface, of `diameter` (k,) m, in the wind minus their own velocity; where the
    wind has a field, the mean of it along each line.

    `law` see `interface.line_drag`; `normal_drag` and `friction` are the start values of its coefficients, `about` says
    in words about which point moments are. In a `transient` case the air around the lines can have inertia, from
    the change of velocity over the step: the state is that velocity (k,3) m/s.
    """

    title = "the flow around lines alone"

    def __init__(
        self, lines, diameter, law, normal_drag=NORMAL_DRAG, friction=FRICTION, about="origin", transient=False
    ):
        self._lines, self._diameter, self._law = lines, diameter, law
        self.variables = tuple(self._declared(normal_drag, friction, about, transient))

    def _declared(self, normal_drag, friction, about, transient):
        tunable = partial(Variable, causality="parameter", variability="tunable", minimum=0.0, maximum=100.0)
        text = "drag coefficient of lines across the flow, on diameter times length"
        yield tunable("line_normal_drag", start=normal_drag, description=text)
        text = "friction coefficient of lines along the flow, on diameter times length"
        yield tunable("line_friction", start=friction, description=text)
        if transient:
            text = (
                "added mass of the air around lines over the mass of the air they displace (1: a cylinder in potential "
                "flow; 0: none), from the change of velocity over the step"
            )
            yield tunable("added_mass_coefficient", maximum=1e6, description=text)
        output = partial(Variable, causality="output")
        text = "wind load on each exposed line per current length"
        yield output("line_load", (len(self._lines), 3), unit="N/m", description=text, counts="line")
        yield output("line_force", (3,), unit="N", description="aerodynamic force on the exposed lines")
        text = f"aerodynamic moment on the exposed lines about the {about}"
        yield output("line_moment", (3,), unit="N.m", description=text)

    def _air(self, flow, values, wind):
        """What `line_loads` needs besides the ends of the lines."""
        drag, friction = float(values["line_normal_drag"]), float(values["line_friction"])
        return self._diameter, wind, flow.density, drag, friction, self._law

    def history_dependent(self, values):
        """See AeroModel: inertia does."""
        return "added_mass_coefficient" in values and float(values["added_mass_coefficient"]) > 0.0

    def _load(self, ends, flow, values):
        """Load N/m (k,3) on lines between `ends` (k,2,3) m: that at their middles in a uniform wind, in another one the
        mean along them, exact where it grows with the square of the place (two points of Gauss).
        """
        speeds = None if flow.velocity is None else flow.velocity[self._lines]
        if flow.field is None:
            wind = flow.wind if speeds is None else flow.wind - speeds.mean(axis=1)
            return line_loads(ends, *self._air(flow, values, wind))
        load = 0.0
        for share in MEAN_POINTS:
            wind = flow.air(ends[:, 0] + share * (ends[:, 1] - ends[:, 0]))
            wind = wind if speeds is None else wind - speeds[:, 0] - share * (speeds[:, 1] - speeds[:, 0])
            load = load + 0.5 * line_loads(ends, *self._air(flow, values, wind))
        return load

    def solve(self, flow: Flow, values, state=None):
        """See AeroModel."""
        ends = flow.nodes[self._lines]
        own = None if flow.velocity is None else flow.velocity[self._lines].mean(axis=1)
        load = self._load(ends, flow, values)
        if self.history_dependent(values) and flow.dt > 0.0 and state is not None:
            coefficient = float(values["added_mass_coefficient"])
            acceleration = (own - state) / flow.dt
            load = load - line_inertia(ends, self._diameter, acceleration, flow.density, coefficient)
        force = load * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
        total = force.sum(axis=0)
        moment = np.cross(ends.mean(axis=1) - flow.about, force).sum(axis=0)
        outputs = {"line_load": load, "line_force": total, "line_moment": moment}
        return Response(outputs, total, moment, own)

    def derivative(self, flow: Flow, values, state):
        """See AeroModel: exact to rounding, for lines at rest."""
        ends = flow.nodes[self._lines]

        def derivative(change):
            stepped, size = moved(ends, change[self._lines])
            return {"line_load": self._load(stepped, flow, values).imag / STEP * size}

        return derivative
