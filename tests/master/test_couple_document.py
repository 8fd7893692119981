"""The file of `kitecosim couple`: what is wrong in it is answered, before anything is run, by one sentence each."""

import copy
import re
import zipfile

import numpy as np
import pytest
from fmpy import platform

from master.fmu_coupling.document import Document
from master.fmu_coupling.mapping import Described, MappedParticipant, Naming
from tests.master.test_couple import oscillator
from tests.master.toy_fmus import DESCRIPTION

REMOVED = type("Absent", (), {"__repr__": lambda self: "absent"})()


def changed(content, changes):
    """A copy of a content with the value at each path of keys ("a/b/0/c") replaced or removed."""
    content = copy.deepcopy(content)
    for path, value in changes.items():
        *way, last = (int(key) if key.isdigit() else key for key in path.split("/"))
        place = content
        for key in way:
            place = place.setdefault(key, {}) if isinstance(place, dict) else place[key]
        if value is REMOVED:
            del place[last]
        else:
            place[last] = value
    return content


WALL, FLUID = "participants/wall", "participants/fluid"
STEADY = {"time/mode": "steady", "time/stop": REMOVED}

# What is changed in a document that is right, and the sentence that answers it.
MISTAKES = [
    ({"times": {}}, "coupling: knows no key 'times'; did you mean time?"),
    ({"time": 3}, "coupling: [time] must be a table, not 3."),
    ({"time/steps": 3}, "coupling: [time] knows no key 'steps'; did you mean step or stop?"),
    ({"time/step": REMOVED}, "coupling: [time] lacks step; give it."),
    ({"time/stop": REMOVED}, "coupling: [time] lacks stop; give it."),
    ({"time/step": 0.0}, "coupling: [time] step must be above zero, not 0.0."),
    ({"time/step": "0.1"}, "coupling: [time] step must be a number, not '0.1'."),
    ({"time/step": True}, "coupling: [time] step must be a number, not True."),
    ({"time/stop": float("nan")}, "coupling: [time] stop must be a number, not nan."),
    ({"time/step": 0.3}, "[time] from start = 0 to stop = 1 is no whole number of steps of 0.3; change one."),
    ({"time/start": 2.0}, "[time] from start = 2 to stop = 1 is no whole number of steps"),
    ({"time/mode": "static"}, "[time] mode is 'static', which there is not; choose one of: transient, steady."),
    (
        {"time/mode": "steady"},
        '[time] stop does not go with mode = "steady", which does not advance in time; leave it out.',
    ),
    (STEADY | {"coupling/predictor": "linear"}, '[coupling] predictor does not go with mode = "steady"'),
    ({"coupling/scheme": "iqn"}, "[coupling] scheme is 'iqn', which there is not; choose one of: explicit, relaxation"),
    ({"coupling/parameters": {"omega": 1.0}}, "[coupling.parameters] does not suit: scheme iqn-ils has no parameter"),
    (
        {"coupling/parameters": {"omega0": 0.0}},
        "[coupling.parameters] does not suit: omega0 must be finite and not zero",
    ),
    ({"coupling/parameters": {"reuse": "all"}}, "[coupling.parameters] does not suit: reuse"),
    ({"coupling/scheme": "newton-krylov"}, "[coupling] scheme takes directional derivatives"),
    ({"coupling/order": "both"}, "[coupling] order is 'both', which there is not; choose one of: serial, parallel."),
    ({"coupling/predictor": "cubic"}, "choose one of: constant, linear, quadratic."),
    ({"coupling/interpolation": "cubic"}, "choose one of: linear, constant."),
    ({"coupling/strict": "yes"}, "[coupling] strict must be true or false, not 'yes'."),
    ({"coupling/max_iterations": 0}, "[coupling] max_iterations must be a whole number of at least 1, not 0."),
    ({"coupling/rtol": -1.0}, "coupling: rtol must be finite and not negative."),
    ({"coupling/rtol": 0.0}, "coupling: All tolerances of field 'wall.position' are zero"),
    ({"coupling/atol": {"wall.positions": 1e-3}}, "coupling: atol must name every field once: wall.position."),
    ({WALL: REMOVED}, "[participants] holds 1 participants; give at least two."),
    ({WALL + "/fmu": REMOVED}, "[participants.wall] lacks fmu; give it."),
    ({WALL + "/fmu": "well.fmu"}, "well.fmu, which is no file; paths are relative to the folder of this file."),
    ({WALL + "/fmu": "wall_slave.py"}, "wall_slave.py is not a readable FMU"),
    ({WALL + "/sub_steps": 2}, "[participants.wall] knows no key 'sub_steps'; did you mean substeps?"),
    ({WALL + "/substeps": 0.5}, "[participants.wall] substeps must be a whole number of at least 1, not 0.5."),
    ({WALL + "/start/stifness": 1.0}, "[participants.wall.start] stifness does not suit: wall.fmu has no variable or "
                                      "block 'stifness'; did you mean stiffness"),
    ({WALL + "/start/load": 1.0}, "[participants.wall.start] load does not suit: wall.fmu: block 'load' has shape"),
    ({WALL + "/start/load": ["a", "b"]}, "block 'load' takes numbers of shape (2,)."),
    ({WALL + "/start/position": [1.0, 1.0]}, "block 'position' cannot be set, its causality is output."),
    ({FLUID + "/start/wallPos": {"x": 1.0}}, "[participants.fluid.start] wallPos is a table; write names that contain "
                                             "a dot in quotes."),
    ({FLUID + "/start/table": 1.0}, "fluid.fmu has 'table' as a text, and only numbers can be exchanged"),
    ({FLUID + "/start/stiffness": "soft"}, "fluid.fmu: 'stiffness' takes numbers; texts go to: table."),
    ({FLUID + "/start/tabel": "t.csv"}, "fluid.fmu: 'tabel' is not there; texts go to: table."),
    ({"connections/0/from": "fluid.table"}, "fluid.fmu has 'table' as a text, and only numbers can be exchanged"),
    ({FLUID + "/start/fail_at": 0.5}, "block 'fail_at' takes whole numbers, not 0.5."),
    ({WALL + "/blocks/position": "p_#"}, "block 'position': no variable of wall.fmu matches 'p_#'; did you mean "),
    ({WALL + "/blocks/position": "Q_1"}, "wall.fmu has no variable or block 'Q_1'; did you mean q_1"),
    ({WALL + "/blocks/position": ["q_1", "v_1"]}, "block 'position' mixes variables of different causality: q_1 is "
                                                  "output, v_1 is local; make two blocks of them."),
    ({WALL + "/blocks/position": ["q_1", "q_1"]}, "block 'position' lists the variable 'q_1' twice; list it once."),
    ({WALL + "/blocks/position": []}, "[participants.wall.blocks] position is empty; list at least one variable."),
    ({WALL + "/blocks/position": 3}, "position must be a variable, a pattern with #, a list or a table, not 3."),
    ({WALL + "/blocks/stiffness": "mass"}, "block 'stiffness' has the name of another variable of wall.fmu"),
    ({WALL + "/blocks/n": {"variables": "steps", "factor": 2.0}}, "block 'n' has a factor, but 'steps' is no Real"),
    ({FLUID + "/blocks/load/factor": 0.0}, "[participants.fluid.blocks.load] factor must not be zero"),
    ({FLUID + "/blocks/load/facto": 1.0}, "[participants.fluid.blocks.load] knows no key 'facto'; did you mean f"),
    ({FLUID + "/blocks/load/shape": [3]}, "block 'load' has 2 variables, which do not fill the shape [3]."),
    ({FLUID + "/blocks/load/shape": [1, 2]}, "[[connections]] 1: fluid.load has shape [1, 2], but wall.load [2]; make "
                                             "blocks of one shape"),
    ({"connections": []}, "there are no connections; add [[connections]] with from and to."),
    ({"connections": {}}, "connections must be tables, each headed [[connections]]."),
    ({"connections/0/factor": 0}, "[[connections]] 1: factor must not be zero, as nothing would arrive"),
    ({"connections/0/offset": "1"}, "[[connections]] 1: offset must be a number, not '1'."),
    ({"connections/0/from": "load"}, "[[connections]] 1: from is 'load'; write participant.block."),
    ({"connections/0/form": "x"}, "[[connections]] 1: knows no key 'form'; did you mean from"),
    ({"connections/0/from": "fluit.load"}, "from names no participant 'fluit'; did you mean fluid?"),
    ({"connections/0/from": "fluid.loads"}, "from is 'fluid.loads', but fluid.fmu has no variable or block 'loads'; "
                                            "did you mean load"),
    ({"connections/0/from": "fluid.place"}, "from is 'fluid.place', whose causality is input; it takes an output: "),
    ({"connections/0/to": "wall.position"}, "to is 'wall.position', whose causality is output; it takes an input: "),
    ({"connections/0/to": "wall.stiffness"}, "whose causality is parameter; it takes an input"),
    ({"connections/0/to": "wall.F_1"}, "fluid.load has shape [2], but wall.F_1 []"),
    ({"results/record": ["wall.speed"]}, "[results] record is 'wall.speed', but wall.fmu has no variable or block"),
    ({"results/record": "wall.position"}, "[results] record must be a list of names in quotes"),
    ({"results/file": "x.csv"}, "[results] knows no key 'file'; it has: record."),
]  # fmt: skip


