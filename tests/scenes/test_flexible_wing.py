"""A wing of fabric in the flow of the panel method: one surface for both sides, balance of forces, bad input."""

import re
import shutil

import numpy as np
import pytest

import scenes
from interface import area_vectors
from master.coupling import Coupling, solve
from master.coupling.acceleration import IQNILS
from scenes.schema import SceneError

FOLDER = "flexible_wing"
SKETCH = {"variant": "sketch"}


@pytest.fixture(scope="module")
def scene():
    return scenes.load(FOLDER, SKETCH)


@pytest.fixture(scope="module")
def flown(scene):
    coupling = Coupling.in_process(scene)
    return coupling, solve(coupling, IQNILS(), max_iterations=40)


def test_flow_and_structure_share_nodes_and_the_skin_has_two_triangles_a_panel(scene):
    interface, skin = scene.interface, scene.members.membranes.skin
    assert np.array_equal(interface.nodes, scene.members.nodes[skin])
    assert np.array_equal((interface.weights @ scene.members.nodes), interface.nodes)
    triangles = scene.members.membranes.group.nodes
    quads = interface.panels[:, 2] != interface.panels[:, 3]
    count = len(interface.panels) + np.count_nonzero(quads)
    assert set(np.unique(triangles[:count])) == set(skin)
    corners = scene.members.nodes[triangles[:count]]
    vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.abs(vectors.sum(axis=0)).max() < 1e-14  # a closed surface, to rounding


def test_it_converges_and_the_supports_bear_what_the_flow_sends(flown):
    coupling, found = flown
    assert found.status == "converged"
    assert found.residual_N < 0.01
    structure, aero = coupling.structural, coupling.aero
    on_supports = structure.get("support_group_force").sum(axis=0)
    # the pressure inside has no resultant on a closed surface; the rest is the force of the flow on the shape it saw
    # last, which differs from this one by the residual of the interface
    assert on_supports == pytest.approx(aero.get("force"), abs=1e-3 * np.linalg.norm(aero.get("force")))
    nodes = coupling.structural.get("displacement") + scenes.load(FOLDER, SKETCH).interface.nodes
    panels = scenes.load(FOLDER, SKETCH).interface.panels
    area = area_vectors(nodes[panels])
    pressure, shear = aero.get("pressure"), aero.get("shear")
    assert np.abs(pressure @ area).max() < 1e-10 * pressure.max()  # rounding of some hundred panels of 0.1 m2
    assert np.linalg.norm(area, axis=1) @ shear == pytest.approx(on_supports, abs=1e-3 * np.abs(on_supports).max())


def test_cells_balloon_between_ribs_that_stay_flat(scene, flown):
    coupling, _ = flown
    displaced = scene.interface.nodes + coupling.structural.get("displacement")
    strips, points = 8, 32
    grid = displaced[: (strips + 1) * points].reshape(strips + 1, points, 3)
    thickness = np.ptp(grid[:, :, 2], axis=1)
    cells, ribs = thickness[1::2], thickness[2:-1:2]
    assert cells.min() > 1.02 * ribs.max()
    # a rib keeps its thickness to some strain; the cells between grow to where their panels are arcs
    assert ribs == pytest.approx(np.ptp(scene.interface.nodes[:points, 2]), rel=0.05)
    assert grid == pytest.approx(grid[::-1] * [1.0, -1.0, 1.0], abs=1e-12)  # solved as one half


BAD = {
    "needs a body": (r'\[body\]\nshape = "wing".*?\n\n', "", r"\[body\]"),
    "cells that do not divide": ("cells = 8", "cells = 7", "strips of the wing are no whole number"),
    "cells missing": ("cells = 8", "", "lacks 'cells'"),
    "unknown size": ("rib_rows = 3", "rows = 3", "unknown key 'rows'"),
    "attachment behind the wing": ("rear = 1.0", "rear = 1.2", "share of the chord from 0 to 1"),
    "two attachments at one node": ("middle = 0.5", "middle = 0.081", "two attachments are at one node"),
    "second order": ('shape = "body"', 'shape = "body"\norder = 2', "order 2 means nothing to a body"),
    "pressure twice": (
        r"\[membranes.fabrics.cloth\]",
        "[membranes.pressures.inside]\nvalue = 90.0\n\n[membranes.fabrics.cloth]",
        "internal_pressure_coefficient",
    ),
    "a body of a structure that is not its skin": ('shape = "body"', 'shape = "sphere"', "rigid and stands in a scene"),
    "a box wing": (
        'shape = "wing"',
        'shape = "box-wing"\nheight = 1.0\ncorner_radius = 0.2\nplate_strips = 2',
        "needs",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_is_one_sentence(case, tmp_path):
    old, new, told = BAD[case]
    folder = tmp_path / "wing"
    shutil.copytree(scenes.load(FOLDER).folder, folder)
    text = (folder / "scene.toml").read_text()
    changed = (
        re.sub(old, new.replace("\\", r"\\"), text, count=1, flags=re.DOTALL)
        if case != "second order"
        else (text.replace(old, new))
    )
    assert changed != text
    (folder / "scene.toml").write_text(changed)
    with pytest.raises(SceneError, match=told) as caught:
        scenes.load(folder)
    assert str(caught.value).count("\n") == 0
