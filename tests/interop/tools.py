"""How tests run tools: programs, the commands of the page, containers; and what a test tells the table."""

import os
import subprocess
import sys
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, Session

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


def container(folder, name, sides, *options, rows=()):
    """Path of a container that exchanges every second, its FMUs in the order of `sides`, and what the build printed."""
    table = ["rule;from_fmu;from_port;to_fmu;to_port", *(f"FMU;v3_kite_{side}.fmu;;;" for side in sides), *rows]
    (folder / "my_fmus" / f"{name}.csv").write_text("\n".join(table) + "\n")
    build = "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer; fmucontainer()"
    arguments = ["-fmu-directory", "my_fmus", "-container", f"{name}.csv:1", *options]
    done = program([sys.executable, "-c", build, *arguments], folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return f"my_fmus/{name}.fmu", done.stdout
