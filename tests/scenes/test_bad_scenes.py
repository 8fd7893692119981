"""Scenes with one thing wrong: one sentence that names file, row or variable and the remedy."""

import shutil

import pytest

import scenes
from tests.scenes.broken import built, copy_of, edited

TOML = "scene.toml"


def _replaced(file, old, new):
    return lambda folder: edited(folder, file, old, new)


def _rewritten(file, content):
    return lambda folder: (folder / file).write_bytes(content)


def _removed(file):
    return lambda folder: (folder / file).unlink()


def _folder_for_file(file):
    def change(folder):
        (folder / file).unlink()
        (folder / file).mkdir()

    return change


def _appended(file, text):
    return lambda folder: (folder / file).write_text((folder / file).read_text() + text)


# what is wrong: (change, words that the message must hold: file with row, or variable, and what it is about)
TABLES = {
    "duplicate node": (_replaced("nodes.csv", "\n5,", "\n4,"), ["nodes.csv row 7", "'4'", "row 6"]),
    "missing node in line": (_replaced("lines.csv", "3 21,", "3 91,"), ["lines.csv row 3", "'91'"]),
    "missing node in spring": (_replaced("springs.csv", "1 2,", "1 x2,"), ["springs.csv row 2", "'x2'"]),
    "missing node in masses": (_replaced("masses.csv", "kcu,0,", "kcu,k,"), ["masses.csv row 2", "'k'"]),
    "missing node in struts": (_replaced("struts.csv", "5,11,12", "5,11,99"), ["struts.csv row 6", "'99'"]),
    "dangling line": (
        lambda f: (
            edited(f, "nodes.csv", "\n37,", "\nloose,1,2,3,\n37,"),
            edited(f, "lines.csv", "3 21,", "3 loose,"),
            edited(f, TOML, "line_density = 724.0", "line_density = 0.0"),
            edited(f, TOML, 'default = "on"', 'default = "off"'),  # no weight and no wind on lines
        ),
        ["lines.csv row 3", "'A5_right'", "'loose'"],
    ),
    "node without elements": (_appended("nodes.csv", "alone,1,1,1,\n"), ["nodes.csv", "'alone'"]),
    "leg from a node to itself": (_replaced("lines.csv", "3 21,", "3 3,"), ["lines.csv row 3", "A5_right"]),
    "rope with one node": (_replaced("lines.csv", "3 21,", "3,"), ["lines.csv row 3", "nodes"]),
    "spring with three nodes": (_replaced("springs.csv", "1 2,", "1 2 3,"), ["springs.csv row 2", "nodes"]),
    "two lines of one name": (_replaced("lines.csv", "A3_right", "A5_right"), ["lines.csv row 4", "A5_right", "row 3"]),
    "line named as a spring": (_replaced("lines.csv", "A3_right", "te_5"), ["lines.csv row 4", "te_5", "springs.csv"]),
    "misspelt column": (_replaced("lines.csv", "rest_length_m", "rest_length"), ["lines.csv row 1", "rest_length_m"]),
    "text in a number cell": (_replaced("nodes.csv", "-0.16686417", "left"), ["nodes.csv row 3", "x_m", "'left'"]),
    "decimal comma in quotes": (_replaced("nodes.csv", "-0.16686417", '"-0,16"'), ["nodes.csv row 3", "x_m", "-0,16"]),
    "empty number cell": (_replaced("springs.csv", "1.074728", ""), ["springs.csv row 2", "rest_length_m"]),
    "NaN": (_replaced("nodes.csv", "-0.16686417", "nan"), ["nodes.csv row 3", "x_m", "'nan'"]),
    "infinity": (_replaced("nodes.csv", "-0.16686417", "-inf"), ["nodes.csv row 3", "x_m", "'-inf'"]),
    "number that overflows": (_replaced("nodes.csv", "-0.16686417", "1e999"), ["nodes.csv row 3", "x_m"]),
    "negative stiffness": (
        _replaced("springs.csv", ",2000.0,", ",-2000.0,"),
        ["springs.csv row 2", "stiffness_N_per_m"],
    ),
    "zero diameter": (_replaced("lines.csv", "2.782,0.002", "2.782,0"), ["lines.csv row 3", "diameter_m"]),
    "negative rest length": (_replaced("lines.csv", "2.782", "-2.782"), ["lines.csv row 3", "rest_length_m"]),
    "negative mass": (_replaced("masses.csv", "8.4", "-8.4"), ["masses.csv row 2", "mass_kg"]),
    "unknown direction": (_replaced("nodes.csv", ",xyz", ",xyw"), ["nodes.csv row 2", "fixed", "'xyw'"]),
    "nothing fixed": (_replaced("nodes.csv", ",xyz", ","), ["nodes.csv", "fixed"]),
    "too few cells": (_replaced("struts.csv", "5,11,12", "5,11"), ["struts.csv row 6", "2 cells"]),
    "too many cells": (_replaced("struts.csv", "5,11,12", "5,11,12,13"), ["struts.csv row 6", "4 cells"]),
    "struts out of order": (
        lambda f: (
            edited(f, "struts.csv", "1,19,20", "1,x"),
            edited(f, "struts.csv", "2,17,18", "2,19,20"),
            edited(f, "struts.csv", "1,x", "1,17,18"),
        ),
        ["struts.csv row 3", "left tip"],
    ),
    "strut without chord": (_replaced("struts.csv", "5,11,12", "5,11,11"), ["struts.csv row 6"]),
    "one strut": (_rewritten("struts.csv", b"strut,leading_edge_node,trailing_edge_node\n1,19,20\n"), ["struts.csv"]),
    "polar out of order": (_replaced("polars.csv", "1,-14.5,", "1,-15.5,"), ["polars.csv row 3", "'1'", "sort"]),
    "polar with one angle only": (_appended("polars.csv", "lonely,0,0,0,0\n"), ["polars.csv row", "'lonely'"]),
    "unknown polar": (_replaced("sections.csv", "1,19,", "1,99,"), ["sections.csv row 2", "'99'"]),
    "sections in one point": (
        lambda f: (f / "sections.csv").write_text(
            "".join((f / "sections.csv").read_text().splitlines(keepends=True)[i] for i in (0, 1, 1))
        ),
        ["sections.csv row 3"],
    ),
    "unclosed quote": (_replaced("lines.csv", "AI_right,", '"AI_right,'), ["lines.csv"]),
    "text after a quote": (_replaced("lines.csv", "AI_right,", '"AI"_right,'), ["lines.csv"]),
    "semicolons": (
        lambda f: (f / "nodes.csv").write_text((f / "nodes.csv").read_text().replace(",", ";")),
        ["nodes.csv row 1"],
    ),
    "empty table": (_rewritten("lines.csv", b""), ["lines.csv is empty"]),
    "blank table": (_rewritten("lines.csv", b"\n \n\n"), ["lines.csv"]),
    "header only": (_rewritten("lines.csv", b"name,nodes,rest_length_m,diameter_m\n"), ["lines.csv", "no rows"]),
    "binary table": (_rewritten("lines.csv", bytes(range(256)) * 20), ["lines.csv"]),
    "UTF-16 table": (lambda f: (f / "lines.csv").write_text((f / "lines.csv").read_text(), "utf-16"), ["lines.csv"]),
    "folder in place of a table": (_folder_for_file("lines.csv"), ["lines.csv"]),
} | {
    f"no {table}": (_removed(table), [table, "does not exist"])
    for table in ("nodes.csv", "springs.csv", "lines.csv", "masses.csv", "struts.csv", "sections.csv", "polars.csv")
}

