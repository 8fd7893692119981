"""The detailed V3 kite: its structure under one aerodynamic load over meshes, and what it does in flight."""

import contextlib
import functools

import numpy as np

import scenes
from master.coupling import SCHEMES, coupled_run

from .problems import as_fmus, in_process
from .registry import Case, Curve, Outcome, Table
from .text import lines, table

TOLERANCE = 1e-3  # N
MODULI = {"0.55 GPa, as in the file": 0.55e9, "100 GPa, Dyneema": 100e9}
MESHES = {1: (3, 1), 2: (6, 1), 3: (6, 2), 4: (12, 2), 5: (12, 3)}  # stations, subdivisions


@functools.cache
def _scene(mesh):
    stations, subdivisions = MESHES[mesh]
    return scenes.load("v3_kite_detailed", {"canopy_stations": stations, "canopy_subdivisions": subdivisions})


@functools.cache
def _loads(mesh):
    """Loads of the flow on the design shape turned to its trim angle at 12 m/s, and that angle."""
    scene = _scene(mesh)
    trim, aero = scene.trim_angle(), scene.aero_core()
    aero.set("trim_angle", trim)
    aero.step(0.0, 1.0)
    return {b: aero.get(b) for b in ("pressure", "shear", "line_load")}, trim


@contextlib.contextmanager
def from_design_shape(series, mesh):
    """A first solve of the structure from the design shape; the answer is the place of the leading edge at each rib."""
    scene = _scene(mesh)
    loads, trim = _loads(mesh)

    def work():
        core = scene.structural_core()
        core.set("trim_angle", trim)
        core.set("solver_tolerance", TOLERANCE)
        for block, values in loads.items():
            core.set(block, values)
        core.set("line_modulus", MODULI[series])
        core.step(0.0, 1.0)
        line = scene.members.area > 0.0
        strain = core.get("strain")
        return Outcome(
            core.get("position")[scene.struts[:, 0]],
            {
                "nodes": len(scene.members.nodes),
                "elements": len(scene.members.names) + len(scene.members.wing.tubes.names),
                "newton_iterations": int(core.get("newton_iterations")),
                "residual_N": float(core.get("residual")),
                "line_strain": float(strain[line].max()),
                "canopy_strain": float(strain[~line].max()),
                "tube_strain": float(core.get("tube_strain").max()),
                "tube_load": float(core.get("tube_load").max()),
            },
        )

    yield work


@functools.cache
def _finest(series):
    with from_design_shape(series, 5) as work:
        return work().answer[:: MESHES[5][1]]


def _ribs_apart(answer, truth):
    """Largest distance m between leading edge nodes at the 29 ribs, common to all meshes."""
    step = (len(answer) - 1) // (len(truth) - 1)
    return float(np.linalg.norm(answer[::step] - truth, axis=1).max())


FLIGHT = (
    "case", "status", "coupling iterations", "out-of-balance force, N", "α, °", "C_L", "C_D", "tip span, m", "pull, N",
    "largest tube moment / collapse", "holding moment (roll, yaw), N m", "solve, s",
)  # fmt: skip
CASES = (
    ("12 m/s", {}, {}),
    ("20 m/s", {}, {"wind_speed": 20.0}),
    ("depowered, tape 1.7 m", {}, {"power_tape_length": 1.7}),
    ("depowered, tape 1.8 m", {}, {"power_tape_length": 1.8}),
    ("20 m/s, tape 1.8 m", {}, {"wind_speed": 20.0, "power_tape_length": 1.8}),
    ("steered, tapes 1.5 and 1.7 m", {}, {"steering_tape_left_length": 1.5, "steering_tape_right_length": 1.7}),
    ("steered, tapes 1.4 and 1.8 m", {}, {"steering_tape_left_length": 1.4, "steering_tape_right_length": 1.8}),
    ("billowing fed back", {"camber_feedback": "on"}, {}),
    ("fabric law of tubes", {"tube_law": "fabric"}, {}),
    ("tubes at 0.6 bar, 20 m/s", {}, {"wind_speed": 20.0, "tube_pressure": 6e4}),
)


