"""The V3 kite as it ships: what the main job finds, and the picture of the flown shape."""

import numpy as np

from master.coupling import SCHEMES, coupled_run
from master.report import final_state

from .problems import in_process, loaded
from .registry import Table
from .text import lines, table

SPEEDS = (8.0, 12.0, 20.0)  # m/s
NAMES = (
    "wind, m/s", "status", "coupling iterations", "out-of-balance force, N", "α, °", "C_L", "C_D", "glide, with lines",
    "tip span, m", "pull, N", "largest line strain, %", "outside validity", "solve, ms",
)  # fmt: skip


def flown(speed):
    """The run at this wind speed from the trim start with default settings, and its coupled pair."""
    coupling = in_process("v3_kite", wind_speed=speed)
    return coupled_run(coupling, SCHEMES["iqn-ils"](), stability=False), coupling


def results(quick):
    """A row a wind speed."""
    rows = []
    for speed in SPEEDS[1:2] if quick else SPEEDS:
        run, coupling = flown(speed)
        aero = {
            block: float(coupling.aero.get(block)) for block in ("alpha_mid", "CL", "CD", "glide_ratio", "tip_span")
        }
        rows.append(
            [
                f"{speed:g}",
                run.status,
                str(run.result.iterations),
                f"{run.result.residual_N:.1e}",
                f"{np.rad2deg(aero['alpha_mid']):.2f}",
                f"{aero['CL']:.3f}",
                f"{aero['CD']:.4f}",
                f"{aero['glide_ratio']:.2f}",
                f"{aero['tip_span']:.3f}",
                f"{np.linalg.norm(coupling.structural.get('support_force')):.0f}",
                f"{100.0 * float(coupling.structural.get('largest_line_strain')):.1f}",
                ", ".join(j.criterion.quantity for j in run.validity if not j.within) or "nothing",
                f"{1e3 * run.result.seconds['total']:.0f}",
            ]
        )
    return lines(
        table(NAMES, rows),
        "C_L and C_D of the wing on 19.753 m²; glide is lift over drag with the lines; pull is the force on the bridle "
        "point, weight of the control unit included; lines are known to be good up to 1 % of strain "
        "(docs/scenes.md, Validity); time of the coupling loop, both solvers in one process.",
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
