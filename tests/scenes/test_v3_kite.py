"""Facts of the V3 kite scene that its sources and its mirror symmetry fix."""

import itertools

import numpy as np
import pytest

import scenes
from structural import mirror_permutation

SETTINGS = [
    {"chord": chord, "panels_per_section": panels} for chord in ("structural", "design") for panels in (1, 2, 3, 4)
]


@pytest.fixture(scope="module")
def kite():
    return scenes.load("v3_kite")


def test_kite_has_38_nodes_in_mirrored_pairs(kite):
    nodes = kite.members.nodes
    assert len(nodes) == 38
    image = mirror_permutation(nodes, 1e-12)
    assert image is not None
    assert np.count_nonzero(image == np.arange(38)) == 2  # bridle point and power tape knot lie in the plane
    assert np.array_equal(nodes[image], nodes * [1, -1, 1])


def test_lumped_masses_are_mirror_symmetric(kite):
    m = kite.members
    image = mirror_permutation(m.nodes)
    # sums of leg shares in different order: rounding of 1 kg
    assert np.abs(m.mass - m.mass[image]).max() <= 1e-12
    assert np.abs(m.wing_mass - m.wing_mass[image]).max() <= 1e-12


def test_masses_add_up(kite):
    m = kite.members
    assert m.wing_mass.sum() == pytest.approx(22.6, abs=1e-12)  # the springs of the source table, rounding
    lines = 724.0 * sum(a * l for a, l in zip(m.area, np.concatenate([c.l0 for c in m.chains]), strict=True))
    pulleys_and_kcu = 6 * 0.1 + 8.4
    assert m.mass.sum() == pytest.approx(22.6 + pulleys_and_kcu + lines, abs=1e-12)
    assert m.mass.min() > 0.0


def test_elements_are_mirrored_with_their_rest_lengths_and_stiffnesses(kite):
    m = kite.members
    image = mirror_permutation(m.nodes)
    for group in m.chains:
        there = {tuple(n): (l0, k) for n, l0, k in zip(group.nodes.tolist(), group.l0, group.k, strict=True)}
        for nodes, l0, k in zip(group.nodes, group.l0, group.k, strict=True):
            path = image[nodes].tolist()
            assert there.get(tuple(path), there.get(tuple(path[::-1]))) == (l0, k)


def test_line_stiffness_is_modulus_times_area_over_rest_length(kite):
    m = kite.members
    names = list(m.names)
    k = np.concatenate([c.k for c in m.chains])
    l0 = np.concatenate([c.l0 for c in m.chains])
    for name, length, diameter in (
        ("power_tape", 3.129, 0.002),
        ("amain_left", 4.297, 0.005),
        ("a6_right", 11.372, 0.002),
    ):
        i = names.index(name)
        assert l0[i] == length
        assert k[i] == pytest.approx(0.55e9 * np.pi * diameter**2 / 4.0 / length, rel=1e-14)
    assert len(names) == len(set(names)) == 46 + 37


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: f"{s['chord']}-{s['panels_per_section']}")
def test_map_returns_the_interface_in_the_reference_configuration(settings):
    scene = scenes.load("v3_kite", settings)
    i, nodes = scene.interface, scene.members.nodes
    # affine combinations of coordinates of 11 m: rounding
    assert np.abs(i.weights @ nodes - i.nodes).max() <= 1e-13 * 11.0
    assert np.abs(np.asarray(i.weights.sum(axis=1)) - 1.0).max() <= 1e-13
    per_bay = settings["panels_per_section"]
    assert len(i.panels) == 2 * 9 * per_bay
    on_the_wing = 3 * (9 * per_bay + 1)
    assert np.array_equal(np.unique(i.sections), np.arange(on_the_wing))
    assert len(scenes.load("v3_kite", {**settings, "line_drag": "off"}).interface.nodes) == on_the_wing
    core = scene.structural_core()
    assert np.abs(core.get("displacement")).max() <= 1e-13 * 11.0


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: f"{s['chord']}-{s['panels_per_section']}")
def test_every_leg_of_the_bridle_stands_in_the_wind_once_between_its_structural_nodes(settings):
    scene = scenes.load("v3_kite", settings)
    i, m = scene.interface, scene.members
    ropes = [nodes for c in m.chains for nodes, two_way in zip(c.nodes, c.two_way, strict=True) if not two_way]
    legs = [frozenset(pair) for nodes in ropes for pair in itertools.pairwise(nodes.tolist())]
    assert len(i.lines) == len(legs) == 37 + 6  # 37 lines, six of which run over a sheave
    of_node = i.weights[i.lines.ravel()].toarray()
    assert np.array_equal(np.sort(of_node, axis=1)[:, -2:], np.tile([0.0, 1.0], (len(of_node), 1)))
    assert [frozenset(pair) for pair in of_node.argmax(axis=1).reshape(-1, 2).tolist()] == legs
    # diameters of the line table: 5 mm from the pulleys down, 2 mm else
    assert set(np.round(i.diameter, 12)) == {0.002, 0.005}
    if settings["chord"] == "structural":  # a line ends at the node of the wing that it holds
        assert len(np.unique(i.nodes, axis=0)) == len(i.nodes)


