"""CSV tables of a scene, read with errors that name file, row and remedy."""

import csv
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from interface import irregular, misnamed, unprintable

from ..schema import LARGEST, SceneError


def require_own(path: Path, label: str) -> None:
    """SceneError for a file of a scene that is no regular one, or a link to something outside of the scene's folder."""
    if what := irregular(path):
        raise SceneError(f"{label} is {what}; put a regular file in its place.")
    if path.is_symlink() and not path.resolve().is_relative_to(path.parent.resolve()):
        raise SceneError(f"{label} is a link to {path.resolve()}, outside of the scene; put a copy in its place.")


def number(text: str) -> float:
    """A finite number; `1e4` and `10000.0` alike."""
    value = float(text)
    if not abs(value) <= LARGEST:
        raise ValueError
    return value


def positive(text: str) -> float:
    """A finite number above zero."""
    value = number(text)
    if value < 1.0 / LARGEST:
        raise ValueError
    return value


def chord_length(text: str) -> float:
    """A finite number above zero, of a section that is no point."""
    return positive(text)


def non_negative(text: str) -> float:
    """A finite number, zero or more."""
    value = number(text)
    if value < 0.0:
        raise ValueError
    return value


def whole(text: str) -> int:
    """A whole number."""
    return int(text)


def name(text: str) -> str:
    """A name without blanks, which every table can hold."""
    if not text or " " in text or misnamed(text):
        raise ValueError
    return text


def names(text: str) -> tuple[str, ...]:
    """Names separated by blanks."""
    if any(misnamed(part) for part in text.split()):
        raise ValueError
    return tuple(text.split())


_MEANING: dict[Callable[[str], Any], str] = {
    number: f"a finite number of at most {LARGEST:g}",
    positive: f"a number above zero, from {1.0 / LARGEST:g} to {LARGEST:g}",
    chord_length: f"a number above zero, from {1.0 / LARGEST:g} to {LARGEST:g} (cut a tip that ends in a point where "
    "its chord is a twentieth of that in the middle)",
    non_negative: f"a number, zero or more, of at most {LARGEST:g}",
    whole: "a whole number",
    name: "a name without blanks and control characters that begins with none of = + - @",
    names: "names separated by blanks, without control characters, none of which begins with = + - @",
}


class Table:
    """Columns of one CSV file, and `at(row)` to say where a row stands."""

    def __init__(self, path: Path, columns: dict[str, list[Any]], lines: list[int]):
        self.path = path
        self.columns = columns
        self.lines = lines

    def __getitem__(self, column: str) -> list[Any]:
        return self.columns[column]

    def __len__(self) -> int:
        return len(self.lines)

    def at(self, row: int) -> str:
        """File and row number as an editor counts it."""
        return f"{self.path.parent.name}/{self.path.name} row {self.lines[row]}"


def _numbered(reader: Any) -> list[tuple[int, list[str]]]:
    """The rows with content, each with the line of the file where it begins."""
    rows, begin = [], 1
    for row in reader:
        if any(map(str.strip, row)):
            rows.append((begin, row))
        begin = reader.line_num + 1
    return rows


def read_table(path: Path, columns: Mapping[str, Callable[[str], Any]]) -> Table:
    """The named columns of a CSV file with a header row; raises `SceneError` for whatever does not fit."""
    label = f"{path.parent.name}/{path.name}"
    require_own(path, label)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = _numbered(csv.reader(file, strict=True))
    except FileNotFoundError:
        raise SceneError(f"{label} does not exist; add the file or correct its name in scene.toml.") from None
    except (csv.Error, ValueError, OSError) as error:  # Unicode errors and impossible names are ValueErrors
        reason = " ".join(str(error).split())
        raise SceneError(f"{label} is not a readable CSV file ({reason}); save it as comma-separated UTF-8.") from None
    if not rows:
        raise SceneError(f"{label} is empty; its first row must be: {','.join(columns)}.")
    header = [cell.strip() for cell in rows[0][1]]
    missing = [c for c in columns if c not in header]
    if missing:
        hint = " (it has semicolons; separate by commas)" if any(";" in cell for cell in header) else ""
        raise SceneError(
            f"{label} row 1 has no column '{missing[0]}'{hint}; the header must name: {','.join(columns)}."
        )
    if len(rows) == 1:
        raise SceneError(f"{label} has a header but no rows; add at least one.")
    place = {c: header.index(c) for c in columns}
    try:
        if any(len(row) != len(header) for _, row in rows[1:]):
            raise ValueError
        values = {c: [convert(row[place[c]].strip()) for _, row in rows[1:]] for c, convert in columns.items()}
    except ValueError:
        raise SceneError(_first_fault(label, header, rows[1:], columns)) from None
    return Table(path, values, [line for line, _ in rows[1:]])


def _first_fault(
    label: str, header: list[str], rows: list[tuple[int, list[str]]], columns: Mapping[str, Callable[[str], Any]]
) -> str:
    """What is wrong in the first of the rows that is, and the remedy."""
    for line, row in rows:
        if len(row) != len(header):
            return f"{label} row {line} has {len(row)} cells where the header has {len(header)}; mend the row."
        for column, convert in columns.items():
            cell = row[header.index(column)].strip()
            shown = repr(cell) if unprintable(cell) else f"'{cell}'"
            try:
                convert(cell)
            except ValueError:
                meaning = _MEANING.get(convert, "a valid value")
                return f"{label} row {line}: {column} {shown} is not {meaning}; correct the cell."
    return f"{label} has a row that cannot be read; correct it."
