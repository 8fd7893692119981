"""Rows of a comparison as flat dicts, and which cells have found the same equilibrium."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from master.studies.cells import HISTORIES, OUTPUTS, RECORDS, STEPS
from master.studies.grid import Cell

# Displacements that differ by more than this share of their norm are two equilibria (converged solves of one differ by
# some 1e-5, folded or overturned wings by some 0.1), unless they differ by less than so many tolerances: where a
# displacement is small, the tolerance of the coupling decides how well it is known.
SAME, TOLERANCES = 1e-3, 10.0
SECONDS = ("total", "structural", "aero", "master")


def flat_rows(cells: Sequence[Cell], found: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One dict of plain values (and lists over the coupling iterations) per cell, all with the same first keys."""
    out = [_flat(cell, row) for cell, row in zip(cells, found, strict=True)]
    for case in dict.fromkeys((cell.scene, cell.digest, tuple(cell.assigned.items())) for cell in cells):
        members = [i for i, c in enumerate(cells) if (c.scene, c.digest, tuple(c.assigned.items())) == case]
        for i, (number, difference) in _equilibria({i: found[i] for i in members}, cells[0].tolerance).items():
            out[i]["equilibrium"], out[i]["displacement_difference"] = number, difference
    return out


def _equilibria(found: dict[int, dict[str, Any]], tolerance: float) -> dict[int, tuple[int, float]]:
    """Number of the equilibrium (1: found by most, of equally many the one found best) and relative distance from it.

    The distance is ||d - d_1|| / ||d_1|| with d_1 the displacement of the cell with the least residual of number 1.
    """
    converged = [i for i, row in found.items() if row["status"] == "converged"]
    ranked = sorted(converged, key=lambda i: (found[i].get("residual_N", 0.0), i))
    displacement = {i: np.array(found[i]["displacement"]) for i in converged}
    groups: list[list[int]] = []
    for i in ranked:
        for group in groups:
            d = displacement[group[0]]
            if np.linalg.norm(displacement[i] - d) <= max(SAME * float(np.linalg.norm(d)), TOLERANCES * tolerance):
                group.append(i)
                break
        else:
            groups.append([i])
    groups.sort(key=lambda group: -len(group))  # stable: the better found first
    return {
        i: (number, _distance(displacement[i], displacement[groups[0][0]]))
        for number, group in enumerate(groups, 1)
        for i in group
    }


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    difference, size = float(np.linalg.norm(a - b)), float(np.linalg.norm(b))
    return difference / size if size > 0.0 else difference


def _flat(cell: Cell, row: dict[str, Any]) -> dict[str, Any]:
    histories, calls, seconds = (row.get(k, {}) for k in ("histories", "calls", "seconds"))
    flat: dict[str, Any] = {
        "case": cell.case,
        "label": cell.label,
        "scene": cell.scene,
        "scheme": cell.scheme,
        "order": cell.order,
        "backend": cell.backend,
        "status": row["status"],
        "message": row["message"],
        "equilibrium": None,
        "displacement_difference": None,
        "coupling_iterations": row.get("coupling_iterations"),
        "communication_steps": row.get("communication_steps"),
        "calls_structural": calls.get("structural"),
        "calls_aero": calls.get("aero"),
        "newton_structural": _total(histories.get("newton_history_structural")),
        "newton_aero": _total(histories.get("newton_history_aero")),
        "failures": row.get("failures"),
        "recoveries": row.get("recoveries"),
        "residual_m": row.get("residual_m"),
        "residual_N": row.get("residual_N"),
        **{name: row.get("outputs", {}).get(name) for name in OUTPUTS},
        "outside_validity": row.get("outside_validity"),
        **{f"seconds_{name}": seconds.get(name) for name in SECONDS},
        "columns": _most(histories.get("columns_history")),
        "filtered": _total(histories.get("filtered_history")),
        "products": _total(histories.get("products_history")),
    }
    flat |= {name: histories.get(name, []) for name in (*HISTORIES, *(f"{r}_history" for r in RECORDS), STEPS)}
    options = ("tolerance", "force_tolerance", "max_iterations", "stop_time", "step", "repeat")
    flat |= {name: getattr(cell, name) for name in options}
    flat |= {f"scheme.{name}": value for name, value in cell.parameters.items()}
    flat |= {f"given.{name}": value for name, value in cell.assigned.items()}
    for side, values in row.get("settings", {}).items():
        flat |= {f"{side}.{name}": value for name, value in values.items()}
    flat |= {f"version.{name}": value for name, value in cell.versions.items()}
    return flat | {"digest": cell.digest, "key": cell.key}


def _numbers(values: Any) -> list[float]:
    return [v for v in values or [] if v is not None]


def _total(values: Any) -> int | None:
    shown = _numbers(values)
    return int(sum(shown)) if shown else None


def _most(values: Any) -> int | None:
    shown = _numbers(values)
    return int(max(shown)) if shown else None
