"""A tool that is missing is told as not run: it has not passed, and it fails where it is required."""

import os
import sys

import pytest

from tests.interop.tools import REQUIRE, ROOT, Row, program


def test_a_tool_that_is_not_installed_is_not_run(monkeypatch):
    monkeypatch.delenv(REQUIRE, raising=False)
    with pytest.raises(pytest.skip.Exception, match="no-such-tool is not installed"):
        Row().of_package("tool", "no-such-tool", "serial")


def test_a_tool_that_is_required_and_not_installed_is_a_failure(monkeypatch):
    monkeypatch.setenv(REQUIRE, "1")
    with pytest.raises(pytest.fail.Exception, match="not run: no-such-tool is not installed"):
        Row().of_package("tool", "no-such-tool", "serial")


def test_the_table_says_why_a_tool_was_not_run(tmp_path):
    """The library that Ecos needs is there, and empty."""
    Row().of_package("ecospy", "ecospy", "")
    (tmp_path / "libtbb.so.12").touch()
    place = {**os.environ, "LD_LIBRARY_PATH": str(tmp_path)}
    place.pop(REQUIRE, None)
    case = "tests/interop/test_python_tools.py::test_a_tool_runs_the_pair_in_its_order_till_rest[ecospy]"
    done = program([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", case], ROOT, place)
    assert done.returncode == 0, done.stdout
    assert "1 skipped" in done.stdout
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("ecospy "))
    assert "| not run: OSError: " in line
    assert "libtbb.so.12: file too short" in line
    assert "passed" not in done.stdout
