"""The panel method: exact flows around ellipsoids, wings with known lift and drag, time and memory over panels."""

import contextlib
import functools

import numpy as np

from aero.panel.bodies import Body
from aero.panel.collocation import collocation_points
from aero.panel.influence import PanelGeometry
from aero.panel.solver import TOLERANCE, PanelSolver
from aero.panel.velocities import Stencils, tangential

from .panel_models import PRESSURE, bent, box_wing, panel_model, rectangular, stream, wing_of
from .panel_references import ellipsoid_velocity, halved, sphere
from .registry import Case, Curve, Fit, Outcome

ELLIPSOIDS = {"sphere": (1.0, 1.0, 1.0), "ellipsoid 1 : 0.6 : 0.3": (1.0, 0.6, 0.3)}
STREAM = np.array([1.0, 0.3, -0.5]) / np.linalg.norm([1.0, 0.3, -0.5])
# Angle deg, area m^2, and the limits of C_L and C_Di by a prototype of this project, not published; the wings are those
# of the ram-air thesis, 4.1.1, and of Weber and Brebner (1958).
WINGS = {"box wing": (5.86, 24.0, 0.523, 0.0102), "swept wing": (4.2, 5.0, 0.262, 0.0048)}


@contextlib.contextmanager
def around_ellipsoid(series, divisions):
    """Solve and velocities; the answer is the error of these, root of the mean square over the area."""
    name, of = series.rsplit(", ", 1)
    axes = np.array(ELLIPSOIDS[name])
    nodes, panels = sphere(divisions)
    panels = halved(panels) if of == "triangles" else panels
    body = Body.of(nodes * axes, panels, np.zeros((0, 2), dtype=int))

    def work():
        g = PanelGeometry.of(nodes * axes, panels)
        found, _ = PanelSolver(body).solve(nodes * axes, STREAM, np.array([1.0, 0.0, 0.0]))
        stencils = Stencils.of(body, g.centre, g.normal)
        weights = stencils.weights(collocation_points(body, nodes * axes), g.normal, g.centre)
        velocity = tangential(STREAM - stencils.gradient(weights, found.doublets), stencils.normals(g.normal))
        on = g.centre / np.linalg.norm(g.centre / axes, axis=1)[:, None]
        off = velocity - ellipsoid_velocity(on, axes, STREAM)
        error = np.sqrt(g.area @ np.einsum("mc,mc->m", off, off) / g.area.sum())
        return Outcome(100.0 * error, {"panels": len(panels), "gmres_iterations": found.iterations})

    yield work