def test_the_document_that_the_mistakes_are_made_in_is_right(toy_fmus):
    document = Document.of(oscillator(), toy_fmus)
    assert document.record == (("fluid", "load"), ("wall", "position"))
    assert document.settings.count == 10
    steady = changed(oscillator(), STEADY)
    assert Document.of(steady, toy_fmus).settings.mode == "steady"


@pytest.mark.parametrize(("changes", "sentence"), MISTAKES, ids=lambda value: str(value)[:60])
def test_a_mistake_is_answered_by_one_sentence(toy_fmus, changes, sentence):
    with pytest.raises(ValueError, match=re.escape(sentence)) as error:
        Document.of(changed(oscillator(), changes), toy_fmus)
    text = str(error.value)
    assert text.startswith("coupling: ")
    assert "\n" not in text
    assert text[-1] in ".?"


def test_an_input_has_one_source_also_where_blocks_share_a_variable(toy_fmus):
    content = oscillator()
    content["connections"].append({"from": "fluid.loadX", "to": "wall.F_1"})
    with pytest.raises(
        ValueError, match=r"\[\[connections\]\] 3: to: F_1 of wall has a source already, fluid.load -> "
    ):
        Document.of(content, toy_fmus)


def test_a_participant_without_a_connection_is_refused(toy_fmus):
    content = oscillator()
    content["participants"]["spare"] = {"fmu": "fluid.fmu"}
    with pytest.raises(ValueError, match=r"\[participants.spare\] is in no connection; connect it, or leave it out\."):
        Document.of(content, toy_fmus)


