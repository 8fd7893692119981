"""`kitecosim couple` where a save fails, where a checkpoint is of something else, where a name is taken."""

import json

import pytest
from typer.testing import CliRunner

from master import couple
from master.cli import app
from master.coupling import FmuParticipant
from master.coupling.checkpoint import Files
from master.fmu_coupling.document import Document
from tests.master.test_couple import FLUID, WALL, oscillator


def test_a_save_that_fails_ends_a_steady_run_with_its_reason(toy_fmus, monkeypatch):
    def save(self):
        raise ValueError(f"{self.name}: no memory left")

    monkeypatch.setattr(FmuParticipant, "save", save)
    content = oscillator(fluid={"memoryless": False})
    content["time"] = {"mode": "steady"}
    content["participants"] = {"one": WALL, "two": WALL}
    content["connections"] = [
        {"from": "one.position", "to": "two.load"},
        {"from": "two.position", "to": "one.load"},
    ]
    result = couple(Document.of(content, toy_fmus))
    assert result.status == "diverged"
    assert "no memory left" in result.message
    assert result.evaluations == 0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"order": "parallel"}, r"a\.ckp: the run to continue has the unknowns wall\.position, but in order parallel"),
        ({"wall": FLUID, "fluid": WALL}, r"a\.ckp is of the models .*, this file of "),
    ],
)
def test_a_checkpoint_of_another_order_or_of_other_models_is_refused_by_name(serialising, tmp_path, change, says):
    file = tmp_path / "a.ckp"
    couple(Document.of(oscillator(stop=0.2), serialising), files=Files(file))
    content = oscillator(**{k: v for k, v in change.items() if k == "order"})
    if "wall" in change:
        content["participants"] = {"fluid": WALL, "wall": FLUID}
        content["connections"] = [
            {"from": "wall.load", "to": "fluid.load"},
            {"from": "fluid.position", "to": "wall.place"},
        ]
    with pytest.raises(ValueError, match=says):
        couple(Document.of(content, serialising), files=Files(restart=file))


@pytest.mark.parametrize("name", ["total", "set_up", "master"])
def test_a_participant_cannot_have_the_name_of_a_wall_time(toy_fmus, name):
    content = oscillator()
    content["participants"][name] = content["participants"].pop("wall")
    with pytest.raises(ValueError, match=rf"^coupling: \[participants\.{name}\] has a name .*\.$"):
        Document.of(content, toy_fmus)


def test_a_checkpoint_of_the_other_backend_is_refused_with_the_remedy(tmp_path):
    file, options = tmp_path / "a b.ckp", ["--no-report", "--out", str(tmp_path / "out")]
    command = ["run", "typical_section", *options]
    runner = CliRunner()
    assert runner.invoke(app, [*command, "--backend", "in-process", "--checkpoint", str(file)]).exit_code == 0
    ended = runner.invoke(app, [*command, "--restart", str(file), "--backend", "fmu"])
    assert ended.exit_code == 2
    assert "add --backend in-process" in ended.output
    assert "a b.ckp" in ended.output
    assert runner.invoke(app, [*command, "--restart", str(file)]).exit_code == 0  # as in the checkpoint


@pytest.mark.parametrize("mode", ["explicit", "iqn-ils", "steady"])
@pytest.mark.parametrize("first", [0, 1, 3])
def test_a_recorded_variable_that_cannot_be_had_ends_with_a_status_and_what_was_reached(
    toy_fmus, monkeypatch, tmp_path, mode, first
):
    get, calls = FmuParticipant.get, []

    def failing(self, block):
        if block == "steps":
            calls.append(block)
            if len(calls) > first:
                raise RuntimeError(f"{self.name} ended with fmi2Fatal:\n no steps")
        return get(self, block)

    monkeypatch.setattr(FmuParticipant, "get", failing)
    content = oscillator(**({} if mode == "steady" else {"scheme": mode}))
    content["results"] = {"record": ["wall.position", "wall.steps"]}
    if mode == "steady":
        content["time"] = {"mode": "steady"}
    result = couple(Document.of(content, toy_fmus), tmp_path)
    assert result.status == "diverged"
    assert result.message.endswith("participant wall could not give steps: wall.fmu ended with fmi2Fatal: no steps.")
    assert set(result.values) == ({"wall.position", "wall.steps"} if first else set())
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "diverged"
    assert (tmp_path / "results.png").exists() == bool(first)
    rows = [len((tmp_path / name).read_text().splitlines()) - 1 for name in ("results.csv", "steps.csv")]
    assert rows == [first, first]  # the start, and steps but the last one; all steps but the start
    assert result.steps.statuses[-1:] == (["diverged"] if mode == "steady" and first else ["converged"] * bool(first))
