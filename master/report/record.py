"""What a transient run writes as it advances: rows of a CSV file, and curves for its plots."""

import contextlib
import csv
import io
import os
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

POINTS = 2000  # most of a curve in a plot


class Rows:
    """A CSV file written row by row, each at once and as a whole: who reads it while it grows, or after the run was
    killed, finds all rows so far.
    """

    def __init__(self, path: Path, header: list[str]) -> None:
        self._path, self._file, self._whole = path, path.open("wb", buffering=0), 0
        self.add(header)

    def add(self, row: list[Any]) -> None:
        """One row more; floats keep all their digits. OSError that names the file where the disk is full; no part of
        the row is left then.
        """
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerow(row)
        data = memoryview(text.getvalue().encode())
        whole = self._whole + len(data)
        try:
            with named(self._path):
                while data:
                    data = data[self._file.write(data) :]
            self._whole = whole
        finally:
            if self._whole != whole:
                self._file.truncate(self._whole)

    def close(self) -> None:
        """The end of the file; once is enough."""
        self._file.close()


@contextlib.contextmanager
def named(path: Path) -> Iterator[None]:
    """An OSError on the way names the file that was written."""
    try:
        yield
    except OSError as error:
        raise type(error)(error.errno, error.strerror or str(error), str(path)) from error


LEFT = re.compile(r"\.(.+)\.(\d+)\.(tmp|part)")  # a file under way: its name to be, the process that writes it


def clear_leftovers(folder: Path, names: Collection[str] | None = None) -> None:
    """Remove what processes that no longer live have left half-written in a folder, of files of these names (None: of
    any).
    """
    for path in folder.glob(".*.*"):
        found = LEFT.fullmatch(path.name)
        if found and (names is None or found[1] in names) and not _lives(int(found[2])):
            path.unlink(missing_ok=True)


def _lives(process: int) -> bool:
    if os.name != "posix":  # elsewhere to ask would be to end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # of another user; no process has such a number
        return True
    return True


class Curve:
    """Values over time for a plot, thinned out by half whenever they are more than POINTS."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.values: list[np.ndarray] = []
        self._stride, self._seen = 1, 0

    def add(self, time: float, values: np.ndarray) -> None:
        """One point more."""
        if self._seen % self._stride == 0:
            self.times.append(time)
            self.values.append(values)
        self._seen += 1
        if len(self.times) > POINTS:
            self.times, self.values, self._stride = self.times[::2], self.values[::2], 2 * self._stride
