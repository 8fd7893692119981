"""The plots of a run: what their artists show, that all of it is on the page and large enough to read."""

import dataclasses

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.text import Text

import scenes
from master.coupling import SCHEMES, Coupling, coupled_run
from master.report import final_state
from master.report.convergence import convergence_figure
from master.report.figures import polar_figure, rendered, strip_figure
from master.report.shape import shape_figure

WIND = np.array([8.0, 0.0, 0.0])


def flown(name, settings=None, **given):
    scene = scenes.load(name, settings or {})
    run = coupled_run(Coupling.in_process(scene, given), SCHEMES["iqn-ils"](), stability=False)
    return final_state(scene, run), run


@pytest.fixture(scope="module")
def kite():
    return flown("v3_kite", wind_speed=8.0)


def drawn(state, run):
    return {
        "shape": shape_figure(state, "a scene, wind 8 m/s", "converged", WIND),
        "convergence": convergence_figure(run.result.history, "a scene", 1e-5, 0.01, run.result.residual_N),
        "strips": strip_figure(state.strips, "a scene"),
        "polars": polar_figure(state.strips, "a scene"),
    }


@pytest.fixture(
    scope="module",
    params=[("v3_kite", {}), ("v3_kite", {"chord": "design", "panels_per_section": 4}), ("typical_section", {})],
    ids=["kite", "fine design kite", "plate"],
)
def figures(request):
    name, settings = request.param
    return drawn(*flown(name, settings))


def inside(figure, artist):
    """Whether an artist is within the page."""
    box = artist.get_window_extent(figure.canvas.get_renderer())
    return box.x0 >= 0.0 and box.y0 >= 0.0 and box.x1 <= figure.bbox.width and box.y1 <= figure.bbox.height


def collections(axes, gid):
    return [c for c in axes.collections if c.get_gid() == gid]


def test_slack_lines_are_dashed_and_taut_ones_are_not(kite):
    state, run = kite
    count = int(run.blocks["structural"]["slack_lines"])
    assert count > 0
    figure = shape_figure(state, "a scene", "converged", WIND)
    views = [axes for axes in figure.axes if collections(axes, "slack")]
    assert len(views) == 3
    legs, element = state.frame.legs
    for axes in views:
        (slack,), (taut,), (springs,) = (collections(axes, gid) for gid in ("slack", "taut", "springs"))
        assert len(slack.get_segments()) == np.count_nonzero(state.frame.slack[element])
        assert len(springs.get_segments()) == np.count_nonzero(state.frame.two_way)
        assert len(slack.get_segments()) + len(taut.get_segments()) + len(springs.get_segments()) == len(legs)
        assert slack.get_linestyle()[0][1] is not None
        assert taut.get_linestyle()[0][1] is None
    labels = [text.get_text() for axes in figure.axes if axes.get_legend() for text in axes.get_legend().get_texts()]
    assert f"slack lines ({count})" in labels


def test_loose_lines_are_dashed_and_neither_slack_nor_taut():
    state, _ = flown("v3_kite", wind_speed=12.0)
    count = int(state.frame.loose.sum())
    assert count == 2
    figure = shape_figure(state, "a scene", "converged", WIND)
    _, element = state.frame.legs
    for axes in figure.axes[:3]:
        (loose,), (taut,), (slack,) = (collections(axes, gid) for gid in ("loose", "taut", "slack"))
        assert len(loose.get_segments()) == np.count_nonzero(state.frame.loose[element])
        assert len(taut.get_segments()) == np.count_nonzero(state.frame.taut[element])
        assert not slack.get_segments()
        assert loose.get_linestyle()[0][1] is not None
        assert loose.get_linestyle() != slack.get_linestyle()
    (legend,) = (axes.get_legend() for axes in figure.axes if axes.get_legend())
    labels = [text.get_text().replace("\n", " ") for text in legend.get_texts()]
    assert "loose lines, below 1 % of the largest tension (2)" in labels
    assert "lines under tension (35)" in labels  # of 37