DESCRIPTION = {
    "broken TOML": (_replaced(TOML, "[wing]", "[wing"), ["line"]),
    "binary": (_rewritten(TOML, bytes(range(256)) * 20), []),
    "empty": (_rewritten(TOML, b""), ["[structure]", "nodes"]),
    "nested without end": (_rewritten(TOML, b"a = " + b"[" * 5000 + b"]" * 5000), []),
    "number of 5000 digits": (_replaced(TOML, "gravity = 9.81", "gravity = " + "9" * 5000), []),
    "number of 400 digits": (_replaced(TOML, "gravity = 9.81", "gravity = " + "9" * 400), ["gravity"]),
    "unknown section": (_appended(TOML, "\n[tail]\nlength = 1\n"), ["[tail]"]),
    "unknown key": (_replaced(TOML, "gravity = 9.81", "gravty = 9.81"), ["[structure]", "'gravty'"]),
    "missing key": (_replaced(TOML, 'nodes = "nodes.csv"\n', ""), ["[structure]", "'nodes'"]),
    "duplicate key": (_replaced(TOML, "gravity = 9.81", "gravity = 9.81\ngravity = 9.8"), []),
    "path out of bounds of the system": (_replaced(TOML, '"nodes.csv"', '"a\\u0000b"'), ["nodes"]),
    "table that is the folder": (_replaced(TOML, '"nodes.csv"', '"."'), []),
    "unknown method": (_replaced(TOML, '"vortex-step"', '"panels"'), ["method", "vortex-step"]),
    "tape that names no line": (_replaced(TOML, '["power_tape"]', '["tape"]'), ["power_tape_length", "'tape'"]),
    "tape without lines": (_replaced(TOML, '["power_tape"]', "[]"), ["power_tape_length"]),
    "tape named as another variable": (_replaced(TOML, "power_tape_length", "pressure"), ["pressure"]),
    "pivot missing from the nodes": (_replaced(TOML, "pivot = 0", "pivot = 99"), ["pivot", "'99'"]),
    "trim without a pivot": (_replaced(TOML, "pivot = 0\n", ""), ["pivot"]),
    "trim range upside down": (_replaced(TOML, "highest_deg = 25.0", "highest_deg = -25.0"), ["highest_deg"]),
    "trim range without end": (_replaced(TOML, "highest_deg = 25.0", "highest_deg = inf"), ["highest_deg"]),
    "wind from nowhere": (_replaced(TOML, "[1.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]"), ["wind_direction"]),
    "wind in two dimensions": (_replaced(TOML, "[1.0, 0.0, 0.0]", "[1.0, 0.0]"), ["wind_direction"]),
    "wind in words": (_replaced(TOML, "[1.0, 0.0, 0.0]", '["east", 0.0, 0.0]'), ["wind_direction"]),
    "wind nested": (_replaced(TOML, "[1.0, 0.0, 0.0]", "[[1.0], [0.0, 0.0]]"), ["wind_direction"]),
    "default of a setting out of its range": (
        _replaced(TOML, "default = 1\n", "default = 0\n"),
        ["panels_per_section"],
    ),
    "default that is no option": (_replaced(TOML, 'default = "structural"', 'default = "curved"'), ["chord", "curved"]),
    "lines without a modulus": (_replaced(TOML, "line_modulus = 0.55e9", "# line_modulus = 0.55e9"), ["line_modulus"]),
    "setting without default": (_appended(TOML, '\n[settings.variant]\ndescription = "x"\n'), ["settings"]),
}
for _key, _old in {
    "line_modulus": "0.55e9  # Pa",
    "line_density": "724.0",
    "gravity": "9.81",
    "wind_speed": "12.0",
    "air_density": "1.225",
    "reference_area": "19.753",
    "lowest_deg": "-5.0",
}.items():
    _bad = {"nan": "nan", "inf": "inf", "text": '"much"', "true": "true", "list": "[1.0]"}
    if _key in ("line_modulus", "wind_speed", "air_density", "reference_area"):
        _bad |= {"0": "0", "negative": "-1.0"}
    if _key == "line_density":
        _bad |= {"negative": "-1.0"}
    for _name, _value in _bad.items():
        # a comment may follow the value on its line
        _new = f"{_key} = {_value}" + ("  # Pa" if "#" in _old else "")
        DESCRIPTION[f"{_key} = {_name}"] = (_replaced(TOML, f"{_key} = {_old}", _new), [_key])

