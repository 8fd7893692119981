"""Inflatable wings with one thing wrong: one sentence that names file, row or variable and the remedy."""

import numpy as np
import pytest

import scenes
from tests.scenes.broken import copy_of, edited

TOML = "scene.toml"
KITE, HUNG = "v3_kite_detailed", "v3_hanging_test"


def _replaced(file, old, new):
    return lambda folder: edited(folder, file, old, new)


def _appended(file, text):
    return lambda folder: (folder / file).write_text((folder / file).read_text() + text)


def _both(*changes):
    def change(folder):
        for one in changes:
            one(folder)

    return change


def _refused(name, change, tmp_path):
    """The message with which a changed scene is refused, after the checks that all messages must pass."""
    folder = copy_of(name, tmp_path)
    change(folder)
    with pytest.raises(scenes.SceneError) as caught:
        scenes.load(folder).cores()
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(name)
    assert message.endswith(".")
    assert 20 < len(message) < 300
    assert ";" in message or "must" in message  # the remedy follows the finding
    return message


LE = "le_mid,te_mid"
LOADS = "load_values = { centre_load = 0.0, tip_load = 0.0 }"
# what is wrong: (change, words that the message must hold)
WINGS = {
    "zero diameter": (_replaced("tubes.csv", "1 2,0.112452,", "1 2,0,"), ["tubes.csv row 2", "start_diameter_m"]),
    "negative diameter": (_replaced("tubes.csv", ",0.078907", ",-0.1"), ["tubes.csv row 3", "end_diameter_m"]),
    "tube without length": (
        _both(_appended("nodes.csv", "a,0,0,1,\nb,0,0,1,\n"), _appended("tubes.csv", "none,a b,0.1,0.1,\n")),
        ["tubes.csv row 40", "'none'", "length"],
    ),
    "tube from a node to itself": (_appended("tubes.csv", "loop,1 1,0.1,0.1,\n"), ["tubes.csv row 40", "'loop'"]),
    "tube with one end": (_appended("tubes.csv", "half,1,0.1,0.1,\n"), ["tubes.csv row 40", "two ends"]),
    "two tubes of one name": (_appended("tubes.csv", "tip_right,3 4,0.1,0.1,\n"), ["tubes.csv row 40", "row 2"]),
    "tube to nowhere": (_appended("tubes.csv", "far,1 x9,0.1,0.1,\n"), ["tubes.csv row 40", "'x9'"]),
    "hinge elsewhere": (_replaced("tubes.csv", "0.112452,0.112452,", "0.1,0.1,7"), ["tubes.csv row 2", "hinges"]),
    "attachment on a missing tube": (
        _replaced("attachments.csv", "118,tip_right", "118,tip_rigth"),
        ["attachments.csv row 2", "'tip_rigth'"],
    ),
    "attachment of a missing node": (
        _replaced("attachments.csv", "118,tip_right", "1180,tip_right"),
        ["attachments.csv row 2", "'1180'"],
    ),
    "attached twice": (_appended("attachments.csv", "118,strut_1\n"), ["attachments.csv row 42", "'118'", "row 2"]),
    "end of a tube attached to it": (_appended("attachments.csv", "1,tip_right\n"), ["attachments.csv row 42", "end"]),
    "part of a tube attached to another": (
        _appended("attachments.csv", "7,tip_right\n"),
        ["attachments.csv row 42", "'7'", "tube itself"],
    ),
    "fixed node attached": (_appended("attachments.csv", "0,tip_right\n"), ["attachments.csv row 42", "'0'", "fixed"]),
    "attachments without a table": (
        _replaced(TOML, 'attachments = "attachments.csv"\n', ""), ["nodes.csv", "no element"]
    ),
    "rib with one point": (_replaced("ribs.csv", LE, "le_mid,le_mid"), ["ribs.csv row 16", "one point"]),
    "rib of a missing node": (_replaced("ribs.csv", LE, "le_mid,te_md"), ["ribs.csv row 16", "'te_md'"]),
    "ribs that share a node": (_replaced("ribs.csv", LE, "le_mid,30"), ["ribs.csv", "share a node"]),
    "ribs out of order": (
        _both(_replaced("ribs.csv", "\n55,56\n", "\nx\n"), _replaced("ribs.csv", "53,54", "55,56"),
              _replaced("ribs.csv", "\nx\n", "\n53,54\n")),
        ["ribs.csv row 3", "left tip"],
    ),
    "rib the wrong way round": (_replaced("ribs.csv", LE, "te_mid,le_mid"), ["ribs.csv", "'te_mid'", "upwind"]),
    "one rib": (
        lambda folder: (folder / "ribs.csv").write_text(f"leading_edge_node,trailing_edge_node\n{LE}\n"),
        ["ribs.csv", "two ribs"],
    ),
    "part of lines that hangs on nothing": (
        _both(_appended("nodes.csv", "a,0,0,1,\nb,0,0,2,\n"),
              _appended("lines.csv", "loose_1,a b,1,0.001\nloose_2,a b,1,0.001\n")),
        ["nodes.csv", "'a'", "no fixed node"],
    ),
    "tube that hangs on nothing": (
        _both(_appended("nodes.csv", "a,0,0,1,\nb,0,0,2,\n"), _appended("tubes.csv", "loose,a b,0.1,0.1,\n")),
        ["nodes.csv", "'a'", "no fixed node"],
    ),
    "node named as the mesher names its own": (
        _appended("nodes.csv", "w1_1,0,0,1,\n"), ["nodes.csv", "'w1_1'", "rename"]
    ),
    "line named as a canopy spring": (
        _replaced("lines.csv", "br5_left,", "chord_1_0,"), ["lines.csv row 70", "'chord_1_0'", "rename"]
    ),
    "no pressure in the tubes": (_replaced(TOML, "tube_pressure = 3", "tube_pressure = 0.0 # "), ["tube_pressure"]),
    "pressure below zero": (_replaced(TOML, "tube_pressure = 3", "tube_pressure = -3"), ["tube_pressure"]),
    "pressure of a bottle": (_replaced(TOML, "tube_pressure = 3", "tube_pressure = 93"), ["tube_pressure", "300000"]),
    "pressure beyond the fits": (_replaced(TOML, "= 30000.0", "= 290000.0"), ["tube_pressure", "290000", "fits"]),
    "wing lighter than its canopy": (_replaced(TOML, "wing_mass = 11.0", "wing_mass = 1.0"), ["wing_mass", "4.15"]),
    "nothing held": (_replaced("nodes.csv", "0,0.0,0.0,0.0,xyz", "0,0.0,0.0,0.0,"), ["nodes.csv", "fixed"]),
    "held off the plane of symmetry": (_replaced(TOML, '"le_mid"', '"7"'), ["hold", "7", "y = 0"]),
    "held at no tube": (_replaced(TOML, '"le_mid"', '"te_mid"'), ["hold", "te_mid", "tube"]),
    "held at a missing node": (_replaced(TOML, '"le_mid"', '"le_middle"'), ["hold", "'le_middle'"]),
    "struts beside ribs": (_replaced(TOML, "[wing]", '[wing]\nstruts = "ribs.csv"'), ["[wing] struts", "drop"]),
    "setting of strut wings": (
        _appended(TOML, '\n[settings.chord]\ndefault = "design"\noptions = ["design"]\n'), ["settings.chord", "remove"]
    ),
    "one canopy cell along the chord": (
        _replaced(TOML, "default = 6\nminimum = 2", "default = 1\nminimum = 1"), ["canopy_stations", "2 or more"]
    ),
    "half a canopy cell": (_replaced(TOML, "default = 6\n", "default = 6.5\n"), ["canopy_stations", "whole number"]),
    "scale of nothing": (_replaced(TOML, "default = 1.0\nminimum = 0.2", "default = 0.0\nminimum = 0.0"), ["scale"]),
} | {
    f"no {key}": (_replaced(TOML, f"\n{key} = ", f"\n# {key} = "), [TOML, f"'{key}'", "tubes"])
    for key in ("ribs", "tube_pressure", "canopy_stiffness", "canopy_shear_stiffness", "tubes")
}  # fmt: skip

