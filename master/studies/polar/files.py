"""The files of a polar, each written whole or not at all: its table, everything as JSON, and plots."""

import csv
import io
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from master.report.tables import plain, write_json, write_whole

if TYPE_CHECKING:
    from master.studies.polar import Polar

FIGURES = ("polar", "sideslip")
FILES = ("polar.csv", "polar.json", *(f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")))
ANGLES = (
    "wing axes x backward, y to the right wing, z up; the wind blows to (cos alpha cos beta, -sin beta, sin alpha cos "
    "beta) in them: alpha > 0 is nose up, beta > 0 is wind from the right"
)
COEFFICIENTS = (
    "CD along the wind, CL across it in the wing's plane of symmetry, CS to the right across both; CM nose up over the "
    "reference chord, Cl right wing down and Cn nose right over the reference span, about the wing axes y, -x, -z"
)


def lacking(report: bool) -> str:
    """One sentence on what to install for plots, empty if it is there or none are wanted; nothing is loaded."""
    if not report or find_spec("matplotlib") is not None:
        return ""
    return "no plots, because matplotlib is not installed; pip install 'kitecosim[report]' brings it."


def write_polar(out: Path, found: "Polar", report: bool = True) -> None:
    """Write polar.csv and polar.json, and where wanted and possible the plots."""
    write_whole(out / "polar.csv", comma_separated(found.rows()))
    write_json(out / "polar.json", record(found))
    if not report or lacking(report):
        return
    from master.report.figures import rendered
    from master.studies.polar.figures import polar_figures

    for name, figure in polar_figures(found).items():
        for kind, data in rendered(figure).items():
            write_whole(out / f"{name}.{kind}", data)


def record(found: "Polar") -> dict[str, Any]:
    """Everything of a polar, as polar.json has it."""
    points = [
        {
            "alpha_deg": p.alpha, "beta_deg": p.beta, "status": p.status, "message": p.message,
            "coefficients": p.coefficients, "force_N": p.force, "moment_Nm": p.moment, "outputs": p.outputs,
            "strips": p.strips, "within_validity": p.within, "remarks": p.remarks,
        }
        for p in found.points
    ]  # fmt: skip
    outputs = {
        name: {"unit": found.units[name], "description": found.descriptions[name]} for name in sorted(found.units)
    }
    return {
        "title": found.title,
        "method": found.method,
        "angles": ANGLES,
        "coefficients": COEFFICIENTS,
        "reference": found.reference.record(),
        "points": points,
        "derivatives": None if found.derivatives is None else found.derivatives.record(),
        "no_derivatives": found.lacking,
        "outputs": outputs,
        "settings": found.settings,
    }


def comma_separated(rows: list[dict[str, Any]]) -> str:
    """The rows as CSV; floats keep all their digits, what is not known is empty."""
    text = io.StringIO()
    names = list(dict.fromkeys(name for row in rows for name in row))
    writer = csv.DictWriter(text, names, lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows([{k: "" if v is None else v for k, v in plain(row).items()} for row in rows])
    return text.getvalue()
