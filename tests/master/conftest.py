"""FMUs of other makers that the tests of `kitecosim couple` share."""

import pytest

from tests.master.toy_fmus import FLUID, WALL, python_fmu, wheel_fmu


@pytest.fixture(scope="session")
def toy_fmus(tmp_path_factory):
    """The folder with wall.fmu and fluid.fmu."""
    folder = tmp_path_factory.mktemp("toy_fmus")
    python_fmu("wall", WALL, folder, canGetAndSetFMUstate=True)
    python_fmu("fluid", FLUID, folder)
    return folder


@pytest.fixture(scope="session")
def with_wheel(toy_fmus):
    """The same folder with wheel.fmu too."""
    wheel_fmu(toy_fmus)
    return toy_fmus


@pytest.fixture(scope="session")
def serialising(tmp_path_factory):
    """A folder with the same FMUs, the wall of which can write its state too."""
    folder = tmp_path_factory.mktemp("serialising")
    python_fmu("wall", WALL, folder, canGetAndSetFMUstate=True, canSerializeFMUstate=True)
    python_fmu("fluid", FLUID, folder)
    return folder
