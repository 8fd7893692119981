"""V3 kite coupled: schemes against wind, critical relaxation, stability, strips, folding tips, ranges, line drag."""

import functools

import numpy as np
from scipy.optimize import brentq

import scenes
from master.coupling import SCHEMES, coupled_run, solve
from master.coupling.acceleration import Aitken, ConstantRelaxation
from master.coupling.spectrum import critical_relaxation, dominant_eigenvalue

from .problems import has_setting, in_process, published
from .registry import Table
from .text import lines, table

SPEEDS = (8.0, 12.0, 20.0)  # m/s
STRIP_SPEEDS = (8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0)  # m/s
RAISED = {  # strips a bay -> winds m/s, to beyond the end of the branch with tips up
    4: (20.0, 21.0, 22.0, 22.4, 22.5, 22.58, 22.7),
    8: (20.0, 21.0, 22.0, 22.5, 23.0, 23.1, 23.16, 23.3),
}
LOWERED = (24.0, 22.0, 20.0, 18.0, 16.0, 15.0)  # m/s
FLIGHT = ("iterations", "status", "alpha deg", "C_L", "tip span m", "pull N")
TIPS = ("alpha tip strip deg", "without lift at deg", "circulation, tip bay / middle")
CELLS = ("iterations", "status", "residual_N", "alpha deg", "tip span m", "support force N", "slack lines", "ms")


def kite(settings=None, **parameters):
    """The coupled V3 kite at its trim start, with the settings of published figures."""
    return in_process("v3_kite", published("v3_kite", settings), **parameters)


def speeds(quick):
    """All wind speeds, or one."""
    return SPEEDS[1:2] if quick else SPEEDS


@functools.cache
def factor_of_speed(speed):
    """Dominant eigenvalue of G' at the symmetric equilibrium, critical relaxation 2 / (1 - lambda), whether settled."""
    coupling = kite(wind_speed=speed)
    start = coupling.structural.get("displacement")
    x = solve(coupling, SCHEMES["iqn-ils"](), atol=1e-8).displacement
    coupling.set_tolerance(1e-8)
    found = dominant_eigenvalue(coupling, x, step=1e-4, start=np.sign(x - start) * np.sqrt(np.abs(x - start)))
    return found.value, critical_relaxation(found.value), found.settled


def cells(result, coupling):
    """`CELLS` of a coupled solve."""
    aero, structural = coupling.aero, coupling.structural
    force = np.linalg.norm(structural.get("support_force"))
    return [
        str(result.iterations),
        result.status,
        f"{result.residual_N:.1e}",
        f"{np.rad2deg(float(aero.get('alpha_mid'))):.3f}",
        f"{float(aero.get('tip_span')):.4f}",
        f"{force:.2f}",
        str(int(structural.get("slack_lines"))),
        f"{1e3 * result.seconds['total']:.0f}",
    ]


def schemes(quick):
    """Every scheme at every wind speed from the trim start."""
    rows = []
    for speed in speeds(quick):
        value, critical, settled = factor_of_speed(speed)
        tried = {
            "explicit": ConstantRelaxation(1.0),
            f"relaxation 0.97 x {critical:.4f}": ConstantRelaxation(0.97 * critical),
            f"relaxation 1.03 x {critical:.4f}": ConstantRelaxation(1.03 * critical),
            "Aitken": Aitken(0.5),
            "IQN-ILS": SCHEMES["iqn-ils"](),
        }
        for name, scheme in tried.items():
            coupling = kite(wind_speed=speed)
            rows.append([f"{speed:g}", name, *cells(solve(coupling, scheme, max_iterations=1000), coupling)])
        settled_or_not = "" if settled else " (not settled)"
        rows.append([f"{speed:g}", f"dominant eigenvalue {value:.4f}{settled_or_not}", *[""] * len(CELLS)])
    return lines(table(("wind m/s", "scheme", *CELLS), rows))


