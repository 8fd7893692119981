"""A scene without flow stands alone, in its FMU as in this process."""

import numpy as np

import scenes
from fmus.builder import build
from master.coupling import SCHEMES, Coupling, FmuParticipant, solve
from master.coupling.participants.zero_loads import ZeroLoads


def test_the_hanging_kite_runs_alone_and_as_in_process(tmp_path):
    scene = scenes.load("v3_hanging_test", {"variant": "load_case_5", "canopy_stations": 2})
    (path,) = build(scene, tmp_path)  # there is no flow
    shapes = []
    with FmuParticipant(path) as structural:
        for pair in (Coupling(structural, ZeroLoads.beside(structural)), Coupling.in_process(scene)):
            result = solve(pair, SCHEMES["iqn-ils"]())
            assert result.status == "converged"
            shapes.append(result.displacement)
    assert np.array_equal(*shapes)
