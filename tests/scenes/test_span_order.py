"""Rows of struts, ribs and sections along the wing: any shape and azimuth in order, no other order."""

import itertools

import numpy as np
import pytest

import scenes
from scenes.readers.span_order import check_span_order
from scenes.readers.tables import Table
from tests.scenes.broken import BUILT_IN, copy_of

DOWNWIND = (1.0, 0.0, 0.0)
FACING = "as seen facing the wind"


def _table(folder, rows):
    return Table(folder / "wing" / "struts.csv", {}, list(range(2, rows + 2)))


def _refusal(edges, folder, wind=DOWNWIND):
    """The message for rows with these leading and trailing edges (n,6) m; empty where they are accepted."""
    try:
        check_span_order(_table(folder, len(edges)), "struts", np.array([edges[:, :3], edges[:, 3:]]), wind)
    except scenes.SceneError as error:
        return str(error)
    return ""


def _in_plane(y, z, sweep=0.0):
    """Edges (n,6) m of a wing of chord 1 m with its leading edge at (y, z), swept back to the tips."""
    le = np.column_stack([sweep * np.abs(y), y, z]).astype(float)
    return np.hstack([le, le + np.array([1.0, 0.0, 0.0])])


def _arc(rows, degrees, height=1.0):
    """A wing that goes round an ellipse by so many degrees, its middle at the top."""
    t = np.deg2rad(np.linspace(-0.5 * degrees, 0.5 * degrees, rows))
    return _in_plane(3.0 * np.sin(t), 3.0 * height * np.cos(t))


