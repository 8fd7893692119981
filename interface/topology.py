"""How the faces of a surface turn, of whatever number of corners, from which of them are neighbours; words for counts.

scipy loads only where a surface is looked at.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Turning:
    """The `patch` (m,) of each face, numbered as they first occur; `flip` (m,) the faces to turn over so that
    neighbours agree, the fewer of each patch; `orientable` (patches,).
    """

    patch: np.ndarray
    flip: np.ndarray
    orientable: np.ndarray


def turning(count, one, other, agree):
    """Which of `count` faces to turn over, from neighbours `one` and `other` (p,) and whether these `agree` (p,).

    Nothing is to be turned in a patch of one side only, such as a Moebius strip. Every face stands twice in a graph, as
    it is and turned over; whoever hangs together there agrees.
    """
    m = count
    rows = np.concatenate([one, one + m])
    columns = np.concatenate([np.where(agree, other, other + m), np.where(agree, other + m, other)])
    state = connected(2 * m, rows, columns)
    patch = connected(m, one, other)
    first = np.unique(patch, return_index=True)[1]
    orientable = (state[:m] != state[m:])[first]
    flip = (state[:m] != state[first][patch]) & orientable[patch]
    size = np.bincount(patch)
    flip ^= (2 * np.bincount(patch, flip) > size)[patch]
    return Turning(patch, flip, orientable)


def connected(count, one, other):
    """Which connected part (count,) each of `count` things is in whose neighbours are the pairs `one`, `other` (p,);
    numbered as they first occur.
    """
    import scipy.sparse as sp
    from scipy.sparse.csgraph import connected_components

    graph = sp.coo_array((np.ones(len(one)), (one, other)), shape=(count, count))
    return in_order(connected_components(graph, directed=False)[1])


def in_order(labels):
    """Labels renumbered 0, 1, 2 ... as they first occur."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=int)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse.ravel()]


def distinct_pairs(pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The distinct rows (u,2) of pairs (p,2) of node indices, ascending, where each stands first (u,), and which of
    them each pair is (p,).
    """
    base = int(pairs.max(initial=0)) + 1  # one number a pair: several times faster to sort than rows
    _, first, which = np.unique(pairs[:, 0] * base + pairs[:, 1], return_index=True, return_inverse=True)
    return pairs[first], first, which


def listed(numbers: np.ndarray, most: int = 5) -> str:
    """' 7', 's 7, 9 and 12' or 's 7, 9, 12, 15, 16 and 31 more', to stand behind a noun."""
    texts = [str(n) for n in numbers]
    if len(texts) == 1:
        return f" {texts[0]}"
    if len(texts) <= most:
        return f"s {', '.join(texts[:-1])} and {texts[-1]}"
    return f"s {', '.join(texts[:most])} and {len(texts) - most} more"


def agreed(count: int, one: str, many: str) -> str:
    """The word for one thing or for many."""
    return one if count == 1 else many
