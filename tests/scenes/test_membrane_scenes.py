"""Membranes as scenes have them, against series, closed forms and laws of statics."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

import scenes
from benchmarks.particle_membrane import series
from master.coupling import SCHEMES, Coupling, solve
from scenes.builders.surfaces import airbag
from scenes.cores.structure import StructuralModel
from tests.scenes.membrane_scenes import ISOTROPIC, held, rectangle, solved, written
from tests.scenes.mesh_files import msh2
from tests.scenes.mesh_files import written as mesh_file

RELATIVE = 1e-9  # out-of-balance force over the loads that a converged membrane has at most
SIDES = "x_min", "x_max", "y_min", "y_max"


def load_of(core, name="inner_pressure"):
    """Norm N of the forces of a pressure on all nodes that are free in some direction, at the shape of a core."""
    model = StructuralModel(core.solver.model.scene)
    values = {block: core.get(block) for block in core.names}
    loads = model.loads(values)
    faces = model._structure.load_groups[f"pressure {name}"]
    forces, x = np.zeros_like(model.members.nodes), core.get("position")
    np.add.at(forces, faces.nodes, faces.forces(x[faces.nodes], loads.on[f"pressure {name}"]))
    return float(np.linalg.norm(forces[~model.members.fixed]))


@pytest.mark.parametrize(("settings", "triangles"), [({}, 2000), ({"order": 2, "cells": 8}, 320)])
def test_henckys_membrane_stands_where_his_series_says(settings, triangles):
    core = solved("hencky", settings)
    members = core.solver.model.members
    assert len(members.membranes.group) == triangles
    height = core.get("position")[members.labels.index("centre"), 2]
    assert height == pytest.approx(series(460.0 / 100e3, 0.3), rel=5e-3)  # the pressure follows; strains are finite
    assert core.get("residual") <= RELATIVE * load_of(core)
    assert core.get("symmetry_used") == 1.0
    assert core.get("wrinkled_area_share") == 0.0
    rise = core.get("support_group_force")[0]
    assert rise == pytest.approx([0.0, 0.0, 460.0 * np.pi], rel=2e-3, abs=1e-6)  # p pi a^2; the rim is a polygon


def test_the_half_disc_gives_what_the_whole_one_does():
    half, whole = (solved("hencky", {"cells": 6}, symmetric=s) for s in (1.0, 0.0))
    assert (half.get("symmetry_used"), whole.get("symmetry_used")) == (1.0, 0.0)
    for name in ("position", "membrane_stress_1", "inner_pressure_volume"):
        assert half.get(name) == pytest.approx(whole.get(name), rel=1e-8, abs=1e-9)  # the tolerance of either solve


@pytest.mark.parametrize(("cells", "near"), [(2, 6e-4), (10, 3e-4)])  # m; 16 and 400 triangles
def test_the_airbag_stands_up_from_flat_as_tension_field_theory_says(cells, near):
    core = solved("airbag", {"cells": cells})
    members = core.solver.model.members
    centre = members.labels.index("centre")
    assert core.get("position")[centre, 2] == pytest.approx(0.2152, abs=near)
    assert core.get("residual") <= RELATIVE * load_of(core)
    larger, smaller = core.get("membrane_stress_1"), core.get("membrane_stress_2")
    assert smaller.min() >= -1e-9 * larger.max()
    if cells == 10:
        beside = np.any(members.membranes.group.nodes == centre, axis=1)
        assert larger[beside].mean() / 0.6e-3 == pytest.approx(3.91e6, abs=0.05e6)  # Pa


def test_without_wrinkles_a_membrane_resists_compression():
    stiff = solved("airbag", {"cells": 2, "wrinkling": "off"})
    assert stiff.get("membrane_stress_2").min() < -100.0  # N/m, of some thousand
    assert np.all(stiff.get("wrinkle_state") == 2.0)


def test_forces_on_groups_of_supports_add_up_to_the_load():
    core = solved("airbag", {"cells": 6})
    groups = core.get("support_group_force")
    assert groups.sum(axis=0) == pytest.approx(core.get("support_force"), rel=1e-8)  # 1e-9 of the loads out of balance
    assert np.count_nonzero(np.abs(groups) > 1e-6) == 3  # each holds one direction


@pytest.mark.parametrize("order", [1, 2])
def test_pressure_on_the_interface_adds_to_that_of_the_parameter(order):
    settings = {"cells": 3, "order": order}
    parameter = solved("airbag", settings)
    inputs = solved("airbag", settings, inner_pressure=2000.0, pressure=3000.0)
    # of second order the interface has four flat triangles an element, whose pressure is not that of the curved one
    near = 1e-8 if order == 1 else 5e-3
    assert inputs.get("displacement") == pytest.approx(parameter.get("displacement"), abs=near)


@pytest.mark.parametrize("order", [1, 2])
def test_a_sphere_under_pressure_has_half_the_pressure_times_the_radius(tmp_path, order):
    radius, pressure, cells = 0.5, 1000.0, 24 if order == 1 else 4
    sphere = f"""shape = "sphere"
