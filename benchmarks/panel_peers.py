"""Peers of the panel method, from the same shapes: pyapm on the same panels, vortex lattices on the same strips.

They are loaded when they are first used, where they are installed: pip install -c constraints.txt -e '.[peers]'
"""

import functools
import gc
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata

import numpy as np

from aero.panel.bodies import Body
from aero.panel.trefftz import far_wake
from aero.vortex_step import StripPolars, SurfaceGrid, VortexStep
from scenes.builders.profiles import naca
from scenes.builders.wings import Planform, mirrored_wing, span_shares

from .panel_models import DENSITY, PRESSURE, SPEED, box_wing, panel_model, rectangular, stream
from .registry import Table
from .text import lines, table

INSTALL = "pip install -c constraints.txt -e '.[peers]'"
ROUNDS = 3
PATIENCE = 1.5  # s; no further round of what has taken this long
LATTICE = 4  # panels round the profile for one along the chord of a lattice
JOUKOWSKY = 2.0 * np.pi * (1.0 + 4.0 / np.sqrt(27.0) * 0.12)  # lift slope of a Joukowsky profile of 12 %


def installed(package):
    """Version of a package, None where it is not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def missing(packages):
    """A sentence about those of the packages that are not installed, empty where all are."""
    gone = [p for p in packages if installed(p) is None]
    if not gone:
        return ""
    verb, them = ("is", "it") if len(gone) == 1 else ("are", "them")
    names = ", ".join(gone[:-1]) + (" and " if gone[:-1] else "") + gone[-1]
    return f"{names} {verb} not installed; `{INSTALL}` brings {them}."


@dataclass(frozen=True, eq=False)
class Shape:
    """A closed wing at an angle deg: `surface(strips, panels)` of each half, `area` and `span` of its coefficients, and
    `limit()`, C_L and C_Di of inviscid flow (nan where there is no figure), from the `source`; `meshes`, strips and
    panels. `ring`: a wing without ends.
    """

    name: str
    angle: float
    area: float
    span: float
    surface: Callable
    limit: Callable
    source: str
    meshes: tuple
    slope: float = JOUKOWSKY
    ring: bool = False

    @property
    def along(self):
        """Unit vector (3,) of the wind."""
        a = np.deg2rad(self.angle)
        return np.array([np.cos(a), 0.0, np.sin(a)])

    def coefficients(self, force):
        """C_L and C_D of a force (3,) N."""
        up = np.array([-self.along[2], 0.0, self.along[0]])
        return np.array([force @ up, force @ self.along]) / (PRESSURE * self.area)

    def edges(self, surface, panels):
        """Leading and trailing edges (k,3) m of the sections of a surface with `panels` round the profile, tip to tip,
        or round the ring.
        """
        rows = surface.sections
        if rows is None:
            rows = np.arange(len(surface.nodes)).reshape(-1, panels)
            rows = np.concatenate([rows, rows[:1]])
        return surface.nodes[rows[:, panels // 2]], surface.nodes[rows[:, 0]]


def in_trefftz_plane(shape, surface, trailing, jumps):
    """C_L and C_Di of the `jumps` (t,) m^2/s that leave at `trailing` (t,4)."""
    far = far_wake(surface.nodes, trailing[:, 2:], jumps, shape.along, SPEED, DENSITY)
    return np.array([shape.coefficients(far.lift)[0], far.induced_drag / (PRESSURE * shape.area)])


def own_panels(symmetric, shape, surface, panels):
    """Unknowns, C_L and C_Di in the Trefftz plane and C_L by pressure of the panel method."""
    model, values = panel_model(surface)
    values["symmetric"] = np.asarray(float(symmetric))
    out = model.solve(stream(surface.nodes, shape.angle), values).outputs
    lift, drag, pressure = (float(out[n]) for n in ("trefftz_lift", "induced_drag", "pressure_lift"))
    found = np.array([lift, drag, pressure]) / (PRESSURE * shape.area)
    return len(surface.panels) // (2 if symmetric else 1), *found


def own_strips(shape, surface, panels):
    """Unknowns, C_L, C_Di and no other C_L of the vortex-step method with inviscid section polars."""
    leading, trailing = shape.edges(surface, panels)
    share = np.array([0.0, 0.5, 1.0])[:, None]
    nodes = (leading[:, None] + share * (trailing - leading)[:, None]).reshape(-1, 3)
    alpha, strips = np.deg2rad([-20.0, 20.0]), len(leading) - 1
    none = np.zeros((1, 2))
    polars = StripPolars.from_tables(alpha, [shape.slope * alpha], none, none, [0.0], np.zeros(strips))
    wing = VortexStep(polars, SurfaceGrid(np.arange(len(nodes)).reshape(-1, 3), share[:, 0]), density=DENSITY)
    loads = wing.loads(nodes, SPEED * shape.along)
    return strips, *shape.coefficients(loads.total_force()), np.nan


def pyapm(shape, surface, panels):
    """Unknowns, C_L and C_Di in the Trefftz plane and C_L by pressure of pyapm's panel method, on the same panels.

    It takes the velocity along the surface from all neighbours of a panel, also across a sharp trailing edge; so the
    two sides have nodes of their own there, in the same places. The Trefftz plane is ours, with its circulations.
    """
    from pyapm.classes import PanelResult, PanelSystem
    from pyapm.classes.grid import Grid
    from pyapm.classes.panel import Panel
    from pygeom.geom3d import Vector

    trailing = Body.of(surface.nodes, surface.panels, surface.trailing_edges).trailing
    edge, count = np.unique(trailing[:, 2:], return_counts=True)
    inner = edge[count > 1]
    twin = np.arange(len(surface.nodes))
    twin[inner] = len(surface.nodes) + np.arange(len(inner))
    corners = surface.panels.copy()
    corners[trailing[:, 1]] = twin[corners[trailing[:, 1]]]
    nodes = np.concatenate([surface.nodes, surface.nodes[inner]])
    sharp = np.isin(np.arange(len(nodes)), edge) | (np.arange(len(nodes)) >= len(surface.nodes))
    grids = {i: Grid(i, *map(float, p), bool(s)) for i, (p, s) in enumerate(zip(nodes, sharp, strict=True))}
    faces = {i: Panel(i, [grids[n] for n in dict.fromkeys(row)]) for i, row in enumerate(corners.tolist())}
    system = PanelSystem(shape.name, shape.span, 1.0, shape.area, Vector(0.0, 0.0, 0.0))
    system.set_mesh(grids, faces)
    system.set_horseshoes(Vector(*shape.along))
    result = PanelResult(shape.name, system)
    result.set_density(DENSITY)
    result.set_state(alpha=shape.angle, speed=SPEED)
    doublets = np.asarray(result.mu)
    jumps = doublets[trailing[:, 0]] - doublets[trailing[:, 1]]
    found = in_trefftz_plane(shape, surface, trailing, jumps)
    return len(faces), *found, float(result.nfres.CL)


def aerosandbox(shape, surface, panels):
    """Unknowns, C_L and C_Di of AeroSandbox's vortex lattice."""
    import aerosandbox as asb

    leading, trailing = shape.edges(surface, panels)
    flat = asb.Airfoil("naca0012")  # its camber line is the chord
    chord = np.linalg.norm(trailing - leading, axis=1)
    sections = [asb.WingXSec(xyz_le=p, chord=c, airfoil=flat) for p, c in zip(leading, chord, strict=True)]
    plane = asb.Airplane(wings=[asb.Wing(xsecs=sections)], s_ref=shape.area, c_ref=1.0, b_ref=shape.span)
    flow = asb.OperatingPoint(velocity=SPEED, alpha=shape.angle)
    along = panels // LATTICE
    options = {"spanwise_resolution": 1, "chordwise_resolution": along, "align_trailing_vortices_with_wind": True}
    found = asb.VortexLatticeMethod(plane, flow, xyz_ref=[0.0, 0.0, 0.0], **options).run()
    return along * (len(sections) - 1), float(found["CL"]), float(found["CD"]), np.nan


