"""A slice of what `make stress` does to runs and scenes; the judge sees what it is to see."""

import json

import pytest

from benchmarks import run_stress
from benchmarks.run_stress import MARKER, campaign, contents, fault_of_results, mutants


@pytest.mark.parametrize("name", ["run, in time", "couple"])
def test_killed_and_interrupted_runs_lose_nothing(name, tmp_path):
    counts, wrong = campaign(tmp_path, [name], 4, seed=7)
    assert not wrong, "\n".join(wrong)
    assert counts[name]["tried"] == 4


def test_spoiled_scenes_run_or_are_refused_in_a_sentence(monkeypatch):
    monkeypatch.setattr(run_stress, "WEIGHTS", (6, 8, 0, 0, 1, 0, 0))
    counts, wrong = mutants(40, seed=7)
    assert not wrong, "\n".join(wrong)
    assert sum(row["tried"] for row in counts.values()) == 40
    assert sum(row["refused in a sentence"] for row in counts.values()) > 10  # else nothing was spoiled


def test_the_judge_sees_what_is_not_whole(tmp_path):
    (tmp_path / "a.csv").write_text("x,y\n1,2\n")
    files = {"a.csv": {"by": "run", "sha256": contents(tmp_path)["a.csv"]}}
    marker = {"layout": 1, "state": "complete", "files": files}
    (tmp_path / MARKER).write_text(json.dumps(marker))
    assert not fault_of_results(tmp_path)
    (tmp_path / "b.csv").write_text("of another run")
    assert "not whole" in fault_of_results(tmp_path)
    (tmp_path / "b.csv").unlink()
    (tmp_path / "a.csv").write_text("x,y\n1,2\n3")
    assert "not whole" in fault_of_results(tmp_path)
    files["a.csv"]["sha256"] = contents(tmp_path)["a.csv"]
    (tmp_path / MARKER).write_text(json.dumps(marker))
    assert "half a row" in fault_of_results(tmp_path)
