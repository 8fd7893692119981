"""Scenes of closed bodies: from [body] to the panel method, the two that are built in, and what is refused of them."""

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from interface import area_vectors
from master import polar
from master.cli import app
from tests.scenes.broken import copy_of, edited
from tests.scenes.rigid import V3

BODIES = ("box_wing", "swept_wing")
TOML = "scene.toml"


def solved(name, **settings):
    """The core of a scene, stepped once."""
    core = scenes.load(name, settings).aero_core()
    core.step(0.0, 1.0)
    return core


@pytest.mark.parametrize("name", BODIES)
def test_the_interface_is_the_closed_surface_with_its_trailing_edges(name):
    scene = scenes.load(name, {"variant": "sketch"})
    mesh = scene.interface
    assert mesh.closed
    assert not scene.has_structure
    assert list(scene.cores()) == ["aero"]
    tail = mesh.nodes[mesh.trailing_edges]
    assert np.all(np.isin(mesh.trailing_edges, mesh.panels))
    lengths = np.linalg.norm(tail[:, 1] - tail[:, 0], axis=1).sum()
    if name == "box_wing":  # once round, across the corners
        assert lengths == pytest.approx(2.0 * (12.0 + 2.4) - 0.15 * (8.0 - 4.0 * np.sqrt(2.0)), rel=1e-12)
    else:  # both halves, swept by 45 degrees
        assert lengths == pytest.approx(98 * 0.0254 * np.sqrt(2.0), rel=1e-12)


def test_the_meshes_of_the_box_wing_are_those_of_the_study():
    """Panels round the profile times strips of a half, twice."""
    for variant, panels in {"coarse": 78 * 28, "medium": 118 * 38, "fine": 158 * 52}.items():
        assert len(scenes.load("box_wing", {"variant": variant}).interface.panels) == 2 * panels


def test_the_box_wing_lifts_as_a_panel_method_says_it_does():
    """C_L 0.523 and e 1.42 in the limit, both with S = 2 b c; the thesis' own code has 0.509 on this mesh."""
    core = solved("box_wing")
    pressure = 0.5 * 1.225 * 10.0**2 * 24.0
    assert float(core.get("CL")) == pytest.approx(0.523, rel=0.01)  # of the limit
    # 0.56 % with 78 panels round the profile, below 0.1 % with 158 (docs/verification.md)
    assert float(core.get("trefftz_lift")) / pressure == pytest.approx(float(core.get("CL")), rel=0.006)
    assert float(core.get("span_efficiency")) == pytest.approx(1.42, abs=0.04)  # 28 strips a half: 0.03 above
    assert bool(core.get("symmetry_used"))
    assert float(core.get("reference_area_misfit")) < 1.25  # twice span times chord


def test_the_swept_wing_lifts_as_inviscid_flow_says_it_does():
    """C_L 0.262 with NACA 0012 at 4.2 degrees; 0.238 were measured (Weber and Brebner 1958), with friction."""
    core = solved("swept_wing")
    assert float(core.get("CL")) == pytest.approx(0.262, rel=0.01)
    assert int(core.get("separated_strips")) == 0


@pytest.mark.parametrize("name", BODIES)
def test_coefficients_do_not_depend_on_the_scale(name):
    found = []
    for scale in (1.0, 3.0):
        core = solved(name, variant="sketch", scale=scale)
        force = core.get("force") / scale**2
        found.append([float(core.get("CL")), float(core.get("CD")), *force, *core.get("moment") / scale**3])
    size = np.abs(found[0]).max()
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-8 * size)  # residual of the panels' equations


@pytest.mark.parametrize("name", BODIES)
def test_a_polar_is_the_same_warm_and_cold_upwards_and_downwards(name):
    alphas, given = [0.0, 3.0, 6.0], {"variant": "sketch"}
    up, cold, down = (
        polar(name, angles, [0.0, 4.0], settings=given, warm=warm)
        for angles, warm in ((alphas, True), (alphas, False), (alphas[::-1], True))
    )
    assert all(p.converged for p in up.points)
    values = [np.array([list(p.coefficients.values()) for p in found.points]).reshape(2, 3, -1) for found in (up, cold)]
    values.append(np.array([list(p.coefficients.values()) for p in down.points]).reshape(2, 3, -1)[:, ::-1])
    for other in values[1:]:
        np.testing.assert_allclose(other, values[0], rtol=0, atol=1e-7)  # residual of the panels' equations
    lift = values[0][0, :, 0]
    assert lift[0] == pytest.approx(0.0, abs=1e-3)  # symmetric sections
    assert np.all(np.diff(lift) > 0.15)


def test_beyond_45_degrees_a_point_has_no_answer_and_the_sweep_goes_on():
    found = polar("swept_wing", [0.0, 60.0, 3.0], settings={"variant": "sketch"})
    assert [p.status for p in found.points] == ["converged", "diverged", "converged"]
    assert "45 deg" in found.points[1].message


