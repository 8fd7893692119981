"""Operating range of the V3 kite: wind speed, power tape and gravity, each point from its own trim start."""

import contextlib
import functools

import numpy as np

from master.coupling import SCHEMES, solve
from scenes import SceneError

from .problems import in_process
from .registry import Branches, Case, Outcome

TAPES = (2.9, 3.0, 3.129, 3.2, 3.3)  # m
GRAVITY = (0.0, 4.905, 9.81)  # m/s^2
SERIES = {f"{tape:g} m, {g:g} m/s²": (tape, g) for g in GRAVITY for tape in TAPES}
ITERATIONS = 80
# What a point may end with and be believed: no trim angle means that the wind cannot carry the weight.
STATUSES = ("converged", "stalled", "diverged", "max_iterations", "no trim")
ANSWERS = ("alpha_deg", "tip_span_m", "glide")
JUMP, FOLDED = 0.5, 6.8  # m of tip span: between neighbours on one branch less, with folded tips below


def coupled(series, wind):
    """The kite at its trim start, None where it has none."""
    tape, gravity = SERIES[series]
    try:
        return in_process("v3_kite", wind_speed=wind, power_tape_length=tape, gravity=gravity)
    except SceneError:
        return None


@functools.cache
def tight(series, wind):
    """The displacement (n,3) m of the point, converged to 1e-8 m."""
    result = solve(coupled(series, wind), SCHEMES["iqn-ils"](), atol=1e-8, max_iterations=ITERATIONS)
    return result.displacement if result.status == "converged" else np.full_like(result.displacement, np.nan)


@contextlib.contextmanager
def point(series, wind):
    """One coupled solve with default tolerances."""
    coupling = coupled(series, wind)
    given = dict(zip(("power_tape_m", "gravity"), SERIES[series], strict=True))

    def work():
        if coupling is None:
            return Outcome(None, {**given, **dict.fromkeys(("coupling_iterations", *ANSWERS), float("nan"))}, "no trim")
        result = solve(coupling, SCHEMES["iqn-ils"](), max_iterations=ITERATIONS)
        aero = {block: float(coupling.aero.get(block)) for block in ("alpha_mid", "tip_span", "glide_ratio")}
        columns = {
            **given,
            "coupling_iterations": result.iterations,
            "alpha_deg": float(np.rad2deg(aero["alpha_mid"])),
            "tip_span_m": aero["tip_span"],
            "glide": aero["glide_ratio"],
        }
        return Outcome(result.displacement, columns, result.status)

    yield work


def distance(answer, truth):
    """Largest difference, nan where there is no solution to compare."""
    return float("nan") if answer is None or truth is None else float(np.max(np.abs(answer - truth)))


def truth(series, wind):
    """The tight solution, None where the default one is not worth comparing."""
    return None if coupled(series, wind) is None else tight(series, wind)


ENTRIES = (
    Case(
        name="v3_range.wind",
        title="V3 kite over wind, power tape and gravity, each point from its trim start",
        knob="wind, m/s",
        values=(8.0, 12.0, 16.0, 20.0, 24.0),
        quick=(12.0, 16.0),
        error="largest error of the displacement",
        unit="m",
        reference="the same solver converged to 1e-8 m",
        prepare=point,
        truth=truth,
        distance=distance,
        bound=1e-3,  # neighbouring branches are centimetres to metres away
        series=tuple(SERIES),
        quick_series=("3.129 m, 9.81 m/s²",),
        statuses=STATUSES,
        repeats=1,
        memory=False,  # the same model at every point
        plot=Branches(
            "value", ANSWERS, across="gravity", lines="power_tape_m",
            by="tip_span_m", jump=JUMP, least=FOLDED, filled=f"folded tips\n(span < {FOLDED:g} m)",
        ),
        labels={
            "power_tape_m": "power tape, m", "gravity": "gravity, m/s²", "coupling_iterations": "coupling iterations",
            "alpha_deg": "α, °", "tip_span_m": "tip span, m", "glide": "glide, with lines",
        },
        note="Glide is lift over drag of wing and lines. In the diagram, filled markers are wings with folded tips, "
        f"which is a tip span below {FOLDED:g} m; lines are broken where the tip span jumps by more than {JUMP:g} m, "
        "and at points that did not converge.",
    ),
)  # fmt: skip
