"""Directional derivatives of both solver cores against differences of their own steps, and that asking changes nothing.

Differences are central and of fourth order, (8 (f(1) - f(-1)) - (f(2) - f(-2))) / 12, from one saved state each.
"""

from dataclasses import is_dataclass

import numpy as np
import pytest

import scenes
from aero.vortex_step import WingSensitivity
from interface import StepFailed
from master import IQNILS
from master.coupling import Coupling, InProcessParticipant, solve
from structural import mirror_permutation

FLIP = np.array([1.0, -1.0, 1.0])
LOADS = ("pressure", "shear", "line_load")
COARSE = {"canopy_stations": 2}  # a first solve takes a second instead of some
TURN = {"hold_roll_and_yaw": 1.0, "steering_tape_left_length": 1.4, "steering_tape_right_length": 1.8}
# Scene, settings, parameters, and the structural solver_tolerance N and load step (relative to the largest load) of the
# differences: an error of the tolerance must be small beside the step, which takes a larger one with the small loads of
# the typical section, where rounding alone leaves 1e-7 N.
CASES = {
    "kite": ("v3_kite", {}, {}, 1e-9, 1e-4),
    "no line drag": ("v3_kite", {"line_drag": "off"}, {}, 1e-9, 1e-4),
    "four strips a bay": ("v3_kite", {"panels_per_section": 4}, {}, 1e-9, 1e-4),
    "whole": ("v3_kite", {}, {"symmetric": 0.0}, 1e-9, 1e-4),
    "slack lines": ("v3_kite", {}, {"wind_speed": 8.0}, 1e-9, 1e-4),
    "depowered": ("v3_kite", {}, {"power_tape_length": 3.0, "wind_speed": 20.0}, 1e-9, 1e-4),
    "design chords": ("v3_kite", {"chord": "design"}, {}, 1e-9, 1e-4),
    "section": ("typical_section", {}, {}, 1e-9, 1e-2),
    "inflatable": ("v3_kite_detailed", COARSE, {}, 1e-7, 1e-4),
    "held turn": ("v3_kite_detailed", COARSE, TURN, 1e-7, 1e-5),
}
# What the differences themselves leave: noise of the solves, 1e-12 of the circulation and `solver_tolerance`, over the
# steps, and truncation. Found are 1e-9 at most; 4e-9 for the held turn, whose solver ends in linear convergence,
# since its tangent does without the moment of the hold (1e-7 is then possible).
BOUND = 1e-6


def flown(name, settings, parameters, tolerance):
    """Both participants at the coupled equilibrium, solved to the tolerance N once more."""
    coupling = Coupling.in_process(scenes.load(name, settings), parameters)
    assert solve(coupling, IQNILS()).status == "converged"
    coupling.structural.set("solver_tolerance", tolerance)
    coupling(coupling.structural.get("displacement"))
    return coupling


@pytest.fixture(scope="module")
def equilibria():
    """Case -> coupled equilibrium, each solved once; tests put the states back."""
    found = {}

    def of(case):
        if case not in found:
            coupling = flown(*CASES[case][:4])
            found[case] = coupling, coupling.structural.save(), coupling.aero.save()
        coupling, structure, air = found[case]
        coupling.structural.restore(structure)
        coupling.aero.restore(air)
        return coupling

    return of


def inputs(participant):
    return [b for b, c in participant.causality.items() if c == "input"]


def outputs(participant):
    return [b for b in ("displacement", *LOADS) if participant.causality.get(b) == "output"]


def symmetric_part(v, image):
    return 0.5 * (v + v[image] * (FLIP if v.ndim == 2 else 1.0))


def images(interface):
    """Mirror image of every row of each interface block."""
    nodes = mirror_permutation(interface.nodes)

    def rows(elements):
        place = {frozenset(e): i for i, e in enumerate(elements.tolist())}
        return np.array([place[frozenset(nodes[e].tolist())] for e in elements], dtype=int)

    panels = rows(interface.panels)
    return {"displacement": nodes, "pressure": panels, "shear": panels, "line_load": rows(interface.lines)}


def random_directions(participant, seed, scale=None):
    """A random direction of each input, of the size of its largest value, or of `scale`."""
    rng = np.random.default_rng(seed)
    sizes = {b: np.abs(participant.get(b)).max() if scale is None else scale for b in inputs(participant)}
    return {b: (size or 1.0) * rng.standard_normal(participant.blocks[b]) for b, size in sizes.items()}