def test_a_steady_run_needs_a_loop(toy_fmus):
    content = changed(oscillator(), STEADY)
    del content["connections"][1]
    with pytest.raises(ValueError, match="nothing is sent back to an earlier participant"):
        Document.of(content, toy_fmus)


def test_a_file_that_is_no_toml_is_told_by_its_line(tmp_path):
    file = tmp_path / "ring.toml"
    file.write_text("[time]\nstop = 1.0\nstep = \n")
    with pytest.raises(ValueError, match=r"ring.toml: this is not TOML: .*line 3"):
        Document.read(file)
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match="is not text in UTF-8"):
        Document.read(file)
    with pytest.raises(ValueError, match=r"there is no file .*none\.toml; name a TOML file"):
        Document.read(tmp_path / "none.toml")
    with pytest.raises(ValueError, match="is a folder; name a TOML file"):
        Document.read(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ('fmiVersion="2.0"', 'fmiVersion="1.0"', "of FMI 1.0"),
        ('fmiVersion="2.0"', 'fmiVersion="4.0"', "of FMI 4.0"),
        ("<CoSimulation", "<ModelExchange", "not for co-simulation"),
    ],
)
def test_an_fmu_of_another_kind_is_refused(tmp_path, old, new, what):
    path = tmp_path / "other.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.replace(old, new))
    with pytest.raises(ValueError, match=f"is {what}; export it as a co-simulation FMU of FMI 2.0 or 3.0"):
        Described(path)


