"""Polars that do not share their angles: a point that did not converge, another step, another range."""

import numpy as np
import pytest

import scenes
from scenes.readers.polars import SAME_ANGLE, at_common_angles
from tests.scenes.broken import copy_of

FULL = np.arange(-15.0, 25.01, 0.5)


def _section(alpha, camber=0.0):
    """A polar (4,k), angles deg first: lift that bends over to a maximum at 15 deg, drag and moment."""
    cl = camber + 1.5 * np.sin(np.deg2rad(6.0 * alpha))
    return np.array([alpha, cl, 0.01 + 1e-4 * alpha**2, -0.05 + 1e-3 * alpha])


def _edited(name, folder, change):
    """A copy of a built-in scene whose polars (4,k), deg, are changed by their names."""
    folder = copy_of(name, folder)
    header, *rows = (folder / "polars.csv").read_text().splitlines()
    assert header == "polar,alpha_deg,cl,cd,cm"
    polars: dict[str, list[list[str]]] = {}
    for row in rows:
        key, *cells = row.split(",")
        polars.setdefault(key, []).append(cells)
    kept = [[key, *cells] for key, rows in polars.items() for cells in change(key, rows)]
    (folder / "polars.csv").write_text("\n".join([header, *(",".join(row) for row in kept)]) + "\n")
    return folder


def _loads(scene):
    air = scenes.load(scene).aero_core()
    air.step(0.0, 1.0)
    return air


def test_polars_on_one_list_are_taken_as_they_are():
    alpha, cl, cd, cm, ends = at_common_angles([_section(FULL), _section(FULL, 0.2)])
    assert np.array_equal(alpha, np.deg2rad(FULL))
    for camber, row in ((0.0, 0), (0.2, 1)):
        assert np.array_equal([cl[row], cd[row], cm[row]], _section(FULL, camber)[1:])
    assert np.array_equal(ends, np.deg2rad([[-15.0, 25.0]] * 2))


def test_every_polar_passes_through_its_own_points_at_the_angles_of_all():
    rng = np.random.default_rng(0)
    lists = [np.sort(rng.choice(FULL, 60, replace=False)) for _ in range(5)]
    curves = [_section(alpha, 0.1 * k) for k, alpha in enumerate(lists)]
    alpha, *tables, ends = at_common_angles(curves)
    grid = np.rad2deg(alpha)
    np.testing.assert_allclose(grid, np.unique(np.concatenate(lists)), rtol=1e-14)
    for k, curve in enumerate(curves):
        at = np.isin(grid.round(6), curve[0])
        # rounding of cubics at their ends
        np.testing.assert_allclose([table[k, at] for table in tables], curve[1:], atol=1e-14)
        np.testing.assert_allclose(np.rad2deg(ends[k]), curve[0, [0, -1]], rtol=1e-14)