def test_structural_sections_end_at_the_strut_nodes_and_design_sections_at_the_design_wing():
    scene = scenes.load("v3_kite")
    i = scene.interface
    ends = scene.members.nodes[scene.struts]
    assert np.array_equal(i.nodes[i.sections[:, [0, 2]]], ends)
    design = scenes.load("v3_kite", {"chord": "design", "panels_per_section": 4}).interface
    mid = design.nodes[design.sections[len(design.sections) // 2]]
    assert np.linalg.norm(mid[2] - mid[0]) == pytest.approx(2.599, abs=1e-3)  # mid-span chord of the section table
    structural = i.nodes[i.sections[4]]
    assert np.linalg.norm(structural[2] - structural[0]) == pytest.approx(2.2655, abs=1e-3)


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: f"{s['chord']}-{s['panels_per_section']}")
def test_interface_is_mirror_symmetric_and_its_normals_point_to_the_suction_side(settings):
    i = scenes.load("v3_kite", settings).interface
    image = mirror_permutation(i.nodes)
    assert image is not None
    corner = i.nodes[i.panels]
    area = 0.5 * np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    outward = corner.mean(axis=1) - [0.2, 0.0, 8.0]  # the kite arches over this point
    assert np.all(np.sum(area * outward, axis=1) > 0.0)
    assert np.abs(area.sum(axis=0)[1]) <= 1e-12 * 20.0  # both halves face each other: rounding of 20 m2


def test_trim_angle_leaves_no_pitching_moment_of_air_and_weight(kite):
    angle = kite.trim_angle()
    assert 5.0 < np.rad2deg(angle) < 15.0  # near 9 to 10 degrees
    air = kite.aero_core()
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    moments = []
    for d in (0.0, 1e-3):
        turned = turn @ np.array([[np.cos(d), 0, np.sin(d)], [0, 1, 0], [-np.sin(d), 0, np.cos(d)]])
        nodes = kite.interface.nodes
        air.set("displacement", nodes @ turned.T - nodes)
        air.step(0.0, 0.0)
        weight = 9.81 * kite.members.mass @ (kite.members.nodes @ turned.T)[:, 0]
        moments.append(air.get("moment")[1] + air.get("line_moment")[1] + weight)
    slope = (moments[1] - moments[0]) / 1e-3
    assert slope < 0.0  # nose-up turns are turned back: stable
    assert abs(moments[0]) <= 2e-6 * abs(slope)  # the angle is found to 1e-6 rad


def test_trim_follows_the_wind_direction(kite):
    # turning the wind by d about the pivot turns the trim by nearly as much; only gravity keeps its direction
    d = np.deg2rad(2.0)
    light = {"gravity": 0.0}
    turned = kite.trim_angle({"wind_direction": [np.cos(d), 0.0, -np.sin(d)], **light})
    assert turned - kite.trim_angle(light) == pytest.approx(d, abs=3e-6)  # without gravity exactly; both to 1e-6 rad
