"""Profiles from files of coordinates, as collections of airfoils have them: in the order of Selig or of Lednicer."""

from pathlib import Path

import numpy as np

from ..builders.profiles import Profile, from_coordinates
from ..schema import SceneError


def read_profile(path: Path) -> Profile:
    """The profile of a file with a pair x, z of coordinates in each row, its name in the first one.

    Selig: from the trailing edge round the nose back to it, either way. Lednicer: both sides from the nose to the
    trailing edge, after a row with the numbers of their points, or apart by an empty row. Rows that begin with # are
    left out. SceneError in one sentence for whatever does not fit.
    """
    label = f"{path.parent.name}/{path.name}"
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise SceneError(f"{label} does not exist; add the file or correct its name.") from None
    except (ValueError, OSError) as error:
        reason = " ".join(str(error).split())
        raise SceneError(f"{label} is not a readable text ({reason}); save it as UTF-8.") from None
    name, blocks = _blocks(label, text.splitlines())
    try:
        return from_coordinates(_round(label, blocks), name or path.stem)
    except ValueError as error:
        raise SceneError(f"{label}: {error}") from None


def _blocks(label: str, lines: list[str]) -> tuple[str, list[list[tuple[float, float]]]]:
    """The name, and the rows of numbers in blocks between empty rows."""
    name, blocks, last = "", [[]], len(lines)  # type: str, list[list[tuple[float, float]]], int
    for k in range(last):
        words = lines[k].replace(",", " ").replace(";", " ").split()
        if not words or words[0].startswith("#"):
            blocks += [[]] if not words else []
            continue
        try:
            x, z = map(float, words)
        except ValueError:
            if any(blocks) or name:
                raise SceneError(
                    f"{label} row {k + 1}: '{lines[k].strip()[:40]}' is no pair of numbers x, z; correct the row."
                ) from None
            name = " ".join(lines[k].split())
            continue
        blocks[-1].append((x, z))
    return name, [block for block in blocks if block]


def _round(label: str, blocks: list[list[tuple[float, float]]]) -> np.ndarray:
    """Points (k,2) from the trailing edge over the first side and back along the second one."""
    rows = [row for block in blocks for row in block]
    if rows and min(rows[0]) > 1.5 and all(v.is_integer() for v in rows[0]):
        first, second = map(int, rows[0])
        if first + second != len(rows) - 1:
            raise SceneError(
                f"{label} says that {first} and {second} points follow, but {len(rows) - 1} do; correct it."
            )
        return _joined(rows[1 : 1 + first], rows[1 + first :])
    if len(blocks) == 2 and all(block[0][0] < block[-1][0] for block in blocks):
        return _joined(*blocks)
    return np.array(rows).reshape(-1, 2)


def _joined(upper: list[tuple[float, float]], lower: list[tuple[float, float]]) -> np.ndarray:
    """Both sides, each from the nose to the trailing edge, as one line round the profile."""
    return np.array([*upper[::-1], *(lower[1:] if lower[0] == upper[0] else lower)])
