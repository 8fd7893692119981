"""The files of a comparison, each written whole or not at all: its tables, plots and page, and its finished cells.

The same rows give the same bytes.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from master.report.record import clear_leftovers
from master.report.tables import write_json, write_whole
from master.studies.grid import Cell
from master.studies.tables import comma_separated, markdown

FIGURES = {
    "residuals": "Interface residual over the coupling iterations. A filled dot ends a solve that converged, a red "
    "cross one that did not; the dashed line is the tolerance. Beside each scheme how many "
    "iterations it took (* to another equilibrium)",
    "iterations": "Coupling iterations of each scheme, dark where they are fewest. Hatched red bars are solves that "
    "did not converge, with the iteration at which they ended; dotted ones have found another equilibrium",
    "steps": "Coupling iterations of each communication step of transient scenes; beside each scheme all of them",
    "omega": "Relaxation factors over the coupling iterations, where a scheme has them and they change",
}
FILES = (
    *("compare.csv", "compare.json", "compare.md", "compare.html"),
    *(f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")),
)


def lacking() -> str:
    """One sentence on what to install for plots and page, empty if it is there; nothing is loaded."""
    missing = [name for name in ("matplotlib", "jinja2") if find_spec(name) is None]
    if not missing:
        return ""
    which = " and ".join(missing) + (" is" if len(missing) == 1 else " are")
    return f"no plots and HTML page, because {which} not installed; pip install 'kitecosim[report]' brings them."


def write_comparison(out: Path, rows: Sequence[dict[str, Any]]) -> list[str]:
    """Write tables and, where their libraries are installed, plots and page; the names of the files."""
    content: dict[str, str | bytes] = {"compare.csv": comma_separated(rows), "compare.md": markdown(rows)}
    if not lacking():
        from master.report.figures import rendered
        from master.studies.figures import comparison_figures
        from master.studies.page import page

        images = {name: rendered(figure) for name, figure in comparison_figures(rows).items()}
        content |= {f"{name}.{kind}": data for name, image in images.items() for kind, data in image.items()}
        content["compare.html"] = page(rows, {name: (FIGURES[name], image["svg"]) for name, image in images.items()})
    write_json(out / "compare.json", {"cells": list(rows)})
    for name, data in content.items():
        write_whole(out / name, data)
    return [name for name in FILES if name in content or name == "compare.json"]


class Store:
    """Finished cells as files in the folder `out`/cells, one each: a comparison continues where it was interrupted.

    A file is named after the hash of all that defines its cell, and is whole or missing.
    """

    def __init__(self, out: Path) -> None:
        self._folder = out / "cells"
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            raise ValueError(f"--out {out}: {self._folder} cannot be made a folder; name another folder.") from None
        clear_leftovers(self._folder)

    def finished(self, cells: Iterable[Cell]) -> dict[str, dict[str, Any]]:
        """Key -> row of the cells that are there."""
        out = {}
        for cell in cells:
            try:
                out[cell.key] = json.loads(self._path(cell).read_text(encoding="utf-8"))["row"]
            except (OSError, ValueError, KeyError, TypeError):  # not there, or no file of ours
                continue
        return out

    def write(self, cell: Cell, row: dict[str, Any]) -> None:
        """Keep the row of a cell."""
        write_json(self._path(cell), {"cell": asdict(cell), "row": row})

    def _path(self, cell: Cell) -> Path:
        return self._folder / f"{cell.key}.json"
