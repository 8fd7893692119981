"""The example of a pipeline, copied out of the repository: it needs the package as pip installs it, and no more."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("interface", "structural", "aero", "scenes", "fmus", "master", "pyproject.toml", "README.md", "LICENSE")


def finished(*command, **options):
    """A command that has to succeed."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=300, check=False, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the package as a wheel installs it, compiled binary included."""
    source, site = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("site")
    ignored = shutil.ignore_patterns("__pycache__", "*.so")
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, source / name, ignore=ignored)
        else:
            shutil.copy(ROOT / name, source / name)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    finished(*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", source, source)
    finished(*pip, "install", "--no-deps", "--target", site, next(source.glob("*.whl")))
    return site


def test_it_passes_with_only_the_installed_package(installed, tmp_path):
    project = tmp_path / "somebody's project"
    shutil.copytree(ROOT / "examples" / "pipeline", project, ignore=shutil.ignore_patterns("__pycache__", ".*"))
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST")}
    options = {"cwd": project, "env": environment | {"PYTHONPATH": str(installed)}}
    found = finished(sys.executable, "-c", "import fmus, master, scenes; print(fmus.__file__)", **options)
    assert found.startswith(str(installed))
    assert " passed" in finished(sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", **options)


def test_a_wheel_carries_binary_and_kernels_where_there_is_a_compiler(installed):
    if not shutil.which((sysconfig.get_config_var("CC") or "cc").split()[0]):
        pytest.skip("not run: there is no C compiler")
    assert list((installed / "fmus").glob("_binary*.so"))
    assert list((installed / "aero/panel").glob("_kernels*.so"))
