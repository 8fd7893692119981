"""The small parafoil flown: it finds its angle of attack about the pilot point, and everything is in balance there."""

import numpy as np
import pytest

import scenes
from interface import area_vectors
from master.coupling import Coupling, solve
from master.coupling.acceleration import IQNILS

MOST = 25  # coupling iterations


def flown(**settings):
    scene = scenes.load("parafoil_small", settings)
    coupling = Coupling.in_process(scene)
    return scene, coupling, solve(coupling, IQNILS(), max_iterations=MOST)


@pytest.fixture(scope="module")
def usual():
    return flown()


def angle(coupling):
    return np.degrees(float(coupling.aero.get("alpha_mid")))


def test_it_has_480_panels_and_converges_from_the_unstressed_shape(usual):
    scene, coupling, found = usual
    assert len(scene.interface.panels) == 480
    assert found.status == "converged"
    lift_and_drag = np.linalg.norm(coupling.aero.get("force"))
    assert found.residual_N < 1e-3 * lift_and_drag
    assert angle(coupling) == pytest.approx(17.13, abs=0.05)  # as it flies; a change of the mesh moves it by more


def test_lines_pull_at_the_pilot_point_with_what_the_air_does_to_wing_and_lines(usual):
    scene, coupling, _ = usual
    nodes, (chains,) = scene.members.nodes, scene.members.chains
    x = coupling.structural.get("position")
    ends = x[chains.nodes]
    assert np.array_equal(x[scene.pivot], nodes[scene.pivot])
    along = ends[:, 0] - ends[:, 1]
    along /= np.linalg.norm(along, axis=1)[:, None]
    pull = coupling.structural.get("tension") @ along
    wing, lines = (coupling.aero.get(name) for name in ("force", "line_force"))
    half_of_lines = 0.5 * lines  # each line gives half of its own wind load to its end at the pilot point
    size = np.linalg.norm(wing)
    # what is left is the residual of the interface: loads belong to the shape that the flow saw last
    assert pull + half_of_lines == pytest.approx(wing + lines, abs=1e-5 * size)


def test_nothing_pitches_it_about_the_pilot_point(usual):
    _, coupling, _ = usual
    moment = coupling.aero.get("moment") + coupling.aero.get("line_moment")
    assert np.linalg.norm(moment) < 1e-5 * 6.1 * np.linalg.norm(coupling.aero.get("force"))  # residual, as above


def test_the_pressure_inside_travels_as_pressure_and_the_flow_outside_as_traction(usual):
    scene, coupling, _ = usual
    q = 0.5 * 1.2 * 10.0**2
    assert coupling.aero.get("pressure") == pytest.approx(q, rel=1e-12)  # stagnation pressure on all panels
    nodes = scene.interface.nodes + coupling.structural.get("displacement")
    area = area_vectors(nodes[scene.interface.panels])
    traction = np.linalg.norm(area, axis=1) @ coupling.aero.get("shear")
    assert traction == pytest.approx(coupling.aero.get("force"), abs=1e-5 * np.linalg.norm(traction))
    assert np.abs(area.sum(axis=0)).max() < 1e-12  # a closed surface, on which uniform pressure has no resultant


@pytest.mark.parametrize("start", [12.0, 22.0])
def test_where_it_starts_changes_nothing_of_how_it_flies(usual, start):
    _, coupling, _ = usual
    _, other, found = flown(start_angle=start)
    assert found.status == "converged"
    for name in ("CL", "CD"):
        # the interface converges to 1e-6 of displacements that are 1 m
        assert float(other.aero.get(name)) == pytest.approx(float(coupling.aero.get(name)), abs=1e-4)
    assert angle(other) == pytest.approx(angle(coupling), abs=0.01)


def test_the_angle_of_attack_grows_with_the_trim(usual):
    _, coupling, _ = usual
    angles = []
    for trim, start in ((27.0, 15.0), (37.0, 19.0)):
        _, other, found = flown(trim=trim, start_angle=start)
        assert found.status == "converged"
        angles.append(angle(other))
    assert angles[0] + 1.0 < angle(coupling) < angles[1] - 1.0