# every place that holds a table, list, text or number, given something else
WRONG_TYPES = {'"a"': "text", "true": "true", "[1]": "list", "[]": "empty list", "{a=1}": "table", "1979-05-27": "date"}
PLACES = {
    "structure": ("typical_section", None, "structure = {}\n"),
    "settings": ("typical_section", None, "settings = {}\n"),
    "variants": ("typical_section", None, "variants = {}\n[settings.variant]\ndefault = 'divergent'\n"),
    "variants.divergent": (
        "typical_section",
        '[variants.divergent.structure]\nsprings = "springs_divergent.csv"',
        "[variants]\ndivergent = {}",
    ),
    "variants.divergent.structure": (
        "typical_section",
        '[variants.divergent.structure]\nsprings = "springs_divergent.csv"',
        "[variants.divergent]\nstructure = {}",
    ),
    "default of variant": ("typical_section", 'default = "divergent"', "default = {}"),
    "default of panels": ("v3_kite", "default = 1\n", "default = {}\n"),
    "minimum of panels": ("v3_kite", "minimum = 1\n", "minimum = {}\n"),
    "maximum of panels": ("v3_kite", "maximum = 40\n", "maximum = {}\n"),
    "options of chord": ("v3_kite", 'options = ["structural", "design"]', "options = {}"),
    "line_drag": ("v3_kite", 'options = ["on", "off"]', 'options = ["on", {}]'),
    "default of chord": ("v3_kite", 'default = "structural"', "default = {}"),
    "nodes": ("v3_kite", 'nodes = "nodes.csv"', "nodes = {}"),
    "lines": ("v3_kite", 'lines = "lines.csv"', "lines = {}"),
    "pivot": ("v3_kite", "pivot = 0", "pivot = {}"),
    "power_tape_length": ("v3_kite", '["power_tape"]', "{}"),
    "direction": ("v3_kite", 'direction = "control"', "direction = {}"),
    "wind_direction": ("v3_kite", "[1.0, 0.0, 0.0]", "{}"),
    "wing": (
        "v3_kite",
        '[wing]\nstruts = "struts.csv"\nsections = "sections.csv"\npolars = "polars.csv"',
        "[wing]\nstruts = {}",
    ),
    "induction": ("v3_kite", "induction = true", "induction = {}"),
}


