"""`kitecosim compare` on coupling files: the FMUs of other makers with every scheme, side by side."""

import json
import time

import pytest
from typer.testing import CliRunner

from master import compare
from master.cli import app
from master.fmu_coupling.document import Document
from master.fmu_coupling.run import opened
from tests.master.guests import coupling, guest, lin

UY = [("u", 0, "input", "Real", ""), ("y", 1, "output", "Real", "")]
FILE = """
[time]
stop = 0.5
step = 0.1
[coupling]
rtol = 1e-9
[participants.a]
fmu = "a.fmu"
[participants.b]
fmu = "lin.fmu"
[[connections]]
from = "a.y"
to = "b.u"
[[connections]]
from = "b.y"
to = "a.u"
"""


@pytest.fixture
def pair(tmp_path):
    guest(tmp_path, "a", UY, step="r[1] = 0.5 * r[0] + t + h")
    lin(tmp_path)
    file = tmp_path / "pair.toml"
    file.write_text(FILE)
    return file


def test_all_schemes_but_those_with_derivatives_are_compared_and_agree(pair):
    rows = compare(str(pair), jobs=0)
    assert [row["label"] for row in rows] == ["explicit", "relaxation", "aitken", "iqn-ils", "iqn-imvj"]
    assert {row["status"] for row in rows} == {"converged"}
    explicit, *implicit = rows
    assert (explicit["coupling_iterations"], explicit["communication_steps"]) == (5, 5)
    assert {row["equilibrium"] for row in implicit} == {1}
    assert explicit["displacement_difference"] > 1e-3  # it is a step late
    assert all(row["tolerance"] == 1e-9 for row in rows)
    assert all(sum(row["evaluations_history"]) == row["coupling_iterations"] for row in rows)


def test_parameters_orders_and_times_are_those_that_are_given(pair):
    rows = compare(str(pair), "relaxation", {"omega": [0.5, 0.8]}, orders=("serial", "parallel"), step=0.25, jobs=0)
    assert len(rows) == 4
    assert {row["communication_steps"] for row in rows} == {2}
    assert sorted({row["scheme.omega"] for row in rows}) == [0.5, 0.8]


def test_a_scheme_that_the_fmus_do_not_allow_is_unavailable_with_the_reason(pair):
    guest(pair.parent, "a", UY, attributes='canGetAndSetFMUstate="false"', step="r[1] = 0.5 * r[0]")
    rows = {row["label"]: row for row in compare(str(pair), ["explicit", "aitken"], jobs=0)}
    assert rows["explicit"]["status"] == "converged"
    assert rows["aitken"]["status"] == "unavailable"
    assert "cannot save and restore its state" in rows["aitken"]["message"]


def test_an_fmu_that_ends_its_process_ends_its_cell_only(pair):
    guest(pair.parent, "a", UY, save="abort()", step="r[1] = 0.5 * r[0]")
    rows = {row["label"]: row for row in compare(str(pair), ["explicit", "aitken"], jobs=1)}
    assert (rows["explicit"]["status"], rows["aitken"]["status"]) == ("converged", "crashed")


def test_the_command_writes_the_files_of_a_comparison_and_continues_from_its_cells(pair, tmp_path):
    out = tmp_path / "out"
    line = ["compare", str(pair), "--jobs", "0", "--out", str(out)]
    done = CliRunner().invoke(app, line)
    assert done.exit_code == 0, done.output
    assert "iqn-ils" in done.output
    assert {"compare.csv", "compare.json", "compare.md", "compare.html"} <= {path.name for path in out.iterdir()}
    assert len(json.loads((out / "compare.json").read_text())["cells"]) == 5
    assert "5 of 5 cells were there already" in CliRunner().invoke(app, line).output
    refused = CliRunner().invoke(app, [*line, "--set", "omega=1"])
    assert refused.exit_code == 2
    assert "--set and --sweep are for scenes" in refused.output


def test_a_file_that_is_not_there_or_is_wrong_is_one_sentence(tmp_path):
    with pytest.raises(ValueError, match=r"there is no file .*none\.toml"):
        compare(str(tmp_path / "none.toml"), jobs=0)


def test_loading_many_connections_takes_time_in_proportion_to_their_number(tmp_path):
    def seconds(n):
        listed = [(f"u_{k}", k, "input", "Real", "") for k in range(n)]
        listed += [(f"y_{k}", n + k, "output", "Real", "") for k in range(n)]
        guest(tmp_path, "many", listed, size=str(2 * n))
        links = [(f"a.y_{k}", f"b.u_{k}") for k in range(n)] + [(f"b.y_{k}", f"a.u_{k}") for k in range(n)]
        found = []
        for _ in range(3):
            begin = time.process_time()
            with opened(Document.of(coupling({"a": "many", "b": "many"}, links, scheme="explicit"), tmp_path)):
                found.append(time.process_time() - begin)
        return min(found)

    assert seconds(1600) < 8.0 * seconds(400)  # in proportion 4, with the square 16
