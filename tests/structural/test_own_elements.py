"""Families of elements and loads that a user might write, on the contracts alone: right answers, or a sentence."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from interface.vectors import spin
from scenes.cores.symmetry import symmetric_groups
from structural import (
    Assembly,
    Configuration,
    ElementGroup,
    FaceLoad,
    Faces,
    LineLoad,
    Lines,
    Loads,
    LoadSensitivity,
    Structure,
    equilibrium,
    interface_loads,
    mirror_permutation,
)
from structural.dynamics import GeneralisedAlpha, Motion, form_finding, integrate
from structural.elements.contract import translations
from structural.loads.contract import Load
from structural.loads.legs import Wind
from tests.structural.models import central_difference


@dataclass(frozen=True, eq=False)
class Cubic(ElementGroup):
    """Springs of tension k s^3: no stiffness at rest, and no method of the contract but those it must have."""

    nodes: np.ndarray
    l0: np.ndarray
    k: np.ndarray

    def forces(self, at):
        return self.forces_and_tangents(at)[0]

    def forces_and_tangents(self, at):
        d = at.x[self.nodes[:, 1]] - at.x[self.nodes[:, 0]]
        length = np.linalg.norm(d, axis=1)
        u, s = d / length[:, None], length - self.l0
        along = u[:, :, None] * u[:, None, :]
        block = self._slope(s)[:, None, None] * along
        block = block + (self._tension(s) / length)[:, None, None] * (np.eye(3) - along)
        pull = self._tension(s)[:, None] * u
        return np.concatenate([-pull, pull], axis=1), np.block([[block, -block], [-block, block]])

    def _tension(self, s):
        return self.k * s**3

    def _slope(self, s):
        return 3.0 * self.k * s**2


class Linear(Cubic):
    """Springs of tension k s."""

    def _tension(self, s):
        return self.k * s

    def _slope(self, s):
        return self.k


@dataclass(frozen=True, eq=False)
class Torsion(ElementGroup):
    """Springs from nodal `rotations` (e,) to the ground with the moment k w, w the rotation vector."""

    nodes: np.ndarray
    rotations: np.ndarray
    k: np.ndarray

    def dofs(self, node_count):
        return translations(node_count + self.rotations[:, None])

    def forces(self, at):
        return self.forces_and_tangents(at)[0]

    def forces_and_tangents(self, at):
        moments, tangents = [], []
        for r, k in zip(at.rotations[self.rotations], self.k, strict=True):
            angle = np.arccos(np.clip(0.5 * (np.trace(r) - 1.0), -1.0, 1.0))
            half = 0.5 * angle / np.sin(angle) if angle > 1e-9 else 0.5
            w = half * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
            moments.append(k * w)
            b = 1.0 / 12.0 if angle < 1e-4 else (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
            tangents.append(k * (np.eye(3) + b * spin(w) @ spin(w)))  # dw/dspin without its skew part - [w]x / 2
        return np.array(moments), np.array(tangents)

    def properties(self):
        return {"stiffness": self.k}


def spring(kind, k, start, l0=1.0):
    """One spring between a held node and one that may move, the second at `start` m below the first."""
    nodes = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -start]])
    group = kind(np.array([[0, 1]]), np.array([l0]), np.array([k]))
    return Structure(nodes, np.array([[True] * 3, [False] * 3]), (group,))


def weight(newtons):
    return Loads(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -newtons]]))


@pytest.mark.parametrize("start", [0.7, 1.0, 1.3])
def test_springs_without_stiffness_at_rest_are_found_from_rest(start):
    s = spring(Cubic, 1000.0, start)
    found = equilibrium(Assembly(s), weight(8.0), s.nodes, atol=1e-9)
    assert found.status == "converged"
    assert found.x[1, 2] == pytest.approx(-1.2, abs=1e-9 / 120.0)  # the tolerance over 3 k s^2


def test_nothing_that_holds_a_loaded_node_is_a_status():
    s = Structure(np.zeros((1, 3)), np.zeros((1, 3), bool))
    found = equilibrium(Assembly(s), Loads(np.array([[0.0, 0.0, -1.0]])), s.nodes, max_iterations=30)
    assert found.status != "converged"
    assert np.isfinite(found.x).all()


def test_sensitivity_where_nothing_is_stiff_and_nothing_changes_is_zero():
    s = spring(Cubic, 1000.0, 1.0)
    along = LoadSensitivity(Assembly(s), weight(0.0), s.nodes)
    assert not along(weight(0.0)).any()


def test_springs_so_stiff_that_rounding_leaves_more_than_the_tolerance_converge():
    s = spring(Linear, 1e11, 10.0, l0=10.0)
    turned = np.array([0.6, 0.0, 0.8])
    found = equilibrium(Assembly(s), Loads(np.array([[0.0] * 3, -1e3 * turned])), s.nodes, atol=1e-9)
    assert found.status == "converged"
    assert found.x[1] == pytest.approx(-turned * (10.0 + 1e-8), abs=1e-9)


def test_springs_so_stiff_that_rounding_leaves_more_than_the_tolerance_move():
    x = np.array([[1000.0, 0.0, 0.0], [1001.0, 0.0, 0.0]])
    group = Linear(np.array([[0, 1]]), np.array([1.0]), np.array([1e9]))
    s = Structure(x, np.array([[True] * 3, [False] * 3]), (group,))
    motion = Motion(Assembly(s), np.ones(2), weight(9.81))
    run = integrate(motion, motion.at(x), 0.02, GeneralisedAlpha(), step=1e-3)
    assert run.finished
    assert motion.positions(run.state.q)[1, 2] == pytest.approx(-0.5 * 9.81 * 0.02**2, rel=0.01)


def test_form_finding_takes_a_net_of_own_springs():
    s = spring(Linear, 100.0, 1.0)
    for method in ("equilibrium", "viscous"):
        form = form_finding(Assembly(s), weight(10.0), s.nodes, method)
        assert form.status == "converged"
        assert form.x[1, 2] == pytest.approx(-1.1, abs=1e-4)


def test_a_family_without_energy_is_named():
    s = spring(Cubic, 1000.0, 1.1)
    with pytest.raises(ValueError, match="Cubic have no energy"):
        Assembly(s).energy(s.reference, s.groups)


# Rotations


def hinged(order=("la", "lb", "rc", "rd"), k=None):
    """Torsion springs on the rotations of two nodes and their mirror images, two hinged to each, in some `order`."""
    k = {"la": 10.0, "lb": 20.0, "rc": 10.0, "rd": 20.0} if k is None else k
    nodes = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    rotation_nodes = np.array([0, 0, 1, 1])
    of = {"la": (0, 0), "lb": (0, 1), "rc": (1, 2), "rd": (1, 3)}
    at, turns = np.array([of[name][0] for name in order]), np.array([of[name][1] for name in order])
    springs = Torsion(at[:, None], turns, np.array([k[name] for name in order]))
    free = np.zeros((4, 3), bool)
    return Structure(nodes, np.ones((2, 3), bool), (springs,), rotation_nodes=rotation_nodes, fixed_rotations=free)


def turns(rotations):
    return np.array([np.arctan2(r[0, 2], r[0, 0]) for r in rotations])


def test_tangent_of_a_torsion_spring_is_consistent_under_an_applied_moment():
    s = hinged()
    moment = np.array([[0.3, 2.0, 0.5], [0.0, 4.0, -1.0], [0.1, 2.0, 0.2], [1.0, 4.0, 0.0]])
    loads = Loads(np.zeros((2, 3)), moment=moment)
    assembly = Assembly(s)
    found = equilibrium(assembly, loads, s.nodes, atol=1e-10)
    assert found.converged
    prepared, q = assembly.prepare(loads), np.zeros(assembly.unknowns.count)
    tangent = assembly.residual_and_tangent(q, prepared, found.rotations)[1].toarray()

    def residual(step):
        at, rotations = assembly.moved(q, found.rotations, step)
        return assembly.residual(at, prepared, rotations)[0]

    np.testing.assert_allclose(tangent, central_difference(residual, q), atol=1e-6)


@pytest.mark.parametrize("order", [("la", "lb", "rc", "rd"), ("la", "rd", "rc", "lb"), ("rd", "la", "lb", "rc")])
def test_a_half_pairs_the_springs_of_nodal_rotations_and_not_of_nodes_alone(order):
    s = hinged(order)
    mirror = mirror_permutation(s.nodes)
    loads = Loads(np.zeros((2, 3)), moment=np.array([[0.0, m, 0.0] for m in (4.0, 4.0, 4.0, 4.0)]))
    assert symmetric_groups(s.groups, mirror, s.rotation_nodes)
    whole, half = (equilibrium(Assembly(s, m), loads, s.nodes, atol=1e-10) for m in (None, mirror))
    assert whole.converged
    assert half.converged
    assert turns(whole.rotations) == pytest.approx([0.4, 0.2, 0.4, 0.2], abs=1e-9)
    assert turns(half.rotations) == pytest.approx(turns(whole.rotations), abs=1e-9)


def test_unlike_springs_on_alike_nodes_are_no_symmetric_structure():
    s = hinged(k={"la": 10.0, "lb": 20.0, "rc": 20.0, "rd": 10.0})
    assert not symmetric_groups(s.groups, mirror_permutation(s.nodes), s.rotation_nodes)


# Halves


def two_springs(stiffness):
    nodes = np.array([[0.0, -1.0, 1.0], [0.0, -1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 0.0]])
    group = Linear(np.array([[0, 1], [2, 3]]), np.ones(2), np.array(stiffness))
    return Structure(nodes, np.repeat([[True], [False], [True], [False]], 3, axis=1), (group,))


def test_without_a_word_of_the_family_unlike_halves_are_not_symmetric():
    mirror = mirror_permutation(two_springs([100.0, 100.0]).nodes)
    none = np.zeros(0, int)
    assert symmetric_groups(two_springs([100.0, 100.0]).groups, mirror, none)
    assert not symmetric_groups(two_springs([100.0, 300.0]).groups, mirror, none)


def test_an_element_without_image_is_named():
    s = two_springs([100.0, 100.0])
    lone = Structure(s.nodes, s.fixed, (Linear(np.array([[0, 1]]), np.ones(1), np.ones(1)),))
    with pytest.raises(ValueError, match="number 1 of Linear has no mirror image"):
        Assembly(lone, mirror_permutation(s.nodes))


@dataclass(frozen=True, eq=False)
class Fancy(Linear):
    """With what is no array of a row an element."""

    direction: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    coefficients: tuple[float, ...] = (1.0, 0.5)
    total: float = field(init=False, default=0.0)


def test_selected_elements_keep_what_holds_for_all():
    group = Fancy(np.array([[0, 1], [2, 3]]), np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    one = group.select(np.array([1]))
    assert (len(one), one.l0.tolist(), one.k.tolist()) == (1, [2.0], [4.0])
    assert (one.direction.tolist(), one.coefficients) == ([0.0, 0.0, 1.0], (1.0, 0.5))


# Loads


def loaded():
    """A square of two triangles, and its edge as a line."""
    nodes = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    groups = {"skin": Faces(np.array([[0, 1, 2], [0, 2, 3]])), "edge": Lines(np.array([[0, 1]]))}
    return Structure(nodes, np.zeros((4, 3), bool), (), groups)


@pytest.mark.parametrize(
    ("on", "sentence"),
    [
        ({"skin": FaceLoad(np.ones(3))}, "'skin' has 2 elements; pressure has values for 3"),
        ({"skin": FaceLoad(np.ones(2), np.ones((1, 3)))}, "'skin' has 2 elements; shear has values for 1"),
        ({"skin": LineLoad(np.ones((2, 3)))}, "'skin' takes a FaceLoad, not a LineLoad"),
        ({"hull": FaceLoad(np.ones(2))}, "no load group 'hull'; it has: skin, edge"),
    ],
)
def test_loads_that_do_not_fit_are_refused(on, sentence):
    s = loaded()
    with pytest.raises(ValueError, match=sentence):
        Assembly(s).prepare(Loads(np.zeros((4, 3)), on))


def test_too_few_groups_are_refused():
    s = spring(Linear, 1.0, 1.0)
    with pytest.raises(ValueError, match="has 1 groups of elements; 0 are given"):
        Assembly(s).prepare(weight(1.0), ())


def test_shear_alone_is_a_load():
    on = interface_loads(shear=np.array([[0.0, 0.0, 20.0]]))
    assert on["panels"].pressure.tolist() == [0.0]
    assert interface_loads() == interface_loads(np.zeros(0), None, np.zeros((0, 3))) == {}


@dataclass(frozen=True, eq=False)
class Everywhere(Load):
    """A number for all elements."""

    level: float
    kind: str = "a"
    extra: np.ndarray | None = None


def test_loads_go_linearly_from_one_to_the_other():
    first, second = Everywhere(100.0), Everywhere(300.0, "b", np.array([2.0]))
    between = first.between(second, 0.5)
    assert (between.level, between.kind, between.extra.tolist()) == (200.0, "b", [1.0])
    back = second.between(first, 0.25)
    assert (back.level, back.kind, back.extra.tolist()) == (250.0, "a", [1.5])
    wind = Wind(np.array([8.0, 0.0, 0.0])).between(Wind(np.array([0.0, 8.0, 0.0]), normal_drag=2.0), 0.5)
    assert wind.velocity.tolist() == [4.0, 4.0, 0.0]
    assert wind.select(np.array([0])).velocity.tolist() == [4.0, 4.0, 0.0]


def test_stiffness_without_a_word_of_the_family_is_that_of_its_tangent():
    s = spring(Linear, 100.0, 1.0)
    assert s.groups[0].stiffness(Configuration(s.nodes)) == pytest.approx([100.0])
    h = hinged()
    assert not h.groups[0].stiffness(h.reference).any()  # of moments there is no N/m
