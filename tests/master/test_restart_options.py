"""Options that are not given to a restart are as in its checkpoint, inputs over time among them."""

import json

import pytest
from typer.testing import CliRunner

from master.cli import app

SECTION = ["typical_section", "--backend", "in-process", "--no-report"]
TETHER = ["tether_in_wind", "--backend", "in-process", "--no-report"]


def cli(*words):
    return CliRunner().invoke(app, ["run", *map(str, words)])


def summary(folder):
    return json.loads((folder / "summary.json").read_text())


@pytest.fixture
def reeled(tmp_path):
    """A table of inputs, and the checkpoint at 0.4 s of a run of 0.8 s with it and other options."""
    table, kept = tmp_path / "reel.csv", tmp_path / "a.ckp"
    table.write_text("time,tether_length_rate,wind_speed\n0,0,6\n0.33,-1,8\n0.7,1,5\n")
    options = ["--inputs", table, "--scheme", "aitken", "--relaxation", 0.9, "--tolerance", 1e-8, "--step", 0.05]
    assert cli(*TETHER, *options, "--stop-time", 0.8, "--out", tmp_path / "whole").exit_code == 0
    half = cli(*TETHER, *options, "--stop-time", 0.4, "--checkpoint", kept, "--out", tmp_path / "half")
    assert half.exit_code == 0, half.output
    return table, kept


def test_a_restart_without_options_goes_on_bitwise(reeled, tmp_path):
    rest = cli("tether_in_wind", "--restart", reeled[1], "--stop-time", 0.8, "--out", tmp_path / "rest")
    assert rest.exit_code == 0, rest.output
    was, now = summary(tmp_path / "whole"), summary(tmp_path / "rest")
    for settings in (was["settings"], now["settings"]):
        settings.pop("inputs")
    assert now["settings"] == was["settings"]
    assert summary(tmp_path / "rest")["settings"]["inputs"].endswith("reel.csv")
    (remark, kept) = now["remarks"]
    assert remark == "restarted from a.ckp at 0.4 s"
    assert kept.startswith("as in the checkpoint: ")
    for said in (
        "backend = in-process",
        "scheme = aitken",
        "relaxation = 0.9",
        "tolerance = 1e-08",
        "step = 0.05",
        "reel.csv",
    ):
        assert said in kept
    rows, all_ = ((tmp_path / name / "history.csv").read_text().splitlines() for name in ("rest", "whole"))
    assert rows[2:] == all_[10:]
    assert (tmp_path / "rest" / "nodes.csv").read_bytes() == (tmp_path / "whole" / "nodes.csv").read_bytes()


def test_the_stop_time_is_as_in_the_checkpoint_too(reeled, tmp_path):
    rest = cli("tether_in_wind", "--restart", reeled[1], "--out", tmp_path / "rest")
    assert rest.exit_code == 0, rest.output
    assert summary(tmp_path / "rest")["time"] == pytest.approx(0.4, abs=1e-12)


@pytest.mark.parametrize("what", ["gone", "changed"])
def test_inputs_that_are_gone_or_changed_are_refused_by_name_unless_others_are_given(reeled, what, tmp_path):
    table, kept = reeled
    other = tmp_path / "other.csv"
    other.write_text("time,tether_length_rate,wind_speed\n0,0,6\n")
    before = {p: p.read_bytes() for p in (tmp_path / "whole").iterdir()}
    if what == "gone":
        table.unlink()
    else:
        table.write_text(table.read_text().replace("-1,8", "-1,9"))
    refused = cli("tether_in_wind", "--restart", kept, "--stop-time", 0.8, "--out", tmp_path / "whole")
    assert refused.exit_code == 2
    said = {"gone": "cannot be read (no such file or directory)", "changed": "has changed since"}[what]
    assert f"a.ckp was written with --inputs {table.resolve()}, which {said}; name" in refused.output
    assert before == {p: p.read_bytes() for p in (tmp_path / "whole").iterdir()}
    words = ["--restart", kept, "--stop-time", 0.8, "--inputs", other, "--out", tmp_path / "rest"]
    given = cli("tether_in_wind", *words)
    assert given.exit_code == 0, given.output
    (remark, *_) = summary(tmp_path / "rest")["remarks"]
    assert remark == f"restarted from a.ckp at 0.4 s, inputs {table.resolve()} -> {other.resolve()}"


def test_a_quasi_static_restart_has_scheme_tolerances_and_backend_of_its_checkpoint(tmp_path):
    kept, options = tmp_path / "a.ckp", ["--scheme", "aitken", "--relaxation", 0.4, "--tolerance", 1e-9]
    whole = cli(*SECTION, *options, "--out", tmp_path / "whole")
    few = cli(*SECTION, *options, "--max-iterations", 3, "--checkpoint", kept, "--out", tmp_path / "few")
    assert (whole.exit_code, few.exit_code) == (0, 1)
    rest = cli("typical_section", "--restart", kept, "--max-iterations", 200, "--out", tmp_path / "rest")
    assert rest.exit_code == 0, rest.output
    was, now = summary(tmp_path / "whole"), summary(tmp_path / "rest")
    for key in ("scheme", "backend", "tolerance", "relaxation", "report"):
        assert now["settings"][key] == was["settings"][key]
    assert now["coupling_iterations"] == was["coupling_iterations"]
    assert now["outputs"] == was["outputs"]  # to the last bit: nothing has changed
    assert "coupling iterations are counted from 1 again" not in rest.output


def test_a_factor_of_another_scheme_does_not_come_along(tmp_path):
    kept = tmp_path / "a.ckp"
    first = ["--scheme", "relaxation", "--relaxation", 0.3, "--checkpoint", kept, "--out", tmp_path / "a"]
    assert cli(*SECTION, *first).exit_code == 0
    assert cli("typical_section", "--restart", kept, "--scheme", "iqn-ils", "--out", tmp_path / "b").exit_code == 0
    assert summary(tmp_path / "b")["settings"]["relaxation"] is None


@pytest.mark.parametrize("scheme", ["explicit", "aitken"])
def test_steep_inputs_reach_a_restart_to_the_last_bit_wherever_it_begins(scheme, tmp_path):
    table, words = tmp_path / "reel.csv", [*TETHER, "--scheme", scheme, "--inputs", tmp_path / "reel.csv"]
    table.write_text("time,tether_length,wind_speed\n0,300,1\n0.7,301.3,17.7\n")
    assert cli(*words, "--stop-time", 0.7, "--out", tmp_path / "whole").exit_code == 0
    whole = (tmp_path / "whole" / "history.csv").read_text().splitlines()
    for k in range(1, 7):  # 6 x 0.1 is not 0.5 + 0.1
        kept, out = tmp_path / "a.ckp", tmp_path / f"rest{k}"
        first = cli(*words, "--stop-time", f"{k / 10}", "--checkpoint", kept, "--out", tmp_path / "half")
        assert first.exit_code == 0, first.output
        assert cli("tether_in_wind", "--restart", kept, "--stop-time", 0.7, "--out", out).exit_code == 0
        assert (out / "history.csv").read_text().splitlines()[2:] == whole[2 + k :]
