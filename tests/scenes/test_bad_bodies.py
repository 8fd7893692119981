"""Bodies with one thing wrong: one sentence that names panels, elements, rows or keys; nothing else is ever raised."""

import re

import numpy as np
import pytest

from aero.panel.bodies import Body, BodyError
from interface.topology import listed
from scenes.schema import SceneError
from tests.aero.closed_shapes import cube, ellipsoid, half_fin, turned_over, wing, with_image
from tests.scenes.body_scenes import BOX, HEADER, WING, body
from tests.scenes.mesh_files import msh2

NONE = np.zeros((0, 2), dtype=int)
SENTENCE = re.compile(r"[^\n]*[^.\n]\.")


def refused(*arguments, **options):
    """The sentence with which a body is refused."""
    with pytest.raises(BodyError) as caught:
        Body.of(*arguments, **options)
    assert SENTENCE.fullmatch(str(caught.value))
    return str(caught.value)


SHAPE = wing(strips=3)


def without(panel):
    return SHAPE.nodes, np.delete(SHAPE.panels, panel, axis=0)


def changed(rows, values):
    panels = SHAPE.panels.copy()
    panels[rows] = values
    return SHAPE.nodes, panels


def moved(node, place):
    nodes = SHAPE.nodes.copy()
    nodes[node] = place
    return nodes, SHAPE.panels


def given(edges, **options):
    return SHAPE.nodes, SHAPE.panels, np.asarray(edges), options


TE = SHAPE.trailing_edges
FEW = SHAPE.panels[:2]
MOEBIUS = np.array([[0, 1, 3, 2], [2, 3, 5, 4], [4, 5, 7, 6], [6, 7, 0, 1]])