share = "eighth"
order = {order}
[membranes.size]
radius = {radius}
cells = {cells}
[membranes.fabrics.sheet]
stiffness = 1e7
poisson = 0.3
[membranes.supports]
symmetry_x = "x"
symmetry_y = "y"
symmetry_z = "z"
[membranes.pressures.inside]
value = {pressure}
closed = true
"""
    core = solved(written(tmp_path, sphere))
    area = core.solver.model.members.membranes.group.area
    for name in ("membrane_cauchy_stress_1", "membrane_cauchy_stress_2"):
        mean = float(area @ core.get(name) / area.sum())
        assert mean == pytest.approx(0.5 * pressure * radius, rel=5e-3)  # facets; the strain is 2e-5
    assert core.get("inside_volume") == pytest.approx(np.pi / 6.0 * radius**3, rel=1e-2)  # within inscribed facets


def test_a_cut_that_is_shorter_than_its_frame_is_under_the_stress_of_its_strain(tmp_path):
    woven = """[membranes.fabrics.sheet]
stiffness_warp = 2e5
stiffness_weft = 5e4
shear_stiffness = 1e4
poisson_warp = 0.2
warp_direction = [0.0, 1.0, 0.0]
shortening_along = 1.0
shortening_across = 0.5
strength = 4000.0
"""
    core = solved(written(tmp_path, rectangle(fabric=woven, more=held(*SIDES))))
    strain = np.array([0.5 * (1.0 / 0.99**2 - 1.0), 0.5 * (1.0 / 0.995**2 - 1.0)])  # of warp and weft, Green-Lagrange
    nu21 = 0.2 * 5e4 / 2e5
    stress = np.array([2e5 * (strain[0] + nu21 * strain[1]), 5e4 * (strain[1] + 0.2 * strain[0])]) / (1.0 - 0.2 * nu21)
    assert core.get("membrane_stress_1") == pytest.approx(np.full(64, stress[0]), rel=1e-9)  # the frame does not move
    assert core.get("membrane_stress_2") == pytest.approx(np.full(64, stress[1]), rel=1e-9)
    assert np.abs(core.get("wrinkle_direction")[:, 1]) == pytest.approx(np.ones(64))
    cauchy = stress[0] / 0.99 * 0.995  # F S F^T / J
    assert core.get("largest_fabric_utilisation") == pytest.approx(cauchy / 4000.0)
    assert core.get("largest_membrane_strain") == pytest.approx(strain[0])
    assert core.get("outside_validity") == 0.0


def test_beyond_its_strength_and_five_per_cent_a_fabric_is_outside_of_validity(tmp_path):
    fabric = ISOTROPIC + "shortening_along = 6.0\nshortening_across = 6.0\nstrength = 100.0\n"
    core = solved(written(tmp_path, rectangle(fabric=fabric, more=held(*SIDES))))
    assert core.get("outside_validity") == 2.0
    assert {c.name: c.limit for c in core.criteria} == {
        "largest_membrane_strain": 0.05, "largest_fabric_utilisation": 1.0,
    }  # fmt: skip


def test_a_table_of_patterns_cuts_single_triangles(tmp_path):
    side = 0.25 * np.sqrt(2.0)  # of the four triangles in a cell of 0.5 m: one side is an edge of the cell
    rows = f"element,side_12_m,side_23_m,side_31_m\n3,{0.5 * 0.98},{side * 0.98},{side * 0.98}\n"
    keys = 'patterns = "patterns.csv"'
    sheet = rectangle(2, 1.0, 1.0, keys=keys, more=held(*SIDES))
    core = solved(written(tmp_path, sheet, patterns_csv=rows))
    stress = core.get("membrane_stress_1")
    assert int(np.argmax(stress)) == 2  # the third is pulled, and pulls at what is around it


def test_a_cable_along_a_seam_has_the_tension_of_its_strain(tmp_path):
    cable = """[membranes.cables.leech]
