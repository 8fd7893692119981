"""Folded and mirrored wings: points do not jump where a fold becomes a crease, halves are those of the whole, and the
mirror image of a wing has mirrored loads.
"""

from dataclasses import replace

import numpy as np
import pytest

from scenes.builders.profiles import naca
from scenes.builders.wings import Stations, lofted
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
    _, far = np.array([lifts(dihedral=angle, sweep=30.0) for angle in angles]).T
    # third differences of a smooth curve; panels whose points had jumped changed lift by 25 %
    assert np.abs(np.diff(far, 3)).max() < 1e-4 * far.mean()


@pytest.mark.parametrize(
    ("angles", "sweep"),
    [(np.arange(22.0, 23.05, 0.1), 0.0), (np.arange(24.0, 24.65, 0.1), 30.0), (np.arange(30.2, 30.85, 0.1), 30.0)],
)
def test_lift_by_pressure_is_a_continuous_function_of_the_fold(angles, sweep):
    """Wings made anew at every angle: values pass a fold less and less, until it is a crease."""
    by_pressure = np.array([lifts(dihedral=angle, sweep=sweep)[0] for angle in angles])
    # 1e-4 to 3e-4 measured in 0.1 degrees; neighbours that leave all at once change lift by 5e-3 to 2e-2
    assert np.abs(np.diff(by_pressure)).max() < 1e-3 * by_pressure.mean()


@pytest.mark.parametrize(("before", "after"), [(15.0, 25.0), (20.0, 26.0)])
def test_a_wing_that_is_folded_has_the_pressures_of_one_that_is_made_so(before, after):
    """What counts of neighbours follows the shape, although they were found on the wing at rest."""
    rest, folded = (wing(5, 24, dihedral=np.deg2rad(angle), sweep=np.deg2rad(30.0)) for angle in (before, after))
    found = []
    for surface in (rest, folded):
        model = panel_model(surface)
        out = model.solve(replace(flow(surface), nodes=folded.nodes), values(model)).outputs
        found.append(float(out["pressure_lift"]))
    assert found[0] == pytest.approx(found[1], rel=2e-3)


def test_pressures_on_a_flat_tip_hardly_change_where_it_is_lifted_a_little():
    """Neighbours over its edge are seen at a right angle, which says nothing of where they are in its plane."""
    surface = wing(8, 64)
    model = panel_model(surface)
    found = []
    for lift in np.linspace(-0.02, 0.02, 5):
        nodes = surface.nodes + np.outer(lift * (surface.nodes[:, 1] / 3.0) ** 2, [0.0, 0.0, 1.0])
        found.append(model.solve(replace(flow(surface), nodes=nodes), values(model)).outputs["pressure_coefficient"])
    tip = np.abs(surface.nodes[surface.panels, 1]).min(axis=1) == 3.0
    # -1.6 and 0.006 measured; -40 and 14 where neighbours have no direction
    assert np.min(found) > -3.0
    assert np.abs(np.diff(found, axis=0))[:, tip].max() < 0.03


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


@pytest.mark.parametrize("tip", ["flat", "round"])
def test_the_mirror_image_of_an_asymmetric_wing_has_mirrored_loads(tip):
    """Its panels are warped: first diagonals must be mirrored too."""
    place = np.array([[0.0, -3.0, 0.0], [0.2, -1.0, 0.0], [0.3, 0.0, 0.1], [0.5, 3.0, 0.3]])
    chord, twist, roll = (
        np.array([1.0, 1.0, 0.9, 0.6]),
        np.deg2rad([0.0, 2.0, 3.0, 8.0]),
        np.deg2rad([0.0, 2.0, 0, 10.0]),
    )
    found = []
    for order, sign in ((slice(None), 1.0), (slice(None, None, -1), -1.0)):
        stations = Stations(place[order] * [1.0, sign, 1.0], chord[order], twist[order], sign * roll[order])
        stations, profiles = stations.between(3, naca("2412").points(24))
        surface = lofted(stations.sections(profiles), tip)
        model = panel_model(surface)
        found.append(model.solve(flow(surface, beta=sign * 0.1), values(model)))
    one, other = found
    scale = np.abs(one.force).max()
    # the residual is 1e-10 and the equations are the same but for their order
    np.testing.assert_allclose(other.force * [1.0, -1.0, 1.0], one.force, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(other.moment * [-1.0, 1.0, -1.0], one.moment, rtol=0, atol=1e-9 * 3.0 * scale)
    np.testing.assert_allclose(other.outputs["circulation"][::-1], one.outputs["circulation"], rtol=1e-8)
    assert other.outputs["warp"] == pytest.approx(one.outputs["warp"], rel=1e-9)


def test_warp_is_told_over_the_width_of_a_panel_not_over_its_length():
    """Corners of a twisted strip leave the plane of its panel by the twist times the width along the chord, however
    wide the strip is.
    """
    found = []
    for span in (40.0, 80.0):
        surface = wing(4, 24, span=span, twist=np.deg2rad(8.0))
        model = panel_model(surface)
        found.append(model.solve(flow(surface), values(model)).outputs["warp"])
    assert found[0] > 0.01
    # the narrowest strip is 1.5 m wide, its panels 0.13 m at most: a diagonal is 0.4 % longer than a side
    assert found[1] == pytest.approx(found[0], rel=0.01)
