"""Runs of random kites, judged by the files that they leave."""

import collections
import json
import tempfile
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from master.cli import app

from .kite_balance import judged
from .random_kites import random_kite
from .registry import Table
from .text import lines, table

SEED, KITES = 2026, 150
SHIPPED = Path(__file__).parents[1] / "scenes" / "v3_kite"
VERDICTS = (
    "right",
    "right, and unstable, as was said",
    "without success, and said so",
    "refused in a sentence",
    "wrong",
    "failed",
)


def ended(words):
    """Exit code and output of a command line; the code is -1 after an exception."""
    result = CliRunner().invoke(app, [str(word) for word in words])
    crashed = result.exception is not None and not isinstance(result.exception, SystemExit)
    return (-1 if crashed else result.exit_code), result.output


def flown(seed, folder):
    """What became of a kite: one of VERDICTS, and why."""
    rng, scene, out = np.random.default_rng([SEED, seed]), folder / f"kite_{seed}", folder / f"out_{seed}"
    words, modulus = random_kite(rng, SHIPPED, scene)
    code, output = ended(["run", scene, "--backend", "in-process", "--no-report", "--out", out, *words])
    if code == 0:
        problem = judged(scene, out, modulus=modulus)
        return ("wrong", problem) if problem else ("right", "")
    if code == 2:
        return VERDICTS[3], output
    if code != 1:
        return "failed", output
    if json.loads((out / "summary.json").read_text())["status"] != "statically_unstable":
        return VERDICTS[2], output
    problem = judged(scene, out, modulus=modulus)
    return ("wrong", problem) if problem else (VERDICTS[1], output)


def campaign(seeds):
    """Verdicts on the kites of these seeds, counted, and what was wrong with which."""
    counted, told = collections.Counter(), []
    with tempfile.TemporaryDirectory(prefix="stress.") as folder:
        for seed in seeds:
            verdict, why = flown(seed, Path(folder))
            counted[verdict] += 1
            if verdict in ("wrong", "failed"):
                told.append(f"kite {seed} of seed {SEED}: {why}")
    return counted, told


def random(quick):
    """How runs of random kites end."""
    counted, told = campaign(range(5 if quick else KITES))
    row = ["v3_kite, varied", counted.total(), *(counted[verdict] for verdict in VERDICTS)]
    text = (
        f"Seed {SEED}. Sizes of 0.3 to 2, each axis stretched by up to 8 %, rest lengths off by up to 1 %, lines of "
        "0.3 to 100 GPa, winds of 6 to 22 m/s, tapes by up to 2 %, two in five steered and askew, three schemes. "
        "Right: positions, rest lengths, masses and written loads leave 0.01 N at most at all free nodes, tensions are "
        "those of EA and lengths, and the loads add up to the force on the supports."
    )
    return lines(table(["kites", "tried", *VERDICTS], [row]), text, *told)


ENTRIES = (Table(name="kites.random", title="Coupled equilibria of random kites", build=random),)
