"""The vortex-step method as a model of the flow around an interface of strips."""

from dataclasses import replace
from functools import partial

import numpy as np

from aero.model import AeroModel, Flow, Response, StripLayout
from interface import MIRROR, Criterion, StepFailed, Variable
from interface.validity import worst

from .wing import VortexStep, WingSensitivity

# Difference of mirrored points, m, that still counts as symmetric: what a half structure leaves by rounding.
POSITION_ASYMMETRY = 1e-9
# Difference of mirrored velocities, m/s, likewise.
VELOCITY_ASYMMETRY = 1e-6
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


class VortexStepModel(AeroModel):
    """A `VortexStep` wing in a uniform wind; the state is the circulation (n,) m^2/s, a warm start.

    One half is solved and mirrored where `symmetric` asks for it and flow, shape, motion and polars all are; here
    `symmetric` is its start value. In a `transient` case it says how fast the circulation changes.
    """

    title = "the vortex-step method (a lifting line) with section polars"

    def __init__(self, wing: VortexStep, symmetric: bool, transient: bool = False):
        self.wing = wing
        self.title = self.title if wing.induction else "strip theory with section polars"
        self.strips = StripLayout(wing.grid.sections, "alpha", "circulation", wing.polars)
        self._stall = wing.polars.stall_angles()
        self._mirrored_polars = wing.polars.mirrored()
        labels = tuple(f"strip {i}" for i in range(1, len(wing.grid.sections)))
        self.criteria = tuple(Criterion(*given, labels=labels, whole=True) for given in OF_STRIPS)
        self._moves = replace(OF_MOTION, labels=labels) if transient else None
        self.variables = (*self._declared(float(symmetric)), *self._validity_variables())
        self.criteria += () if self._moves is None else (self._moves,)

    def _validity_variables(self):
        """Last of all, so that what came before them keeps its place."""
        for criterion in self.criteria:
            yield criterion.variables("strip")[1]
        if self._moves is not None:
            yield from self._moves.variables("strip")

    def _declared(self, symmetric):
        panels, strips = len(self.wing.grid.panels), len(self.wing.grid.sections) - 1
        text = "solve one half and mirror it; asymmetric input turns it off (see symmetry_used)"
        switch = partial(Variable, kind="boolean", start=symmetric)
        yield switch(
            "symmetric", causality="parameter", variability="tunable", minimum=0.0, maximum=1.0, description=text
        )
        output = partial(Variable, causality="output")
        of_panel = partial(output, counts="panel")
        text = "net pressure on each interface panel"
        yield of_panel("pressure", (panels,), unit="Pa", description=text)
        if self.wing.section_force != "normal":
            yield of_panel("shear", (panels, 3), unit="Pa", description="traction on each interface panel")
        of_strip = partial(output, shape=(strips,), counts="strip")
        text = "angle of the mid-span chord to the free stream"
        yield output("alpha_mid", unit="rad", description=text)
        yield of_strip("alpha", unit="rad", description="effective angle of attack of each strip")
        if self.wing.camber:
            text = "angle by which billowing lifts the polar of each strip (thin-airfoil theory)"
            yield of_strip("camber_shift", unit="rad", description=text)
        yield of_strip("circulation", unit="m2/s", description="circulation of each strip")
        yield output("span", unit="m", description="largest extent of the displaced wing across the wind plane (y)")
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

    def solve(self, flow: Flow, values, state=None):
        """See AeroModel."""
        symmetric = bool(values["symmetric"]) and flow.direction[1] == 0.0 and self._mirrored_polars
        symmetric = symmetric and self._mirrored(flow.nodes, POSITION_ASYMMETRY)
        symmetric = symmetric and (flow.velocity is None or self._mirrored(flow.velocity, VELOCITY_ASYMMETRY))
        wing = self.wing.in_air(flow.density)
        with np.errstate(all="ignore"):
            try:
                loads = wing.loads(flow.nodes, flow.wind, state, symmetric, flow.velocity)
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
            outputs = self._outputs(flow, loads) | {"symmetry_used": float(symmetric)}
            outputs |= self._reduced_frequency(flow, loads, state)
            return Response(outputs, loads.total_force(), loads.total_moment(flow.about), found.gamma, bool(symmetric))

    def _mirrored(self, vectors, tolerance):
        """Whether vectors (n,3) at the interface nodes are mirror-symmetric over the sections."""
        grid = vectors[self.wing.grid.sections]
        return np.abs(grid[::-1] * MIRROR - grid).max() <= tolerance

    def _outputs(self, flow, loads):
        found, sections = loads.circulation, flow.nodes[self.wing.grid.sections]
        bound = loads.strips.bound
        out = {"pressure": loads.pressure} | ({} if loads.shear is None else {"shear": loads.shear})
        out |= {"alpha_mid": mid_span_angle(sections, flow.direction), "alpha": found.alpha}
        shift = np.zeros(len(found.alpha))
        if self.wing.camber:
            shift = out["camber_shift"] = -self.wing.grid.camber(sections, loads.strips.normal)[0]
        low, high = self._stall
        at, table = found.alpha + shift, self.wing.polars.alpha
        return out | {
            "stalled_strips_at": worst(np.maximum(at - high, low - at))[1],
            "strips_beyond_polar_at": worst(np.maximum(at - table[-1], table[0] - at))[1],
            "circulation": found.gamma,
            "span": np.ptp(sections[..., 1]),
            "tip_span": np.linalg.norm(bound[-1] - bound[0]),
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
        wing, symmetric = self.wing.in_air(flow.density), bool(values["symmetry_used"])
        viscosity = float(values["stall_viscosity"])
        try:
            along = WingSensitivity(wing, flow.nodes, flow.wind, state, viscosity, symmetric)
        except np.linalg.LinAlgError:
            raise ValueError("the circulation is at a fold of its solutions, where it has no derivative.") from None
        return lambda change: {k: v for k, v in zip(("pressure", "shear"), along(change), strict=True) if v is not None}

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


def mid_span_angle(sections, direction):
    """Angle rad of the chord at the middle of the span (mean of the middle `sections`, (n+1,k+1,3) m) to the wind."""
    n = len(sections)
    middle = 0.5 * (sections[(n - 1) // 2] + sections[n // 2])
    chord = middle[-1] - middle[0]
    up = np.cross(direction, [0.0, 1.0, 0.0])
    return np.arctan2(-chord @ up, chord @ direction)