@pytest.mark.parametrize("label", ["0", "pulley_left", "trailing_edge_node_of_the_outermost_left_strut_12"])
@pytest.mark.parametrize("stretch", [(0.5, 1, 1), (1, 1, 1), (1, 1, 30), (3, 1, 1)])
def test_legend_is_on_the_page_beside_the_top_view_whatever_the_nodes_are_called(kite, stretch, label):
    state, _ = kite
    tension = state.frame.tension.copy()
    tension[np.flatnonzero(state.frame.slack)[0]] = 0.1  # one slack line is loose then: an entry more
    shapes = {k: getattr(state.frame, k) * stretch for k in ("undeformed", "position")}
    names = (label,) * len(state.frame.labels)
    frame = dataclasses.replace(state.frame, labels=names, tension=tension, **shapes)
    surface = dataclasses.replace(state.surface, position=state.surface.position * stretch)
    state = dataclasses.replace(state, surface=surface, frame=frame, pivot=label)
    figure = shape_figure(state, "a scene", "converged", WIND)
    (legend,) = (axes.get_legend() for axes in figure.axes if axes.get_legend())
    figure.draw_without_rendering()
    assert inside(figure, legend)
    assert all(inside(figure, text) for text in legend.get_texts())
    box = legend.get_window_extent()
    for axes in (*figure.axes[:3], figure.axes[-1]):  # the views, and the bar below
        assert not box.overlaps(axes.get_tightbbox())
    text = "".join(text.get_text() for text in legend.get_texts()).replace("\n", "")
    assert text.count(label) >= 2


def test_views_show_the_nodes_where_they_are_to_one_scale(kite):
    state, _ = kite
    figure = shape_figure(state, "a scene", "converged", WIND)
    legs, element = state.frame.legs
    taut = legs[~state.frame.two_way[element] & ~state.frame.slack[element]]
    scales = []
    for axes, at in zip(figure.axes, ([1, 2], [0, 2], [1, 0]), strict=False):
        shown = np.array(collections(axes, "taut")[0].get_segments())
        np.testing.assert_array_equal(shown, state.frame.position[taut][..., at])
        limits = np.array([axes.get_xlim(), axes.get_ylim()])
        points = state.frame.position[:, at]
        assert np.all((points > limits.min(axis=1)) & (points < limits.max(axis=1)))
        scales += [axes.bbox.width / np.ptp(limits[0]), axes.bbox.height / np.ptp(limits[1])]
    np.testing.assert_allclose(scales, scales[0], rtol=1e-9)  # rounding
    left, right = figure.axes[0].get_xlim()
    assert left > right  # seen from upwind, the right wing (y > 0) is on the left


@pytest.mark.parametrize("name", ["shape", "convergence", "strips", "polars"])
def test_every_axis_says_what_it_shows_and_in_which_unit(figures, name):
    units = {"m", "N", "N/m", "deg", "m\u00b2/s", "\u2013"}
    counted = {"coupling iteration", "Newton iterations"}
    figure = figures[name]
    rendered(figure)
    checked = 0
    for axes in (axes for axes in figure.axes if axes.axison):
        for axis in (axes.xaxis, axes.yaxis):
            numbered = any(t.get_text() and t.get_visible() for t in axis.get_ticklabels())
            label = axis.get_label().get_text()
            if numbered or label:
                unit = label.split(" (")[0].rpartition(", ")[2]
                assert label in counted or unit in units, label
                checked += 1
    assert checked >= 4


@pytest.mark.parametrize("name", ["shape", "convergence", "strips", "polars"])
def test_all_of_a_figure_is_on_the_page_and_no_letter_is_smaller_than_8_pt(figures, name):
    figure = figures[name]
    rendered(figure)
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert box.x0 >= 0.0
    assert box.y0 >= 0.0
    assert box.x1 <= width
    assert box.y1 <= height
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text():
            assert text.get_fontsize() >= 8.0