@contextlib.contextmanager
def around_wing(series, panels):
    """Solve, loads and Trefftz plane of one half from nothing; the answer is C_L."""
    if series == "box wing":
        surface = box_wing(panels // 8, panels, plate=panels // 20, corner=panels // 40)
    else:
        surface = rectangular(panels // 3, panels, 5.0, 0.25 * np.pi)
    angle, area, _, _ = WINGS[series]

    def work():
        model, values = panel_model(surface)
        out = model.solve(stream(surface.nodes, angle), values).outputs
        names = {"induced_drag": "CDi", "pressure_lift": "CL_pressure", "pressure_drag": "CD_pressure"}
        columns = {"panels": len(surface.panels), "strips": len(surface.trailing_edges)}
        columns["drag_misfit"] = 100.0 * float(out["drag_misfit"])
        columns |= {to: float(out[name]) / (PRESSURE * area) for name, to in names.items()}
        return Outcome(float(out["trefftz_lift"]) / (PRESSURE * area), columns | {"e": float(out["span_efficiency"])})

    yield work


@contextlib.contextmanager
def in_coupling(series, panels):
    """A step of the model as a coupling makes it; the answer is the residual of its equations."""
    surface = wing_of(panels)
    model, values = panel_model(surface)
    nodes, state = surface.nodes, None
    if series != "first step":
        state = model.solve(stream(nodes, 5.0), values).state
        nodes = bent(nodes, 0.02) if series == "the tips 2 cm up" else nodes

    def work():
        if series == "first step":
            model._solver = None
        found = model.solve(stream(nodes, 5.0 if nodes is not surface.nodes else 6.0), values, state).outputs
        columns = {"panels": len(surface.panels) // 2, "gmres_iterations": int(found["gmres_iterations"])}
        return Outcome(float(found["residual"]), columns)

    yield work


@functools.cache
def lift(series):
    """The limit of C_L of a wing."""
    return WINGS[series][2]


ENTRIES = (
    Case(
        name="panel.ellipsoid",
        title="Panel method: velocities on ellipsoids in a skew stream, over the mesh",
        knob="divisions of a side of the cube",
        values=(4, 8, 16, 24),
        quick=(4, 8),
        error="velocity error, rms",
        unit="% of the stream",
        reference="exact flow (Lamb 1932, section 114)",
        prepare=around_ellipsoid,
        truth=lambda series, n: 0.0,
        bound=2.0,
        finer="larger",
        series=tuple(f"{name}, {of}" for name in ELLIPSOIDS for of in ("quads", "triangles")),
        repeats=2,
        plot=Curve("panels", "error"),
        fit=Fit("value", "error", "error ~ divisions", least=8.0),
        labels={"panels": "panels", "gmres_iterations": "GMRES iterations"},
        note="A sphere made of a cube, stretched; 6 n² quads, or twice as many triangles. Whole bodies. The error is "
        "the root of its mean square over the area.",
    ),
    Case(
        name="panel.wings",
        title="Panel method: time, and lift and drag, of a box wing and a swept wing over panels",
        knob="panels round the profile",
        values=(40, 80, 120),
        quick=(40,),
        error="C_L",
        unit="%",
        reference="limits by a prototype: box wing C_L 0.523, C_Di 0.0102, e 1.42; swept wing C_L 0.262, C_Di 0.0048",
        prepare=around_wing,
        truth=lambda series, n: lift(series),
        distance=lambda answer, truth: 100.0 * abs(answer / truth - 1.0),
        bound=2.0,
        further=lambda answer, truth: {"CL": answer},
        series=tuple(WINGS),
        repeats=2,
        plot=Curve("panels", "time_s"),
        fit=Fit("panels", "time_s", "time ~ panels", least=2000.0),
        labels={
            "panels": "panels",
            "strips": "strips",
            "CDi": "C_Di, Trefftz",
            "CL_pressure": "C_L, pressure",
            "CD_pressure": "C_D, pressure",
            "drag_misfit": "pressure beside Trefftz, %",
            "e": "span efficiency",
            "CL": "C_L, Trefftz",
        },
        note="Box wing of the ram-air thesis, section 4.1.1, h/b 0.2, b 12 c, NACA 0012, 5.86 deg (its panel code: C_L "
        "0.509, 0.507, 0.500, C_D 0.01007, 0.01000, 0.0097 on three meshes); swept wing of Weber and Brebner (1958), "
        "45 deg, aspect ratio 5, NACA 0012, 4.2 deg (measured 0.238, 0.005; FLOWPanel 0.2244, 0.0121). Every solve "
        "begins from nothing, of one half. Meshes are refined alike in all directions.",
    ),
    Case(
        name="panel.steps",
        title="Panel method: time of a step of a coupled run, over the panels of one half",
        knob="panels of one half, about",
        values=(500, 1000, 2000, 4000, 8000),
        quick=(500, 1000),
        error="residual of the equations",
        unit="of that without doublets",
        reference="zero",
        prepare=in_coupling,
        truth=lambda series, n: 0.0,
        bound=TOLERANCE,
        series=("first step", "the tips 2 cm up", "the wind turned by 1 deg"),
        repeats=2,
        plot=Curve("panels", "time_s"),
        fit=Fit("panels", "time_s", "time ~ panels", least=1000.0),
        labels={"panels": "panels of one half", "gmres_iterations": "GMRES iterations"},
        note="Rectangular wing, aspect ratio 6, solved as one half. The first step computes influences and factors; "
        "one on a changed shape computes influences, with the old factors as preconditioner; one of a body that has "
        "moved rigidly, or in another wind, computes the influences of the wake alone.",
    ),
)  # fmt: skip
