"""Influence of panels and wake strips: integrals, sums over closed bodies, jumps, multipoles, images, kernels."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from aero.panel.influence import (
    PanelGeometry,
    doublet_matrix,
    induced_velocity,
    influence,
    memory_needed,
    source_potential,
    wake_matrix,
    wake_velocity,
)
from aero.panel.kernels import compiled

EXACT = np.inf  # `far`: no multipoles
KERNELS = [
    "numpy",
    pytest.param("compiled", marks=pytest.mark.skipif(compiled() is None, reason="no C compiler at installation")),
]
PANELS = {
    "square": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    "slender": [[0, 0, 0], [10, 0, 0], [10, 1, 0], [0, 1, 0]],
    "trapezium": [[0, 0, 0], [1, 0, 0], [0.8, 0.5, 0], [0.3, 0.6, 0]],
    "triangle": [[0, 0, 0], [1, 0, 0], [0.4, 0.8, 0], [0.4, 0.8, 0]],
    "triangle that repeats its first corner": [[0, 0, 0], [0, 0, 0], [1, 0, 0], [0.4, 0.8, 0]],
    "dart": [[0, 0, 0], [1, 0, 0], [0.3, 0.3, 0], [0, 1, 0]],
    "dart whose first diagonal is outside": [[0, 1, 0], [0, 0, 0], [1, 0, 0], [0.3, 0.3, 0]],
    "warped": [[0, 0, 0.2], [1, 0, 0], [1.1, 1, 0.1], [0, 0.9, 0]],
}


def panel(name):
    """One panel of that shape somewhere in space; its corners (4,3)."""
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    return np.array(PANELS[name], dtype=float) @ turn.T + [0.3, -0.2, 0.5]


def geometry_of(corners):
    return PanelGeometry.of(corners, [[0, 1, 2, 3]])


def ellipsoid(rings=12, around=17, warp=0.02, axes=(1.0, 0.6, 1.5)):
    """Nodes and panels of a closed body of quadrilaterals and, at its poles, triangles; nodes off the ellipsoid by
    random `warp` as a fraction of the size of the panels.
    """
    polar, azimuth = np.linspace(0.0, np.pi, rings + 1)[1:-1, None], np.arange(around) * 2.0 * np.pi / around
    ring = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0.0 * azimuth
    nodes = np.concatenate([[[0.0, 0.0, 1.0]], np.stack(ring, axis=2).reshape(-1, 3), [[0.0, 0.0, -1.0]]]) * axes
    scale = warp * np.linalg.norm(nodes[1:2] - nodes[2:3])
    nodes += scale * np.random.default_rng(1).uniform(-1.0, 1.0, nodes.shape)
    at = 1 + np.arange((rings - 1) * around).reshape(rings - 1, around)
    after = np.roll(at, -1, axis=1)
    quads = np.stack([at[:-1], at[1:], after[1:], after[:-1]], axis=2).reshape(-1, 4)
    top = np.stack([np.zeros_like(at[0]), at[0], after[0], after[0]], axis=1)
    bottom = np.stack([np.full_like(at[0], len(nodes) - 1), after[-1], at[-1], at[-1]], axis=1)
    return nodes, np.concatenate([top, quads, bottom])


BODY = PanelGeometry.of(*ellipsoid())


def random_points(count, seed=0, spread=2.0):
    return spread * np.random.default_rng(seed).normal(size=(count, 3))


def gradient(potential, points, h):
    """Central differences of potential(points) (p,) along the three axes: (p,3)."""
    return np.stack([(potential(points + h * e) - potential(points - h * e)) / (2.0 * h) for e in np.eye(3)], axis=1)


def integrals(corners, diagonal, point):
    """Potentials of unit source and unit doublet at a point by adaptive quadrature over two flat triangles, the source
    on each as its part of the area across the panel's normal.
    """
    found, across = np.zeros(2), np.cross(corners[2] - corners[0], corners[3] - corners[1])
    across /= np.linalg.norm(across)
    for triangle in ((0, 1, 2), (0, 2, 3)) if diagonal == 0 else ((1, 2, 3), (1, 3, 0)):
        a, b, c = corners[list(triangle)]
        normal = np.cross(b - a, c - a)

        def r(v, u, a=a, b=b, c=c):
            return point - (a + u * (b - a) + v * (1.0 - u) * (c - a))

        if np.linalg.norm(normal) > 0.0:
            kernels = (
                lambda v, u, r=r, n=normal: (1.0 - u) * n @ across / np.linalg.norm(r(v, u)),
                lambda v, u, r=r, n=normal: (1.0 - u) * n @ r(v, u) / np.linalg.norm(r(v, u)) ** 3,
            )
            found -= [dblquad(f, 0, 1, 0, 1, epsabs=1e-10, epsrel=1e-10)[0] / (4.0 * np.pi) for f in kernels]
    return found


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", PANELS)
def test_potentials_of_a_panel_are_its_integrals(name, kernel):
    corners = panel(name)
    geometry = geometry_of(corners)
    diagonal = 1 if name in ("dart whose first diagonal is outside", "triangle that repeats its first corner") else 0
    near = geometry.centre + 0.4 * random_points(2, seed=1, spread=geometry.size[0])
    for point in np.concatenate([near, geometry.centre + random_points(2, seed=2, spread=4.0 * geometry.size[0])]):
        matrix, potential = influence(geometry, point[None], [1.0], far=EXACT, kernel=kernel)
        source, doublet = integrals(corners, diagonal, point)
        assert potential[0] == pytest.approx(source, rel=1e-8)  # ten times that of the quadrature
        assert matrix[0, 0] == pytest.approx(doublet, rel=1e-8, abs=1e-11)


@pytest.mark.parametrize("kernel", KERNELS)
def test_influences_are_continuous_where_a_soft_panel_folds_over(kernel):
    # the last panel of a cell whose trailing edge the ribs do not hold: its second triangle turns over on the way
    def shape(share):
        corners = np.array([[7.0, 2.1, 3.8], [-6.0, 250.8, 0.6], [-5.8, 249.4, 17.9], [0.0, 0.0, 0.0]]) / 1000.0
        corners[3, 0] += (share - 0.75) * 0.01
        return geometry_of(corners)

    shares = np.linspace(0.0, 1.5, 1501)
    places = np.array([[0.3, 0.1, 0.2], [0.05, 0.1, 0.05], [-0.05, 0.2, -0.03]])
    found, sides = [], []
    for share in shares:
        g = shape(share)
        matrix, potential = influence(g, places, [1.0], far=EXACT, kernel=kernel)
        found.append(np.concatenate([matrix[:, 0], potential, 10.0 * g.centre[0], g.own, g.area]))
        triangle = np.cross(g.corners[0, 2] - g.corners[0, 0], g.corners[0, 3] - g.corners[0, 0])
        sides.append(np.sign(triangle @ g.normal[0]))
    assert set(sides) == {-1.0, 1.0}
    steps = np.abs(np.diff(found, axis=0))
    # a step of the way is a thousandth of it: no value changes by more than some thousandths of the whole
    worst = int(steps.max(axis=0).argmax())
    assert steps.max() < 0.01, (worst, steps[:, worst].argmax(), steps.max())


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_closed_body_of_unit_doublets_has_potential_one_inside_and_none_outside(kernel):
    inside = 0.5 * random_points(20, spread=0.5) / np.array([1.0, 1.5, 1.0])
    outside = random_points(20, seed=3)
    outside *= (2.0 + random_points(20, seed=4, spread=0.1)[:, :1]) / np.linalg.norm(outside, axis=1, keepdims=True)
    sums = doublet_matrix(BODY, np.concatenate([inside, outside]), far=EXACT, kernel=kernel).sum(axis=1)
    # Two hundred terms of order 0.01, each rounded.
    assert sums == pytest.approx(np.repeat([1.0, 0.0], 20), abs=1e-13)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("warp", [0.0, 0.02, 0.2])
def test_influences_of_a_closed_body_on_its_own_centres_sum_to_one(kernel, warp):
    body = PanelGeometry.of(*ellipsoid(warp=warp))
    exact = doublet_matrix(body, body.centre, own=True, far=EXACT, kernel=kernel)
    assert exact.sum(axis=1) == pytest.approx(1.0, abs=1e-13)  # as above
    assert np.diagonal(exact) == pytest.approx(0.5, abs=1.5 * (body.warp / body.size).max() + 1e-13)
    # The default distance: some hundred panels with 1e-4 each, whose errors change sign around a panel.
    by_multipoles = doublet_matrix(body, body.centre, own=True, kernel=kernel)
    assert by_multipoles.sum(axis=1) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_potential_of_a_square_at_its_centre_is_known(kernel):
    square = geometry_of(panel("square"))
    matrix, potential = influence(square, square.centre, [1.0], own=True, kernel=kernel)
    assert matrix[0, 0] == 0.5
    assert potential[0] == pytest.approx(
        -np.arcsinh(1.0) / np.pi, rel=1e-14
    )  # int dS / r = 4 asinh(1) of a unit square


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", PANELS)
def test_potential_jumps_by_the_doublet_and_normal_velocity_by_the_source(name, kernel):
    geometry = geometry_of(panel(name))
    corners, near = geometry.corners[0], geometry.near[0]
    rows = [0, 1, 3] if "outside" in name else [0, 1, 2]  # in the first triangle, or where it has no area the second
    on, normal, share = corners[rows].mean(axis=0), near[12:15], near[45]
    if near[43]:
        on, normal, share = corners[[0, 2, 3]].mean(axis=0), near[15:18], near[46]
    sides = on + 1e-7 * np.array([[1.0], [-1.0]]) * normal
    matrix, potential = influence(geometry, sides, [3.0], kernel=kernel)
    above, below = matrix[:, 0]
    assert above - below == pytest.approx(-1.0, abs=1e-5)  # of the distance over the size of the panel
    assert potential[0] == pytest.approx(potential[1], abs=1e-5)
    above, below = induced_velocity(geometry, sides, [3.0], [0.0], kernel=kernel) @ normal
    assert above - below == pytest.approx(3.0 * share, abs=1e-5)


@pytest.mark.parametrize("kernel", KERNELS)
def test_two_halves_have_the_influence_of_the_whole_at_and_beside_their_common_edge(kernel):
    corners = panel("trapezium")
    low, high = 0.5 * (corners[0] + corners[1]), 0.5 * (corners[3] + corners[2])
    nodes = np.concatenate([corners, [low, high]])
    halves, whole = PanelGeometry.of(nodes, [[0, 4, 5, 3], [4, 1, 2, 5]]), geometry_of(corners)
    along = np.linspace(-0.5, 1.5, 41)[:, None] * (high - low) + low
    for height in (0.0, 1e-9, 1e-3, 0.3):
        points = along + height * whole.normal
        split, one = (influence(g, points, np.ones(len(g.area)), far=EXACT, kernel=kernel) for g in (halves, whole))
        assert split[1] == pytest.approx(one[1], abs=1e-12)  # rounding of logarithms of order 20 times the size
        if height > 1e-6:  # nearer the solid angle of points above edges is only as exact as the height
            assert split[0].sum(axis=1) == pytest.approx(one[0][:, 0], abs=1e-12)


@pytest.mark.parametrize("kernel", KERNELS)
def test_influence_is_finite_everywhere_on_a_body(kernel):
    corners = BODY.corners[:60:7].reshape(-1, 3)
    beside = BODY.corners[:60:7]
    extended = (2.0 * beside - np.roll(beside, 1, axis=1)).reshape(-1, 3)
    middles = (0.5 * (beside + np.roll(beside, 1, axis=1))).reshape(-1, 3)
    points, ones = np.concatenate([corners, extended, middles, BODY.centre[:9]]), np.ones(len(BODY.area))
    with np.errstate(all="raise", under="ignore"):
        matrix, potential = influence(BODY, points, ones, kernel=kernel)
        velocity = induced_velocity(BODY, points, ones, ones, kernel=kernel)
        strips = beside[:, 0], beside[:, 1], np.array([1.0, 0.0, 0.0])
        wake = wake_matrix(*strips, points, kernel=kernel)
        downwash = wake_velocity(*strips, np.ones(len(beside)), points, kernel=kernel)
    for values in (matrix, potential, velocity, wake, downwash):
        assert np.isfinite(values).all()
    assert np.abs(matrix).max() <= 1.0


@pytest.mark.parametrize(("name", "source", "doublet"), [
    ("square", 1e-5, 4e-5), ("slender", 3e-5, 1e-4), ("trapezium", 1e-4, 2.5e-4), ("triangle", 1e-4, 2.5e-4),
    ("dart", 2e-4, 5e-4), ("warped", 1e-4, 8e-4),
])  # fmt: skip
def test_multipoles_at_five_sizes_have_the_stated_error_which_falls_with_the_third_power(name, source, doublet):
    geometry = geometry_of(panel(name))
    away = random_points(2000, seed=5)
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    worst = []
    for distance in (5.0, 10.0):
        points = geometry.centre + distance * geometry.size * away
        by_multipoles, exact = (influence(geometry, points, [1.0], far=far) for far in (0.0, EXACT))
        errors = [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(by_multipoles, exact, strict=True)]
        worst.append(errors[::-1])
    assert worst[0][0] < source
    assert worst[0][1] < doublet
    # The first moments that are left out are the third, of a panel that is no parallelogram; a warped one lacks the
    # second moments of its normal as well.
    assert worst[1][0] < worst[0][0] / 7.0
    assert worst[1][1] < worst[0][1] / (3.5 if name == "warped" else 7.0)


@pytest.mark.parametrize("warp", [0.0, 0.02])
def test_multipoles_change_the_potentials_of_a_body_by_less_than_a_hundred_thousandth(warp):
    body = PanelGeometry.of(*ellipsoid(20, 30, warp))
    sources, doublets = -body.normal[:, 0], body.centre[:, 0]
    found, exact = (influence(body, body.centre, sources, own=True, far=far) for far in (5.0, EXACT))
    assert found[0] @ doublets == pytest.approx(exact[0] @ doublets, abs=1e-5 * np.abs(exact[0] @ doublets).max())
    assert found[1] == pytest.approx(exact[1], abs=1e-5 * np.abs(exact[1]).max())


def test_two_triangles_are_a_warped_panel_up_to_a_sixth_of_its_warp_over_the_distance():
    corners = panel("warped")
    geometry = geometry_of(corners)
    u, w = (np.polynomial.legendre.leggauss(60)[k] for k in (0, 1))
    u, v = (0.5 * (x + 1.0) for x in np.meshgrid(u, u))
    shape = [(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v]
    place = sum(s[..., None] * c for s, c in zip(shape, corners, strict=True))
    along = (1 - v)[..., None] * (corners[1] - corners[0]) + v[..., None] * (corners[2] - corners[3])
    across = (1 - u)[..., None] * (corners[3] - corners[0]) + u[..., None] * (corners[2] - corners[1])
    area = np.linalg.norm(np.cross(along, across), axis=2) * w * w[:, None] / 4.0
    away = random_points(50, seed=6)
    points = geometry.centre + geometry.size * away / np.linalg.norm(away, axis=1, keepdims=True)
    curved = [-(area / np.linalg.norm(p - place, axis=2)).sum() / (4.0 * np.pi) for p in points]
    found = source_potential(geometry, points, [1.0], far=EXACT)
    # The bilinear surface is warp/2 from the triangles in its middle, warp/6 on average, and seen from one size away;
    # the area of the triangles is larger by 1/6 (2 warp / side)^2 of a square.
    warp = geometry.warp[0] / geometry.size[0]
    assert found == pytest.approx(curved, rel=warp / 6.0 + 2.0 * warp**2)


@pytest.mark.parametrize("kernel", KERNELS)
def test_mirrored_influence_is_that_of_the_mirrored_body(kernel):
    nodes, panels = ellipsoid()
    nodes[:, 1] += 1.5
    body = PanelGeometry.of(nodes, panels)
    flip = np.array([1.0, -1.0, 1.0])
    image = PanelGeometry.of(nodes * flip, panels[:, [0, 3, 2, 1]])
    points, strengths = random_points(40), np.random.default_rng(8).normal(size=(2, len(panels)))
    matrix, potential = influence(body, points, strengths[0], mirrored=True, far=EXACT, kernel=kernel)
    other = influence(image, points, strengths[0], far=EXACT, kernel=kernel)
    assert potential == pytest.approx(other[1], abs=1e-13)  # rounding: edges are summed in another order
    assert matrix == pytest.approx(other[0], abs=1e-13)
    velocity = induced_velocity(body, points, *strengths, mirrored=True, kernel=kernel)
    assert velocity == pytest.approx(induced_velocity(image, points, *strengths, kernel=kernel), abs=1e-11)


STRIPS = np.array([[1.0, -0.3, 0.1], [0.2, 1.0, 0.0]]), np.array([[1.2, 0.5, 0.0], [0.0, 1.8, 0.3]])
DOWNSTREAM = np.array([0.9, 0.1, 0.3]) / np.linalg.norm([0.9, 0.1, 0.3])


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_semi_infinite_strip_is_a_very_long_panel(kernel):
    length, points = 1e5, random_points(30)
    a, b = STRIPS
    nodes = np.stack([b, a, a + length * DOWNSTREAM, b + length * DOWNSTREAM], axis=1).reshape(-1, 3)
    panels = PanelGeometry.of(nodes, np.arange(8).reshape(2, 4))
    found = wake_matrix(a, b, DOWNSTREAM, points, kernel=kernel)
    # What the panel lacks has the solid angle of its width times its height over the square of its length, 1e-9.
    assert found == pytest.approx(doublet_matrix(panels, points, far=EXACT, kernel=kernel), abs=1e-9)
    mirrored = wake_matrix(a, b, DOWNSTREAM, points, mirrored=True, kernel=kernel)
    assert (mirrored == wake_matrix(a, b, DOWNSTREAM, points * [1.0, -1.0, 1.0], kernel=kernel)).all()


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_strip_whose_upper_panel_runs_from_a_to_b_continues_its_doublet(kernel):
    # The upper side of a plate in the plane z = 0, whose trailing edge x = 1 runs from a to b counter-clockwise.
    plate = geometry_of(np.array([[0.0, -0.5, 0.0], [1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [0.0, 0.5, 0.0]]))
    a, b = np.array([[1.0, -0.5, 0.0]]), np.array([[1.0, 0.5, 0.0]])
    x = np.array([[0.999, 0.0, 0.2], [1.001, 0.0, 0.2], [2.0, 0.0, 1e-6]])
    together = doublet_matrix(plate, x, kernel=kernel) + wake_matrix(a, b, [1.0, 0.0, 0.0], x, kernel=kernel)
    assert together[0] == pytest.approx(together[1], abs=2e-3)  # smooth across the common edge: slope times 0.002
    assert together[2] == pytest.approx(-0.5, abs=1e-5)  # just above the wake


@pytest.mark.parametrize("kernel", KERNELS)
def test_velocity_is_the_gradient_of_the_potential(kernel):
    sources, doublets = np.random.default_rng(9).normal(size=(2, len(BODY.area)))
    points, h = np.concatenate([random_points(12), BODY.centre[:12] + 0.02 * BODY.normal[:12]]), 1e-5

    def body(x):
        matrix, potential = influence(BODY, x, sources, far=EXACT, kernel=kernel)
        return potential + matrix @ doublets

    found = induced_velocity(BODY, points, sources, doublets, kernel=kernel)
    # Rounding over h is 1e-10; h^2 times third derivatives, strengths over the cube of the distance, 1e-5 at most.
    assert found == pytest.approx(gradient(body, points, h), abs=1e-5 * np.abs(found).max())
    strengths = [1.0, -0.7]
    found = wake_velocity(*STRIPS, DOWNSTREAM, strengths, points, kernel=kernel)
    wake = gradient(lambda x: wake_matrix(*STRIPS, DOWNSTREAM, x, kernel=kernel) @ strengths, points, h)
    assert found == pytest.approx(wake, abs=1e-7)


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_core_takes_the_velocity_at_edges_and_leaves_it_further_away(kernel):
    panel_, core = geometry_of(panel("square")), 0.01
    edge = panel_.corners[0, :2].mean(axis=0)

    def speed(distance, core):
        points = edge + distance * panel_.normal
        return np.linalg.norm(induced_velocity(panel_, points, [0.0], [1.0], core=core, kernel=kernel))

    assert speed(1e-4, core) < 0.02 * speed(1e-4, 0.0)  # d^2 / (d^2 + core^2) = 1e-4, beside that of the other edges
    assert speed(0.5, core) == pytest.approx(speed(0.5, 0.0), rel=1e-3)  # core^2 / d^2 = 4e-4


@pytest.mark.skipif(compiled() is None, reason="no C compiler at installation")
def test_compiled_kernels_have_the_numbers_of_numpy_to_rounding():
    rng = np.random.default_rng(10)
    strengths = rng.normal(size=(len(BODY.area), 3))
    shifted = BODY.centre + 1e-3 * BODY.normal
    points = np.concatenate([BODY.centre, BODY.corners.reshape(-1, 3), shifted, random_points(70)])
    for arguments in ({}, {"far": EXACT}, {"far": 1.0}, {"mirrored": True}):
        pair = [influence(BODY, points, strengths, kernel=kernel, **arguments) for kernel in ("numpy", "compiled")]
        for plain, fast in zip(*pair, strict=True):
            assert fast == pytest.approx(plain, abs=1e-12)  # of numbers of order one
    off = np.concatenate([shifted, random_points(70)])
    columns = strengths[:, 0], strengths[:, 1]
    plain, fast = (induced_velocity(BODY, off, *columns, kernel=kernel) for kernel in ("numpy", "compiled"))
    assert fast == pytest.approx(plain, abs=1e-12 * np.abs(plain).max())
    for function, extra in ((wake_matrix, ()), (wake_velocity, ([1.0, -0.7],))):
        plain, fast = (function(*STRIPS, DOWNSTREAM, *extra, off, kernel=kernel) for kernel in ("numpy", "compiled"))
        assert fast == pytest.approx(plain, abs=1e-12 * np.abs(plain).max())


@pytest.mark.parametrize("kernel", KERNELS)
def test_results_are_bitwise_the_same_for_any_number_of_threads_and_for_single_points(kernel, monkeypatch):
    points, strengths = np.concatenate([BODY.centre, random_points(70)]), np.linspace(-1.0, 1.0, len(BODY.area))

    def all_of(threads, rows=slice(None)):
        set_ = {"threads": threads, "kernel": kernel}
        at = points[rows]
        return [
            *influence(BODY, at, strengths, **set_),
            doublet_matrix(BODY, at, **set_),
            source_potential(BODY, at, np.stack([strengths, strengths**2], axis=1), **set_),
            induced_velocity(BODY, at, strengths, strengths, **set_),
            wake_matrix(*STRIPS, DOWNSTREAM, at, **set_),
            wake_velocity(*STRIPS, DOWNSTREAM, [1.0, 2.0], at, **set_),
        ]

    one = all_of(1)
    assert (one[0] == one[2]).all()
    for found in (all_of(2), all_of(5)):
        assert all((a == b).all() for a, b in zip(one, found, strict=True))
    monkeypatch.setenv("KITECOSIM_THREADS", "3")
    assert all((a == b).all() for a, b in zip(one, all_of(None), strict=True))
    if kernel == "compiled":  # numpy's sums depend on the shape of its blocks
        assert all((a[83:84] == b).all() for a, b in zip(one, all_of(2, slice(83, 84)), strict=True))


def test_numpy_takes_over_where_it_is_asked_for(monkeypatch):
    monkeypatch.setenv("KITECOSIM_PANEL_KERNEL", "numpy")
    assert compiled() is None
    found = doublet_matrix(BODY, BODY.centre, own=True)
    assert (found == doublet_matrix(BODY, BODY.centre, own=True, kernel="numpy")).all()


def test_an_image_is_added_to_the_first_pass():
    first = doublet_matrix(BODY, BODY.centre, own=True)
    image = doublet_matrix(BODY, BODY.centre, mirrored=True)
    out = first.copy()
    assert doublet_matrix(BODY, BODY.centre, mirrored=True, out=out) is out
    assert (out == first + image).all()


def test_bad_input_is_refused_in_one_sentence(monkeypatch):
    flat = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    with pytest.raises(ValueError, match="Panel 2 has no area; remove it or set its corners apart"):
        PanelGeometry.of(flat, [[0, 1, 3, 3], [0, 1, 2, 2]])
    with pytest.raises(ValueError, match="'compiled' or 'numpy', not 'fortran'"):
        doublet_matrix(BODY, BODY.centre, kernel="fortran")
    with pytest.raises(ValueError, match="Only the unmirrored centres"):
        doublet_matrix(BODY, BODY.centre, mirrored=True, own=True)
    with pytest.raises(ValueError, match="C-contiguous and of shape"):
        doublet_matrix(BODY, BODY.centre, out=np.zeros((3, 3)))
    monkeypatch.setenv("KITECOSIM_THREADS", "many")
    with pytest.raises(ValueError, match="KITECOSIM_THREADS takes a number of threads of at least 1, not 'many'"):
        doublet_matrix(BODY, BODY.centre)


def test_ten_thousand_panels_need_one_and_a_half_gigabytes():
    assert 1.2e9 < memory_needed(10_000) < 1.6e9  # 12 bytes for each pair, and what does not grow with the square
