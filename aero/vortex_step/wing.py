"""Vortex-step method on a deformed wing: from interface nodes to pressures and shears, and their derivatives."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from aero.complex_steps import STEP, moved
from aero.polars import StripPolars
from interface.mirror import MIRROR
from interface.vectors import cross

from .circulation import Circulation, SectionFlow, attached_start, flow_angle, solve
from .strips import Strips, strips_between, unit
from .surface_loads import PanelGeometry, SurfaceGrid, panel_geometry, pressure_and_shear, two_panel_loads
from .vortices import CORE_FRACTION, control_influence, folded, wake_influence


@dataclass(frozen=True, eq=False)
class WingLoads:
    """Loads on n strips and k n panels for one shape in one wind.

    `pressure` (k n,) Pa, `shear` (k n,3) Pa or None; per strip: `force` (n,3) N acting at `point` (n,3) m with the
    couple `moment` (n,3) N m, `alpha` (n,) rad, `circulation`. `strips` is the geometry that was used.
    """

    pressure: np.ndarray
    shear: np.ndarray | None
    force: np.ndarray
    point: np.ndarray
    moment: np.ndarray
    circulation: Circulation
    strips: Strips

    def total_force(self):
        """Force on the wing (3,) N."""
        return self.force.sum(axis=0)

    def total_moment(self, about):
        """Moment on the wing (3,) N m about a point (3,) m."""
        return (np.cross(self.point - about, self.force) + self.moment).sum(axis=0)


@dataclass(frozen=True, eq=False)
class _Placed:
    """A wing in one shape and wind: `flow` through the strips `rows` that are solved for, of all `strips`.

    `wake` (3,) is the direction of the wake, `extra_moment` (n,) the change of c_m by camber and pitching, if any.
    """

    nodes: np.ndarray
    strips: Strips
    flow: SectionFlow
    wake: np.ndarray
    rows: slice
    symmetric: bool
    extra_moment: np.ndarray | None


@dataclass(frozen=True, eq=False)
class VortexStep:
    """A wing of strips with section polars, ready to be solved on any shape of its interface surface.

    `induction` False is strip theory: every section meets the free stream. `direction` chooses the flow that the
    section lift is normal to: at the "bound" vortex, as in lifting-line theory, with half the wash of the far wake
    (`wake_influence`: the induced drag of the Trefftz plane, within 2.5 % up to 45 degrees of sweep at small angles),
    or at the "control" point, as Damiani et al. (2019) and the Vortex-Step-Method code do, which adds drag.
    `circulation_speed` chooses the speed of
    gamma = lift / (rho speed): the "local" one (Kutta-Joukowski), or the "far" one of the same authors.
    With `camber` the stations between leading and trailing edge change the polars as thin-airfoil theory says
    (`SurfaceGrid.camber`): the zero-lift angle moves the whole polar, and the pitching moment gets its share.
    `section_force` "lift-drag" reads the polars as cl and cd; "normal" reads cl as c_n of a thin plate that carries
    pressure only: no shear then. `follow` see `pressure_and_shear`.
    """

    polars: StripPolars
    grid: SurfaceGrid
    density: float = 1.225
    induction: bool = True
    direction: Literal["bound", "control"] = "bound"
    section_force: Literal["lift-drag", "normal"] = "lift-drag"
    follow: bool = False
    circulation_speed: Literal["local", "far"] = "local"
    core_fraction: float = CORE_FRACTION
    camber: bool = False
    mirror: np.ndarray = field(init=False)
    _panels: np.ndarray = field(init=False)

    def __post_init__(self):
        n = len(self.grid.sections) - 1
        object.__setattr__(self, "mirror", np.arange(n)[::-1])
        object.__setattr__(self, "_panels", self.grid.panels)

    def in_air(self, density):
        """The same wing in air of this density kg/m^3."""
        return self if density == self.density else replace(self, density=density)

    def loads(self, nodes, wind, start=None, symmetric=False, velocity=None, field=None):
        """Loads for interface `nodes` (s,3) m in the `wind` (3,) m/s, from the circulation `start` (n,) if there is
        one.

        With `symmetric` only the half of the strips with y > 0 is solved and the other half mirrored. With the
        `velocity` (s,3) m/s of the nodes every strip meets the wind minus its own velocity at its control point, at
        three quarters of the chord, and pitching has the c_m -pi q c / 8 U about the quarter chord, U the speed of the
        air that the strip meets: both as thin-airfoil theory says for a steady pitch rate q (quasi-steady: without
        shed vortices and without the inertia of the air). The wake goes with the wind. What a `field` (`LinearField`)
        of the wind has more at the nodes counts as their motion against it does, and the wake goes with the mean over
        the strips of the wind that they meet at rest.
        """
        at = self.placed(nodes, wind, symmetric, velocity, field)
        return self.loaded(at, self._solve(at.flow, None if start is None else start[at.rows]))

    def placed(self, nodes, wind, symmetric=False, velocity=None, field=None):
        """The strips and the flow to be solved for `nodes`, `wind`, `symmetric`, `velocity`, `field` as in `loads`."""
        sections = nodes[self.grid.sections]
        strips = strips_between(sections[:, 0], sections[:, -1])
        zero_lift, extra = self.grid.camber(sections, strips.normal) if self.camber else (None, None)
        wind = np.asarray(wind, float)
        wake = wind / np.linalg.norm(wind)
        if field is not None:
            beside = field.velocity(nodes)
            velocity = -beside if velocity is None else velocity - beside
            wake = mean_direction(wind + field.velocity(strips.control), strips, symmetric)
        n = len(strips.chord)
        rows = slice(n // 2, n) if symmetric else slice(0, n)
        if velocity is not None:
            moving = velocity[self.grid.sections]
            wind = wind - strips.at_control(moving[:, 0], moving[:, -1])
            speed = np.sqrt((wind * wind).sum(axis=1))  # of complex steps too
            rate = strips.pitch_rate(moving[:, 0], moving[:, -1])
            damping = -0.125 * np.pi * rate * strips.chord / np.where(speed > 0.0, speed, np.inf)
            extra = damping if extra is None else extra + damping
            wind = wind[rows]
        flow = self._flow(strips, wind, wake, rows, symmetric, zero_lift)
        return _Placed(nodes, strips, flow, wake, rows, symmetric, extra)

    def loaded(self, at, circulation):
        """Loads on a `placed` wing with the `circulation` of the strips that are solved for."""
        force, moment = self._section_loads(at, circulation)
        if at.extra_moment is not None:
            part = at.flow.strips
            q_area = 0.5 * self.density * circulation.speed**2 * part.chord * part.width
            moment = moment + q_area * part.chord * at.extra_moment[at.rows]
        if at.symmetric:
            circulation, force, moment = _whole(circulation, force, moment, len(at.strips.chord))
        return self._on_surface(at.nodes, at.strips, force, moment, circulation)

    def _flow(self, strips, wind, wake, rows, symmetric, zero_lift=None):
        part = _part(strips, rows)
        influence = None
        if self.induction:
            influence = control_influence(strips, wake, rows, self.core_fraction)
            if symmetric:
                influence = folded(influence, self.mirror)
        middle = symmetric and len(self.mirror) % 2 == 1
        far = None
        if self.circulation_speed == "far":
            along = part.span @ wind if wind.ndim == 1 else np.einsum("ik,ik->i", part.span, wind)
            across = wind - along[:, None] * part.span
            far = np.sqrt(np.einsum("ik,ik->i", across, across))
            far = np.where(far.real > 0.0, far, np.inf)  # strips at rest in the air have no circulation
        shift = None if zero_lift is None else -zero_lift[rows]
        polars = self.polars.of(rows)
        return SectionFlow(influence, wind, part, polars, far_speed=far, from_middle=middle, shift=shift)

    @staticmethod
    def _solve(flow, start):
        return solve(flow, attached_start(flow) if start is None else start)

    def _section_loads(self, at, circulation):
        """Force (p,3) N and pitching moment (p,) N m of the solved strips."""
        flow, part = at.flow, at.flow.strips
        cl, cd, cm = flow.polars.all(flow.polar_angle(circulation.alpha))
        q_area = 0.5 * self.density * circulation.speed**2 * part.chord * part.width
        moment = q_area * part.chord * cm
        if self.section_force == "normal":
            return (q_area * cl)[:, None] * part.normal, moment
        alpha = circulation.alpha
        if self.direction == "bound" and self.induction:
            wash = wake_influence(at.strips, at.wake, at.rows, self.core_fraction)
            if at.symmetric:
                wash = folded(wash, self.mirror)
            v = flow.free_stream + (wash @ circulation.gamma).T
            alpha = flow_angle(np.einsum("ik,ik->i", v, part.normal), np.einsum("ik,ik->i", v, part.tangent))
        along = np.cos(alpha)[:, None] * part.tangent + np.sin(alpha)[:, None] * part.normal
        lift = unit(cross(along, part.span))
        drag = cross(part.span, lift)
        return (q_area * cl)[:, None] * lift + (q_area * cd)[:, None] * drag, moment

    def _on_surface(self, nodes, strips, force, moment, circulation):
        n, k = len(moment), self.grid.rows
        f = self.grid.fractions
        fractions = np.repeat(np.stack([f[:-1], f[1:], f[1:], f[:-1]], axis=1), n, axis=0)
        panels = panel_geometry(nodes[self._panels], fractions)
        shapes = self.grid.shapes
        fore, aft = (_weighed(panels, shape, n) for shape in shapes)
        steady, couple, point, turning = two_panel_loads(force, moment, strips.span, fore, aft)
        steady, couple = (
            np.einsum("sk,sni->kni", shapes, np.stack(both)).reshape(k * n, 3) for both in (steady, couple)
        )
        follow = self.follow or self.section_force == "normal"
        pressure, shear = pressure_and_shear(steady, couple, panels, follow)
        if self.section_force == "normal":  # what lies along warped panels is dropped: report what is sent
            shear = None
            sent = pressure[:, None] * panels.area
            arms = panels.centroid - np.tile(point, (k, 1))
            force, turning = (v.reshape(k, n, 3).sum(axis=0) for v in (sent, cross(arms, sent)))
        return WingLoads(pressure, shear, force, point, turning, circulation, strips)


def mean_direction(velocity, strips, symmetric):
    """Direction (3,) of the mean of velocities (n,3) at strips by their areas, in y = 0 where they are `symmetric`."""
    mean = (strips.chord * strips.width) @ velocity * np.array([1.0, 0.0 if symmetric else 1.0, 1.0])
    speed = np.sqrt(mean @ mean)
    return mean / np.where(speed != 0.0, speed, 1.0)


def _weighed(panels, shape, n):
    """The panels of each strip as one, with the centroid of the load `shape` (k,)."""
    centroid = np.einsum("k,kni->ni", shape, panels.centroid.reshape(-1, n, 3))
    fraction = shape @ panels.fraction.reshape(-1, n)
    return PanelGeometry(panels.area[:n], panels.area2[:n], centroid, fraction)


def _part(strips, rows):
    names = ("control", "centre", "chord", "width", "tangent", "span", "normal")
    return Strips(strips.bound, strips.trailing_edge, *(getattr(strips, name)[rows] for name in names))


def _whole(circulation, force, moment, n):
    """The mirrored half added: strips 0 ... n/2 - 1 are the images of the solved ones in reverse order."""
    image = slice(None, 0 if n % 2 else None, -1)
    mirrored = force * MIRROR

    def join(a, b):
        return np.concatenate([a[image], b])

    halves = {name: getattr(circulation, name) for name in ("gamma", "alpha", "speed", "outside")}
    whole = replace(circulation, **{name: join(half, half) for name, half in halves.items()})
    return whole, join(mirrored, force), join(moment, moment)


class WingSensitivity:
    """Derivative of a wing's pressures and shears with respect to its nodes, at a solved shape.

    The imbalance of the circulation stays zero, F(gamma, x) = 0, so that for nodes moving along v

        dgamma = -(dF/dgamma)^-1 (dF/dx) v,   dp = (dp/dgamma) dgamma + (dp/dx) v,

    with the Jacobian of `SectionFlow`, inverted once. All else moves with v: strips, influence, camber, artificial
    viscosity, panels, all of them analytic, so by complex steps (`aero.complex_steps`).

    `circulation` (n,) m^2/s is the solution on `nodes` (s,3) m in the `wind` (3,) m/s, which contains the artificial
    `viscosity`; `symmetric` and `field` as in `VortexStep.loads`. numpy.linalg.LinAlgError where the Jacobian is
    singular.
    """

    def __init__(self, wing: VortexStep, nodes, wind, circulation, viscosity=0.0, symmetric=False, field=None):
        self._wing, self._nodes, self._wind, self._symmetric = wing, nodes, wind, symmetric
        self._viscosity, self._field = viscosity, field
        at = wing.placed(nodes, wind, symmetric, field=field)
        self._gamma = circulation[at.rows]
        flow = at.flow.with_viscosity(viscosity)
        self._inverse = np.linalg.inv(flow.jacobian(flow.imbalance(self._gamma)[1]))

    def __call__(self, direction):
        """Derivatives of pressure (p,) Pa and shear (p,3) Pa, or None, for nodes moving along `direction` (s,3) m; a
        mirror-symmetric one on a symmetric wing.
        """
        stepped, size = moved(self._nodes, direction)
        at = self._wing.placed(stepped, self._wind, self._symmetric, field=self._field)
        flow = at.flow.with_viscosity(self._viscosity)
        gamma = self._gamma - 1j * (self._inverse @ flow.imbalance(self._gamma)[0].imag)
        _, (_, _, _, speed, alpha, _, _, outside) = flow.imbalance(gamma)
        circulation = Circulation(gamma, alpha, speed, outside, True, 0, 0.0, self._viscosity)
        loads = self._wing.loaded(replace(at, flow=flow), circulation)
        return tuple(None if a is None else a.imag / STEP * size for a in (loads.pressure, loads.shear))