# what is wrong: nodes, panels, more arguments, and words that the sentence must hold
ARRAYS = {
    "open": (*without(7), ["open at the panels 7, 8, 31 and 163", "4 edges without a second panel"]),
    "open at a whole tip": (SHAPE.nodes, SHAPE.panels[:144], ["is open at the panels", "48 edges", "43 more"]),
    "one normal": (*changed([7], turned_over(SHAPE.panels[[7]])), ["the normal of panel 8 points to the other side"]),
    "two normals": (
        *changed([7, 40], turned_over(SHAPE.panels[[7, 40]])), ["the normals of panels 8 and 41 point to the other"],
    ),
    "inside out": (SHAPE.nodes, turned_over(SHAPE.panels), ["normals of the panels 1, 2, 3", "point into the body"]),
    "one of two inside out": (
        np.concatenate([SHAPE.nodes, SHAPE.nodes + 5.0]),
        np.concatenate([SHAPE.panels, turned_over(SHAPE.panels) + len(SHAPE.nodes)]),
        [f"panels {len(SHAPE.panels) + 1}, {len(SHAPE.panels) + 2}", "point into the body"],
    ),
    "no trailing edge": (*cube(3), ["has no trailing edge", "sharper than 60 degrees", "none for a body without lift"]),
    "flow from behind": (
        SHAPE.nodes, SHAPE.panels, None, {"downstream": (-1.0, 0.0, 0.0)}, ["has no trailing edge"],
    ),
    "one-sided": (*given([SHAPE.panels[5, :2]]), ["edge 1 has both panels on one side", "panels 6 and 30 turn by"]),
    "twice": (*given([*TE, TE[1][::-1]]), ["trailing edge 7 stands twice", "number 2 again"]),
    "no edge": (*given([*TE, [0, 30]]), ["trailing edge 7 is no edge of a panel", "nodes 1 and 31"]),
    "diagonals": (
        *given([SHAPE.panels[5, [0, 2]], SHAPE.panels[6, [0, 2]]]), ["trailing edges 1 and 2 are no edge of a panel"],
    ),
    "no pairs": (*given([[0, 1, 2]]), ["pairs of nodes (t,2)"]),
    "no area": (*moved(SHAPE.panels[30, 2:], SHAPE.nodes[SHAPE.panels[30, 1::-1]]), ["the panel 31 has no area"]),
    "crossed": (*changed([3], SHAPE.panels[3, [0, 2, 1, 3]]), ["the panel 4 has no area"]),
    "corner twice": (*changed([3], SHAPE.panels[3, [0, 0, 1, 2]]), ["the panel 4 has a corner twice", "a, b, c, c"]),
    "no node": (*changed([3], [0, 1, 2, 999]), ["the panel 4 has a corner that is no node of 168"]),
    "no place": (*moved(30, np.nan), ["the node 31 is at no finite place"]),
    "far": (*moved(30, 1e12), ["the node 31 is at no finite place within 1e+09 m"]),
    "three at an edge": (
        SHAPE.nodes, np.concatenate([SHAPE.panels, SHAPE.panels[:1]]), ["panels 1, 157 and 169", "3 more edges"],
    ),
    "one side only": (
        np.random.default_rng(1).normal(size=(8, 3)), MOEBIUS, ["has one side only", "bounds no body"],
    ),
    "no volume": (
        SHAPE.nodes[[0, 30, 60, 60]] + 0.0, np.array([[0, 1, 2, 2], [0, 2, 1, 1]]), ["encloses no volume"],
    ),
    "no panels": (SHAPE.nodes, SHAPE.panels[:0], ["one panel at least"]),
    "indices of another kind": (SHAPE.nodes, SHAPE.panels.astype(float), ["whole numbers"]),
    "wide strips": (
        SHAPE.nodes * [1.0, 60.0, 1.0], SHAPE.panels, ["the strips 2, 3, 4 and 5", "times as wide", "more than 50"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", ARRAYS)
def test_a_body_with_one_thing_wrong_is_refused_in_one_sentence(case):
    nodes, panels, *more, words = ARRAYS[case]
    options = more.pop() if more and isinstance(more[-1], dict) else {}
    sentence = refused(nodes, panels, *more, **options)
    for word in words:
        assert word in sentence


def test_an_ellipsoid_needs_no_trailing_edge_if_that_is_said():
    nodes, panels = ellipsoid(3)
    assert "no trailing edge" in refused(nodes, panels)
    body = Body.of(nodes, panels, NONE)
    assert body.trailing.shape == (0, 4)
    assert body.strips == ()
    body.check_wake(nodes, (1.0, 0.0, 0.0))


HALF = Body.of(SHAPE.nodes, SHAPE.panels).half(SHAPE.nodes).panels


def shifted(y):
    return SHAPE.nodes + np.array([0.0, y, 0.0])


def test_halves_are_open_in_the_plane_of_symmetry_only():
    assert "is open at the panels" in refused(SHAPE.nodes, SHAPE.panels[HALF])
    assert "through the plane y = 0 (down to y = -0.1 m)" in refused(shifted(-0.1), SHAPE.panels[HALF], symmetric=True)
    assert "except in the plane y = 0" in refused(shifted(0.1), SHAPE.panels[HALF], symmetric=True)
    assert "the panels 1, 2, 3" in refused(SHAPE.nodes, SHAPE.panels, symmetric=True)
    half = Body.of(SHAPE.nodes, SHAPE.panels[HALF], symmetric=True)
    half.check_plane(SHAPE.nodes)
    with pytest.raises(BodyError, match=r"through the plane y = 0 \(down to y = -0.1 m\)"):
        half.check_plane(shifted(-0.1))
    turned = SHAPE.panels[HALF].copy()
    with pytest.raises(BodyError, match="point into the body"):
        Body.of(SHAPE.nodes, turned_over(turned), symmetric=True)


def test_panels_of_a_half_in_the_plane_are_refused_and_so_are_trailing_edges_there():
    other = wing(strips=3, spacing="uniform")
    body = Body.of(other.nodes, other.panels)
    tip = body.half(other.nodes).panels
    closing = other.nodes - [0.0, 3.0, 0.0]  # the tip is in the plane, the wing beyond it
    assert "through the plane" in refused(closing, other.panels[tip], symmetric=True)
    inward = other.nodes * [1.0, -1.0, 1.0] + [0.0, 3.0, 0.0]
    at_plane = np.flatnonzero(np.all(np.abs(inward[other.panels[tip], 1]) < 1e-12, axis=1))
    sentence = refused(inward, turned_over(other.panels[tip]), symmetric=True)
    assert f"the panels {1 + at_plane[0]}, " in sentence
    assert "in the plane y = 0; leave them out" in sentence
    nodes, panels = half_fin()
    edge = [0, 13]  # from one section of 13 points to the next, along the trailing edge
    assert "trailing edge 1 (at the panel 1) has a panel on one side only" in refused(
        nodes, panels, [edge], symmetric=True
    )
    Body.of(nodes, panels, NONE, symmetric=True)


def test_a_body_without_mirror_image_or_across_the_plane_has_no_half():
    askew = shifted(0.0)
    askew[40, 0] += 0.01
    with pytest.raises(BodyError, match="not its own mirror image in the plane y = 0: nodes have no mirror images"):
        Body.of(askew, SHAPE.panels).half(askew)
    cut = SHAPE.panels.copy()
    cut[0:1] = np.nan_to_num(cut[0:1])
    triangles = np.concatenate([cut[1:], [[*cut[0, :3], cut[0, 2]], [cut[0, 0], cut[0, 2], cut[0, 3], cut[0, 3]]]])
    with pytest.raises(BodyError, match=r"not its own mirror image in the plane y = 0: the panels .* have no mirror"):
        Body.of(SHAPE.nodes, triangles).half(SHAPE.nodes)
    nodes, panels = cube(3)  # the middle row of panels lies across y = 0
    with pytest.raises(BodyError, match=r"the panels .* lie across the plane y = 0"):
        Body.of(nodes, panels, NONE).half(nodes)
    nodes, panels = with_image(*half_fin())
    Body.of(nodes, panels).half(nodes)


@pytest.mark.parametrize("seed", range(200))
def test_no_random_change_of_a_body_ends_in_anything_but_a_body_or_a_sentence(seed):
    random = np.random.default_rng(seed)
    nodes, panels = SHAPE.nodes.copy(), SHAPE.panels.copy()
    for _ in range(random.integers(1, 4)):
        row = random.integers(len(panels))
        match random.integers(6):
            case 0:
                panels[row, random.integers(4)] = random.integers(-2, len(nodes) + 2)
            case 1:
                panels = np.delete(panels, row, axis=0)
            case 2:
                panels = np.concatenate([panels, panels[[row]]])
            case 3:
                panels[row] = panels[row][random.permutation(4)]
            case 4:
                nodes[random.integers(len(nodes))] = random.choice([0.0, np.nan, 1e300, 1.0])
            case 5:
                panels = panels[random.permutation(len(panels))]
    edges = SHAPE.trailing_edges if random.integers(2) else None
    assert SENTENCE.fullmatch(outcome(nodes, panels, edges, random.normal(size=3)))


def outcome(nodes, panels, edges, direction):
    """The sentence in which a body, its wake or its half ends."""
    try:
        body = Body.of(nodes, panels, edges)
        body.check_wake(nodes, direction)
        body.half(nodes)
    except BodyError as error:
        return str(error)
    return "It is one."


# [body] in scene.toml: text, files and words
SCENES = {
    "no shape": (WING.replace('shape = "wing"\n', ""), {}, ["[body] lacks 'shape'"]),
    "unknown shape": (WING.replace('"wing"', '"kite"'), {}, ["must be one of: wing, parafoil, box-wing, mesh-file"]),
    "misspelt key": (WING + "dihedrall = 3.0\n", {}, ["unknown key 'dihedrall'"]),
    "no span": (WING.replace("span = 6.0\n", ""), {}, ["[body] lacks 'span'; a wing needs it"]),
    "negative chord": (WING.replace("chord = 1.0", "chord = -1.0"), {}, ["chord must be a finite number above 0"]),
    "coarse profile": (WING.replace("panels = 24", "panels = 9"), {}, ["panels must be a whole number from 10"]),
    "no strips": (WING.replace("strips = 6", "strips = 0"), {}, ["strips must be a whole number from 1"]),
    "height of a wing": (WING + "height = 2.0\n", {}, ["height means nothing to a wing; drop it"]),
    "sweep of a box wing": (BOX + "sweep = 20.0\n", {}, ["sweep means nothing to a box wing"]),
    "span of a table": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\nspan = 3.0\n', {}, ["span means nothing to"],
    ),
    "profile of a file": ('shape = "mesh-file"\nmesh = "w.msh"\nprofile = "0012"\n', {}, ["profile means nothing to"]),
    "no profile": (WING.replace('profile = "0012"\n', ""), {}, ["has no profile"]),
    "two profiles": (WING + "upper_weights = [0.1]\n", {}, ["a profile and weights of another"]),
    "lower weights of a name": (WING + "lower_weights = [0.1]\n", {}, ["lower_weights means nothing to a named"]),
    "weights that are none": (
        WING.replace('profile = "0012"', 'upper_weights = ["a"]'), {}, ["upper_weights must be a list of"],
    ),
    "unknown profile": (WING.replace("0012", "eppler"), {}, ["'eppler' is no NACA profile", "no such file"]),
    "impossible NACA": (WING.replace("0012", "0412"), {}, ["[body] profile: NACA 0412 has a place of camber without"]),
    "profile elsewhere": (WING.replace("0012", "../e.dat"), {}, ["no file in the scene's folder"]),
    "missing profile": (WING.replace("0012", "e.dat"), {}, ["wing/e.dat does not exist"]),
    "profile that crosses itself": (
        WING.replace('profile = "0012"', "upper_weights = [0.2]\nlower_weights = [-0.2]"), {}, ["[body]:", "no area"],
    ),
    "arc and dihedral": (WING + "arc = 30.0\ndihedral = 3.0\n", {}, ["an arc or a dihedral, not both"]),
    "pointed tip": (WING + "tip_chord = 0\n", {}, ["tip_chord must be a finite number above 0 (cut a tip that ends"]),
    "pointed ellipse": (WING + 'planform = "elliptic"\n', {}, ["lacks 'tip_chord'"]),
    "odd round tip": (WING.replace("24", "25") + 'tip = "round"\n', {}, ["an even number of panels a profile; 25"]),
    "wide strips": (WING.replace("6.0", "900.0"), {}, ["the strips 1, 2, 3", "75.", "more than 50"]),
    "too many": (
        WING.replace("panels = 24", "panels = 1000").replace("strips = 6", "strips = 600"), {}, ["1200000 panels"],
    ),
    "wide corners": (BOX.replace("0.15", "1.5"), {}, ["below half of span and height; it is 1.5 m"]),
    "corners without plate": (BOX.replace("0.15", "1.2"), {}, ["below half of span and height; it is 1.2 m"]),
    "sharp corners": (BOX.replace("0.15", "0.05"), {}, ["corners are", "take a larger radius"]),
    "no table": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\n', {}, ["wing/s.csv does not exist"],
    ),
    "one station": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\n', {"s_csv": HEADER + "0,0,0,1,0,0,0012\n"},
        ["wing/s.csv row 2 is the only station"],
    ),
    "stations off the middle": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\n',
        {"s_csv": HEADER + "0,1,0,1,0,0,0012\n0,2,0,1,0,0,0012\n"}, ["wing/s.csv row 2: y_m is 1", "left tip"],
    ),
    "station twice": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\n',
        {"s_csv": HEADER + "0,0,0,1,0,0,0012\n0,2,0,1,0,0,0012\n0,2,0,1,0,0,0012\n"}, ["row 4 is at the place"],
    ),
    "roll in the middle": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\n',
        {"s_csv": HEADER + "0,0,0,1,0,3,0012\n0,2,0,1,0,0,0012\n"}, ["wing/s.csv row 2: roll_deg must be 0"],
    ),
    "stations that return": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\n',
        {"s_csv": HEADER + "0,0,0,1,0,0,0012\n0,-2,0,1,0,0,0012\n0,2,0,1,0,0,0012\n"},
        ["wing/s.csv row 3: y_m is -2; ", "right of it"],
    ),
    "stations that turn back": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\n',
        {"s_csv": HEADER + "0,-2,0,1,0,0,0012\n0,1,0,1,0,0,0012\n0,0.5,0,1,0,0,0012\n0,2,0,1,0,0,0012\n"},
        ["wing/s.csv row 4 goes back", "order of the span"],
    ),
    "profile of a station": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\n',
        {"s_csv": HEADER + "0,0,0,1,0,0,0012\n0,2,0,1,0,0,what\n"}, ["wing/s.csv row 3: 'what' is no NACA profile"],
    ),
    "no chord at a station": (
        'shape = "wing"\nstations = "s.csv"\npanels = 24\nstrips = 2\n',
        {"s_csv": HEADER + "0,0,0,1,0,0,0012\n0,2,0,0,0,0,0012\n"},
        ["row 3: chord_m '0' is not a number above zero", "cut a tip that ends in a point"],
    ),
    "no mesh": ('shape = "mesh-file"\nmesh = "w.msh"\n', {}, ["wing/w.msh does not exist"]),
    "no name of a mesh": ('shape = "mesh-file"\n', {}, ["lacks 'mesh'; a mesh from a file needs it"]),
}  # fmt: skip


