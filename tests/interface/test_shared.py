"""What rooms share: open and closed meshes, products over either axis, bounds in words, one law for lines."""

import numpy as np
import pytest

import scenes
from interface import SurfaceMesh, Variable, cross
from interface.line_drag import line_drag, line_force_and_slopes
from interface.mesh import station_panels
from interface.mirror import canonical_faces, mirror_rows
from interface.panels import area_vectors, corner_shares
from interface.variables import allowed, first_outside
from tests.structural.models import TANGENT_TOLERANCE, central_difference

CORNERS = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]])
FACES = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
OCTAHEDRON = np.column_stack([FACES, FACES[:, 2]])  # triangles repeat their last corner


def test_a_body_is_closed_and_a_sheet_is_open():
    assert SurfaceMesh(CORNERS, OCTAHEDRON).closed
    assert not SurfaceMesh(CORNERS, OCTAHEDRON[:-1]).closed  # a hole
    turned = OCTAHEDRON.copy()
    turned[0] = turned[0, [1, 0, 2, 2]]
    assert not SurfaceMesh(CORNERS, turned).closed  # one panel looks inwards
    assert not SurfaceMesh(CORNERS, np.concatenate([OCTAHEDRON, OCTAHEDRON[:1]])).closed  # one stands twice
    assert not SurfaceMesh(CORNERS, OCTAHEDRON[:0]).closed
    for name in ("v3_kite", "v3_kite_detailed", "tether_in_wind"):
        assert not scenes.load(name).interface.closed


def test_area_vectors_of_a_closed_body_sum_to_zero_and_point_outward():
    area = area_vectors(CORNERS[OCTAHEDRON])
    assert area.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-15)
    assert np.all(np.einsum("pc,pc->p", area, CORNERS[FACES].mean(axis=1)) > 0.0)
    assert np.linalg.norm(area, axis=1) == pytest.approx(np.full(8, np.sqrt(3.0) / 2.0), rel=1e-15)


def test_panels_between_sections_look_to_suction():
    nodes = np.stack(np.meshgrid([0.0, 1.0, 2.0], [0.0, 0.3, 1.0], indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.column_stack([nodes[:, 1], nodes[:, 0], 0.0 * nodes[:, 0]])  # y along the span, x aft
    panels = station_panels(np.arange(9).reshape(3, 3))
    assert area_vectors(points[panels])[:, 2] == pytest.approx([0.3, 0.3, 0.7, 0.7], rel=1e-14)
    assert corner_shares(points[panels]) == pytest.approx(np.full((4, 4), 0.25), rel=1e-14)


def test_cross_products_over_the_last_and_the_first_axis_are_those_of_numpy():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(4, 5, 3)), rng.normal(size=(5, 3)) + 1j * rng.normal(size=(5, 3))
    assert cross(a, b) == pytest.approx(np.cross(a, b), rel=1e-14)
    first = cross(np.moveaxis(a, -1, 0), b.T[:, None], axis=0)
    assert np.moveaxis(first, 0, -1) == pytest.approx(np.cross(a, b), rel=1e-14)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (None, None, "finite"),
        (0.0, None, "at least 0 m"),
        (None, 2.5, "at most 2.5 m"),
        (-1.0, 1.0, "between -1 and 1 m"),
        (-np.inf, np.inf, "finite"),
    ],
)
def test_bounds_are_told_in_words(low, high, words):
    assert allowed(low, high, "m") == words
    assert allowed(low, high) == words.removesuffix(" m")


def test_the_first_value_that_is_not_within_its_bounds_is_found():
    values = np.array([[0.0, 1.0], [np.nan, 5.0]])
    assert first_outside(values) == 2
    assert first_outside(values, 0.5) == 0
    assert first_outside(np.array([0.0, 1.0, 5.0]), 0.0, 4.0) == 2
    assert first_outside(np.array([0.0, 1.0]), np.array([0.0, 2.0])) == 1
    assert first_outside(np.zeros(0)) is None
    assert first_outside(3.0, 3.0, 3.0) is None
    assert Variable("a", (2, 3)).size == 6


@pytest.mark.parametrize("law", ["inclined", "projected"])
def test_slopes_of_the_force_on_a_line_are_its_derivatives(law):
    rng = np.random.default_rng(3)
    for _ in range(50):
        axis, wind = rng.normal(size=(1, 3)), 10.0 * rng.normal(size=(1, 3))
        air = np.array([0.004]), 1.2, 1.1, 0.02, law
        force, by_axis, by_air = line_force_and_slopes(axis, wind, *air)
        assert force == pytest.approx(np.linalg.norm(axis) * line_drag(axis, wind, *air), rel=1e-14)

        def along_axis(d, wind=wind, air=air):
            return np.linalg.norm(d) * line_drag(d, wind, *air)

        def in_wind(v, axis=axis, air=air):
            return np.linalg.norm(axis) * line_drag(axis, v, *air)

        for slope, exact in (
            (by_axis, central_difference(along_axis, axis)),
            (by_air, central_difference(in_wind, wind)),
        ):
            assert np.abs(slope[0] - exact).max() <= TANGENT_TOLERANCE * np.abs(exact).max()


def test_a_triangle_that_repeats_any_corner_finds_its_mirror_image():
    """Both halves of a plate of two triangles with four corners each, listed from other corners and the other way."""
    panels = np.array([[0, 1, 2, 2], [4, 4, 3, 5]])
    mirror = np.array([3, 4, 5, 0, 1, 2])
    assert mirror_rows(panels, mirror, canonical_faces).tolist() == [1, 0]
    assert canonical_faces(np.array([[3, 1, 1, 2], [0, 3, 1, 2]])).tolist() == [[1, 2, 3, 3], [0, 1, 2, 3]]