def test_an_fmu_for_another_platform_is_refused(tmp_path):
    path = tmp_path / "other.fmu"
    for binaries, what in ((["binaries/vax/wheel.so", "binaries/pdp/wheel.so"], "pdp, vax"), ([], "no platform")):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", DESCRIPTION)
            for name in binaries:
                archive.writestr(name, "")
        with pytest.raises(ValueError, match=f"is built for {what}, not for .*; export it for this platform"):
            Described(path)


def test_an_fmu_that_allows_one_instance_is_not_used_twice(tmp_path):
    once = 'modelIdentifier="wheel" canBeInstantiatedOnlyOncePerProcess="true"'
    with zipfile.ZipFile(tmp_path / "wheel.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.replace('modelIdentifier="wheel"', once))
        archive.writestr(f"binaries/{platform}/wheel.so", "")
    content = oscillator()
    content["participants"] = {"front": {"fmu": "wheel.fmu"}, "rear": {"fmu": "./wheel.fmu"}}
    with pytest.raises(ValueError, match=r"\[participants.rear\] fmu is that of front too, but its canBeInstantiated"):
        Document.of(content, tmp_path)


def test_blocks_of_our_own_reach_the_variables_they_name_in_their_order(toy_fmus):
    names = {
        "q": Naming("q_#", 2.0),
        "turned": Naming(("q_2", "q_1")),
        "place": Naming(("q0_1", "q0_2"), 100.0, (2, 1)),  # cm
        "all": Naming(("F_1", "F_2"), -1.0),
    }
    start = {"place": [[100.0], [50.0]], "all": [3.0, 1.5]}
    with MappedParticipant(toy_fmus / "wall.fmu", names, start) as wall:
        assert wall.get("q_1") == 1.0
        assert wall.get("q").tolist() == [2.0, 1.0]
        assert wall.get("turned").tolist() == [0.5, 1.0]
        assert wall.get("place").tolist() == [[100.0], [50.0]]
        assert wall.get("F_1") == -3.0
        wall.set("all", [4.0, 5.0])
        assert (wall.get("F_1"), wall.get("F_2")) == (-4.0, -5.0)
        wall.set("F_2", 6.0)  # the variables stay usable
        assert wall.get("all").tolist() == [4.0, -6.0]
        with pytest.raises(ValueError, match=r"block 'all' has shape \(2,\), not \(3,\)"):
            wall.set("all", np.zeros(3))


def test_a_pattern_sorts_by_number_and_spans_a_grid(toy_fmus, tmp_path, monkeypatch):
    listed = [f"u_{i}_{j}" for j in (9, 10) for i in (1, 2, 3)]
    mapped = Described(toy_fmus / "wall.fmu")
    variables = dict.fromkeys(listed, mapped._variables["q_1"])
    monkeypatch.setattr(mapped, "_variables", variables)
    grid = mapped._found("u", Naming("u_#_#"))
    assert (grid.shape, grid.variables[:3]) == ((3, 2), ("u_1_9", "u_1_10", "u_2_9"))
    row = mapped._found("u", Naming("u_1_#"))
    assert row.variables == ("u_1_9", "u_1_10")
    del variables["u_2_9"]
    with pytest.raises(ValueError, match="leave gaps; list the variables"):
        mapped._found("u", Naming("u_#_#"))
    variables["u_1_09"] = variables["u_1_9"]
    with pytest.raises(ValueError, match="both match 'u_1_#'; list the variables"):
        mapped._found("u", Naming("u_1_#"))
