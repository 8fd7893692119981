"""Parafoils flown coupled: meshes and winds, and coupling schemes."""

import numpy as np

import scenes
from master.coupling import SCHEMES, Coupling, scheme, solve

from .registry import Table
from .text import lines, table

SMALL, LARGE = "parafoil_small", "parafoil_160"
WINDS = {"coarse": (10.0, 20.0, 30.0)}  # mesh -> m/s; finer ones take minutes
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


def meshes(quick):
    """Meshes and winds, by the default scheme without tuning."""
    rows = []
    for mesh, winds in ({SMALL: (10.0,)} if quick else WINDS).items():
        for wind in winds:
            of = (SMALL, None) if quick else (LARGE, {"variant": mesh})
            coupling, end = flown(*of, wind_speed=wind)
            rows.append([mesh, f"{wind:g}", *cells(coupling, end), *times(end)])
    return lines(
        table(("mesh", "wind m/s", *RUN, *TIMES), rows),
        "Default scheme, as shipped, in this process; the residual is that of the forces on all free nodes. "
        "Coefficients are over 125 m2.",
    )


def picture(path):
    """The membranes of the coarse mesh at 10 m/s as SVG."""
    from master.report.figures import rendered
    from master.report.membranes import membrane_figure, membrane_state

    coupling, end = flown(LARGE, {"variant": "coarse"}, wind_speed=10.0)
    structure = coupling.structural
    found = membrane_state(scenes.load(LARGE).members, {name: structure.get(name) for name in structure.blocks})
    path.write_bytes(rendered(membrane_figure(found, "Parafoil of 160 m2, wind 10 m/s", end.status))["svg"])


def schemes(quick):
    """Schemes on one kite, beside figure 4.8 of the thesis."""
    rows = []
    for name in ("explicit", "iqn-ils") if quick else SCHEMES:
        try:
            coupling, end = flown(SMALL, None, name)
        except ValueError as error:
            rows.append([name, "", str(error), *[""] * (len(RUN) + len(TIMES) - 2)])
            continue
        rows.append([name, *cells(coupling, end), *times(end)])
    return lines(
        table(("scheme", *RUN, *TIMES), rows),
        "The thesis (figure 4.8, residual 1e-3 of the displacement): explicit 12 to 13, Aitken never within 20, "
        "IQN-ILS 12 to 15 with a filter tuned by hand.",
    )


def line_loads(quick):
    """Shares of the rows of lines at the rib in the middle, beside table 4.4 of the thesis."""
    from master.report.line_rows import line_rows

    settings = None if quick else {"variant": "coarse"}
    name, rows = SMALL if quick else LARGE, []
    for wind in (10.0,) if quick else WINDS["coarse"]:
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
    Table("parafoil.lines", "Parafoil of 160 m2, coarse: line loads by row", line_loads),
    Table("parafoil.schemes", "Small parafoil: coupling schemes", schemes),
)
