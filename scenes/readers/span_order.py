"""Whether the rows of a table go along a wing, from its left tip to its right one."""

import numpy as np

from ..schema import SceneError
from .tables import Table

# Savings of way, over the whole way, that are more than rounding.
SHORTER = 1e-9
# A wing that closes to a ring may have its tips nearer to each other than neighbouring rows. It never turns by more
# than the angle of this cosine (72 deg in a pentagon), and has no step longer than this many of its median ones.
RING_TURN, RING_STEP = 0.2, 1.5
# Part of the way from left to right, over its length, below which a wing has no left and right across the wind.
ACROSS = 0.1


def check_span_order(table: Table, what: str, edges: np.ndarray, wind: tuple[float, ...]) -> None:
    """`SceneError` in one sentence where rows with these leading and trailing `edges` (2,n,3) m do not go along the
    wing, or from right to left as seen by who faces the wind; `what` they are in the plural.

    The rows are in order where no shorter way along both edges comes of turning a run of rows round, of putting one row
    elsewhere or of beginning at another row. That knows no axis: tips may curl in, stand up or point back, and the wing
    may be drawn at any azimuth. On a straight wing only the order along the span and its reverse are that short.
    """
    places = np.hstack(list(edges))  # (n,6)
    same = np.flatnonzero(np.all(places[1:] == places[:-1], axis=1))
    if len(same):
        raise SceneError(f"{table.at(int(same[0]) + 1)}: both edges are those of the row above; move them or drop it.")
    with np.errstate(all="ignore"):  # beyond all measure a wing is in no order
        found, back = _shortcut(places), _from_the_right(edges.sum(axis=0), wind)
    if found is not None:
        row, words = found
        instead = " ".join(w if isinstance(w, str) else str(table.lines[w]) for w in words)
        raise SceneError(
            f"{table.at(row)}: {what} do not follow each other along the wing, whose leading and trailing edges are "
            f"shorter with {instead}; sort the rows from the left tip to the right one."
        )
    if back:
        where = f"{table.path.parent.name}/{table.path.name}"
        raise SceneError(
            f"{where}: {what} must go from the left tip, as seen facing the wind, to the right one; reverse the rows."
        )


def _shortcut(places):
    """The change of order that saves most of the way along rows (n,6): the row where it goes wrong, and what is better
    as texts and rows; None where no way is shorter.
    """
    last = len(places) - 1
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    step = np.diagonal(apart, 1)
    ring = _is_ring(places, step)
    turned, moved = _turned_runs(apart, step, ring), _moved_rows(apart, step, ring)
    cut = -np.inf if ring else step.max() - apart[0, last]
    least = SHORTER * step.sum()
    best = max(turned.max(), moved.max(), cut)
    if best <= least:
        return None
    if turned.max() >= best - least:
        i, j = (int(k) for k in np.unravel_index(np.argmax(turned), turned.shape))
        return i + 1, ("rows", i, "to", j, "the other way round")
    if cut >= best - least:
        k = int(np.argmax(step))
        return k + 1, ("rows", k + 1, "to", last, "before row", 0)
    k, to = (int(k) for k in np.unravel_index(np.argmax(moved), moved.shape))
    if to in (0, last + 1):
        return k, ("row", k, *(("before row", 0) if to == 0 else ("after row", last)))
    return k, ("row", k, "between rows", to - 1, "and", to)


def _is_ring(places, step):
    """Whether the way never turns sharply and has no step that is long beside the others."""
    way = np.diff(places, axis=0)
    cosine = np.sum(way[1:] * way[:-1], axis=1) / (step[1:] * step[:-1])
    return bool(np.all(cosine > RING_TURN) and step.max() <= RING_STEP * np.median(step))


def _turned_runs(apart, step, ring):
    """What is saved (n,n) m by turning round rows i to j; nothing by joining the tips of a `ring`."""
    n = len(apart)
    into, out = np.concatenate([[0.0], step]), np.concatenate([step, [0.0]])
    saved = np.full((n, n), -np.inf)
    i, j = np.triu_indices(n, 1)
    new_into = np.where(i > 0, apart[i - 1, j], 0.0)
    new_out = np.where(j < n - 1, apart[i, (j + 1) % n], 0.0)
    saved[i, j] = into[i] + out[j] - new_into - new_out
    if ring:
        saved[1, n - 1] = saved[0, n - 2] = -np.inf
    return saved


def _moved_rows(apart, step, ring):
    """What is saved (n,n+1) m by putting row k in front of row `to`, n: at the end; nothing by joining the tips of a
    `ring`.
    """
    n = len(apart)
    before, after = np.arange(n) - 1, (np.arange(n) + 1) % n
    inner = (np.arange(n) > 0) & (np.arange(n) < n - 1)
    gone = np.concatenate([[0.0], step]) + np.concatenate([step, [0.0]]) - np.where(inner, apart[before, after], 0.0)
    come = np.hstack([apart[:, :1], apart[:, :-1] + apart[:, 1:] - step, apart[:, -1:]])
    saved = gone[:, None] - come
    k = np.arange(n)
    saved[k, k] = saved[k, k + 1] = -np.inf  # where it stands already
    if ring:
        saved[0, n - 1 :] = saved[n - 1, :2] = -np.inf
    return saved


def _from_the_right(points, wind):
    """Whether a way through points (n,3) goes to the left across the wind, or, for a wing along the wind, in y."""
    along = (np.arange(len(points)) - 0.5 * (len(points) - 1.0)) @ points
    across = np.array([-wind[1], wind[0], 0.0])
    for axis in (across, np.array([0.0, 1.0, 0.0])):
        part = along @ axis
        if abs(part) > ACROSS * np.linalg.norm(along) * np.linalg.norm(axis):
            return bool(part < 0.0)
    return False  # a wing on end has no left and right
