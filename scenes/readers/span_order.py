"""Whether the rows of a table go along a wing, from its left tip to its right one."""

import numpy as np

from ..schema import SceneError
from .tables import Table

# Savings of way, over the whole way, that are more than rounding.
SHORTER = 1e-9
# A wing that closes to a ring may have its tips nearer to each other than neighbouring rows. It never turns by more
# than the angle of this cosine (102 deg), and has no step longer than this many of the longer one beside it.
RING_TURN, RING_STEP = -0.2, 1.5
# Difference of distances, over the mean step, below which a wing is its own mirror image.
MIRRORED = 0.05
# Least bulge, see `_bulge`, of a wing that may close below: about half a circle.
CLOSING = 0.6
# Part of the way by which the middle of it may be beside the plane between the tips, for rows of uneven spacing.
ASIDE = 0.15
# A step this many times as long as the longer one beside it can only lie between two tips, where the wing closes.
TIP_GAP = 2.0
# Part of the way from left to right, over its length, below which a wing has no left and right across the wind.
ACROSS = 0.1


def check_span_order(table: Table, what: str, edges: np.ndarray, wind: tuple[float, ...]) -> None:
    """`SceneError` in one sentence where rows with these leading and trailing `edges` (2,n,3) m do not go along the
    wing, or from right to left as seen by who faces the wind; `what` they are in the plural.

    The rows are in order where no shorter way along both edges comes of turning a run of rows round, of putting one row
    elsewhere or of beginning at another row. That knows no axis: tips may curl in, stand up or point back, and the wing
    may be drawn at any azimuth. On a straight wing only the order along the span and its reverse are that short.

    Tips that nearly meet may be nearer to each other than neighbouring rows, and a way across them is shorter without
    being better. So it counts for nothing where the rows can begin and end as they do (`_may_end_here`).
    """
    places = np.hstack(list(edges))  # (n,6)
    same = np.flatnonzero(np.all(places[1:] == places[:-1], axis=1))
    if len(same):
        raise SceneError(f"{table.at(int(same[0]) + 1)}: both edges are those of the row above; move them or drop it.")
    with np.errstate(all="ignore"):  # beyond all measure a wing is in no order
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        tip = _tip_within(edges, apart, wind)
        found = _shortcut(edges, apart, wind) if tip is None else None
        back = _from_the_right(edges.sum(axis=0), wind)
    if found is not None:
        row, words = found
        instead = " ".join(w if isinstance(w, str) else str(table.lines[w]) for w in words)
        raise SceneError(
            f"{table.at(row)}: {what} do not follow each other along the wing, whose leading and trailing edges are "
            f"shorter with {instead}; sort the rows from the left tip to the right one."
        )
    if tip is not None:
        raise SceneError(
            f"{table.at(tip)}: {what} begin and end within the wing, whose tips are rows {table.lines[tip]} and "
            f"{table.lines[tip + 1]} by the gap between them; sort the rows from the left tip to the right one."
        )
    if back:
        where = f"{table.path.parent.name}/{table.path.name}"
        raise SceneError(
            f"{where}: {what} must go from the left tip, as seen facing the wind, to the right one; reverse the rows."
        )


def _shortcut(edges, apart, wind):
    """The change of order that saves most of the way along rows with `edges` (2,n,3): the row where it goes wrong, and
    what is better as texts and rows; None where no way is shorter.
    """
    last = len(apart) - 1
    step = np.diagonal(apart, 1)
    free = _may_end_here(edges, apart, wind)
    turned, moved = _turned_runs(apart, step, free), _moved_rows(apart, step, free)
    cut = -np.inf if free else step.max() - apart[0, last]
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


def _may_end_here(edges, apart, wind):
    """Whether a way that closes may have its tips where the rows with `edges` (2,n,3) begin and end.

    On a wing that is its own mirror image the tips are opposite the middle, on the hollow side. Any other must be a way
    without sharp turns, and no bay of it may look like a gap between tips, unless the one between first and last does
    more so.
    """
    if _is_mirror_wing(edges, apart, wind):
        return True
    way, step = np.diff(np.hstack(list(edges)), axis=0), np.diagonal(apart, 1)
    cosine = np.sum(way[1:] * way[:-1], axis=1) / (step[1:] * step[:-1])
    gap = _gaps(apart)
    return bool(np.all(cosine > RING_TURN) and gap[:-1].max() <= max(RING_STEP, gap[-1]))


def _tip_within(edges, apart, wind):
    """The row that is a tip, and the next one the other, of a wing that closes and whose rows begin elsewhere; None
    where that cannot be told.

    Between the tips is a step far longer than those beside it, as the one between first and last row is not though it
    is no shorter: beginning there saves no way (what does is a `_shortcut`). From there the rows are in order and make
    a mirror wing, which they do not from the first row.
    """
    gap = _gaps(apart)
    k = int(np.argmax(gap[:-1]))
    if gap[k] < TIP_GAP * max(gap[-1], 1.0) or apart[k, k + 1] > apart[0, -1] or _is_mirror_wing(edges, apart, wind):
        return None
    order = np.roll(np.arange(len(apart)), -k - 1)
    whole = edges[:, order], apart[np.ix_(order, order)], wind
    return k if _is_mirror_wing(*whole) and _shortcut(*whole) is None else None


