"""FMUs that the tests of this room share."""

import pytest

import scenes
from fmus.builder import archive, build
from tests.fmus.toy_fmu import Toy, ToyFmu


@pytest.fixture(scope="session")
def toy_path(tmp_path_factory):
    """The FMU of the toy core."""
    path = tmp_path_factory.mktemp("toy") / "toy.fmu"
    path.write_bytes(archive("toy", ToyFmu(Toy(), instance_name="toy"), {}))
    return path


@pytest.fixture(scope="session")
def scene():
    """The smallest scene: a plate on springs."""
    return scenes.load("typical_section")


@pytest.fixture(scope="session")
def scene_paths(scene, tmp_path_factory):
    """The two FMUs of the scene."""
    return build(scene, tmp_path_factory.mktemp("scene"))
