"""The panel method as a model of the flow around a closed wing."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

import numpy as np

from aero.model import AeroModel, EdgeStrips, Flow, Response
from aero.wind import lift_direction
from interface import MIRROR, Criterion, StepFailed, UprightPlane, Variable, area_vectors, corner_shares
from interface.mirror import mirror_permutation
from interface.topology import listed
from interface.validity import worst
from interface.vectors import cross

from .bodies import Body
from .collocation import collocation_points
from .influence import PanelGeometry, induced_velocity
from .solver import PanelSolver, SolverState, check_memory
from .strips import Strips, section_drag
from .surfaces import lifting_surfaces
from .trefftz import far_wake, strip_forces
from .velocities import Stencils, tangential, unit
from .wake import CORE, carried, divided, straight_wake

# Differences of mirrored points, m, and velocities, m/s, that still count as symmetric, and the part of the wind across
# the plane of symmetry that is rounding.
POSITION_ASYMMETRY, VELOCITY_ASYMMETRY, WIND_ASYMMETRY = 1e-9, 1e-6, 1e-12
LARGEST_ANGLE = 45.0  # degrees of the wind to the mean chord, beyond which no flow is attached
RELAXATION_STEPS = 3
MIDDLE = 1e-6  # of the span, within which strips are as near to mid-span as the nearest
# Of the way from the stagnation line to the trailing edge: without a boundary layer the air comes to rest at a trailing
# edge that is not a cusp, and the criterion always speaks there.
ATTACHED = 0.85
# Of speed times span: circulation that the tolerance of the equations may leave, whose span efficiency is noise.
NO_LIFT = 1e-9
OF_STRIPS = (
    "separated_strips", "separated strips", 0.0, "attached flow: Stratford (1959), separated ahead of 85 % of the way "
    "to the trailing edge",
)  # fmt: skip
OF_CELLS = (
    "crossed_strips", "strips whose upper and lower side went through each other", 0.0, "no air flows there"
)  # fmt: skip

OF_POLARS = (
    "strips_beyond_polar", "strips beyond their polar", 0.0, "section polars between their largest lift on either "
    "side, whose drag is held beyond",
)  # fmt: skip

OF_EDGES = (
    "trailing_edge_skew", "offset of the panels above and below a trailing edge", 2.0, "triangles that do not face "
    "each other across a thin trailing edge: lift is off by 1.5 % at 2, 4 % at 12, 10 % at 70, docs/verification.md",
)  # fmt: skip

# Lift and drag without friction come twice, by the pressure and in the Trefftz plane; what parts them is the mesh. Each
# is judged against the latter, or this share of q times the planform where there is nearly none.
LEAST_LIFT, LEAST_DRAG = 0.05, 0.002
OF_LIFT = Criterion(
    "lift_misfit", "lift by pressure beside that in the Trefftz plane", 0.1, "both are one in potential flow",
    where="take more panels round the profile", percent=True,
)  # fmt: skip
OF_DRAG = Criterion(
    "drag_misfit", "drag by pressure beside that in the Trefftz plane", 0.5, "both are one in potential flow",
    where="take the drag in the Trefftz plane, or more panels round the profile", percent=True,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class PanelState:
    """What one step leaves to the next: the `solver`'s state, of one half where `symmetric`."""

    symmetric: bool
    solver: SolverState