@pytest.mark.parametrize("case", SCENES)
def test_a_section_body_with_one_thing_wrong_is_refused_in_one_sentence(tmp_path, case):
    text, files, words = SCENES[case]
    with pytest.raises(SceneError) as caught:
        body(tmp_path, text, **files)
    assert SENTENCE.fullmatch(str(caught.value))
    for word in words:
        assert word in str(caught.value)


def written(folder, nodes, panels, lines=()):
    """A Gmsh file w.msh of panels behind some lines in the group `te`."""
    (folder / "wing").mkdir()
    elements = [(2, tuple(np.add(pair, 1).tolist())) for pair in lines]
    for panel in (panels + 1).tolist():
        corners = tuple(dict.fromkeys(panel))
        elements.append((1, corners, {3: 2, 4: 3}[len(corners)]))
    msh2(folder / "wing" / "w.msh", nodes, elements, [(2, 1, "skin"), (1, 2, "te")])


MESHES = {
    "open": (*without(7), TE, "", ["wing/w.msh: the surface is open at the elements 13, 14"]),
    "one normal": (
        *changed([7], turned_over(SHAPE.panels[[7]])), TE, "", ["wing/w.msh: the normal of element 14 points"],
    ),
    "missing group": (SHAPE.nodes, SHAPE.panels, TE, 'trailing_edges = "edge"\n', ["no line group 'edge'", "'te'"]),
    "diagonal": (
        SHAPE.nodes, SHAPE.panels, [SHAPE.panels[3, [0, 2]]], 'trailing_edges = "te"\n', ["trailing edge 1 is no edge"],
    ),
    "one-sided": (
        SHAPE.nodes, SHAPE.panels, [SHAPE.panels[5, :2]], 'trailing_edges = ["te"]\n', ["elements 7 and 31 turn by"],
    ),
    "off the surface": (
        np.concatenate([SHAPE.nodes, [[9.0, 9.0, 9.0]]]), SHAPE.panels, [[0, len(SHAPE.nodes)]],
        'trailing_edges = "te"\n', ["lines of the group 'te' are on no panel"],
    ),
    "mm": (1000.0 * SHAPE.nodes, SHAPE.panels, TE, "", ["look like mm"]),
    "no panels": (SHAPE.nodes, SHAPE.panels[:0], TE, "", ["no quads and no triangles"]),
    "no trailing edge": (*ellipsoid(3), [], "", ["has no trailing edge"]),
}  # fmt: skip


