"""A coupled solve that is interrupted anywhere continues to the last bit as if it had not been."""

import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import master
from benchmarks.problems import in_process
from master import commands, restart
from master.coupling import checkpoint, scheme, solve
from tests.master.kept_runs import CASES, Interrupted, about, begun

ROOT = Path(master.__file__).parents[1]


def assert_same(again, whole):
    assert again.status == whole.status
    assert np.array_equal(again.displacement, whole.displacement)
    assert again.residual_N == whole.residual_N
    assert len(again.history) == len(whole.history)
    for a, b in zip(again.history, whole.history, strict=True):
        assert a == b or all(a[k] == b[k] or np.isnan(a[k]) for k in b)  # omega, columns, residuals, all outputs


@pytest.mark.parametrize(
    ("name", "method", "order"),
    [("section", m, o) for m in ("iqn-ils", "iqn-imvj", "newton-krylov") for o in ("serial", "parallel")]
    + [
        ("section", "aitken", "serial"),
        ("kite", "iqn-ils", "serial"),
        ("kite", "iqn-ils", "parallel"),
        ("kite", "aitken", "serial"),
        ("kite", "newton-krylov", "serial"),
    ],
)
def test_a_coupled_solve_goes_on_bitwise_from_every_coupling_iteration(name, method, order, tmp_path):
    path = tmp_path / "kept.checkpoint"
    whole, _, used = begun(name, path, -1, method, order)
    assert whole.status == "converged"
    # every iteration of the section and of the kite by default, else the first, the second, the middle, the last
    places = range(whole.iterations)
    if name == "kite" and (method, order) != ("iqn-ils", "serial"):
        places = sorted({0, 1, whole.iterations // 2, whole.iterations - 1})
    for at in places:
        with pytest.raises(Interrupted):
            begun(name, path, at, method, order)
        coupling = in_process(CASES[name][0], **CASES[name][1])
        fresh = scheme(method, coupling, order)
        search, remarks = restart.resumed(
            path, coupling, fresh, about(name, coupling, scheme=method, order=order), {}
        )  # fmt: skip
        assert remarks == [f"restarted from {path.name} after {at} coupling iterations"]
        again = solve(coupling, fresh, atol=1e-7, order=order, search=search)
        assert_same(again, whole)
        for entry in ("_shares", "_floor", "_omega", "_size"):
            assert np.array_equal(getattr(fresh, entry, None), getattr(used, entry, None))


def test_a_restart_after_all_iterations_are_used_up_ends_as_that_and_not_in_an_error(tmp_path):
    path = tmp_path / "kept.checkpoint"
    with pytest.raises(Interrupted):
        begun("kite", path, 5)
    coupling = in_process("v3_kite", **CASES["kite"][1])
    used = scheme("iqn-ils")
    search, _ = restart.resumed(path, coupling, used, about("kite", coupling, max_iterations=3), {})
    result = solve(coupling, used, atol=1e-7, max_iterations=3, search=search)
    assert (result.status, result.iterations) == ("max_iterations", 6)


def test_fewer_iterations_than_were_made_before_the_tolerance_was_tightened_end_as_max_iterations():
    coupling = in_process("typical_section", wind_speed=15.0)
    kept = []
    used = scheme("relaxation", omega=0.5)
    options = {"atol": 1e-2, "force_tolerance": 1e-6}

    def hold(search, snapshot):
        if search.tighter < 1.0:
            kept.append(pickle.dumps(checkpoint.dump_search(coupling, used, search, snapshot)))

    solve(coupling, used, hold=hold, **options)
    assert kept
    again = in_process("typical_section", wind_speed=15.0)
    search = checkpoint.load_search(again, pickle.loads(kept[0]))
    result = solve(again, used, max_iterations=1, search=search, **options)
    assert result.status == "max_iterations"


@pytest.mark.parametrize("how", ["iterating", "converged"])
@pytest.mark.parametrize(
    ("change", "chosen", "says"),
    [
        ({"tolerance": 1e-9}, {}, "tolerance 1e-07 -> 1e-09"),
        (
            {"scheme": "aitken"},
            {},
            "aitken; coupling iterations are counted from 1 again, without the history of another scheme",
        ),
        ({"parameters": {"wind_speed": 16.0}}, {"wind_speed": "16"}, "wind_speed 15.0 -> 16.0"),
    ],
)
def test_a_restart_with_other_settings_says_what_changed_and_finds_what_a_fresh_run_finds(
    how, change, chosen, says, tmp_path
):
    path = tmp_path / "kept.checkpoint"
    if how == "iterating":
        with pytest.raises(Interrupted):
            begun("section", path, 2)
    else:
        result, coupling, used = begun("section", path, -1)
        restart.CheckpointWriter(path, 1, coupling, used, about("section", coupling)).end(result)
    coupling = in_process("typical_section", **CASES["section"][1])
    now = about("section", coupling) | change
    used = scheme(now["scheme"])
    search, (remark,) = restart.resumed(path, coupling, used, now, chosen)
    assert says in remark
    found = solve(coupling, used, atol=now["tolerance"], search=search)
    assert found.status == "converged"
    fresh = solve(in_process("typical_section", **now["parameters"]), scheme("iqn-ils"), atol=1e-9)
    # residual of 1e-7 m over 1 - q / q_D, which is above 0.3 here
    assert np.abs(found.displacement - fresh.displacement).max() < 1e-6


FMUS = """
import sys
from pathlib import Path
from benchmarks.problems import as_fmus
from fmus.builder import archive
from master import commands, restart
from master.coupling import checkpoint
from master.coupling import scheme, solve

path, at = Path(sys.argv[1]), int(sys.argv[2])
about = {"scene": "typical_section", "scene_settings": {}, "parameters": {}, "order": "serial"}
with as_fmus("typical_section", wind_speed=15.0) as coupling:
    used, search = scheme("iqn-ils"), None
    keeper = restart.CheckpointWriter(path if at >= 0 else None, 1, coupling, used, about)
    if at == -2:
        search, _ = restart.resumed(path, coupling, used, about, {})

    def hold(search, snapshot):
        keeper(search, snapshot)
        if len(search.history) == at:
            import os
            os._exit(3)

    result = solve(coupling, used, atol=1e-8, search=search, hold=hold)
    print(result.status, [float(v).hex() for v in result.displacement.ravel()])
    print([row["residual_m"].hex() for row in result.history])
"""


def test_fmus_in_a_new_process_go_on_bitwise(tmp_path):
    path = tmp_path / "kept.checkpoint"

    def process(at):
        return subprocess.run(
            [sys.executable, "-W", "error", "-c", FMUS, str(path), str(at)],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    whole = process(-1)
    assert whole.returncode == 0, whole.stderr
    assert process(2).returncode == 3
    rest = process(-2)
    assert rest.returncode == 0, rest.stderr
    assert rest.stdout == whole.stdout
    assert rest.stdout.startswith("converged")


CHOICES = {
    "scheme": "iqn-ils",
    "backend": "in-process",
    "order": "serial",
    "tolerance": 1e-5,
    "force_tolerance": 0.01,
    "max_iterations": 200,
    "relaxation": None,
    "stability": False,
    "report": False,
}


def test_the_command_goes_on_from_the_end_of_another_run_with_another_wind(tmp_path):
    path = tmp_path / "kept.checkpoint"
    keep = checkpoint.Files(checkpoint=path)
    assert commands.run_scene("v3_kite", CHOICES, {"wind_speed": "12"}, tmp_path / "a", keep) == 0
    about_, _ = checkpoint.read(path)
    assert about_["status"] == "converged"
    onward = checkpoint.Files(restart=path)
    counts = {}
    for name, files in (("warm", onward), ("cold", checkpoint.Files())):
        assert commands.run_scene("v3_kite", CHOICES, {"wind_speed": "12.5"}, tmp_path / name, files) == 0
        content = json.loads((tmp_path / name / "summary.json").read_text())
        counts[name] = content["coupling_iterations"]
        assert any("wind_speed 12.0 -> 12.5" in remark for remark in content["remarks"]) == (name == "warm")
    assert counts["warm"] < counts["cold"]


def test_the_command_refuses_other_settings_of_a_scene(tmp_path):
    path = tmp_path / "kept.checkpoint"
    keep, onward = checkpoint.Files(checkpoint=path), checkpoint.Files(restart=path)
    assert commands.run_scene("typical_section", CHOICES, {"wind_speed": "12"}, tmp_path / "a", keep) == 0
    with pytest.raises(ValueError, match=r"has variant = divergent, this run restoring.*\.$"):
        commands.run_scene("typical_section", CHOICES, {"variant": "restoring"}, tmp_path / "b", onward)
    with pytest.raises(ValueError, match=r"--checkpoint-every must be a whole number of at least 1.*\.$"):
        commands.run_scene("typical_section", CHOICES, {}, tmp_path / "c", checkpoint.Files(path, 0))
