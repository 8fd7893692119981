"""FMUs of other makers that the tests of `kitecosim couple` share."""

import pytest

from tests.master.foreign import FLUID, WALL, python_fmu, wheel_fmu


@pytest.fixture(scope="session")
def foreign(tmp_path_factory):
    """The folder with wall.fmu and fluid.fmu."""
    folder = tmp_path_factory.mktemp("foreign")
    python_fmu("wall", WALL, folder, canGetAndSetFMUstate=True)
    python_fmu("fluid", FLUID, folder)
    return folder


@pytest.fixture(scope="session")
def with_wheel(foreign):
    """The same folder with wheel.fmu too."""
    wheel_fmu(foreign)
    return foreign


@pytest.fixture(scope="session")
def serialising(tmp_path_factory):
    """A folder with the same FMUs, the wall of which can write its state too."""
    folder = tmp_path_factory.mktemp("serialising")
    python_fmu("wall", WALL, folder, canGetAndSetFMUstate=True, canSerializeFMUstate=True)
    python_fmu("fluid", FLUID, folder)
    return folder