@pytest.mark.parametrize("case", MESHES)
def test_a_mesh_of_a_body_with_one_thing_wrong_is_refused_by_the_numbers_of_its_elements(tmp_path, case):
    nodes, panels, lines, keys, words = MESHES[case]
    written(tmp_path, nodes, panels, lines)
    with pytest.raises(SceneError) as caught:
        body(tmp_path, 'shape = "mesh-file"\nmesh = "w.msh"\n' + keys)
    assert SENTENCE.fullmatch(str(caught.value))
    for word in words:
        assert word in str(caught.value)


def test_volumes_and_second_order_are_no_panels(tmp_path):
    (tmp_path / "wing").mkdir()
    msh2(tmp_path / "wing" / "w.msh", SHAPE.nodes, [(1, (1, 2, 3, 4, 5, 6))])
    with pytest.raises(SceneError, match="element 1 is of the type triangle6; a body has triangles of three and quads"):
        body(tmp_path, 'shape = "mesh-file"\nmesh = "w.msh"\n')


def test_a_trailing_edge_without_mirror_image_has_no_half_and_its_continuation_is_told_by_its_elements(tmp_path):
    """TE leads from the left tip to the right one; the elements of panels begin behind the lines of the group."""
    right = TE[len(TE) // 2 :]
    with pytest.raises(BodyError, match=r"trailing edges 1, 2 and 3 \(at the panels .*\) have no mirror image among"):
        Body.of(SHAPE.nodes, SHAPE.panels, right).half(SHAPE.nodes)
    Body.of(SHAPE.nodes, SHAPE.panels, TE).half(SHAPE.nodes)
    text = 'shape = "mesh-file"\nmesh = "w.msh"\ntrailing_edges = "te"\n'
    for name, lines, missing in (("all", TE, []), ("half", right, [0, 1, 2]), ("one", np.delete(TE, 2, axis=0), [2])):
        (tmp_path / name).mkdir()
        written(tmp_path / name, SHAPE.nodes, SHAPE.panels, lines)
        remarks = body(tmp_path / name, text).remarks
        assert len(remarks) == bool(missing)
        if missing:
            body_of_all = Body.of(SHAPE.nodes, SHAPE.panels, TE)
            elements = np.sort(body_of_all.trailing[missing, :2].ravel()) + 1 + len(lines)
            assert remarks[0].startswith(f"wing/w.msh: {len(missing)} sharp edge")
            assert f"(at the element{listed(elements)})" in remarks[0]
