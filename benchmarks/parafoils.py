"""Parafoils flown coupled: meshes and winds, and coupling schemes."""

import functools
import json
import subprocess
import sys

import numpy as np

import scenes
from master.coupling import SCHEMES, Coupling, scheme, solve
from master.coupling.spectrum import dominant_eigenvalue, rightmost_eigenvalue
from master.coupling.stability import static_stability

from .registry import Table
from .text import lines, table

SMALL, LARGE = "parafoil_small", "parafoil_160"
MESHES = "coarse", "medium", "fine"
WINDS = 10.0, 20.0, 30.0  # m/s
TRIMS = (10, 20, 32, 42, 50, 60)  # %
MILLIMETRE = 1e-3  # by which the shape is off its equilibrium where an explicit step is watched, m in all entries
SHARES = (26, 55, 15, 4)  # % of rows A to D at the centre rib, thesis table 4.4
RUN = ("iterations", "status", "residual N", "alpha deg", "C_L", "C_D", "L/D with lines", "projected m2", "pull N")
TIMES = ("structure s", "flow s", "transfer and scheme s")
ITERATIONS = 60  # of a scheme at most


def flown(name, settings=None, using="iqn-ils", **parameters):
    """A parafoil at its trim, coupled, and the end of the solve."""
    coupling = Coupling.in_process(scenes.load(name, settings), parameters)
    end = solve(coupling, scheme(using, coupling), max_iterations=ITERATIONS)
    return coupling, end


def cells(coupling, end):
    """`RUN` of a coupled solve."""
    aero, structure = coupling.aero, coupling.structural
    numbers = [np.rad2deg(float(aero.get("alpha_mid")))]
    numbers += [float(aero.get(name)) for name in ("CL", "CD", "glide_ratio", "projected_area")]
    pull = float(np.linalg.norm(structure.get("support_force")))
    return [str(end.iterations), end.status, f"{end.residual_N:.1e}", *(f"{v:.4g}" for v in numbers), f"{pull:.1f}"]


def times(end):
    """`TIMES` of a coupled solve."""
    s = end.seconds
    parts = s["structural"], s["aero"], s["total"] - s["structural"] - s["aero"]
    return [f"{part:.2f}" for part in parts]


