"""Scenes of rigid wings: without a structure, an aerodynamic side alone."""

import shutil
from pathlib import Path

import numpy as np

from interface.vectors import azimuth_axes
from tests.scenes.broken import BUILT_IN

# The wing of v3_kite, whose sections and polars it has, with the options of its flow.
V3 = """title = "rigid wing of the V3 kite"
description = "The sections of the V3 kite without its bridle."

[settings.panels_per_section]
default = 1
maximum = 40
description = "strips between two sections"

[settings.scale]
default = 1.0
minimum = 0.01
description = "geometric scale"

[wing]
sections = "sections.csv"
polars = "polars.csv"

[aero]
direction = "control"
circulation_speed = "far"
wind_speed = 12.0
reference_area = 19.753
symmetric = true
"""


def rigid_v3(folder, more=""):
    """The wing of the V3 kite as a scene of its own in a folder, with `more` at the end of its scene.toml; its path."""
    path = Path(folder) / "rigid_v3"
    path.mkdir()
    for name in ("sections.csv", "polars.csv"):
        shutil.copy(BUILT_IN / "v3_kite" / name, path)
    (path / "scene.toml").write_text(V3 + more)
    return path


def flat_wing(
    folder, span=10.0, chord=1.0, sweep=0.0, dihedral=0.0, sections=9, point=None, twist=0.0, azimuth=0.0, aero=""
):
    """A rectangular wing of thin sections (cl = 2 pi alpha, no drag, no moment), span along y, chord along x, the
    middle of its quarter-chord line at the origin; `sweep`, `dihedral` and `twist` (nose-up) rad, and an
    `azimuth` rad about z by which it is turned with its wind; `aero` more of that section. The path of its scene.
    """
    path = Path(folder) / "flat_wing"
    path.mkdir()
    turn = azimuth_axes(azimuth)
    rows = ["section,polar,le_x_m,le_y_m,le_z_m,te_x_m,te_y_m,te_z_m"]
    for k, y in enumerate(np.linspace(-0.5, 0.5, sections) * span):
        x, z = abs(y) * np.tan(sweep), abs(y) * np.tan(dihedral)
        along = chord * np.array([np.cos(twist), 0.0, -np.sin(twist)])
        le, te = np.array([x, y, z]) - 0.25 * along, np.array([x, y, z]) + 0.75 * along
        edges = np.concatenate([le @ turn.T, te @ turn.T])
        rows.append(",".join([str(k + 1), "thin", *(repr(float(v)) for v in edges)]))
    (path / "sections.csv").write_text("\n".join(rows) + "\n")
    alpha = np.arange(-40.0, 40.5, 1.0)
    polar = [f"thin,{a},{2.0 * np.pi * np.deg2rad(a):.12f},0.0,0.0" for a in alpha.tolist()]
    (path / "polars.csv").write_text("\n".join(["polar,alpha_deg,cl,cd,cm", *polar]) + "\n")
    about = "" if point is None else f"reference_point = {[float(x) for x in point]}\n"
    text = f"""title = "flat wing"

[wing]
sections = "sections.csv"
polars = "polars.csv"

[aero]
wind_speed = 10.0
wind_direction = {turn[:, 0].tolist()}
reference_area = {span * chord}
{about}{aero}"""
    (path / "scene.toml").write_text(text)
    return path