def stability(quick):
    """With and without symmetry and gravity: the rightmost eigenvalue of G'."""
    rows = []
    for speed in speeds(quick):
        for symmetric, gravity in ((1.0, 9.81), (0.0, 9.81), (0.0, 0.0)):
            run = coupled_run(kite(wind_speed=speed, symmetric=symmetric, gravity=gravity), SCHEMES["iqn-ils"]())
            s = run.stability
            told = [""] * 3 if s is None else [f"{s.eigenvalue:.4f}", str(s.statically_stable), str(s.evaluations)]
            rows.append([f"{speed:g}", str(bool(symmetric)), f"{gravity:g}", run.status, *told])
    names = ("wind m/s", "symmetric", "gravity", "status", "rightmost eigenvalue", "statically stable", "evaluations")
    return lines(table(names, rows))


def strips(quick):
    """Strips a bay over wind, as the scene ships otherwise."""
    rows = []
    for speed in (12.0,) if quick else STRIP_SPEEDS:
        for per_bay in (1, 4) if quick else (1, 2, 4, 8):
            coupling = in_process("v3_kite", {"panels_per_section": per_bay}, wind_speed=speed)
            result = solve(coupling, SCHEMES["iqn-ils"]())
            rows.append([f"{speed:g}", str(per_bay), *flight(result, coupling), *tips(coupling.aero, per_bay)])
    return lines(
        table(("wind m/s", "strips a bay", *FLIGHT, *TIPS), rows),
        "With line drag, from the automatic trim start. The tip strip is the outermost one; its α is the effective "
        "one, beside the angle at which its polar has no lift. Circulation of the tip bay: mean over its strips, over "
        "that at mid-span.",
    )


def flight(result, coupling):
    """`FLIGHT` of a coupled solve."""
    aero, structural = coupling.aero, coupling.structural
    return [
        str(result.iterations),
        result.status,
        f"{np.rad2deg(float(aero.get('alpha_mid'))):.2f}",
        f"{float(aero.get('CL')):.3f}",
        f"{float(aero.get('tip_span')):.3f}",
        f"{np.linalg.norm(structural.get('support_force')):.0f}",
    ]


