"""FMUs of scenes with tubes: they are clean, carry the rotations in their state, and one without flow stands alone."""

import subprocess
import sys

import fmpy.validation
import numpy as np
import pytest

import scenes
from fmus.builder import build
from master.coupling import SCHEMES, Coupling, solve
from master.participants import FmuParticipant
from master.still_air import StillAir


@pytest.fixture(scope="module")
def kite(tmp_path_factory):
    scene = scenes.load("v3_kite_detailed")
    return scene, build(scene, tmp_path_factory.mktemp("kite"))


@pytest.fixture(scope="module")
def hanging(tmp_path_factory):
    scene = scenes.load("v3_hanging_test", {"variant": "load_case_5"})
    return scene, build(scene, tmp_path_factory.mktemp("hanging"))


def test_the_fmus_of_inflatable_wings_are_valid(kite, hanging):
    assert [path.name for path in hanging[1]] == ["v3_hanging_test_structural.fmu"]  # there is no flow
    for path in (*kite[1], *hanging[1]):
        assert fmpy.validation.validate_fmu(str(path)) == []
        check = subprocess.run(
            [sys.executable, "-m", "fmu_manipulation_toolbox", "-input", str(path), "-check"],
            capture_output=True,
            text=True,
        )
        assert "FAIL" not in check.stdout + check.stderr


def test_state_of_the_detailed_kite_repeats_bitwise_also_in_another_instance(kite):
    _, (path, flow) = kite
    with FmuParticipant(path) as structural, FmuParticipant(flow) as aero:
        pair = Coupling(structural, aero)
        coupled = pair(structural.get("displacement"))
        state = structural.save()
        outcomes = []
        for _ in range(2):
            structural.set("gravity", 9.0)
            structural.step(5.0, 1.0)
            outcomes.append({b: structural.get(b) for b in ("displacement", "tube_load", "tension")})
            structural.restore(state)
        structural.free(state)
        assert np.any(coupled)
        assert all(np.array_equal(outcomes[0][b], outcomes[1][b]) for b in outcomes[0])
        assert not np.array_equal(outcomes[0]["displacement"], coupled)


def test_the_hanging_kite_runs_alone_and_as_in_process(hanging):
    scene, (path,) = hanging
    shapes = []
    with FmuParticipant(path) as structural:
        for pair in (Coupling(structural, StillAir.beside(structural)), Coupling.in_process(scene)):
            result = solve(pair, SCHEMES["iqn-ils"]())
            assert result.status == "converged"
            shapes.append(result.displacement)
    assert np.array_equal(*shapes)
