"""Roll and yaw of a kite held at one node of a tube in the plane of symmetry, and the reactions there."""

from dataclasses import replace

import numpy as np

from ..schema import SceneError


def held_place(scene):
    """Node and frame at which roll and yaw can be held; None where scene.toml names none."""
    label = scene.structure.hold
    if label is None:
        return None
    where, members = f"{scene.name}/scene.toml [structure] hold", scene.members
    node = members.node(label, where)
    frames = np.flatnonzero(members.wing.frames == node)
    if len(frames) != 1:
        raise SceneError(f"{where}: node {label} must be one on a tube, without a hinge; name another.")
    if members.nodes[node, 1] != 0.0:
        raise SceneError(f"{where}: node {label} must lie in the plane y = 0; name another.")
    return node, int(frames[0])


def held_structure(structure, place):
    """The structure with the `place` (node, frame) held: no side displacement (y), no turn about z."""
    node, frame = place
    fixed, clamped = structure.fixed.copy(), structure.clamped.copy()
    fixed[node, 1] = clamped[frame, 2] = True
    return replace(structure, fixed=fixed, clamped=clamped)


def holding_reactions(free, residual, x, place, about):
    """Side force N and moment (3,) N m about `about` (3,) that hold the `place` at positions x (n,3) m.

    They are what the assembly `free`, without the hold, is out of balance by: its `residual` (q,).
    """
    node, frame = place
    index = free.unknowns.index
    force = float(residual[index[3 * node + 1]])
    turn = float(residual[index[3 * (len(x) + frame) + 2]])
    arm = x[node] - about
    return force, np.array([-arm[2] * force, 0.0, arm[0] * force + turn])


def held_moment(free, residual, place, rotations):
    """Moments (r,3) N m about fixed axes on the frames that hold the `place`: of the assembly `free` as above."""
    _, frame = place
    moment = np.zeros((len(rotations), 3))
    moment[frame, 2] = residual[free.unknowns.index[len(free.unknowns.base) + 3 * frame + 2]]
    return moment