def test_point_that_is_missing_is_found_again_to_the_second_order_of_the_step():
    """Slopes of a monotone cubic between unequal steps are of first order, so values beside the gap of second."""
    errors = []
    for step in (1.0, 0.5, 0.25):
        alpha = np.arange(-10.0, 10.01, step)
        gap = np.delete(alpha, len(alpha) // 4)
        _, cl, *_ = at_common_angles([_section(alpha), _section(gap)])
        errors.append(np.abs(cl[1] - cl[0]).max())
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(order > 1.9)


def test_angles_of_lists_that_are_all_unlike_stay_as_many_as_can_be_told_apart():
    rng = np.random.default_rng(1)
    curves = [_section(np.unique(rng.uniform(-5.0, 5.0, 100))) for _ in range(60)]
    alpha = np.rad2deg(at_common_angles(curves)[0])
    assert np.all(np.diff(alpha) > 0.0)
    # of 6000 angles over 10 deg; within one list, and between new ones of one list, they may be nearer
    assert len(alpha) < 2.0 * 10.0 / SAME_ANGLE
    one, other = _section(FULL), _section(FULL + 1e-3)
    assert np.array_equal(np.rad2deg(at_common_angles([one, other])[0]).round(9), FULL)


def test_dropping_points_of_straight_polars_changes_no_load(tmp_path):
    """The typical section's polar is a straight line through stall-free angles: any list draws the same one."""
    whole = _loads("typical_section")
    polar = scenes.load("typical_section").polars
    assert np.ptp(np.diff(polar.cl[0]) / np.diff(polar.alpha)) < 1e-9
    angles = [-90.0, -30.0, -7.0, 0.0, 4.0, 11.0, 90.0]
    slope = polar.cl[0, -1] / 90.0

    def change(key, rows):
        return [[str(a), repr(float(slope * a)), "0.0", "0.0"] for a in angles]

    fewer = _loads(_edited("typical_section", tmp_path, change))
    for name in ("CL", "force", "moment", "alpha"):
        np.testing.assert_allclose(fewer.get(name), whole.get(name), rtol=1e-9, atol=1e-12)


def test_kite_whose_polars_lack_points_has_its_loads(tmp_path):
    """Every third of the V3's polars without three of its points, none of them the last one."""
    whole = _loads("v3_kite")
    rng = np.random.default_rng(2)

    def change(key, rows):
        lost = rng.choice(len(rows) - 2, 3, replace=False) + 1 if int(key) % 3 == 0 else ()
        return [cells for k, cells in enumerate(rows) if k not in lost]

    folder = _edited("v3_kite", tmp_path, change)
    gaps = _loads(folder)
    # cubics over steps of 1 deg instead of 0.5: h^3 of polars that bend by a hundredth in a degree
    np.testing.assert_allclose(gaps.get("force"), whole.get("force"), rtol=1e-3, atol=1e-3 * whole.get("force")[2])
    assert gaps.get("strips_beyond_polar") == 0
    assert len(scenes.load(folder).polars.alpha) == len(scenes.load("v3_kite").polars.alpha)


def test_strips_beside_a_polar_of_shorter_range_are_counted_as_beyond_it(tmp_path):
    """Polars of the left half of the V3 end at -4 deg, and the wing flies above: strips beside them are beyond data."""
    folder = _edited("v3_kite", tmp_path, lambda key, rows: rows)
    header, *rows = (folder / "sections.csv").read_text().splitlines()
    left = [row for row in rows if float(row.split(",")[3]) < -1.0]
    renamed = [",".join([c if i != 1 else f"short_{c}" for i, c in enumerate(row.split(","))]) for row in left]
    (folder / "sections.csv").write_text("\n".join([header, *renamed, *rows[len(left) :]]) + "\n")
    polars = (folder / "polars.csv").read_text().splitlines()[1:]
    short = [f"short_{row}" for row in polars if float(row.split(",")[1]) <= -4.0]
    with (folder / "polars.csv").open("a") as file:
        file.write("\n".join(short) + "\n")
    beyond, total = [], []
    for scene in ("v3_kite", folder):
        air = scenes.load(scene, {"panels_per_section": 2}).aero_core()
        air.set("wind_direction", [np.cos(0.2), 0.0, np.sin(0.2)])
        air.step(0.0, 1.0)
        assert np.all(air.get("alpha") > np.deg2rad(-4.0))
        beyond.append(int(air.get("strips_beyond_polar")))
        total.append(len(air.get("alpha")))
    middle = scenes.load(folder, {"panels_per_section": 2}).interface.nodes.reshape(-1, 3, 3)[:, 0, 1]
    on_the_left = np.count_nonzero(0.5 * (middle[1:] + middle[:-1]) < -0.9)
    assert beyond[0] == 0
    assert abs(beyond[1] - on_the_left) <= 1  # the one beside the last short section
    assert 0 < beyond[1] < total[1] // 2


def _two_polars(folder, ranges, panels):
    """A typical section whose ends have cl = 0.1 alpha_deg over the given ranges deg, in so many strips."""
    folder = copy_of("typical_section", folder)
    sections = (folder / "sections.csv").read_text()
    (folder / "sections.csv").write_text(sections.replace("1,plate", "1,first").replace("2,plate", "2,second"))
    rows = [
        f"{key},{a!r},{0.1 * a!r},0.0,0.0"
        for key, (low, high) in zip(("first", "second"), ranges, strict=True)
        for a in np.linspace(low, high, 6).tolist()
    ]
    (folder / "polars.csv").write_text("\n".join(["polar,alpha_deg,cl,cd,cm", *rows]) + "\n")
    return scenes.load(folder, {"panels_per_section": panels})


@pytest.mark.parametrize(
    ("first", "second"),
    [((-10.0, -5.0), (5.0, 20.0)), ((5.0, 20.0), (-10.0, -5.0)), ((-10.0, 5.0), (5.0, 20.0)),
     ((-10.0, 5.5), (5.0, 20.0))],
)  # fmt: skip
def test_strip_between_polars_that_share_no_range_is_refused_with_both_of_them(first, second, tmp_path):
    with pytest.raises(scenes.SceneError) as caught:
        _two_polars(tmp_path, (first, second), 1)
    assert str(caught.value) == (
        f"typical_section/polars.csv: polar 'first' goes from {first[0]:g} to {first[1]:g} deg and polar 'second' from "
        f"{second[0]:g} to {second[1]:g} deg, but strips between typical_section/sections.csv row 2 and row 3 blend "
        "both; widen them until they share 1 deg or more."
    )


@pytest.mark.parametrize(
    ("first", "second"), [((-10.0, 6.0), (5.0, 20.0)), ((-10.0, 20.0), (5.0, 5.5)), ((-0.2, 0.2), (-0.2, 0.2))]
)
def test_straight_polars_give_their_line_over_the_range_they_share(first, second, tmp_path):
    """One degree, or all of a narrow polar: the blend of two pieces of one line is that line, and is not flagged."""
    polars = _two_polars(tmp_path, (first, second), 3).strip_polars()
    for degrees in np.linspace(max(first[0], second[0]), min(first[1], second[1]), 7):
        cl, _, outside = polars.lift(np.full(3, np.deg2rad(degrees)))
        np.testing.assert_allclose(cl, 0.1 * degrees, atol=1e-13)  # rounding
        assert not outside[1]
