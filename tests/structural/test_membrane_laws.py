"""Stress of membranes that are taut, wrinkled or slack: the projection on stresses without compression."""

import numpy as np
import pytest

from structural.materials.membranes import SLACK, TAUT, WRINKLED, LinearMembrane, isotropic_membrane
from tests.structural.models import central_difference

# E1 / E2 and G / E1. With E1 = E2 and G = E1 / 200 the scaled compliance is furthest from isotropic (kappa = 100).
KINDS = [(ratio, shear) for ratio in (1.0, 3.0, 30.0, 100.0) for shear in (0.4, 0.05, 0.005)]
NEAR = 1e-4  # strains that far from a border of states are clear of it, relative to strains of about 1
STEP = 1e-6  # truncation h^2 and rounding eps / h of central differences: 1e-9 of strains and stiffnesses of about 1


def membranes(ratio, shear, count, nu=0.3):
    """`count` rows of an orthotropic membrane with E1 = 1 N/m."""
    one = np.ones(count)
    return LinearMembrane(one, one / ratio, nu * one, shear * one)


def turned(strain, angle):
    """A strain (3,n) in axes that are turned by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    e1, e2, g = strain
    return np.stack(
        [
            c * c * e1 + s * s * e2 + s * c * g,
            s * s * e1 + c * c * e2 - s * c * g,
            2 * s * c * (e2 - e1) + (c * c - s * s) * g,
        ]
    )


def clear_states(law, rng, state, count=100):
    """`count` random strains (3,count) in a state, each NEAR or more from a border, the fibres at any angle to them."""
    found = []
    while sum(f.shape[1] for f in found) < count:
        strain = turned(np.concatenate([rng.uniform(-1, 1, (2, len(law))), np.zeros((1, len(law)))]),
                        rng.uniform(0.0, 0.5 * np.pi, len(law)))  # fmt: skip
        around = [law.state(strain + NEAR * d[:, None]) for d in np.concatenate([np.eye(3), -np.eye(3)])]
        found.append(strain[:, np.all([s == state for s in around], axis=0)])
    return np.concatenate(found, axis=1)[:, :count]


def eigenvalues(s1, s2, s12):
    mean, radius = 0.5 * (s1 + s2), np.hypot(0.5 * (s1 - s2), s12)
    return mean - radius, mean + radius


@pytest.mark.parametrize(("ratio", "shear"), KINDS)
@pytest.mark.parametrize("state", [TAUT, WRINKLED, SLACK])
def test_the_tangent_is_the_derivative_of_the_stress(ratio, shear, state):
    strain = clear_states(membranes(ratio, shear, 4000), np.random.default_rng(0), state)
    law = membranes(ratio, shear, strain.shape[1])
    rows = law.response(strain)[1]
    tangent = rows[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    for k in range(strain.shape[1]):
        one = law.select(np.array([k]))
        numbers = central_difference(lambda e, one=one: one.response(e[:, None])[0], strain[:, k], STEP)
        np.testing.assert_allclose(tangent[:, :, k], numbers, atol=1e-8)  # ten times what the differences leave


@pytest.mark.parametrize(("ratio", "shear"), KINDS)
def test_the_stress_is_the_one_projection_on_stresses_without_compression(ratio, shear):
    # Karush, Kuhn and Tucker: S >= 0, C^-1 S - E >= 0, and both have no work on one another; no other stress has these
    rng = np.random.default_rng(1)
    law = membranes(ratio, shear, 5000)
    strain = rng.normal(size=(3, 5000))
    stress, _ = law.response(strain)
    missing = law.strain(stress) - strain
    assert eigenvalues(*stress)[0].min() >= -1e-15  # rounding of stresses of about 1
    assert eigenvalues(missing[0], missing[1], 0.5 * missing[2])[0].min() >= -1e-14
    assert np.abs(np.sum(stress * missing, axis=0)).max() <= 1e-13
    assert set(law.state(strain)) == {SLACK, WRINKLED, TAUT}


@pytest.mark.parametrize(("ratio", "shear"), KINDS)
def test_no_direction_of_wrinkles_has_more_energy_than_the_one_found(ratio, shear):
    # of the several maxima of the energy over the direction (E ratios of 20 and more, small G) the largest counts
    law = membranes(ratio, shear, 300)
    strain = np.random.default_rng(2).normal(size=(3, 300))
    angle = np.linspace(0.0, np.pi, 2001)[:, None]
    c, s = np.cos(angle), np.sin(angle)
    along = c * c * strain[0] + s * s * strain[1] + s * c * strain[2]
    soft = c**4 / law.E1 + s**4 / law.E2 + s * s * c * c * (1.0 / law.G - 2.0 * law.nu12 / law.E1)
    best = (0.5 * np.maximum(along, 0.0) ** 2 / soft).max(axis=0)
    found = law.energy(strain)
    wrinkled = law.state(strain) == WRINKLED
    assert np.all(found[wrinkled] >= best[wrinkled] - 1e-14)
    # two thousandths of a degree apart the largest sample is below the maximum by the square of that over the width
    np.testing.assert_allclose(found[wrinkled], best[wrinkled], rtol=1e-3)


@pytest.mark.parametrize(("ratio", "shear"), KINDS)
def test_the_stress_is_continuous_across_the_borders_of_states(ratio, shear):
    rng = np.random.default_rng(3)
    count = 2000
    law = membranes(ratio, shear, count)
    inside, outside = rng.normal(size=(3, count)), rng.normal(size=(3, count))
    change = law.state(inside) != law.state(outside)
    law = membranes(ratio, shear, int(change.sum()))
    a, b = inside[:, change], outside[:, change]
    for _ in range(60):  # bisection down to neighbouring numbers
        middle = 0.5 * (a + b)
        same = law.state(middle) == law.state(a)
        a, b = np.where(same, middle, a), np.where(same, b, middle)
    gap = np.abs(law.response(a)[0] - law.response(b)[0]).max()
    assert gap <= 1e-14  # a stiffness of 1.1 times strains a rounding apart, and rounding; 1e-9 is asked for


def test_wrinkles_of_an_isotropic_membrane_lie_along_the_larger_principal_strain():
    rng = np.random.default_rng(4)
    law = isotropic_membrane(np.full(100, 2.0), np.full(100, 0.3))
    first = rng.uniform(0.1, 1.0, 100)
    second = -rng.uniform(0.31, 2.0, 100) * first  # below -nu E1
    angle = rng.uniform(0.0, np.pi, 100)
    strain = turned(np.stack([first, second, np.zeros(100)]), -angle)
    stress, _ = law.response(strain)
    c, s = np.cos(angle), np.sin(angle)
    np.testing.assert_allclose(stress, 2.0 * first * np.stack([c * c, s * s, s * c]), atol=1e-15)  # E h E1 n n


def test_the_energy_is_convex_and_its_derivative_the_stress():
    rng = np.random.default_rng(5)
    law = membranes(30.0, 0.005, 500)
    a, b = rng.normal(size=(2, 3, 500))
    assert np.all(law.energy(0.5 * (a + b)) <= 0.5 * (law.energy(a) + law.energy(b)) + 1e-14)
    d = rng.normal(size=(3, 500))
    slope = (law.energy(a + STEP * d) - law.energy(a - STEP * d)) / (2.0 * STEP)
    np.testing.assert_allclose(slope, np.sum(law.response(a)[0] * d, axis=0), atol=1e-8)


def test_without_wrinkling_compression_is_resisted_like_tension():
    law = isotropic_membrane(np.ones(1), np.full(1, 0.3), wrinkles=False)
    strain = np.array([[-0.1], [-0.2], [0.05]])
    np.testing.assert_allclose(law.response(strain)[0], -law.response(-strain)[0], rtol=1e-15)
    assert law.state(strain) == TAUT


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ((1.0, 0.0, 0.3, 0.4), "number 1 has E2 = 0 N/m; it must be above zero"),
        ((np.nan, 1.0, 0.3, 0.4), "number 1 has E1 = nan N/m"),
        ((1.0, 1.0, 0.3, -1.0), "number 1 has G = -1 N/m"),
        ((1.0, 4.0, 0.6, 0.4), "nu12 = 0.6 with E1 = 1 and E2 = 4 N/m; the size of nu12 must be below .* = 0.5"),
    ],
)
def test_materials_that_do_not_exist_are_refused_with_their_values(values, sentence):
    with pytest.raises(ValueError, match=sentence):
        LinearMembrane(*(np.array([v]) for v in values))


def test_poissons_ratio_of_an_isotropic_membrane_has_limits():
    with pytest.raises(ValueError, match=r"number 2 has nu = 1; .* between -1 and 1"):
        isotropic_membrane(np.ones(2), np.array([0.3, 1.0]))


def test_at_rest_the_tangent_is_taut_whatever_rounding_makes_of_the_strain():
    law = membranes(3.0, 0.4, 400)
    strain = 1e-16 * np.random.default_rng(3).normal(size=(3, 400))
    assert set(law.state(strain)) == {SLACK, WRINKLED, TAUT}
    stress, slope = law.response(strain, rounding=1e-14)
    c11, c12, c22 = law.plane
    np.testing.assert_array_equal(slope, np.stack([c11, c12, 0 * c11, c22, 0 * c11, law.G]))
    np.testing.assert_array_equal(stress, law.response(strain)[0])  # the stress is the projection all the same
    far = 1e3 * strain
    np.testing.assert_array_equal(law.response(far, rounding=1e-14 * 1e-3)[1], law.response(far)[1])


def test_a_scaled_membrane_has_the_scaled_stress():
    law = membranes(30.0, 0.05, 300)
    strain = np.random.default_rng(4).uniform(-1, 1, (3, 300))
    factor = np.linspace(0.1, 2.0, 300)
    np.testing.assert_allclose(law.scaled(factor).response(strain)[0], factor * law.response(strain)[0], atol=1e-14)
