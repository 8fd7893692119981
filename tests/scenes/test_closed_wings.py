"""Closed wings that are made or read: shape, size, symmetry, numbers of panels."""

import numpy as np
import pytest

from aero.panel.bodies import Body
from interface.panels import area_vectors
from scenes.builders.profiles import naca
from scenes.builders.wings import (
    BoxWing,
    Planform,
    Stations,
    cell_shares,
    elliptic_chords,
    lofted,
    mirrored_wing,
    span_shares,
)
from tests.aero.closed_shapes import ellipsoid, triangulated, turned_over, volume
from tests.scenes.body_scenes import BOX, HEADER, WING, body
from tests.scenes.mesh_files import msh2

ROUNDING = 1e-12  # of lengths of order one
PROFILE = naca("0012")
# integral of twice the half thickness of NACA 0012, closed: 10 tau sum a_k / (power + 1)
SECTION = 10 * 0.12 * (0.2969 / 1.5 - 0.1260 / 2 - 0.3516 / 3 + 0.2843 / 4 - 0.1036 / 5)


def plan_area(surface):
    """Area m^2 of the projection on z = 0."""
    return 0.5 * np.abs(area_vectors(surface.nodes[surface.panels])[:, 2]).sum()


def is_own_image(surface):
    """Whether nodes, and the corners of panels with their first diagonals, are mirrored in y = 0 to the last bit."""
    nodes = surface.nodes + 0.0  # no -0
    there = {tuple(p) for p in nodes.tolist()}
    if {tuple(p) for p in (nodes * [1.0, -1.0, 1.0] + 0.0).tolist()} != there:
        return False

    def keys(points):
        return {(frozenset(map(tuple, (p[0], p[2]))), frozenset(map(tuple, (p[1], p[3])))) for p in points.tolist()}

    corners = nodes[surface.panels[surface.panels[:, 2] != surface.panels[:, 3]]]
    return keys(corners) == keys(corners * [1.0, -1.0, 1.0] + 0.0)


PLANFORMS = {
    "rectangular": Planform(6.0, 1.0, 1.0),
    "swept and tapered": Planform(5.0, 1.0, 0.5, sweep=np.radians(45.0), twist=np.radians(-5.0)),
    "dihedral": Planform(5.0, 1.0, 0.5, dihedral=np.radians(8.0)),
    "circular": Planform(2.0, 2.0, 0.1, axis=0.5, chords="elliptic"),
    "arc": Planform(25.3, 7.855, 1.971, arc=np.radians(60.0), axis=0.35, chords="elliptic"),
}