def _used(folder, settings, trim):
    scene, _, _ = built(folder, settings)
    if trim:
        scene.trim_angle()


def _refused(folder, settings=None, trim=False):
    """The message with which a scene is refused, after the checks that all messages must pass."""
    with pytest.raises(scenes.SceneError) as caught:
        _used(folder, settings, trim)
    message = str(caught.value)
    assert "\n" not in message
    assert message.endswith(".")
    assert 20 < len(message) < 600
    return message


@pytest.mark.parametrize("wrong", TABLES)
def test_broken_table_is_refused_with_file_row_and_remedy(wrong, tmp_path):
    change, words = TABLES[wrong]
    folder = copy_of("v3_kite", tmp_path)
    change(folder)
    message = _refused(folder)
    assert message.startswith("v3_kite/")
    for word in words:
        assert word in message
    assert ";" in message or "must" in message  # the remedy follows the finding


@pytest.mark.parametrize("wrong", DESCRIPTION)
def test_broken_description_is_refused_with_file_variable_and_remedy(wrong, tmp_path):
    change, words = DESCRIPTION[wrong]
    folder = copy_of("v3_kite", tmp_path)
    change(folder)
    message = _refused(folder, trim=True)
    assert "v3_kite" in message
    for word in words:
        assert word in message


RIGHT_AFTER_ALL = {("induction", "true")}
MISTAKES = [(place, value) for place in PLACES for value in WRONG_TYPES if (place, value) not in RIGHT_AFTER_ALL]


