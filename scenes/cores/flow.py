"""The aerodynamic solver of a scene: interface displacements in, loads of the models of its flow out."""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from aero import AeroModel, Flow, Gusts, LinearField, coefficients, glide_ratio
from aero.model import LOADS
from interface import StepFailed, UprightPlane, Variable, area_vectors
from interface.mirror import mirror_permutation, symmetrised
from interface.validity import Criterion, outside, outside_variable

from .core import Result, Solver
from .heading import azimuth_variables, inward

# How far a reference area may lie beyond projected and laid-out area of the mesh, which ends at the outermost struts
# and has straight chords: of the V3 kite 16.9 to 21.3 m2, where 19.75 (projected) and 25 m2 (flat) are published.
AREA_LIMIT = 1.25
GUSTS = ("gust_speed", "gust_start", "gust_duration", "gust_interval")


@dataclass(frozen=True, eq=False)
class FlowState:
    """End s of the last step, 0 where no wind depends on it; what the models keep, None before the first step; and
    whether one half was solved and mirrored.
    """

    time: float = 0.0
    models: tuple[Any, ...] | None = None
    symmetric: bool = False


class FlowSolver(Solver):
    """Loads of the models of a scene's flow, `wing` first where it has one, in a uniform wind or one that is
    linear in space.

    In a transient scene the interface moves: every part meets the wind minus its own velocity. The wind of a step is
    that at its end. Until the first step every solve starts without a state, so that to look changes no later result.
    """

    def __init__(self, scene, wing: AeroModel | None, lines: AeroModel | None):
        self.name, self._scene, self._interface = scene.name, scene, scene.interface
        self._wing, self._lines = wing, lines
        self.models = tuple(m for m in (wing, lines) if m is not None)
        self._varies = scene.aero.linear_wind is not None or scene.aero.rotation is not None
        self._outputs = [{v.name for v in m.variables if v.causality == "output"} for m in self.models]
        self._about_what, self._about = scene.moments_about
        self._heading, self._turns = scene.heading, scene.trim is not None and scene.pivot is not None
        own = () if wing is None else (reference_area_criterion(scene.aero.reference_area, scene.interface),)
        self.criteria = own + tuple(c for m in self.models for c in m.criteria)
        validity = (*(c.variables()[0] for c in own), outside_variable())
        self.variables = (*self._declared(scene.aero), *validity)
        around = "lines alone" if wing is None else "the wing of a transient scene" if scene.transient else ""
        without = [m.title for m in self.models if not m.differentiable]
        what = f"the flow around {around}" if around else "".join(without[:1])
        if what:
            self.refuses_derivatives = f"{what} has no directional derivatives; use a scheme that needs none."

    def _declared(self, aero):
        yield from self._air(aero)
        of_models = [v for m in self.models for v in m.variables]
        yield from (v for v in of_models if v.causality == "parameter")
        if self._scene.trim is not None:
            text = "rigid nose-up rotation about the pivot in which the wing starts"
            fixed = partial(Variable, causality="parameter", variability="fixed", unit="rad", description=text)
            yield fixed("trim_angle", minimum=-3.2, maximum=3.2)
        # the order of value references in FMUs: in transient scenes the loads on lines stand beside their sum
        later = self._lines.variables if self._scene.transient and self._lines is not None else ()
        yield from (v for v in of_models if v.name in LOADS and v not in later)
        if self._scene.transient:
            text, start = "wind speed with the gust", aero.wind_speed
            yield Variable("present_wind_speed", causality="output", unit="m/s", start=start, description=text)
        if self._wing is not None:
            yield from self._totals(aero)
        for model in (self._lines, self._wing):
            if model is self._wing is not None:
                text = "lift over drag of the wing and the exposed lines together"
                yield Variable("glide_ratio", causality="output", description=text)
            shown = () if model is None else model.variables
            yield from (v for v in shown if v.causality == "output" and (v.name not in LOADS or v in later))
        yield from azimuth_variables(self._scene)
        if self._varies:
            output = partial(Variable, causality="output")
            text = "velocity of the undisturbed air, as the kite meets it, at the origin of the global frame"
            yield output("wind_at_origin", (3,), unit="m/s", description=text)
            text = "change of that velocity (first index) by the place (second): wind_at_origin + wind_gradient x"
            yield output("wind_gradient", (3, 3), unit="1/s", description=text)

    def _air(self, aero):
        of_node = partial(Variable, shape=(len(self._interface.nodes), 3), counts="interface node")
        yield of_node("displacement", unit="m", description="interface displacement from the reference configuration")
        if self._scene.transient:
            yield of_node("velocity", unit="m/s", description="velocity of the interface nodes")
        tunable = partial(Variable, causality="parameter", variability="tunable")
        text = "wind speed at the wing" if self._wing is not None else "wind speed at the lines"
        start = aero.wind_speed
        yield tunable("wind_speed", unit="m/s", start=start, minimum=1e-3, maximum=340.0, description=text)
        text = "direction that the wind blows to, global frame, any length above zero"
        yield tunable("wind_direction", (3,), start=np.array(aero.wind_direction), description=text)
        start, text = aero.air_density, "density of the air"
        yield tunable("air_density", unit="kg/m3", start=start, minimum=1e-6, maximum=2e3, description=text)
        yield from self._of_places(aero, tunable)
        if self._scene.transient:
            gust = self._scene.dynamics
            text = (
                "height of gusts: wind_speed + gust_speed (1 - cos(2 pi t / gust_duration)) / 2, t since its beginning"
            )
            at, most = gust.gust_speed, 340.0
            yield tunable("gust_speed", unit="m/s", minimum=-most, maximum=most, start=at, description=text)
            positive = partial(tunable, unit="s", minimum=0.0, maximum=1e6)
            text = "time at which the first gust begins"
            yield positive("gust_start", start=gust.gust_start, description=text)
            yield positive("gust_duration", start=gust.gust_duration, description="duration of a gust")
            text = "time from the beginning of a gust to that of the next; 0: there is one only"
            yield positive("gust_interval", start=gust.gust_interval, description=text)

    def _of_places(self, aero, tunable):
        """Parameters of a wind that is not the same everywhere."""
        linear, turning = aero.linear_wind, aero.rotation
        if linear is not None:
            start, text = np.array(linear.ground), "where the line along which the wind grows begins, global frame"
            yield tunable("ground_point", (3,), unit="m", start=start, description=text)
            start = self._about if linear.kite is None else np.array(linear.kite)
            text = "where the wind has wind_speed; beyond it goes on growing, and across the line it is alike"
            yield tunable("kite_point", (3,), unit="m", start=start, description=text)
            start, text = linear.ground_share, "wind speed at ground_point over wind_speed; 1: as fast as at kite_point"
            yield tunable("ground_wind_share", start=start, minimum=0.0, maximum=10.0, description=text)
        if turning is not None:
            start, text = np.array(turning.rate), "angular velocity of the kite, about the axes of the global frame"
            yield tunable("turn_rate", (3,), unit="rad/s", start=start, description=text)
            start = self._about if turning.centre is None else np.array(turning.centre)
            text = "point about which the kite turns, global frame: it meets -turn_rate x (x - turn_centre) beside"
            yield tunable("turn_centre", (3,), unit="m", start=start, description=text)

    def _field(self, values, wind):
        """The `LinearField` beside the `wind` (3,) m/s, None where that is uniform; StepFailed where there is none."""
        found = []
        try:
            if self._scene.aero.linear_wind is not None:
                points = values["ground_point"], values["kite_point"]
                found.append(LinearField.along_line(wind, *points, float(values["ground_wind_share"])))
        except ValueError as error:
            raise StepFailed(str(error)) from None
        if self._scene.aero.rotation is not None:
            found.append(LinearField.rotation(values["turn_rate"], values["turn_centre"]))
        field = found[0] if len(found) == 1 else found[0] + found[1] if found else None
        return field if field is not None and (field.gradient.any() or field.offset.any()) else None

    def _totals(self, aero):
        output = partial(Variable, causality="output")
        area = f"of the wing on the reference area {aero.reference_area:g} m2"
        area += " and wind_speed, without gusts" if self._scene.transient else ""
        yield output("CL", description=f"lift coefficient {area}")
        yield output("CD", description=f"drag coefficient {area}")
        yield output("CS", description=f"side force coefficient {area}")
        yield output("force", (3,), unit="N", description="aerodynamic force on the wing")
        text = f"aerodynamic moment on the wing about the {self._about_what}"
        yield output("moment", (3,), unit="N.m", description=text)

        if self._scene.body is not None:
            text = "area of the wing as deformed, projected along the direction in which that is largest"
            yield output("projected_area", unit="m2", description=text)

    def check(self, block, array):
        """See Solver."""
        if block == "wind_direction" and not np.abs(array).max() > 0.0:
            raise ValueError("wind_direction must not be zero.")
        if block == "wind_direction" and self._wing is not None and not self._turns:
            span = self._heading.axes({})
            along = inward(array, span)
            if not np.abs(along[[0, 2]]).max() > 1e-6 * np.abs(along).max():
                raise ValueError("wind_direction must not be zero or along the span (y).")
        if block == "gust_duration" and not float(array) > 0.0:
            raise ValueError("gust_duration must be above zero.")

    def begin(self, values):
        """See Solver."""
        state = FlowState()
        return Result(self._wind(values, state) | self._started(values["displacement"]), state)

    def follow(self, block, values, state, started):
        """See Solver: where the wing starts, and the wind with its gust."""
        if block in ("trim_angle", "start_azimuth"):
            nodes = self._interface.nodes
            turned = self._heading.started(nodes, values) - nodes
            return Result({"displacement": turned} | self._started(turned))
        return Result(self._wind(values, state) if block in ("wind_speed", *GUSTS) else {})

    def _started(self, displacement):
        """The displacement to start from, where the scene knows another than this one, that it was drawn in."""
        start = self._scene.start
        return {} if start is None else {"displacement": start.of_interface(displacement)}

    def _wind(self, values, state):
        if not self._scene.transient:
            return {}
        return {"present_wind_speed": self._gusts(values).speed(float(values["wind_speed"]), state.time)}

    @staticmethod
    def _gusts(values):
        return Gusts(*(float(values[name]) for name in GUSTS))

    def _speed(self, values, at):
        """Wind speed m/s at a time s; StepFailed where gusts leave none."""
        steady = float(values["wind_speed"])
        return self._gusts(values).checked_speed(steady, at) if self._scene.transient else steady

    def must_step(self, values, state, t, dt):
        """See Solver: where the wind is another, or a model depends on the step before."""
        if self._scene.transient and self._speed(values, t + dt) != float(values["present_wind_speed"]):
            return True
        return any(m.history_dependent(values) for m in self.models)

    def repeated(self, values, state, first, t, dt):
        """See Solver."""
        out = {} if first else {k: v for m in self.models for k, v in m.repeated(values).items()}
        out["outside_validity"] = outside(self.criteria, {**values, **out})
        return Result(out, replace(state, time=self._end(t, dt)))

    def look(self, values, state):
        """See Solver: the loads on the wing and the lines as they start."""
        speed = float(values["present_wind_speed"] if self._scene.transient else values["wind_speed"])
        return self._solved(values, self._flow(values, speed), None, state.time)

    def step(self, values, state, first, t, dt):
        """Loads on the displaced interface."""
        flow = self._flow(values, self._speed(values, t + dt), dt)
        return self._solved(values, flow, None if first else state.models, self._end(t, dt))

    def _end(self, t, dt):
        return t + dt if self._scene.transient else 0.0

    def _flow(self, values, speed, dt=0.0):
        direction = values["wind_direction"]
        direction = np.ldexp(direction, -np.frexp(np.abs(direction).max())[1])  # exact, and its square is a number
        if self._turns:
            self._refuse_along_span(inward(direction, self._heading.axes(values)))
        nodes = self._interface.nodes + values["displacement"]
        air = float(values["air_density"]), self._about, values.get("velocity")
        direction = direction / np.linalg.norm(direction)
        return Flow(nodes, direction, speed, *air, dt, self._field(values, speed * direction))

    @staticmethod
    def _refuse_along_span(direction):
        """StepFailed for a wind, in the axes of the kite at its start, that has nothing across its span."""
        if not np.abs(direction[[0, 2]]).max() > 1e-6 * np.abs(direction).max():
            raise StepFailed(
                "the wind blows along the span of the wing; turn the kite to it (start_azimuth) or set another "
                "wind_direction."
            )

    def _solved(self, values, flow, states, time):
        states = states or (None,) * len(self.models)
        found = [m.solve(flow, values, state) for m, state in zip(self.models, states, strict=True)]
        for model, response, outputs in zip(self.models, found, self._outputs, strict=True):
            if response.outputs.keys() != outputs:
                odd = ", ".join(sorted(response.outputs.keys() ^ outputs))
                raise TypeError(f"{model.title} does not give the outputs that it declares: they differ in {odd}.")
        out = {k: v for response in found for k, v in response.outputs.items()}
        if self._varies:
            out |= {"wind_at_origin": flow.air(np.zeros(3)), "wind_gradient": np.zeros((3, 3))}
            out |= {} if flow.field is None else {"wind_gradient": flow.field.gradient}
        if self._scene.transient:
            out["present_wind_speed"] = flow.speed
        if self._wing is not None:
            area, steady = self._scene.aero.reference_area, float(values["wind_speed"])
            force, whole = found[0].force, found[0].force + (found[1].force if len(found) > 1 else np.zeros(3))
            c = coefficients(force, flow.direction, 0.5 * flow.density * steady**2 * area)
            out |= {"CL": c.CL, "CD": c.CD, "CS": c.CS, "force": force, "moment": found[0].moment}
            out["glide_ratio"] = glide_ratio(whole, flow.direction)
            out["reference_area_misfit"] = self._misfit
            if self._scene.body is not None:
                out["projected_area"] = wing_areas(self._interface, flow.nodes)[0]
        out["outside_validity"] = outside(self.criteria, out)
        kept, symmetric = tuple(response.state for response in found), any(response.symmetric for response in found)
        return Result(out, FlowState(time, kept, symmetric))

    def derivative(self, values, state):
        """Of the loads along directions in the displacement, on the shape of the last step."""
        for model in self.models:
            if model.history_dependent(values):
                raise ValueError(f"{model.title} depends on the step before and has no directional derivatives.")
        flow = self._flow(values, float(values["wind_speed"]))
        along = [m.derivative(flow, values, kept) for m, kept in zip(self.models, state.models, strict=True)]

        def derivative(changes):
            change = changes.get("displacement", np.zeros_like(self._interface.nodes))
            change = self._symmetric_part(change, flow.nodes) if state.symmetric else change
            return {k: v for model in along for k, v in model(change).items()}

        return derivative

    def _symmetric_part(self, change, nodes):
        """The mirror-symmetric part of a direction (n,3) in the plane that mirrors the wing on `nodes` (n,3) m; of the
        wing alone where the lines have no mirror image.
        """
        sections = self._interface.sections
        plane = UprightPlane.between(nodes[sections[0]], nodes[sections[-1]])
        change = plane.inward(change)
        if self._image is not None:
            return plane.outward(symmetrised(change, self._image))
        change = change.copy()
        change[sections] = symmetrised(change[sections], np.arange(len(sections))[::-1])
        return plane.outward(change)

    @cached_property
    def _misfit(self):
        return reference_area_misfit(self._scene.aero.reference_area, *wing_areas(self._interface))

    @cached_property
    def _image(self):
        return mirror_permutation(self._heading.home(self._interface.nodes))


