"""Membranes with one thing wrong: one sentence that names file, element or group, and the remedy; exit code 2."""

import re

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app
from tests.scenes.membrane_scenes import ISOTROPIC, held, rectangle, written
from tests.scenes.mesh_files import HALVES, SQUARE, msh2

FRAME = held("x_min", "x_max", "y_min", "y_max")
WOVEN = """[membranes.fabrics.sheet]
stiffness_warp = 1e4
stiffness_weft = 9e4
shear_stiffness = 1e3
poisson_warp = 0.2
warp_direction = [1.0, 0.0, 0.0]
"""
PATTERN = "element,side_12_m,side_23_m,side_31_m\n"

# what is wrong: keys, fabric and tables of a rectangle, files, and words that the sentence must hold
SHEETS = {
    "no fabric": ("", "", FRAME, {}, ["[membranes]", "fabric"]),
    "misspelt key": ("wrinkles = true", ISOTROPIC, FRAME, {}, ["[membranes]", "'wrinkles'", "wrinkling"]),
    "misspelt key of a fabric": (
        "", ISOTROPIC + "tear = 1.0\n", FRAME, {}, ["[membranes.fabrics.sheet]", "'tear'", "strength"],
    ),
    "fabric is no table": ("", "[membranes.fabrics]\nsheet = 3\n", FRAME, {}, ["[membranes] fabrics", "tables"]),
    "no stiffness": ("", ISOTROPIC.replace("stiffness = 1e5", ""), FRAME, {}, ["fabrics.sheet]", "'stiffness'"]),
    "modulus without thickness": (
        "", ISOTROPIC.replace("stiffness = 1e5", "modulus = 1e9"), FRAME, {}, ["fabrics.sheet]", "'thickness'"],
    ),
    "stiffness twice": ("", ISOTROPIC + "thickness = 1e-4\n", FRAME, {}, ["fabrics.sheet]", "product"]),
    "Poisson's ratio of 1": (
        "", ISOTROPIC.replace("poisson = 0.0", "poisson = 1.0"), FRAME, {}, ["poisson", "between -1 and 1", "1.0"],
    ),
    "inadmissible contraction": (
        "", WOVEN.replace("0.2", "0.4"), FRAME, {}, ["poisson_warp is 0.4", "10000", "90000", "0.3333"],
    ),
    "woven and alike": ("", WOVEN + "poisson = 0.3\n", FRAME, {}, ["'poisson'", "'stiffness_warp'", "drop one"]),
    "warp without direction": (
        "", WOVEN.replace("warp_direction = [1.0, 0.0, 0.0]", ""), FRAME, {}, ["fabrics.sheet]", "'warp_direction'"],
    ),
    "warp normal to its elements": (
        "", WOVEN.replace("[1.0, 0.0, 0.0]", "[0.0, 0.0, 1.0]"), FRAME, {}, ["normal to elements 1, 2", "direction"],
    ),
    "shorter along nothing": (
        "", ISOTROPIC + "shortening_along = 1.0\n", FRAME, {}, ["fabrics.sheet]", "'warp_direction'"],
    ),
    "fabric of a missing group": (
        "", ISOTROPIC + 'parts = "roof"\n', FRAME, {}, ["no surface group 'roof'", "'sheet'"],
    ),
    "two fabrics on one element": (
        "", ISOTROPIC + ISOTROPIC.replace("sheet", "patch"), FRAME, {}, ["fabrics.patch]", "elements 1, 2", "'sheet'"],
    ),
    "support of a missing group": ("", ISOTROPIC, held("x_mid"), {}, ["no group 'x_mid'", "'x_min'"]),
    "support in no direction": ("", ISOTROPIC, held("x_min", axes="w"), {}, ["supports", "x_min", "'w'"]),
    "rigid mode left": ("", ISOTROPIC, held("x_min"), {}, ["1 rigid mode", "rotation about the axis along y"]),
    "rigid modes left": (
        "", ISOTROPIC, held("x_min", axes="z"), {}, ["4 rigid modes", "translation along x", "translation along y"],
    ),
    "no support": ("", ISOTROPIC, "", {}, ["6 rigid modes"]),
    "pressure of a missing group": (
        "", ISOTROPIC, FRAME + '[membranes.pressures.inside]\nparts = "roof"\n', {}, ["no surface group 'roof'"],
    ),
    "pressure that is no name": (
        "", ISOTROPIC, FRAME + '[membranes.pressures."in side"]\nvalue = 1.0\n', {}, ["'in side'", "parameter"],
    ),
    "pressure named as something else": (
        "", ISOTROPIC, FRAME + "[membranes.pressures.gravity]\nvalue = 1.0\n", {}, ["'gravity'", "rename"],
    ),
    "cable along a missing group": (
        "", ISOTROPIC, FRAME + "[membranes.cables.leech]\naxial_stiffness = 1e4\n", {}, ["no line group 'leech'"],
    ),
    "cable without stiffness": (
        "", ISOTROPIC, FRAME + "[membranes.cables.x_min]\n", {}, ["[membranes.cables.x_min]", "'axial_stiffness'"],
    ),
    "pattern that is no triangle": (
        'patterns = "cut.csv"', ISOTROPIC, FRAME, {"cut_csv": PATTERN + "7,1.0,0.3,0.4\n"},
        ["cut.csv", "element 7", "no triangle", "0.3"],
    ),
    "pattern of an element that is not there": (
        'patterns = "cut.csv"', ISOTROPIC, FRAME, {"cut_csv": PATTERN + "700,1.0,1.0,1.0\n"}, ["cut.csv row 2", "700"],
    ),
    "two patterns of an element": (
        'patterns = "cut.csv"', ISOTROPIC, FRAME, {"cut_csv": PATTERN + "7,0.5,0.4,0.4\n7,0.5,0.4,0.4\n"},
        ["cut.csv row 3", "element 7", "earlier row"],
    ),
    "patterns of second order": (
        'patterns = "cut.csv"\norder = 2', ISOTROPIC, FRAME, {"cut_csv": PATTERN + "7,1,1,1\n"}, ["order 1"],
    ),
    "share of a rectangle": ('share = "half"', ISOTROPIC, FRAME, {}, ["share means nothing to a rectangle"]),
    "unit of a shape": ('unit = "mm"', ISOTROPIC, FRAME, {}, ["unit means nothing to a shape"]),
    "order three": ("order = 3", ISOTROPIC, FRAME, {}, ["order", "from 1 to 2"]),
}  # fmt: skip


