"""Polars of rigid wings: angles and their signs, coefficients, warm starts, derivatives, files and what is refused."""

import csv
import io
import json

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from interface import StepFailed
from master import polar
from master.cli import app
from master.report.results_folder import MARKER
from master.studies.polar import COEFFICIENTS, RigidWing
from master.studies.polar.angles import angles, wind_axes
from scenes.cores import Core
from tests.scenes.rigid import flat_wing, rigid_v3

SLOPE = 2.0 * np.pi  # per rad, of the sections of flat wings
STRIPS = "induction = false\n"  # strip theory: every section by itself, in closed form


@pytest.fixture(scope="module")
def rigid(tmp_path_factory):
    return rigid_v3(tmp_path_factory.mktemp("rigid"))


def table(found, *names):
    return np.array([[p.coefficients[name] for name in names] for p in found.points])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("4", [4.0]),
        ("-5:5:5", [-5.0, 0.0, 5.0]),
        ("0, 4,8", [0.0, 4.0, 8.0]),
        ("0:1:0.3", [0.0, 0.3, 0.6, 0.9]),
        ("0:0.3:0.1", [0.0, 0.1, 0.2, 0.3]),
        ("5:-5:-5", [5.0, 0.0, -5.0]),
        ("2:2:1", [2.0]),
    ],
)
def test_lists_and_ranges_of_angles_with_both_ends(text, expected):
    assert angles("--alpha", text) == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is none"),
        ("a", "is none"),
        ("1,,2", "is none"),
        ("nan", "is none"),
        ("1:2", "not of that form"),
        ("1:2:3:4", "not of that form"),
        ("1:5:0", "does not lead"),
        ("1:5:-1", "does not lead"),
        ("0:100:0.001", "100001 angles"),
        ("1,2,1", "given twice"),
        ("0:200:50", "from -180 to 180"),
    ],
)
def test_what_is_no_list_of_angles_is_refused_in_one_sentence(text, words):
    with pytest.raises(ValueError, match=words) as caught:
        angles("--alpha", text)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_sideslip_stays_below_a_right_angle():
    with pytest.raises(ValueError, match="beta must be between -90 and 90 degrees; it is 90"):
        angles("--beta", "0:90:30")


@pytest.mark.parametrize("alpha", [-170.0, -30.0, 0.0, 12.0, 95.0])
@pytest.mark.parametrize("beta", [-40.0, 0.0, 25.0])
def test_wind_axes_are_right_angled_and_give_their_angles_back(alpha, beta):
    axes = wind_axes(alpha, beta)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-15)
    forward, right, down = (
        -np.diag([-1.0, 1.0, -1.0]) @ axes[0]
    )  # velocity in the air, of a wing that stands in the wind
    assert np.rad2deg(np.arctan2(down, forward)) == pytest.approx(alpha, abs=1e-12)
    assert np.rad2deg(np.arcsin(right)) == pytest.approx(beta, abs=1e-12)
    assert axes[1][1] == 0.0  # lift is in the plane of symmetry of the wing


def test_without_sideslip_coefficients_are_those_of_a_run_in_that_wind(rigid):
    found = polar(rigid, [-4.0, 3.0, 11.0])
    for p in found.points:
        core = scenes.load(rigid).aero_core()
        core.set("wind_direction", [np.cos(np.deg2rad(p.alpha)), 0.0, np.sin(np.deg2rad(p.alpha))])
        core.step(0.0, 1.0)
        for name in ("CL", "CD"):
            assert p.coefficients[name] == pytest.approx(float(core.get(name)), abs=1e-9)  # what warm starts leave
        assert abs(p.coefficients["CS"]) < 1e-12


def test_alpha_turns_the_wing_nose_up(rigid):
    """To turn the wind by alpha is to turn the wing nose-up in a wind along x."""
    scene, alpha = scenes.load(rigid), 6.0
    core = scene.aero_core()
    nodes = scene.interface.nodes
    core.set("displacement", scene.heading.started(nodes, {"trim_angle": np.deg2rad(alpha)}) - nodes)
    core.step(0.0, 1.0)
    (point,) = polar(rigid, [alpha]).points
    for name in ("CL", "CD"):
        assert point.coefficients[name] == pytest.approx(float(core.get(name)), rel=1e-9)  # Newton's tolerance
    assert point.coefficients["CL"] > polar(rigid, [0.0]).points[0].coefficients["CL"]


