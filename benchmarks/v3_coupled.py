"""V3 kite coupled at one wind speed: error of the shape over interface tolerance, a line a scheme."""

import contextlib
import functools

from master.coupling import SCHEMES, solve

from .problems import in_process
from .registry import Case, Fit, Outcome

SPEED = 12.0  # m/s
TIGHT = 1e-10  # m
NO_FORCE_TEST = float("inf")  # the tolerance of the interface alone ends the loop


@functools.cache
def shape(*_):
    """The displacement (n,3) m of a tightly converged solution, from the start that all schemes have."""
    result = solve(in_process("v3_kite", wind_speed=SPEED), SCHEMES["iqn-ils"](), atol=TIGHT)
    if result.status != "converged":
        raise RuntimeError(f"the reference solution ended as {result.status}: {result.message}")
    return result.displacement


@contextlib.contextmanager
def at_tolerance(scheme, tolerance):
    """One coupled solve from the trim start."""
    coupling = in_process("v3_kite", wind_speed=SPEED)

    def work():
        result = solve(coupling, SCHEMES[scheme](), atol=tolerance, force_tolerance=NO_FORCE_TEST)
        newton = {k: int(sum(r[f"{k}.newton_iterations"] for r in result.history)) for k in ("structural", "aero")}
        columns = {
            "coupling_iterations": result.iterations,
            "solver_calls": 2 * coupling.evaluations,
            **{f"{k}_newton": count for k, count in newton.items()},
            "unknowns": result.displacement.size,
            "residual_N": result.residual_N,
        }
        return Outcome(result.displacement, columns, result.status)

    yield work


ENTRIES = (
    Case(
        name="v3_coupled.tolerance",
        title=f"V3 kite at {SPEED:g} m/s, from the trim start: schemes over interface tolerance",
        knob="interface tolerance, m",
        values=(1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7),
        quick=(1e-2, 1e-4, 1e-6),
        error="largest error of the displacement",
        unit="m",
        reference=f"IQN-ILS converged to {TIGHT:g} m",
        prepare=at_tolerance,
        truth=shape,
        # At the finest tolerance of 1e-7 m; the error exceeds the last residual by 1 / (1 - eigenvalue), and structural
        # solves to 1e-8 N over soft bridle modes of some 0.1 N/m may leave as much again.
        bound=1e-6,
        finer="smaller",
        series=("explicit", "aitken", "iqn-ils"),
        quick_series=("aitken", "iqn-ils"),
        repeats=5,
        fit=Fit("value", "error", "error ~ tolerance"),
        labels={
            "coupling_iterations": "coupling iterations", "solver_calls": "solver calls",
            "structural_newton": "Newton iterations, structure", "aero_newton": "Newton iterations, flow",
            "unknowns": "unknowns", "residual_N": "out-of-balance force, N",
        },
        note="A Newton iteration factorises once, seldom more often; each structural solve once more, to count "
        "unstable directions. The unknowns are those of the interface.",
    ),
)  # fmt: skip