@dataclass(frozen=True, eq=False)
class _Case:
    """A shape in a stream, in axes where the plane of symmetry is y = 0 if one half is solved.

    `nodes` (n,3) m with their panels' `geometry`; the `onset` at these, (3,) or (m,3) m/s, its mean `direction` (3,)
    and `speed` m/s, and where it is not the same everywhere its mean on each strip, `on_strips` (s,3) m/s; the
    `density` kg/m^3 and the upward direction `lift` (3,) across the stream.
    """

    nodes: np.ndarray
    geometry: PanelGeometry
    onset: np.ndarray
    direction: np.ndarray
    speed: float
    density: float
    lift: np.ndarray
    symmetric: bool
    on_strips: np.ndarray | None = None

    @property
    def dynamic_pressure(self):
        """Pa of the mean stream."""
        return 0.5 * self.density * self.speed**2

    @property
    def strip_directions(self):
        """Direction of the stream that the strips meet, (3,) or (s,3)."""
        return self.direction if self.on_strips is None else unit(self.on_strips)

    @property
    def strip_pressures(self):
        """Dynamic pressure Pa that the strips meet, a number or (s,)."""
        if self.on_strips is None:
            return self.dynamic_pressure
        return 0.5 * self.density * np.einsum("sc,sc->s", self.on_strips, self.on_strips)

    @property
    def side(self):
        """Direction (3,) of a positive side force."""
        return np.cross(self.lift, self.direction)


