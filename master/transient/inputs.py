"""Values of parameters and inputs over time, from a CSV file."""

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from master.participants import Participant


@dataclass(frozen=True, eq=False)
class Inputs:
    """Columns of a table over `times` (k,) s: name of a block of either side -> values (k,), linear between the rows
    and held outside. A communication step gets the values at its end, to which tapes move in the course of it.
    """

    path: str
    times: np.ndarray
    columns: dict[str, np.ndarray]

    @classmethod
    def read(cls, path: Path) -> "Inputs":
        """The table of a file whose first column is `time`; ValueError naming file, row and remedy."""
        try:
            with path.open(newline="", encoding="utf-8-sig") as file:
                rows = [(n, row) for n, row in enumerate(csv.reader(file), 1) if any(c.strip() for c in row)]
        except OSError as error:
            raise ValueError(f"{path} cannot be read ({(error.strerror or str(error)).lower()}).") from None
        except (csv.Error, UnicodeDecodeError) as error:
            raise ValueError(
                f"{path} is not a readable CSV file ({error}); save it as comma-separated UTF-8."
            ) from None
        header = [c.strip() for c in rows[0][1]] if rows else []
        if len(header) < 2 or header[0] != "time" or len(rows) < 2:
            raise ValueError(f"{path} must have a first row 'time,NAME,...' and at least one row of numbers; add them.")
        values = []
        for n, row in rows[1:]:
            if len(row) != len(header):
                raise ValueError(
                    f"{path} row {n} has {len(row)} cells where the header has {len(header)}; mend the row."
                )
            values.append([_number(path, n, name, cell) for name, cell in zip(header, row, strict=True)])
        table = np.array(values)
        back = np.flatnonzero(np.diff(table[:, 0]) <= 0.0)
        if len(back):
            raise ValueError(f"{path} row {rows[back[0] + 2][0]}: time does not increase; sort the rows by time.")
        if len(set(header)) < len(header):
            raise ValueError(f"{path} row 1 names a column twice; drop one.")
        return cls(str(path), table[:, 0], {name: table[:, k] for k, name in enumerate(header) if k > 0})

    def require(self, participants: Mapping[str, Participant]) -> None:
        """ValueError in one sentence for a column that is no scalar parameter or input of either side."""
        for name in self.columns:
            owners = [p for p in participants.values() if p.causality.get(name) in ("parameter", "input")]
            if not owners:
                known = sorted({b for p in participants.values() for b, c in p.causality.items()
                                if c in ("parameter", "input") and p.blocks[b] == ()})  # fmt: skip
                raise ValueError(f"{self.path} row 1: there is no '{name}'; there are: {', '.join(known)}.")
            if owners[0].blocks[name] != ():
                raise ValueError(f"{self.path} row 1: {name} is no single value; leave it out.")

    def apply(self, participants: Mapping[str, Participant], time: float) -> None:
        """Set all columns to their values at a time s."""
        for name, values in self.columns.items():
            value = np.array(float(np.interp(time, self.times, values)))
            for participant in participants.values():
                if participant.causality.get(name) in ("parameter", "input"):
                    participant.set(name, value)


def _number(path: Path, row: int, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{path} row {row}: {name} '{cell.strip()}' is not a finite number; correct the cell.")
    return value
