"""What the solver cores say of their own validity: strains, tubes, stall, reference area, against closed forms."""

from dataclasses import dataclass

import numpy as np
import pytest

import scenes
from interface import Criterion
from interface.validity import outside, worst
from scenes.cores.flow import reference_area_misfit, wing_areas
from scenes.cores.structure import StructuralModel
from structural import Chains, Configuration, breukels_tube, inflatable_tube
from structural.materials.tip_deflection import tip_deflection_tube
from tests.scenes.broken import built, copy_of, edited

NODES = """node,x_m,y_m,z_m,fixed
0,0.0,0.0,0.0,xyz
1,0.0,0.0,-2.0,
"""
LINES = """name,nodes,rest_length_m,diameter_m
thin,0 1,2.0,0.001
thick,0 1,2.0,0.002
"""
MASSES = """name,node,mass_kg
weight,1,10.0
"""
HANGING = """title = "A weight on two lines"
description = "Two lines side by side."

[structure]
nodes = "nodes.csv"
lines = "lines.csv"
masses = "masses.csv"
line_modulus = 1e9
gravity = 9.81
symmetric = false

[dynamics]
start_in_equilibrium = true
"""


@pytest.fixture
def hanging(tmp_path):
    """A weight of 98.1 N on two lines of 1 and 2 mm side by side."""
    folder = tmp_path / "hanging"
    folder.mkdir()
    tables = {"nodes.csv": NODES, "lines.csv": LINES, "masses.csv": MASSES, "scene.toml": HANGING}
    for name, text in tables.items():
        (folder / name).write_text(text)
    return built(folder)[1]


@pytest.mark.parametrize(("modulus", "count"), [(1e9, 1), (1e10, 0)])
def test_strain_of_two_lines_side_by_side_is_the_weight_over_their_stiffness(hanging, modulus, count):
    hanging.set("line_modulus", modulus)
    hanging.step(0.0, 0.01)
    area = 0.25 * np.pi * np.array([0.001, 0.002]) ** 2
    strain = 98.1 / (modulus * area.sum())  # 2.5 % and 0.25 %
    # it begins in equilibrium, but for 1e-6 N of 98.1
    np.testing.assert_allclose(hanging.get("strain"), strain, rtol=2e-8)
    np.testing.assert_allclose(hanging.get("axial_stiffness"), modulus * area, rtol=1e-14)  # rounding
    np.testing.assert_allclose(hanging.get("tension"), modulus * area * strain, rtol=2e-8)
    np.testing.assert_allclose(hanging.get("length"), 2.0 * (1.0 + strain), rtol=2e-8)
    assert hanging.get("largest_line_strain") == pytest.approx(strain, rel=2e-6)
    (criterion,) = hanging.criteria
    assert criterion.named(hanging.get("largest_line_strain_at")) == "thin"  # the first of those that are equal
    assert criterion.limit == 0.01
    assert hanging.get("outside_validity") == count