def test_beta_is_wind_from_the_right(rigid):
    """To turn the wind by beta is to turn the wing nose left in a wind along x: anticlockwise from above."""
    scene, beta = scenes.load(rigid), 8.0
    core = scene.aero_core()
    nodes, turn = scene.interface.nodes, scene.heading.axes({"start_azimuth": np.deg2rad(beta)})
    core.set("displacement", nodes @ turn.T - nodes)
    core.step(0.0, 1.0)
    (point,) = polar(rigid, [0.0], [beta]).points
    scale = np.linalg.norm(point.force)
    np.testing.assert_allclose(point.force, core.get("force") @ turn, rtol=0, atol=1e-9 * scale)
    assert point.force[1] < 0.0  # pushed to the left
    assert point.coefficients["CS"] < 0.0


def test_coefficients_make_the_force_and_the_moment_again(rigid):
    found = polar(rigid, [-3.0, 9.0], [-7.0, 5.0], about=[0.2, 0.1, 9.0])
    ref, pressure = found.reference, 0.5 * 1.225 * 12.0**2 * found.reference.area
    for p in found.points:
        c = p.coefficients
        force = pressure * np.array([c["CD"], c["CL"], c["CS"]]) @ wind_axes(p.alpha, p.beta)
        np.testing.assert_allclose(force, p.force, rtol=0, atol=1e-12 * pressure)
        moment = pressure * np.array([-ref.span * c["Cl"], ref.chord * c["CM"], -ref.span * c["Cn"]])
        np.testing.assert_allclose(moment, p.moment, rtol=0, atol=1e-12 * pressure * ref.span)


def test_moments_about_another_point_differ_by_the_moment_of_the_force(rigid):
    one, other = (polar(rigid, [5.0], [5.0], about=about).points[0] for about in (None, [1.0, -2.0, 8.0]))
    np.testing.assert_array_equal(one.force, other.force)
    expected = one.moment - np.cross([1.0, -2.0, 8.0], one.force)
    np.testing.assert_allclose(other.moment, expected, rtol=0, atol=1e-12 * np.linalg.norm(one.moment))


@pytest.mark.parametrize("azimuth", [0.7, 2.5, -1.9])
def test_a_wing_drawn_looking_elsewhere_has_the_same_polar(tmp_path, azimuth):
    found = []
    for name, turn in (("here", 0.0), ("there", azimuth)):
        (tmp_path / name).mkdir()
        path = flat_wing(tmp_path / name, sweep=0.3, dihedral=0.1, azimuth=turn)
        found.append(table(polar(path, [2.0, 8.0], [0.0, 6.0]), *COEFFICIENTS))
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-9)  # Newton's tolerance


def test_strips_of_a_flat_wing_have_their_closed_form(tmp_path):
    found = polar(flat_wing(tmp_path, aero=STRIPS), [-8.0, 0.0, 5.0], with_derivatives=True)
    np.testing.assert_allclose(table(found, "CL")[:, 0], SLOPE * np.deg2rad([-8.0, 0.0, 5.0]), rtol=0, atol=1e-9)
    np.testing.assert_allclose(table(found, "CD", "CM", "Cl", "Cn", "CS"), 0.0, atol=1e-12)  # lift at the quarter chord
    # central differences of a line: rounding of a difference of 0.5 deg
    assert found.derivatives.by_alpha["CL"] == pytest.approx(SLOPE, rel=1e-10)
    assert found.derivatives.static_margin == pytest.approx(0.0, abs=1e-12)


def test_the_static_margin_is_the_distance_to_the_quarter_chord(tmp_path):
    """Of an unswept wing of thin sections, in induced velocity too: its lift acts on the quarter-chord line."""
    path = flat_wing(tmp_path, chord=1.0, point=[-0.2, 0.0, 0.0])
    found = polar(path, [-4.0, 1.0, 6.0], with_derivatives=True).derivatives
    assert found.static_margin == pytest.approx(0.2, abs=1e-9)
    np.testing.assert_allclose(found.neutral_point, 0.0, atol=1e-9)
    assert found.alpha == pytest.approx(0.0, abs=1e-6)  # a flat wing has no moment without lift
    assert found.why == "where C_M is zero"
    assert found.by_alpha["CM"] == pytest.approx(-0.2 * found.by_alpha["CL"], rel=1e-3)  # CD of the lift direction


