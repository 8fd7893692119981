"""The plot with the names of nodes and lines of a bridle: all there, none on top of another, on the page."""

import dataclasses

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app
from master.coupling import SCHEMES, Coupling, coupled_run
from master.report import final_state
from master.report.labels import labels_figure


@pytest.fixture(scope="module", params=["v3_kite", "v3_kite_detailed", "typical_section"])
def state(request):
    scene = scenes.load(request.param)
    run = coupled_run(Coupling.in_process(scene, scene.with_trim({})), SCHEMES["iqn-ils"](), stability=False)
    return final_state(scene, run)


def names(figure):
    return [[text for text in axes.texts if text.get_gid() == "name"] for axes in figure.axes]


def bridle(frame):
    """Names of lines (of springs, where there are no lines), and of their nodes."""
    lines = np.flatnonzero(~frame.two_way & ~frame.canopy)
    lines = lines if len(lines) else np.flatnonzero(~frame.canopy)
    return {frame.names[i] for i in lines}, {frame.labels[n] for i in lines for n in frame.chains[i]}


def test_every_line_and_node_of_the_bridle_has_its_name_in_a_view(state):
    figure = labels_figure(state, "a scene")
    shown = {text.get_text() for view in names(figure) for text in view}
    lines, nodes = bridle(state.frame)
    assert shown == lines | nodes
    assert not any("no room" in text.get_text() for text in figure.texts)


@pytest.mark.parametrize(("what", "kind"), [("lines", 0), ("nodes", 1)])
def test_names_are_of_what_was_asked_for(state, what, kind):
    shown = {text.get_text() for view in names(labels_figure(state, "a scene", what)) for text in view}
    assert shown == bridle(state.frame)[kind]


def corners(text, renderer):
    """Corners (4,2) of a name in pixels, turned as it is."""
    turn = text.get_rotation()
    text.set_rotation(0.0)
    box = text.get_window_extent(renderer)
    text.set_rotation(turn)
    middle, (c, s) = 0.5 * (box.min + box.max), (np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn)))
    half = 0.5 * np.array([box.width, 0.5 * box.height])  # letters without what reaches above and below most of them
    return middle + (np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half) @ np.array([[c, s], [-s, c]])


def apart(one, other):
    """Whether two rectangles do not meet: a side of one of them parts them."""
    sides = np.concatenate([np.diff(np.vstack([box, box[:1]]), axis=0) for box in (one, other)])
    across = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
    a, b = one @ across.T, other @ across.T
    return bool(np.any((a.max(axis=0) <= b.min(axis=0)) | (b.max(axis=0) <= a.min(axis=0))))


def test_no_name_stands_on_another_and_all_are_on_the_page(state):
    figure = labels_figure(state, "a scene")
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    for axes, view in zip(figure.axes, names(figure), strict=True):
        boxes = [corners(text, renderer) for text in view]
        frame = axes.get_window_extent(renderer)
        for k, box in enumerate(boxes):
            assert np.all((box >= frame.min) & (box <= frame.max)), view[k].get_text()
            for j in range(k):
                assert apart(box, boxes[j]), (view[k].get_text(), view[j].get_text())


def test_names_stand_at_what_they_name(state):
    """A name on its line or by its node, and a leader from there to one further away: within an inch."""
    figure, frame = labels_figure(state, "a scene"), state.frame
    figure.draw_without_rendering()
    at = dict(zip(frame.labels, frame.position, strict=True))
    view = {"front view, from upwind": [1, 2], "side view, from the left": [0, 2], "side view, from the right": [0, 2],
            "top view, from above": [1, 0]}  # fmt: skip
    _, nodes = bridle(frame)
    checked = 0
    for axes, texts in zip(figure.axes, names(figure), strict=True):
        columns = view[axes.get_title(loc="left")]
        for text in texts:
            if text.get_text() in nodes and text.get_text() not in frame.names:
                place = axes.transData.transform(at[text.get_text()][columns])
                box = text.get_window_extent()
                nearest = np.clip(place, box.min, box.max)
                assert np.linalg.norm(nearest - place) < 1.0 * figure.dpi
                checked += 1
    assert checked >= len(nodes)


def test_names_that_find_no_room_are_listed(state):
    frame = dataclasses.replace(state.frame, labels=tuple(f"node_{'x' * 300}_{k}" for k in state.frame.labels))
    figure = labels_figure(dataclasses.replace(state, frame=frame), "a scene", "nodes")
    count = len(bridle(frame)[1])
    assert any(f"no room for {count} of {count} names" in text.get_text() for text in figure.texts)


def test_a_result_without_a_structure_has_no_names(state):
    assert labels_figure(dataclasses.replace(state, frame=None), "a scene") is None


@pytest.mark.parametrize(
    ("scene", "more"), [("v3_kite", ["--no-stability"]), ("v3_kite_dynamic", ["--stop-time", "0.08"])]
)
def test_labels_are_drawn_where_they_are_asked_for_and_else_not(scene, more, tmp_path):
    words = ["run", scene, "--backend", "in-process", "--out", str(tmp_path), *more]
    assert CliRunner().invoke(app, [*words, "--labels", "both"]).exit_code == 0
    assert {"labels.png", "labels.svg"} <= {path.name for path in tmp_path.iterdir()}
    assert CliRunner().invoke(app, words).exit_code == 0
    assert not list(tmp_path.glob("labels.*"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--labels", "ropes"], "--labels takes nodes, lines or both, not 'ropes'"),
        (["--labels", "nodes", "--no-report"], "--labels asks for a plot, which --no-report leaves out"),
    ],
)
def test_labels_that_cannot_be_are_refused_in_one_sentence(words, said, tmp_path):
    done = CliRunner().invoke(app, ["run", "v3_kite", "--out", str(tmp_path), *words])
    assert done.exit_code == 2
    assert said in done.stderr
