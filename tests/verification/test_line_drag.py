"""Line drag where a closed form knows the answer: a tether blown into a catenary, the glide ratio of the V3 kite."""

import numpy as np
import pytest
from scipy.optimize import brentq

import scenes
from aero import line_loads
from benchmarks.problems import in_process
from master import Aitken, fixed_point
from master.coupling import SCHEMES, solve
from structural import Assembly, Chains, LineLoad, Lines, Loads, Structure, equilibrium, tensions


def blown_line(n, span=100.0, length=101.0, diameter=0.004, wind=10.0):
    """A nearly inextensible line of n pieces between (0, 0, -span/2) and (0, 0, span/2) m in a wind along x, with drag
    across it only: positions (n+1,3) m at equilibrium and tensions (n,) N, structure and loads coupled.
    """
    nodes = np.zeros((n + 1, 3))
    nodes[:, 2] = np.linspace(-0.5 * span, 0.5 * span, n + 1)
    links = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    rest = np.full(n, length / n)
    chains = (Chains(links, rest, 1e8 / rest, np.zeros(n, bool)),)  # EA of 1e8 N: strains of 5e-7
    fixed = np.zeros((n + 1, 3), bool)
    fixed[[0, -1]] = True
    assembly = Assembly(Structure(nodes, fixed, chains, {"lines": Lines(links)}))
    start = nodes.copy()
    start[:, 0] = 0.1 * span * (1.0 - (2.0 * nodes[:, 2] / span) ** 2)

    def under_wind(x):
        load = line_loads(x[links], np.full(n, diameter), np.array([wind, 0.0, 0.0]), 1.225, 1.1, 0.0)
        loads = Loads(np.zeros_like(x), {"lines": LineLoad(load)})
        solved = equilibrium(assembly, loads, x, atol=5e-6)
        assert solved.converged
        return solved.x

    result = fixed_point(under_wind, start, Aitken(1.0), atol=1e-9)
    assert result.converged
    return result.x_tilde, tensions(result.x_tilde, chains[0])


def test_line_in_cross_wind_becomes_a_catenary_of_constant_tension():
    # Load w sin^2 Theta across the line only: T dTheta/ds = -w sin^2 Theta with constant T, so that cot Theta = s / a,
    # a = T / w: the catenary x = a cosh(z / a) with its axis along the wind, of length 2 a sinh(span / 2a).
    w = 0.5 * 1.225 * 10.0**2 * 0.004 * 1.1
    a = brentq(lambda a: 2.0 * a * np.sinh(50.0 / a) - 101.0, 10.0, 1e4, xtol=1e-12)
    sag, pull = a * np.cosh(50.0 / a) - a, w * a
    errors = []
    for n in (8, 16, 32):
        x, tension = blown_line(n)
        assert np.ptp(tension) <= 0.01 / n**2 * pull  # constant but for the kinks between straight pieces
        errors.append([np.ptp(x[:, 0]) / sag - 1.0, tension.mean() / pull - 1.0])
    order = np.log2(np.abs(np.array(errors[:-1]) / errors[1:]))
    assert np.all(np.abs(order - 2.0) < 0.15)  # chords of a smooth curve
    assert np.abs(errors[-1]).max() < 2e-3


@pytest.mark.parametrize("wind", [8.0, 12.0, 20.0])
def test_bridle_lowers_the_glide_ratio_of_the_kite_as_the_lumped_line_drag_says(wind):
    """Ram-air thesis eq. 2.14 with the whole C_tau d L / S in place of a quarter of it.

    The quarter belongs to a tether whose speed falls to zero at the ground; the bridle moves with the kite.
    """
    couplings = {}
    for drag in ("off", "on"):
        couplings[drag] = in_process("v3_kite", {"line_drag": drag}, wind_speed=wind)
        assert solve(couplings[drag], SCHEMES["iqn-ils"]()).status == "converged"
    scene = scenes.load("v3_kite")
    ends = scene.interface.nodes[scene.interface.lines]
    area = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) @ scene.interface.diameter
    lumped = 1.12 * area / scene.aero.reference_area
    bare, draggy = (couplings[k].aero for k in ("off", "on"))
    lift, drag = float(bare.get("CL")), float(bare.get("CD"))
    assert float(bare.get("glide_ratio")) == pytest.approx(lift / drag, rel=1e-12)
    # 10 %: the kite flies at another angle of attack with its bridle in the wind
    assert float(draggy.get("glide_ratio")) == pytest.approx(lift / (drag + lumped), rel=0.1)
    # What the wing has at the angle at which it flies now: only the inclination of the lines is left.
    lift, drag = float(draggy.get("CL")), float(draggy.get("CD"))
    fall = lift / drag - float(draggy.get("glide_ratio"))
    assert fall == pytest.approx(lift / drag - lift / (drag + lumped), rel=0.1)


def test_line_drag_needs_no_variables_where_it_is_off():
    names = {
        drag: {v.name for core in (scene.structural_core(), scene.aero_core()) for v in core.variables}
        for drag in ("on", "off")
        for scene in [scenes.load("v3_kite", {"line_drag": drag})]
    }
    assert names["on"] - names["off"] == {"line_load", "line_force", "line_moment", "line_normal_drag", "line_friction"}