def test_dihedral_rolls_away_from_the_wind(tmp_path):
    """Strip theory: a half meets the wind at beta times the dihedral more or less, C_l = -slope dihedral beta / 4."""
    dihedral = 0.02
    path = flat_wing(tmp_path, dihedral=dihedral, sections=41, aero=STRIPS)
    found = polar(path, [0.0], derivatives_at=0.0).derivatives
    assert found.why == "given"
    assert found.by_beta["Cl"] == pytest.approx(-SLOPE * dihedral / 4.0, rel=2e-3)  # dihedral^2, 40 strips
    # both halves carry across themselves: side force -2 dihedral (slope beta dihedral / 2) on each half's area
    assert found.by_beta["CS"] == pytest.approx(-SLOPE * dihedral**2, rel=2e-3)


def test_of_a_swept_wing_the_half_into_the_wind_lifts_more(tmp_path):
    found = polar(flat_wing(tmp_path, sweep=0.4), [6.0], derivatives_at=6.0).derivatives
    assert found.by_beta["Cl"] < 0.0
    assert abs(found.by_beta["CL"]) < 1e-6  # even in sideslip: rounding of a difference
    assert abs(found.by_alpha["Cl"]) < 1e-6


def test_derivatives_are_at_the_trim_point_that_is_stable(rigid):
    found = polar(rigid, [0.0, 6.0, 12.0], with_derivatives=True)
    d = found.derivatives
    assert 6.0 < d.alpha < 12.0
    assert abs(d.at["CM"]) < 1e-7  # slope 3 per rad, found to 1e-7 deg
    assert d.by_alpha["CM"] < 0.0 < d.static_margin
    assert d.by_beta["CS"] < 0.0
    step = polar(rigid, [d.alpha - 0.5, d.alpha + 0.5]).points
    slope = (step[1].coefficients["CL"] - step[0].coefficients["CL"]) / np.deg2rad(1.0)
    assert d.by_alpha["CL"] == pytest.approx(slope, rel=2e-2)  # the bend of the polars over twice the step
    behind = polar(rigid, [d.alpha], derivatives_at=d.alpha, about=d.neutral_point).derivatives
    assert abs(behind.static_margin) < 1e-6  # about the neutral point the moment does not change


def test_without_a_trim_point_derivatives_are_in_the_middle(rigid):
    d = polar(rigid, [0.0, 2.0, 3.0], with_derivatives=True).derivatives
    assert d.alpha == 1.5
    assert "middle" in d.why


ATTACHED = [-4.0, 0.0, 4.0, 8.0, 12.0]


def test_up_down_warm_and_cold_are_the_same_answer(rigid):
    up = table(polar(rigid, ATTACHED, [0.0, 5.0]), *COEFFICIENTS)
    cold = table(polar(rigid, ATTACHED, [0.0, 5.0], warm=False), *COEFFICIENTS)
    down = table(polar(rigid, ATTACHED[::-1], [5.0, 0.0]), *COEFFICIENTS)[::-1]
    # Newton's method ends at 1e-9 of U c / 2, whatever it starts from
    np.testing.assert_allclose(cold, up, rtol=0, atol=1e-8)
    np.testing.assert_allclose(down, up, rtol=0, atol=1e-8)


def test_a_warm_start_takes_fewer_newton_iterations(rigid):
    counts = [
        sum(p.outputs["newton_iterations"] for p in polar(rigid, np.arange(5.0, 5.1, 0.01), warm=warm).points)
        for warm in (True, False)
    ]
    assert counts[0] < counts[1]


def test_a_kite_has_the_polar_of_its_design_shape_and_its_wing_alone():
    given = {"chord": "design", "panels_per_section": 4}
    (kite,) = polar("v3_kite", [8.0], settings=given | {"line_drag": "off"}).points
    (with_lines,) = polar("v3_kite", [8.0], settings=given).points
    core = scenes.load("v3_kite", given | {"line_drag": "off"}).aero_core()
    core.set("wind_direction", [np.cos(np.deg2rad(8.0)), 0.0, np.sin(np.deg2rad(8.0))])
    core.step(0.0, 1.0)
    assert kite.coefficients["CL"] == pytest.approx(float(core.get("CL")), abs=1e-12)
    assert with_lines.coefficients == kite.coefficients
    assert with_lines.outputs["glide_ratio"] < kite.outputs["glide_ratio"]  # which counts the lines
    assert polar("v3_kite", [8.0]).reference.about_what == "pivot"


def test_the_wing_of_a_transient_scene_stands_still():
    found = polar("v3_kite_dynamic", [4.0, 8.0])
    assert [p.status for p in found.points] == ["converged"] * 2
    assert [p.outputs["reduced_frequency"] for p in found.points] == [0.0, 0.0]


