"""What a run leaves behind: summary.json, history.csv and tables of the final state, each written whole or not at
all.
"""

import csv
import io
import json
import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np


def write_whole(path: Path, text: str) -> None:
    """Write a file under a temporary name and rename it, so that no reader ever meets half of it."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Content as JSON, keys in the given order; NaN and infinity become null."""
    write_whole(path, json.dumps(_plain(content), indent=2, allow_nan=False) + "\n")


def write_csv(path: Path, header: list[str], rows: list[list[Any]]) -> None:
    """A table with a header row; floats keep all their digits."""
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow(header)
    out.writerows(rows)
    write_whole(path, text.getvalue())


def write_history(path: Path, history: list[dict[str, float]]) -> None:
    """A row per coupling iteration."""
    header = list(history[0]) if history else ["iteration", "residual_m"]
    rows = [[int(row[k]) if k == "iteration" else repr(float(row[k])) for k in header] for row in history]
    write_csv(path, header, rows)


def write_state(
    folder: Path, blocks: dict[str, np.ndarray], names: dict[str, tuple[str, ...]], reference: np.ndarray
) -> None:
    """The final state: nodes.csv, elements.csv, interface.csv and panels.csv, as far as the blocks are there."""
    rows: list[list[Any]]
    if "position" in blocks:
        rows = [[n, *map(repr, map(float, p))] for n, p in zip(names["position"], blocks["position"], strict=True)]
        write_csv(folder / "nodes.csv", ["node", "x_m", "y_m", "z_m"], rows)
    if "tension" in blocks:
        tension = zip(names["tension"], blocks["tension"], strict=True)
        write_csv(folder / "elements.csv", ["element", "tension_N"], [[n, repr(float(t))] for n, t in tension])
    x = blocks["displacement"]
    rows = [[i + 1, *map(repr, map(float, (*p, *d)))] for i, (p, d) in enumerate(zip(reference + x, x, strict=True))]
    write_csv(folder / "interface.csv", ["node", "x_m", "y_m", "z_m", "dx_m", "dy_m", "dz_m"], rows)
    pressure, shear = blocks["pressure"], blocks.get("shear")
    header = ["panel", "pressure_Pa"] + ([] if shear is None else ["shear_x_Pa", "shear_y_Pa", "shear_z_Pa"])
    rows = [
        [i + 1, repr(float(p)), *([] if shear is None else map(repr, map(float, shear[i])))]
        for i, p in enumerate(pressure)
    ]
    write_csv(folder / "panels.csv", header, rows)


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that make the numbers."""
    found = {"python": platform.python_version()}
    for package in ("kitecosim", "numpy", "scipy", "fmpy", "pythonfmu"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value
