"""The pair of FMUs and the programs that every tool runs; tests/conftest.py prints the table of tools."""

import sys

import pytest

import fmus.builder
from tests.docs.pages import checked, give_files
from tests.interop import reference
from tests.interop.c_host import compiled, lacking, wiring
from tests.interop.tools import PAGE, Row, Shell, container, program


@pytest.fixture(scope="session")
def shell(tmp_path_factory):
    """A session on the page in a folder with its files, and with the pair of FMUs built as the page says."""
    session = Shell(PAGE)
    session.folder = tmp_path_factory.mktemp("tools")
    give_files(PAGE, session.folder)
    assert not checked(PAGE, session, "The pair")
    return session


@pytest.fixture(scope="session")
def host(tmp_path_factory):
    """The compiled host; without a compiler, a test of it is not run."""
    if reason := lacking("PythonFMU"):
        Row.not_run(reason)
    return compiled(tmp_path_factory.mktemp("host"))


@pytest.fixture(scope="session")
def wired(shell, tmp_path_factory):
    """The wiring of the pair, and of the same pair with PythonFMU's binary, by name."""
    folder = tmp_path_factory.mktemp("python fmu")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fmus.builder, "own_binary", lambda: None)
        built = fmus.builder.build(reference.scene(), folder, {"wind_speed": reference.WIND})
    plain = dict(zip(("structural", "aero"), built, strict=True))
    own = {side: shell.folder / f"my_fmus/v3_kite_{side}.fmu" for side in plain}
    return {"own": wiring(tmp_path_factory.mktemp("own"), own), "PythonFMU": wiring(folder, plain)}


@pytest.fixture(scope="session")
def flow_first(shell):
    """A container that steps both at once and lists the flow first: what its build and its run have printed, and the
    values."""
    path, built = container(shell.folder, "flow_first", ("aero", "structural"))
    done = program([sys.executable, "kite_container.py", path, "flow_first.csv"], shell.folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return built, done.stdout, reference.written(shell.folder / "flow_first.csv")


@pytest.fixture
def row(record_property):
    """The row of a test in the table."""
    row = Row()
    record_property("tool", vars(row))  # filled in later; of plain values, as reports of worker processes are sent on
    return row