def refused(path):
    """The sentence by which the command line refuses a scene, with exit code 2."""
    done = CliRunner().invoke(app, ["run", str(path), "--backend", "in-process", "--out", str(path.parent / "out")])
    assert done.exit_code == 2, done.output
    text = " ".join(done.output.split())
    assert text.startswith("kitecosim: ")
    assert text.endswith(".")
    with pytest.raises(scenes.SceneError) as told:
        scenes.load(path).cores()
    assert "\n" not in str(told.value)
    return str(told.value)


@pytest.mark.parametrize("case", SHEETS)
def test_a_sheet_with_one_thing_wrong_is_refused_in_one_sentence(tmp_path, case):
    keys, fabric, more, files, words = SHEETS[case]
    sentence = refused(written(tmp_path, rectangle(keys=keys, fabric=fabric, more=more), **files))
    assert sentence.startswith("sheet")
    for word in words:
        assert word in sentence


SIZES = {
    "unknown size": ("radius = 1.0\ncells = 3", ["'radius'", "length, width"]),
    "missing size": ("length = 1.0\ncells = 3", ["'width'"]),
    "no cells": ("length = 1.0\nwidth = 1.0", ["'cells'"]),
    "half a cell": ("length = 1.0\nwidth = 1.0\ncells = 2.5", ["cells", "2.5"]),
    "no length": ("length = 0.0\nwidth = 1.0\ncells = 2", ["length", "above zero"]),
    "too many cells": ("length = 1.0\nwidth = 1.0\ncells = 100000", ["500000 cells"]),
}


@pytest.mark.parametrize("case", SIZES)
def test_a_size_that_makes_no_mesh_is_refused_in_one_sentence(tmp_path, case):
    size, words = SIZES[case]
    sentence = refused(written(tmp_path, f'shape = "rectangle"\n[membranes.size]\n{size}\n{ISOTROPIC}{FRAME}'))
    assert sentence.startswith("sheet/scene.toml: [membranes.size]")
    for word in words:
        assert word in sentence


def test_sizes_that_look_like_mm_are_refused_unless_they_are_said_to_be_m(tmp_path):
    def wide(keys=""):
        return written(tmp_path, rectangle(length=3000.0, width=2000.0, keys=keys, more=FRAME))

    sentence = refused(wide())
    assert "rectangle is 3000 m across: its lengths look like mm; give sizes and profiles in m" in sentence
    scenes.load(wide('unit = "m"')).cores()


def of_file(tmp_path, nodes, elements, names=(), keys="", more=""):
    """A scene of a Gmsh file."""
    supports = more or held("2")
    path = written(tmp_path, f'mesh = "sail.msh"\n{keys}\n{ISOTROPIC}{supports}')
    msh2(path / "sail.msh", np.array(nodes, float), elements, names)
    return path


