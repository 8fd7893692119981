"""Where on each panel the flow is asked for: towards the narrower of its neighbours, as the mesh is graded.

Doublets that are constant on panels are vortices along their edges. Half way between two of them is the right place
only where panels are equally wide. On cosine-spaced ones it is the half angle, a quarter of the panel at its end, and
the lift of a profile is then more than twice as near to its limit as with centres (van Garrel 2003, ECN-C-03-079, has
it of strips along a span).
"""

import numpy as np

CREASED = 0.25  # of a rim: the two sides of a flat tip turn by 180 degrees together, one of them by a crease at least


def collocation_points(body, nodes):
    """Points (m,3) m on the panels of a `Body` on `nodes` (n,3) m; centres of triangles.

    Trailing edges and the rims of `_ends` are ends of the row of panels; a plane of symmetry has the image behind it.
    """
    corners = nodes[body.panels]
    middle = 0.5 * (corners + np.roll(corners, -1, axis=1))  # of the edges (m,4,3)
    width = np.linalg.norm(middle - np.roll(middle, 2, axis=1), axis=2)  # across each edge
    beyond = _beyond(body, width)
    before, after = beyond[:, [3, 0]], beyond[:, [1, 2]]
    xi, eta = _fractions(before, width[:, [1, 2]], after).T[..., None]
    a, b, c, d = np.moveaxis(corners, 1, 0)
    points = (1.0 - eta) * ((1.0 - xi) * a + xi * b) + eta * ((1.0 - xi) * d + xi * c)
    triangle = body.panels[:, 2] == body.panels[:, 3]
    points[triangle] = corners[triangle, :3].mean(axis=1)
    return points


def _beyond(body, width):
    """How wide (m,4) the panel beyond each edge is, across it: NaN beyond ends, as wide as the panel itself beyond a
    plane of symmetry and next to triangles.
    """
    m, edge, end = len(body.panels), body.of_panel, _ends(body)
    sides = body.sides[edge]
    own = np.arange(m)[:, None]
    other = np.where(sides[..., 0] == own, sides[..., 1], sides[..., 0])
    slot = np.argmax(body.of_panel[other] == edge[..., None], axis=2)
    triangle = body.panels[:, 2] == body.panels[:, 3]
    found = np.where((other >= 0) & ~triangle[other], width[other, slot], width)
    return np.where(end[edge], np.nan, found)


def _ends(body):
    """Whether a row of panels ends at each edge, (e,): at trailing edges, at creases beside no strip, and at the rim of
    a strip beside panels of none, a flat tip, where a quarter of it is creased: its whole rim ends then, whether it
    leans to the upper or the lower side.

    Strips go on across the creases between them: a wing folded by just more than the angle of a crease has its points
    where one that is folded by just less has them.
    """
    strip = np.full(len(body.panels) + 1, -1)
    for k, row in enumerate(body.strips):
        strip[row] = k
    sides = strip[body.sides]  # -1 also beyond an open edge
    folded = np.zeros(len(body.edges), bool)
    folded[body.creases] = True
    rim = (np.sum(sides >= 0, axis=1) == 1) & (body.sides[:, 1] >= 0)
    of = sides.max(axis=1)[rim]
    share = np.bincount(of, folded[rim], len(body.strips)) / np.maximum(np.bincount(of, minlength=len(body.strips)), 1)
    end = folded & np.all(sides < 0, axis=1)
    end[rim] = share[of] >= CREASED
    end[body.trailing_edge] = True
    return end


def _fractions(before, width, after):
    """Where along each panel, 0 to 1, from the widths before it, of it and after it, NaN at free ends."""
    to_before, to_after = before / (before + width), width / (width + after)
    inner = 0.25 * (to_before + to_after + 1.0)
    one = np.where(np.isnan(before), to_after, to_before)
    found = np.where(np.isnan(before) | np.isnan(after), one, inner)
    return np.where(np.isnan(found), 0.5, found)