def differences(participant, directions, step):
    """Fourth-order differences of all interface outputs; the participant is where it was afterwards."""
    state, values = participant.save(), {b: participant.get(b) for b in directions}
    f = {}
    for s in (2, 1, -1, -2):
        participant.restore(state)
        for block, v in directions.items():
            participant.set(block, values[block] + s * step * v)
        before = participant.get("symmetry_used")
        participant.step(0.0, 1.0)
        assert participant.get("symmetry_used") == before
        f[s] = {b: participant.get(b) for b in outputs(participant)}
    participant.restore(state)
    return {b: (8.0 * (f[1][b] - f[-1][b]) - (f[2][b] - f[-2][b])) / (12.0 * step) for b in f[1]}


def assert_same(found, expected, bound=BOUND):
    assert found.keys() == expected.keys()
    for block, value in expected.items():
        assert np.linalg.norm(found[block] - value) <= bound * np.linalg.norm(value), block


def seen(participant, scene, directions):
    """What the solver sees of directions: their symmetric parts, where it solves one half."""
    if not participant.get("symmetry_used"):
        return directions
    image = images(scene.interface)
    return {b: symmetric_part(v, image[b]) for b, v in directions.items()}


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("case", CASES)
def test_displacement_answers_to_loads_as_the_equilibrium_does(equilibria, case, seed):
    name, settings, _, _, step = CASES[case]
    structure = equilibria(case).structural
    directions = random_directions(structure, seed)
    found = structure.directional_derivative(directions)
    scene = scenes.load(name, settings)
    assert_same(found, differences(structure, seen(structure, scene, directions), step))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("case", CASES)
def test_loads_answer_to_the_shape_as_the_flow_does(equilibria, case, seed):
    name, settings, _, _, _ = CASES[case]
    air = equilibria(case).aero
    directions = random_directions(air, seed, scale=1.0)
    found = air.directional_derivative(directions)
    # 1e-5 m: in larger steps strips pass points of the polar tables, where the second derivative jumps
    assert_same(found, differences(air, seen(air, scenes.load(name, settings), directions), 1e-5))


def test_slack_lines_are_slack(equilibria):
    assert equilibria("slack lines").structural.get("slack_lines") > 0.0


@pytest.mark.parametrize(
    ("settings", "angle", "expected"),
    [
        ({"panels_per_section": 4}, 0.45, "stalled_strips"),
        ({"panels_per_section": 4}, -0.3, "strips_beyond_polar"),
    ],
)
@pytest.mark.parametrize("symmetric", [1.0, 0.0])
def test_stalled_wings_have_exact_derivatives_too(settings, angle, expected, symmetric):
    scene = scenes.load("v3_kite", settings)
    air = InProcessParticipant(scene.aero_core(), {"trim_angle": angle, "symmetric": symmetric})
    air.step(0.0, 1.0)
    assert air.get(expected) > 0.0
    directions = random_directions(air, 3, scale=1.0)
    assert_same(air.directional_derivative(directions), differences(air, seen(air, scene, directions), 1e-5))


@pytest.mark.parametrize("symmetric", [1.0, 0.0])
def test_artificial_viscosity_in_the_loads_is_in_their_derivative(symmetric):
    scene = scenes.load("v3_kite", {"panels_per_section": 10})
    core = scene.aero_core()
    air = InProcessParticipant(core, {"trim_angle": 0.5, "symmetric": symmetric})
    air.step(0.0, 1.0)
    viscosity = float(air.get("stall_viscosity"))
    assert viscosity > 0.0
    directions = seen(air, scene, random_directions(air, 3, scale=1.0))
    found = air.directional_derivative(directions)
    # no differences of steps: a moved wing may be solved without viscosity (see tests/aero/test_sensitivity.py)
    nodes = scene.interface.nodes + air.get("displacement")
    at = nodes, air.get("wind_speed") * air.get("wind_direction"), air.get("circulation")
    expected = WingSensitivity(scene.wing_model.wing, *at, viscosity, bool(symmetric))(directions["displacement"])
    for block, value in zip(("pressure", "shear"), expected, strict=True):
        assert np.abs(found[block] - value).max() <= 1e-12 * np.abs(value).max()  # rounding


