"""Every built-in scene, and every setting of it changed once: later scenes and settings are tested without a word.

Those with inflatable wings, membranes or closed bodies are large: they are taken on coarse meshes, and their settings
are not changed. Nor are those of transient scenes, whose schemes of integration are tested without FMUs
(tests/scenes/test_transient_core.py). RIGID are scenes without a structure, with one FMU.
"""

import scenes

# Meshes on which a first solve takes a second instead of some.
COARSE = {name: {"canopy_stations": 2} for name in ("v3_hanging_test", "v3_kite_detailed")}
COARSE |= {"airbag": {"cells": 2}, "hencky": {"cells": 3}}
COARSE |= {name: {"variant": "sketch"} for name in ("box_wing", "flexible_wing", "parafoil_160", "swept_wing")}
COARSE |= {"parafoil_small": {}}


LIKE = dict.fromkeys(("parafoil_160", "flexible_wing"), "parafoil_small")  # scenes with nothing that another one lacks


def _cases():
    for name in scenes.available():
        if name in LIKE:
            continue
        yield name, COARSE.get(name, {})
        scene = scenes.load(name)
        for key, option in scene.offers.items() if name not in COARSE and not scene.transient else ():
            for value in option.options or [option.default + 1]:
                if value != option.default:
                    yield name, {key: value}


ALL = list(_cases())
RIGID = [case for case in ALL if not scenes.load(*case).has_structure]
CASES = [case for case in ALL if case not in RIGID]
PLAIN = [case for case in CASES if case[1] == COARSE.get(case[0], {})]


def label(case):
    """The name of a case in a test report."""
    name, settings = case
    return "-".join([name, *(f"{key}={value}" for key, value in settings.items())])


def start(scene):
    """Start values of parameters that a coupled simulation of the scene begins with."""
    return {} if scene.trim is None else {"trim_angle": scene.trim_angle()}


def gust(displacement):
    """Pressure on all panels of a wing without a flow, which does not settle with its displacement (a list)."""
    return 5.0 + 1e6 * abs(displacement[2]) % 10.0
