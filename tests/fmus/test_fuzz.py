"""A slice of the random sequences of calls and of the cycles of which benchmarks/ makes ten thousand and a thousand."""

import os
import pickle
import subprocess
import sys

import pytest

from benchmarks.fmu_cycles import WAYS, cycles_in_process, left_behind
from benchmarks.fmu_fuzz import SEED, SHARES, campaign, unpacked
from benchmarks.fmu_values import sentence
from fmus import builder

pytestmark = pytest.mark.skipif(builder.own_binary() is None, reason="no C compiler was there at installation")
SMALL = [key for key in SHARES if key[0] in ("v3_kite", "typical_section")]


def test_random_calls_end_in_a_status_with_its_sentence_and_the_legal_state_comes_back_to_the_last_bit():
    records = campaign(200, chosen=SMALL)
    told = [f"sequence {r['k']} of seed {SEED}, {r['fmu']}: {r['problem']}" for r in records if r["problem"]]
    assert not told, "\n".join(told)
    assert [record["k"] for record in records] == list(range(200))
    for status in ("0", "2", "3"):  # the calls are not all of one kind: OK, Discard, Error
        assert sum(record["statuses"][status] for record in records) > 100


def test_a_process_that_dies_is_told_with_its_sequence_and_the_next_ones_are_made(tmp_path, monkeypatch):
    died = "import sys, os, json; ks = json.loads(sys.argv[3])\nfor k in ks:\n    print('begin', k, flush=True)\n"
    died += "    if k == 2: os.abort()\n    print(json.dumps({'k': k}), flush=True)"
    from benchmarks import fmu_fuzz

    (tmp_path / "dying.py").write_text(died)
    monkeypatch.setattr(fmu_fuzz, "__name__", "dying")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    records = []
    fmu_fuzz.worker(tmp_path, 1, range(5), records, lambda _: None)
    assert [record["k"] for record in records] == [0, 1, 2, 3, 4]
    assert records[2]["problem"].startswith("sequence 2: the process ended with -6")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (b"wind_speed must be at most 340 m/s.", ""),
        (b"It was 100 %% of it.", ""),
        (b"It was 100 % of it.", "per cent"),
        (b"RuntimeWarning: overflow encountered in dot", "only Python"),
        (b"no end", "no sentence"),
        (b"\xff is not one.", "UTF-8"),
    ],
)
def test_what_is_no_sentence_for_an_engineer_is_found(text, problem):
    assert problem in sentence(text)
    assert bool(sentence(text)) == bool(problem)


@pytest.mark.parametrize("way", WAYS)
def test_cycles_of_making_and_freeing_leave_nothing_behind(way, tmp_path):
    folders = unpacked(tmp_path, [key for key in SMALL if key[0] == "typical_section"])
    _, settled, end = cycles_in_process(way, list(folders.values()), 100)
    assert left_behind(settled, end) == ""


ALONE = """
import pickle, sys
from tests.fmus.turns import in_threads, in_turn
kind, given = sys.argv[1], pickle.loads(bytes.fromhex(sys.argv[2]))
sys.stdout.write(pickle.dumps({"turn": in_turn, "threads": in_threads}[kind](given)).hex())
"""


def found(kind, given):
    """Outputs of the instances of `given`, by a new process."""
    command = [sys.executable, "-W", "error", "-c", ALONE, kind, pickle.dumps(given).hex()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)
    assert not done.stderr
    return pickle.loads(bytes.fromhex(done.stdout))


@pytest.mark.parametrize("scene", ["v3_kite", "typical_section"])
def test_instances_that_share_a_process_give_what_each_gives_alone_to_the_last_bit(scene, tmp_path):
    folders = unpacked(tmp_path, [key for key in SMALL if key[0] == scene])
    given = [(str(folder), factor) for folder in folders.values() for factor in (1.0, 1.3)]
    alone = [found("turn", [one])[0] for one in given]
    assert len(set(alone)) == len(alone)  # they differ, so that one could be taken for another
    assert found("turn", given) == alone
    assert found("threads", given) == alone