@pytest.mark.parametrize("settings", [{"camber_feedback": "on"}, {"tube_law": "fabric"}])
def test_loads_follow_the_camber_of_a_displaced_canopy(settings):
    scene = scenes.load("v3_kite_detailed", {"canopy_stations": 4, **settings})
    air = InProcessParticipant(scene.aero_core(), {"trim_angle": 0.1})
    rng = np.random.default_rng(5)
    air.set("displacement", air.get("displacement") + 0.01 * rng.standard_normal(air.blocks["displacement"]))
    air.step(0.0, 1.0)
    directions = random_directions(air, 4, scale=1.0)
    assert_same(air.directional_derivative(directions), differences(air, directions, 1e-5))


@pytest.mark.parametrize("case", ["kite", "whole", "four strips a bay", "slack lines"])
def test_derivative_of_the_coupled_map_is_the_product_of_both(equilibria, case):
    name, settings, _, _, _ = CASES[case]
    coupling = equilibria(case)
    x = coupling.aero.get("displacement")
    directions = seen(coupling.aero, scenes.load(name, settings), random_directions(coupling.aero, 7, scale=1.0))
    loads = coupling.aero.directional_derivative(directions)
    found = coupling.structural.directional_derivative(loads)["displacement"]
    states = coupling.structural.save(), coupling.aero.save()

    def moved(s):
        coupling.structural.restore(states[0])
        coupling.aero.restore(states[1])
        return coupling(x + s * 1e-5 * directions["displacement"])

    difference = (8.0 * (moved(1) - moved(-1)) - (moved(2) - moved(-2))) / 12e-5
    # 1e-9 N over the change of the loads by some 0.1 N: 8e-10 is found
    assert np.linalg.norm(found - difference) <= BOUND * np.linalg.norm(difference)


@pytest.mark.parametrize("case", ["kite", "whole", "inflatable"])
@pytest.mark.parametrize("side", ["structural", "aero"])
def test_products_repeat_bitwise_and_are_linear(equilibria, case, side):
    participant = getattr(equilibria(case), side)
    a, b = (random_directions(participant, seed, scale=1.0) for seed in (0, 1))
    first, other = participant.directional_derivative(a), participant.directional_derivative(b)
    again = participant.directional_derivative(a)
    assert all(np.array_equal(first[k], again[k]) for k in first)
    both = participant.directional_derivative({k: 2.0 * a[k] - 3.0 * b[k] for k in a})
    assert_same(both, {k: 2.0 * first[k] - 3.0 * other[k] for k in first}, 1e-10)  # rounding, times the condition
    parts = [participant.directional_derivative({k: v}) for k, v in a.items()]
    assert_same({k: sum(p[k] for p in parts) for k in first}, first, 1e-10)
    assert not any(v.any() for v in participant.directional_derivative({}).values())


