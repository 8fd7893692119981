"""A structure whose equilibrium takes every way that there is to one: its FMU carries all that these need."""

import subprocess
import sys
from pathlib import Path

import numpy as np

import scenes
from benchmarks.random_networks import random_network
from fmus.builder import build
from structural.solve import energy

MODULUS = 1e9
WING = ("struts", "sections", "polars")
# Beside the network, and not tied to it: springs need a wing, here a plate on springs.
PLATE = {
    "nodes": [f"{e}{s},{x},{y},0,{held}" for e, held in (("", ""), ("ground_", "xyz")) for s, x, y in
              (("le_left", 0, -0.5), ("te_left", 1, -0.5), ("le_right", 0, 0.5), ("te_right", 1, 0.5))],
    "springs": [f"p_{s},{s} ground_{s},0.0,900,0" for s in ("le_left", "te_left", "le_right", "te_right")],
    "canopy": ["name,nodes,stiffness_N_per_m,mass_kg", "plate,le_left te_left te_right le_right,1e6,0"],
    "struts": ["strut,leading_edge_node,trailing_edge_node", "1,le_left,te_left", "2,le_right,te_right"],
    "sections": ["section,polar,le_x_m,le_y_m,le_z_m,te_x_m,te_y_m,te_z_m", "1,1,0,-0.5,0,1,-0.5,0",
                 "2,1,0,0.5,0,1,0.5,0"],
    "polars": ["polar,alpha_deg,cl,cd,cm", "1,-90,-9,0,0", "1,0,0,0,0", "1,90,9,0,0"],
}  # fmt: skip


def _scene(folder):
    """Springs that push and lines that do not, a network of 600 m."""
    given = random_network("springs", 76)
    (group,) = given.members
    folder.mkdir()
    label = [f"n{i}" for i in range(len(given.nodes))]
    tables = {
        "nodes": ["node,x_m,y_m,z_m,fixed"],
        "springs": ["name,nodes,rest_length_m,stiffness_N_per_m,mass_kg"],
        "lines": ["name,nodes,rest_length_m,diameter_m"],
        "loads": ["load,node,x,y,z"],
    }
    for i, (x, y, z) in enumerate(given.start.tolist()):
        tables["nodes"].append(f"{label[i]},{x!r},{y!r},{z!r},{'xyz' if given.held[i] else ''}")
    values = []
    for i, (a, b) in enumerate(group.nodes):
        l0, k = float(group.l0[i]), float(group.k[i])
        if group.two_way[i]:
            tables["springs"].append(f"e{i},{label[a]} {label[b]},{l0!r},{k!r},0")
        else:
            diameter = float(np.sqrt(4.0 * k * l0 / (np.pi * MODULUS)))
            tables["lines"].append(f"e{i},{label[a]} {label[b]},{l0!r},{diameter!r}")
    for i, force in enumerate(given.loads):
        if size := float(np.linalg.norm(force)):
            x, y, z = (force / size).tolist()
            tables["loads"].append(f"P{i},{label[i]},{x!r},{y!r},{z!r}")
            values.append(f"P{i} = {size!r}")
    for name, rows in PLATE.items():
        tables[name] = [*tables.get(name, []), *rows]
    for name, rows in tables.items():
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n")
    text = [
        "title = 'network'",
        "[structure]",
        *(f"{n} = '{n}.csv'" for n in tables if n not in WING),
        f"line_modulus = {MODULUS}",
    ]
    text += ["line_density = 0.0", "gravity = 0.0", "[structure.load_values]", *values]
    text += ["[wing]", *(f"{name} = '{name}.csv'" for name in WING)]
    text += ["[aero]", "induction = false", "section_force = 'normal'", "wind_speed = 1.0", "reference_area = 1.0"]
    (folder / "scene.toml").write_text("\n".join(text) + "\n")
    return scenes.load(folder)


STEP = """
import sys
from master.coupling import FmuParticipant
with FmuParticipant(sys.argv[1]) as fmu:
    fmu.step(0.0, 1.0)
    print(int(fmu.get("newton_iterations")), fmu.get("position").tobytes().hex())
"""


def test_an_fmu_takes_the_last_way_to_an_equilibrium_as_the_core_does(tmp_path, monkeypatch):
    """In another process, which has loaded nothing of the project's solvers: what an FMU lacks cannot be borrowed."""
    scene, ways = _scene(tmp_path / "network"), []
    core, method = scene.structural_core(), energy.EnergyNewton.run
    monkeypatch.setattr(energy.EnergyNewton, "run", lambda self, most: (ways.append(most), method(self, most))[1])
    core.step(0.0, 1.0)
    assert ways  # the last of all: downhill in energy
    path, _ = build(scene, tmp_path / "fmus", reference=False)
    words = [sys.executable, "-c", STEP, str(path)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parents[2], check=False)
    assert done.returncode == 0, done.stderr
    spent, position = done.stdout.split()[-2:]
    assert int(spent) == int(core.get("newton_iterations"))
    assert position == core.get("position").tobytes().hex()
