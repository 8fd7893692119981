"""Runs of random motions, judged by the files that they leave."""

import collections
import tempfile
from pathlib import Path

import numpy as np

from .kite_stress import ended
from .motion_balance import judged
from .random_motions import KINDS, random_motion
from .registry import Table
from .text import lines, table

SEED = 2026
VERDICTS = ("right", "without success, and said so", "wrong", "failed")
HALVINGS = 3  # step sizes of a smooth motion
TITLES = {
    "springs": "springs between weights, let go",
    "reels": "weights let down and drawn up",
    "wind": "weights on lines in the wind",
    "slack": "stiff lines jerking taut, steps too long",
}
MOTIONS = {"springs": 25, "reels": 20, "wind": 20, "slack": 45}


def moved(kind, seed, folder):
    """What became of a motion with each of its step sizes: one of VERDICTS, why, and how many runs that were."""
    scene = folder / f"{kind}_{seed}"
    given = random_motion(kind, np.random.default_rng([SEED, list(KINDS).index(kind), seed]), scene)
    outs, runs = [], HALVINGS if given["smooth"] else HALVINGS - 1
    while len(outs) < runs:
        step = repr(given["step"] / 2 ** len(outs))
        words = ["--backend", "in-process", "--no-report", "--step", step, "--set", f"longest_step={step}"]
        words += ["--inputs", given["inputs"]] if given["inputs"] else []
        outs.append(scene.with_name(f"{scene.name}_{len(outs)}"))
        code, output = ended(["run", scene, "--out", outs[-1], *words])
        if code != 0:
            return ("failed" if code != 1 else VERDICTS[1]), output, len(outs)
        if len(outs) == runs:
            problem = judged(scene, outs[-HALVINGS:], kind == "wind", given["smooth"], given["order"])
            # an order shows where steps are small enough: once more where it does not yet
            runs += problem.startswith("of order") and runs == HALVINGS
    return ("wrong" if problem else "right"), problem, len(outs)


def campaign(kind, seeds):
    """Verdicts on the motions of a kind, counted; what was wrong with which; and the runs in all."""
    counted, told, runs = collections.Counter(), [], 0
    with tempfile.TemporaryDirectory(prefix="stress.") as folder:
        for seed in seeds:
            verdict, why, count = moved(kind, seed, Path(folder))
            counted[verdict] += 1
            runs += count
            if verdict in ("wrong", "failed"):
                told.append(f"{kind} {seed} of seed {SEED}: {why}")
    return counted, told, runs


def random(quick):
    """How runs of random motions end."""
    table_rows, told = [], []
    for kind, count in MOTIONS.items():
        counted, wrong, runs = campaign(kind, range(2 if quick else count))
        table_rows.append([TITLES[kind], counted.total(), runs, *(counted[verdict] for verdict in VERDICTS)])
        told += wrong
    text = (
        f"Seed {SEED}. Generalised-alpha, BDF2 and implicit Euler, step sizes halved once or twice. Right: tensions "
        "and elastic energy are those of EA and lengths; energies add up, the work of the weight is that of its fall, "
        "and no scheme makes more energy than went in; of smooth motions, the change of momentum is the impulse of all "
        "forces within 2 %, and places converge with the order of the scheme (differences fall by 2.8 to 6 where that "
        "is two, by 1.4 to 2.9 where it is one; where they do not yet, steps are halved once more)."
    )
    return lines(table(["motions", "tried", "runs", *VERDICTS], table_rows), text, *told)


ENTRIES = (Table(name="motion.random", title="Random motions", build=random),)
