"""The pair of FMUs and the scripts that every tool runs, and the table of tools at the end."""

import os
import subprocess
import sys
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, Session, checked, give_files

ROOT = DOCS.parent
PAGE = DOCS / "use-in-other-tools.md"
REQUIRE = "KITECOSIM_REQUIRE_INTEROP"  # set to 1, a tool that cannot be run is a failure
LIMIT = 120  # s a program may take; each takes two


@dataclass
class Row:
    """A row of the table: how a tool did."""

    tool: str = ""
    version: str = ""
    order: str = ""
    difference: float | None = None

    def of_package(self, tool, package, order, module=None):
        """A tool that is a Python package; where it cannot be imported, it is not run."""
        self.tool, self.order = tool, order
        try:
            self.version = metadata.version(package)
        except metadata.PackageNotFoundError:
            self.not_run(f"{package} is not installed")
        done = program([sys.executable, "-c", f"import {module or package}"], ROOT)
        if done.returncode != 0:
            self.not_run(done.stderr.strip().splitlines()[-1])

    @staticmethod
    def not_run(reason):
        """End the test: neither passed nor, unless it is required, failed."""
        if os.environ.get(REQUIRE) == "1":
            pytest.fail(f"not run: {reason}")
        pytest.skip(reason)


class Shell(Session):
    """Runs the `sh` blocks of the page, with the Python of the tests as that of the project."""

    folder: Path

    def output(self, block):
        """What a block of commands prints; the first that fails ends it."""
        commands = block.text.replace(".venv/bin/", f"{Path(sys.executable).parent}/")
        done = program(["sh", "-ec", commands], self.folder)
        assert done.returncode == 0, f"{block.text}\n{done.stdout}{done.stderr}"
        return done.stdout


def program(command, folder, environment=None):
    """A finished program, its output as text. It finds the packages of this checkout, whatever is installed."""
    if environment is None:
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=LIMIT, check=False
    )


@pytest.fixture(scope="session")
def shell(tmp_path_factory):
    """A session on the page in a folder with its files, and with the pair of FMUs built as the page says."""
    session = Shell(PAGE)
    session.folder = tmp_path_factory.mktemp("tools")
    give_files(PAGE, session.folder)
    assert not checked(PAGE, session, "The pair")
    return session


@pytest.fixture
def row(record_property):
    """The row of a test in the table."""
    row = Row()
    record_property("tool", row)
    return row


def pytest_terminal_summary(terminalreporter):
    rows = [("tool", "version", "order", "largest difference", "verdict")]
    for outcome in ("passed", "skipped", "failed", "error"):
        for report in terminalreporter.stats.get(outcome, ()):
            for row in (value for _, value in getattr(report, "user_properties", ()) if isinstance(value, Row)):
                size = "" if row.difference is None else f"{row.difference:.1e}" if row.difference else "0"
                verdict = f"not run: {report.longrepr[2]}" if outcome == "skipped" else outcome
                rows.append((row.tool, row.version, row.order, size, verdict.replace("Skipped: ", "")))
    if len(rows) == 1:
        return
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    terminalreporter.section("FMUs in other tools")
    for cells in rows:
        terminalreporter.line(" | ".join(f"{cell:{width}}" for cell, width in zip(cells, widths, strict=True)).rstrip())