def flight(quick):
    """A row a flight case, through the FMUs with the default scheme."""
    rows = []
    for label, settings, parameters in CASES[:1] if quick else CASES:
        held = {"hold_roll_and_yaw": 1.0} if "steering_tape_left_length" in parameters else {}
        with as_fmus("v3_kite_detailed", settings, **parameters, **held) as coupling:
            run = coupled_run(coupling, SCHEMES["iqn-ils"](), stability=False)
        aero, structural = run.blocks["aero"], run.blocks["structural"]
        moment = structural["holding_moment"]
        rows.append(
            [
                label,
                run.status,
                str(run.result.iterations),
                f"{run.result.residual_N:.1e}",
                f"{np.rad2deg(float(aero['alpha_mid'])):.2f}",
                f"{float(aero['CL']):.3f}",
                f"{float(aero['CD']):.4f}",
                f"{float(aero['tip_span']):.3f}",
                f"{np.linalg.norm(structural['support_force']):.0f}",
                f"{float(structural['tube_load'].max()):.2f}",
                f"{moment[0]:.0f}, {moment[2]:.0f}" if held else "",
                f"{run.result.seconds['total']:.1f}",
            ]
        )
    return lines(
        table(FLIGHT, rows),
        "Wind 12 m/s unless said; both FMUs, IQN-ILS from the automatic trim start; time of the coupling loop, first "
        "structural solve included. Steered: roll and yaw held at the leading edge's middle, with the reactions about "
        "the bridle point. The LEI thesis ran a single coupling iteration of its detailed model (section 7.4).",
    )


def deformed(quick):
    """How depower and steering deform the wing, as in figure 2.3 of the LEI thesis."""
    rows = []
    for label, _, parameters in (CASES[0], CASES[3], CASES[6])[: 1 if quick else 3]:
        held = {"hold_roll_and_yaw": 1.0} if "steering_tape_left_length" in parameters else {}
        coupling = in_process("v3_kite_detailed", None, **parameters, **held)
        coupled_run(coupling, SCHEMES["iqn-ils"](), stability=False)
        grid = _scene(2).interface.sections
        shape = _scene(2).interface.nodes + coupling.structural.get("displacement")
        chord = shape[grid[:, -1]] - shape[grid[:, 0]]
        pitch = np.rad2deg(np.arctan2(-chord[:, 2], chord[:, 0]))
        tips = shape[grid[[0, -1], 0]]
        names = {"left tip rib": 1, "left strut 7": 6, "middle": 14, "right strut 2": 22, "right tip rib": 27}
        rows.append([label, *(f"{pitch[i]:.2f}" for i in names.values()), *(f"{z:.3f}" for z in tips[:, 2])])
    return lines(
        table(
            ["case", *(f"incidence {n}, °" for n in ("left outer", "left", "middle", "right", "right outer")),
             "left tip z, m", "right tip z, m"],
            rows,
        ),
        "Incidence of the chords in the x-z plane, nose-up positive. Depower lowers the incidence over the whole span; "
        "steering twists the wing: the half with the shortened tape gains incidence, the other one loses it.",
    )  # fmt: skip


ENTRIES = (
    Table(name="v3_detailed.flight", title="Detailed V3 kite in flight", build=flight),
    Table(name="v3_detailed.deformed", title="Incidence along the span of the detailed V3 kite", build=deformed),
    Case(
        name="v3_detailed.structure",
        title="Structure of the detailed V3 kite from its design shape under its aerodynamic load at 12 m/s",
        knob="mesh",
        values=(1, 2, 3, 4),
        quick=(1,),
        error="largest distance of a rib's leading edge from the finest mesh",
        unit="m",
        reference="mesh 5 (12 canopy cells along the chord, 3 between ribs)",
        prepare=from_design_shape,
        truth=lambda series, mesh: _finest(series),
        distance=_ribs_apart,
        bound=0.2,
        series=tuple(MODULI),
        quick_series=tuple(MODULI)[:1],
        repeats=3,
        plot=Curve(),
        memory=True,
        finer="larger",
        labels={
            "nodes": "nodes", "elements": "elements", "newton_iterations": "Newton iterations",
            "residual_N": "residual, N", "line_strain": "line strain", "canopy_strain": "canopy strain",
            "tube_strain": "tube strain", "tube_load": "tube moment / collapse",
        },
        note="Meshes 1 to 5: 3 × 1, 6 × 1 (default), 6 × 2, 12 × 2, 12 × 3 canopy cells along the chord and between "
        "ribs; to 1e-3 N from the design shape. A solve of more than 600 Newton iterations has begun again over lines "
        "stiffened in steps. A peer needs 541 s to 1.04 N on 1095 degrees of freedom.",
    ),
)  # fmt: skip
