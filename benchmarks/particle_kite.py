"""The V3 kite in a transient case: ten thousand steps in gusts, and a steering step."""

import time

import numpy as np

from master.coupling import simulate
from scenes import load

from .particle_coupled import sides
from .registry import Table
from .text import lines, table

SCENE, STEP = "v3_kite_dynamic", 0.02
GUSTS = {"gust_speed": 2.0, "gust_start": 2.0, "gust_duration": 5.0, "gust_interval": 10.0}
STEERED, FOR = 0.02, 5.0  # m of one steering tape, s


class Flight:
    """What a run of the kite shows step by step: angle of attack rad, force N, tip span m, side displacement m."""

    def __init__(self, pair, tape=None):
        self.pair, self.tape = pair, tape
        self.rows = []
        self.symmetric = True

    def __call__(self, at, run):
        structure, flow = self.pair["structural"], self.pair["aero"]
        if self.tape is not None:
            name, begin, change = self.tape
            steered = begin + (change if 2.0 <= at < 2.0 + FOR else 0.0)
            structure.set(name, np.array(steered))
        if at > 0.0:
            x = structure.get("position")
            force = np.linalg.norm(structure.get("support_force"))
            span, alpha = float(flow.get("tip_span")), float(flow.get("alpha_mid"))
            self.rows.append((at, alpha, force, span, x[:, 1].mean(), x[:, 2].max()))


def flown(steps, scheme="explicit", parameters=None, tape=None):
    """Simulation, rows of `Flight` (k,6) and wall time s of `steps` communication steps."""
    scene = load(SCENE)
    given = scene.with_trim(GUSTS | (parameters or {}))
    pair = sides(scene, given)
    if tape is not None:
        tape = (tape[0], float(pair["structural"].get(tape[0])), tape[1])
    follow = Flight(pair, tape)
    begin = time.perf_counter()
    run = simulate(pair, steps * STEP, STEP, scheme, tolerance=1e-6, follower=follow)
    return run, np.array(follow.rows), time.perf_counter() - begin


def _row(name, run, rows, seconds):
    late = rows[len(rows) // 10 :]
    return [
        name,
        len(run.steps),
        run.status,
        f"{run.time / seconds:.1f}",
        f"{1e3 * run.seconds['aero'] / run.evaluations:.2f}",
        f"{1e3 * run.seconds['structural'] / run.evaluations:.2f}",
        f"{run.evaluations / len(run.steps):.1f}",
        f"{np.rad2deg(late[:, 1].min()):.2f} ... {np.rad2deg(late[:, 1].max()):.2f}",
        f"{late[:, 2].min():.0f} ... {late[:, 2].max():.0f}",
        f"{np.abs(late[:, 4]).max():.3f}",
    ]


def _kite(quick):
    steps = 500 if quick else 10_000
    cases = {
        f"gusts of 2 m/s, explicit, {steps} steps": (steps, "explicit", {}, None),
        "the same, IQN-ILS": (steps // 10, "iqn-ils", {}, None),
        "with the inertia of the air, explicit": (steps // 10, "explicit", {"added_mass_coefficient": 1.0}, None),
        f"one steering tape {100 * STEERED:g} cm longer for {FOR:g} s, explicit": (
            500, "explicit", {"gust_speed": 0.0}, ("steering_tape_left_length", STEERED),
        ),
    }  # fmt: skip
    rows = [_row(name, *flown(*case)) for name, case in cases.items()]
    heads = [
        "flight", "steps", "status", "times real time", "ms a flow", "ms a structure", "evaluations a step",
        "alpha, deg", "force, N", "side, m",
    ]  # fmt: skip
    return lines(
        table(heads, rows), f"Communication steps of {1e3 * STEP:g} ms, two of the integration each; one process."
    )


ENTRIES = (Table("particles.kite", "The transient V3 kite: gusts, inertia of the air, steering", _kite),)
