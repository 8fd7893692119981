"""V3 kite coupled: schemes against wind speeds, critical relaxation, strips, symmetry and backends, as markdown tables.

Run as `python benchmarks/v3_coupled.py`; `--quick` leaves out strips, ranges and the timing of the FMUs.
"""

import contextlib
import statistics
import sys
import tempfile
import time

import numpy as np

import scenes
from fmus.builder import build
from master.acceleration import Aitken, ConstantRelaxation
from master.coupling import SCHEMES, Coupling, solve
from master.participants import FmuParticipant
from master.run import coupled_run
from master.spectrum import critical_relaxation, dominant_eigenvalue

SPEEDS = (8.0, 12.0, 20.0)
CELLS = "iterations | status | residual_N | alpha deg | tip span m | support force N | slack lines | ms"


def in_process(settings=None, **parameters):
    """The V3 kite as a coupled pair of solver cores at its trim start."""
    scene = scenes.load("v3_kite", settings)
    given = {**parameters, "trim_angle": scene.trim_angle(parameters)}
    return Coupling.in_process(scene, given)


@contextlib.contextmanager
def as_fmus(**parameters):
    """The same as two FMUs."""
    scene = scenes.load("v3_kite")
    with tempfile.TemporaryDirectory() as folder:
        paths = build(scene, folder, {**parameters, "trim_angle": scene.trim_angle(parameters)})
        with FmuParticipant(paths[0]) as structural, FmuParticipant(paths[1]) as aero:
            yield Coupling(structural, aero)


def factor_of_speed(speed):
    """Dominant eigenvalue of G' at the symmetric equilibrium, and the critical relaxation factor 2 / (1 - lambda)."""
    coupling = in_process(wind_speed=speed)
    start = coupling.structural.get("displacement")
    x = solve(coupling, SCHEMES["iqn-ils"](), atol=1e-8).displacement
    coupling.set_tolerance(1e-8)
    found = dominant_eigenvalue(coupling, x, step=1e-4, start=np.sign(x - start) * np.sqrt(np.abs(x - start)))
    return found.value, critical_relaxation(found.value), found.settled


def row(result, coupling):
    """Iterations, status, angle of attack, tip span, support force and solve time as table cells."""
    aero, structural = coupling.aero, coupling.structural
    force = np.linalg.norm(structural.get("support_force"))
    return (
        f"{result.iterations} | {result.status} | {result.residual_N:.1e} | "
        f"{np.rad2deg(float(aero.get('alpha_mid'))):.3f} | {float(aero.get('tip_span')):.4f} | {force:.2f} | "
        f"{int(structural.get('slack_lines'))} | {1e3 * result.seconds['total']:.0f}"
    )


def scheme_table():
    """Every scheme at every wind speed from the trim start, in-process."""
    print(f"| wind m/s | scheme | {CELLS} |")
    print("|" + "---|" * 10)
    for speed in SPEEDS:
        value, critical, settled = factor_of_speed(speed)
        schemes = {
            "explicit": ConstantRelaxation(1.0),
            f"relaxation 0.97 x {critical:.4f}": ConstantRelaxation(0.97 * critical),
            f"relaxation 1.03 x {critical:.4f}": ConstantRelaxation(1.03 * critical),
            "Aitken": Aitken(0.5),
            "IQN-ILS": SCHEMES["iqn-ils"](),
        }
        for name, scheme in schemes.items():
            coupling = in_process(wind_speed=speed)
            result = solve(coupling, scheme, max_iterations=1000)
            print(f"| {speed:g} | {name} | {row(result, coupling)} |")
        print(f"| {speed:g} | dominant eigenvalue {value:.4f}{'' if settled else ' (not settled)'} | | | | | | | | |")


def stability_table():
    """With and without symmetry and gravity: the rightmost eigenvalue of G'."""
    print("\n| wind m/s | symmetric | gravity | status | rightmost eigenvalue | statically stable | evaluations |")
    print("|---|---|---|---|---|---|---|")
    for speed in SPEEDS:
        for symmetric, gravity in ((1.0, 9.81), (0.0, 9.81), (0.0, 0.0)):
            coupling = in_process(wind_speed=speed, symmetric=symmetric, gravity=gravity)
            run = coupled_run(coupling, SCHEMES["iqn-ils"]())
            s = run.stability
            cells = "| | |" if s is None else f"{s.eigenvalue:.4f} | {s.statically_stable} | {s.evaluations} |"
            print(f"| {speed:g} | {bool(symmetric)} | {gravity:g} | {run.status} | {cells}")


