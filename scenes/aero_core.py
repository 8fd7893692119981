"""The aerodynamic solver of a scene behind blocks: interface displacements in, pressures and shears out."""

from functools import cached_property, partial
from typing import Any

import numpy as np

from aero import SurfaceGrid, VortexStep, WingSensitivity, line_loads_derivative
from interface import StepFailed, Variable
from structural import mirror_permutation

from .flow import FlowCore
from .symmetry import symmetrised

# Difference of mirrored points, m, that still counts as symmetric: what a half structure leaves by rounding.
LOPSIDED = 1e-9
# Difference of mirrored velocities, m/s, likewise.
SPEED_LOPSIDED = 1e-6


class AeroCore(FlowCore):
    """Quasi-steady loads of a scene's wing in a uniform wind, warm-started from step to step."""

    _hidden = (*FlowCore._hidden, "_gamma", "_looked")

    def __init__(self, scene):
        content = scene.content["aero"]
        interface = scene.interface
        self._wing = VortexStep(
            scene.strip_polars(),
            SurfaceGrid(interface.sections, interface.fractions),
            induction=content["induction"],
            direction=content["direction"],
            circulation_speed=content["circulation_speed"],
            section_force=content["section_force"],
            camber=scene.settings.get("camber_feedback", "off") == "on",
        )
        self._gamma = None
        self._looked = False  # the present values have been tried without a step
        self._stall = self._wing.polars.stall_angles()
        self._mirrored_polars = self._wing.polars.mirrored()
        super().__init__(scene)

    def _declared(self, content):
        panels, strips = len(self._interface.panels), len(self._interface.sections) - 1
        yield from self._inputs(content)
        tunable = partial(Variable, causality="parameter", variability="tunable")
        start = self._scene.content["structure"]["symmetric"]
        text = "solve one half and mirror it; asymmetric input turns it off (see symmetry_used)"
        yield tunable("symmetric", kind="boolean", start=float(start), minimum=0.0, maximum=1.0, description=text)
        yield from self._line_parameters(content)
        if self._scene.content["trim"] is not None:
            text = "rigid nose-up rotation about the pivot in which the wing starts"
            fixed = partial(tunable, variability="fixed", minimum=-3.2, maximum=3.2)
            yield fixed("trim_angle", unit="rad", description=text)
        output = partial(Variable, causality="output")
        yield output("pressure", (panels,), unit="Pa", description="net pressure on each interface panel")
        if content["section_force"] != "normal":
            yield output("shear", (panels, 3), unit="Pa", description="traction on each interface panel")
        line_load, *of_lines = [*self._line_outputs()] or [None]
        if line_load is not None:
            yield line_load
        area = f"of the wing on the reference area {content['reference_area']:g} m2"
        area += " and wind_speed, without gusts" if self._scene.moves else ""
        yield output("CL", description=f"lift coefficient {area}")
        yield output("CD", description=f"drag coefficient {area}")
        yield output("CS", description=f"side force coefficient {area}")
        yield output("force", (3,), unit="N", description="aerodynamic force on the wing")
        about = "origin" if self._scene.pivot is None else "pivot"
        text = f"aerodynamic moment on the wing about the {about}"
        yield output("moment", (3,), unit="N.m", description=text)
        yield from of_lines
        yield output("glide_ratio", description="lift over drag of the wing and the exposed lines together")
        text = "angle of the mid-span chord to the free stream"
        yield output("alpha_mid", unit="rad", description=text)
        yield output("alpha", (strips,), unit="rad", description="effective angle of attack of each strip")
        if self._wing.camber:
            text = "angle by which billowing lifts the polar of each strip (thin-airfoil theory)"
            yield output("camber_shift", (strips,), unit="rad", description=text)
        yield output("circulation", (strips,), unit="m2/s", description="circulation of each strip")
        yield output("span", unit="m", description="largest extent of the displaced wing across the wind plane (y)")
        yield output("tip_span", unit="m", description="distance between the tips' quarter-chord points")
        text = "strips whose angle of attack lies beyond the polar table, where its end value is held"
        yield output("strips_beyond_polar", kind="integer", description=text)
        text = "strips beyond the first lift maximum above or minimum below zero angle of attack"
        yield output("stalled_strips", kind="integer", description=text)
        text = "artificial viscosity in the result, in units of (lost lift slope / 2 pi) (chord / width); 0 below stall"
        yield output("stall_viscosity", description=text)
        yield output("residual", description="norm of the circulation imbalance relative to U c / 2")
        yield output("newton_iterations", kind="integer", description="Newton iterations of the step")
        start, text = self._scene.content["structure"]["symmetric"], "whether the last solve was of one half"
        yield output("symmetry_used", kind="boolean", start=float(start), description=text)

    def _check(self, block, array):
        super()._check(block, array)
        if block == "wind_direction" and not np.abs(array[[0, 2]]).max() > 1e-6 * np.abs(array).max():
            raise ValueError("wind_direction must not be zero or along the span (y).")

    def get(self, block: str) -> np.ndarray:
        """See `Core.get`. Before the first step the outputs are the loads on the wing as it starts.

        To look changes no later result: until the first step every solve starts from the attached flow.
        """
        if self._fresh and self._stale and not self._looked and block in self._outputs:
            self._looked = True
            try:
                self._solve()
            except StepFailed:  # no loads then; the first step says why
                self._put_starts()
        return super().get(block)

    def set(self, block: str, values: Any) -> None:
        """See `Core.set`."""
        super().set(block, values)
        self._looked = False

    def step(self, t: float, dt: float) -> None:
        """Loads on the displaced wing; the same input again returns the stored output without solving."""
        try:
            self._blow(t, dt)
            if self._stale:
                self._solve(dt)
            elif not self._fresh:
                self._put("newton_iterations", 0)
            self._passed(t, dt)
        finally:
            self._fresh = False

    def directional_derivative(self, changes):
        """Derivative of the loads along a direction in the displacement, on the shape of the last step.

        `changes` is {"displacement": direction (n,3) m}; returns {"pressure": (m,) Pa, "shear": (m,3) Pa, "line_load":
        (k,3) N/m}, those that the scene has. Exact to rounding: the circulation follows by the implicit function
        theorem, all else by complex steps (`aero.WingSensitivity`); artificial viscosity counts where the loads
        contain it. Where one half is solved, a direction is first made mirror-symmetric, because nothing else exists
        for the half. It changes no state. ValueError in one sentence for directions that do not fit, where the
        present values have not been solved or their solution is a fold, which has no derivative, and in scenes of
        motion.
        """
        if self._scene.moves:
            raise ValueError("the flow around a wing in motion has no directional derivatives; use another scheme.")
        change = self._directions(changes).get("displacement", np.zeros_like(self._interface.nodes))
        nodes, direction, speed = self._present()
        symmetric = bool(self._values["symmetry_used"])
        if symmetric:
            change = self._symmetric_part(change)
        if self._linearised is None:
            wing, viscosity = self._wing.in_air(self._scalar("air_density")), self._scalar("stall_viscosity")
            at = nodes, speed * direction, self._gamma
            try:
                self._linearised = WingSensitivity(wing, *at, viscosity, symmetric)
            except np.linalg.LinAlgError:
                raise ValueError("the circulation is at a fold of its solutions, where it has no derivative.") from None
        pressure, shear = self._linearised(change)
        out = {"pressure": pressure} | ({} if shear is None else {"shear": shear})
        if len(lines := self._interface.lines):
            out["line_load"] = line_loads_derivative(nodes[lines], change[lines], *self._line_air(speed * direction))
        return out

    def _symmetric_part(self, change):
        """The mirror-symmetric part of a direction (n,3); of the wing alone where the lines have no mirror image."""
        if self._image is not None:
            return symmetrised(change, self._image)
        change, sections = change.copy(), self._interface.sections
        change[sections] = symmetrised(change[sections], np.arange(len(sections))[::-1])
        return change

    @cached_property
    def _image(self):
        return mirror_permutation(self._interface.nodes)

    def _solve(self, dt: float = 0.0) -> None:
        self._unsolved()
        nodes, direction, speed = self._present()
        symmetric = bool(self._values["symmetric"]) and direction[1] == 0.0 and self._mirrored_polars
        symmetric = symmetric and self._symmetric_shape(nodes) and self._symmetric_motion()
        wing = self._wing.in_air(self._scalar("air_density"))
        with np.errstate(all="ignore"):
            try:
                start = None if self._fresh else self._gamma
                loads = wing.loads(nodes, speed * direction, start, symmetric, self._values.get("velocity"))
            except np.linalg.LinAlgError:
                loads = None
        if loads is None or not np.all(np.isfinite(loads.force)):
            raise StepFailed("the circulation has no finite solution; the displaced wing is degenerate.")
        if not loads.circulation.converged:
            raise StepFailed(
                f"circulation not found in {loads.circulation.newton_iterations} Newton iterations: imbalance "
                f"{loads.circulation.residual:.2g} of U c / 2."
            )
        with self._finite_results():
            self._gamma = loads.circulation.gamma
            self._show(nodes, direction, speed, loads, symmetric, dt)
        self._stale, self._solved = False, True

    def _symmetric_shape(self, nodes):
        grid = nodes[self._interface.sections]
        return np.abs(grid[::-1] * np.array([1.0, -1.0, 1.0]) - grid).max() <= LOPSIDED

    def _symmetric_motion(self):
        if not self._scene.moves:
            return True
        moving = self._values["velocity"][self._interface.sections]
        return np.abs(moving[::-1] * np.array([1.0, -1.0, 1.0]) - moving).max() <= SPEED_LOPSIDED

    def _show(self, nodes, direction, speed, loads, symmetric, dt):
        force = loads.total_force()
        area, steady = self._scene.content["aero"]["reference_area"], self._scalar("wind_speed")
        q_area = 0.5 * self._scalar("air_density") * steady**2 * area
        across = np.cross(direction, [0.0, 1.0, 0.0])
        across /= np.linalg.norm(across)
        self._put("pressure", loads.pressure)
        if loads.shear is not None:
            self._put("shear", loads.shear)
        total = force + self._show_lines(nodes, speed * direction, dt)
        self._put("glide_ratio", (total @ across) / (total @ direction) if total @ direction != 0.0 else 0.0)
        self._put("CL", force @ across / q_area)
        self._put("CD", force @ direction / q_area)
        self._put("CS", force @ np.cross(across, direction) / q_area)
        self._put("force", force)
        self._put("moment", loads.total_moment(self._about))
        self._put("alpha_mid", self._mid_span_angle(nodes, direction))
        circulation = loads.circulation
        self._put("alpha", circulation.alpha)
        self._put("circulation", circulation.gamma)
        self._put("span", np.ptp(nodes[self._interface.sections, 1]))
        bound = loads.strips.bound
        self._put("tip_span", np.linalg.norm(bound[-1] - bound[0]))
        self._put("strips_beyond_polar", np.count_nonzero(circulation.outside))
        low, high = self._stall
        camber = np.zeros(len(low))
        if self._wing.camber:
            sections = nodes[self._interface.sections]
            camber = -self._wing.grid.camber(sections, loads.strips.normal)[0]
            self._put("camber_shift", camber)
        at = circulation.alpha + camber
        self._put("stalled_strips", np.count_nonzero((at < low) | (at > high)))
        self._put("stall_viscosity", circulation.viscosity)
        self._put("residual", circulation.residual)
        self._put("newton_iterations", circulation.newton_iterations)
        self._put("symmetry_used", float(symmetric))

    def _mid_span_angle(self, nodes, direction):
        """Angle of the chord at the middle of the span (mean of the middle sections) to the wind, rad."""
        sections = nodes[self._interface.sections]
        n = len(sections)
        middle = 0.5 * (sections[(n - 1) // 2] + sections[n // 2])
        chord = middle[-1] - middle[0]
        up = np.cross(direction, [0.0, 1.0, 0.0])
        return np.arctan2(-chord @ up, chord @ direction)
