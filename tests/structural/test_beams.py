"""Co-rotational beams: gradients, objectivity, assemblies with rigid links, hinges, and the solver that they meet."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from benchmarks.cantilevers import cantilever, straight, tip_loaded
from interface.vectors import rotation, spin, turned
from structural import (
    Assembly,
    Beams,
    LinearSection,
    Loads,
    Structure,
    breukels_tube,
    collapse_deflection,
    equilibrium,
    natural_deformations,
    reference_axes,
    section_forces,
    tip_load,
)
from structural.elements.beams import SERIES_ABOVE, _stretch, beam_forces, beam_forces_and_tangents
from tests.structural.beam_models import frame, mirror_of_frame
from tests.structural.models import TANGENT_TOLERANCE, central_difference

ENDS = np.array([[0, 1]])


def _beam(section, seed=0):
    """One skew beam of about 1.5 m, its nodes, and a deformed state with end rotations of up to a radian."""
    rng = np.random.default_rng(seed)
    nodes = np.array([[0.3, -0.2, 0.1], [1.4, 0.5, 0.9]])
    beam = Beams(ENDS, ENDS, reference_axes(nodes, ENDS), np.linalg.norm(nodes[1:] - nodes[:1], axis=1), section)
    x = nodes + 0.15 * rng.normal(size=(2, 3))
    return beam, nodes, x, rotation(0.4 * rng.normal(size=(2, 3)))


def _stepped(x, rotations, step):
    """Positions and rotations after a step (12,) of (x_1, spin_1, x_2, spin_2)."""
    move = step.reshape(2, 2, 3)
    return x + move[:, 0], turned(rotations, move[:, 1])


@dataclass(frozen=True)
class OneForce:
    """A section whose forces are constant, one in a single natural deformation: its nodal forces are the gradient."""

    row: int

    def response(self, natural, l0):
        force = np.zeros_like(natural)
        force[:, self.row] = 1.0
        return force, np.zeros((len(l0), 6, 6))


ANISOTROPIC = LinearSection.of(1, 100.0, 3.0, 2.0, kGA=50.0, EI_b=5.0)


@pytest.mark.parametrize("row", range(6), ids=["u", "theta_n1", "theta_b1", "theta_n2", "theta_b2", "phi"])
@pytest.mark.parametrize("seed", range(3))
def test_nodal_forces_of_a_unit_section_force_are_the_gradient_of_its_natural_deformation(row, seed):
    beam, _, x, rotations = _beam(OneForce(row), seed)
    slope = central_difference(lambda d: natural_deformations(*_stepped(x, rotations, d), beam)[:, row], np.zeros(12))
    # rounding eps / h of rotations of order one; truncation h^2 is far below it
    assert beam_forces(x, rotations, beam)[0] == pytest.approx(slope[0], abs=1e-9)


@pytest.mark.parametrize("section", [ANISOTROPIC, *map(OneForce, range(6))], ids=["linear", *"123456"])
@pytest.mark.parametrize("seed", range(3))
def test_tangent_is_the_symmetric_part_and_half_the_spin_of_the_node_moments_the_skew_part(section, seed):
    beam, _, x, rotations = _beam(section, seed)
    force, tangent = beam_forces_and_tangents(x, rotations, beam)
    slope = central_difference(lambda d: beam_forces(*_stepped(x, rotations, d), beam), np.zeros(12))
    scale = TANGENT_TOLERANCE * np.abs(slope).max()
    assert tangent[0] == pytest.approx(0.5 * (slope + slope.T), abs=scale)
    skew = np.zeros((12, 12))
    for k in (3, 9):
        skew[k : k + 3, k : k + 3] = -0.5 * spin(force[0, k : k + 3])
    assert 0.5 * (slope - slope.T) == pytest.approx(skew, abs=scale)
    assert np.abs(skew).max() > 100.0 * scale or isinstance(section, OneForce)  # there is a moment to be seen


@pytest.mark.parametrize("angle", [0.5, 0.5 * np.pi, np.pi, 4.0, 2.0 * np.pi, 7.5, 25.0])
def test_a_rigid_motion_by_any_angle_about_any_axis_gives_no_force(angle):
    rng = np.random.default_rng(int(10 * angle))
    for axis in (*np.eye(3), *rng.normal(size=(4, 3))):
        beam, nodes, _, _ = _beam(ANISOTROPIC)
        turn = rotation(angle * axis / np.linalg.norm(axis))
        x = nodes @ turn.T + rng.normal(size=3)
        force = beam_forces(x, np.broadcast_to(turn, (2, 3, 3)), beam)
        # asked for: 1e-10 of EA; found is the rounding of the length and of the angles, some 1e-14
        assert np.abs(force).max() <= 1e-10 * 100.0


def test_a_rigid_motion_on_top_leaves_natural_deformations_and_turns_the_forces():
    rng = np.random.default_rng(5)
    for seed in range(5):
        beam, _, x, rotations = _beam(ANISOTROPIC, seed)
        turn = rotation(rng.normal(scale=3.0, size=3))
        moved = x @ turn.T + rng.normal(size=3), turn @ rotations
        before = natural_deformations(x, rotations, beam)
        assert natural_deformations(*moved, beam) == pytest.approx(before, abs=1e-13)  # rounding of unit vectors
        force = beam_forces(x, rotations, beam).reshape(4, 3)
        assert beam_forces(*moved, beam).reshape(4, 3) == pytest.approx(force @ turn.T, abs=1e-11)  # of 100 N


def test_forces_of_a_beam_are_in_balance_and_so_are_their_moments():
    for seed in range(5):
        beam, _, x, rotations = _beam(ANISOTROPIC, seed)
        f1, m1, f2, m2 = beam_forces(x, rotations, beam).reshape(4, 3)
        assert f1 + f2 == pytest.approx(np.zeros(3), abs=1e-12)  # rounding of forces of 10 N
        assert m1 + m2 + np.cross(x[1] - x[0], f2) == pytest.approx(np.zeros(3), abs=1e-12)


def test_natural_deformations_of_one_end_turned_about_the_sections_own_axes_are_the_angles():
    beam, nodes, _, _ = _beam(ANISOTROPIC)
    for angle in (-3.0, -1.0, 0.2, 1.5, 3.0):  # any angle below pi
        for axis, row in ((0, 5), (1, 3), (2, 4)):
            turns = np.stack([np.eye(3), rotation(angle * beam.axes[0, :, axis])])
            expected = np.zeros(6)
            expected[row] = angle
            # arccos loses digits at 3 rad: eps / sin(3)
            assert natural_deformations(nodes, turns, beam)[0] == pytest.approx(expected, abs=1e-14 / np.sin(3.0))


def test_series_and_closed_form_of_angle_over_sine_agree_where_they_meet():
    s = np.linspace(SERIES_ABOVE - 0.05, SERIES_ABOVE + 0.05, 41)
    sine2 = 1.0 - s * s
    g = np.arccos(s) / np.sqrt(sine2)
    g1 = (s * g - 1.0) / sine2
    closed = g, g1, (g + 3.0 * s * g1) / sine2
    for found, expected in zip(_stretch(s), closed, strict=True):
        # the closed forms divide differences of numbers of order one by sine^2 = 0.1, the last one twice: 1e-13
        assert found == pytest.approx(expected, abs=1e-12)
    # without any angle: g = 1 + e / 3 + 2 e^2 / 15 with e = 1 - s
    assert [float(v[0]) for v in _stretch(np.ones(1))] == pytest.approx([1.0, -1.0 / 3.0, 4.0 / 15.0], abs=1e-15)


def _wobbled(assembly, rng, size):
    """Random unknowns and rotations about the reference configuration of a structure, m and rad."""
    q = assembly.unknowns.restrict(assembly.structure.nodes)
    return assembly.moved(q, assembly.start(), rng.normal(scale=size, size=len(q)))


@pytest.mark.parametrize("symmetric", [False, True], ids=["full", "half"])
def test_tangent_of_a_frame_with_rigid_links_and_all_loads_is_the_gradient_but_for_spins_of_moments_out_of_balance(
    symmetric,
):
    s, loads = frame()
    assembly = Assembly(s, mirror_of_frame() if symmetric else None)
    prepared = assembly.prepare(loads)
    rng = np.random.default_rng(7)
    for _ in range(4):
        q, rotations = _wobbled(assembly, rng, 0.05)
        r, k, _ = assembly.residual_and_tangent(q, prepared, rotations)
        same, _ = assembly.residual(q, prepared, rotations)
        assert r == pytest.approx(same, abs=1e-9)  # the same sums in another order, forces of 1e4 N

        def stepped(d, q=q, rotations=rotations):
            new, turns = assembly.moved(q, rotations, d)
            return assembly.residual(new, prepared, turns)[0]

        slope = central_difference(stepped, np.zeros(len(q)))
        skew = np.zeros_like(slope)
        u = assembly.unknowns
        for dofs in np.split(3 * len(s.nodes) + np.arange(3 * len(s.rotation_nodes)), len(s.rotation_nodes)):
            index, sign = u.index[dofs], u.sign[dofs]
            keep = np.flatnonzero((index >= 0) & (u.first[index] == dofs))  # not the images of others
            moment = np.zeros(3)
            moment[keep] = r[index[keep]]
            skew[np.ix_(index[keep], index[keep])] = -0.5 * spin(moment)[np.ix_(keep, keep)]
            assert np.all(sign[keep] == 1.0)
        assert np.abs(skew).max() > 1.0  # N m: moments are out of balance here
        # rounding of lengths makes residuals of beams with EA = 3e4 N and more uncertain by eps EA / h, 1e-5 N / m
        assert k.toarray() + skew == pytest.approx(slope, abs=TANGENT_TOLERANCE * np.abs(slope).max())


def test_tangent_in_equilibrium_under_moments_is_the_gradient_of_the_residual():
    s, loads = frame()
    assembly = Assembly(s)
    found = equilibrium(assembly, loads, s.nodes, atol=1e-9)
    prepared = assembly.prepare(loads)
    q = assembly.unknowns.restrict(found.x)
    _, k, _ = assembly.residual_and_tangent(q, prepared, found.rotations)
    slope = central_difference(
        lambda d: assembly.residual(*_arguments(assembly.moved(q, found.rotations, d), prepared))[0], np.zeros(len(q))
    )
    assert found.converged
    assert k.toarray() == pytest.approx(slope, abs=TANGENT_TOLERANCE * np.abs(slope).max())
    rotational = assembly.unknowns.rotational
    skew = (k - k.T).toarray()[np.ix_(rotational, rotational)]
    assert np.abs(skew).max() > 0.5  # applied moments of some N m have no energy about fixed axes


def _arguments(at, prepared):
    q, rotations = at
    return q, prepared, rotations


def test_half_of_a_mirrored_frame_with_rigid_links_has_the_solution_of_the_whole():
    s, loads = frame()
    mirror = mirror_of_frame()
    whole, half = (equilibrium(Assembly(s, m), loads, s.nodes, atol=1e-9) for m in (None, mirror))
    assert whole.converged
    assert half.converged
    assert np.abs(whole.x - s.nodes).max() > 0.1  # m
    # residuals of 1e-9 N on stiffnesses of 10 N/m and more
    assert half.x == pytest.approx(whole.x, abs=1e-9)
    assert half.rotations == pytest.approx(whole.rotations, abs=1e-9)
    assert half.x[mirror] * [1, -1, 1] == pytest.approx(half.x, abs=1e-15)  # a copy


def test_dependent_nodes_stay_where_they_are_in_the_frame_of_their_reference_node():
    s, loads = frame()
    found = equilibrium(Assembly(s), loads, s.nodes, atol=1e-9)
    at = found.x[s.reference_nodes]
    arms = np.einsum("kij,kj->ki", found.rotations[s.link_rotations], s.arms)
    assert found.x[s.dependent_nodes] == pytest.approx(at + arms, abs=1e-14)  # rounding
    assert np.abs(arms - s.arms).max() > 0.01  # m: they have turned


def _elastica():
    return cantilever(straight(8), LinearSection.of(8, 1e5, 1.0, 1.0)), {"force": (0.0, 10.0, 0.0)}


def _rolled():
    return cantilever(straight(8), LinearSection.of(8, 1e5, 1.0, 1.0)), {"moment": (0.0, 0.0, 4.0), "steps": 4}


def _bent_and_twisted():
    s = cantilever(straight(8), LinearSection.of(8, 1e4, 1.0, 0.7), across=(0.0, 1.0, 0.0))
    return s, {"force": (0.3, 2.0, 1.5), "moment": (0.3, 0.5, -0.5), "steps": 4}


def _nearly_collapsed():
    p, r = 0.3e5, 0.1
    load = tip_load(p, r, 0.97 * collapse_deflection(p, r))
    return cantilever(straight(8), breukels_tube(p, np.full(8, r))), {"force": (0.0, load, 0.0)}


def _loaded_frame():
    s, loads = frame()
    found = equilibrium(Assembly(s), loads, s.nodes, atol=1e-9)
    return Assembly(s), s.groups, loads, found


def _loaded_cantilever(case):
    s, how = case()
    found = tip_loaded(s, atol=1e-9, **how)
    dead, moment = np.zeros_like(s.nodes), np.zeros((len(s.rotation_nodes), 3))
    dead[-1], moment[-1] = how.get("force", 0.0), how.get("moment", 0.0)
    return Assembly(s), s.groups, Loads(dead, moment=moment), found


PROBLEMS = {
    "elastica": lambda: _loaded_cantilever(_elastica),
    "rolled by a moment": lambda: _loaded_cantilever(_rolled),
    "bent and twisted": lambda: _loaded_cantilever(_bent_and_twisted),
    "tube near collapse": lambda: _loaded_cantilever(_nearly_collapsed),
    "frame with rigid links": _loaded_frame,
}


def _newton(assembly, prepared, at):
    """Unknowns and rotations after one plain Newton step."""
    r, k, _ = assembly.residual_and_tangent(at[0], prepared, at[1])
    return assembly.moved(*at, np.linalg.solve(k.toarray(), -r))


@pytest.mark.parametrize("problem", PROBLEMS)
def test_a_newton_step_from_near_the_solution_squares_the_distance_to_it(problem):
    assembly, groups, loads, found = PROBLEMS[problem]()
    assert found.converged
    prepared = assembly.prepare(loads, groups)
    at = assembly.unknowns.restrict(found.x), found.rotations
    for _ in range(2):
        at = _newton(assembly, prepared, at)  # to rounding
    # along soft directions: the residual of others is rounding of axial forces before it is anything else
    _, k, _ = assembly.residual_and_tangent(at[0], prepared, at[1])
    direction = np.linalg.solve(k.toarray(), np.random.default_rng(3).normal(size=len(at[0])))
    direction /= np.abs(direction).max()
    translational = ~assembly.unknowns.rotational
    left = []
    for size in (3e-4, 1e-4):  # m and rad
        q, rotations = _newton(assembly, prepared, assembly.moved(*at, size * direction))
        left.append(max(np.abs(q - at[0])[translational].max(), np.abs(rotations - at[1]).max()))
    # 2 or, where the quadratic terms of these directions are stiff ones, more: found are 2.0 to 3.2
    assert np.log(left[0] / left[1]) / np.log(3.0) >= 1.9
    assert left[1] <= 1e-6  # and the constant is of order one, for tubes near collapse some tens


@pytest.mark.parametrize("problem", PROBLEMS)
def test_the_answer_depends_neither_on_the_start_nor_on_the_length_of_steps(problem):
    assembly, groups, loads, found = PROBLEMS[problem]()
    rng = np.random.default_rng(11)
    q = assembly.unknowns.restrict(found.x)
    q, rotations = assembly.moved(q, found.rotations, rng.normal(scale=0.01, size=len(q)))  # m and rad
    x = assembly.positions(q, rotations)
    for limit in (1.0, 0.02):
        other = equilibrium(assembly, loads, x, atol=1e-10, step_limit=limit, rotations=rotations, groups=groups)
        assert other.converged
        # residuals of 1e-9 N at most (rounding of axial forces) on tip stiffnesses of a few N/m and more
        assert other.x == pytest.approx(found.x, abs=1e-9)
        assert other.rotations == pytest.approx(found.rotations, abs=1e-9)


def _two_halves(hinged, force):
    """Two beams of 1 m (four elements each) between clamped ends, a force across at the node where they meet."""
    n = 9
    nodes = straight(8, 2.0)
    ends = np.stack([np.arange(8), np.arange(1, 9)], axis=1)
    rotation_nodes = np.append(np.arange(n), 4) if hinged else np.arange(n)  # the middle node has one for each beam
    of_end = ends.copy()
    if hinged:
        of_end[4, 0] = n
    beams = Beams(ends, of_end, reference_axes(nodes, ends), np.full(8, 0.25), LinearSection.of(8, 1e3, 1.0, 1.0))
    fixed = np.zeros((n, 3), dtype=bool)
    fixed[[0, 8]] = True
    s = Structure(nodes, fixed, (beams,), rotation_nodes=rotation_nodes, fixed_rotations=fixed[rotation_nodes])
    dead = np.zeros_like(nodes)
    dead[4, 1] = force
    return s, equilibrium(Assembly(s), Loads(dead), nodes, atol=1e-11)


def test_beams_that_meet_in_a_hinge_carry_no_moment_through_it():
    force = 1e-3
    s, found = _two_halves(True, force)
    assert found.converged
    # either half is a cantilever of 1 m under half the force: F / 2 / 3 EI. The rope effect, of order EA w^2 / EI,
    # adds w = 1.7e-4, 3e-5 of it
    assert found.x[4, 1] == pytest.approx(force / 6.0, rel=1e-4)
    forces = section_forces(found.x, found.rotations, s.groups[0])
    # no moment on either side of the hinge, but for what the solve leaves, 1e-11 N m
    assert np.abs(np.concatenate([forces[3, 3:5], forces[4, 1:3]])).max() <= 1e-7 * force
    assert abs(forces[0, 2]) == pytest.approx(0.5 * force, rel=1e-4)  # the root has the whole of it, F / 2 times 1 m
    slope = [np.arctan2(found.rotations[k, 1, 0], found.rotations[k, 0, 0]) for k in (4, 9)]
    assert slope == pytest.approx([0.25 * force, -0.25 * force], rel=1e-4)  # F / 2 times L^2 / 2 EI: a kink


def test_beams_that_share_a_nodal_rotation_carry_the_moment():
    force = 1e-3
    _, found = _two_halves(False, force)
    assert found.x[4, 1] == pytest.approx(force * 8.0 / 192.0, rel=1e-4)  # F L^3 / 192 EI, clamped at both ends


def test_a_rigid_link_transfers_the_force_to_the_reference_node_with_the_moment_of_its_turned_arm():
    n = 4
    nodes = np.concatenate([straight(n), [[1.0, 0.0, 0.3]]])
    base = cantilever(straight(n), LinearSection.of(n, 1e4, 1.0, 1.0))
    s = replace(
        base,
        nodes=nodes,
        fixed=np.concatenate([base.fixed, np.zeros((1, 3), dtype=bool)]),
        dependent_nodes=np.array([n + 1]),
        link_rotations=np.array([n]),
    )
    force = np.array([0.2, 0.8, -0.4])
    dead = np.zeros_like(nodes)
    dead[-1] = force
    found = equilibrium(Assembly(s), Loads(dead), nodes, atol=1e-10)
    assert found.converged
    arm = found.rotations[n] @ np.array([0.0, 0.0, 0.3])
    same = tip_loaded(base, force, np.cross(arm, force), atol=1e-10, steps=4)
    assert same.x == pytest.approx(found.x[:-1], abs=1e-9)  # residuals of 1e-10 N on a tip stiffness of a few N/m
    assert same.rotations == pytest.approx(found.rotations, abs=1e-9)
