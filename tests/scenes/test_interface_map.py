"""Loads and motions through the map between interface and structure."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import scenes
from scenes.builders.interface import design_interface, with_lines
from structural import (
    Assembly,
    Chains,
    Loads,
    Structure,
    interface_groups,
    interface_loads,
    mirror_permutation,
    surface_forces,
)

CASES = [("v3_kite", {"chord": c, "panels_per_section": n}) for c in ("structural", "design") for n in (1, 2, 3, 5)]
CASES += [("typical_section", {"panels_per_section": 3})]
CASES += [
    ("v3_kite_detailed", {"canopy_stations": k, "canopy_subdivisions": m}) for k, m in ((2, 1), (3, 2), (6, 1), (10, 1))
]
TURNS = [Rotation.identity()] + [
    Rotation.from_rotvec(np.deg2rad(30.0) * np.array(a) / np.linalg.norm(a))
    for a in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, -2, 0.5])
]


def _nodal_forces(scene, x, pressure, shear):
    """Forces (n,3) N that the solver's own assembly puts on the structural nodes, supports lifted."""
    m, i = scene.members, scene.interface
    slack = Chains(m.chains[0].nodes[:1], np.array([1e6]), np.array([1.0]), np.array([False]))
    s = Structure(m.nodes, np.zeros_like(m.fixed), (slack,), interface_groups(i.weights, i.panels))
    assembly = Assembly(s)
    loads = Loads(0.0 * x, interface_loads(pressure, shear))
    r, _ = assembly.residual(assembly.unknowns.restrict(x), assembly.prepare(loads))
    return -r[assembly.unknowns.index].reshape(-1, 3)


@pytest.mark.parametrize(
    ("name", "settings"), CASES, ids=lambda c: c if isinstance(c, str) else "-".join(map(str, c.values()))
)
@pytest.mark.parametrize("turn", range(len(TURNS)), ids=["at rest", "x", "y", "z", "skew"])
def test_force_moment_and_virtual_work_pass_the_map_unchanged(name, settings, turn):
    scene = scenes.load(name, settings)
    i = scene.interface
    rng = np.random.default_rng(turn)
    x = TURNS[turn].apply(scene.members.nodes) + rng.normal(scale=2.0, size=3)
    x = x + rng.normal(scale=0.05, size=x.shape)  # deformed as well as turned
    pressure, shear = rng.normal(scale=100.0, size=len(i.panels)), rng.normal(scale=20.0, size=(len(i.panels), 3))
    points = i.weights @ x
    on_panels = surface_forces(points[i.panels], pressure, shear)
    on_nodes = _nodal_forces(scene, x, pressure, shear)
    # rounding: sums of some hundred products of forces with arms of 12 m, and weights of the design chord of order one
    size = 1e-13 * np.abs(on_panels).sum()
    assert np.abs(on_nodes.sum(axis=0) - on_panels.sum(axis=(0, 1))).max() <= size
    moment = np.cross(points[i.panels], on_panels).sum(axis=(0, 1))
    assert np.abs(np.cross(x, on_nodes).sum(axis=0) - moment).max() <= 15.0 * size
    move = rng.normal(size=x.shape)
    work = np.sum((i.weights @ move)[i.panels] * on_panels)
    assert abs(np.sum(move * on_nodes) - work) <= 5.0 * size


@pytest.mark.parametrize(
    ("name", "settings"), CASES, ids=lambda c: c if isinstance(c, str) else "-".join(map(str, c.values()))
)
def test_interface_moves_rigidly_with_a_rigid_structure(name, settings):
    scene = scenes.load(name, settings)
    i, shift = scene.interface, np.array([1.0, -2.0, 3.0])
    for turn in TURNS:
        x = turn.apply(scene.members.nodes) + shift
        assert np.abs(i.weights @ x - (turn.apply(i.nodes) + shift)).max() <= 1e-13 * 20.0  # rounding at 20 m


@pytest.mark.parametrize(
    ("name", "settings"), CASES, ids=lambda c: c if isinstance(c, str) else "-".join(map(str, c.values()))
)
def test_pressure_on_the_structure_turns_with_it_and_shear_does_not(name, settings):
    scene = scenes.load(name, settings)
    rng = np.random.default_rng(1)
    panels = len(scene.interface.panels)
    pressure, shear = rng.normal(scale=100.0, size=panels), rng.normal(scale=20.0, size=(panels, 3))
    x = scene.members.nodes
    rest = _nodal_forces(scene, x, pressure, None)
    dragged = _nodal_forces(scene, x, 0.0 * pressure, shear)
    for turn in TURNS[1:]:
        size = 1e-12 * np.abs(rest).sum()  # rounding of turned coordinates of 12 m in small panels
        assert np.abs(_nodal_forces(scene, turn.apply(x), pressure, None) - turn.apply(rest)).max() <= size
        assert np.abs(_nodal_forces(scene, turn.apply(x), 0.0 * pressure, shear) - dragged).max() <= size


def test_strips_cut_finer_carry_the_same_uniform_pressure():
    forces = []
    for n in (1, 2, 4, 8):
        scene = scenes.load("v3_kite", {"panels_per_section": n})
        panels = len(scene.interface.panels)
        forces.append(_nodal_forces(scene, scene.members.nodes, np.full(panels, 100.0), None))
    # the bays are ruled surfaces, whose area vector and first moments do not depend on how finely they are cut
    assert np.abs(forces[0].sum(axis=0) - forces[-1].sum(axis=0)).max() <= 1e-12 * np.abs(forces[0]).sum()
    change = [np.abs(f - forces[-1]).max() for f in forces[:-1]]
    # shares of warped panels differ by their warp along the area vector, which falls with the square of the width
    assert change[1] < 0.5 * change[0]
    assert change[2] < 0.5 * change[1]


def test_lines_share_the_nodes_of_design_sections_that_stand_on_the_struts():
    # the weights are units but for rounding, which differs from side to side
    scene = scenes.load("v3_kite")
    nodes, struts = scene.members.nodes, scene.struts
    bare = design_interface(nodes, struts, nodes[struts[:, 0]], nodes[struts[:, 1]], 1)
    full = with_lines(bare, nodes, *scene.members.line_legs())
    assert mirror_permutation(full.nodes) is not None
    assert len(np.unique(full.nodes.round(9), axis=0)) == len(full.nodes)
    assert np.abs(full.weights @ nodes - full.nodes).max() <= 1e-12 * 11.0  # rounding of 11 m