@pytest.mark.parametrize("stretch", [(1, 1, 30), (30, 1, 1), (1, 30, 1), (1e-3, 1e-3, 1e-3), (0, 1, 0)])
def test_shape_of_any_proportions_stays_on_the_page(kite, stretch):
    state, _ = kite
    surface = dataclasses.replace(state.surface, position=state.surface.position * stretch)
    shapes = {k: getattr(state.frame, k) * stretch for k in ("undeformed", "position")}
    state = dataclasses.replace(state, surface=surface, frame=dataclasses.replace(state.frame, **shapes))
    figure = shape_figure(state, "a scene", "converged", WIND)
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert min(box.x0, box.y0) >= 0.0
    assert box.x1 <= width
    assert box.y1 <= height <= 11.0  # a page
    for axes, at in zip(figure.axes, ([1, 2], [0, 2], [1, 0]), strict=False):
        limits = np.array([axes.get_xlim(), axes.get_ylim()])
        points = state.frame.position[:, at]
        assert np.all((points > limits.min(axis=1)) & (points < limits.max(axis=1)))
    views = [axes.get_tightbbox() for axes in figure.axes[:3]]
    for i, one in enumerate(views):
        assert not any(one.overlaps(other) for other in views[:i])


def test_history_of_a_run_that_blew_up_is_drawn():
    history = [
        {"iteration": k, "residual_m": r, "structural.imbalance_before_step": r, "aero.newton_iterations": 3.0}
        for k, r in ((1.0, 1.0), (2.0, 1e30), (3.0, np.inf), (4.0, np.nan))
    ]
    figure = convergence_figure(history, "a scene", 1e-5, 0.01, np.nan)
    assert rendered(figure)["png"].startswith(b"\x89PNG")
    residual = figure.axes[0].lines[0].get_ydata()
    assert np.isnan(residual[2:]).all()
    low, high = figure.axes[0].get_ylim()
    assert low < 1e-5
    assert high > 1e30
    assert len(convergence_figure(history[:1], "a scene").axes) == 3


def test_axis_labels_of_the_polars_keep_off_the_numbers_and_off_the_edge(figures):
    figure = figures["polars"]
    rendered(figure)
    for panel in figure.axes[:2]:
        label = panel.yaxis.get_label().get_window_extent()
        assert label.x0 > 0.05 * figure.dpi
        numbers = [t.get_window_extent() for t in panel.get_yticklabels() if t.get_text()]
        assert label.x1 < min(box.x0 for box in numbers)


def test_strips_and_their_polars_have_one_colour(kite):
    state, _ = kite
    for panel in polar_figure(state.strips, "a scene").axes[:2]:
        (curves,) = (c for c in panel.collections if isinstance(c, LineCollection))
        left, right = (c for c in panel.collections if c is not curves)
        n = len(left.get_facecolors())
        np.testing.assert_array_equal(curves.get_colors()[:n], left.get_facecolors())
        np.testing.assert_array_equal(curves.get_colors()[-n:], right.get_facecolors())
        assert len(np.unique(curves.get_colors().round(3), axis=0)) == (len(state.strips.arc) + 1) // 2


def test_strips_stand_on_their_polars(kite):
    state, _ = kite
    figure = polar_figure(state.strips, "a scene")
    for panel, values in zip(figure.axes[:2], state.strips.coefficients, strict=False):
        (curves,) = (c for c in panel.collections if isinstance(c, LineCollection))
        for strip, curve in enumerate(curves.get_segments()):
            at = np.interp(state.strips.alpha[strip], curve[:, 0], curve[:, 1])
            # chords of 0.3 deg below an arc whose slope changes by less than 0.1 per deg
            assert at == pytest.approx(values[strip], abs=2e-3)
        offsets = np.concatenate([np.asarray(c.get_offsets()) for c in panel.collections if c is not curves])
        for alpha, value in zip(state.strips.alpha, values, strict=True):
            assert np.min(np.abs(offsets - [alpha, value]).sum(axis=1)) < 1e-12


def test_dollar_signs_in_a_title_are_dollar_signs(kite):
    figure = shape_figure(kite[0], "costs $1, not $\\foo$", "converged", WIND)
    assert rendered(figure)["svg"].startswith(b"<?xml")
