"""Starts in equilibrium of stiff lines, and of lines at another scale."""

import numpy as np
import pytest

from scenes import load


def hanging(tmp_path, pieces, modulus, density, scale="", length=101.0):
    """The folder of a line of 10 mm and `length` m between supports 100 m apart, in so many pieces."""
    folder = tmp_path / "hanging"
    folder.mkdir()
    part = np.linspace(0.0, 1.0, pieces + 1)
    sag = np.sqrt(0.375 * 100.0 * max(length - 100.0, 0.0)) * 4.0 * part * (1.0 - part)
    held = ["xyz" if k in (0, pieces) else "" for k in range(pieces + 1)]
    nodes = [f"n{k},{100.0 * part[k]},0.0,{-sag[k]},{held[k]}" for k in range(pieces + 1)]
    lines = [f"s{k},n{k} n{k + 1},{length / pieces},0.01" for k in range(pieces)]
    (folder / "nodes.csv").write_text("\n".join(["node,x_m,y_m,z_m,fixed", *nodes]))
    (folder / "lines.csv").write_text("\n".join(["name,nodes,rest_length_m,diameter_m", *lines]))
    reel = ", ".join(f'"s{k}"' for k in range(pieces))
    (folder / "scene.toml").write_text(
        f'title = "a line"\ndescription = "a line that hangs"\n{scale}\n[structure]\nnodes = "nodes.csv"\n'
        f'lines = "lines.csv"\nline_modulus = {modulus}\nline_density = {density}\ngravity = 9.81\n'
        f"[structure.reels]\nline_length = [{reel}]\n[dynamics]\nstart_in_equilibrium = true\n"
        "longest_step = 0.01\ncommunication_step = 0.01\nstop_time = 0.01\n"
    )
    return folder


@pytest.mark.parametrize("stiffness", [1e6, 1e9, 1e12])
def test_a_start_in_equilibrium_asks_for_no_less_than_rounding_leaves(stiffness, tmp_path):
    """EA of a steel cable and of what others take for inextensible: the supports carry the weight."""
    area = 0.25 * np.pi * 0.01**2
    core = load(hanging(tmp_path, 200, stiffness / area, 1000.0)).structural_core()
    core.step(0.0, 0.01)
    weight = 1000.0 * area * 101.0 * 9.81
    # a residual of eps EA reach / length of a piece, a random sum of 200
    left = np.finfo(float).eps * stiffness / 0.5 * 100.0 * np.sqrt(200.0)
    assert core.get("support_force")[2] == pytest.approx(-weight, abs=1e-3 + 3.0 * left)


def test_a_start_in_equilibrium_is_as_exact_as_the_solver_tolerance_asks(tmp_path):
    folder = hanging(tmp_path, 20, 1e9, 1000.0)
    imbalance = []
    for tolerance in (1e-6, 1.0):
        core = load(folder).structural_core()
        core.set("solver_tolerance", tolerance)
        core.step(0.0, 0.01)
        imbalance.append(float(core.get("kinetic_energy")))
    assert imbalance[0] < 1e-12 * max(imbalance[1], 1e-6)


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_twice_the_line_weighs_twice_as_much_at_every_scale(scale, tmp_path):
    offer = '[settings.scale]\ndefault = 1.0\nminimum = 0.1\nmaximum = 10.0\ndescription = "scale"\n'
    scene = load(hanging(tmp_path, 8, 1e9, 1300.0, offer, length=110.0), {"scale": scale})
    weight = []
    for length in (110.0 * scale, 220.0 * scale):
        core = scene.structural_core()
        core.set("line_length", length)
        core.step(0.0, 0.01)
        weight.append(core.get("support_force")[2])
    assert weight[1] / weight[0] == pytest.approx(2.0, rel=1e-6)  # out of balance by a millionth of a newton
    assert weight[0] == pytest.approx(-1300.0 * 0.25 * np.pi * 0.01**2 * 110.0 * 9.81 * scale**2, rel=1e-6)
