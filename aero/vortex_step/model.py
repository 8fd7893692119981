"""The vortex-step method as a model of the flow around an interface of strips."""

from dataclasses import replace
from functools import partial

import numpy as np

from aero.model import AeroModel, Flow, Response, StripLayout
from interface import MIRROR, Criterion, StepFailed, UprightPlane, Variable
from interface.validity import worst

from .wing import VortexStep, WingSensitivity

# Difference of mirrored points, m, that still counts as symmetric: what a half structure leaves by rounding.
POSITION_ASYMMETRY = 1e-9
# Difference of mirrored velocities, m/s, likewise.
VELOCITY_ASYMMETRY = 1e-6
# Part of the wind across the plane of symmetry that is rounding of its direction.
WIND_ASYMMETRY = 1e-12
# What the strips are judged by: name, quantity, limit, source.
OF_STRIPS = (
    ("stalled_strips", "stalled strips", 0.0, "section polars up to their largest lift; steady lifting lines have no "
     "single answer beyond, docs/theory/aerodynamics.md"),
    ("strips_beyond_polar", "strips beyond their polar", 0.0, "section polars: end values are held beyond"),
)  # fmt: skip
OF_MOTION = Criterion(
    "reduced_frequency", "reduced frequency", 0.05,
    "steady aerodynamics: ram-air thesis, section 4.3.1; Wright and Cooper (2008)",
)  # fmt: skip
OF_TIPS = Criterion(
    "tip_span_lost", "tip span lost", 0.15, "a wing that has folded is another equilibrium: loads take 10 % of the tip "
    "span of the V3 kite at 20 m/s, folding 28 % and more, docs/verification.md", percent=True,
)  # fmt: skip