HANGING = {
    "load on a missing node": (_replaced("loads.csv", ",29,", ",299,"), ["loads.csv row 2", "'299'"]),
    "load without direction": (_replaced("loads.csv", "29,0,0,1", "29,0,0,0"), ["loads.csv row 2", "direction"]),
    "load that cannot name a parameter": (
        _replaced("loads.csv", "centre_load,29", "1st_load,29"), ["loads.csv row 2", "'1st_load'"]
    ),
    "value of an unknown load": (
        _replaced(TOML, LOADS, "load_values = { center_load = 9.0 }"), ["load_values", "'center_load'", "centre_load"]
    ),
    "value of a load without a table": (_replaced(TOML, 'loads = "loads.csv"\n', ""), ["load_values", "'loads'"]),
    "value that is a text": (_replaced(TOML, LOADS, 'load_values = { centre_load = "9" }'), ["load_values", "number"]),
    "load named as another variable": (
        _both(_replaced(TOML, LOADS, ""), _replaced("loads.csv", "centre_load", "pressure")), ["'pressure'"]
    ),
    "wing without aero": (_appended(TOML, '\n[wing]\nsections = "a.csv"\npolars = "b.csv"\n'), ["[aero]", "flow"]),
    "aero without wing": (_appended(TOML, "\n[aero]\nwind_speed = 9\n"), ["[aero]", "[wing]", "tubes"]),
    "trim without flow": (_appended(TOML, "\n[trim]\nlowest_deg = 1.0\n"), ["[aero]", "flow"]),
}  # fmt: skip
OTHERS = {
    f"{key} without tubes": (_replaced(TOML, "[structure]", f"[structure]\n{key} = {value}"), [key, "'tubes'"])
    for key, value in {
        "ribs": '"struts.csv"', "attachments": '"struts.csv"', "tube_pressure": "1e4", "tube_stiffness": "1e5",
        "canopy_stiffness": "1e5", "wing_mass": "9.0", "hold": "3",
    }.items()
} | {
    "canopy cells without tubes": (
        _appended(TOML, "\n[settings.canopy_stations]\ndefault = 4\n"), ["canopy_stations", "struts"]
    )
}  # fmt: skip
CASES = [
    *((KITE, wrong, *WINGS[wrong]) for wrong in WINGS),
    *((HUNG, wrong, *HANGING[wrong]) for wrong in HANGING),
    *(("v3_kite", wrong, *OTHERS[wrong]) for wrong in OTHERS),
]


