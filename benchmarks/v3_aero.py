"""V3 kite, rigid, design chord: C_L and C_D against a peer, wind tunnel and RANS; time, strips, stall; markdown tables.

Run as `python benchmarks/v3_aero.py`, best with OMP_NUM_THREADS=1: the matrices are small. Figures of others come from
data/v3_reference_3d.csv, whose last column names their source.
"""

import csv
import statistics
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import scenes

REFERENCE = Path(__file__).parent / "data" / "v3_reference_3d.csv"
AREA = 19.753  # m^2 projected, TUDELFT_V3_KITE properties
SPEED = 10.0  # m/s


def reference():
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
        scene = scenes.load("v3_kite", {"chord": "design", "panels_per_section": per_bay})
        self.nodes = scene.interface.nodes
        self.wing = scene.aero_core()._wing
        corners = self.nodes[scene.interface.panels]
        area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        self.strip_area = np.abs(area[:, 2]).sum()
        self.strips = len(scene.interface.sections) - 1

    def solve(self, alpha, start=None, symmetric=True):
        """Lift and drag over q (m^2) at alpha (deg), the circulation, and the time in ms."""
        a = np.deg2rad(alpha)
        along = np.array([np.cos(a), 0.0, np.sin(a)])
        began = time.perf_counter()
        loads = self.wing.loads(self.nodes, SPEED * along, start, symmetric)
        took = 1e3 * (time.perf_counter() - began)
        force = loads.total_force() / (0.5 * self.wing.density * SPEED**2)
        return force @ np.array([-along[2], 0.0, along[0]]), force @ along, loads.circulation, took


def print_row(*cells):
    print("| " + " | ".join(c if isinstance(c, str) else f"{c:.4g}" for c in cells) + " |")


def header(title, *names):
    print(f"\n### {title}\n")
    print_row(*names)
    print("|" + "---|" * len(names))


def at(rows, alpha, column):
    """A figure of others at alpha: linear between their points, a dash outside."""
    inside = rows[0, 0] <= alpha <= rows[-1, 0]
    return f"{np.interp(alpha, rows[:, 0], rows[:, column]):.3f}" if inside else "–"


def coefficients(kite, others):
    names = ("C_L", "C_D", "C_L strips", "C_D strips", "peer", "tunnel", "RANS 1e6", "C_L peer/ours")
    header(f"{kite.strips} strips; areas {AREA} m² and the strips' own {kite.strip_area:.3f} m²", "α °", *names)
    peers = {row[0]: row for row in others["peer", "polars"]}
    for alpha in range(-10, 31, 5):
        lift, drag, _, _ = kite.solve(alpha)
        ours = (f"{v:.4f}" for area in (AREA, kite.strip_area) for v in (lift / area, drag / area))
        peer = peers.get(alpha)
        pair = "–" if peer is None else f"{peer[1]:.3f} / {peer[2]:.3f}"
        ratio = "–" if peer is None else f"{peer[1] * AREA / lift:.4f}"
        read = (f"{at(others[k], alpha, 1)} / {at(others[k], alpha, 2)}" for k in (("tunnel", "5e5"), ("RANS", "1e6")))
        print_row(str(alpha), *ours, pair, *read, ratio)
    print(f"\n{AREA} / {kite.strip_area:.3f} = {AREA / kite.strip_area:.4f}.")


def errors(kite, others):
    names = ("against", "area m²", "C_L", "C_D", "signed C_L", "C_L with α + 0.75°")
    header("Mean absolute error, points from 0 to 10.1°", *names)
    for key in (("tunnel", "5e5"), ("RANS", "1e6"), ("RANS", "3e6")):
        rows = others[key]
        rows = rows[(rows[:, 0] >= 0.0) & (rows[:, 0] <= 10.1)]
        for area in (AREA, kite.strip_area):
            plain, turned = (np.array([kite.solve(a + d)[:2] for a in rows[:, 0]]) / area for d in (0.0, 0.75))
            off = plain - rows[:, 1:]
            lift, drag = np.abs(off).mean(axis=0)
            print_row(" ".join(key), area, lift, drag, off[:, 0].mean(), np.abs(turned - rows[:, 1:])[:, 0].mean())
    tunnel, rans = others["tunnel", "5e5"], others["RANS", "1e6"]
    rows = tunnel[(tunnel[:, 0] >= 0.0) & (tunnel[:, 0] <= 10.1)]
    off = np.array([np.interp(rows[:, 0], rans[:, 0], rans[:, k]) for k in (1, 2)]).T - rows[:, 1:]
    lift, drag = np.abs(off).mean(axis=0)
    print(f"\nRANS 1e6 against the tunnel, same points: {lift:.4f} / {drag:.4f}.")


def times(repeats=30):
    names = ("strips", "C_L", "C_D", "cold ms", "cold half ms", "warm ms", "warm half ms")
    header("Time and strips at 7°, medians", *names)
    for per_bay in (1, 2, 4, 8, 12):
        kite = Kite(per_bay)
        lift, drag, circulation, _ = kite.solve(7.0)
        near = kite.solve(6.8)[2].gamma  # warm: from a fifth of a degree away
        took = [
            statistics.median(kite.solve(7.0, start, half)[3] for _ in range(repeats))
            for start in (None, near)
            for half in (False, True)
        ]
        assert circulation.converged
        print_row(str(kite.strips), f"{lift / AREA:.4f}", f"{drag / AREA:.4f}", *took)


def stall(kite):
    names = (
        "sweep",
        "median ms",
        "95 % ms",
        "max ms",
        "most iterations",
        "not converged",
        "viscous",
        "C_L 15°, 20°, 25°",
    )
    header("Sweeps from -10 to 30° by 0.25°, whole wing", *names)
    up = np.arange(-10.0, 30.01, 0.25)
    for label, angles, warm in (("cold", up, False), ("warm up", up, True), ("warm down", up[::-1], True)):
        start, solved = None, {}
        for alpha in angles:
            solved[alpha] = kite.solve(alpha, start, symmetric=False)
            start = solved[alpha][2].gamma if warm else None
        took = [s[3] for s in solved.values()]
        found = [s[2] for s in solved.values()]
        print_row(
            label,
            *(float(f(took)) for f in (np.median, lambda t: np.percentile(t, 95), max)),
            str(max(c.newton_iterations for c in found)),
            str(sum(not c.converged for c in found)),
            str(sum(c.viscosity > 0.0 for c in found)),
            ", ".join(f"{solved[a][0] / AREA:.3f}" for a in (15.0, 20.0, 25.0)),
        )


def direction_line():
    """Drag with the section lift normal to the flow at the bound vortex instead of the three-quarter chord."""
    kite = Kite()
    kite.wing = replace(kite.wing, direction="bound")
    cells = [
        f"{lift / AREA:.4f} / {drag / AREA:.4f} at {a} degrees" for a in (5, 10) for lift, drag, *_ in [kite.solve(a)]
    ]
    print(f'\nWith direction = "bound", area {AREA} m2: C_L / C_D {", ".join(cells)}.')


def main():
    others, kite = reference(), Kite()
    kite.solve(5.0)  # first call: imports and caches
    coefficients(kite, others)
    errors(kite, others)
    times()
    stall(kite)
    direction_line()


if __name__ == "__main__":
    main()