class VortexStepModel(AeroModel):
    """A `VortexStep` wing in the wind; the state is the circulation (n,) m^2/s, a warm start.

    One half is solved and mirrored where `symmetric` asks for it and flow, shape, motion and polars all are, in the
    upright plane half way between the tips; here `symmetric` is its start value. In a `transient` case it says how fast
    the circulation changes.
    """

    title = "the vortex-step method (a lifting line) with section polars"

    def __init__(self, wing: VortexStep, symmetric: bool, transient: bool = False, drawn: np.ndarray | None = None):
        self.wing = wing
        self._drawn_tips = None if drawn is None else _tip_distance(drawn[wing.grid.sections])
        self.title = self.title if wing.induction else "strip theory with section polars"
        self.strips = StripLayout(wing.grid.sections, "alpha", "circulation", wing.polars)
        self._stall = wing.polars.stall_angles()
        self._mirrored_polars = wing.polars.mirrored()
        labels = tuple(f"strip {i}" for i in range(1, len(wing.grid.sections)))
        self.criteria = tuple(Criterion(*given, labels=labels, whole=True) for given in OF_STRIPS)
        self._moves = replace(OF_MOTION, labels=labels) if transient else None
        self.variables = (*self._declared(float(symmetric)), *self._validity_variables())
        self.criteria += () if self._moves is None else (self._moves,)
        self.criteria += () if self._drawn_tips is None else (OF_TIPS,)

    def _validity_variables(self):
        """Last of all, so that what came before them keeps its place."""
        for criterion in self.criteria:
            yield criterion.variables("strip")[1]
        if self._moves is not None:
            yield from self._moves.variables("strip")
        if self._drawn_tips is not None:
            yield from OF_TIPS.variables()

    def _declared(self, symmetric):
        panels, strips = len(self.wing.grid.panels), len(self.wing.grid.sections) - 1
        text = "solve one half and mirror it; asymmetric input turns it off (see symmetry_used)"
        switch = partial(Variable, kind="boolean", start=symmetric)
        yield switch(
            "symmetric", causality="parameter", variability="tunable", minimum=0.0, maximum=1.0, description=text
        )
        output = partial(Variable, causality="output")
        of_panel = partial(output, counts="panel")
        yield of_panel("pressure", (panels,), unit="Pa", description=self._pressure())
        if self.wing.section_force != "normal":
            text = "traction on each interface panel: all of its load that is not in pressure"
            yield of_panel("shear", (panels, 3), unit="Pa", description=text)
        of_strip = partial(output, shape=(strips,), counts="strip")
        text = "angle of the mid-span chord to the free stream, in the plane of the wind across the span there"
        yield output("alpha_mid", unit="rad", description=text)
        yield of_strip("alpha", unit="rad", description="effective angle of attack of each strip")
        if self.wing.camber:
            text = "angle by which billowing lifts the polar of each strip (thin-airfoil theory)"
            yield of_strip("camber_shift", unit="rad", description=text)
        yield of_strip("circulation", unit="m2/s", description="circulation of each strip")
        yield output("span", unit="m", description="largest extent of the displaced wing along the span at its middle")
        yield output("tip_span", unit="m", description="distance between the tips' quarter-chord points")
        count = partial(output, kind="integer")
        text = "strips whose angle of attack lies beyond the polar table, where its end value is held"
        yield count("strips_beyond_polar", description=text)
        text = "strips beyond the first lift maximum above or minimum below zero angle of attack"
        yield count("stalled_strips", description=text)
        text = "artificial viscosity in the result, in units of (lost lift slope / 2 pi) (chord / width); 0 below stall"
        yield output("stall_viscosity", description=text)
        yield output("residual", description="norm of the circulation imbalance relative to U c / 2")
        yield count("newton_iterations", description="Newton iterations of the step")
        yield switch("symmetry_used", causality="output", description="whether the last solve was of one half")

    def _pressure(self):
        """What pressure is, in words."""
        if self.wing.section_force == "normal":
            return "net pressure on each interface panel"
        if self.wing.follow:
            return "normal part of the load on each interface panel"
        return "pitching couples of the strips as pressure on each interface panel; lift and drag are in shear"

    def solve(self, flow: Flow, values, state=None):
        """See AeroModel."""
        plane = self._plane(flow) if bool(values["symmetric"]) and self._mirrored_polars else None
        seen = flow if plane is None else _inward(flow, plane)
        wing = self.wing.in_air(flow.density)
        with np.errstate(all="ignore"):
            try:
                loads = wing.loads(seen.nodes, seen.wind, state, plane is not None, seen.velocity, seen.field)
            except np.linalg.LinAlgError:
                loads = None
        if loads is None or not np.all(np.isfinite(loads.force)):
            raise StepFailed("the circulation has no finite solution; the displaced wing is degenerate.")
        found = loads.circulation
        if not found.converged:
            raise StepFailed(
                f"circulation not found in {found.newton_iterations} Newton iterations: imbalance "
                f"{found.residual:.2g} of U c / 2."
            )
        with np.errstate(all="ignore"):
            outputs = self._outputs(seen, loads) | {"symmetry_used": float(plane is not None)}
            outputs |= self._reduced_frequency(seen, loads, state)
            total = loads.total_force(), loads.total_moment(seen.about)
            if plane is not None:
                total = tuple(plane.outward(v) for v in total)
                outputs |= {"shear": plane.outward(outputs["shear"])} if "shear" in outputs else {}
            return Response(outputs, *total, found.gamma, plane is not None)

    def _plane(self, flow):
        """The `UprightPlane` that mirrors shape, motion and wind, None where there is none."""
        sections = self.wing.grid.sections
        plane = UprightPlane.between(flow.nodes[sections[0]], flow.nodes[sections[-1]])
        if plane is None or abs(plane.inward(flow.direction)[1]) > WIND_ASYMMETRY:
            return None
        motion = flow.motion
        mirrored = self._mirrored(plane.inward(flow.nodes, point=True), POSITION_ASYMMETRY)
        mirrored = mirrored and (motion is None or self._mirrored(plane.inward(motion), VELOCITY_ASYMMETRY))
        return plane if mirrored else None

    def _mirrored(self, vectors, tolerance):
        """Whether vectors (n,3) at the interface nodes are mirror-symmetric over the sections, in y = 0."""
        grid = vectors[self.wing.grid.sections]
        return np.abs(grid[::-1] * MIRROR - grid).max() <= tolerance

    def _outputs(self, flow, loads):
        found, sections = loads.circulation, flow.nodes[self.wing.grid.sections]
        bound = loads.strips.bound
        out = {"pressure": loads.pressure} | ({} if loads.shear is None else {"shear": loads.shear})
        direction = flow.direction if flow.field is None else flow.air(mid_span_chord(sections).mean(axis=0))
        out |= {"alpha_mid": mid_span_angle(sections, direction), "alpha": found.alpha}
        shift = np.zeros(len(found.alpha))
        if self.wing.camber:
            shift = out["camber_shift"] = -self.wing.grid.camber(sections, loads.strips.normal)[0]
        low, high = self._stall
        at, ends = found.alpha + shift, self.wing.polars.ends
        tips = np.linalg.norm(bound[-1] - bound[0])
        if self._drawn_tips is not None:
            out[OF_TIPS.name] = max(0.0, 1.0 - tips / self._drawn_tips)
        return out | {
            "stalled_strips_at": worst(np.maximum(at - high, low - at))[1],
            "strips_beyond_polar_at": worst(np.maximum(at - ends[:, 1], ends[:, 0] - at))[1],
            "circulation": found.gamma,
            "span": np.ptp(sections @ mid_span_axis(sections)),
            "tip_span": tips,
            "strips_beyond_polar": np.count_nonzero(found.outside),
            "stalled_strips": np.count_nonzero((at < low) | (at > high)),
            "stall_viscosity": found.viscosity,
            "residual": found.residual,
            "newton_iterations": found.newton_iterations,
        }

    def _reduced_frequency(self, flow, loads, before):
        """k = omega c / 2 U of the strip where it is largest, and which that is: omega is the change of its circulation
        since the step before, `before` (n,) m^2/s, over the time and over the largest circulation of the wing, U the
        speed of the air that it meets. Where loads swing between nothing and twice their mean at a frequency f, its
        largest value is pi f c / U; smaller swings count by their part of the load, as their unsteadiness does.
        """
        if self._moves is None:
            return {}
        found = loads.circulation
        largest = np.abs(found.gamma).max()
        if before is None or flow.dt <= 0.0 or largest == 0.0:
            k = np.zeros(1)
        else:
            moved = np.abs(found.gamma - before) / (largest * flow.dt)
            k = 0.5 * moved * loads.strips.chord / np.where(found.speed > 0.0, found.speed, np.inf)
        return dict(zip((self._moves.name, self._moves.place), worst(k), strict=True))

    def repeated(self, values):
        """See AeroModel."""
        still = {} if self._moves is None else {self._moves.name: 0.0, self._moves.place: 0}
        return {"newton_iterations": 0} | still

    def derivative(self, flow: Flow, values, state):
        """See AeroModel. Exact to rounding: the circulation follows by the implicit function theorem, all else by
        complex steps (`WingSensitivity`); artificial viscosity counts where the loads contain it.
        """
        plane = self._plane(flow) if bool(values["symmetry_used"]) else None
        seen = flow if plane is None else _inward(flow, plane)
        wing, viscosity = self.wing.in_air(flow.density), float(values["stall_viscosity"])
        try:
            along = WingSensitivity(wing, seen.nodes, seen.wind, state, viscosity, plane is not None, seen.field)
        except np.linalg.LinAlgError:
            raise ValueError("the circulation is at a fold of its solutions, where it has no derivative.") from None

        def derivative(change):
            pressure, shear = along(change if plane is None else plane.inward(change))
            shear = shear if shear is None or plane is None else plane.outward(shear)
            return {k: v for k, v in (("pressure", pressure), ("shear", shear)) if v is not None}

        return derivative

    def remarks(self, outputs):
        """See AeroModel."""
        found = []
        if beyond := int(outputs["strips_beyond_polar"]):
            alpha = np.rad2deg(outputs["alpha"])
            found.append(
                f"{beyond} strips are beyond their polar tables, where end values are held: their effective angles of "
                f"attack go from {alpha.min():.1f} to {alpha.max():.1f} deg"
            )
        if stalled := int(outputs["stalled_strips"]):
            found.append(f"{stalled} of {len(outputs['alpha'])} strips are stalled: past their largest lift")
        if viscosity := float(outputs["stall_viscosity"]):
            found.append(f"beyond stall: the circulation contains artificial viscosity ({viscosity:g})")
        return found

    def rows(self, outputs):
        """See AeroModel."""
        angle = f"{np.rad2deg(float(outputs['alpha_mid'])):.3f} deg (mid-span chord to the wind)"
        return [("angle of attack", angle), ("tip span", f"{float(outputs['tip_span']):.4f} m")]

    def tables(self):
        """See AeroModel: the panels of every strip, numbered from 1."""
        strips, rows = len(self.wing.grid.sections) - 1, self.wing.grid.rows
        columns = "front rear" if rows == 2 else " ".join(f"panel_{k + 1}" for k in range(rows))
        return [("strip", columns, [[i + k * strips for k in range(rows)] for i in range(1, strips + 1)])]


