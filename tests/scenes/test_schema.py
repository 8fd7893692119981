"""The schema of scene.toml: what is read is what a scene is solved with, and what it may say is said once."""

import re
import shutil
from dataclasses import MISSING, fields

import numpy as np
import pytest

import scenes
from scenes.readers.description import known_keys
from scenes.readers.settings import NUMBERS, OPTIONS
from scenes.schema import SECTIONS, Choices, Number, OneOf, Wrong


def test_every_key_is_explained_where_it_is_declared():
    for kind in (*SECTIONS.values(), Choices):
        for field in fields(kind):
            assert f"`{field.name}`" in kind.__doc__, field.name


def test_every_setting_is_a_choice_with_a_value_for_scenes_that_do_not_offer_it():
    assert set(OPTIONS) == {field.name for field in fields(Choices)}
    for field in fields(Choices):
        assert field.default is not MISSING
        if field.name in NUMBERS:
            assert isinstance(field.default, int | float | None)
        elif OPTIONS[field.name] is not None and field.default is not None:
            assert field.default in OPTIONS[field.name]


def test_defaults_pass_their_own_checks():
    for section in SECTIONS:
        for key, (check, default) in known_keys(section).items():
            if default is not MISSING and default is not None:
                value = list(default) if isinstance(default, tuple) else default
                assert check(value) == default, key


@pytest.mark.parametrize(
    ("check", "good", "bad"),
    [
        (Number(), (0, -1.5, 1e100), (1e101, True, "1", None, float("nan"), float("inf"), 10**400, [1.0])),
        (Number(above=0.0), (1e-300, 5), (0, 0.0, -1.0)),
        (Number(low=0.0), (0, 0.0), (-1e-300,)),
        (Number(low=0.0, high=1.0), (0, 1.0), (1.0000001, -0.1)),
        (OneOf(("a", "b")), ("a", "b"), ("c", 1, None, ["a"])),
    ],
)
def test_a_check_takes_what_it_says_and_nothing_else(check, good, bad):
    for value in good:
        assert check(value) == value
    for value in bad:
        with pytest.raises(Wrong):
            check(value)


def with_setting(tmp_path, lines):
    folder = shutil.copytree(scenes.load("typical_section").folder, tmp_path / "plate")
    file = folder / "scene.toml"
    text = re.sub(r"^\[settings\.panels_per_section\]\n(.+\n)*", "", file.read_text(), flags=re.MULTILINE)
    file.write_text(text.replace("[structure]\n", f"{lines}\n\n[structure]\n", 1))
    return folder


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        ('[settings.scale]\ndefault = "large"\noptions = ["large"]', r"\[settings.scale\] default must be a number"),
        (
            '[settings.panels_per_section]\ndefault = "2"\noptions = ["2"]',
            r"panels_per_section\] default must be a num",
        ),
        ("[settings.panels_per_section]\ndefault = 2.0", r"panels_per_section\] default must be a whole number"),
        ("[settings.chord]\ndefault = 1", r"\[settings.chord\] default must be a text"),
        ("[settings.line_drag]\ndefault = true", r"\[settings.line_drag\] default must be a text or a whole number"),
    ],
)
def test_a_setting_of_another_kind_is_refused(tmp_path, lines, sentence):
    with pytest.raises(scenes.SceneError, match=rf"^plate/scene.toml: .*{sentence}.*\.$"):
        scenes.load(with_setting(tmp_path, lines))


def test_what_a_scene_chooses_is_what_it_is_solved_with():
    scene = scenes.load("v3_kite_detailed", {"scale": 2.0, "canopy_stations": 3, "tube_law": "fabric"})
    assert scene.settings["canopy_stations"] == scene.choices.canopy_stations == 3
    assert scene.members.wing.grid.shape[1] == 4
    assert scene.aero.reference_area == pytest.approx(4.0 * scenes.load("v3_kite_detailed").aero.reference_area)
    assert set(scene.settings) == set(scene.offers)
    assert scenes.load("v3_kite").choices.tube_law == Choices().tube_law  # which it does not offer


def test_settings_are_known_without_reading_a_table(tmp_path):
    folder = shutil.copytree(scenes.load("v3_kite").folder, tmp_path / "kite")
    for table in folder.glob("*.csv"):
        table.unlink()
    assert set(scenes.settings_of(folder)) == set(scenes.load("v3_kite").settings)
    assert scenes.name_of(folder) == "kite"


def test_a_carried_scene_does_not_know_its_folder():
    scene = scenes.load("typical_section")
    carried = scene.carried("aero")
    for ask in (lambda: carried.folder, lambda: carried.files, lambda: carried.offers):
        with pytest.raises(scenes.SceneError, match="'typical_section' comes from an FMU"):
            ask()
    assert carried.carried("aero").interface.nodes is carried.interface.nodes
    assert np.array_equal(carried.polars.cl, scene.polars.cl)