group = "y_min"
axial_stiffness = 2e4
mass_per_length = 0.05
shortening = 1.0
"""
    soft = ISOTROPIC.replace("1e5", "1e-3")
    path = written(tmp_path, rectangle(fabric=soft, more=held("x_min", "x_max", "y_max") + cable))
    core = solved(path)
    assert core.solver.model.members.names == ("leech_1", "leech_2", "leech_3", "leech_4")
    assert core.get("tension") == pytest.approx(np.full(4, 2e4 * (1.0 / 0.99 - 1.0)), rel=1e-6)  # ends held, soft sheet
    assert scenes.load(path).members.mass.sum() == pytest.approx(0.05 * 2.0 * 0.99)


def test_cables_of_second_order_run_through_the_nodes_between(tmp_path):
    cable = "[membranes.cables.x_min]\naxial_stiffness = 1e3\n"
    members = scenes.load(written(tmp_path, rectangle(keys="order = 2", more=held("x_max", "y_min") + cable))).members
    ends = members.nodes[members.chains[0].nodes]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) == pytest.approx(np.full(8, 1.0 / 8))


def test_lines_hold_a_sheet_where_its_nodes_are_those_of_the_table(tmp_path):
    density = 0.5  # kg/m^2
    fabric = ISOTROPIC + f"density = {density}\n"
    nodes = "node,x_m,y_m,z_m,fixed\n"
    lines = "name,nodes,rest_length_m,diameter_m\n"
    for k, (x, y) in enumerate(((0, 0), (2, 0), (2, 1), (0, 1))):
        nodes += f"corner{k},{x},{y},0,\nhook{k},{2 * x - 1},{2 * y - 0.5},1,xyz\n"
        lines += f"line{k},corner{k} hook{k},1.4,0.002\n"
    structure = 'nodes = "nodes.csv"\nlines = "lines.csv"\nline_modulus = 1e9\ngravity = 10.0'
    path = written(tmp_path, rectangle(fabric=fabric), structure, nodes_csv=nodes, lines_csv=lines)
    core = solved(path)
    members = core.solver.model.members
    assert len(members.nodes) == 8 + (5 * 5 + 16 - 4)  # the corners are one with those of the table
    assert core.get("support_force") == pytest.approx([0.0, 0.0, -density * 2.0 * 10.0], abs=1e-9)  # the weight
    x, tension = core.get("position"), core.get("tension")
    upward = 0.0
    for pair, t in zip(members.chains[0].nodes, tension, strict=True):
        along = x[pair[1]] - x[pair[0]]
        upward += t * along[2] / np.linalg.norm(along)
    assert upward == pytest.approx(density * 2.0 * 10.0, rel=1e-8)  # the tolerance, 1e-9 of the loads
    assert np.all(core.get("membrane_stress_2") >= -1e-6)


def test_a_named_point_of_the_mesh_is_a_node_that_loads_may_name(tmp_path):
    loads = "load,node,x,y,z\npull,centre,0,0,1\n"
    structure = 'gravity = 0.0\nloads = "loads.csv"\n[structure.load_values]\npull = 10.0'
    disc = f'shape = "disc"\n[membranes.size]\nradius = 1.0\ncells = 4\n{ISOTROPIC}{held("rim")}'
    core = solved(written(tmp_path, disc, structure, loads_csv=loads))
    assert core.get("support_force") == pytest.approx([0.0, 0.0, 10.0], abs=1e-7)
    centre = core.solver.model.members.labels.index("centre")
    assert core.get("position")[:, 2].max() == core.get("position")[centre, 2] > 0.01  # m


SHAPES = {
    "rectangle": ("length = 2.0\nwidth = 1.0\ncells = 3\ncells_across = 2", "", 4 * 3 * 2),
    "disc": ("radius = 1.0\ncells = 3\nsectors = 8", 'share = "quarter"', 2 * 3**2),
    "airbag": ("edge = 1.0\ncells = 2", 'share = "whole"', 2 * 4 * 4 * 4),
    "cylinder": ("radius = 0.5\nlength = 2.0\ncells = 3\ncells_around = 12", "", 4 * 3 * 12 + 2 * 6 * 2**2),
    "sphere": ("radius = 1.0\ncells = 3", "", 8 * 3**2),
    "ruled": ("cells = 3\ncells_along = 2", 'profiles = "profiles.csv"', 4 * 3 * 2),
}
PROFILES = "profile,x_m,y_m,z_m\na,0,0,0\na,1,0,0.2\na,2,0,0\nb,0,1,0\nb,1,1,0\n"


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("order", [1, 2])
def test_every_shape_is_made_of_its_sizes(tmp_path, shape, order):
    size, keys, triangles = SHAPES[shape]
    toml = f'shape = "{shape}"\norder = {order}\n{keys}\n[membranes.size]\n{size}\n{ISOTROPIC}'
    group = {"rectangle": "sheet", "disc": "disc", "airbag": "seam", "cylinder": "start", "sphere": "sphere"}
    toml += held(group.get(shape, "gap_1"))
    scene = scenes.load(written(tmp_path, toml, profiles_csv=PROFILES))
    nodes = scene.members.membranes.group.nodes
    assert nodes.shape == (triangles, 3 * order)
    assert len(scene.interface.panels) == triangles * (1 if order == 1 else 4)
    assert np.array_equal(scene.interface.nodes, scene.members.nodes)  # all nodes are those of the interface


def test_a_setting_of_cells_keeps_the_proportions_of_the_mesh(tmp_path):
    setting = "[settings.cells]\ndefault = 4\nmaximum = 40\n"
    toml = rectangle(more=held("x_min", "x_max")).replace("cells = 4", "cells = 4\ncells_across = 2")
    path = written(tmp_path, toml)
    (path / "scene.toml").write_text(setting + (path / "scene.toml").read_text())
    counts = [len(scenes.load(path, {"cells": n}).members.membranes.group) for n in (4, 8, 10)]
    assert counts == [4 * 4 * 2, 4 * 8 * 4, 4 * 10 * 5]


@pytest.mark.parametrize(("ending", "order"), [("msh", 1), ("msh", 2), ("vtu", 1)])
def test_a_mesh_file_gives_what_the_same_shape_gives(tmp_path, ending, order):
    mesh = airbag(0.844, 2, "eighth", order=order)
    path = written(tmp_path, "")
    options = {"groups": True, "file_format": "gmsh22", "binary": False} if ending == "msh" else {}
    thousands = type(mesh)(1e3 * mesh.nodes, mesh.triangles, mesh.lines, mesh.triangle_parts, mesh.line_parts)
    mesh_file(path / f"bag.{ending}", thousands, **options)
    if ending == "vtu":  # which has no groups: read, and refused for what it lacks
        toml = f'mesh = "bag.vtu"\nunit = "mm"\n{ISOTROPIC}{held("seam")}'
        with pytest.raises(scenes.SceneError, match=r"bag.vtu has no group 'seam'; there are: none"):
            scenes.load(written(tmp_path, toml))
        return
    rest = (scenes.load("airbag").folder / "scene.toml").read_text()
    rest = rest[rest.index("[membranes.fabrics") :]
    core = solved(written(tmp_path, f'mesh = "bag.msh"\nunit = "mm"\norder = {order}\n{rest}'))
    same = solved("airbag", {"cells": 2, "order": order})
    for name in ("displacement", "membrane_stress_1"):
        assert core.get(name) == pytest.approx(same.get(name), rel=1e-6, abs=1e-8)  # the file has 16 digits of mm
    assert scenes.load(tmp_path / "sheet").files == ("scene.toml", "bag.msh")


def test_a_larger_sheet_of_the_same_fabric_is_geometrically_similar(tmp_path):
    setting = "[settings.scale]\ndefault = 1.0\nminimum = 0.5\nmaximum = 3.0\n"
    path = written(tmp_path, rectangle(more=held(*SIDES) + "[membranes.pressures.inside]\nvalue = 100.0\n"))
    (path / "scene.toml").write_text(setting + (path / "scene.toml").read_text())
    small, large = solved(path), solved(path, {"scale": 2.0}, inside=50.0)  # p a / (E h) is the same
    assert large.get("displacement") == pytest.approx(2.0 * small.get("displacement"), rel=1e-6, abs=1e-9)


def test_a_scene_without_membranes_loads_none_of_their_code():
    script = (
        "import sys, scenes\n"
        "from scenes import load\n"
        "for core in load('v3_kite').cores().values(): core.step(0.0, 1.0)\n"
        "words = 'membrane', 'solve.energy', 'triangles', 'curved_faces', 'meshio', 'builders.mesh', 'surfaces'\n"
        "print(*[m for m in sys.modules if m.startswith(('scenes', 'structural', 'meshio'))\n"
        "        and any(w in m for w in words)])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_membranes_bear_the_strips_of_a_wing_where_its_struts_are_nodes_of_theirs(tmp_path):
    """A plate of two triangles instead of six springs, as stiff in its plane, rises and twists as that does."""
    sheet = rectangle(1, 1.0, 1.0, 'diagonals = "one-way"', ISOTROPIC.replace("1e5", "1e8"))
    shapes = []
    for name, more in (("springs", None), ("membrane", f"\n[membranes]\n{sheet}")):
        folder = shutil.copytree(scenes.load("typical_section").folder, tmp_path / name)
        rows = [row.split(",") for row in (folder / "nodes.csv").read_text().strip().split("\n")]
        for row in rows[1:]:
            row[2] = repr(float(row[2]) + 0.5)  # the mesh begins at y = 0
            row[3] = repr(-1e-5 if row[0].startswith("ground") else 0.0)  # so that a place is that of one node
        (folder / "nodes.csv").write_text("\n".join(map(",".join, rows)) + "\n")
        toml = (folder / "scene.toml").read_text()
        if more is not None:
            (folder / "scene.toml").write_text(toml.replace('canopy = "canopy.csv"\n', "") + more)
        scene = scenes.load(folder, {"variant": "restoring"})
        pair = Coupling.in_process(scene, {"symmetric": 0.0})
        assert solve(pair, SCHEMES["iqn-ils"]()).status == "converged"
        shapes.append(pair.structural.get("displacement"))
        assert len(scene.interface.panels) == 4  # of the strips alone: membranes are no part of the interface here
    assert shapes[1] == pytest.approx(shapes[0], abs=1e-3 * np.abs(shapes[0]).max())  # neither is quite rigid


def test_membranes_stand_beside_tubes_rigid_links_pulleys_and_a_canopy(tmp_path):
    """A patch between three nodes of an inflatable wing, cut too short: its tension pulls these nodes together."""
    folder = shutil.copytree(scenes.load("v3_hanging_test").folder, tmp_path / "hung")
    settings = {"canopy_stations": 2}
    plain = scenes.load(folder, settings)
    corners = plain.members.wing.grid[[10, 11], 0].tolist() + plain.members.wing.grid[[10], 2].tolist()
    msh2(folder / "patch.msh", plain.members.nodes[corners], [(1, (1, 2, 3))])
    patch = f'mesh = "patch.msh"\n{ISOTROPIC}shortening_along = 5.0\nshortening_across = 5.0\n'
    (folder / "scene.toml").write_text((folder / "scene.toml").read_text() + f"\n[membranes]\n{patch}")
    patched = scenes.load(folder, settings)
    assert len(patched.members.nodes) == len(plain.members.nodes)  # all of them tied
    assert len(patched.interface.panels) == len(plain.interface.panels)  # of the canopy
    around = []
    for scene in (plain, patched):
        core = scene.structural_core()
        core.step(0.0, 1.0)
        x = core.get("position")[corners]
        around.append(np.linalg.norm(x - np.roll(x, 1, axis=0), axis=1).sum())
    assert around[1] < around[0] - 1e-3  # m
    assert core.get("membrane_stress_1")[0] > 100.0  # N/m
    assert core.get("residual") < 1e-6  # N
    weight = core.get("support_force")
    assert weight == pytest.approx([0.0, 0.0, abs(weight[2])], abs=1e-6)
