"""Folded wings: their points do not jump where a fold becomes a crease, and a half is the half of the whole."""

import numpy as np
import pytest

from tests.aero.closed_wings import flow, panel_model, values, wing


def lifts(beta=0.0, symmetric=1.0, **angles):
    """Lift N by pressure and in the Trefftz plane of a wing with `angles` in degrees."""
    surface = wing(5, 24, **{name: np.deg2rad(angle) for name, angle in angles.items()})
    model = panel_model(surface)
    found = model.solve(flow(surface, beta=beta), values(model, symmetric=symmetric)).outputs
    assert bool(found["symmetry_used"]) == (symmetric and beta == 0.0)
    return float(found["pressure_lift"]), float(found["trefftz_lift"])


def test_the_lift_of_a_folded_wing_is_the_limit_of_little_sideslip():
    straight, yawed = (lifts(beta=beta, dihedral=20.0, sweep=30.0) for beta in (0.0, 1e-5))
    np.testing.assert_allclose(yawed, straight, rtol=1e-6)  # even in sideslip: it changes by some 1e-10


def test_lift_goes_smoothly_through_the_angle_at_which_folds_become_creases():
    """Sections turn by 45 degrees at the middle of a wing with 30 degrees of sweep and some 20 of dihedral."""
    angles = np.arange(18.0, 25.5, 1.0)
    by_pressure, far = np.array([lifts(dihedral=angle, sweep=30.0) for angle in angles]).T
    # third differences of a smooth curve; panels whose points had jumped changed lift by 25 %
    assert np.abs(np.diff(far, 3)).max() < 1e-4 * far.mean()
    # velocities are not averaged across a crease, of which the pressures at the fold know
    assert np.abs(np.diff(by_pressure)).max() < 0.01 * by_pressure.mean()


@pytest.mark.parametrize(
    "angles", [{"sweep": 45.0}, {"sweep": 50.0}, {"dihedral": 20.0, "sweep": 30.0}, {"dihedral": 50.0}]
)
def test_one_half_of_a_folded_wing_gives_the_loads_of_the_whole(angles):
    surface = wing(5, 24, **{name: np.deg2rad(angle) for name, angle in angles.items()})
    model = panel_model(surface)
    half, whole = (model.solve(flow(surface), values(model, symmetric=on)) for on in (1.0, 0.0))
    assert half.symmetric
    assert not whole.symmetric
    # residuals of 1e-10 times the condition of the equations
    for name, scale in (("pressure_lift", 360.0), ("trefftz_lift", 360.0), ("pressure_coefficient", 1.0)):
        np.testing.assert_allclose(half.outputs[name], whole.outputs[name], rtol=0, atol=1e-8 * scale, err_msg=name)