def tips(aero, per_bay):
    """`TIPS` of a flow."""
    polars = scenes.load("v3_kite", {"panels_per_section": per_bay}).strip_polars()

    def lift(angle):
        return float(polars.lift(np.full(9 * per_bay, angle))[0][0])

    none = brentq(lift, *np.deg2rad((-6.0, 4.0)))
    gamma = aero.get("circulation")
    ratio = gamma[:per_bay].mean() / gamma[gamma.size // 2]
    return [f"{np.rad2deg(aero.get('alpha')[0]):.2f}", f"{np.rad2deg(none):.2f}", f"{ratio:.3f}"]


def ramp(quick):
    """Wind raised until the tips fold, and lowered from where they are folded, each solve from the one before."""
    rows = []
    for per_bay, raised in list(RAISED.items())[:1] if quick else RAISED.items():
        for winds in (raised[:2],) if quick else (raised, LOWERED):
            coupling = in_process("v3_kite", {"panels_per_section": per_bay}, wind_speed=winds[0])
            for wind in winds:
                coupling.aero.set("wind_speed", wind)
                run = coupled_run(coupling, SCHEMES["iqn-ils"](), max_iterations=120)
                eigenvalue = f"{run.stability.eigenvalue:.2f}" if run.stability else ""
                told = flight(run.result, coupling)
                rows.append([f"{per_bay}", f"{wind:g}", *told, *tips(coupling.aero, per_bay), eigenvalue])
    return lines(
        table(("strips a bay", "wind m/s", *FLIGHT, *TIPS, "rightmost eigenvalue"), rows),
        "With line drag; the first of each row of winds is solved from the automatic trim start. Where the rightmost "
        "eigenvalue of the coupled map comes to 1, the branch ends.",
    )


def choices(quick):
    """Influence of chord and line modulus, with few and many strips."""
    tried = (
        *(("structural", k, 0.55e9) for k in (1, 4, 12)),
        *(("structural", k, 100e9) for k in (1, 4)),
        *(("design", k, 0.55e9) for k in (1, 4)),
    )
    rows = []
    for speed in (12.0,) if quick else (12.0, 20.0):
        for chord, per_bay, modulus in tried[:2] if quick else tried:
            coupling = kite({"chord": chord, "panels_per_section": per_bay}, wind_speed=speed, line_modulus=modulus)
            result = solve(coupling, SCHEMES["iqn-ils"]())
            rows.append([f"{speed:g}", chord, str(per_bay), f"{modulus / 1e9:g}", *cells(result, coupling)])
    return lines(table(("wind m/s", "chord", "strips a bay", "line modulus GPa", *CELLS), rows))


def ranges(quick):
    """Wind speed and power tape: coupling iterations, or how the run ended."""
    winds = (8.0, 12.0) if quick else (7.0, 8.0, 10.0, 12.0, 15.0, 18.0, 20.0, 24.0)
    rows = []
    for tape in (3.0, 3.129) if quick else (2.6, 2.8, 3.0, 3.129, 3.3, 3.5):
        row = [f"{tape:g}"]
        for wind in winds:
            coupling = kite(wind_speed=wind, power_tape_length=tape)
            result = solve(coupling, SCHEMES["iqn-ils"](), max_iterations=80)
            row.append(str(result.iterations) if result.status == "converged" else result.status)
        rows.append(row)
    return lines(table(("power tape m", *(f"{w:g} m/s" for w in winds)), rows))


def against_askite(quick):
    """What the peer needs at 12 m/s with gravity, and what we need."""
    told = {}
    for name, scheme in (("IQN-ILS", SCHEMES["iqn-ils"]()), ("Aitken", Aitken(0.5))):
        told[name] = solve(kite(wind_speed=12.0), scheme)
    tight = solve(kite(wind_speed=12.0), SCHEMES["iqn-ils"](), atol=1e-10)
    ours = told["IQN-ILS"]
    off = np.abs(ours.displacement - tight.displacement).max()
    rows = [
        ["coupling iterations to 0.01 N", ", ".join(f"{r.iterations} ({n})" for n, r in told.items()), "78"],
        ["time", f"{ours.seconds['total']:.2f} s", "41 s of CPU time"],
        ["what its default tolerance leaves", f"{ours.residual_N:.0e} N, {1e3 * off:.0e} mm", "stops 5.4 cm away"],
    ]
    return lines(table(("12 m/s, gravity", "this", "ASKITE"), rows))


def line_drag(quick):
    """What line drag changes, where the scene can model it."""
    rows = []
    values = ("off", "on") if has_setting("v3_kite", "line_drag") else (None,)
    for speed in speeds(quick):
        for value in values:
            coupling = in_process("v3_kite", {"line_drag": value} if value else {}, wind_speed=speed)
            result = solve(coupling, SCHEMES["iqn-ils"]())
            glide = float(coupling.aero.get("glide_ratio"))
            rows.append([f"{speed:g}", value or "not modelled", f"{glide:.3f}", *cells(result, coupling)])
    return lines(table(("wind m/s", "line drag", "glide ratio", *CELLS), rows))


ENTRIES = (
    Table("v3_coupled.schemes", "Every scheme from the trim start", schemes),
    Table("v3_coupled.askite", "Beside the peer that couples the same model", against_askite),
    Table("v3_coupled.stability", "Static stability with and without symmetry and gravity", stability),
    Table("v3_coupled.strips", "Strips a bay over wind", strips),
    Table("v3_coupled.choices", "Chord and line modulus, with few and many strips", choices),
    Table("v3_coupled.ramp", "Wind raised until the tips fold, and lowered with folded tips", ramp),
    Table("v3_coupled.range", "Wind speed and power tape: coupling iterations, or how the run ended", ranges),
    Table("v3_coupled.line_drag", "What line drag changes", line_drag),
)
