"""A run that does not converge writes one shape, and says of which coupling iteration it is."""

import contextlib
import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from benchmarks.problems import in_process
from master import commands
from master.cli import app
from master.coupling import Coupling
from tests.master.toys import Faulty

ENDS = {
    "too few iterations": ({}, ["--max-iterations", "3"], 3),
    "a flow that fails from the third on": (dict.fromkeys(range(3, 500), "discard"), [], 2),
    "a flow that fails from the start": ({"always": "discard"}, [], 0),
    "growth": ({}, ["--scheme", "relaxation", "--relaxation", "5"], None),
}


def column(path, *names):
    with path.open() as file:
        return np.array([[float(row[name]) for name in names] for row in csv.DictReader(file)])


@pytest.mark.parametrize("end", ENDS)
def test_the_tables_of_a_run_that_does_not_converge_are_of_one_shape(end, tmp_path, monkeypatch):
    faults, words, iterate = ENDS[end]
    made = commands.pair

    @contextlib.contextmanager
    def faulty(*arguments):
        with made(*arguments) as coupling:
            flow = Faulty(coupling.aero)
            flow.faults = faults
            yield Coupling(coupling.structural, flow)

    monkeypatch.setattr(commands, "pair", faulty)
    words = ["run", "v3_kite", "--backend", "in-process", "--no-report", "--out", str(tmp_path / "out"), *words]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 1, done.output
    content = json.loads((tmp_path / "out/summary.json").read_text())
    nodes = column(tmp_path / "out/nodes.csv", "x_m", "y_m", "z_m")
    surface = column(tmp_path / "out/interface.csv", "x_m", "y_m", "z_m")
    scene = scenes.load("v3_kite")
    # the interface hangs on the nodes by a linear map, exactly but for rounding of metres
    assert np.allclose(scene.interface.weights @ nodes, surface, rtol=0.0, atol=1e-12)
    assert iterate is None or content["shape_of_iteration"] == iterate
    which = content["shape_of_iteration"]
    shown = "of the start" if which == 0 else f"after coupling iteration {which} of {content['coupling_iterations']}"
    assert f"not converged: all that is written is of one shape, that {shown}" in content["remarks"]


def test_the_shape_of_an_iteration_is_that_of_a_run_which_ends_with_it(tmp_path):
    coupling = in_process("v3_kite", wind_speed=12.0)
    from master.coupling import scheme, solve

    seen = {}
    for last in (2, 3):
        result = solve(in_process("v3_kite", wind_speed=12.0), scheme("aitken"), max_iterations=last)
        assert result.iterate == last
        seen[last] = result.displacement
    flow = Faulty(coupling.aero)
    flow.faults = dict.fromkeys(range(4, 500), "discard")
    broken = solve(Coupling(coupling.structural, flow), scheme("aitken"))
    assert broken.status == "diverged"
    assert np.array_equal(broken.displacement, seen[broken.iterate])