@pytest.mark.parametrize(("name", "change", "words"), [(c[0], c[2], c[3]) for c in CASES], ids=[c[1] for c in CASES])
def test_broken_wing_is_refused_with_what_would_do(name, change, words, tmp_path):
    message = _refused(name, change, tmp_path)
    for word in words:
        assert word in message


@pytest.mark.parametrize("key", ["tube_stiffness", "tube_shear_stiffness"])
def test_law_of_the_fabric_asks_for_its_moduli(key, tmp_path):
    law = _replaced(TOML, 'default = "breukels"', 'default = "fabric"')
    assert f"'{key}'" in _refused(KITE, _both(law, _replaced(TOML, f"\n{key} = ", f"\n# {key} = ")), tmp_path)
    folder = copy_of(KITE, tmp_path / "fits")
    edited(folder, TOML, f"\n{key} = ", f"\n# {key} = ")
    scenes.load(folder).cores()  # the fits need none


@pytest.mark.parametrize("pressure", [0.0, -1e4, 50.0, 4e5, 2.9e5, np.nan, "high"])
def test_pressure_without_a_tube_is_refused_and_the_old_one_stays(pressure):
    core = scenes.load(KITE, {"canopy_stations": 2}).structural_core()
    before = {v.name: core.get(v.name) for v in core.variables}
    with pytest.raises(ValueError, match="tube_pressure") as caught:
        core.set("tube_pressure", pressure)
    assert "\n" not in str(caught.value)
    assert str(caught.value).endswith(".")
    assert all(np.array_equal(before[name], core.get(name)) for name in before)


BARS = {"hanging": ("0,0,2", 0), "on its head": ("0,0,0", 1)}


@pytest.mark.parametrize("bar", BARS)
def test_bar_that_is_free_to_turn_about_its_support_is_solved_and_counted_as_unstable_on_its_head(bar, tmp_path):
    """A support holds places, not rotations: a single beam on it is a pendulum. Gravity is towards +z here."""
    place, unstable = BARS[bar]
    folder = copy_of(HUNG, tmp_path)
    _appended("nodes.csv", f"support,0,0,1,xyz\nend,{place},\n")(folder)
    _appended("tubes.csv", "bar,support end,0.1,0.1,\n")(folder)
    core = scenes.load(folder, {"canopy_stations": 2}).structural_core()
    core.set("solver_tolerance", 1e-3)
    core.step(0.0, 1.0)
    assert core.get("residual") <= 1e-3
    assert core.get("unstable_modes") == unstable