def _built_in(name):
    """Edges of the sections of a scene in the project's folder, as it stands in its table."""
    table = np.genfromtxt(BUILT_IN / name / "sections.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    return np.column_stack([table[f"{side}_{axis}_m"] for side in ("le", "te") for axis in "xyz"])


def _struts_of_the_v3():
    scene = scenes.load("v3_kite")
    return np.hstack(list(scene.members.nodes[scene.struts.T]))


WINGS = {
    "struts of the V3": _struts_of_the_v3,
    "sections of the V3": lambda: _built_in("v3_kite"),
    "flat, bays from 0.1 m to 1.5 m": lambda: _in_plane(np.array([0.0, 0.1, 0.3, 1.0, 2.5, 4.0, 4.2]), np.zeros(7)),
    "swept": lambda: _in_plane(np.arange(-3.0, 4.0), np.zeros(7), sweep=1.2),
    "three rows": lambda: _in_plane(np.array([-4.08, 0.0, 4.08]), np.array([8.9, 12.05, 8.9])),
    "end plates up": lambda: _in_plane(np.array([-2.0, -2.0, 0.0, 2.0, 2.0]), np.array([0.5, 0.0, 0.0, 0.0, 0.5])),
    "winglets down and in": lambda: _in_plane(
        np.array([-1.8, -2.0, -1.0, 0.0, 1.0, 2.0, 1.8]), np.array([-0.6, 0.0, 0.1, 0.15, 0.1, 0.0, -0.6])
    ),
    "C-kite of 200 degrees": lambda: _arc(8, 200.0, 1.4),
    "arc of 270 degrees": lambda: _arc(7, 270.0),
}  # fmt: skip


@pytest.mark.parametrize("shape", WINGS)
@pytest.mark.parametrize("azimuth", [0.0, 20.0, 90.0, 180.0, 275.0])
def test_wing_of_any_shape_is_in_order_at_any_azimuth_with_its_wind(shape, azimuth, tmp_path):
    """Left and right are those of who faces the wind, so a wing turned about z with its wind stays in order, and its
    rows from right to left are refused.
    """
    a = np.deg2rad(azimuth)
    turn = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    edges = WINGS[shape]()
    turned = np.hstack([edges[:, :3] @ turn.T, edges[:, 3:] @ turn.T])
    wind = tuple(turn @ [0.9, 0.0, 0.3])
    assert _refusal(turned, tmp_path, wind) == ""
    message = _refusal(turned[::-1], tmp_path, wind)
    assert message.startswith("wing/struts.csv: ")
    assert FACING in message
    assert message.endswith("reverse the rows.")


@pytest.mark.parametrize("rows", [9, 20])
@pytest.mark.parametrize("degrees", [180.0, 300.0, 345.0])
def test_arc_whose_tips_almost_touch_is_in_order(rows, degrees, tmp_path):
    assert _refusal(_arc(rows, degrees), tmp_path) == ""


def _on_circle(degrees, sweep=0.0, radius=3.0):
    """A wing of chord 1 m with rows at these angles from the top of a circle, its tips swept back by `sweep` deg."""
    t = np.deg2rad(np.asarray(degrees, float))
    le = np.column_stack([np.tan(np.deg2rad(sweep)) * radius * np.abs(t), radius * np.sin(t), radius * np.cos(t)])
    return np.hstack([le, le + np.array([1.0, 0.0, 0.0])])


# Tips nearer to each other than rows at mid-span are.
CLOSING = {
    "30 deg open, few rows above": _on_circle([-165, -160, -150, -90, 0, 90, 150, 160, 165]),
    "44 deg open, close tip rows": _on_circle([-158, -150, -90, -30, 30, 90, 150, 158]),
    "44 deg open, close tip rows, swept": _on_circle([-158, -150, -90, -30, 30, 90, 150, 158], 20.0),
    "one wide bay in the middle": _on_circle([-165, -140, -115, -90, -40, 40, 90, 115, 140, 165]),
    "rows not opposite each other": _on_circle([-162, -100, -80, -25, 10, 24, 90, 133, 148, 162], 10.0),
    "three rows": _on_circle([-120, 0, 120], 10.0, 1.0),
    "three rows, almost closed": _on_circle([-165, 0, 165], 10.0, 1.0),
    "three rows, the middle one aside": _on_circle([-130, 15, 130], 10.0, 1.0),
}


@pytest.mark.parametrize("shape", CLOSING)
@pytest.mark.parametrize("azimuth", [0.0, 90.0, 200.0])
def test_wing_whose_tips_are_nearer_than_its_rows_is_in_order(shape, azimuth, tmp_path):
    a = np.deg2rad(azimuth)
    turn = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    edges = np.hstack([CLOSING[shape][:, :3] @ turn.T, CLOSING[shape][:, 3:] @ turn.T])
    assert _refusal(edges, tmp_path, tuple(turn @ DOWNWIND)) == ""
    assert _refusal(edges[::-1], tmp_path, tuple(turn @ DOWNWIND)).endswith("reverse the rows.")


def _same_round(order):
    """All orders that go round as this one, from any row and either way."""
    n = len(order)
    return {tuple(np.roll(order, k)[::way].tolist()) for k in range(n) for way in (1, -1)}


@pytest.mark.parametrize("shape", CLOSING)
def test_rows_of_a_closing_wing_that_do_not_go_round_are_refused(shape, tmp_path):
    """The remedies lead to an order that goes round it."""
    edges = CLOSING[shape]
    round_it = _same_round(range(len(edges)))
    for slip in set(_slips(len(edges))) - round_it:
        order = list(slip)
        message = _refusal(edges[order], tmp_path)
        assert message.startswith("wing/struts.csv row "), slip
        while "shorter with" in message:
            before = _length(edges[order])
            order = _followed(order, message.partition("shorter with ")[2].partition(";")[0])
            assert _length(edges[order]) < before
            message = _refusal(edges[order], tmp_path)
        assert tuple(order) in round_it, slip


def _length(edges):
    return np.linalg.norm(np.diff(edges, axis=0), axis=1).sum()


@pytest.mark.parametrize("shape", list(CLOSING)[:3])
@pytest.mark.parametrize("way", [1, -1])
def test_wing_cut_at_mid_span_is_refused_with_its_tips(shape, way, tmp_path):
    """Its first and last row are as near as neighbours are, and its tips stand in the middle of the table."""
    edges = CLOSING[shape]
    for cut in (len(edges) // 2, (len(edges) + 1) // 2):
        order = np.roll(np.arange(len(edges)), -cut)[::way]
        left, right = sorted((list(order).index(0), list(order).index(len(edges) - 1)))
        assert f"whose tips are rows {left + 2} and {right + 2} by the gap" in _refusal(edges[order], tmp_path)


@pytest.mark.parametrize("first", range(12))
def test_ring_may_begin_at_any_row(first, tmp_path):
    """Twelve rows 30 deg apart: no step tells where the tips are."""
    ring = np.roll(_on_circle(np.arange(-165, 166, 30)), first, axis=0)
    assert "row " not in _refusal(ring, tmp_path)


def test_wing_on_end_has_no_left_and_right(tmp_path):
    """A sail: its span stands along z, and either end may come first."""
    sail = _in_plane(np.zeros(5), np.arange(5.0))
    assert _refusal(sail, tmp_path) == _refusal(sail[::-1], tmp_path) == ""
    assert _refusal(sail[[0, 2, 1, 3, 4]], tmp_path) != ""


def _slips(rows):
    """Orders that slips make: two rows exchanged, a run of rows turned round, one row elsewhere, another first row."""
    whole = list(range(rows))
    for i, j in itertools.combinations(whole, 2):
        swapped = whole.copy()
        swapped[i], swapped[j] = j, i
        yield tuple(swapped)
        yield tuple(whole[:i] + whole[i : j + 1][::-1] + whole[j + 1 :])
    for i, j in itertools.permutations(whole, 2):
        rest = whole[:i] + whole[i + 1 :]
        yield (*rest[:j], i, *rest[j:])
    for i in whole:
        yield tuple(whole[i:] + whole[:i])
        yield tuple((whole[i:] + whole[:i])[::-1])


def _orders(rows, rng):
    """Slips, and all orders of few rows or 1000 random ones."""
    more = itertools.permutations(range(rows)) if rows <= 6 else (tuple(rng.permutation(rows)) for _ in range(1000))
    right = tuple(range(rows))
    yield from {p for p in itertools.chain(_slips(rows), more) if p not in (right, right[::-1])}


@pytest.mark.parametrize("shape", WINGS)
def test_every_other_order_of_the_rows_is_refused_with_a_row(shape, tmp_path):
    edges = WINGS[shape]()
    for order in _orders(len(edges), np.random.default_rng(len(edges))):
        message = _refusal(edges[list(order)], tmp_path)
        assert message.startswith("wing/struts.csv row "), order
        assert "sort the rows" in message


@pytest.mark.parametrize("shape", WINGS)
def test_what_the_message_says_is_shorter_leads_to_the_right_order(shape, tmp_path):
    """Rows that are put as each message says end in an order that is accepted, or that is the reverse of one."""
    edges = WINGS[shape]()
    rng = np.random.default_rng(3)
    right = tuple(range(len(edges)))
    for _ in range(20):
        order = list(rng.permutation(len(edges)))
        for _ in range(len(edges) ** 2):
            message = _refusal(edges[order], tmp_path)
            if "shorter with" not in message:
                break
            order = _followed(order, message.partition("shorter with ")[2].partition(";")[0])
        assert tuple(order) in (right, right[::-1])


def _followed(order, words):
    """The order of rows, numbered from 2 in the words, changed as they say."""
    at = [int(word) - 2 for word in words.split() if word.isdigit()]
    if "the other way round" in words:
        i, j = at
        return order[:i] + order[i : j + 1][::-1] + order[j + 1 :]
    if words.startswith("rows"):  # to before the first one
        return order[at[0] :] + order[: at[0]]
    k, beside = at[0], order[at[-1]]
    rest = order[:k] + order[k + 1 :]
    place = rest.index(beside) + ("after" in words)
    return [*rest[:place], order[k], *rest[place:]]


def test_rows_that_stand_in_one_place_are_refused(tmp_path):
    edges = _in_plane(np.array([-1.0, 0.0, 0.0, 1.0]), np.zeros(4))
    assert _refusal(edges, tmp_path).startswith("wing/struts.csv row 4: both edges are those of the row above")


@pytest.mark.parametrize(
    ("scene", "file"),
    [("v3_kite", "struts.csv"), ("v3_kite", "sections.csv"), ("v3_kite_detailed", "ribs.csv"),
     ("v3_hanging_test", "ribs.csv")],
)  # fmt: skip
def test_every_table_along_the_wing_is_judged_alike(scene, file, tmp_path):
    """The middle row moved to the front, which leaves first and last row on their sides, and all rows reversed."""
    folder = copy_of(scene, tmp_path)
    header, *rows = (folder / file).read_text().splitlines()
    middle = len(rows) // 2
    for changed, words in (
        ([rows[middle], *rows[:middle], *rows[middle + 1 :]], [f"{file} row 2", "sort the rows"]),
        (rows[::-1], [file, FACING, "reverse the rows"]),
    ):
        (folder / file).write_text("\n".join([header, *changed]) + "\n")
        with pytest.raises(scenes.SceneError) as caught:
            scenes.load(folder)
        for word in words:
            assert word in str(caught.value)