def test_derivatives_of_a_swept_wing_are_those_of_one():
    """Stable in pitch about its nose; the half into the wind lifts more, so that it rolls away from it."""
    given, about = {"variant": "sketch"}, [0.0, 0.0, 0.0]
    d = polar("swept_wing", [0.0, 4.0], settings=given, about=about, derivatives_at=4.2).derivatives
    assert d.static_margin > 0.0
    assert d.by_beta["Cl"] < 0.0
    assert 2.5 < d.by_alpha["CL"] < 2.0 * np.pi  # of an aspect ratio of 5 and 45 degrees of sweep


def test_the_plot_of_a_run_shows_the_panels_that_are_seen_in_the_colours_of_their_loads(tmp_path):
    words = ["run", "swept_wing", "--set", "variant=sketch", "--backend", "in-process", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    text = (tmp_path / "shape.svg").read_text()
    drawn = [part.split("</g>")[0].count("<path") for part in text.split('<g id="body">')[1:]]
    mesh = scenes.load("swept_wing", {"variant": "sketch"}).interface
    normals = area_vectors(mesh.nodes[mesh.panels])
    seen = [np.count_nonzero(normals @ view > 0.0) for view in ([-1.0, 0, 0], [0, -1.0, 0], [0, 0, 1.0])]
    assert drawn == seen  # from upwind, from the left, from above


# what is wrong: (old, new, words that the message must hold)
WRONG = {
    "method of sheets": ('method = "panel"', 'method = "vortex-step"', ['"vortex-step"', "[body]", '"panel"']),
    "no method named": ('method = "panel"\n', "", ['"vortex-step"', "[body]", '"panel"']),
    "wing too": ("[aero]", '[wing]\nsections = "a.csv"\npolars = "b.csv"\n\n[aero]', ["[body]", "[wing]"]),
    "structure too": ("[aero]", '[structure]\nnodes = "nodes.csv"\n\n[aero]', ["[body]", "[structure]"]),
    "trim": ("[aero]", "[trim]\n\n[aero]", ["[trim]"]),
    "strips of a sheet": (
        "[settings.scale]",
        "[settings.panels_per_section]\ndefault = 1\n\n[settings.scale]",
        ["[settings.panels_per_section]", "rigid"],
    ),
    "no reference area": ("reference_area", "# reference_area", ["reference_area"]),
    "no flow": ("[aero]", "[variants.x.aero]", ["lacks", "[aero]"]),
    "no shape": ("shape = ", "# shape = ", ["[body]", "shape"]),
    "unknown key": ("shape = ", "colour = 3\nshape = ", ["[body]", "colour"]),
    "profile that is none": ('profile = "naca 0012"', 'profile = "naca 12"', ["[body]", "naca 12"]),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_scene_of_a_body_with_one_thing_wrong_is_refused_in_one_sentence(wrong, tmp_path):
    old, new, words = WRONG[wrong]
    path = copy_of("swept_wing", tmp_path)
    edited(path, TOML, old, new)
    with pytest.raises(scenes.SceneError) as caught:
        scenes.load(path, {"variant": "sketch"}).cores()
    message = str(caught.value)
    assert message.startswith("swept_wing/scene.toml")
    assert "\n" not in message
    assert message.endswith(".")
    assert ";" in message or "must" in message  # the remedy follows the finding
    for word in words:
        assert word in message


def test_a_sheet_is_not_for_the_panel_method(tmp_path):
    (tmp_path / "sheet").mkdir()
    (tmp_path / "sheet/scene.toml").write_text(V3.replace("[aero]", '[aero]\nmethod = "panel"').replace(
        'direction = "control"\ncirculation_speed = "far"\n', ""
    ))  # fmt: skip
    with pytest.raises(scenes.SceneError, match=r'\[aero\] method "panel" is not for \[wing\].*"vortex-step"'):
        scenes.load(tmp_path / "sheet")


def test_what_was_changed_of_a_profile_is_a_note_of_every_run(tmp_path):
    """A blunt trailing edge is closed by a wedge."""
    path = copy_of("swept_wing", tmp_path)
    x = 0.5 * (1.0 - np.cos(np.pi * np.arange(31) / 30))
    z = 0.1 * np.sqrt(x) * (1.0 - x) + 0.002 * x
    upper, lower = np.column_stack([x, z])[::-1], np.column_stack([x, -z])[1:]
    rows = "\n".join(f"{a:.9f} {b:.9f}" for a, b in np.concatenate([upper, lower]))
    (path / "blunt.dat").write_text(f"blunt\n{rows}\n")
    edited(path, TOML, 'profile = "naca 0012"', 'profile = "blunt.dat"')
    scene = scenes.load(path, {"variant": "sketch"})
    assert scene.files == ("scene.toml", "blunt.dat")
    (note,) = scene.notes()
    assert "blunt" in note