def _tip_distance(sections):
    """Distance m between the quarter-chord points of the outermost `sections` (n+1,k+1,3) m."""
    left, right = (edge[0] + 0.25 * (edge[-1] - edge[0]) for edge in (sections[0], sections[-1]))
    return float(np.linalg.norm(right - left))


def _inward(flow, plane):
    """The flow in axes where the `plane` of symmetry is y = 0."""
    direction = plane.inward(flow.direction) * np.array([1.0, 0.0, 1.0])  # what is across the plane is rounding
    return replace(
        flow,
        nodes=plane.inward(flow.nodes, point=True),
        direction=direction,
        about=plane.inward(flow.about, point=True),
        velocity=None if flow.velocity is None else plane.inward(flow.velocity),
        field=None if flow.field is None else flow.field.inward(plane),
    )


def mid_span_axis(sections):
    """Unit vector (3,) along the span at the middle of the wing, from the stations (n+1,k+1,3) m of its sections."""
    left = (len(sections) - 2) // 2
    across = (sections[len(sections) - 1 - left] - sections[left]).mean(axis=0)
    return across / np.linalg.norm(across)


def mid_span_chord(sections):
    """Stations (k+1,3) m at the middle of the span: the mean of the middle `sections`, (n+1,k+1,3) m."""
    n = len(sections)
    return 0.5 * (sections[(n - 1) // 2] + sections[n // 2])


def mid_span_angle(sections, direction):
    """Angle rad of the chord at the middle of the span (`mid_span_chord`) to the part of the wind (its `direction`,
    (3,), of any length) that is across the span there.
    """
    span, middle = mid_span_axis(sections), mid_span_chord(sections)
    chord = middle[-1] - middle[0]
    along = direction - (direction @ span) * span
    up = np.cross(along, span)
    return np.arctan2(-chord @ up, chord @ along)