def openaerostruct(shape, surface, panels):
    """Unknowns, C_L and C_Di of OpenAeroStruct's vortex lattice, one half with its image.

    A ring is solved whole: which half a mesh is, OpenAeroStruct reads from its first section.
    """
    import openmdao.api as om
    from openaerostruct.aerodynamics.aero_groups import AeroPoint

    leading, trailing = shape.edges(surface, panels)
    half = np.arange(len(leading) if shape.ring else len(leading) // 2 + 1)
    along = panels // LATTICE
    share = 0.5 - 0.5 * np.cos(np.pi * np.arange(along + 1) / along)
    mesh = leading[half] + share[:, None, None] * (trailing - leading)[half]
    given = {
        "name": "wing", "symmetry": not shape.ring, "S_ref_type": "wetted", "mesh": mesh, "CL0": 0.0, "CD0": 0.0,
        "k_lam": 0.05, "c_max_t": 0.3, "with_viscous": False, "with_wave": False,
    }  # fmt: skip
    problem = om.Problem(reports=False)
    values = om.IndepVarComp()
    flow = {"v": (SPEED, "m/s"), "alpha": (shape.angle, "deg"), "Mach_number": (0.0, None), "re": (1e6, "1/m")}
    flow |= {"rho": (DENSITY, "kg/m**3"), "cg": (np.zeros(3), "m"), "S_ref_total": (shape.area, "m**2")}
    form = {"mesh": (mesh, "m"), "t_over_c": (np.full((1, len(half) - 1), 0.12), None)}
    for name, (value, unit) in (flow | form).items():
        values.add_output(name, val=value, units=unit)
    problem.model.add_subsystem("values", values, promotes=["*"])
    point = AeroPoint(surfaces=[given], user_specified_Sref=True)
    problem.model.add_subsystem("point", point, promotes_inputs=list(flow))
    problem.model.connect("mesh", "point.wing.def_mesh")
    problem.model.connect("mesh", "point.aero_states.wing_def_mesh")
    problem.model.connect("t_over_c", "point.wing_perf.t_over_c")
    problem.setup()
    problem.run_model()
    lift, drag = (float(problem[f"point.{name}"][0]) for name in ("CL", "CD"))
    return along * (len(half) - 1), lift, drag, np.nan


MANY = 100_000
# Name -> package, its solve, and the panels of the largest mesh that it is given: pyapm keeps some twenty arrays of a
# number for each panel and each triangle.
METHODS = {
    "panel method, half": (None, functools.partial(own_panels, True), MANY),
    "panel method, whole": (None, functools.partial(own_panels, False), MANY),
    "pyapm panel method": ("pyapm", pyapm, 900),
    "vortex-step method": (None, own_strips, MANY),
    "AeroSandbox lattice": ("AeroSandbox", aerosandbox, MANY),
    "OpenAeroStruct lattice": ("openaerostruct", openaerostruct, MANY),
}
PEERS = tuple(package for package, _, _ in METHODS.values() if package)


@functools.cache
def rectangular_limit():
    """C_L and C_Di of the rectangular wing from our own meshes, extrapolated in 1 / strips.

    Strips of constant jumps end where the wing ends, which leaves an error of the first order in their width.
    """
    found = [own_panels(True, RECTANGULAR, rectangular(n, 5 * n), 5 * n)[1:3] for n in (16, 24)]
    coarse, fine = np.array(found)
    return fine + (fine - coarse) / (24 / 16 - 1.0)


def circular(strips, panels):
    """A circular wing of 1 m diameter, 1 % thick, its tips cut where the chord is 8 cm."""
    form = Planform(1.0, 1.0, 0.08, axis=0.5, chords="elliptic")
    return mirrored_wing(form.stations(span_shares(strips, "cosine")).sections(naca("0001").points(panels)))


RECTANGULAR = Shape(
    "rectangular, A = 6, 5°", 5.0, 6.0, 6.0, rectangular, rectangular_limit,
    "our own meshes of 24 and 16 strips, extrapolated", ((6, 24), (10, 40), (20, 80)),
)  # fmt: skip
SHAPES = (
    RECTANGULAR,
    Shape(
        "swept 45°, A = 5, 4.2°", 4.2, 5.0, 5.0, functools.partial(rectangular, span=5.0, sweep=0.25 * np.pi),
        lambda: np.array([0.262, 0.0048]), "inviscid limit of another panel code", ((6, 24), (10, 40), (20, 80)),
    ),
    Shape(
        "box wing, 5.86°", 5.86, 24.0, 12.0, box_wing, lambda: np.array([0.523, 0.0102]),
        "inviscid limit of another panel code", ((4, 24), (6, 32), (12, 78)), ring=True,
    ),
    Shape(
        "circular, 1 % thick, 2°", 2.0, 0.25 * np.pi, 1.0, circular,
        lambda: np.array([1.790 * np.deg2rad(2.0), np.nan]), "Jordan (1973)", ((6, 24), (10, 40), (20, 80)),
        slope=2.0 * np.pi,
    ),
)  # fmt: skip


def timed(solves, rounds):
    """(what each solve found, the median of its times s): all in turn, round after round; the first warms up."""
    found, times = {}, {key: [] for key in solves}
    for turn in range(rounds + 1):
        for key, solve in solves.items():
            if turn > 0 and sum(times[key]) > PATIENCE:
                continue
            gc.collect()
            begin = time.perf_counter()
            found[key] = solve()
            seconds = time.perf_counter() - begin
            if turn > 0 or rounds == 0 or seconds > PATIENCE:
                times[key].append(seconds)
    return found, {key: statistics.median(values) for key, values in times.items()}


def percent(value, limit):
    """How far a value is off its limit, as text in %; a dash where there is none."""
    return "–" if np.isnan(value) or np.isnan(limit) else f"{100.0 * (value / limit - 1.0):+.1f}"


def rows_of(shape, quick):
    """Rows of one shape: every method that is here, on its meshes, with times over that of ours on the same mesh."""
    meshes = shape.meshes[:1] if quick else shape.meshes
    here = {name: m for name, m in METHODS.items() if m[0] is None or installed(m[0]) is not None}
    surfaces = {mesh: shape.surface(*mesh) for mesh in meshes}
    solves = {
        (name, mesh): functools.partial(solve, shape, surfaces[mesh], mesh[1])
        for name, (_, solve, most) in here.items()
        for mesh in meshes
        if len(surfaces[mesh].panels) <= most
    }
    found, seconds = timed(solves, 0 if quick else ROUNDS)
    limit = shape.limit()
    rows = []
    for (name, mesh), (unknowns, lift, drag, pressure) in found.items():
        own = seconds["panel method, half", mesh]
        took = seconds[name, mesh]
        cells = [f"{lift:.4f}", percent(lift, limit[0]), f"{drag:.5f}", percent(drag, limit[1])]
        cells.append(percent(pressure, limit[0]))
        rows.append([shape.name, name, f"{mesh[0]} × {mesh[1]}", str(unknowns), *cells, 1e3 * took, took / own])
    return rows


def peers(quick):
    """Markdown: error against time of the panel method and of its peers."""
    names = ("wing", "method", "strips × panels", "unknowns", "C_L", "% off", "C_Di", "% off", "C_L by pressure, % off")
    rows = [row for shape in SHAPES[: 1 if quick else None] for row in rows_of(shape, quick)]
    shown = SHAPES[: 1 if quick else None]
    limits = [f"{s.name}: " + ", ".join(f"{v:.4g}" for v in s.limit() if v == v) + f" ({s.source})" for s in shown]
    versions = [f"{p} {installed(p)}" for p in PEERS if installed(p)]
    return lines(
        table((*names, "time, ms", "time / ours, half"), rows),
        "Limits of C_L and C_Di: " + "; ".join(limits) + ".",
        "Strips of each half × panels round the profile (for a lattice four times those along the chord). Time: from "
        "the nodes to coefficients, all that a program makes of them included; medians of one run. Lattices and strips "
        "have no thickness: their own limit of the box wing is C_L 0.490, e 1.438. The vortex-step method has "
        f"section polars c_l = {JOUKOWSKY / np.pi / 2.0:.3f} · 2π α, of a Joukowsky profile of 12 %; C_Di of "
        "the lattices is that of their forces, of the panel methods that in the Trefftz plane.",
        f"With {', '.join(versions)}." if versions else "",
        missing(PEERS),
    )


ENTRIES = (Table("panel.peers", "The panel method beside its peers: error against time", peers),)
