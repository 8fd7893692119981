"""Parafoils that cannot be: each mistake is one sentence that says what to change."""

import re
import shutil

import pytest

import scenes
from scenes.schema import SceneError

PLANFORM = re.compile(r"profile = .*?last_cell = [\d.]+\n", re.DOTALL)
TABLE = 'stations = "ribs.csv"\ntip = "sewn"\n'
HEADER = "x_m,y_m,z_m,chord_m,twist_deg,roll_deg,profile\n"
RIBS = "0,0,0,4,0,0,{profile}\n0,1.5,0,3.6,0,-10,{profile}\n0,3.0,-0.5,2.8,0,-20,{profile}\n"
FIGURE_OF_EIGHT = (
    "crossed\n1.0 0.0\n0.6 0.06\n0.3 -0.05\n0.05 0.05\n0.0 0.0\n0.05 -0.05\n0.3 0.05\n0.6 -0.06\n1.0 0.0\n"
)
FROM_THE_NOSE = "turned\n0.0 0.0\n0.3 0.09\n0.7 0.05\n1.0 0.0\n0.7 -0.05\n0.3 -0.09\n0.0 0.0\n"


def with_ribs(rows):
    return lambda text, folder: (folder / "ribs.csv").write_text(HEADER + rows) and PLANFORM.sub(TABLE, text)


def with_profile(coordinates):
    def change(text, folder):
        (folder / "profile.dat").write_text(coordinates)
        return text.replace('"naca 0018"', '"profile.dat"')

    return change


def instead(old, new):
    def change(text, folder):
        assert old in text
        return text.replace(old, new, 1)

    return change


NACA = RIBS.format(profile="0018").splitlines(keepends=True)
BAD = {
    "ribs out of order": (with_ribs(NACA[0] + NACA[2] + NACA[1]), "row 4.* goes back along the span"),
    "one rib": (with_ribs(NACA[0]), "the only rib; a parafoil has three at least"),
    "ribs that do not begin in the middle": (with_ribs(NACA[1] + NACA[2]), "begin with the middle one"),
    "a middle rib that leans": (
        with_ribs(NACA[0].replace("4,0,0", "4,0,5") + NACA[1]),
        "roll_deg must be 0 in the plane y = 0",
    ),
    "a profile that crosses itself": (with_profile(FIGURE_OF_EIGHT), "crosses itself, at 0.* of the chord"),
    "a profile from the nose on": (with_profile(FROM_THE_NOSE), "does not begin and end at its trailing edge"),
    "a row off the rib": (instead("D = 0.70", "D = 1.20"), "D is off the rib"),
    "a row called as the tether": (instead("D = 0.70", "tether_1 = 0.70"), "tether_1 has the name of a tether"),
    "no row": (lambda text, folder: re.sub(r"\n[ABCD] = [\d.]+", "", text), "is empty; name a row of lines"),
    "rows at one node": (instead("D = 0.70", "D = 0.4201"), "too near to each other"),
    "trim of the bridle": (instead("trim = 32.0", "trim = 151.0"), "trim must be a number from -50 to 150"),
    "shortening above the width": (
        instead('shape = "body"', 'shape = "body"\npanel_shortening = [[0.0, 1.0], [1.0, 100.0]]'),
        "of 100 % is more than the panel is wide",
    ),
    "shortening along no chord": (
        instead('shape = "body"', 'shape = "body"\npanel_shortening = [[1.0, 1.0], [0.0, 2.0]]'),
        "must rise from 0, the nose, to 1",
    ),
    "arc": (instead("arc = 60.0", "arc = 81.0"), "beyond 80 its tips face each other"),
    "odd cells": (instead("cells = 10", "cells = 9"), "cells must be even"),
    "more equal cells than there are": (instead("equal_cells = 1", "equal_cells = 6"), "give 1 to 5"),
    "tether shorter than the lines": (
        instead("depth =", "tether_length = 3.0\ntether_diameter = 0.014\ndepth ="),
        "tether_length is 3 m, less than the",
    ),
    "tether without a diameter": (instead("depth =", "tether_length = 30.0\ndepth ="), "lacks 'tether_diameter'"),
    "belts of all ribs": (instead("depth =", "belt_ribs = 5\ndepth ="), "leave some with lines of their own"),
    "loads that all follow a wing that pitches": (
        instead('method = "panel"', 'method = "panel"\nfollow = "all"'),
        "nothing holds its pitch",
    ),
    "inlets open": (instead("cells = 10", 'cells = 10\ninlets = "open"'), "inlets cannot be open"),
    "no modulus": (instead("line_modulus = 83.6e9  # Pa\n", ""), "lacks 'line_modulus'"),
    "other cells of the membranes": (instead("rib_rows = 3", "rib_rows = 3\ncells = 8"), "those of the parafoil"),
    "a bridle without a parafoil": (
        lambda text, folder: PLANFORM.sub(
            'profile = "0018"\nspan = 9.0\nchord = 4.0\n', text.replace('shape = "parafoil"', 'shape = "wing"')
        ),
        r"\[bridle\] hangs on the ribs of a parafoil",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_is_one_sentence(case, tmp_path):
    change, told = BAD[case]
    folder = tmp_path / "kite"
    shutil.copytree(scenes.load("parafoil_small").folder, folder)
    text = (folder / "scene.toml").read_text()
    changed = change(text, folder)
    assert changed != text
    (folder / "scene.toml").write_text(changed)
    with pytest.raises(SceneError, match=told) as caught:
        scenes.load(folder)
    assert str(caught.value).count("\n") == 0


@pytest.mark.parametrize("trim", [-51, 151])
def test_a_trim_far_off_the_chord_is_refused(trim):
    with pytest.raises(SceneError, match=r"trim .*must lie between -50"):
        scenes.load("parafoil_small", {"trim": trim})