@pytest.mark.parametrize(("place", "value"), MISTAKES)
def test_wrong_type_anywhere_in_the_description_is_refused(place, value, tmp_path):
    name, old, new = PLACES[place]
    folder = copy_of(name, tmp_path)
    if old is None:
        (folder / TOML).write_text(new.format(value) if "{}" in new else new)
    else:
        edited(folder, TOML, old, new.replace("{}", value))
    message = _refused(folder, {"panels_per_section": 3} if place.startswith("m") else None)
    assert TOML in message or place.split()[-1] in message


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"sail": 1}, ["'sail'", "chord", "panels_per_section"]),
        ({"chord": "curved"}, ["chord", "'curved'", "design"]),
        ({"chord": ["design"]}, ["chord"]),
        ({"line_drag": "yes"}, ["line_drag", "'yes'", "on, off"]),
        ({"panels_per_section": "two"}, ["panels_per_section", "'two'"]),
        ({"panels_per_section": "1.5"}, ["panels_per_section"]),
        ({"panels_per_section": 0}, ["panels_per_section", "between 1 and 40"]),
        ({"panels_per_section": 41}, ["panels_per_section", "between 1 and 40"]),
        ({"panels_per_section": None}, ["panels_per_section"]),
        ({"panels_per_section": float("nan")}, ["panels_per_section"]),
    ],
    ids=str,
)
def test_bad_setting_is_refused_with_what_would_do(settings, words):
    message = _refused("v3_kite", settings)
    for word in words:
        assert word in message


def test_unknown_variant_is_refused():
    assert "restoring" in _refused("typical_section", {"variant": "plain"})


def test_option_without_a_meaning_is_refused_with_those_that_have_one(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, TOML, 'options = ["structural", "design"]', 'options = ["structural", "curved"]')
    message = _refused(folder)
    for word in (TOML, "chord", "'curved'", "structural, design"):
        assert word in message


@pytest.mark.parametrize(
    "kind", ["1.5", "true", "[1]", "{a = 1}", "1979-05-27"], ids=["number", "bool", "list", "table", "date"]
)
def test_text_for_a_setting_of_another_kind_is_refused(kind, tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    _appended(TOML, f"\n[settings.variant]\ndefault = {kind}\n")(folder)
    _refused(folder, {"variant": "abc"})


@pytest.mark.parametrize("name", ["no_such_scene", "", ".", "/", "\0", "x" * 5000, "v3_kite/scene.toml", "../scenes"])
def test_unknown_scene_is_refused_with_the_known_ones(name):
    message = _refused(name)
    assert "typical_section, v3_hanging_test, v3_kite, v3_kite_detailed" in message


def test_scene_file_that_is_a_folder_or_gone_is_refused(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    _folder_for_file(TOML)(folder)
    _refused(folder)
    shutil.rmtree(folder / TOML)
    _refused(folder)


def test_quad_that_uses_a_node_twice_is_refused(tmp_path):
    for corners in ("le_left te_left te_right le_left", "le_left te_left le_left te_right"):
        folder = copy_of("typical_section", tmp_path / corners.replace(" ", "_"))
        edited(folder, "canopy.csv", "le_left te_left te_right le_right", corners)
        assert "canopy.csv row 2" in _refused(folder)


@pytest.mark.parametrize("ending", ["\r\n", "\r"], ids=["CRLF", "CR"])
def test_line_endings_of_other_systems_are_read(ending, tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    for table in folder.glob("*.csv"):
        table.write_bytes(table.read_bytes().replace(b"\n", ending.encode()))
    built(folder)


def test_byte_order_mark_of_spreadsheets_is_read(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    for table in folder.glob("*.csv"):
        table.write_bytes(b"\xef\xbb\xbf" + table.read_bytes())
    built(folder)


def test_row_numbers_count_lines_as_an_editor_does(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, "masses.csv", "kcu,0,8.4", '"kcu\nwith winch",0,8.4\n\n')
    edited(folder, "masses.csv", "pulley_a6_left,19,0.1", "pulley_a6_left,19,heavy")
    rows = (folder / "masses.csv").read_text().splitlines()
    assert f"row {1 + next(i for i, r in enumerate(rows) if 'heavy' in r)}:" in _refused(folder)
