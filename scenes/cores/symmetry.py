"""Whether a loaded structure is its own mirror image in y = 0, so that one half gives the whole answer."""

import numpy as np

from interface.mirror import MIRROR, canonical_chains, canonical_faces, mirror_permutation, mirror_rows
from structural.dofs import rotation_images

# What still counts as symmetric: loads of mirrored panels and nodes that differ by the rounding of an aerodynamic
# solve relative to the largest, and positions that differ by what a solver tolerance of 1e-4 N leaves open (m).
LOAD_ASYMMETRY, POSITION_ASYMMETRY = 1e-9, 1e-6
# Of properties of elements, over the largest of their kind: what turning leaves of springs between points of 10 m.
PROPERTY_ASYMMETRY = 1e-10


def mirror_images(interface):
    """Rows of the mirror images of every panel and of every exposed line, or None where one has no image."""
    nodes = mirror_permutation(interface.nodes)
    if nodes is None:
        return None
    panels = mirror_rows(interface.panels, nodes, canonical_faces)
    lines = mirror_rows(interface.lines, nodes, canonical_chains)
    return None if np.any(panels < 0) or np.any(lines < 0) else (panels, lines)


def unlike(values, images):
    """Where properties (e,...) differ from those of the mirror images (e,...) by more than rounding, which lengths that
    were measured between turned points have.
    """
    apart = np.abs(np.asarray(values, float) - images)
    return apart > PROPERTY_ASYMMETRY * np.abs(values).max(initial=0.0)


def symmetric_groups(groups, mirror, rotation_nodes):
    """Whether every element has a mirror image with the same properties, `mirror` (n,) being that of the nodes and
    `rotation_nodes` (r,) the nodes of the nodal rotations.
    """
    try:
        rotations = rotation_images(rotation_nodes, mirror)
    except ValueError:
        return False
    for group in groups:
        rows = group.images(mirror, rotations)
        if np.any(rows < 0) or any(unlike(a, a[rows]).any() for a in group.properties().values()):
            return False
    return True


def symmetric_state(loads, x, mirror, images):
    """Whether loads and positions x (n,3) m are mirror-symmetric: `mirror` (n,) of the nodes, `images` as above."""
    if images is None:
        return False
    panels, lines = images

    def mirrored(values, image, sign=1.0, scale=None):
        odd = np.abs(values - values[image] * sign).max(initial=0.0)
        return odd <= LOAD_ASYMMETRY * (np.abs(values).max(initial=0.0) if scale is None else scale)

    faces, along = loads.on.get("panels"), loads.on.get("lines")
    given = [a for a in (faces.pressure, faces.shear) if a is not None] if faces is not None else []
    scale = max((np.abs(a).max(initial=0.0) for a in given), default=0.0)
    return (
        (faces is None or mirrored(faces.pressure, panels, scale=scale))
        and (faces is None or faces.shear is None or mirrored(faces.shear, panels, MIRROR, scale))
        and (along is None or mirrored(along.per_length, lines, MIRROR))
        and mirrored(loads.dead, mirror, MIRROR)
        and np.abs(x - x[mirror] * MIRROR).max() <= POSITION_ASYMMETRY
    )
