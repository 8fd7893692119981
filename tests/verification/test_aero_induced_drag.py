"""Induced drag of swept, kinked and arched wings against the Trefftz plane."""

import numpy as np
import pytest

from tests.aero.wings import linear_wing, nodes_of

SPAN, CHORD, INCIDENCE, SPEED, DENSITY = 6.0, 1.0, np.deg2rad(6.0), 10.0, 1.225
ALONG = np.array([np.cos(INCIDENCE), 0.0, np.sin(INCIDENCE)])
UP = np.array([-np.sin(INCIDENCE), 0.0, np.cos(INCIDENCE)])
# Shapes: x and z of the leading edge over y.
SHAPES = {
    "straight": (lambda y: 0.0 * y, lambda y: 0.0 * y),
    "swept by 25 degrees": (lambda y: np.abs(y) * np.tan(np.deg2rad(25.0)), lambda y: 0.0 * y),
    "V with 30 degrees of anhedral": (lambda y: 0.0 * y, lambda y: -np.abs(y) * np.tan(np.deg2rad(30.0))),
    "arched like a kite": (lambda y: 0.0 * y, lambda y: -0.9 * (y / 3.0) ** 2),
}


def flown(shape, strips):
    """Lift and drag N of a wing of thin sections (c_d = 0), the circulation and the trailing edge (n+1,3) m."""
    y = np.linspace(-0.5 * SPAN, 0.5 * SPAN, strips + 1)
    leading_edge = np.stack([SHAPES[shape][0](y), y, SHAPES[shape][1](y)], axis=1)
    trailing_edge = leading_edge + np.array([CHORD, 0.0, 0.0])
    loads = linear_wing(strips, density=DENSITY).loads(nodes_of(leading_edge, trailing_edge), SPEED * ALONG)
    force = loads.total_force()
    return force @ UP, force @ ALONG, loads.circulation.gamma, trailing_edge


def trefftz_drag(gamma, trailing_edge):
    """Induced drag N from the trace of the wake: -rho/2 sum gamma_i (flux through the trace of strip i).

    The flux of a point vortex through a segment is Gamma / 2 pi times the logarithm of the ratio of its distances to
    the ends; those that leave from its own ends are taken at its middle, where they have the distance of half of it.
    """
    trace = np.stack([trailing_edge[:, 1], trailing_edge @ UP], axis=1)
    shed = np.diff(gamma, prepend=0.0, append=0.0)  # d gamma shed at each section
    d = np.linalg.norm(trace[:, None] - trace[None], axis=2)  # section k to section j
    with np.errstate(divide="ignore", invalid="ignore"):
        flux = np.log(d[1:] / d[:-1])  # strip i, vortex j
    i = np.arange(len(gamma))
    flux[i, i], flux[i, i + 1] = 2.0, -2.0  # midpoint rule: length over half the length
    return float(0.5 * DENSITY * gamma @ (flux @ shed) / (2.0 * np.pi))


@pytest.mark.parametrize("shape", SHAPES)
def test_section_forces_add_up_to_the_drag_of_the_trefftz_plane(shape):
    ratios = []
    for strips in (20, 40, 80):
        _, drag, gamma, trailing_edge = flown(shape, strips)
        ratios.append(drag / abs(trefftz_drag(gamma, trailing_edge)))
    # 1 % to 2 %: the wake leaves the trailing edge, not the bound vortex, and section forces turn by finite angles
    assert np.abs(np.array(ratios) - 1.0).max() < 0.025
    # no drift but that of the two quadratures: neither kink nor sweep has a singular wash
    assert np.ptp(ratios) < 0.012


@pytest.mark.parametrize("shape", list(SHAPES)[:2])
def test_planar_wings_have_a_span_efficiency_of_at_most_one(shape):
    lift, drag, _, _ = flown(shape, 40)
    q = 0.5 * DENSITY * SPEED**2
    assert 0.9 < lift**2 / (np.pi * q * SPAN**2 * drag) <= 1.02  # 40 equal strips: 1 % too much
