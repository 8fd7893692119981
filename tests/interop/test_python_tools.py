"""Tools in Python run the pair as the page says, in the order that it says, and come to rest where the master does."""

import sys

import pytest

from tests.docs.pages import checked
from tests.interop import reference
from tests.interop.tools import PAGE, container, program

# Section of the page, package, module to import, the file that its script writes, the order of exchange.
TOOLS = [
    ("fmpy", "fmpy", "fmpy", "kite_fmpy.csv", "serial"),
    ("libcosimpy", "libcosimpy", "libcosimpy.CosimExecution", "kite_libcosimpy.csv", "parallel"),
    ("ecospy", "ecospy", "ecospy", "kite_ecospy.csv", "parallel"),
    ("fmucontainer", "fmu-manipulation-toolbox", "fmu_manipulation_toolbox", "kite_container.csv", "serial"),
]


@pytest.mark.parametrize(("section", "package", "module", "file", "order"), TOOLS, ids=[tool[0] for tool in TOOLS])
def test_a_tool_runs_the_pair_in_its_order_till_rest(section, package, module, file, order, shell, row):
    row.of_package(section, package, order, module)
    wrong = checked(PAGE, shell, section)
    values = reference.written(shell.folder / file)
    row.difference = reference.difference(values, order)
    assert row.difference <= reference.SAME
    assert reference.distance(values) <= reference.AT_REST
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("options", [(), ("-mt",)], ids=["one thread", "-mt"])
def test_a_container_that_steps_both_at_once_begins_well_with_the_structure_first(options, shell, row, tmp_path):
    name = " ".join(["fmucontainer", *options])
    row.of_package(f"{name}, structure first", "fmu-manipulation-toolbox", "parallel", "fmu_manipulation_toolbox")
    path, _ = container(shell.folder, f"parallel{''.join(options)}", ("structural", "aero"), *options)
    done = program([sys.executable, "kite_container.py", path, str(tmp_path / "values.csv")], shell.folder)
    assert done.returncode == 0, done.stdout + done.stderr
    values = reference.written(tmp_path / "values.csv")
    row.difference = reference.difference(values, row.order)
    assert row.difference <= reference.SAME
    assert reference.distance(values) <= reference.AT_REST


def test_a_container_that_steps_both_at_once_with_the_flow_first_begins_with_the_loads_of_an_undeformed_wing(
    request, row
):
    order = "parallel, undeformed"
    row.of_package("fmucontainer, flow first", "fmu-manipulation-toolbox", order, "fmu_manipulation_toolbox")
    *_, values = request.getfixturevalue("flow_first")
    row.difference = reference.difference(values, order)
    assert row.difference <= reference.SAME
