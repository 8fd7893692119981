"""The V3 kite coupled, from its trim start: schemes, branches, critical relaxation, stability, backends."""

import numpy as np
import pytest

import scenes
from benchmarks.problems import as_fmus, in_process
from master.coupling import SCHEMES, coupled_run, solve
from master.coupling.acceleration import IQNILS, Aitken, ConstantRelaxation
from master.coupling.fixed_point import fixed_point
from master.coupling.spectrum import critical_relaxation, dominant_eigenvalue

SPEEDS = (8.0, 12.0, 20.0)
MOST_ITERATIONS = {8.0: 15, 12.0: 15, 20.0: 20}


def outputs(coupling):
    """All outputs of both participants."""
    pair = (coupling.aero, coupling.structural)
    return {b: p.get(b) for p in pair for b, c in p.causality.items() if c == "output"}


@pytest.fixture(scope="module", params=["on", "off"], ids=lambda p: f"line drag {p}")
def line_drag(request):
    """With drag of the bridle, as it flies, and without, as the figures of others were made."""
    return {"line_drag": request.param}


@pytest.fixture(scope="module")
def equilibria(line_drag):
    """Per wind speed: the default solve, its coupling, the start displacement, and all outputs at the end."""
    out = {}
    for speed in SPEEDS:
        coupling = in_process("v3_kite", line_drag, wind_speed=speed)
        start = coupling.structural.get("displacement")
        result = solve(coupling, SCHEMES["iqn-ils"]())
        out[speed] = result, coupling, start, outputs(coupling)
    return out


@pytest.fixture(scope="module")
def factors(equilibria):
    """Per wind speed: dominant eigenvalue of G' in symmetric motions and the critical relaxation factor."""
    out = {}
    for speed, (result, coupling, start, _) in equilibria.items():
        coupling.set_tolerance(1e-8)
        d = result.displacement - start
        found = dominant_eigenvalue(coupling, result.displacement, step=1e-4, start=np.sign(d) * np.sqrt(np.abs(d)))
        assert found.settled, found.message
        out[speed] = found.value, critical_relaxation(found.value)
    return out


@pytest.mark.parametrize("speed", SPEEDS)
def test_the_default_scheme_converges_from_the_trim_start_in_few_coupling_iterations(equilibria, speed):
    result = equilibria[speed][0]
    assert result.status == "converged"
    assert result.iterations <= MOST_ITERATIONS[speed]
    assert result.residual_N <= 0.01


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("name", ["aitken", "relaxation", "explicit"])
def test_every_scheme_that_converges_finds_the_same_branch(line_drag, equilibria, factors, speed, name):
    coupling = in_process("v3_kite", line_drag, wind_speed=speed)
    if name == "explicit" and factors[speed][1] < 1.0:  # explicit is relaxation by one: beyond the critical factor
        outcome = solve(coupling, ConstantRelaxation(1.0), max_iterations=60)
        apart = float(coupling.aero.get("tip_span")) - float(equilibria[speed][3]["tip_span"])
        assert outcome.status != "converged" or apart < -0.3  # m: driven off, to a wing whose tips are closer together
        return
    scheme = {"aitken": Aitken(0.5), "explicit": ConstantRelaxation(1.0)}.get(name)
    # Half the critical factor: well inside, and from the trim start itself.
    result = solve(coupling, scheme or ConstantRelaxation(0.5 * factors[speed][1]))
    assert result.status == "converged"
    reference, found = equilibria[speed][3], outputs(coupling)
    # 1 mm: neighbouring branches are centimetres to metres away; the tip span tells folded tips.
    assert np.abs(result.displacement - equilibria[speed][0].displacement).max() <= 1e-3
    assert float(found["tip_span"]) == pytest.approx(float(reference["tip_span"]), abs=1e-3)
    assert np.linalg.norm(found["support_force"]) == pytest.approx(np.linalg.norm(reference["support_force"]), rel=1e-3)


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize(("fraction", "statuses"), [(0.97, {"converged"}), (1.03, {"max_iterations", "diverged"})])
def test_constant_relaxation_fails_just_above_the_critical_factor(equilibria, factors, speed, fraction, statuses):
    result, coupling, start, _ = equilibria[speed]
    scheme = ConstantRelaxation(fraction * factors[speed][1])
    # The bound is that of the linearised map, so the start is 3 % of the way from the equilibrium to the trim pose.
    x = result.displacement + 0.03 * (start - result.displacement)
    outcome = fixed_point(coupling, x, scheme, atol=1e-5, max_iterations=400, stall_window=0)
    assert outcome.status in statuses


