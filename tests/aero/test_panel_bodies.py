"""Topology of closed bodies: edges, trailing edges, strips, creases, halves, wakes."""

import numpy as np
import pytest

from aero.panel.bodies import Body, BodyError
from aero.panel.velocities import Neighbours
from interface.panels import area_vectors
from tests.aero.closed_shapes import all_triangles, box_wing, cube, ellipsoid, half_fin, volume, wing, with_image

NONE = np.zeros((0, 2), dtype=int)
ROUNDING = 1e-12  # of areas and volumes of order one, sums of some thousand terms

WINGS = {
    "rectangular": lambda: wing(),
    "odd number of panels": lambda: wing(25),
    "round tips": lambda: wing(caps="round"),
    "swept back": lambda: wing(sweep=np.radians(60.0), tip=0.4),
    "swept forward": lambda: wing(sweep=np.radians(-30.0)),
    "arc": lambda: wing(span=25.0, root=7.9, tip=2.0, arc=np.radians(60.0), chords="elliptic", axis=0.35),
    "cambered, twisted": lambda: wing(profile="4415", twist=np.radians(-8.0), dihedral=np.radians(10.0)),
    "box wing": box_wing,
}


def turned_up(surface, angle):
    """The surface turned about x by an angle, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return surface.nodes @ np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


@pytest.mark.parametrize("shape", WINGS)
def test_a_closed_surface_has_two_panels_at_every_edge_and_its_number_of_handles(shape):
    surface = WINGS[shape]()
    body = Body.of(surface.nodes, surface.panels)
    assert np.all(body.sides >= 0)
    characteristic = len(np.unique(surface.panels)) - len(body.edges) + len(body.panels)
    assert characteristic == (0 if shape == "box wing" else 2)  # Euler-Poincare: torus and sphere
    for edge, sides in zip(body.edges.tolist(), body.sides.tolist(), strict=True):
        for panel, (a, b) in zip(sides, (edge, edge[::-1]), strict=True):  # the second runs the other way
            ring = list(dict.fromkeys(body.panels[panel].tolist()))
            assert ring[(ring.index(a) + 1) % len(ring)] == b


@pytest.mark.parametrize("shape", WINGS)
def test_trailing_edges_are_found_where_the_generator_put_them(shape):
    surface = WINGS[shape]()
    given = Body.of(surface.nodes, surface.panels, surface.trailing_edges)
    found = Body.of(surface.nodes, surface.panels)
    assert set(map(tuple, given.trailing.tolist())) == set(map(tuple, found.trailing.tolist()))
    ends = found.trailing[:, 2:]  # in the order of the span: each begins where the one before ends
    assert np.count_nonzero(~np.any(ends[1:, :, None] == ends[:-1, None], axis=(1, 2))) == 0


@pytest.mark.parametrize("shape", WINGS)
def test_upper_panels_run_along_the_trailing_edge_and_look_up_or_outward(shape):
    surface = WINGS[shape]()
    body = Body.of(surface.nodes, surface.panels)
    upper, lower, a, b = body.trailing.T
    along = body.panels[upper] == a[:, None]
    assert np.array_equal(body.panels[upper][np.roll(along, 1, axis=1)], b)
    difference = area_vectors(surface.nodes[body.panels[upper]]) - area_vectors(surface.nodes[body.panels[lower]])
    middle = surface.nodes[a] * [0.0, 1.0, 1.0]
    outward = np.einsum("tk,tk->t", difference, middle) if shape == "box wing" else difference[:, 2]
    assert np.all(outward > 0.0)


@pytest.mark.parametrize("shape", WINGS)
def test_strips_go_from_the_upper_panel_round_the_nose_to_the_lower_one(shape):
    surface = WINGS[shape]()
    body = Body.of(surface.nodes, surface.panels)
    count = 25 if shape.startswith("odd") else 24
    assert {len(strip) for strip in body.strips} == {count}
    pairs = {frozenset(pair) for pair in body.sides.tolist()}
    for strip, (upper, lower, _, _) in zip(body.strips, body.trailing.tolist(), strict=True):
        assert (strip[0], strip[-1]) == (upper, lower)
        assert all(frozenset(pair) in pairs for pair in zip(strip[:-1].tolist(), strip[1:].tolist(), strict=True))
        x = surface.nodes[surface.panels[strip]].mean(axis=1)[:, 0]
        assert 1 <= np.argmin(x) < count - 1
    every = np.concatenate(body.strips)
    assert len(np.unique(every)) == len(every) == count * len(body.trailing)


def test_numbers_of_nodes_and_panels_and_first_corners_mean_nothing():
    surface, random = wing(caps="round"), np.random.default_rng(3)
    place = random.permutation(len(surface.nodes))
    nodes = np.empty_like(surface.nodes)
    nodes[place] = surface.nodes
    order = random.permutation(len(surface.panels))
    panels = place[surface.panels][order]
    quads = panels[:, 2] != panels[:, 3]
    panels[quads] = np.roll(panels[quads], 1, axis=1)
    one, other = Body.of(surface.nodes, surface.panels), Body.of(nodes, panels)
    expected = {
        tuple(place[row[2:]]): place[surface.panels[s]] for row, s in zip(one.trailing, one.strips, strict=True)
    }
    assert set(expected) == {tuple(row) for row in other.trailing[:, 2:].tolist()}
    for row, strip in zip(other.trailing, other.strips, strict=True):
        corners = expected[tuple(row[2:])]
        assert np.array_equal(np.sort(panels[strip], axis=1), np.sort(corners, axis=1))


def test_triangles_have_trailing_edges_but_no_strips():
    surface = wing()
    body = Body.of(*all_triangles(surface))
    assert set(map(tuple, body.trailing[:, 2:].tolist())) == set(
        map(tuple, surface.trailing_edges[:, ::-1].tolist())
    ) or (len(body.trailing) == len(surface.trailing_edges))
    assert all(len(strip) == 0 for strip in body.strips)
    assert np.all(np.count_nonzero(body.of_panel >= 0, axis=1) == 3)


def test_neighbours_are_mutual_and_across_smooth_edges_only():
    surface = wing()
    body = Body.of(surface.nodes, surface.panels)
    smooth = np.setdiff1d(np.arange(len(body.edges)), [*body.trailing_edge, *body.creases])
    around = Neighbours.across(len(body.panels), body.sides, smooth)
    of = np.repeat(np.arange(len(body.panels)), np.diff(around.start))
    pairs = set(zip(of.tolist(), around.panel.tolist(), strict=True))
    assert pairs == {(b, a) for a, b in pairs}
    assert len(pairs) == 2 * len(smooth)
    assert np.array_equal(np.sort(np.stack([of, around.panel]), axis=0), np.sort(body.sides[around.edge].T, axis=0))
    panel, neighbour, edge = around.of(np.array([7, 3]))
    assert all(set(body.sides[e]) == {(7, 3)[p], n} for p, n, e in zip(panel, neighbour, edge, strict=True))
    assert len(panel) == np.isin(body.sides[smooth], [3, 7]).sum()


@pytest.mark.parametrize("n", [2, 5])
def test_a_cube_is_creased_at_its_twelve_edges_and_nowhere_else(n):
    nodes, panels = cube(n)
    assert len(Body.of(nodes, panels, NONE).creases) == 12 * n


@pytest.mark.parametrize("n", [1, 2, 8])
def test_a_sphere_is_smooth_however_coarse(n):
    nodes, panels = ellipsoid(n)
    assert len(Body.of(nodes, panels, NONE).creases) == 0


@pytest.mark.parametrize("panels", [24, 78])
def test_a_round_nose_is_no_crease_but_the_rim_of_a_flat_tip_is(panels):
    surface = wing(panels)
    body = Body.of(surface.nodes, surface.panels)
    assert np.all(np.abs(np.abs(surface.nodes[body.edges[body.creases]][:, :, 1]) - 3.0) < ROUNDING)
    assert len(body.creases) == 2 * panels
    surface = wing(panels, caps="round")
    assert len(Body.of(surface.nodes, surface.panels).creases) == 0


@pytest.mark.parametrize("shape", WINGS)
def test_a_half_has_half_of_the_surface_and_gives_back_the_whole(shape):
    surface = WINGS[shape]()
    nodes, whole = surface.nodes, Body.of(surface.nodes, surface.panels)
    half = whole.half(nodes)
    area = area_vectors(nodes[whole.panels])
    assert np.allclose(half.whole(area[half.panels]), area, rtol=0.0, atol=ROUNDING)
    assert np.array_equal(half.whole(np.arange(len(half.panels)))[half.panels], np.arange(len(half.panels)))
    assert 2 * len(half.panels) == len(whole.panels)
    own = half.body.trailing
    assert np.array_equal(half.panels[own[:, :2]], whole.trailing[half.strips, :2])
    assert np.array_equal(own[:, 2:], whole.trailing[half.strips, 2:])
    assert np.all(half.sign == 1.0)
    y = nodes[whole.trailing[:, 2:], 1].mean(axis=1)
    assert np.allclose(half.whole_strips(y[half.strips]), np.abs(y), rtol=0.0, atol=ROUNDING)
    assert np.all(nodes[half.body.edges[half.body.open_edges], 1] == 0.0)
    for strip, row in zip(half.body.strips, half.strips, strict=True):
        assert np.array_equal(half.panels[strip], whole.strips[row])


@pytest.mark.parametrize("shape", WINGS)
def test_a_half_of_its_own_is_the_half_of_the_whole(shape):
    surface = WINGS[shape]()
    half = Body.of(surface.nodes, surface.panels).half(surface.nodes)
    alone = Body.of(surface.nodes, surface.panels[half.panels], symmetric=True)
    for name in ("trailing", "strips"):
        one, other = (sorted(map(tuple, getattr(body, name))) for body in (alone, half.body))
        assert one == other
    ends = [np.sort(np.sort(b.edges[b.creases], axis=1), axis=0) for b in (alone, half.body)]
    assert np.array_equal(*ends)


def test_jumps_change_sign_in_the_image_where_upper_sides_do():
    fin = wing(strips=2, spacing="uniform")
    right = turned_up(fin, 0.5 * np.pi) + np.array([0.0, 2.0, 0.0])
    nodes, panels = with_image(right, fin.panels)
    whole = Body.of(nodes, panels)
    half = whole.half(nodes)
    up = area_vectors(nodes[panels[whole.trailing[:, 0]]])
    assert np.all(up[:, 1] > 0.0)  # a fin has no upper side: that of larger y stands for it, on both of them
    assert np.array_equal(half.sign, np.where(nodes[whole.trailing[:, 2], 1] > 0.0, 1.0, -1.0))
    assert whole.component.max() == 1


def test_there_is_no_jump_across_a_trailing_edge_in_the_plane_of_symmetry():
    nodes, panels = with_image(*half_fin(strips=2))
    whole = Body.of(nodes, panels)
    half = whole.half(nodes)
    assert len(whole.trailing) == 2
    assert len(half.strips) == 0
    assert np.array_equal(half.whole_strips(np.zeros(0)), np.zeros(2))


def test_a_wake_must_not_begin_inside_the_body():
    surface = wing()
    body = Body.of(surface.nodes, surface.panels)
    for alpha in (-40.0, 0.0, 40.0):
        body.check_wake(surface.nodes, (np.cos(np.radians(alpha)), 0.0, np.sin(np.radians(alpha))))
    with pytest.raises(BodyError, match=r"goes into the body at its own trailing edges 1, 2, 3, 4, 5 and 7 more"):
        body.check_wake(surface.nodes, (-1.0, 0.0, 0.0))


@pytest.mark.parametrize(("height", "hit"), [(-0.5, False), (0.0, True), (0.04, True), (0.5, False)])
def test_a_wake_must_not_go_through_a_body_behind(height, hit):
    front, n = wing(), len(wing().nodes)
    nodes = np.concatenate([front.nodes, front.nodes + np.array([3.0, 0.1, height])])
    body = Body.of(nodes, np.concatenate([front.panels, front.panels + n]))
    if not hit:
        body.check_wake(nodes, (1.0, 0.0, 0.0))
        return
    with pytest.raises(
        BodyError, match=r"the wake of trailing edge \d+ \(at panel \d+\) goes through the body at panel"
    ):
        body.check_wake(nodes, (1.0, 0.0, 0.0))
    body.check_wake(nodes, (np.cos(0.3), 0.0, -np.sin(0.3)))  # passes below


def test_the_aspect_ratio_of_a_strip_is_its_span_over_its_chord():
    surface = wing(panels=200, strips=3, spacing="uniform", span=30.0, tip=2.0, root=2.0)
    body = Body.of(surface.nodes, surface.panels)
    # to the centre of the panel at the nose, a panel of 6e-5 of the chord behind it
    assert np.allclose(body.strip_aspect_ratios(surface.nodes), 2.5, rtol=1e-3)


@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (3.0, 1.0, 0.5)])
def test_volumes_of_ellipsoids_converge_with_order_two(axes):
    exact = 4.0 / 3.0 * np.pi * np.prod(axes)
    error = []
    for n in (8, 16):
        nodes, panels = ellipsoid(n, axes)
        error.append(exact - volume(nodes, Body.of(nodes, panels, NONE).panels))
    assert np.log2(error[0] / error[1]) == pytest.approx(2.0, abs=0.1)  # a chord under an arc; higher terms fall with n
