"""A comparison as tables: one row a cell, or one row a scene and one column a scheme."""

import csv
import io
from collections.abc import Sequence
from typing import Any

STATUS = {"max_iterations": "not converged", "statically_unstable": "unstable"}  # others are words already
HEADER = {
    "label": "scheme",
    "status": "status",
    "communication_steps": "steps",
    "coupling_iterations": "iterations",
    "calls": "solver calls",
    "newton": "Newton iterations",
    "seconds_total": "s",
    "residual_N": "residual, N",
    "CL": "C_L",
    "CD": "C_D",
    "tip_span": "tip span, m",
    "equilibrium": "equilibrium",
}
WORDS = ("label", "status", "equilibrium")  # columns that are no numbers
LEGEND = {
    "steps": "communication steps of a transient scene",
    "iterations": "coupling iterations, each one call of both solvers",
    "solver calls": "structure / flow, those that test the result included",
    "Newton iterations": "of all calls, structure / flow",
    "s": "wall time of the coupling loop, both solvers included, without loading the scene",
    "residual, N": "out-of-balance force at the end, with the flow evaluated again",
    "equilibrium": "1 is the one that most schemes have found; others with the relative difference of displacement; of "
    "transient scenes the state at the end",
}


def cases(rows: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """The rows of each case, in their order."""
    out: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        out.setdefault(row["case"], []).append(row)
    return out


def fewest(members: Sequence[dict[str, Any]]) -> int | None:
    """The fewest coupling iterations to the first equilibrium of a case, None if nothing converged."""
    return min((row["coupling_iterations"] for row in members if row["equilibrium"] == 1), default=None)


def status(row: dict[str, Any]) -> str:
    """The status in words."""
    return STATUS.get(row["status"], row["status"])


def shown(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Keys of HEADER that at least one row has something for, in their order."""
    return [k for k in HEADER if any(texts(row)[k] for row in rows)]


def texts(row: dict[str, Any]) -> dict[str, str]:
    """The cells of a row of the table of a case, empty where there is nothing; outputs only of what converged."""
    good = row["status"] == "converged"
    return {
        "label": row["label"],
        "status": status(row),
        "communication_steps": _number(row["communication_steps"], "d"),
        "coupling_iterations": _number(row["coupling_iterations"], "d"),
        "calls": _both(row["calls_structural"], row["calls_aero"]),
        "newton": _both(row["newton_structural"], row["newton_aero"]),
        "seconds_total": _number(row["seconds_total"], ".3f"),
        "residual_N": _number(row["residual_N"], ".1e"),
        "CL": _number(row["CL"], ".4f") if good else "",
        "CD": _number(row["CD"], ".4f") if good else "",
        "tip_span": _number(row["tip_span"], ".3f") if good else "",
        "equilibrium": equilibrium(row),
    }


def equilibrium(row: dict[str, Any]) -> str:
    """Which equilibrium was found."""
    number = row["equilibrium"]
    if number is None:
        return ""
    return "1" if number == 1 else f"{number} ({_percent(row['displacement_difference'])} off)"


def summary(row: dict[str, Any]) -> str:
    """A cell of the table of scenes and schemes: iterations / seconds, or the status that it ended with."""
    if row["status"] != "converged":
        count = row["coupling_iterations"]
        return status(row) + (f" ({count})" if count is not None else "")
    star = "" if row["equilibrium"] == 1 else "*"
    return f"{row['coupling_iterations']}{star} / {row['seconds_total']:.2g} s"


def matrix(rows: Sequence[dict[str, Any]]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table of scenes and schemes."""
    labels = list(dict.fromkeys(row["label"] for row in rows))
    out = []
    for case, members in cases(rows).items():
        of = {row["label"]: summary(row) for row in members}
        out.append([case, *(of.get(label, "") for label in labels)])
    return ["scene", *labels], out


def matrix_legend(rows: Sequence[dict[str, Any]]) -> str:
    """What the cells of the table of scenes and schemes say."""
    text = "Coupling iterations / wall time of the coupling loop; where it did not converge, the status and after how "
    text += "many iterations."
    if any((row["equilibrium"] or 1) > 1 for row in rows):
        text += " * converged to another equilibrium than most schemes (or, of two, than the better one)."
    return text


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """The table of scenes and schemes in Markdown."""
    header, body = matrix(rows)
    lines = [header, ["---"] * len(header), *body]
    table = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
    legend = matrix_legend(rows).replace(" * ", " \\* ")
    return f"{table}\n\n{legend}\n"


def comma_separated(rows: Sequence[dict[str, Any]]) -> str:
    """A row a cell with all numbers to their last digit, vectors as 1.0,0.0,0.0, without histories; a column of a
    setting that a cell does not have is empty.
    """
    first = [k for k in rows[0] if not k.endswith(("_history", "_history_m", "_history_N"))]
    first = [k for k in first if "." not in k and not k.startswith("newton_history")]
    more = dict.fromkeys(k for row in rows for k in row if "." in k)
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow([*first, *more])
    out.writerows([[_entry(row.get(k)) for k in (*first, *more)] for row in rows])
    return text.getvalue()


def _entry(value: Any) -> Any:
    if isinstance(value, list):
        return ",".join(map(str, value))
    return "" if value is None else value


def _number(value: float | None, form: str) -> str:
    return "" if value is None else f"{value:{form}}"


def _both(structural: int | None, aero: int | None) -> str:
    if structural is None or aero is None:
        return "" if structural is None else f"{structural} / –"
    return f"{structural} / {aero}"


def _percent(share: float) -> str:
    percent = 100.0 * share
    return f"{percent:.0f} %" if percent >= 10.0 else f"{percent:.2g} %"