def strip_table():
    """Influence of strips, chord and line modulus at 12 and 20 m/s."""
    print(f"\n| wind m/s | chord | strips | line modulus GPa | {CELLS} |")
    print("|" + "---|" * 12)
    for speed in (12.0, 20.0):
        for chord, per_bay, modulus in (
            *(("structural", k, 0.55e9) for k in (1, 2, 4, 8, 12)),
            ("structural", 4, 100e9),
            ("design", 1, 0.55e9),
            ("design", 4, 0.55e9),
        ):
            coupling = in_process(
                {"chord": chord, "panels_per_section": per_bay}, wind_speed=speed, line_modulus=modulus
            )
            result = solve(coupling, SCHEMES["iqn-ils"]())
            print(f"| {speed:g} | {chord} | {9 * per_bay} | {modulus / 1e9:g} | {row(result, coupling)} |")


def range_table():
    """Default settings over wind speed and power tape: coupling iterations, or how the run ended."""
    winds = (7.0, 8.0, 10.0, 12.0, 15.0, 18.0, 20.0, 24.0)
    print("\n| power tape m | " + " | ".join(f"{w:g} m/s" for w in winds) + " |")
    print("|" + "---|" * (len(winds) + 1))
    for tape in (2.6, 2.8, 3.0, 3.129, 3.3, 3.5):
        cells = []
        for wind in winds:
            result = solve(in_process(wind_speed=wind, power_tape_length=tape), SCHEMES["iqn-ils"](), max_iterations=80)
            cells.append(str(result.iterations) if result.status == "converged" else result.status)
        print(f"| {tape:g} | " + " | ".join(cells) + " |")


def tip_span_line():
    """Tip span against wind speed with 36 strips on the structural chord, going up in wind."""
    coupling = in_process({"panels_per_section": 4}, wind_speed=12.0)
    cells = []
    for speed in (12, 14, 16, 17, 18, 20):
        coupling.aero.set("wind_speed", float(speed))
        result = solve(coupling, SCHEMES["iqn-ils"](), max_iterations=80)
        cells.append(f"{speed} m/s {float(coupling.aero.get('tip_span')):.2f} m ({result.status})")
    print("\nStructural chord, 36 strips, tip span with the wind raised step by step: " + ", ".join(cells) + ".")


def ramp_line():
    """Design chord at 20 m/s reached by going up in wind speed."""
    coupling = in_process({"chord": "design", "panels_per_section": 4}, wind_speed=8.0)
    counts = []
    for speed in range(8, 21):
        coupling.aero.set("wind_speed", float(speed))
        result = solve(coupling, SCHEMES["iqn-ils"]())
        counts.append(str(result.iterations))
    aero = coupling.aero
    print(
        f"\nDesign chord, 36 strips, wind raised from 8 to 20 m/s in steps of 1: {result.status}, coupling iterations "
        f"{', '.join(counts)}; at 20 m/s alpha {np.rad2deg(float(aero.get('alpha_mid'))):.3f} deg, tip span "
        f"{float(aero.get('tip_span')):.4f} m."
    )


def backend_table(repeats=9):
    """Time of the solve loop, FMUs against in-process, alternately in one run."""
    times = {"in-process": [], "fmu": []}
    worst = 0.0
    for _ in range(repeats):
        results = {}
        coupling = in_process(wind_speed=12.0)
        begin = time.perf_counter()
        results["in-process"] = solve(coupling, SCHEMES["iqn-ils"]())
        times["in-process"].append(time.perf_counter() - begin)
        with as_fmus(wind_speed=12.0) as coupling:
            begin = time.perf_counter()
            results["fmu"] = solve(coupling, SCHEMES["iqn-ils"]())
            times["fmu"].append(time.perf_counter() - begin)
        a, b = (np.array([h["residual_m"] for h in results[k].history]) for k in ("in-process", "fmu"))
        worst = max(worst, float(np.max(np.abs(a - b)) / a.max()))
    ratios = sorted(b / a for a, b in zip(times["in-process"], times["fmu"], strict=True))
    middle = {name: 1e3 * statistics.median(values) for name, values in times.items()}
    print(
        f"\nSolve loop at 12 m/s, medians of {repeats}: in-process {middle['in-process']:.1f} ms, "
        f"FMUs {middle['fmu']:.1f} ms, ratio {statistics.median(ratios):.3f} ({ratios[0]:.2f} to {ratios[-1]:.2f}); "
        f"largest difference of the residual histories {worst:.1e} relative."
    )


if __name__ == "__main__":
    scheme_table()
    stability_table()
    if "--quick" not in sys.argv:
        strip_table()
        ramp_line()
        tip_span_line()
        range_table()
        backend_table()