@pytest.mark.parametrize("speed", SPEEDS)
def test_the_flown_shape_is_physical(equilibria, speed):
    out = equilibria[speed][3]
    low, high = {8.0: (10.0, 13.0), 12.0: (6.0, 7.5), 20.0: (2.0, 4.0)}[speed]
    assert low < np.rad2deg(float(out["alpha_mid"])) < high
    assert 7.2 < float(out["tip_span"]) < 8.3  # m; the design wing has 8.22, folded tips below 6
    assert float(out["slack_lines"]) <= 4
    weight = np.array([0.0, 0.0, -9.81 * structural_mass()])
    force = out["support_force"]
    air = out["force"] + out.get("line_force", 0.0)
    np.testing.assert_allclose(force, air + weight, atol=1e-2)  # what residual_N may leave
    assert np.all(np.abs(np.rad2deg(out["alpha"])) < 15.0)  # no strip is stalled
    assert float(out["stall_viscosity"]) == 0.0


def structural_mass():
    return scenes.load("v3_kite").members.mass.sum()


def test_more_wind_pulls_harder_and_lowers_the_angle_of_attack(equilibria):
    force = [np.linalg.norm(equilibria[s][3]["support_force"]) for s in SPEEDS]
    alpha = [float(equilibria[s][3]["alpha_mid"]) for s in SPEEDS]
    assert force == sorted(force)
    assert alpha == sorted(alpha, reverse=True)


@pytest.mark.parametrize("speed", SPEEDS)
def test_the_kite_is_stable_in_symmetric_motions_and_unstable_in_roll(line_drag, speed):
    symmetric = coupled_run(in_process("v3_kite", line_drag, wind_speed=speed), SCHEMES["iqn-ils"]())
    assert symmetric.status == "converged"
    assert symmetric.stability is not None
    assert symmetric.stability.symmetric_only
    whole = coupled_run(in_process("v3_kite", line_drag, wind_speed=speed, symmetric=0.0), SCHEMES["iqn-ils"]())
    assert whole.status == "statically_unstable"
    assert whole.stability is not None
    assert whole.stability.eigenvalue > 1.05


def test_the_verdict_does_not_depend_on_where_the_solve_began():
    coupling = in_process("v3_kite", wind_speed=12.0)
    cold = coupled_run(coupling, SCHEMES["iqn-ils"]())
    warm = coupled_run(coupling, SCHEMES["iqn-ils"]())  # from the equilibrium that the first has found
    assert (cold.status, warm.status) == ("converged", "converged")
    assert warm.stability is not None
    assert cold.stability is not None
    assert warm.stability.eigenvalue == pytest.approx(cold.stability.eigenvalue, abs=2e-3)  # of the Arnoldi iteration


def test_without_gravity_roll_about_the_wind_is_neutral():
    run = coupled_run(in_process("v3_kite", wind_speed=12.0, symmetric=0.0, gravity=0.0), SCHEMES["iqn-ils"]())
    assert run.stability is not None
    assert run.stability.eigenvalue == pytest.approx(1.0, abs=2e-3)  # accuracy of the Arnoldi iteration
    assert run.stability.statically_stable is False