def test_the_shape_of_a_run_has_the_loads_of_the_run(tmp_path):
    words = ["run", "v3_kite", "--backend", "in-process", "--no-report", "--no-stability", "--out", str(tmp_path)]
    assert CliRunner().invoke(app, words).exit_code == 0
    content = json.loads((tmp_path / "summary.json").read_text())
    (point,) = polar("v3_kite", [0.0], shape=tmp_path).points
    for name in ("CL", "CD"):
        assert point.coefficients[name] == pytest.approx(content["outputs"][name], rel=1e-6)  # solver tolerances
    with pytest.raises(ValueError, match="other settings"):
        polar("v3_kite", [0.0], shape=tmp_path, settings={"panels_per_section": 2})
    with pytest.raises(ValueError, match="is a run of scene 'v3_kite'"):
        polar("typical_section", [0.0], shape=tmp_path)
    with pytest.raises(ValueError, match=r"no summary\.json and interface\.csv"):
        polar("v3_kite", [0.0], shape=tmp_path / "none")


def refusing(monkeypatch, error, *, beyond):
    """Let every flow end with an error where the wind rises more than `beyond` rad."""
    step = Core.step

    def stepped(core, t, dt):
        if core.get("wind_direction")[2] > beyond:
            raise error
        step(core, t, dt)

    monkeypatch.setattr(Core, "step", stepped)


