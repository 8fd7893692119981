"""Models of the flow that a user might write, each one file among the methods: what they say is what acts."""

import re
import shutil
import sys

import numpy as np
import pytest

import aero.methods
import scenes
from master import IQNILS
from master.coupling import Coupling, solve
from scenes import SceneError

MODEL = '''
import numpy as np
from aero.model import AeroModel, Option, Response
from interface import Variable

OPTIONS = {"level": Option(20.0, minimum=0.0), "upward": Option(True), "law": Option("even", ("even", "odd"))}

def wing_loads(options):
    return ("shear",)

def wing_model(wing):
    return Lift(wing)

class Lift(AeroModel):
    """A traction upwards on all panels, of which a part comes a step late."""
    title = "a traction upwards"

    def __init__(self, wing):
        self.level = wing.options["level"] * (1.0 if wing.options["upward"] else -1.0)
        self.count = len(wing.mesh.panels)
        self.variables = (
            Variable("late", (), "parameter", "tunable", start=0.0),
            Variable("shear", (self.count, 3), "output", unit="Pa"),
            Variable("sent", (), "output"),
        )

    def history_dependent(self, values):
        return float(values["late"]) > 0.0

    def repeated(self, values):
        return {"sent": 0.0}

    def solve(self, flow, values, state=None):
        late = float(values["late"])
        now = self.level * (1.0 + flow.nodes[:, 2].mean())
        level = (1.0 - late) * now + late * (now if state is None else state)
        shear = np.tile([0.0, 0.0, level], (self.count, 1))
        return Response({"shear": shear, "sent": 1.0}, shear.sum(axis=0), np.zeros(3), now)

    def derivative(self, flow, values, state):
        up = np.array([0.0, 0.0, self.level])
        return lambda change: {"shear": np.tile(up * change[:, 2].mean(), (self.count, 1))}
'''


@pytest.fixture
def plate(tmp_path, monkeypatch):
    """The typical section with the method `lift` and further lines of [aero]; the method's text may be changed."""
    folder = tmp_path / "methods"
    folder.mkdir()
    monkeypatch.setattr(aero.methods, "__path__", [*aero.methods.__path__, str(folder)])

    def made(lines="", change=lambda text: text, name="lift"):
        sys.modules.pop(f"aero.methods.{name}", None)
        (folder / f"{name}.py").write_text(change(MODEL))
        shutil.copytree(scenes.load("typical_section").folder, tmp_path / "plate", dirs_exist_ok=True)
        file = tmp_path / "plate/scene.toml"
        text = re.sub(r"^(section_force|induction|method)\b.*\n", "", file.read_text(), flags=re.MULTILINE)
        file.write_text(text.replace("[aero]\n", f'[aero]\nmethod = "{name.replace("_", "-")}"\n{lines}\n'))
        return scenes.load(tmp_path / "plate")

    yield made
    sys.modules.pop("aero.methods.lift", None)


def test_a_flow_of_shear_alone_lifts_the_plate(plate):
    coupling = Coupling.in_process(plate())
    result = solve(coupling, IQNILS())
    assert result.status == "converged"
    lift = float(coupling.aero.get("shear")[0, 2])
    up = coupling.structural.get("displacement")[:, 2].mean()
    assert up == pytest.approx(lift / 2.0 * (1.0 / 1200.0 + 1.0 / 800.0) / 2.0, rel=1e-3)  # 1 m^2, half on each edge


def test_a_method_has_options_of_its_own(plate):
    for lines, lift in (("", 20.0), ("level = 5.0", 5.0), ("level = 5.0\nupward = false", -5.0)):
        core = plate(lines).cores()["aero"]
        core.look()
        assert core.get("shear")[0, 2] == pytest.approx(lift)
    for lines, sentence in (
        ("level = -1.0", "level must be a finite number, 0 or more"),
        ('law = "other"', "law must be one of: even, odd"),
        ("upward = 1", "upward must be true or false"),
        ("direction = 'bound'", "unknown key 'direction'"),  # of another method
    ):
        with pytest.raises(SceneError, match=sentence):
            plate(lines)


def test_outputs_that_are_not_given_as_declared_are_named(plate):
    core = plate(change=lambda text: text.replace('"sent": 1.0}', '"extra": 1.0}')).cores()["aero"]
    with pytest.raises(TypeError, match=r"a traction upwards .* they differ in extra, sent"):
        core.step(0.0, 1.0)


def test_a_step_in_which_nothing_changes_gives_what_the_model_says_of_it(plate):
    core = plate().cores()["aero"]
    core.step(0.0, 1.0)
    core.step(1.0, 1.0)
    assert core.get("sent") == 0.0


def test_a_model_that_remembers_has_no_derivative_of_its_step(plate):
    core = plate().cores()["aero"]
    core.step(0.0, 1.0)
    moved = np.ones(core.get("displacement").shape)
    assert core.directional_derivative({"displacement": moved})["shear"][0, 2] == pytest.approx(20.0)
    core.set("late", 0.5)
    core.step(1.0, 1.0)
    with pytest.raises(ValueError, match="depends on the step before"):
        core.directional_derivative({"displacement": moved})


def test_two_outputs_of_one_name_are_refused(plate):
    scene = plate(change=lambda text: text.replace('"sent"', '"CL"'))
    with pytest.raises(SceneError, match="two variables are named 'CL'"):
        scene.cores()


def test_helpers_among_the_methods_are_no_methods(plate):
    plate()
    with pytest.raises(SceneError, match="method must be one of: lift, panel, vortex-step"):
        plate(name="_shared")


def test_a_model_brings_what_it_is_judged_by(plate):
    limits = """        self.criteria = (Criterion("sent", "traction sent", 0.5, "who wrote it"),)
        self.level ="""

    def judged(text):
        text = text.replace("from interface import Variable", "from interface import Criterion, Variable")
        return text.replace("        self.level =", limits, 1)

    core = plate(change=judged).aero_core()
    assert [c.name for c in core.criteria] == ["reference_area_misfit", "sent"]
    core.step(0.0, 1.0)
    assert core.get("outside_validity") == 1  # it sent 1
    core.step(1.0, 1.0)  # the same again: nothing to send
    assert core.get("sent") == 0.0
    assert core.get("outside_validity") == 0