RIM = [(2, (1, 2)), (2, (3, 4))]
TWO = [*SQUARE, [3, 0, 0], [4, 0, 0], [3, 1, 0]]
BOOK = [*SQUARE, [1, 1, 1]]
FILES = {
    "no area": ([*SQUARE, [2, 0, 0]], [*HALVES, (1, (1, 2, 5)), *RIM], "", ["sail.msh: element 3 has no area"]),
    "loose node": ([*SQUARE, [5, 5, 0]], [*HALVES, *RIM], "", ["node 5 of 5 belongs to no triangle"]),
    "parts apart": (TWO, [*HALVES, (1, (5, 6, 7)), *RIM], "", ["2 parts", "element 3", "parts_may_be_apart"]),
    "quads": (SQUARE, [(1, (1, 2, 3, 4)), *RIM], "", ["element 1 is a quad where triangles are asked"]),
    "mm": ([[1e3 * x for x in p] for p in SQUARE], [*HALVES, *RIM], "", ["look like mm"]),
    "curved, and order 1": (
        [*SQUARE[:3], [0.5, 0, 0], [1, 0.5, 0], [0.5, 0.5, 0]], [(1, (1, 2, 3, 4, 5, 6))], "",
        ["order 2", "say order = 2"],
    ),
    "cells of a file": (SQUARE, [*HALVES, *RIM], "settings", ["[settings.cells]", "mesh from a file"]),
    "pressure on three leaves": (
        BOOK, [*HALVES, (1, (1, 3, 5)), *RIM], "pressure", ["3 triangles under pressure meet", "elements 1, 2 and 3"],
    ),
    "open volume": (SQUARE, [*HALVES, *RIM], "closed", ["closed volume is open at elements 1 and 2"]),
}  # fmt: skip


@pytest.mark.parametrize("case", FILES)
def test_a_mesh_file_with_one_thing_wrong_is_refused_in_one_sentence(tmp_path, case):
    nodes, elements, extra, words = FILES[case]
    more = {"pressure": "[membranes.pressures.inside]\n", "closed": "[membranes.pressures.inside]\nclosed = true\n"}
    path = of_file(tmp_path, nodes, elements, more=held("2") + more[extra] if extra in more else "")
    if extra == "settings":
        path.joinpath("scene.toml").write_text(
            "[settings.cells]\ndefault = 4\n" + path.joinpath("scene.toml").read_text()
        )
    if case == "open volume":  # not in a plane of symmetry
        path.joinpath("sail.msh").write_text(re.sub(r" 0\.0\n", " 0.5\n", path.joinpath("sail.msh").read_text()))
    sentence = refused(path)
    for word in words:
        assert word in sentence


def test_a_triangle_against_its_neighbours_is_turned_over_and_noted(tmp_path):
    path = of_file(tmp_path, SQUARE, [(1, (1, 2, 3)), (1, (1, 4, 3)), *RIM], more=held("1"))
    (note,) = scenes.load(path).notes()
    assert "sail.msh: 1 of 2 triangles was turned over" in note


def test_membranes_have_no_dynamics_yet_in_one_sentence(tmp_path):
    path = written(tmp_path, rectangle(more=FRAME + "[dynamics]\nstop_time = 1.0\n"))
    assert "[membranes] have no dynamics yet; drop [dynamics]" in refused(path)


def test_membranes_alone_have_no_flow(tmp_path):
    path = written(tmp_path, rectangle(more=FRAME + "[aero]\nwind_speed = 10.0\n"))
    assert "lacks a section [wing]" in refused(path)


def test_a_setting_of_membranes_means_nothing_without_them(tmp_path):
    toml = scenes.load("typical_section").folder / "scene.toml"
    path = written(tmp_path, "")
    for file in toml.parent.glob("*.csv"):
        (path / file.name).write_bytes(file.read_bytes())
    (path / "scene.toml").write_text("[settings.order]\ndefault = 1\nmaximum = 2\n" + toml.read_text())
    assert "[settings.order] means nothing without [membranes]" in refused(path)


NODES = "node,x_m,y_m,z_m,fixed\na,0,0,0,xyz\nb,{x},0,0,{fixed}\n"


def test_a_node_of_the_table_beside_the_mesh_belongs_to_no_element(tmp_path):
    structure = 'gravity = 0.0\nnodes = "nodes.csv"'
    path = written(tmp_path, rectangle(more=FRAME), structure, nodes_csv=NODES.format(x=0.1, fixed=""))
    assert "node 'b' belongs to no element" in refused(path)


def test_two_nodes_of_the_table_cannot_be_one_of_the_mesh(tmp_path):
    structure = 'gravity = 0.0\nnodes = "nodes.csv"'
    path = written(tmp_path, rectangle(more=FRAME), structure, nodes_csv=NODES.format(x=1e-8, fixed="xyz"))
    sentence = refused(path)
    assert "the nodes 'a' and 'b'" in sentence
    assert "tie of 1e-06 m" in sentence


def test_a_tie_that_is_wider_than_the_mesh_is_refused(tmp_path):
    structure = 'gravity = 0.0\nnodes = "nodes.csv"'
    nodes = NODES.format(x=2.0, fixed="xyz")
    path = written(tmp_path, rectangle(keys="tie = 0.7", more=FRAME), structure, nodes_csv=nodes)
    assert "tie of 0.7 m joins node 'a' to" in refused(path)