def _is_mirror_wing(edges, apart, wind):
    """Whether a wing bulges to the side of its lift, and its rows, or its tips across the wind, are mirror images."""
    bulge = _bulge(edges) * (-1.0 if _from_the_right(edges.sum(axis=0), wind) else 1.0)
    if not bulge > CLOSING:
        return False
    near = MIRRORED * np.diagonal(apart, 1).mean()
    return bool(np.abs(apart - apart[::-1, ::-1]).max() <= near or _has_even_tips(edges, wind, near))


def _has_even_tips(edges, wind, near):
    """Whether first and last row are images of each other across the wind to `near` m, in a plane through the middle
    of the way; rows between may stand anywhere. Not told for wind along z, which leaves no direction across.
    """
    across = np.array([-wind[1], wind[0], 0.0])
    length = np.linalg.norm(across)
    if length <= ACROSS * np.linalg.norm(wind):
        return False
    across = across / length
    apart = edges[:, -1] - edges[:, 0]
    level = np.linalg.norm(apart - np.outer(apart @ across, across), axis=1)
    plane = 0.5 * (edges[:, -1] + edges[:, 0]) @ across
    at = edges.mean(axis=0) @ across
    step = np.linalg.norm(np.diff(edges.mean(axis=0), axis=0), axis=1)
    aside = abs(np.average(0.5 * (at[1:] + at[:-1]), weights=step) - plane.mean())
    return level.max() <= near and abs(plane[1] - plane[0]) <= near and aside <= ASIDE * step.sum()


def _gaps(apart):
    """Every step of the closed way (n,), the one from last to first row at the end, over the longer of its two
    neighbours.
    """
    closed = np.append(np.diagonal(apart, 1), apart[0, -1])
    return closed / np.maximum(np.roll(closed, 1), np.roll(closed, -1))


def _bulge(edges):
    """How far a wing with `edges` (2,n,3), taken from left to right, bulges to the side to which its strips lift at a
    positive angle of attack, chord times span: 1 for an arc that closes, 0 for a flat wing, below 0 for end plates up.
    """
    le, te = edges
    middle = 0.5 * (le + te)
    chord = (te - le)[1:] + (te - le)[:-1]
    lift = np.cross(chord, np.diff(middle, axis=0))
    bay = 0.5 * (middle[1:] + middle[:-1])
    out = bay - bay.mean(axis=0)
    return np.sum(lift * out) / np.sum(np.linalg.norm(lift, axis=1) * np.linalg.norm(out, axis=1))


def _round_the_tips(apart, step):
    """Pairs of rows (n,n) between which the way is shorter across the tips than along the wing."""
    at = np.concatenate([[0.0], np.cumsum(step)])
    along = np.abs(at[:, None] - at)
    return at[-1] + apart[0, -1] - along < along


def _turned_runs(apart, step, free):
    """What is saved (n,n) m by turning round rows i to j; with `free` tips a pair across them must shorten the closed
    way too.
    """
    n = len(apart)
    into, out = np.concatenate([[0.0], step]), np.concatenate([step, [0.0]])
    saved = np.full((n, n), -np.inf)
    i, j = np.triu_indices(n, 1)
    new_into = np.where(i > 0, apart[i - 1, j], 0.0)
    new_out = np.where(j < n - 1, apart[i, (j + 1) % n], 0.0)
    saved[i, j] = into[i] + out[j] - new_into - new_out
    if free:
        across = _round_the_tips(apart, step)
        ends = apart[0, -1] - apart[np.where(i > 0, 0, j), np.where(j < n - 1, n - 1, i)]
        joined = ((i > 0) & across[i - 1, j]) | ((j < n - 1) & across[i, (j + 1) % n])
        saved[i, j] = np.where(joined, np.minimum(saved[i, j], saved[i, j] + ends), saved[i, j])
    return saved


def _moved_rows(apart, step, free):
    """What is saved (n,n+1) m by putting row k in front of row `to`, n: at the end; with `free` tips a pair across them
    must shorten the closed way too.
    """
    n = len(apart)
    before, after = np.arange(n) - 1, (np.arange(n) + 1) % n
    inner = (np.arange(n) > 0) & (np.arange(n) < n - 1)
    gone = np.concatenate([[0.0], step]) + np.concatenate([step, [0.0]]) - np.where(inner, apart[before, after], 0.0)
    come = np.hstack([apart[:, :1], apart[:, :-1] + apart[:, 1:] - step, apart[:, -1:]])
    saved = gone[:, None] - come
    k = np.arange(n)
    saved[k, k] = saved[k, k + 1] = -np.inf  # where it stands already
    if free:
        across = _round_the_tips(apart, step)
        first, last = np.zeros((n, n + 1), int), np.full((n, n + 1), n - 1)
        first[0], last[n - 1] = 1, n - 2
        first[:, 0], last[:, n] = k, k
        ends = apart[0, -1] - apart[first, last]
        hole = inner & across[before, after]
        joined = hole[:, None] | np.hstack([across[:, :1], across[:, :-1] | across[:, 1:], across[:, -1:]])
        saved = np.where(joined, np.minimum(saved, saved + ends), saved)
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
