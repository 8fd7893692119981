"""Finished cells as files, one each, so that a comparison goes on where it was interrupted."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from master.comparison.grid import Cell
from master.report.tables import write_json


class Store:
    """The folder `out`/cells. A file is named after the hash of all that defines its cell, and is whole or missing."""

    def __init__(self, out: Path) -> None:
        self._folder = out / "cells"
        try:
            self._folder.mkdir(exist_ok=True)
        except OSError:
            raise ValueError(f"--out {out}: {self._folder} cannot be made a folder; name another folder.") from None

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