def test_a_point_without_an_answer_does_not_end_the_sweep(rigid, monkeypatch, tmp_path):
    refusing(monkeypatch, StepFailed("no circulation."), beyond=np.sin(np.deg2rad(5.0)))
    words = ["polar", str(rigid), "--alpha=2,8,4", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "alpha 8, beta 0 deg diverged: no circulation." in result.output
    points = json.loads((tmp_path / "polar.json").read_text())["points"]
    assert [p["status"] for p in points] == ["converged", "diverged", "converged"]
    assert points[1]["coefficients"]["CL"] is None
    rows = [*csv.DictReader(io.StringIO((tmp_path / "polar.csv").read_text()))]
    assert [row["CL"] == "" for row in rows] == [False, True, False]
    assert rows[1]["message"] == "no circulation."


@pytest.mark.parametrize(
    ("error", "beyond", "words"),
    [
        (StepFailed("no circulation."), -1.0, "diverged"),
        (ZeroDivisionError("a defect"), np.sin(np.deg2rad(5.0)), "crashed: ZeroDivisionError: a defect"),
    ],
)
def test_no_answer_at_all_and_a_crash_are_exit_code_1(rigid, monkeypatch, tmp_path, error, beyond, words):
    refusing(monkeypatch, error, beyond=beyond)
    result = CliRunner().invoke(app, ["polar", str(rigid), "--alpha=2,8", "--out", str(tmp_path)])
    assert result.exit_code == 1
    assert words in result.output
    assert (tmp_path / "polar.csv").exists()


def test_derivatives_that_are_not_there_are_said_and_exit_code_1(rigid, monkeypatch, tmp_path):
    refusing(monkeypatch, StepFailed("no circulation."), beyond=np.sin(np.deg2rad(5.0)))
    words = ["polar", str(rigid), "--alpha=2,4.9", "--derivatives-at=4.9", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 1
    assert "no derivatives, as there is no answer at alpha 5.15" in result.output
    assert json.loads((tmp_path / "polar.json").read_text())["derivatives"] is None


def test_the_command_leaves_tables_and_plots(rigid, tmp_path):
    words = ["polar", str(rigid), "--alpha=-2:8:2", "--beta=0,5", "--derivatives", "--set", "wind_speed=20"]
    result = CliRunner().invoke(app, [*words, "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    names = {p.name for p in tmp_path.iterdir()}
    assert names == {"polar.csv", "polar.json", "polar.png", "polar.svg", "sideslip.png", "sideslip.svg", MARKER}
    rows = [*csv.DictReader(io.StringIO((tmp_path / "polar.csv").read_text()))]
    content = json.loads((tmp_path / "polar.json").read_text())
    assert len(rows) == len(content["points"]) == 12
    for row, point in zip(rows, content["points"], strict=True):
        assert float(row["CL"]) == point["coefficients"]["CL"]
        assert float(row["force_z_N"]) == point["force_N"][2]
        assert float(row["glide_ratio"]) == point["outputs"]["glide_ratio"]
        assert len(point["strips"]["alpha"]) == 36
        assert point["within_validity"]
    assert content["outputs"]["tip_span"]["unit"] == "m"
    assert content["settings"]["parameters"]["wind_speed"] == 20.0
    assert content["derivatives"]["per_rad_of_alpha"]["CL"] > 3.0
    assert "static margin" in result.output
    again = CliRunner().invoke(app, ["polar", str(rigid), "--alpha=0", "--no-report", "--out", str(tmp_path)])
    assert again.exit_code == 0
    assert {p.name for p in tmp_path.iterdir()} == {"polar.csv", "polar.json", MARKER}  # nothing of the one before


@pytest.mark.parametrize("betas", [[0.0], [0.0, 5.0]])
def test_texts_of_the_plots_lie_apart_and_on_the_page(betas):
    from master.studies.polar.figures import polar_figures

    figures = polar_figures(polar("swept_wing", [0.0, 4.0], betas, settings={"variant": "sketch"}))  # a long title
    for figure in figures.values():
        figure.canvas.draw()
        texts = [*figure.texts, *(t for own in figure.legends for t in own.get_texts())]
        texts += [axis.label for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
        boxes = [t.get_window_extent() for t in texts] + [axes.get_window_extent() for axes in figure.axes]
        for i, box in enumerate(boxes):
            assert not any(box.overlaps(other) for other in boxes[i + 1 :])
        assert all(box.x0 >= 0.0 and box.x1 <= figure.bbox.width for box in boxes)
        assert all(box.y0 >= 0.0 and box.y1 <= figure.bbox.height for box in boxes)


def test_one_alpha_at_several_sideslips_is_drawn_over_sideslip(rigid):
    from master.studies.polar.figures import polar_figures

    figures = polar_figures(polar(rigid, [5.0], [-5.0, 0.0, 5.0]))
    assert [axes.get_xlabel() for axes in figures["sideslip"].axes] == ["sideslip β, deg"] * 3
    figures = polar_figures(polar(rigid, [0.0, 5.0]))
    assert list(figures) == ["polar"]
    assert figures["polar"].axes[0].get_xlabel() == "angle of attack α, deg"


WRONG = {
    "no such scene": (["none"], "there is no scene"),
    "no wing": (["tether_in_wind"], "no wing in a flow"),
    "no flow": (["airbag"], "no wing in a flow"),
    "wind": (["typical_section", "--set", "wind_direction=1,0,0"], "turned by --alpha and --beta"),
    "trim angle": (["v3_kite", "--set", "trim_angle=0.1"], "stays as it is drawn"),
    "azimuth": (["v3_kite", "--set", "start_azimuth=0.1"], "stays as it is drawn"),
    "parameter of the structure": (["v3_kite", "--set", "line_modulus=1e9"], "no setting or parameter"),
    "value": (["v3_kite", "--set", "wind_speed=fast"], "a number"),
    "value out of range": (["v3_kite", "--set", "wind_speed=-1"], "wind_speed must be"),
    "angles": (["v3_kite", "--alpha=up"], "--alpha takes angles"),
    "sideslip": (["v3_kite", "--beta=90"], "beta must be between"),
    "too many": (["v3_kite", "--alpha=0:10:0.01", "--beta=0:10:1"], "more than 10000 points"),
    "point": (["v3_kite", "--about", "1,2"], "--about takes a point"),
    "derivatives beyond": (["v3_kite", "--derivatives-at=400"], "alpha must be from"),
    "folder": (["v3_kite", "--out", "FOLDER"], "is a scene folder"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_bad_input_is_refused_in_one_sentence(wrong, tmp_path):
    words, sentence = WRONG[wrong]
    (tmp_path / "FOLDER").mkdir()
    (tmp_path / "FOLDER/scene.toml").touch()
    words = [str(tmp_path / word) if word == "FOLDER" else word for word in words]
    out = [] if "--out" in words else ["--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, ["polar", *words, *out])
    assert result.exit_code == 2, result.output
    (line,) = result.stderr.strip().splitlines()
    assert sentence in line
    assert line.endswith((".", ")."))
    assert not (tmp_path / "out").exists()


def test_a_wind_along_the_span_is_a_point_that_is_refused(tmp_path):
    wing = RigidWing(str(flat_wing(tmp_path)), {})
    assert wing.at(0.0, 90.0).status == "refused"
    assert wing.at(0.0, 0.0).converged
