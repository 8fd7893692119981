"""Inflatable wings with one thing wrong: one sentence that names file, row or key and the remedy."""

import pytest

import scenes
from tests.scenes.broken import copy_of, edited


def _replaced(file, old, new):
    return lambda folder: edited(folder, file, old, new)


def _appended(file, text):
    return lambda folder: (folder / file).write_text((folder / file).read_text() + text)


WRONG = {
    "tube of zero diameter": (_replaced("tubes.csv", "0.112708,0.112708", "0,0.112708"), ["tubes.csv row", "'0'"]),
    "tube with one end": (_replaced("tubes.csv", "le_1,1 3,", "le_1,1,"), ["tubes.csv row", "two ends"]),
    "tube of zero length": (_replaced("tubes.csv", "le_1,1 3,", "le_1,1 1,"), ["tubes.csv row", "no length"]),
    "tube on a missing node": (_replaced("tubes.csv", "le_1,1 3,", "le_1,1 x,"), ["tubes.csv row", "'x'"]),
    "two tubes of one name": (_replaced("tubes.csv", "le_2,", "le_1,"), ["tubes.csv row", "'le_1'", "rename"]),
    "hinge that is no end": (
        _replaced("tubes.csv", "le_1,1 3,0.112708,0.112708,", "le_1,1 3,0.112708,0.112708,5"),
        ["tubes.csv row", "hinges"],
    ),
    "attachment on a missing tube": (
        _replaced("attachments.csv", "strut_1", "strut_x"),
        ["attachments.csv", "strut_x"],
    ),
    "node attached twice": (_appended("attachments.csv", "103,strut_2\n"), ["attachments.csv row", "'103'"]),
    "attachment that is a station": (_appended("attachments.csv", "7,strut_1\n"), ["attachments.csv row", "strut_1"]),
    "rib that is a point": (_replaced("ribs.csv", "53,54", "53,53"), ["ribs.csv row", "one point"]),
    "ribs out of order": (
        _replaced("ribs.csv", "53,54\n51,52", "51,52\n53,54"),
        ["ribs.csv row", "left tip"],
    ),
    "pressure of zero": (_replaced("scene.toml", "tube_pressure = 30000.0", "tube_pressure = 0.0"), ["tube_pressure"]),
    "no pressure": (_replaced("scene.toml", "tube_pressure = 30000.0", ""), ["lacks 'tube_pressure'"]),
    "no ribs": (_replaced("scene.toml", 'ribs = "ribs.csv"', ""), ["lacks 'ribs'"]),
    "wing lighter than its canopy": (
        _replaced("scene.toml", "wing_mass = 11.0", "wing_mass = 1.0"),
        ["wing_mass", "canopy"],
    ),
    "disconnected part": (
        lambda f: (
            _appended("nodes.csv", "a,0,0,20,\nb,1,0,20,\n")(f),
            _appended("tubes.csv", "loose,a b,0.1,0.1,\n")(f),
        ),
        ["nodes.csv", "'a'", "no fixed node"],
    ),
    "nothing is held": (_replaced("nodes.csv", "0,0.0,0.0,0.0,xyz", "0,0.0,0.0,0.0,"), ["nodes.csv", "fixed"]),
    "hold on a node without a tube": (_replaced("scene.toml", 'hold = "le_mid"', 'hold = "68"'), ["hold", "68"]),
}  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_wing_is_refused_in_one_sentence(wrong, tmp_path):
    change, words = WRONG[wrong]
    folder = copy_of("v3_kite_detailed", tmp_path)
    change(folder)
    with pytest.raises(scenes.SceneError) as refused:
        scenes.load(folder).structural_core().set("hold_roll_and_yaw", 1.0)
    message = str(refused.value)
    assert "\n" not in message
    assert len(message) < 300
    for word in words:
        assert word in message, message


HANGING = {
    "load on a missing node": (_replaced("loads.csv", "load,29", "load,290"), ["loads.csv row 2", "'290'"]),
    "load without direction": (_replaced("loads.csv", "29,0,0,1", "29,0,0,0"), ["loads.csv row 2", "direction"]),
    "load with a bad name": (_replaced("loads.csv", "centre_load", "2nd"), ["loads.csv row 2", "'2nd'"]),
    "value of an unknown load": (
        _replaced("scene.toml", "load_values = { centre_load = 0.0", "load_values = { middle_load = 0.0"),
        ["load_values", "middle_load"],
    ),
    "flow without a wing": (_appended("scene.toml", "\n[aero]\nwind_speed = 1.0\nreference_area = 1.0\n"), ["[wing]"]),
}  # fmt: skip


@pytest.mark.parametrize("wrong", HANGING)
def test_a_wrong_load_is_refused_in_one_sentence(wrong, tmp_path):
    change, words = HANGING[wrong]
    folder = copy_of("v3_hanging_test", tmp_path)
    change(folder)
    with pytest.raises(scenes.SceneError) as refused:
        scenes.load(folder).structural_core()
    for word in words:
        assert word in str(refused.value), str(refused.value)


def test_pressure_that_no_tube_can_have_is_refused_and_the_old_one_kept():
    core = scenes.load("v3_kite_detailed").structural_core()
    for value in (0.0, -1.0, float("nan"), 1e9):
        with pytest.raises(ValueError, match="tube_pressure"):
            core.set("tube_pressure", value)
    assert float(core.get("tube_pressure")) == 30000.0
