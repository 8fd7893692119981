"""What the flow of every scene has: wind and gusts, moving interface nodes, and lines that stand in the wind."""

from functools import partial

import numpy as np

from aero import line_loads
from interface import StepFailed, Variable

from .core import Core
from .interface import rotated


class FlowCore(Core):
    """Wind on the interface of a scene; subclasses add what it does to a wing.

    In a scene of motion the interface moves: every part meets the wind minus its own velocity. The wind of a step is
    that at its end.
    """

    _hidden: tuple[str, ...] = ("_fresh", "_solved", "_time", "_line_velocity")

    def __init__(self, scene):
        self._scene, self._interface = scene, scene.interface
        self._about = np.zeros(3) if scene.pivot is None else scene.members.nodes[scene.pivot]
        self._law = scene.settings.get("line_area", "inclined")
        self._time = 0.0  # end of the last step
        self._line_velocity = None  # of the exposed lines then, m/s
        super().__init__(scene.name, tuple(self._declared(scene.content["aero"])))

    def _declared(self, content):
        yield from self._inputs(content)
        yield from self._line_parameters(content)
        yield from self._line_outputs()

    def _inputs(self, content):
        points = len(self._interface.nodes)
        text = "interface displacement from the reference configuration"
        yield Variable("displacement", (points, 3), unit="m", description=text)
        if self._scene.moves:
            yield Variable("velocity", (points, 3), unit="m/s", description="velocity of the interface nodes")
        tunable = partial(Variable, causality="parameter", variability="tunable")
        text = "wind speed at the wing" if self._scene.content["wing"] else "wind speed at the lines"
        start = content["wind_speed"]
        yield tunable("wind_speed", unit="m/s", start=start, minimum=1e-3, maximum=340.0, description=text)
        text = "direction that the wind blows to, global frame, any length above zero"
        start = np.array(content["wind_direction"], float)
        yield tunable("wind_direction", (3,), start=start, description=text)
        text = "density of the air"
        start = content["air_density"]
        yield tunable("air_density", unit="kg/m3", start=start, minimum=1e-6, maximum=2e3, description=text)
        if self._scene.moves:
            yield from self._gusts(tunable)

    def _gusts(self, tunable):
        text = "height of gusts: wind_speed + gust_speed (1 - cos(2 pi t / gust_duration)) / 2, t since its beginning"
        start = self._scene.content["dynamics"]
        yield tunable(
            "gust_speed", unit="m/s", minimum=-340.0, maximum=340.0, start=start["gust_speed"], description=text
        )
        positive = partial(tunable, unit="s", minimum=0.0, maximum=1e6)
        text = "time at which the first gust begins"
        yield positive("gust_start", start=start["gust_start"], description=text)
        yield positive("gust_duration", start=start["gust_duration"], description="duration of a gust")
        text = "time from the beginning of a gust to that of the next; 0: there is one only"
        yield positive("gust_interval", start=start["gust_interval"], description=text)

    def _line_parameters(self, content):
        if not len(self._interface.lines):
            return
        tunable = partial(Variable, causality="parameter", variability="tunable", minimum=0.0, maximum=100.0)
        text = "drag coefficient of lines across the flow, on diameter times length"
        yield tunable("line_normal_drag", start=content["line_normal_drag"], description=text)
        text = "friction coefficient of lines along the flow, on diameter times length"
        yield tunable("line_friction", start=content["line_friction"], description=text)
        if self._scene.moves:
            text = (
                "added mass of the air around lines over the mass of the air they displace (1: a cylinder in potential "
                "flow; 0: none), from the change of velocity over the step"
            )
            yield tunable("added_mass_coefficient", maximum=1e6, description=text)

    def _line_outputs(self):
        output = partial(Variable, causality="output")
        if self._scene.moves:
            start = self._scene.content["aero"]["wind_speed"]
            yield output("present_wind_speed", unit="m/s", start=start, description="wind speed with the gust")
        if not len(self._interface.lines):
            return
        about = "origin" if self._scene.pivot is None else "pivot"
        text = "wind load on each exposed line per current length"
        yield output("line_load", (len(self._interface.lines), 3), unit="N/m", description=text)
        yield output("line_force", (3,), unit="N", description="aerodynamic force on the exposed lines")
        text = f"aerodynamic moment on the exposed lines about the {about}"
        yield output("line_moment", (3,), unit="N.m", description=text)

    def _check(self, block, array):
        if block == "wind_direction" and not np.abs(array).max() > 0.0:
            raise ValueError("wind_direction must not be zero.")
        if block == "gust_duration" and not float(array) > 0.0:
            raise ValueError("gust_duration must be above zero.")

    def _parameter_changed(self, block):
        if block == "trim_angle":
            nodes = self._interface.nodes
            self._values["displacement"] = rotated(nodes, self._scalar("trim_angle"), self._about) - nodes
        if self._scene.moves and block in ("wind_speed", "gust_speed", "gust_start", "gust_duration", "gust_interval"):
            self._put("present_wind_speed", self._wind_at(self._time))

    def _wind_at(self, t):
        """Wind speed m/s at time t s, gust and all."""
        speed, height = self._scalar("wind_speed"), self._scalar("gust_speed")
        since = t - self._scalar("gust_start")
        if height == 0.0 or since <= 0.0:
            return speed
        interval, duration = self._scalar("gust_interval"), self._scalar("gust_duration")
        if interval > 0.0:
            since = since % interval
        return speed + (0.5 * height * (1.0 - np.cos(2.0 * np.pi * since / duration)) if since < duration else 0.0)

    def _blow(self, t, dt):
        """Let the wind be that at the end of a step."""
        if not self._scene.moves:
            return
        interval, duration = self._scalar("gust_interval"), self._scalar("gust_duration")
        if 0.0 < interval < duration:
            raise StepFailed(
                f"a gust of {duration:g} s is not over when the next begins after {interval:g} s; make gust_interval "
                "longer or gust_duration shorter."
            )
        speed = self._wind_at(t + dt)
        if not speed > 0.0:
            raise StepFailed(
                f"the wind speed would be {speed:.3g} m/s at {t + dt:.6g} s; gust_speed must be above -wind_speed."
            )
        if speed != self._scalar("present_wind_speed"):
            self._put("present_wind_speed", speed)
            self._stale = True
        self._stale = self._stale or self._remembers

    @property
    def _remembers(self):
        """Whether loads depend on what the step before was."""
        return "added_mass_coefficient" in self._values and self._scalar("added_mass_coefficient") > 0.0

    def _put_starts(self):
        """Let the outputs be what they are before anything is known of the loads."""
        for name in self._outputs - {"present_wind_speed"}:
            self._put(name, self._by_name[name].start)

    def _passed(self, t, dt):
        """Note the end of a step."""
        if self._scene.moves:
            self._time = t + dt
            self._line_velocity = self._values["velocity"][self._interface.lines].mean(axis=1)

    def _present(self):
        """Nodes (n,3) m of the displaced interface, direction (3,) of the wind, its speed m/s."""
        direction = self._values["wind_direction"]
        direction = np.ldexp(direction, -np.frexp(np.abs(direction).max())[1])  # exact, and its square is a number
        nodes = self._interface.nodes + self._values["displacement"]
        speed = self._scalar("present_wind_speed" if self._scene.moves else "wind_speed")
        return nodes, direction / np.linalg.norm(direction), speed

    def _show_lines(self, nodes, wind, dt=0.0):
        """Put out the loads on the exposed lines; their force (3,) N. `dt` s is that of the step, 0 to look only."""
        lines = self._interface.lines
        if not len(lines):
            return np.zeros(3)
        ends = nodes[lines]
        if self._scene.moves:
            own = self._values["velocity"][lines].mean(axis=1)
            wind = wind - own
        load = line_loads(ends, *self._line_air(wind))
        if self._remembers and dt > 0.0 and self._line_velocity is not None:
            load = load - self._inertia(ends, (own - self._line_velocity) / dt)
        force = load * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
        self._put("line_load", load)
        self._put("line_force", force.sum(axis=0))
        self._put("line_moment", np.cross(ends.mean(axis=1) - self._about, force).sum(axis=0))
        return force.sum(axis=0)

    def _inertia(self, ends, acceleration):
        """Force N/m (k,3) that accelerates the air around lines: C_a rho pi d^2 / 4 times the acceleration across."""
        axis = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(axis, axis=1)[:, None]
        u = axis / np.where(length > 0.0, length, 1.0)
        across = acceleration - np.einsum("kc,kc->k", acceleration, u)[:, None] * u
        displaced = 0.25 * np.pi * self._scalar("air_density") * self._interface.diameter**2
        return (self._scalar("added_mass_coefficient") * displaced)[:, None] * across

    def _line_air(self, wind):
        """What `line_loads` needs besides the ends of the lines."""
        air = (self._scalar(k) for k in ("air_density", "line_normal_drag", "line_friction"))
        return self._interface.diameter, wind, *air, self._law


class LineFlowCore(FlowCore):
    """Wind on the lines of a scene without a wing."""

    def get(self, block: str) -> np.ndarray:
        """See `Core.get`. Before the first step the outputs are the loads on the lines as they start."""
        if self._fresh and self._stale and block in self._outputs:
            try:
                self._look()
            except StepFailed:  # no loads then; the first step says why
                self._put_starts()
        return super().get(block)

    def _look(self, dt=0.0):
        nodes, direction, speed = self._present()
        with self._finite_results():
            self._show_lines(nodes, speed * direction, dt)

    def step(self, t: float, dt: float) -> None:
        """Loads on the displaced lines; the same input again returns the stored output."""
        self._blow(t, dt)
        if self._stale:
            self._unsolved()
            self._look(dt)
            self._stale, self._solved = False, True
        self._fresh = False
        self._passed(t, dt)

    def directional_derivative(self, changes):
        """Refused: schemes with derivatives are for equilibria of wings."""
        raise ValueError("the flow around lines alone has no directional derivatives; use a scheme that needs none.")