def wing_areas(mesh, nodes=None):
    """Area m^2 of a wing in its reference configuration, or on displaced `nodes` (n,3) m, projected along the direction
    in which that is largest, and laid out; of a closed body the half of both.
    """
    a = area_vectors((mesh.nodes if nodes is None else nodes)[mesh.panels])
    size = np.linalg.norm(a, axis=1)
    along = np.linalg.eigh(np.einsum("ni,nj,n->ij", a, a, 1.0 / np.where(size > 0.0, size, np.inf)))[1][:, -1]
    sides = 2.0 if mesh.closed else 1.0
    return float(np.abs(a @ along).sum()) / sides, float(size.sum()) / sides


def reference_area_misfit(reference, projected, laid_out):
    """Factor by which a reference area lies below the projected or above the laid-out area of its wing; up to 1 it lies
    between them.
    """
    return max(projected / reference, reference / laid_out)


def reference_area_criterion(reference, mesh):
    """What the coefficients are judged by: that their reference area is one of the wing."""
    projected, laid_out = wing_areas(mesh)
    return Criterion(
        "reference_area_misfit",
        "reference area against that of the wing",
        AREA_LIMIT,
        "a reference area is the projected, flat or laid-out one; 1: within these of the mesh",
        where=f"{reference:g} m2 for a wing of {projected:.3g} (projected) to {laid_out:.3g} m2 (laid out)",
    )