@pytest.mark.parametrize("name", [name for name, kind in SCHEMES.items() if not kind.exact])
def test_fmus_and_in_process_solvers_give_the_same_iterates(name):
    inside = solve(in_process("v3_kite", wind_speed=12.0), SCHEMES[name](), max_iterations=30)
    with as_fmus("v3_kite", wind_speed=12.0) as coupling:
        outside = solve(coupling, SCHEMES[name](), max_iterations=30)
    assert outside.status == inside.status
    a, b = (np.array([row["residual_m"] for row in r.history]) for r in (inside, outside))
    np.testing.assert_allclose(b, a, rtol=1e-10, atol=1e-10 * a.max())  # the same arithmetic on the same machine
    np.testing.assert_allclose(outside.displacement, inside.displacement, rtol=1e-10, atol=1e-12)


def test_asymmetric_steering_turns_symmetry_off_and_says_so():
    coupling = in_process("v3_kite", wind_speed=12.0, steering_tape_left_length=1.55)
    solve(coupling, IQNILS(omega0=0.5), max_iterations=3)
    assert float(coupling.structural.get("symmetry_used")) == 0.0


@pytest.mark.parametrize(
    ("parameter", "value"),
    [("wind_speed", 7.0), ("wind_speed", 24.0), ("power_tape_length", 2.6), ("power_tape_length", 3.8)],
)
def test_the_default_scheme_converges_over_the_stated_range(parameter, value):
    coupling = in_process("v3_kite", **{"wind_speed": 12.0, parameter: value})
    assert solve(coupling, SCHEMES["iqn-ils"]()).status == "converged"


def test_power_tape_that_is_too_long_goes_slack_and_leaves_the_kite_to_the_jammed_steering_tapes():
    flown = []
    for length in (4.0, 4.5):
        coupling = in_process("v3_kite", wind_speed=12.0, power_tape_length=length)
        result = solve(coupling, SCHEMES["iqn-ils"]())
        assert result.status == "converged"
        tension = dict(zip(scenes.load("v3_kite").members.names, coupling.structural.get("tension"), strict=True))
        assert tension["power_tape"] == 0.0
        assert min(tension["steering_tape_left"], tension["steering_tape_right"]) > 50.0
        flown.append(result.displacement)
    # the knot of the slack tape may be anywhere; it takes 1e-5 m of the interface residual
    assert np.abs(flown[0] - flown[1]).max() <= 1e-3


@pytest.mark.parametrize(("parameter", "value"), [("wind_speed", 40.0), ("wind_speed", 60.0)])
def test_beyond_the_stated_range_a_run_ends_with_a_status_and_its_history(parameter, value):
    coupling = in_process("v3_kite", **{"wind_speed": 12.0, parameter: value})
    result = solve(coupling, SCHEMES["iqn-ils"](), max_iterations=40)
    assert result.status != "converged"
    assert result.message
    assert len(result.history) == result.iterations >= 1


def test_flight_states_vary_smoothly_over_wind_and_power_tape():
    winds, tapes = (8.0, 12.0, 16.0, 20.0), (2.9, 3.129, 3.3)
    alpha, span, pull = np.empty((3, len(tapes), len(winds)))
    for i, tape in enumerate(tapes):
        for j, wind in enumerate(winds):
            coupling = in_process("v3_kite", wind_speed=wind, power_tape_length=tape)
            assert solve(coupling, SCHEMES["iqn-ils"]()).status == "converged"
            alpha[i, j] = np.rad2deg(float(coupling.aero.get("alpha_mid")))
            span[i, j] = float(coupling.aero.get("tip_span"))
            pull[i, j] = np.linalg.norm(coupling.structural.get("support_force"))
    # more wind and a longer tape lower the angle of attack, and ever less so; more wind bends the tips inwards
    assert np.all(np.diff(alpha, axis=0) < 0.0)
    assert np.all(np.diff(alpha, axis=1) < 0.0)
    assert np.all(np.diff(alpha, n=2, axis=1) > 0.0)
    assert np.all(np.diff(span, axis=1) < 0.0)
    assert np.all(np.diff(pull, axis=1) > 0.0)
    assert np.abs(np.diff(span, axis=1)).max() < 0.4  # m; to a branch with folded tips it is more than 1 m
