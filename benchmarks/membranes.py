"""Membranes: the inflated airbag from its flat start, and the deflection of Hencky's membrane over the mesh."""

import contextlib
import functools

import numpy as np

from .membrane_models import AIRBAG_FABRIC, airbag, hencky, inflated, principal
from .membrane_references import axisymmetric_membrane
from .registry import Case, Curve, Fit, Outcome

PRESSURE, THICKNESS = 5000.0, AIRBAG_FABRIC[1]  # Pa, m
LOADS = {"q = 0.0046": 0.0046, "q = 0.0457": 0.0457}
NU = 0.34
# Of the square airbag (ram-air thesis 3.5.1, table 3.3): what the limit of the model is taken to be.
AIRBAG_HEIGHT, AIRBAG_STRESS = 0.2152, 3.91e6  # m; Pa, at the centre


@contextlib.contextmanager
def inflated_airbag(series, triangles):
    """Assembly and solve from the flat start; the answer is the height of the centre in mm."""
    nodes, fixed, group = airbag(round(0.5 * np.sqrt(triangles)))

    def work():
        found, assembly, loads = inflated(nodes, fixed, group, PRESSURE)
        _, external = assembly.residual(assembly.unknowns.restrict(found.x), assembly.prepare(loads))
        stress = principal(group, found.x)
        centre = stress[0, 0, (group.nodes == 0).any(axis=1)].mean() / THICKNESS
        columns = {
            "unknowns": assembly.unknowns.count,
            "newton_iterations": found.iterations,
            "stress": 1e-6 * centre,
            "least_stress": stress[1].min() / stress[0].max(),
            "residual": found.residual / external,
        }
        return Outcome(1e3 * found.x[0, 2], columns, found.status)

    yield work


@contextlib.contextmanager
def hencky_membrane(series, rings):
    """Assembly and solve from the flat start; the answer is the deflection of the centre over the radius."""
    load, m = series.rsplit(", ", 1)

    def work():
        found, group, _ = hencky(rings, LOADS[load], NU, int(m[1]))
        free = len(np.unique(group.nodes)) - len(group.nodes[0]) * 2 * rings
        return Outcome(found.x[0, 2], {"nodes": free, "newton_iterations": found.iterations}, found.status)

    yield work


@functools.cache
def deflection(load):
    """Deflection of the centre over the radius by shooting."""
    return axisymmetric_membrane(LOADS[load], NU).deflection


ENTRIES = (
    Case(
        name="membranes.airbag",
        title="Square airbag with a tension field, assembly and equilibrium from the flat start: time over triangles",
        knob="triangles",
        values=(16, 64, 144, 400, 1024, 1936, 4096, 10_000),
        quick=(64, 400),
        error="height of the centre",
        unit="mm",
        reference=f"limit of the model, {1e3 * AIRBAG_HEIGHT:.1f} mm",
        prepare=inflated_airbag,
        truth=lambda series, n: 1e3 * AIRBAG_HEIGHT,
        bound=0.6,
        further=lambda answer, truth: {"height": answer},
        repeats=2,
        plot=Curve("value", "time_s"),
        fit=Fit("value", "time_s", "time ~ triangles", least=400.0),
        labels={
            "unknowns": "unknowns",
            "newton_iterations": "Newton iterations",
            "stress": "S1 at the centre, MPa",
            "least_stress": "least principal stress over largest",
            "residual": "residual over load",
            "height": "height, mm",
        },
        note="Ram-air thesis 3.5.1: E 588 MPa, h 0.6 mm, nu 0.4, half side 422 mm, 5 kPa, an eighth of the bag, "
        f"squares cut in four. Limit of the stress: {1e-6 * AIRBAG_STRESS:.2f} MPa. Published, 128 triangles: 205 to "
        "217 mm, 3.5 to 3.8 MPa. Peer mem4py: 440 triangles 1.55 s, 216.4 mm; 10200 triangles 327 s, 215.3 mm. The "
        "rim folds: there are equilibria with other folds within some tenths of a millimetre.",
    ),
    Case(
        name="membranes.hencky",
        title="Hencky's membrane: deflection of the centre over the mesh, with linear and quadratic triangles",
        knob="rings",
        values=(4, 8, 16),
        quick=(4, 8),
        error="deflection of the centre",
        unit="%",
        reference="axisymmetric membrane of the same model, by shooting",
        prepare=hencky_membrane,
        truth=lambda series, rings: deflection(series.rsplit(", ", 1)[0]),
        distance=lambda answer, truth: 100.0 * abs(answer / truth - 1.0),
        bound=0.1,
        finer="larger",
        series=tuple(f"{load}, T{m}" for load in LOADS for m in (3, 6)),
        repeats=2,
        plot=Curve("nodes", "error"),
        fit=Fit("nodes", "error", "error ~ nodes"),
        labels={"nodes": "nodes", "newton_iterations": "Newton iterations"},
        note=f"q = p a / (E h), nu = {NU}; 6 rings² triangles. T3 has order 2 in the length of a side (exponent −1 "
        "over nodes), T6 order 4. The series of Hencky, whose pressure does not turn with the surface, is 0.24 % and "
        "1.1 % off at these loads.",
    ),
)  # fmt: skip
