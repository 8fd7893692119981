"""Roll and yaw of a kite held at one node of a tube in the plane of symmetry, and the reactions there."""

from dataclasses import replace

import numpy as np

from ..schema import SceneError

IN_PLANE = 1e-6  # m, as for mirror images


def held_place(scene, members):
    """Node and nodal rotation at which roll and yaw can be held; None where scene.toml names none. The `members` are
    those of the scene in the axes of the kite.
    """
    label = scene.structure.hold
    if label is None:
        return None
    where = f"{scene.name}/scene.toml [structure] hold"
    node = members.node(label, where)
    rotations = np.flatnonzero(members.wing.rotation_nodes == node)
    if len(rotations) != 1:
        raise SceneError(f"{where}: node {label} must be one on a tube, without a hinge; name another.")
    if abs(members.nodes[node, 1]) > IN_PLANE:
        raise SceneError(f"{where}: node {label} must lie in the plane of symmetry (y = 0 of a kite drawn along x).")
    return node, int(rotations[0])


def held_structure(structure, place):
    """The structure with the `place` (node, rotation) held: no side displacement (y), no rotation about z."""
    node, rotation = place
    fixed, fixed_rotations = structure.fixed.copy(), structure.fixed_rotations.copy()
    fixed[node, 1] = fixed_rotations[rotation, 2] = True
    return replace(structure, fixed=fixed, fixed_rotations=fixed_rotations)


def holding_reactions(free, residual, x, place, about):
    """Side force N and moment (3,) N m about `about` (3,) that hold the `place` at positions x (n,3) m.

    They are what the assembly `free`, without the hold, is out of balance by: its `residual` (q,).
    """
    node, rotation = place
    index = free.unknowns.index
    force = float(residual[index[3 * node + 1]])
    yaw = float(residual[index[3 * (len(x) + rotation) + 2]])
    arm = x[node] - about
    return force, np.array([-arm[2] * force, 0.0, arm[0] * force + yaw])


def held_moment(free, residual, place, rotations):
    """Reaction moments (r,3) N m about fixed axes of the held `place`: those of the assembly `free` as above."""
    _, rotation = place
    moment = np.zeros((len(rotations), 3))
    moment[rotation, 2] = residual[free.unknowns.index[len(free.unknowns.base) + 3 * rotation + 2]]
    return moment