class PanelModel(AeroModel):
    """A closed `wing` (`aero.model.Wing`) in a stream by the panel method.

    The outer pressure is traction that keeps its direction, -C_p q n; the inner one, `internal_pressure_coefficient` q,
    pressure that turns with the surface; with the option `follow` "all" both are. Nodes that move meet the wind less
    their own velocity, panel by panel, and where the wind has a field, what it is there; C_p is that of the dynamic
    pressure there, what strips say is of the mean on them, and the wake goes along the mean of all.
    One half is solved where `symmetric` asks for it and shape, motion and wind all are, in the upright plane that
    mirrors the wing; the interface is the whole wing.
    """

    title, smooth = "the 3D panel method", True

    def __init__(self, wing):
        nodes, panels, options = wing.mesh.nodes, wing.mesh.panels, wing.options
        check_memory(
            len(panels) // 2 if wing.symmetric else len(panels)
        )  # before the work on a mesh that cannot be solved
        self._body, self._panels = Body.of(nodes, panels, wing.trailing_edges), panels
        self._wake, self._transition = options["wake"], options["transition"]
        self._all_follows = options["follow"] == "all"
        self._mirror(nodes)
        geometry = PanelGeometry.of(nodes, panels)
        self._stencils = {False: Stencils.of(self._body, geometry.centre, geometry.normal)}
        if self._half is not None:
            self._stencils[True] = Stencils.of(self._body, geometry.centre, geometry.normal, self._half.panels)
        self._solver: tuple[bool, PanelSolver] | None = None
        self._strips = Strips.of(self._body, nodes)
        self._polars = None if wing.polars is None else wing.polars()
        if self._polars is not None and not (self._strips.whole and len(self._polars.ends) == len(self._strips.ends)):
            raise ValueError("section polars need a wing of strips of quads, and as many of them as there are strips.")
        labels = tuple(f"strip {i}" for i in range(1, len(self._strips.ends) + 1))
        if self._strips.whole:
            self.criteria += tuple(Criterion(*of, labels=labels, whole=True) for of in (OF_STRIPS, OF_CELLS))
        if self._polars is not None:
            self._of_polars = Criterion(*OF_POLARS, labels=labels, whole=True)
            self.criteria += (self._of_polars,)
        if labels:
            self._of_edges = Criterion(*OF_EDGES, labels=labels)
            self.criteria += (self._of_edges, OF_LIFT, OF_DRAG)
        if self._strips.whole:
            upper = geometry.normal[self._strips.edges[:, 0]]
            chord = self._strips.chords(nodes, geometry.centre).mean(axis=0)
            surfaces = lifting_surfaces(self._strips.ends, nodes, upper, chord)
            self.edge_strips = EdgeStrips(self._strips.ends, surfaces)
        self.variables = tuple(self._declared(float(wing.symmetric), options))

    def _mirror(self, nodes):
        """The half of the wing at rest and which nodes mirror which, None where it is not symmetric."""
        self._image, self._half = mirror_permutation(nodes, POSITION_ASYMMETRY), cast(Any, None)
        try:
            self._half = None if self._image is None else self._body.half(nodes)
        except ValueError:
            self._half = None
        if self._half is not None:
            self._right = np.flatnonzero(
                (nodes[:, 1] > POSITION_ASYMMETRY) & np.isin(np.arange(len(nodes)), self._panels)
            )

    def _declared(self, symmetric, options):
        parameter = partial(Variable, causality="parameter", variability="tunable")
        switch = partial(parameter, kind="boolean", minimum=0.0, maximum=1.0)
        text = "solve one half and mirror it; asymmetric input turns it off (see symmetry_used)"
        yield switch("symmetric", start=symmetric, description=text)
        text = "pressure inside over the dynamic pressure of the wind: 1 behind an inlet that the wind meets"
        start = options["internal_pressure_coefficient"]
        yield parameter("internal_pressure_coefficient", start=start, minimum=-10.0, maximum=10.0, description=text)
        if self._strips.whole:
            start, text = options["kinematic_viscosity"], "kinematic viscosity of the air, for where it separates"
            air = partial(parameter, minimum=1e-9, maximum=1.0)
            yield air("kinematic_viscosity", unit="m2/s", start=start, description=text)
            if self._polars is None:
                start, text = options["profile_drag_coefficient"], "c_d of all strips, beside the drag by pressure"
                drag = partial(parameter, minimum=0.0, maximum=10.0)
                yield drag("profile_drag_coefficient", start=start, description=text)
        output = partial(Variable, causality="output")
        of_panel = partial(output, counts="panel")
        m = len(self._panels)
        text = "pressure inside less that outside" if self._all_follows else "pressure inside"
        yield of_panel("pressure", (m,), unit="Pa", description=f"{text} on each interface panel, net of rest")
        text = "traction on each interface panel by the flow outside"
        yield of_panel("shear", (m, 3), unit="Pa", description=text)
        text = "C_p outside on each panel, over the dynamic pressure that it meets"
        yield of_panel("pressure_coefficient", (m,), description=text)
        yield from self._of_strips(partial(output, shape=(len(self._strips.ends),), counts="strip"))
        yield from self._of_wing(output)

    def _of_strips(self, of_strip):
        text = "circulation of each strip; positive where its force points to the side of its upper panel"
        yield of_strip("circulation", unit="m2/s", description=text)
        text = "force of each strip per width across the wind, in the Trefftz plane, {}"
        yield of_strip("strip_lift", unit="N/m", description=text.format("upwards"))
        yield of_strip("strip_side_force", unit="N/m", description=text.format("to the side"))
        if self._strips.whole:
            text = "angle of the chord of each strip to the wind, in the plane across its trailing edge"
            yield of_strip("alpha", unit="rad", description=text)
            text = "where its suction side separates, of the way from stagnation line to trailing edge; 1: nowhere"
            yield of_strip("separation", description=text)
            text = f"whether each strip separates ahead of {100.0 * ATTACHED:g} % of the way"
            yield of_strip("separated", kind="boolean", description=text)

    def _of_wing(self, output):
        newton = partial(output, unit="N")
        yield newton("pressure_lift", description="lift of the pressure outside")
        yield newton("pressure_drag", description="drag of the pressure outside")
        yield newton("trefftz_lift", description="lift by the wake, in the Trefftz plane")
        yield newton("trefftz_side_force", description="side force by the wake, in the Trefftz plane")
        yield newton("induced_drag", description="drag by the wake, in the Trefftz plane")
        text = (
            "L^2 / (q pi b^2 D) in the Trefftz plane, b the extent of the trailing edges across wind and lift; 0 where "
            "there is no circulation beyond the tolerance of the equations"
        )
        yield output("span_efficiency", description=text)
        if self._strips.whole:
            text = "angle of attack: of the chord at mid-span to the wind, in the plane of wind and lift"
            yield output("alpha_mid", unit="rad", description=text)
            yield newton("profile_drag", description="drag by c_d of the strips; it is part of the force and of CD")
            text = "Reynolds number of the mean chord"
            yield output("reynolds_number", description=text)
        for criterion in self.criteria:
            yield from criterion.variables("strip" if criterion.labels else "")
        if self._wake == "relaxed":
            text = f"movement of the wake in the last of {RELAXATION_STEPS} relaxation steps, the most, over the span"
            yield output("wake_change", description=text)
        text = (
            "distance of the diagonals of a panel over its width, its area over its longest side or diagonal; the most"
        )
        yield output("warp", description=text)
        count = partial(output, kind="integer")
        yield count("gmres_iterations", description="GMRES iterations of the step")
        yield output("residual", description="residual of the panels' equations over that without doublets")
        text = "whether the equations were factored anew in the step"
        yield output("factored", kind="boolean", description=text)
        yield output("symmetry_used", kind="boolean", description="whether the last solve was of one half")
        if self._strips.whole:
            yield from self._of_loading(partial(output, shape=(len(self._strips.ends),), counts="strip"))

    def _of_loading(self, of_strip):
        yield of_strip("strip_width", unit="m", description="length of each trailing edge across the wind")
        text = "chord of each strip, from its nose to the middle of its trailing edge"
        yield of_strip("strip_chord", unit="m", description=text)
        text = "c c_l of each strip, {}; positive towards the side of its upper panel"
        yield of_strip("span_loading", unit="m", description=text.format("in the Trefftz plane"))
        yield of_strip("pressure_span_loading", unit="m", description=text.format("by the pressure on its panels"))
        text = "force of the pressure on the panels of each strip, per width across the wind"
        yield of_strip("strip_pressure_load", shape=(len(self._strips.ends), 3), unit="N/m", description=text)

    def solve(self, flow: Flow, values, state=None):
        """See AeroModel."""
        plane = self._plane(flow) if bool(values["symmetric"]) else None
        case = self._case(flow, plane)
        self._check(case)
        kept = state.solver if state is not None and state.symmetric == case.symmetric else None
        found, wake, extra, kept = self._strengths(case, kept)
        doublets, jumps = self._whole(case, found)
        loads = self._loads(case, doublets, jumps, wake, values)
        outputs = loads | extra | {"warp": float((case.geometry.warp * case.geometry.size / case.geometry.area).max())}
        outputs |= {"gmres_iterations": found.iterations, "residual": found.residual}
        if len(self._strips.ends):
            name, place = self._of_edges.name, self._of_edges.place
            skew = self._strips.skewness(case.nodes, collocation_points(self._body, case.nodes))
            outputs |= dict(zip((name, place), worst(skew), strict=True))
        outputs |= {"factored": float(found.factored), "symmetry_used": float(case.symmetric)}
        if plane is not None:
            turned = [name for name in ("shear", "strip_pressure_load") if name in outputs]
            outputs |= {name: plane.outward(outputs[name]) for name in turned}
        force, moment = self._resultant(flow, outputs["pressure"], outputs["shear"])
        return Response(outputs, force, moment, PanelState(case.symmetric, kept), case.symmetric)

    def _plane(self, flow):
        """The `UprightPlane` that mirrors shape, motion and wind, None where there is none."""
        if self._half is None:
            return None
        plane = UprightPlane.between(flow.nodes[self._image[self._right]], flow.nodes[self._right])
        if plane is None or abs(plane.inward(flow.direction)[1]) > WIND_ASYMMETRY:
            return None
        mirrored = self._mirrored(plane.inward(flow.nodes, point=True), POSITION_ASYMMETRY)
        motion = flow.motion
        if motion is not None:
            mirrored = mirrored and self._mirrored(plane.inward(motion), VELOCITY_ASYMMETRY)
        return plane if mirrored else None

    def _mirrored(self, vectors, tolerance):
        """Whether vectors (n,3) at the nodes are mirror-symmetric in y = 0."""
        return np.abs(vectors[self._image] * MIRROR - vectors).max() <= tolerance

    def _case(self, flow, plane):
        lift = lift_direction(flow.direction)
        nodes, wind, velocity, direction = flow.nodes, flow.wind, flow.motion, flow.direction
        if plane is not None:
            nodes, wind, lift = plane.inward(nodes, point=True), plane.inward(wind), plane.inward(lift)
            wind = wind * [1.0, 0.0, 1.0]  # what is across the plane is rounding
            direction = unit(plane.inward(direction) * [1.0, 0.0, 1.0])
            velocity = None if velocity is None else plane.inward(velocity)
        try:
            geometry = PanelGeometry.of(nodes, self._panels)
        except ValueError as error:
            raise StepFailed(f"the displaced wing is degenerate: {error}") from None
        mean, onset, on_strips = wind, wind, None
        if velocity is not None:
            corners = nodes[self._panels]
            onset = wind - np.einsum("mi,mic->mc", corner_shares(corners), velocity[self._panels])
            mean = np.average(onset, axis=0, weights=geometry.area)
            mean = mean * [1.0, 0.0, 1.0] if plane is not None else mean
        speed = float(np.linalg.norm(mean))
        if not speed > 0.0:
            raise StepFailed("the wing moves with the wind, so that no air meets it.")
        if velocity is not None and self._strips.whole:
            on_strips = self._strips.means(onset, geometry.area)
        if velocity is not None:  # else the direction is that of any speed to the last bit: factors are kept for it
            direction = mean / speed
            lift = unit(lift - (lift @ mean) * mean / speed**2)
        return _Case(nodes, geometry, onset, direction, speed, flow.density, lift, plane is not None, on_strips)

    def _check(self, case):
        """StepFailed for a shape or a stream that the method knows nothing of."""
        try:
            if case.symmetric:
                self._half.body.check_plane(case.nodes)
            self._body.check_strips(case.nodes)
        except ValueError as error:
            raise StepFailed(f"the displaced wing: {error}") from None
        if not len(self._strips.ends):
            return
        chord = self._strips.chords(case.nodes, case.geometry.centre)
        mean = unit(chord).T @ self._strips.widths(case.nodes, case.direction)
        angle = np.rad2deg(np.arccos(np.clip(unit(mean) @ case.direction, -1.0, 1.0)))
        if angle > LARGEST_ANGLE:
            raise StepFailed(
                f"the wind meets the wing at {angle:.3g} deg to its mean chord; the panel method knows attached flow "
                f"only, up to {LARGEST_ANGLE:g} deg."
            )
        self._check_strips_ahead(case, chord)
        try:
            self._body.check_wake(case.nodes, case.direction)
        except ValueError as error:
            raise StepFailed(str(error)) from None

    @staticmethod
    def _check_strips_ahead(case, chord):
        """StepFailed where strips with `chord` (s,3) m meet the air from their trailing edges, as the mean does not."""
        if case.on_strips is None:
            return
        behind = np.flatnonzero(np.einsum("sc,sc->s", case.on_strips, chord) < 0.0)
        if len(behind):
            raise StepFailed(
                f"the air meets the strip{listed(1 + behind)} from behind; the panel method knows attached flow only: "
                "let the wing turn or move more slowly, or let the wind differ less over its span."
            )

    def _solver_of(self, symmetric):
        """The solver of the half or of the whole wing; there is one at a time, for its memory."""
        if self._solver is None or self._solver[0] != symmetric:
            self._solver = None
            half = self._half
            of_half = (half.body, self._body, half.panels) if symmetric else (self._body,)
            self._solver = symmetric, PanelSolver(*of_half)
        return self._solver[1]

    def _strengths(self, case, state):
        """The `Solution`, the whole wake, further outputs and the solver's state."""
        solver = self._solver_of(case.symmetric)
        onset = case.onset if case.onset.ndim == 1 or not case.symmetric else case.onset[self._half.panels]
        found, state = solver.solve(case.nodes, onset, case.direction, state)
        wake = straight_wake(self._body, case.nodes, case.direction)
        if self._wake == "straight":
            return found, wake, {}, state
        span, iterations, change = self._span(case), found.iterations, 0.0
        wake = divided(wake, span) if len(self._strips.ends) else wake
        for _ in range(RELAXATION_STEPS if len(self._strips.ends) else 0):
            wake, change = carried(wake, self._strips.ends, self._velocity(case, found, wake))
            own = wake.of(self._half.strips) if case.symmetric else wake
            found, state = solver.solve(case.nodes, onset, case.direction, state, own)
            iterations += found.iterations
        return replace(found, iterations=iterations), wake, {"wake_change": change / span}, state

    def _velocity(self, case, found, wake):
        """Velocity of the air at points off the body, a function of these."""
        doublets, jumps = self._whole(case, found)
        sources = -np.einsum(
            "mc,...mc->m", case.geometry.normal, np.broadcast_to(case.onset, case.geometry.normal.shape)
        )
        stream, core = case.speed * case.direction, CORE * self._span(case)

        def velocity(points):
            return (
                stream + induced_velocity(case.geometry, points, sources, doublets) + wake.velocity(points, jumps, core)
            )

        return velocity

    def _whole(self, case, found):
        """Doublets (m,) and jumps (s,) of the whole wing."""
        if not case.symmetric:
            return found.doublets, found.jumps
        return self._half.whole(found.doublets), self._half.whole_strips(found.jumps)

    def _span(self, case):
        """Extent m of the trailing edges across stream and lift."""
        return float(np.ptp(case.nodes[self._strips.ends.ravel()] @ case.side)) if len(self._strips.ends) else 0.0

    def _surface_velocity(self, case, doublets):
        """Velocity (m,3) m/s along the surface at all panels."""
        stencils, g = self._stencils[case.symmetric], case.geometry
        onset = case.onset if case.onset.ndim == 1 else case.onset[stencils.rows]
        points = collocation_points(self._body, case.nodes)
        perturbed = onset - stencils.gradient(stencils.weights(points, g.normal, g.centre), doublets)
        velocity = tangential(perturbed, stencils.normals(g.normal))
        return self._half.whole(velocity) if case.symmetric else velocity

    def _loads(self, case, doublets, jumps, wake, values):
        """Loads on the panels and what strips and wake say, all in the axes of the case."""
        g, velocity = case.geometry, self._surface_velocity(case, doublets)
        onset2 = np.einsum("...c,...c->...", case.onset, case.onset)
        speed2 = np.einsum("mc,mc->m", velocity, velocity)
        outside = 0.5 * case.density * (onset2 - speed2)
        shear = -outside[:, None] * g.normal
        size = np.linalg.norm(area_vectors(g.corners), axis=1)
        force = size @ shear
        inside = float(values["internal_pressure_coefficient"]) * case.dynamic_pressure
        out = {
            "pressure": np.full(len(g.area), inside),
            "pressure_coefficient": 1.0 - speed2 / np.where(onset2 > 0.0, onset2, np.inf),
            "pressure_lift": force @ case.lift,
            "pressure_drag": force @ case.direction,
        }
        far = self._far(case, jumps, wake)
        own = self._leaving(case, far, jumps, wake)
        out |= self._in_trefftz_plane(case, far, own, jumps)
        out |= self._misfits(case, out) if len(jumps) else {}
        if self._strips.whole:
            drag, of_strips = self._sections(case, own, jumps, velocity, values)
            of_strips |= self._loading(case, own, size[:, None] * shear)
            shear = shear + drag
            out |= of_strips
        if self._all_follows:
            out["pressure"], shear = out["pressure"] - outside, shear + outside[:, None] * g.normal
        return out | {"shear": shear}

    def _misfits(self, case, out):
        """How far lift and drag by pressure are from those in the Trefftz plane."""
        planform = 0.5 * np.abs(area_vectors(case.geometry.corners) @ case.lift).sum()
        force, lift, drag = case.dynamic_pressure * planform, out["trefftz_lift"], out["induced_drag"]
        return {
            OF_LIFT.name: abs(out["pressure_lift"] - lift) / max(abs(lift), LEAST_LIFT * force),
            OF_DRAG.name: abs(out["pressure_drag"] - drag) / max(drag, LEAST_DRAG * force),
        }

    def _far(self, case, jumps, wake):
        """The `FarWake` of the strips."""
        ends, nodes, speed = self._strips.ends, case.nodes, self._strip_speed(case)
        if wake.segments:
            nodes = nodes.copy()
            nodes[ends.T] = np.stack(wake.far_ends)
        return far_wake(nodes, ends, jumps, case.direction, speed, case.density)

    def _leaving(self, case, far, jumps, wake):
        """The `far` wake with force and width of strips where they leave the wing; a relaxed one rolls up behind it."""
        if not wake.segments:
            return far
        stream = case.direction, self._strip_speed(case), case.density
        force, width = strip_forces(case.nodes, self._strips.ends, jumps, *stream)
        return replace(far, strip_force=force, width=width)

    def _strip_speed(self, case):
        return case.speed if case.on_strips is None else case.on_strips @ case.direction

    def _in_trefftz_plane(self, case, far, own, jumps):
        per_width = own.strip_force / np.where(own.width > 0.0, own.width, np.inf)[:, None]
        return {
            "circulation": -jumps,
            "strip_lift": per_width @ case.lift,
            "strip_side_force": per_width @ case.side,
            "trefftz_lift": far.lift @ case.lift,
            "trefftz_side_force": far.lift @ case.side,
            "induced_drag": far.induced_drag,
            "span_efficiency": self._span_efficiency(case, far, jumps),
        }

    def _span_efficiency(self, case, far, jumps):
        span = self._span(case)
        if np.abs(jumps).max(initial=0.0) <= NO_LIFT * case.speed * span:
            return 0.0
        return far.span_efficiency(span, case.dynamic_pressure)

    def _sections(self, case, far, jumps, velocity, values):
        """Traction (m,3) Pa of the profile drag, and outputs of strips with a chord."""
        strips, g, q, direction = self._strips, case.geometry, case.strip_pressures, case.strip_directions
        chord = strips.chords(case.nodes, g.centre)
        length, alpha = np.linalg.norm(chord, axis=1), strips.angles(case.nodes, chord, direction)
        viscosity = float(values["kinematic_viscosity"])
        at = strips.separations(case.nodes, g.centre, velocity, viscosity, self._transition)
        separated = at < ATTACHED
        area = length * far.width
        cd, of_polars = self._section_drag(far, jumps, q * area, values)
        drag = q * area * cd
        mean = float(area.sum() / far.width.sum())
        crossed = strips.crossed(g.centre, g.normal)
        of_strips, of_cells = self.criteria[:2]
        return strips.spread(drag[:, None] * direction, g.area), {
            "alpha": alpha,
            "strip_chord": length,
            "separation": at,
            "separated": separated.astype(float),
            of_strips.name: np.count_nonzero(separated),
            of_strips.place: worst(np.where(separated, 1.0 - at, 0.0))[1],
            of_cells.name: np.count_nonzero(crossed),
            of_cells.place: worst(crossed.astype(float))[1],
            "profile_drag": float((drag if case.on_strips is None else drag * (direction @ case.direction)).sum()),
            "reynolds_number": case.speed * mean / viscosity,
            "alpha_mid": self._mid_angle(case, chord),
        } | of_polars

    def _loading(self, case, far, force):
        """c c_l of the strips by what they shed, and by the `force` (m,3) N of the pressure on their panels."""
        strips = self._strips
        a, b = case.nodes[strips.ends.T]
        across = cross(np.broadcast_to(case.direction, a.shape), b - a)  # towards the upper side
        width = np.where(far.width > 0.0, far.width, np.inf)
        normal, q = across / width[:, None], case.strip_pressures
        carried = strips.sums(force) / width[:, None]
        return {
            "strip_width": far.width,
            "span_loading": np.einsum("sc,sc->s", far.strip_force, normal) / (q * width),
            "pressure_span_loading": np.einsum("sc,sc->s", carried, normal) / q,
            "strip_pressure_load": carried,
        }

    def _section_drag(self, far, jumps, force, values):
        """c_d (s,) of strips of `force` (s,) N, dynamic pressure times area each, and what their polars say."""
        if self._polars is None:
            return np.full(len(jumps), float(values["profile_drag_coefficient"])), {}
        lift = np.linalg.norm(far.strip_force, axis=1) / np.where(force > 0.0, force, np.inf)
        cd, beyond = section_drag(self._polars, -np.sign(jumps) * lift)
        at = self._of_polars
        return cd, {
            at.name: np.count_nonzero(beyond),
            at.place: worst(np.where(beyond, lift, 0.0))[1],
        }

    def _mid_angle(self, case, chord):
        """Angle rad of the mean of the chords (s,3) nearest to mid-span, nose up, in the plane of wind and lift."""
        at = self._strips.middles(case.nodes) @ case.side
        off = np.abs(at - 0.5 * (at.min() + at.max()))
        middle = chord[off <= off.min() + MIDDLE * np.ptp(at)].mean(axis=0)
        return float(np.arctan2(-middle @ case.lift, middle @ case.direction))

    def _resultant(self, flow, pressure, shear):
        """Force (3,) N and moment (3,) N m of the loads as whoever receives them takes them."""
        corners = flow.nodes[self._panels]
        area = area_vectors(corners)
        force = pressure[:, None] * area + np.linalg.norm(area, axis=1)[:, None] * shear
        point = np.einsum("mi,mic->mc", corner_shares(corners), corners)
        return force.sum(axis=0), np.cross(point - flow.about, force).sum(axis=0)

    def repeated(self, values):
        """See AeroModel."""
        return {"gmres_iterations": 0, "factored": 0.0}

    def remarks(self, outputs):
        """See AeroModel."""
        found = []
        if self._strips.whole and (count := int(outputs["separated_strips"])):
            at = np.flatnonzero(np.asarray(outputs["separated"]) > 0.0) + 1
            named = ", ".join(map(str, at[:8])) + (" and more" if len(at) > 8 else "")
            found.append(
                f"{count} of {len(self._strips.ends)} strips separate by Stratford's criterion (strips {named}): loads "
                "are those of attached flow all the same"
            )
        return found

    def rows(self, outputs):
        """See AeroModel."""
        pairs = [("lift", "pressure_lift", "trefftz_lift"), ("drag without friction", "pressure_drag", "induced_drag")]
        found = [
            (k, f"{float(outputs[a]):.5g} N by pressure, {float(outputs[b]):.5g} N in the Trefftz plane")
            for k, a, b in pairs
        ]
        efficiency = float(outputs["span_efficiency"])
        found.append(("span efficiency", f"{efficiency:.4f}" if efficiency else "none without lift"))
        if self._strips.whole:
            found.insert(
                0,
                ("angle of attack", f"{np.rad2deg(float(outputs['alpha_mid'])):.3f} deg (mid-span chord to the wind)"),
            )
        return found

    def tables(self):
        """See AeroModel: where every strip leaves the wing, numbered from 1."""
        if not len(self._strips.ends):
            return ()
        rows = [
            [1 + int(v) for v in (*nodes, *panels)]
            for nodes, panels in zip(self._strips.ends, self._strips.edges, strict=True)
        ]
        return [("strip", "node_a node_b upper_panel lower_panel", rows)]