@pytest.mark.parametrize(("tip", "panels"), [("flat", 24), ("flat", 25), ("round", 24)])
@pytest.mark.parametrize("plan", PLANFORMS)
def test_wings_are_closed_with_normals_outward_and_their_own_images(plan, panels, tip):
    stations = PLANFORMS[plan].stations(span_shares(8, "cosine"))
    surface = mirrored_wing(stations.sections(PROFILE.points(panels)), tip)
    made = Body.of(surface.nodes, surface.panels, surface.trailing_edges)  # raises if open, inside out, or flat
    assert len(made.panels) == 16 * panels + 2 * {"flat": panels // 2, "round": 4 * (panels // 2)}[tip]
    assert is_own_image(surface)


def test_a_rectangular_wing_has_the_volume_of_its_profile_times_its_span():
    errors = []
    for panels in (40, 80):
        surface = mirrored_wing(PLANFORMS["rectangular"].stations(span_shares(4)).sections(PROFILE.points(panels)))
        errors.append(6.0 * SECTION - volume(surface.nodes, surface.panels))
    assert errors[1] < 2e-3 * 6.0 * SECTION  # 80 panels: chords under arcs
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_a_round_tip_adds_half_a_body_of_revolution():
    volumes = []
    for strips in (8, 16, 32):
        sections = PLANFORMS["rectangular"].stations(span_shares(4)).sections(PROFILE.points(120))
        flat, rounded = mirrored_wing(sections), mirrored_wing(sections, "round", strips)
        volumes.append(volume(rounded.nodes, rounded.panels) - volume(flat.nodes, flat.panels))
    x = np.linspace(0.0, 1.0, 20001)
    exact = np.trapezoid(np.pi * (0.5 * PROFILE.thickness(x)) ** 2, x)  # two halves of it
    assert volumes[2] == pytest.approx(exact, rel=2.5e-3)  # the last error and what 120 points along the chord leave
    ratio = (volumes[1] - volumes[0]) / (volumes[2] - volumes[1])
    assert np.log2(ratio) == pytest.approx(2.0, abs=0.1)  # polygons in a circle


def test_planforms_have_the_area_span_and_sweep_that_are_asked_for():
    points = PROFILE.points(60)
    swept = mirrored_wing(PLANFORMS["swept and tapered"].stations(span_shares(4)).sections(points))
    # both sides of thin sections: the twist of 5 degrees shortens chords by 0.4 % at the tip
    assert plan_area(swept) == pytest.approx(5.0 * 0.75, rel=3e-3)
    circle = mirrored_wing(PLANFORMS["circular"].stations(span_shares(60, "cosine")).sections(points))
    assert plan_area(circle) == pytest.approx(np.pi, rel=2e-3)  # cut where the chord is 5 % of the diameter
    assert np.ptp(circle.nodes[:, :2], axis=0) == pytest.approx([2.0, 2.0], abs=ROUNDING)
    tip = swept.nodes[np.argmax(swept.nodes[:, 1])]
    assert tip[1] == 2.5
    leading = PLANFORMS["swept and tapered"].stations(np.array([0.0, 1.0])).point
    assert np.degrees(np.arctan2(leading[1, 0], leading[1, 1])) == pytest.approx(45.0)


def test_twist_turns_the_nose_up_and_dihedral_lifts_the_tips():
    stations = Planform(2.0, 1.0, 1.0, twist=0.1, dihedral=0.2).stations(np.array([0.0, 1.0]))
    sections = stations.sections(PROFILE.points(24))
    assert sections[1, 12, 2] - sections[1, 0, 2] == pytest.approx(np.sin(0.1))  # nose above trailing edge
    assert stations.point[1, 2] == pytest.approx(np.tan(0.2))


def test_an_arc_keeps_its_length_and_has_its_sections_normal_to_it():
    plan = PLANFORMS["arc"]
    stations = plan.stations(span_shares(400))
    length = np.linalg.norm(np.diff(stations.point, axis=0), axis=1).sum()
    assert length == pytest.approx(12.65, rel=1e-5)  # chords under an arc of 60 degrees in 400 pieces
    radius = 12.65 / np.radians(60.0)
    assert stations.point[-1, 1] == pytest.approx(radius * np.sin(np.radians(60.0)))
    assert stations.point[-1, 2] == pytest.approx(-radius * 0.5)  # hanging down
    sections = stations.sections(PROFILE.points(24))
    up = sections[:, 6] - sections[:, 18]  # from the lower to the upper side
    centre = np.array([0.0, 0.0, -radius])
    arm = 0.5 * (sections[:, 6] + sections[:, 18]) - centre
    assert np.abs(up[:, 1] * arm[:, 2] - up[:, 2] * arm[:, 1]).max() < 1e-9


def test_the_proposed_parafoil_has_its_area_in_trapezoids_between_its_ribs():
    widths = [0.711] * 14 + [0.654, 0.597, 0.540, 0.483, 0.426]
    shares = cell_shares(widths, 1)
    chord = elliptic_chords(shares, 7.855, 1.971)
    area = 2.0 * np.sum(0.5 * (chord[1:] + chord[:-1]) * np.array(widths))
    assert area == pytest.approx(160.0, rel=1e-3)  # of lengths with three digits
    assert len(cell_shares(widths, 5)) == 96  # 19 cells a side of 5 strips: with 34 panels a profile 6460 of both
    assert np.allclose(cell_shares(widths, 5)[::5], shares, rtol=0.0, atol=ROUNDING)
    assert chord[14] == pytest.approx(5.093, abs=2e-3)


@pytest.mark.parametrize(
    ("panels", "strips", "plate", "elements"), [(78, 9, 4, 4424), (118, 13, 6, 8968), (158, 19, 8, 16432)]
)
def test_the_box_wing_has_the_meshes_of_the_ram_air_thesis(panels, strips, plate, elements):
    surface = BoxWing(12.0, 2.4, 1.0, 0.15, strips, plate).surface(PROFILE.points(panels))
    made = Body.of(surface.nodes, surface.panels, surface.trailing_edges)
    assert {len(strip) for strip in made.strips} == {panels}
    wake = len(made.trailing) if panels == 78 else 0  # table 4.1 counts the strips of the wake in the coarse mesh only
    assert len(made.panels) + wake == elements
    assert is_own_image(surface)


def test_the_box_wing_has_the_volume_of_its_profile_along_its_middle_line():
    volumes = []
    length = 2.0 * (11.7 + 2.1) + 2.0 * np.pi * 0.15
    for corner in (4, 8):
        surface = BoxWing(12.0, 2.4, 1.0, 0.15, 4, 2, corner).surface(PROFILE.points(160))
        volumes.append(volume(surface.nodes, surface.panels))
    # Pappus: the centre of a symmetric profile runs along the middle line; 160 panels a profile leave 4e-4
    assert volumes[1] == pytest.approx(SECTION * length, rel=1e-3)
    assert volumes[1] > volumes[0]
    y, z = np.abs(surface.nodes[:, 1]).max(), np.abs(surface.nodes[:, 2]).max()
    assert (y, z) == (pytest.approx(6.06, abs=1e-4), pytest.approx(1.26, abs=1e-4))  # half the thickness outside


def test_lofted_sections_need_not_be_symmetric():
    stations = Stations(
        np.array([[0.3, -2.0, 0.1], [0.0, 0.0, 0.0], [0.1, 3.0, 0.5]]),
        np.array([0.6, 1.0, 0.8]),
        np.zeros(3),
        np.zeros(3),
    )
    points = np.stack([naca(digits).points(24) for digits in ("0012", "2412", "4415")])
    stations, profiles = stations.between(4, points)
    for tip in ("flat", "round"):
        surface = lofted(stations.sections(profiles), tip)
        made = Body.of(surface.nodes, surface.panels, surface.trailing_edges)
        assert len(made.trailing) == 8
        with pytest.raises(ValueError, match="not its own mirror image"):
            made.half(surface.nodes)
    assert np.allclose(profiles[2], 0.5 * (points[0] + points[1]), rtol=0.0, atol=ROUNDING)


def test_scene_toml_gives_the_wing_that_the_generator_makes(tmp_path):
    keys = 'tip_chord = 0.5\nsweep = 20.0\ntwist = -3.0\ndihedral = 5.0\nstrip_spacing = "cosine"\naxis = 0.5\n'
    read = body(
        tmp_path, WING + keys + 'tip = "round"\ntip_strips = 3\npanel_spacing = "geometric"\npanel_growth = 8.0\n'
    )
    plan = Planform(6.0, 1.0, 0.5, *np.radians([20.0, -3.0, 5.0]), axis=0.5)
    points = PROFILE.points(24, "geometric", 0.08)
    made = mirrored_wing(plan.stations(span_shares(6, "cosine")).sections(points), "round", 3)
    assert np.array_equal(read.nodes, made.nodes)
    assert np.array_equal(read.panels, made.panels)
    assert np.array_equal(read.trailing_edges, made.trailing_edges)
    box = body(tmp_path, BOX)
    assert np.array_equal(box.nodes, BoxWing(12.0, 2.4, 1.0, 0.15, 5, 2).surface(PROFILE.points(24)).nodes)


def test_a_table_of_stations_gives_the_wing_of_its_planform(tmp_path):
    rows = "0,0,0,1,0,0,0012\n0.75,3,0.3,0.5,-4,0,0012\n"
    read = body(tmp_path, 'shape = "wing"\npanels = 24\nstrips = 6\nstations = "st.csv"\n', st_csv=HEADER + rows)
    angles = {"sweep": np.arctan2(0.75, 3.0), "twist": np.radians(-4.0), "dihedral": np.arctan2(0.3, 3.0)}
    made = mirrored_wing(Planform(6.0, 1.0, 0.5, **angles).stations(span_shares(6)).sections(PROFILE.points(24)))
    assert np.allclose(read.nodes, made.nodes, rtol=0.0, atol=ROUNDING)
    assert np.array_equal(read.panels, made.panels)
    whole = "0.75,-3,0.3,0.5,-4,0,0012\n" + rows
    read = body(tmp_path, 'shape = "wing"\npanels = 24\nstrips = 6\nstations = "st.csv"\n', st_csv=HEADER + whole)
    assert np.allclose(np.sort(read.nodes, axis=0), np.sort(made.nodes, axis=0), rtol=0.0, atol=ROUNDING)


def test_profiles_come_from_weights_and_files_and_blunt_ones_are_noted(tmp_path):
    text = WING.replace('profile = "0012"\n', "upper_weights = [0.17, 0.15]\n")
    thick = np.ptp(body(tmp_path, text).nodes[:, 2])
    below = np.ptp(body(tmp_path, text + "lower_weights = [0.02, 0.02]\n").nodes[:, 2])
    assert below < thick
    blunt = naca("0012", closed=False)
    t = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 60)))
    rows = [*blunt.upper(t[::-1]), *blunt.lower(t[1:])]
    dat = "\n".join(f"{x:.9f} {z:.9f}" for x, z in rows)
    read = body(tmp_path, WING.replace('"0012"', '"foil.dat"'), foil_dat=dat)
    assert "0.252 % of the chord" in read.remarks[0]
    expected = blunt.closed().thickness(np.array([0.3]))[0]
    assert np.ptp(read.nodes[:, 2]) == pytest.approx(expected, rel=0.01)  # 24 panels need not have the thickest place


