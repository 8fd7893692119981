"""A host in plain C runs an FMU of FMI 3.0, beside the same of FMI 2.0 and without Python: see host/arrays.c."""

from pathlib import Path

import fmpy
import pytest

import scenes
from fmus.builder import build
from tests.interop.c_host import SOURCES, compiled, environment, lacking
from tests.interop.tools import Row, program

CHECKS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module")
def arguments(tmp_path_factory):
    """What the host is told of a plate on springs, which takes any load, in both versions."""
    if reason := lacking():
        Row.not_run(reason)
    folder = tmp_path_factory.mktemp("both versions")  # a space in every path
    told, size = [], {}
    for fmi in (3, 2):
        path = build(scenes.load("typical_section"), folder, reference=False, fmi=fmi)[0]
        place = Path(fmpy.extract(str(path), str(folder / f"unzipped {fmi}")))
        description = fmpy.read_model_description(str(place))
        (binary,) = place.glob(f"binaries/{'x86_64-linux' if fmi == 3 else 'linux64'}/*.so")
        resources = place / "resources"
        told += [str(binary), description.guid, f"{resources}/" if fmi == 3 else resources.as_uri()]
        size |= {(fmi, v.name): v for v in description.modelVariables}
    panels = size[3, "pressure"]
    nodes = size[3, "displacement"]
    assert (panels.valueReference, size[2, "pressure[1]"].valueReference) == (0, 0)
    assert nodes.valueReference == size[2, "displacement[1,1]"].valueReference
    counts = [int(panels.dimensions[0].start), int(nodes.dimensions[0].start) * int(nodes.dimensions[1].start)]
    return [*told, str(counts[0]), str(nodes.valueReference), str(counts[1])]


@pytest.mark.parametrize("checks", [(), CHECKS], ids=["plain", "sanitizers"])
def test_a_c_host_gets_the_same_bits_of_both_versions_and_ends_by_itself(arguments, tmp_path, checks):
    library = program(["gcc", "-print-file-name=libasan.so"], tmp_path).stdout.strip()
    if checks and library == "libasan.so":
        Row.not_run("gcc has no sanitizers")
    host = compiled(tmp_path, *checks, sources=[SOURCES[0].parent / "arrays.c"])
    # Python keeps what it has allocated till the end of the process, which is no leak of the host.
    place = environment("host-env") | {"ASAN_OPTIONS": "detect_leaks=0"}
    done = program([str(host), *arguments], tmp_path, place)
    assert (done.stdout, done.stderr, done.returncode) == ("done\n", "", 0)