def test_strain_counts_slack_lines_as_none_and_springs_not_at_all():
    at = Configuration(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    nodes, l0 = np.array([[0, 1]] * 4), np.array([1.1, 0.8, 0.99, 0.98])
    two_way, canopy = np.array([False, True, False, False]), np.array([False, False, False, True])
    chains = Chains(nodes, l0, np.full(4, 1e4), two_way, canopy=canopy)
    found = chains.judged(chains.measured(at))
    assert worst(found["largest_line_strain"]) == (pytest.approx(0.01 / 0.99), 3)
    assert worst(found["largest_canopy_strain"]) == (pytest.approx(0.02 / 0.98), 4)
    assert [c.name for c in chains.criteria] == ["largest_line_strain", "largest_canopy_strain"]


@pytest.mark.parametrize("tube", ["fits", "tip deflection", "fabric"])
def test_tube_is_at_its_limits_under_the_moments_of_wrinkling_and_collapse(tube):
    pressure, radius = 3e4, np.array([0.1])
    section = inflatable_tube(pressure, radius, 1e5, 3e4) if tube == "fabric" else breukels_tube(pressure, radius)
    collapse = section.bending.collapse[0]
    section = tip_deflection_tube(section) if tube == "tip deflection" else section
    wrinkling = 0.5 * np.pi * pressure * radius[0] ** 3  # Comer and Levy (1963)
    for moment, name in ((wrinkling, "wrinkling"), (collapse, "collapse")):
        force = np.array([[0.0, 0.6 * moment, 0.8 * moment, 0.0, 0.0, 0.0]])
        found = section.judged(force, np.zeros((1, 6)), np.ones(1))
        assert found[f"largest_moment_over_{name}"][0] == pytest.approx(1.0, rel=1e-14)  # rounding


def test_strain_of_a_tube_is_that_of_its_normal_force_and_its_curvature():
    section, length = inflatable_tube(3e4, np.array([0.1]), 1e5, 3e4), np.array([2.0])
    natural = np.array([[0.0, -0.01, 0.0, 0.01, 0.0, 0.0]])  # a circle: kappa = 0.02 / 2 m
    force = np.array([[-0.003 * section.EA[0], 0.0, 0.0, 0.0, 0.0, 0.0]])
    found = section.judged(force, natural, length)["largest_tube_strain"][0]
    assert found == pytest.approx(0.003 + 0.01 * 0.1, rel=1e-12)  # rounding


@dataclass(frozen=True, eq=False)
class Ties(Chains):
    """A family of its own, judged by the tension that its elements bear."""

    counted = "tie"

    @property
    def criteria(self):
        return (Criterion("largest_tie_tension", "tie tension", 50.0, "the maker of the ties"),)

    def judged(self, measured):
        return {"largest_tie_tension": measured["tension"]}


def test_family_of_elements_brings_its_own_criterion_with_the_names_of_its_elements(hanging):
    model = hanging.solver.model
    (lines,) = model.members.chains
    ties = Ties(lines.nodes, lines.l0, np.array([1e3, 1e4]), lines.two_way, ("soft", "stiff"))
    scene = model.scene
    own = StructuralModel(scene)
    own.__dict__["_structure"] = type(model._structure)(model._structure.nodes, model._structure.fixed, (lines, ties))
    x = model.members.nodes * 1.005  # 1 cm longer
    measured = [group.measured(Configuration(x)) for group in (lines, ties)]
    out = own._verdict(own._judged((lines, ties), measured))
    assert out["largest_tie_tension"] == pytest.approx(100.0)
    names = {c.name: c for c in own.criteria}
    assert names["largest_tie_tension"].named(out["largest_tie_tension_at"]) == "stiff"
    assert out["outside_validity"] == 1  # half a per cent of line strain is within
    assert {v.name for v in own.validity_variables()} == out.keys()


@pytest.mark.parametrize(("area", "within"), [(0.1, False), (0.85, True), (1.0, True), (1.2, True), (3.0, False)])
def test_reference_area_far_from_the_area_of_the_wing_is_outside_validity(tmp_path, area, within):
    folder = copy_of("typical_section", tmp_path)  # a plate of 1 m2
    edited(folder, "scene.toml", "reference_area = 1.0", f"reference_area = {area}")
    core = built(folder)[2]
    core.step(0.0, 1.0)
    assert core.get("reference_area_misfit") == pytest.approx(max(area, 1.0 / area), rel=1e-12)  # rounding
    assert (core.get("outside_validity") == 0) == within
    criterion = next(c for c in core.criteria if c.name == "reference_area_misfit")
    assert f"{area:g} m2" in criterion.where


def test_areas_of_an_arched_wing_are_those_of_its_chord_and_of_its_arc():
    scene, _, _ = built("v3_kite_detailed")
    edge = np.linspace(0.0, np.pi, 401)  # a half circle of radius 2 m, chord 1.5 m, leant back by 20 degrees
    lean = np.deg2rad(20.0)
    arc = np.stack([2.0 * np.sin(edge) * np.sin(lean), -2.0 * np.cos(edge), 2.0 * np.sin(edge) * np.cos(lean)], axis=1)
    along = 1.5 * np.array([np.cos(lean), 0.0, -np.sin(lean)])
    nodes = np.concatenate([arc, arc + along])
    i = np.arange(400)
    panels = np.stack([i, i + 401, i + 402, i + 1], axis=1)
    projected, laid_out = wing_areas(type("Mesh", (), {"nodes": nodes, "panels": panels, "closed": False}))
    assert projected == pytest.approx(1.5 * 4.0, rel=1e-4)  # a polygon of 400 sides
    assert laid_out == pytest.approx(1.5 * 2.0 * np.pi, rel=1e-4)
    assert reference_area_misfit(5.0, projected, laid_out) == pytest.approx(1.2, rel=1e-4)
    assert reference_area_misfit(7.0, projected, laid_out) < 1.0
    low, high = wing_areas(scene.interface)
    assert low < scene.aero.reference_area < high  # published as projected, of sections beyond the outermost struts too


@pytest.mark.parametrize(("degrees", "stalled"), [(8.0, 0), (20.0, 1)])
def test_stalled_strips_are_counted_and_the_furthest_is_named(tmp_path, degrees, stalled):
    _, _, core = built("v3_kite")
    direction = np.array([np.cos(np.deg2rad(degrees)), 0.0, np.sin(np.deg2rad(degrees))])
    core.set("wind_direction", direction)
    core.step(0.0, 1.0)
    assert (core.get("stalled_strips") > 0) == bool(stalled)
    assert (core.get("stalled_strips_at") > 0) == bool(stalled)
    criteria = {c.name: c for c in core.criteria}
    found = {name: float(core.get(name)) for name in criteria}
    assert core.get("outside_validity") == outside(core.criteria, found) == stalled
    if stalled:
        _, high = core.solver.models[0]._stall
        assert criteria["stalled_strips"].named(core.get("stalled_strips_at")).startswith("strip ")
        beyond = core.get("alpha") - high
        assert beyond[int(core.get("stalled_strips_at")) - 1] == pytest.approx(beyond.max())


def test_criterion_says_of_no_number_that_it_is_not_within():
    assert not Criterion("x", "a quantity", 1.0, "nobody").within(float("nan"))
    assert worst(np.zeros(3)) == (0.0, 0)
    assert worst(np.array([1.0, 2.0, 2.0 * (1.0 + 1e-12)]))[1] == 2  # equal but for rounding: the first


def test_a_value_that_is_no_number_is_the_worst_of_all():
    value, place = worst(np.array([0.1, np.nan, 0.5]))
    assert np.isnan(value)
    assert place == 2
    assert worst(np.array([0.1, 0.5, 0.5 * (1.0 - 1e-12)])) == (0.5, 2)
    assert worst(np.array([-0.1, 0.0])) == (0.0, 0)


def test_a_wing_whose_tips_come_together_loses_tip_span():
    """Tips displaced towards the middle by a tenth of their distance each: a fifth is lost, beyond the limit."""
    scene = scenes.load("v3_kite", {"line_drag": "off"})
    core, x = scene.aero_core(), scene.interface.nodes
    tips = x[scene.interface.sections[[0, -1]]]
    apart = np.abs(np.ptp((tips[:, 0] + 0.25 * (tips[:, -1] - tips[:, 0]))[:, 1]))
    for part, count in ((0.05, 0), (0.1, 1)):
        move = np.zeros_like(x)
        move[scene.interface.sections[0], 1], move[scene.interface.sections[-1], 1] = part * apart, -part * apart
        core.set("displacement", move)
        core.step(0.0, 1.0)
        assert core.get("tip_span_lost") == pytest.approx(2.0 * part, abs=1e-9)
        assert core.get("outside_validity") - core.get("stalled_strips").astype(bool) == count