@functools.cache
def measured(mesh, wind):
    """What `parafoil_run` prints of a mesh in a wind."""
    command = [sys.executable, "-m", "benchmarks.parafoil_run", mesh, f"{wind:g}"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def meshes(quick):
    """Meshes and winds, by the default scheme without tuning."""
    rows = []
    for mesh in MESHES[:1] if quick else MESHES:
        for wind in WINDS[:1] if quick else WINDS:
            found = measured(mesh, wind)
            residual, times = f"{found['residual']:.0e}", (f"{found[name]:.0f}" for name in ("setup_s", "solve_s"))
            rows.append([mesh, f"{wind:g}", *found["cells"], residual, *times])
    return lines(
        table(("mesh", "wind m/s", *RUN, "residual over displacement", "set-up s", "solve s"), rows),
        "Default scheme, as shipped, in one process with one thread; the residual in N is that of forces on all free "
        "nodes. Coefficients are over 125 m2. Set-up is the scene and the search for the trim of the rigid wing.",
    )


def work(quick):
    """Where the time of a solve goes, mesh by mesh, and memory."""
    found = {mesh: measured(mesh, WINDS[0]) for mesh in (MESHES[:1] if quick else MESHES)}
    names = list(next(iter(found.values()))["parts"])
    rows = [
        [mesh, *(f"{100.0 * one['parts'][name] / one['solve_s']:.1f}" for name in names), f"{one['memory_MB']:.0f}"]
        for mesh, one in found.items()
    ]
    return lines(
        table(("mesh", *(f"{name} %" for name in names), "memory MB"), rows),
        f"{WINDS[0]:g} m/s. Structure: factorisation, assembly and other; flow: influences, loads, far field, "
        "solution and other. Memory is the most that the process had.",
    )


def picture(path):
    """The membranes of the coarse mesh at 10 m/s as SVG."""
    from master.report.figures import rendered
    from master.report.membranes import membrane_figure, membrane_state

    coupling, end = flown(LARGE, {"variant": "coarse"}, wind_speed=10.0)
    structure = coupling.structural
    found = membrane_state(scenes.load(LARGE).members, {name: structure.get(name) for name in structure.blocks})
    path.write_bytes(rendered(membrane_figure(found, "Parafoil of 160 m2, wind 10 m/s", end.status))["svg"])


def leading(trim):
    """Of the coupled map of the small parafoil at its equilibrium the eigenvalue of largest magnitude, of symmetric
    modes, and the factor by which explicit steps stretch a millimetre of that mode in the first of them.
    """
    coupling = Coupling.in_process(scenes.load(SMALL, {"trim": trim}))
    x = solve(coupling, scheme("iqn-ils", coupling), atol=1e-9, max_iterations=ITERATIONS).displacement
    coupling.set_tolerance(1e-9)
    about = {"step": 0.1 * MILLIMETRE, "start": x - coupling.start}
    found = dominant_eigenvalue(coupling, x, max_evaluations=60, **about)
    if not found.settled:  # several of nearly the same magnitude
        found = rightmost_eigenvalue(coupling, x, max_evaluations=80, **about)
    mode = found.vector.reshape(x.shape)
    off = coupling(x + MILLIMETRE * mode) - x
    return found, float(np.ravel(off) @ np.ravel(mode)) / MILLIMETRE


def trims(quick):
    """Trims: the leading eigenvalue beside the rate of explicit steps, and which schemes converge."""
    rows = []
    for trim in TRIMS[2:3] if quick else TRIMS:
        coupling, end = flown(SMALL, {"trim": trim})
        explicit = flown(SMALL, {"trim": trim}, "explicit")[1]
        eigen, rate = leading(trim)
        imaginary = f" ± {eigen.imaginary:.3f} i" if eigen.imaginary else ""
        ends = (f"{one.status}, {one.iterations}" for one in (explicit, end))
        found = (f"{eigen.value:.3f}{imaginary}", f"{rate:.3f}", *ends)
        rows.append([str(trim), *cells(coupling, end)[3:5], *found])
    names = ("trim %", "alpha deg", "C_L", "leading eigenvalue", "explicit step", "explicit", "default")
    return lines(
        table(names, rows),
        "10 m/s. The eigenvalue is that of the derivative of the coupled map, from differences of 0.1 mm; the explicit "
        "step is the factor on a millimetre of its mode. Up to 60 iterations.",
    )


def schemes(quick):
    """Schemes on two kites, beside figure 4.8 of the thesis."""
    rows = []
    for name, settings in ((SMALL, None),) if quick else ((SMALL, None), (LARGE, {"variant": "coarse"})):
        for using in ("explicit", "iqn-ils") if quick else SCHEMES:
            kite = name if settings is None else f"{name}, {settings['variant']}"
            try:
                coupling, end = flown(name, settings, using)
            except ValueError as error:
                rows.append([kite, using, "", str(error), *[""] * (len(RUN) + len(TIMES))])
                continue
            count, status, *others = cells(coupling, end)
            rightmost = static_stability(coupling, end.displacement).eigenvalue if end.status == "converged" else np.nan
            stable = "" if np.isnan(rightmost) else f"{rightmost:.2f}"
            rows.append([kite, using, first_below(end, 1e-3), count, status, stable, *others, *times(end)])
    to_a_thousandth = "iterations to 1e-3"
    return lines(
        table(("kite", "scheme", to_a_thousandth, *RUN[:2], "rightmost eigenvalue", *RUN[2:], *TIMES), rows),
        "1e-3: of the displacement, as in figure 4.8 of the thesis (explicit 12 to 13, Aitken never within 20, IQN-ILS "
        "12 to 15 with a filter tuned by hand); the other count is to the default tolerance. An equilibrium with an "
        "eigenvalue above 1 is unstable: `kitecosim run` ends as statically_unstable there.",
    )


def first_below(end, part):
    """The first iteration whose residual is at most that part of the displacement."""
    size = part * np.linalg.norm(end.displacement)
    return next((str(int(row["iteration"])) for row in end.history if row["residual_m"] <= size), "")


def line_loads(quick):
    """Shares of the rows of lines at the rib in the middle, beside table 4.4 of the thesis."""
    from master.report.line_rows import line_rows

    settings = None if quick else {"variant": "coarse"}
    name, rows = SMALL if quick else LARGE, []
    for wind in WINDS[:1] if quick else WINDS:
        coupling, end = flown(name, settings, wind_speed=wind)
        found = line_rows(scenes.load(name, settings).members, coupling.structural.get("tension"))
        shares = [f"{100.0 * share:.1f}" for share in found.share[found.middle]]
        rows.append([f"{wind:g}", end.status, *shares, f"{found.tension[found.middle].sum():.1f}"])
    rows.append(["thesis", "", *map(str, SHARES), ""])
    return lines(
        table(("wind m/s", "status", "A %", "B %", "C %", "D %", "all N"), rows),
        "Tension of each line over the sum of the four at the rib in the middle. Profile, places of the rows and "
        "length of the lines are not in the thesis, which does not say either at which wind table 4.4 was taken.",
    )


ENTRIES = (
    Table("parafoil.meshes", "Parafoil of 160 m2: meshes and winds, untuned", meshes, picture),
    Table("parafoil.work", "Parafoil of 160 m2: where the time goes", work),
    Table("parafoil.lines", "Parafoil of 160 m2, coarse: line loads by row", line_loads),
    Table("parafoil.trims", "Small parafoil: trims, and the rate of the explicit scheme", trims),
    Table("parafoil.schemes", "Parafoils: coupling schemes", schemes),
)
