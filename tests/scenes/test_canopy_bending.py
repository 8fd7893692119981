"""Bending stiffness of canopy quads: a strip of them is a beam."""

import shutil

import numpy as np
import pytest

from scenes import SceneError, load
from tests.scenes.broken import edited


def strip(tmp_path, cells=16, bending="canopy_bending_stiffness = 2.0\n"):
    """A strip 2 m long and 0.1 m wide of quads, clamped at two columns of nodes, loaded at its end."""
    folder = tmp_path / "strip"
    folder.mkdir()
    x = np.linspace(0.0, 2.0, cells + 1)
    nodes = [
        f"{side}{i},{x[i]},{y},0.0,{'xyz' if i < 2 else ''}"
        for i in range(cells + 1)
        for side, y in (("a", 0.0), ("b", 0.1))
    ]
    quads = [f"q{i},a{i} a{i + 1} b{i + 1} b{i},1e6,0.01" for i in range(cells)]
    (folder / "nodes.csv").write_text("node,x_m,y_m,z_m,fixed\n" + "\n".join(nodes) + "\n")
    (folder / "canopy.csv").write_text("name,nodes,stiffness_N_per_m,mass_kg\n" + "\n".join(quads) + "\n")
    (folder / "loads.csv").write_text(f"load,node,x,y,z\ntip,a{cells},0,0,1\ntip,b{cells},0,0,1\n")
    (folder / "scene.toml").write_text(
        f'[structure]\nnodes = "nodes.csv"\ncanopy = "canopy.csv"\nloads = "loads.csv"\ngravity = 0.0\n{bending}'
        "[structure.load_values]\ntip = 0.001\n[dynamics]\nstart_in_equilibrium = true\n"
    )
    return folder


def test_a_strip_of_canopy_bends_as_a_beam_of_its_width(tmp_path):
    core = load(strip(tmp_path)).structural_core()
    core.step(0.0, 1e-3)
    # every inner column of nodes turns by M h / EI, the clamped one too: P h^3 / EI (1 + 4 + ... + 15^2)
    exact = 0.002 * 0.125**3 / (2.0 * 0.1) * sum(j * j for j in range(1, 16))
    assert core.get("position")[-1, 2] == pytest.approx(exact, rel=1e-3)  # turned by 0.02 rad: its square
    beam = 0.002 * (2.0 - 0.125 + 0.0625) ** 3 / (3.0 * 2.0 * 0.1)  # clamped in the middle of the first cell
    assert core.get("position")[-1, 2] == pytest.approx(beam, rel=1e-2)  # 1 / 15^2, and a little


def test_without_it_there_is_nothing_to_hold_the_load_but_the_pull_of_the_edges(tmp_path):
    stiff = load(strip(tmp_path)).members.bending
    assert len(stiff) == 1
    assert len(stiff[0].k) == 2 * 15  # two rows; across there is one cell only
    (tmp_path / "other").mkdir()
    assert load(strip(tmp_path / "other", bending="")).members.bending == ()


def test_bending_stiffness_without_quads_is_refused_in_one_sentence(tmp_path):
    folder = tmp_path / "kite"
    shutil.copytree(load("v3_kite").folder, folder)
    edited(folder, "scene.toml", "[structure]\n", "[structure]\ncanopy_bending_stiffness = 1.0\n")
    with pytest.raises(SceneError, match="canopy_bending_stiffness is that of a table 'canopy' of quads"):
        load(folder)
