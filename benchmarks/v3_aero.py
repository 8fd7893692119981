"""V3 kite, rigid, design chord: C_L and C_D against a peer, wind tunnel and RANS; time, strips, stall.

Figures of others come from data/v3_reference_3d.csv, whose last column names their source.
"""

import contextlib
import csv
import functools
import statistics
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import scenes

from .problems import published
from .registry import Case, Fit, Outcome, Table
from .text import lines, table

REFERENCE = Path(__file__).parent / "data" / "v3_reference_3d.csv"
AREA = 19.753  # m^2 projected, TUDELFT_V3_KITE properties
SPEED = 10.0  # m/s
ANGLE, NEAR = 7.0, 6.8  # deg: where time and strips are compared, and where a warm start comes from
TUNNEL_AND_RANS = ("tunnel", "5e5"), ("RANS", "1e6")
BELOW_STALL = 10.1  # deg
BAYS, FINEST = 9, 36  # struts' gaps; strips in each of them for the reference


@functools.cache
def others():
    """Rows alpha deg, C_L, C_D of others by (kind, Reynolds number)."""
    out = {}
    with REFERENCE.open(newline="") as file:
        for row in csv.DictReader(file):
            key = row["kind"], row["reynolds"]
            out.setdefault(key, []).append([float(row[c]) for c in ("alpha_deg", "CL", "CD")])
    return {key: np.array(rows) for key, rows in out.items()}


class Kite:
    """The rigid wing with `per_bay` strips between two struts."""

    def __init__(self, per_bay=4):
        settings = published("v3_kite", {"chord": "design", "panels_per_section": per_bay})
        scene = scenes.load("v3_kite", settings)
        self.nodes = scene.interface.nodes
        self.wing = scene.wing_model.wing
        corners = self.nodes[scene.interface.panels]
        area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        self.strip_area = np.abs(area[:, 2]).sum()
        self.strips = len(scene.interface.sections) - 1

    def solve(self, alpha, start=None, symmetric=True):
        """Lift and drag over q (m^2) at alpha (deg), and the circulation."""
        a = np.deg2rad(alpha)
        along = np.array([np.cos(a), 0.0, np.sin(a)])
        loads = self.wing.loads(self.nodes, SPEED * along, start, symmetric)
        force = loads.total_force() / (0.5 * self.wing.density * SPEED**2)
        return force @ np.array([-along[2], 0.0, along[0]]), force @ along, loads.circulation


@functools.cache
def kite(per_bay=4):
    """The wing, made once."""
    return Kite(per_bay)


@functools.cache
def finest(*_):
    """C_L and C_D on the finest strips."""
    return np.array(kite(FINEST).solve(ANGLE)[:2]) / AREA


