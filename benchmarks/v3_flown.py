"""The V3 kite as it ships: what the main job finds, and the picture of the flown shape."""

import numpy as np

from master.coupling import SCHEMES, coupled_run
from master.report import final_state

from .problems import in_process, loaded
from .registry import Table
from .text import lines, table

SOURCE = None  # the line modulus that the scene ships with
DYNEEMA = 100e9  # Pa
FLIGHTS = ((8.0, SOURCE), (12.0, SOURCE), (20.0, SOURCE), (12.0, DYNEEMA))  # wind m/s, line modulus Pa
NAMES = (
    "wind, m/s", "lines, GPa", "largest line strain, %", "validity", "status", "coupling iterations",
    "out-of-balance force, N", "α, °", "C_L", "C_D", "glide, with lines", "tip span, m", "pull, N", "solve, ms",
)  # fmt: skip


def flown(speed, modulus=SOURCE):
    """The run at this wind speed and line modulus, else with default settings from the trim start, and its pair."""
    given = {} if modulus is SOURCE else {"line_modulus": modulus}
    coupling = in_process("v3_kite", wind_speed=speed, **given)
    return coupled_run(coupling, SCHEMES["iqn-ils"](), stability=False), coupling


def verdict(run):
    """What lies beyond the limit that it is known to be good for; "within" if nothing does."""
    outside = (j.criterion for j in run.validity if not j.within)
    return ", ".join(f"{c.quantity} above {c.text(c.limit)}" for c in outside) or "within"


def results(quick):
    """A row a flight."""
    rows = []
    for speed, modulus in FLIGHTS[1:2] if quick else FLIGHTS:
        run, coupling = flown(speed, modulus)
        aero, structural = coupling.aero, coupling.structural
        rows.append(
            [
                f"{speed:g}",
                f"{float(structural.get('line_modulus')) / 1e9:g}",
                f"{100.0 * float(structural.get('largest_line_strain')):.3g}",
                verdict(run),
                run.status,
                str(run.result.iterations),
                f"{run.result.residual_N:.1e}",
                f"{np.rad2deg(float(aero.get('alpha_mid'))):.2f}",
                f"{float(aero.get('CL')):.3f}",
                f"{float(aero.get('CD')):.4f}",
                f"{float(aero.get('glide_ratio')):.2f}",
                f"{float(aero.get('tip_span')):.3f}",
                f"{np.linalg.norm(structural.get('support_force')):.0f}",
                f"{1e3 * run.result.seconds['total']:.0f}",
            ]
        )
    return lines(
        table(NAMES, rows),
        "Lines of 0.55 GPa are the numerical choice of the source, not Dyneema, which has about 100 GPa (last row). "
        f"The wing weighs {float(structural.get('wing_mass')):g} kg here, the sum of the source's spring masses; that "
        "of the LEI thesis and of `v3_kite_detailed` weighs "
        f"{float(loaded('v3_kite_detailed')[0].structural_core().get('wing_mass')):g} kg.",
        "Validity: lines are known to be good up to 1 % of strain (docs/scenes.md, Validity). C_L and C_D of the wing "
        "on 19.753 m²; glide is lift over drag with the lines; pull is the force on the bridle point, weight of the "
        "control unit included; time of the coupling loop, both solvers in one process.",
    )


def picture(path):
    """The shape plot of the run at 12 m/s as SVG."""
    from master.report.figures import rendered
    from master.report.shape import shape_figure
    from master.report.views import wind_of

    run, _ = flown(12.0)
    scene, _ = loaded("v3_kite", wind_speed=12.0)
    wind = wind_of(run.blocks["aero"])
    figure = shape_figure(final_state(scene, run), f"{scene.title}, wind 12 m/s", run.status, wind)
    path.write_bytes(rendered(figure)["svg"])


ENTRIES = (Table("v3_flown.kite", "TU Delft V3 kite with line drag, from the automatic trim start", results, picture),)
