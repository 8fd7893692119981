"""Sections of an inflatable wing: the profiles of its canopy, column by column (LEI thesis 7.3)."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

COLUMNS = ("column", "arc_m", "y_m", "chord_m", "x_over_c", "z_over_c", "design_x_over_c", "design_z_over_c", "strut")
TIE = 1e-9  # chords; cambers this close are equal, so that rounding does not choose between left and right


@dataclass(frozen=True, eq=False)
class Sections:
    """The columns of a canopy, left tip first, of s nodes from leading to trailing edge.

    `arc` (c,) m along the quarter-chord line from mid-span, right wing positive; `y` (c,) m of the leading edge;
    `chord` (c,) m; `x` along the chord and `z` normal to it, towards suction, both (c,s) in chords, and `design_x` and
    `design_z` those of the design shape; `strut` (c,) bool.
    """

    arc: np.ndarray
    y: np.ndarray
    chord: np.ndarray
    x: np.ndarray
    z: np.ndarray
    design_x: np.ndarray
    design_z: np.ndarray
    strut: np.ndarray

    @property
    def camber(self) -> np.ndarray:
        """The largest distance from the chord with its sign, in chords, (c,)."""
        return _at_most(self.z, self.z)

    @property
    def place(self) -> np.ndarray:
        """Where the camber is, in chords from the leading edge, (c,)."""
        return _at_most(self.z, self.x)

    @property
    def design_camber(self) -> np.ndarray:
        """The camber of the design shape, in chords, (c,)."""
        return _at_most(self.design_z, self.design_z)

    @property
    def most(self) -> int:
        """The column of the largest camber, the first of those that are equal but for rounding."""
        size = np.abs(self.camber)
        return int(np.flatnonzero(size >= size.max() - TIE)[0])

    @property
    def middle(self) -> np.ndarray:
        """The columns in the middle of each bay between struts, both of them where their number is even, (k,)."""
        out: list[int] = []
        for strut, group in groupby(range(len(self.strut)), key=lambda c: bool(self.strut[c])):
            bay = list(group)
            if not strut:
                out += sorted({bay[(len(bay) - 1) // 2], bay[len(bay) // 2]})
        return np.array(out, dtype=int)

    def rows(self) -> Iterator[list[Any]]:
        """The values of COLUMNS, a row per node; columns count from 1, a strut is 1 and any other column 0."""
        for c in range(len(self.chord)):
            for profile in zip(self.x[c], self.z[c], self.design_x[c], self.design_z[c], strict=True):
                numbers = map(float, (self.arc[c], self.y[c], self.chord[c], *profile))
                yield [c + 1, *numbers, int(self.strut[c])]


def _at_most(z: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Of each row (c,s) the value where |z| is largest, (c,)."""
    return np.take_along_axis(values, np.argmax(np.abs(z), axis=1)[:, None], axis=1)[:, 0]


def normals(nodes: np.ndarray) -> np.ndarray:
    """Unit normals (c,3) of the chords of columns of nodes (c,s,3), towards suction.

    n ~ t x e with the chord t from leading to trailing edge and the span direction e from the left neighbour to the
    right one, mean of both edges: the way of the panels' area vectors, turned so that it is normal to the chord.
    """
    span = np.gradient(0.5 * (nodes[:, 0] + nodes[:, -1]), axis=0)  # only its direction counts
    normal = np.cross(nodes[:, -1] - nodes[:, 0], span)
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def profiles(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x/c = r.t / c and z/c = r.n / c, both (c,s), of columns of nodes (c,s,3) m at r from their leading edge."""
    chord = nodes[:, -1] - nodes[:, 0]
    length = np.linalg.norm(chord, axis=1)[:, None]
    offset = (nodes - nodes[:, :1]) / length[..., None]
    x, z = (np.einsum("csk,ck->cs", offset, way) for way in (chord / length, normals(nodes)))
    return x, z


def sections(position: np.ndarray, design: np.ndarray, grid: np.ndarray, strut: np.ndarray) -> Sections:
    """The Sections of the nodes `grid` (c,s), at `position` (n,3) m and in the `design` shape (n,3) m."""
    nodes = position[grid]
    quarter = nodes[:, 0] + 0.25 * (nodes[:, -1] - nodes[:, 0])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(quarter, axis=0), axis=1))])
    chord = np.linalg.norm(nodes[:, -1] - nodes[:, 0], axis=1)
    return Sections(
        arc - 0.5 * arc[-1], nodes[:, 0, 1], chord, *profiles(nodes), *profiles(design[grid]), strut
    )  # fmt: skip


def strut_columns(grid: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Which columns are struts: all their nodes between leading and trailing edge are ends of tubes, (c,) bool."""
    return np.isin(grid[:, 1:-1], ends).all(axis=1) & (grid.shape[1] > 2)


def wing_sections(wing: Any, position: np.ndarray | None) -> Sections | None:
    """The Sections of a `wing` with a grid and tubes, None without one or without a `position` of its nodes."""
    if getattr(wing, "grid", None) is None or position is None or not np.all(np.isfinite(position)):
        return None
    grid = np.asarray(wing.grid)
    return sections(position, wing.nodes, grid, strut_columns(grid, wing.tubes.ends))