def mesh_file(path, surface, triangles=False, edges=True):
    """A Gmsh 2 file of a surface, its trailing edges as the group `te`, with a node of no element in front."""
    nodes = np.concatenate([[[9.0, 9.0, 9.0]], surface.nodes])
    panels = surface.panels
    if triangles:
        quads = panels[:, 2] != panels[:, 3]
        panels = np.concatenate([triangulated(panels[quads]), panels[~quads]])
    elements = [(2, tuple(pair + 2)) for pair in surface.trailing_edges] if edges else []
    for panel in panels + 2:
        corners = tuple(dict.fromkeys(panel.tolist()))
        elements.append((1, corners, {3: 2, 4: 3}[len(corners)]))
    return msh2(path, nodes, elements, [(2, 1, "skin"), (1, 2, "te")])


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("edges", ["found", "grouped"])
def test_a_mesh_file_gives_back_the_wing_that_was_written(tmp_path, triangles, edges):
    plan = PLANFORMS["swept and tapered"]
    surface = mirrored_wing(plan.stations(span_shares(4)).sections(PROFILE.points(24)))
    (tmp_path / "wing").mkdir()
    mesh_file(tmp_path / "wing" / "wing.msh", surface, triangles)
    key = 'trailing_edges = "te"\n' if edges == "grouped" else ""
    read = body(tmp_path, f'shape = "mesh-file"\nmesh = "wing.msh"\n{key}')
    assert np.array_equal(read.nodes, surface.nodes)
    assert {frozenset(p) for p in read.trailing_edges.tolist()} == {
        frozenset(p) for p in surface.trailing_edges.tolist()
    }
    assert len(read.panels) == len(surface.panels) + triangles * 8 * 24 + triangles * 2 * 10
    assert volume(read.nodes, read.panels) == pytest.approx(volume(surface.nodes, surface.panels), rel=1e-9)
    assert "1 node without a panel left out" in read.remarks[0]


def test_a_body_without_lift_is_one_with_an_empty_list_of_trailing_edges(tmp_path):
    nodes, panels = ellipsoid(4, (2.0, 1.0, 0.5))
    (tmp_path / "wing").mkdir()
    elements = [(1, tuple(p + 1), 3) for p in panels]
    msh2(tmp_path / "wing" / "egg.msh", 1000.0 * nodes, elements)
    read = body(tmp_path, 'shape = "mesh-file"\nmesh = "egg.msh"\nunit = "mm"\ntrailing_edges = ""\n')
    assert read.trailing_edges.shape == (0, 2)
    assert np.allclose(np.sort(read.nodes, axis=0), np.sort(nodes, axis=0), rtol=0.0, atol=ROUNDING)
    assert np.array_equal(turned_over(turned_over(read.panels)), read.panels)
