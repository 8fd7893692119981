"""FMUs that the tests of this room share."""

import pytest

import scenes
from fmus.builder import archive, build, own_binary
from tests.fmus.cases import ALL, label, start
from tests.fmus.importer import Importer
from tests.fmus.toy_fmu import Toy, ToyFmu


@pytest.fixture(scope="session")
def toy_path(tmp_path_factory):
    """The FMU of the toy core."""
    path = tmp_path_factory.mktemp("toy") / "toy.fmu"
    path.write_bytes(archive("toy", ToyFmu(Toy(), instance_name="toy"), {}))
    return path


@pytest.fixture
def own_toy(toy_path):
    """An instance of the toy whose FMU has the binary of this project."""
    if own_binary() is None:
        pytest.skip("not run: no C compiler was there when the project was installed")
    with Importer(toy_path) as importer:
        yield importer


@pytest.fixture(scope="session")
def scene():
    """The smallest scene: a plate on springs."""
    return scenes.load("typical_section")


@pytest.fixture(scope="session")
def scene_paths(scene, tmp_path_factory):
    """The two FMUs of the scene."""
    return build(scene, tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="session", params=ALL, ids=label)
def case(request, tmp_path_factory):
    """A scene with settings, and the paths of its FMUs, one without a flow or a structure: every scene, every setting
    changed once.
    """
    scene = scenes.load(*request.param)
    return scene, build(scene, tmp_path_factory.mktemp("case"), start(scene))


@pytest.fixture(scope="session")
def kite_aero(tmp_path_factory):
    """The aerodynamic FMU of a scene that is free to pitch."""
    return build(scenes.load("v3_kite"), tmp_path_factory.mktemp("kite"))[1]
