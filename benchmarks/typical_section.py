"""The spring-mounted plate: error of the twist against its closed form, and coupling iterations towards divergence."""

import contextlib
import functools

from master.coupling import SCHEMES, solve

from .problems import DENSITY, divergence_pressure, in_process, plate_wind, twist
from .registry import Case, Curve, Fit, Outcome

FINE = 1e-11  # m
TWISTS = (0.0005, 0.0025, 0.006, 0.012, 0.022, 0.03)  # rad, q / q_D = 0.09 to 0.86
ANGLE = 0.01  # rad, where tolerances are compared


def outcome_of(theta, scheme, tolerance):
    """The coupled plate in the wind that holds it at the twist theta: twist found, coupling iterations."""
    coupling = in_process("typical_section", **plate_wind("divergent", theta))

    def work():
        result = solve(coupling, SCHEMES[scheme](), atol=tolerance, force_tolerance=float("inf"), max_iterations=500)
        columns = {"coupling_iterations": result.iterations, "solver_calls": 2 * coupling.evaluations}
        columns["structural_newton"] = int(sum(r["structural.newton_iterations"] for r in result.history))
        return Outcome(twist(result.displacement), columns, result.status)

    return work


@contextlib.contextmanager
def at_tolerance(scheme, tolerance):
    """The twist for one scheme and interface tolerance."""
    yield outcome_of(ANGLE, scheme, tolerance)


def pressure_ratio(theta):
    """q / q_D that holds the plate at theta."""
    q = 0.5 * DENSITY * plate_wind("divergent", theta)["wind_speed"] ** 2
    return round(q / divergence_pressure("divergent"), 3)


@functools.cache
def twist_at(ratio):
    """The twist whose pressure ratio this is."""
    return next(theta for theta in TWISTS if pressure_ratio(theta) == ratio)


@contextlib.contextmanager
def at_pressure(scheme, ratio):
    """The twist for one scheme and dynamic pressure."""
    yield outcome_of(twist_at(ratio), scheme, FINE)


LABELS = {
    "coupling_iterations": "coupling iterations", "solver_calls": "solver calls",
    "structural_newton": "Newton iterations of the structure",
}  # fmt: skip
CLOSED_FORM = "closed form, q(θ) = K sin θ / (2π e (α₀ + θ))"

ENTRIES = (
    Case(
        name="typical_section.tolerance",
        title=f"Typical section at q = {pressure_ratio(ANGLE):g} q_D: twist over interface tolerance",
        knob="interface tolerance, m",
        values=(1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9),
        quick=(1e-3, 1e-5, 1e-7),
        error="error of the twist",
        unit="rad",
        reference=CLOSED_FORM,
        prepare=at_tolerance,
        truth=lambda scheme, tolerance: ANGLE,
        # The plate's stretch under its springs, 1e3 against 1e8 N/m, is 1e-9 of the twist, and the structural solve
        # is never tighter than 1e-8 N over a moment stiffness of 480 N m/rad times the distance to divergence.
        bound=1e-8,
        finer="smaller",
        series=("explicit", "aitken", "iqn-ils"),
        quick_series=("explicit",),
        repeats=5,
        fit=Fit("value", "error", "error ~ tolerance", floor=1e-9),
        labels=LABELS,
        note="What is left at tight tolerances is that of the structural solve, 1e-8 N.",
    ),
    Case(
        name="typical_section.pressure",
        title="Typical section towards divergence: time of schemes over dynamic pressure",
        knob="q / q_D",
        values=tuple(pressure_ratio(theta) for theta in TWISTS),
        quick=tuple(pressure_ratio(theta) for theta in TWISTS[1:4:2]),
        error="error of the twist",
        unit="rad",
        reference=CLOSED_FORM,
        prepare=at_pressure,
        truth=lambda scheme, ratio: twist_at(ratio),
        bound=1e-8,  # as above
        series=("explicit", "aitken", "iqn-ils"),
        repeats=5,
        plot=Curve("value", "time_s", ("linear", "log")),
        labels=LABELS,
        note=f"Interface tolerance {FINE:g} m; explicit coupling contracts by q / q_D.",
    ),
)