@contextlib.contextmanager
def solve_of_strips(series, strips):
    """One solve: cold, or from the circulation a fifth of a degree away; whole wing or half."""
    wing = kite(strips // BAYS)
    start = wing.solve(NEAR)[2].gamma if "warm" in series else None

    def work():
        lift, drag, circulation = wing.solve(ANGLE, start, "half" in series)
        lift, drag = lift / AREA, drag / AREA
        columns = {
            "newton_iterations": circulation.newton_iterations,
            "unknowns": (strips + 1) // 2 if "half" in series else strips,
            "CL": lift,
            "CD": drag,
        }
        return Outcome(np.array([lift, drag]), columns, "converged" if circulation.converged else "not converged")

    yield work


STRIPS = Case(
    name="v3_aero.strips",
    title=f"V3 kite, rigid, design chord, {ANGLE:g}°: strips of the vortex-step method",
    knob="strips",
    values=tuple(BAYS * k for k in (1, 2, 4, 8, 12, 20)),
    quick=(9, 36, 72),
    error="error of C_L",
    unit="1",
    reference=f"finest level: {BAYS * FINEST} strips",
    prepare=solve_of_strips,
    truth=finest,
    distance=lambda answer, truth: float(abs(answer[0] - truth[0])),
    further=lambda answer, truth: {"error_CD": float(abs(answer[1] - truth[1]))},
    bound=1e-3,  # 180 strips; 72 leave 0.001 by the sweep of strips in tests/verification
    finer="larger",
    series=("cold, whole wing", "cold, half", "warm, whole wing", "warm, half"),
    quick_series=("cold, half",),
    repeats=15,
    fit=Fit("value", "error", "error ~ strips", least=36, floor=5e-4),
    labels={
        "newton_iterations": "Newton iterations", "unknowns": "unknowns", "CL": "C_L", "CD": "C_D",
        "error_CD": "error of C_D",
    },
    note=f"Coefficients on {AREA} m²; warm means started from the circulation at {NEAR:g}°. Off the order lie strips "
    "that are coarser than the design sections (9, 18) and those near the reference (180).",
)  # fmt: skip


def at(rows, alpha, column):
    """A figure of others at alpha: linear between their points, a dash outside."""
    inside = rows[0, 0] <= alpha <= rows[-1, 0]
    return f"{np.interp(alpha, rows[:, 0], rows[:, column]):.3f}" if inside else "–"


def coefficients(quick):
    """C_L and C_D every five degrees beside those of others, then how near we are to the peer."""
    wing, peers = kite(), {row[0]: row for row in others()["peer", "polars"]}
    names = ("α °", "C_L", "C_D", "C_L strips", "C_D strips", "peer", "tunnel", "RANS 1e6", "C_L peer/ours")
    rows, off = [], {"own": [], "projected": []}
    for alpha in (5, 10) if quick else range(-10, 31, 5):
        lift, drag, _ = wing.solve(alpha)
        ours = (f"{v:.4f}" for area in (AREA, wing.strip_area) for v in (lift / area, drag / area))
        peer = peers.get(alpha)
        pair = "–" if peer is None else f"{peer[1]:.3f} / {peer[2]:.3f}"
        ratio = "–" if peer is None else f"{peer[1] * AREA / lift:.4f}"
        read = (f"{at(others()[k], alpha, 1)} / {at(others()[k], alpha, 2)}" for k in TUNNEL_AND_RANS)
        rows.append([str(alpha), *ours, pair, *read, ratio])
        if alpha in (5, 10):
            for key, area in (("own", wing.strip_area), ("projected", AREA)):
                off[key].append(np.abs(np.array([lift, drag]) / area - peer[1:]))
    worst = {key: np.max(values, axis=0) for key, values in off.items()}
    own, projected = worst["own"], worst["projected"]
    return lines(
        table(names, rows),
        f"Largest distance to the peer at 5 and 10 degrees: {own[0]:.4f} in C_L and {own[1]:.4f} in C_D on the strips' "
        f"own projected area, {wing.strip_area:.3f} m²; {projected[0]:.4f} and {projected[1]:.4f} on {AREA} m². The "
        f"ratio of the areas is {AREA / wing.strip_area:.4f}.",
    )


def _points(key):
    rows = others()[key]
    return rows[(rows[:, 0] >= 0.0) & (rows[:, 0] <= BELOW_STALL)]


def errors(quick):
    """Mean absolute error against tunnel and RANS on both areas, and that of RANS against the tunnel."""
    wing, rows = kite(), []
    for key in TUNNEL_AND_RANS if quick else (*TUNNEL_AND_RANS, ("RANS", "3e6")):
        points = _points(key)
        for area in (AREA, wing.strip_area):
            plain, turned = (np.array([wing.solve(a + d)[:2] for a in points[:, 0]]) / area for d in (0.0, 0.75))
            off = plain - points[:, 1:]
            lift, drag = np.abs(off).mean(axis=0)
            shifted = np.abs(turned - points[:, 1:])[:, 0].mean()
            rows.append([" ".join(key), area, *(f"{v:.4f}" for v in (lift, drag, off[:, 0].mean(), shifted))])
    tunnel, rans = _points(("tunnel", "5e5")), others()["RANS", "1e6"]
    off = np.array([np.interp(tunnel[:, 0], rans[:, 0], rans[:, k]) for k in (1, 2)]).T - tunnel[:, 1:]
    lift, drag = np.abs(off).mean(axis=0)
    angles = ", ".join(f"{a:g}" for a in tunnel[:, 0])
    return lines(
        table(("against", "area m²", "C_L", "C_D", "signed C_L", "C_L with α + 0.75°"), rows),
        f"RANS 1e6 against the tunnel, same points: {lift:.4f} / {drag:.4f}. The tunnel's points are {angles} degrees.",
    )


def stall(quick):
    """Sweeps through stall: time, iterations, and what a warm start changes."""
    wing, rows = kite(), []
    up = np.arange(-10.0, 30.01, 2.5 if quick else 0.25)
    for name, angles, warm in (("cold", up, False), ("warm up", up, True), ("warm down", up[::-1], True)):
        start, took, lift, found = None, [], {}, []
        for alpha in angles:
            begin = time.perf_counter()
            lift[alpha], _, circulation = wing.solve(alpha, start, symmetric=False)
            took.append(1e3 * (time.perf_counter() - begin))
            found.append(circulation)
            start = circulation.gamma if warm else None
        stalled = (f"{lift[a] / AREA:.3f}" for a in (15.0, 20.0, 25.0))
        rows.append(
            [
                name, f"{statistics.median(took):.2f}", f"{np.percentile(took, 95):.2f}", f"{max(took):.2f}",
                str(max(c.newton_iterations for c in found)), str(sum(not c.converged for c in found)),
                str(sum(c.viscosity > 0.0 for c in found)), ", ".join(stalled),
            ]
        )  # fmt: skip
    names = ("sweep", "median ms", "95 % ms", "max ms", "most iterations", "not converged", "viscous")
    return lines(table((*names, "C_L 15°, 20°, 25°"), rows))


def direction(quick):
    """The section lift normal to the flow at the bound vortex instead of the three-quarter chord."""
    wing = Kite()
    rows = []
    for flow in ("control", "bound"):
        wing.wing = replace(wing.wing, direction=flow)
        found = [wing.solve(alpha)[:2] for alpha in (5, 10)]
        rows.append([flow, *(f"{lift / AREA:.4f} / {drag / AREA:.4f}" for lift, drag in found)])
    return lines(table(("direction", "C_L / C_D at 5°", "C_L / C_D at 10°"), rows))


ENTRIES = (
    STRIPS,
    Table("v3_aero.coefficients", "Coefficients of the rigid kite, 36 strips, against others", coefficients),
    Table("v3_aero.errors", f"Mean absolute error over the points from 0 to {BELOW_STALL:g}°", errors),
    Table("v3_aero.stall", "Sweeps from -10 to 30° by 0.25°", stall),
    Table("v3_aero.direction", f"Flow that the section lift is normal to; area {AREA} m²", direction),
)