def same_state(a, b):
    """Whether two nested states are bitwise the same."""
    if is_dataclass(a):
        return type(a) is type(b) and same_state(vars(a), vars(b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same_state(a[k], b[k]) for k in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(same_state(*pair) for pair in zip(a, b, strict=True))
    return a is b is None or (np.shape(a) == np.shape(b) and np.array_equal(a, b))


@pytest.mark.parametrize("case", ["kite", "whole", "section", "held turn"])
def test_asking_changes_neither_the_state_nor_the_next_steps(equilibria, case):
    coupling = equilibria(case)
    both = coupling.structural, coupling.aero
    before = [p.save() for p in both]
    later = []
    for ask in (False, True):
        for participant, state in zip(both, before, strict=True):
            participant.restore(state)
        x = coupling.structural.get("displacement")
        for _ in range(3):
            if ask:
                for participant in both:
                    now = participant.save()
                    participant.directional_derivative(random_directions(participant, 2, scale=1.0))
                    assert same_state(now, participant.save())
            x = coupling(x + 1e-3 * np.abs(x))
        later.append([p.save() for p in both])
    assert same_state(dict(enumerate(later[0])), dict(enumerate(later[1])))


@pytest.mark.parametrize("side", ["structural", "aero"])
def test_derivative_belongs_to_the_state_that_was_solved_or_restored_last(equilibria, side):
    coupling = equilibria("kite")
    participant = getattr(coupling, side)
    a = random_directions(participant, 0, scale=1.0)
    first, state = participant.directional_derivative(a), participant.save()
    coupling(coupling.structural.get("displacement") + 0.01 * FLIP * scenes.load("v3_kite").interface.nodes)
    changed = participant.directional_derivative(a)
    assert all(not np.array_equal(first[k], changed[k]) for k in first)
    participant.restore(state)
    back = participant.directional_derivative(a)
    assert all(np.array_equal(first[k], back[k]) for k in first)


def test_asymmetric_directions_count_with_their_symmetric_parts_on_a_half(equilibria):
    coupling = equilibria("kite")
    scene = scenes.load("v3_kite")
    for participant in (coupling.structural, coupling.aero):
        directions = random_directions(participant, 6)
        symmetric = {b: symmetric_part(v, images(scene.interface)[b]) for b, v in directions.items()}
        found = participant.directional_derivative(directions)
        assert_same(found, participant.directional_derivative(symmetric), 1e-10)  # rounding, times the condition
        for block, v in found.items():
            image = images(scene.interface)[block]
            assert np.abs(v - symmetric_part(v, image)).max() <= 1e-10 * np.abs(v).max()  # as above


BAD = [
    ("structural", {"lift": 0.0}, "no interface input 'lift'"),
    ("structural", {"gravity": 0.0}, "no interface input 'gravity'"),
    ("structural", {"displacement": 0.0}, "no interface input 'displacement'"),
    ("structural", {"pressure": np.zeros(3)}, "pressure has shape"),
    ("structural", {"shear": "strong"}, "shear must be numeric"),
    ("structural", {"line_load": np.nan}, "line_load must be finite"),
    ("aero", {"pressure": 0.0}, "no interface input 'pressure'"),
    ("aero", {"wind_speed": 0.0}, "no interface input 'wind_speed'"),
    ("aero", {"displacement": np.zeros((2, 3))}, "displacement has shape"),
    ("aero", {"displacement": np.inf}, "displacement must be finite"),
]


@pytest.mark.parametrize(("side", "changes", "reason"), BAD, ids=lambda v: str(v)[:30])
def test_directions_that_do_not_fit_are_refused_in_one_sentence(equilibria, side, changes, reason):
    participant = getattr(equilibria("kite"), side)
    if isinstance(value := next(iter(changes.values())), float):
        changes = {b: np.full(participant.blocks.get(b, ()), value) for b in changes}
    with pytest.raises(ValueError, match=reason) as caught:
        participant.directional_derivative(changes)
    assert "\n" not in str(caught.value)
    assert str(caught.value).endswith(".")


@pytest.mark.parametrize("side", ["structural", "aero"])
def test_values_that_have_not_been_solved_have_no_derivative(equilibria, side):
    participant = getattr(equilibria("kite"), side)
    fresh = getattr(Coupling.in_process(scenes.load("v3_kite")), side)
    with pytest.raises(ValueError, match="no step has been made yet"):
        fresh.directional_derivative({})
    fresh.get("symmetry_used")  # the loads on the wing as it starts are no step either
    with pytest.raises(ValueError, match="no step has been made yet"):
        fresh.directional_derivative({})
    block = inputs(participant)[0]
    participant.set(block, participant.get(block) + 1e-3)
    with pytest.raises(ValueError, match="changed since"):
        participant.directional_derivative({})


def test_tolerance_of_the_next_solve_leaves_the_derivative_alone(equilibria):
    structure = equilibria("kite").structural
    a = random_directions(structure, 0)
    first = structure.directional_derivative(a)["displacement"]
    structure.set("solver_tolerance", 0.5)
    assert np.array_equal(structure.directional_derivative(a)["displacement"], first)
    structure.restore(structure.save())
    assert np.array_equal(structure.directional_derivative(a)["displacement"], first)


def test_fold_of_the_circulation_has_no_derivative(equilibria, monkeypatch):
    air = equilibria("kite").aero

    def singular(*_):
        raise np.linalg.LinAlgError

    monkeypatch.setattr("aero.vortex_step.model.WingSensitivity", singular)
    with pytest.raises(ValueError, match="at a fold of its solutions"):
        air.directional_derivative({})


def test_step_that_fails_leaves_no_derivative(equilibria):
    structure = equilibria("kite").structural
    structure.set("pressure", np.full(structure.blocks["pressure"], -1e7))
    with pytest.raises(StepFailed, match="Newton iterations"):
        structure.step(0.0, 1.0)
    with pytest.raises(ValueError, match="last step failed"):
        structure.directional_derivative({})


def test_the_panel_method_says_before_any_step_that_it_has_no_derivatives():
    core = scenes.load("box_wing").aero_core()
    assert not core.offers_derivatives
    with pytest.raises(ValueError, match="the 3D panel method has no directional derivatives"):
        core.directional_derivative({"displacement": np.zeros_like(core.get("displacement"))})
