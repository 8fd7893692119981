"""The page that comes with an FMU: somebody with another solver finds there what every index counts."""

import html.parser
import itertools
import shutil
import zipfile

import numpy as np
import pytest

import scenes
from fmus.builder import build
from fmus.documentation import page
from interface import Variable
from tests.fmus.toy_fmu import Toy, ToyFmu


class Page(html.parser.HTMLParser):
    """Tables by the first words of their titles, as lists of rows of texts; checks that elements close in order."""

    def __init__(self, text):
        super().__init__()
        self.text, self.open, self.tables, self.title = "", [], {}, ""
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "br"):
            self.open.append(tag)
        if tag == "summary":
            self.title = ""
        elif tag == "tr":
            self.tables.setdefault(self.title.partition(":")[0], []).append([])
        elif tag in ("td", "th"):
            self.tables[self.title.partition(":")[0]][-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data
        if "summary" in self.open:
            self.title += data
        elif "td" in self.open:
            self.tables[self.title.partition(":")[0]][-1][-1] += data


def read(path):
    """The page of an FMU."""
    with zipfile.ZipFile(path) as whole:
        return Page(whole.read("documentation/index.html").decode())


def numbers(page, title, columns):
    """Columns of a table as floats, below its header; its rows count from 1."""
    rows = page.tables[title][1:]
    assert [row[0] for row in rows] == [str(i) for i in range(1, len(rows) + 1)]
    return np.array([[float(row[c]) for c in columns] for row in rows])


def test_interface_can_be_rebuilt_from_the_page(case):
    scene, paths = case
    mesh = scene.interface
    for found in map(read, paths):
        # nine digits of coordinates of up to 100 m
        np.testing.assert_allclose(numbers(found, "Interface nodes", (1, 2, 3)), mesh.nodes, rtol=1e-8, atol=1e-11)
        assert ("Panels" in found.tables) is bool(len(mesh.panels))
        if len(mesh.panels):
            np.testing.assert_array_equal(numbers(found, "Panels", (1, 2, 3, 4)), mesh.panels + 1)
        assert ("Exposed lines" in found.tables) is bool(len(mesh.lines))
        if len(mesh.lines):
            np.testing.assert_array_equal(numbers(found, "Exposed lines", (1, 2)), mesh.lines + 1)
            np.testing.assert_allclose(numbers(found, "Exposed lines", (3,))[:, 0], mesh.diameter, rtol=1e-8)
            names = [row[4] for row in found.tables["Exposed lines"][1:]]
            assert names == list(scene.members.leg_names)


def test_structural_page_names_what_tensions_and_positions_belong_to(case):
    scene, paths = case
    if not scene.has_structure:
        pytest.skip("a scene without a structure")
    found, members = read(paths[0]), scene.members
    elements = found.tables.get("Elements", [])[1:]  # a scene may be of membranes alone
    assert [row[1] for row in elements] == list(members.names)
    chains = [nodes for group in members.chains for nodes in group.nodes]
    paths_of = [" – ".join(members.labels[n] for n in chain) for chain in chains]
    assert [row[3] for row in elements] == paths_of
    assert [row[1] for row in found.tables["Structural nodes"][1:]] == list(members.labels)
    places = numbers(found, "Structural nodes", (2, 3, 4))
    np.testing.assert_allclose(places, members.nodes, rtol=1e-8, atol=1e-11)  # nine digits
    if scene.members.wing is not None:
        parts = found.tables["Parts of tubes"][1:]
        assert [row[1] for row in parts] == list(scene.members.wing.tubes.names)
        ends = [" – ".join(members.labels[n] for n in nodes) for nodes in scene.members.wing.tubes.ends]
        assert [row[3] for row in parts] == ends
        np.testing.assert_allclose([float(row[2]) for row in parts], 2.0 * scene.members.wing.tubes.radius, rtol=1e-8)
    for path in paths[1:]:
        assert not {"Elements", "Structural nodes", "Parts of tubes"} & read(path).tables.keys()


def test_a_positive_pressure_pushes_to_the_suction_side_as_the_page_says(case):
    scene, paths = case
    if scene.wing is None:
        pytest.skip("a scene without a wing in a flow")
    found = read(paths[1])
    x = numbers(found, "Interface nodes", (1, 2, 3))[numbers(found, "Panels", (1, 2, 3, 4)).astype(int) - 1]
    area = 0.5 * np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    # wings that pull upwards: the suction side is the upper one; tips may stand upright
    assert np.all(area[:, 2] > -1e-3 * np.linalg.norm(area, axis=1))
    assert np.count_nonzero(area[:, 2] > 0.1 * np.linalg.norm(area, axis=1)) > len(area) / 2
    aero = scene.aero_core()
    if "trim_angle" in {v.name for v in aero.variables}:
        aero.set("trim_angle", scene.trim_angle())
    aero.look()
    assert aero.get("pressure") @ area[:, 2] > 0.0
    # the panels of a strip are those of its lift, from front to rear
    rows = scene.interface.sections.shape[1] - 1
    strips = numbers(found, "Strips", range(1, rows + 1)).astype(int) - 1
    assert sorted(strips.ravel()) == list(range(len(area)))
    for front, rear in itertools.pairwise(strips.T):
        np.testing.assert_array_equal(x[front, 1], x[rear, 0])  # one ends where the next begins


@pytest.mark.parametrize("words", ["fmi2Discard", "fmi2Terminated", "GUID", "linux64", "suction side", "in turn"])
def test_the_page_says_how_it_is_stepped_and_what_to_beware_of(case, words):
    scene, paths = case
    for found in map(read, paths):
        assert words in found.text or (words == "in turn" and len(paths) == 1)
        assert ("trim_angle" in found.text) is (scene.trim is not None)
        if scene.trim is not None:
            assert f"node {scene.structure.pivot} at (" in found.text
        when_to_stop = len(paths) == 2 and not scene.transient
        assert ("imbalance_before_step of the" in " ".join(found.text.split())) is when_to_stop
        assert ("velocity of the structural one" in " ".join(found.text.split())) is (
            scene.has_flow and scene.transient
        )


@pytest.mark.parametrize(
    ("own_binary", "fmi", "said"),
    [
        (True, 2, "On Windows, where the binary is that of PythonFMU"),
        (True, 3, ""),
        (False, 2, "the binaries in this FMU"),
    ],
)
def test_the_page_says_what_the_binaries_of_this_fmu_do_and_of_no_other(own_binary, fmi, said):
    text = Page(page(ToyFmu(Toy(), instance_name="toy"), own_binary=own_binary, fmi=fmi)).text
    assert said in text
    assert ("GUID" in text) is (fmi == 2)
    assert ("On Windows" in text) is (own_binary and fmi == 2)
    assert ("PythonFMU" in text) is (fmi == 2)  # those of FMI 3.0 have no binary of it
    assert ("LD_PRELOAD" in text) is not own_binary


def test_titles_and_names_of_a_scene_are_text_whatever_they_look_like(scene, tmp_path):
    folder = tmp_path / "marked"
    shutil.copytree(scene.folder, folder)
    title = scene.title
    for path in [folder / "scene.toml", *folder.glob("*.csv")]:
        text = path.read_text(encoding="utf-8").replace(title, f"<i>{title}&amp;").replace("te_left", "<script>&lt;")
        path.write_text(text, encoding="utf-8")
    for path in build(scenes.load(folder), tmp_path, reference=False):
        assert f"<i>{title}&amp;" in read(path).text  # Page sees to it that all that opens is closed
    tables = read(tmp_path / "marked_structural.fmu").tables
    assert [row[1] for row in tables["Structural nodes"][1:]].count("<script>&lt;") == 1
    assert any("<script>&lt;" in row[3] for row in tables["Elements"][1:])


def test_hostile_names_are_text():
    toy = Toy()
    toy.variables = (Variable("load", (2,), description="<script>&"), *toy.variables[:2])
    toy.values["load"] = np.zeros(2)
    slave = ToyFmu(toy, instance_name="toy")
    slave.description = "</title><b>"
    found = Page(page(slave))
    assert "<script>&" in found.text
    assert "</title><b>" in found.text
