"""Runs under abuse: killed and interrupted at random moments, and scenes whose files somebody has spoiled.

What is left is judged by its files alone, with the standard library: nothing of the project is asked.
"""

import contextlib
import csv
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from .registry import Table
from .text import lines, table

SEED = 2026
KILLS = 30  # of each command
LIMIT = 300.0  # s, within which every command has to end
MARKER = ".kitecosim.json"
COUPLED = """
[time]
stop = 6.0
step = 0.1
[coupling]
scheme = "explicit"
[participants]
structure = {{ fmu = "{fmus}/tether_in_wind_structural.fmu", start = {{ gravity = {g} }} }}
flow = {{ fmu = "{fmus}/tether_in_wind_aero.fmu" }}
[[connections]]
from = "structure.displacement"
to = "flow.displacement"
[[connections]]
from = "structure.velocity"
to = "flow.velocity"
[[connections]]
from = "flow.line_load"
to = "structure.line_load"
[results]
record = ["structure.support_force", "flow.line_force"]
"""


class Place:
    """A folder with everything that a command needs, temporary files included."""

    def __init__(self, folder):
        self.folder, self.temporary, self.out = folder, folder / "tmp", folder / "out"
        self.temporary.mkdir(parents=True)
        self.environment = {**os.environ, "TMPDIR": str(self.temporary), "PYTHONPATH": str(Path(__file__).parents[1])}

    def started(self, words):
        """A command in a process group of its own, as a terminal makes it."""
        command = [sys.executable, "-m", "master", *map(str, words), "--out", str(self.out)]
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        return subprocess.Popen(command, cwd=self.folder, env=self.environment, start_new_session=True, **pipes)

    def run(self, words):
        """Undisturbed: its exit code, what it says on standard error, and its seconds."""
        begin = time.perf_counter()
        process = self.started(words)
        _, errors = process.communicate(timeout=LIMIT)
        return process.returncode, errors, time.perf_counter() - begin

    def partials(self):
        return sorted(self.folder.glob("out.partial*"))

    def left(self):
        """Temporary folders that are there."""
        return sorted(p.name for p in self.temporary.glob("kitecosim.*"))


def commands(place):
    """Name -> words of a command for a wind of so many m/s, so that results of two runs can be told apart."""

    def coupled(wind):
        file = place.folder / f"coupled_{wind}.toml"
        file.write_text(COUPLED.format(fmus=place.folder / "fmus", g=wind))
        return ["couple", file, "--no-report"]

    tether = ["tether_in_wind", "--no-report", "--stop-time", 3, "--scheme", "explicit"]
    return {
        "run": lambda wind: ["run", "typical_section", "--set", f"wind_speed={4 + wind / 10}"],  # stable, all of them
        "run, in time": lambda wind: ["run", *tether, "--set", f"wind_speed={wind}"],
        "couple": coupled,
        "compare": lambda wind: ["compare", "typical_section", "--jobs", 1, "--set", f"wind_speed={wind}"],
        "build": lambda wind: ["build", "typical_section", "--set", f"wind_speed={wind}"],
    }


def contents(folder):
    """Name -> SHA-256 of the files of results, without finished cells of comparisons, which add up."""
    files = (p for p in folder.rglob("*") if p.is_file())
    named = {p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}
    return {name: digest for name, digest in named.items() if name != MARKER and not name.startswith("cells/")}


def fault_of_results(folder):
    """What is wrong with results that ought to be whole, "" if nothing is."""
    marker = json.loads((folder / MARKER).read_text())
    told = {name: entry["sha256"] for name, entry in marker["files"].items()}
    found = contents(folder)
    if marker["state"] != "complete" or told != found:
        return f"results are not whole: {sorted(set(told.items()) ^ set(found.items()))[:3]}"
    return fault_of_tables(folder)


def fault_of_tables(folder):
    """A table with half a row or a JSON file that is none, "" without one."""
    for path in folder.rglob("*.csv"):
        text = path.read_text()
        rows = list(csv.reader(text.splitlines()))
        if not text.endswith("\n") or len({len(row) for row in rows}) != 1:
            return f"{path.name} has half a row"
    for path in folder.rglob("*.json"):
        json.loads(path.read_text())
    return ""


def disturbed(place, words, after, how):
    """Start a command, and end it by a signal after so many seconds: exit code and standard error."""
    process = place.started(words)
    try:
        _, errors = process.communicate(timeout=after)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, how)
        _, errors = process.communicate(timeout=LIMIT)
    return process.returncode, errors


def judged(place, before, code, errors, how):
    """What came of a disturbed command, in a word, and what is wrong, "" if nothing is."""
    same = contents(place.out) == before
    if how == signal.SIGINT and (code == -signal.SIGINT or "init_import_site" in errors):
        word = "before it began" if same else "finished"  # Python itself was loading, or ending
    else:
        word = {0: "finished", 130: "interrupted", -signal.SIGKILL: "killed"}.get(code, "?")
        if word == "?" or "Traceback" in errors:
            return word, f"exit code {code}: {errors[-300:]}"
    if fault := fault_of_results(place.out):
        return word, fault
    return word, next((fault for p in place.partials() if (fault := fault_of_tables(p))), "")


def campaign(folder, names, kills, seed=SEED):
    """Name -> counts of what came of `kills` disturbed runs of each command, and a list of what was wrong."""
    chance, counts, wrong = random.Random(seed), {}, []
    for name in names:
        place = Place(Path(folder) / re.sub(r"\W", "_", name))
        place.out, fmus = place.folder / "fmus", place.out
        if name == "couple":
            place.run(["build", "tether_in_wind"])
        place.out, make = fmus, commands(place)[name]
        code, errors, seconds = place.run(make(9))
        if code:
            wrong.append(f"{name}: {code} {errors}")
            continue
        found = counts.setdefault(name, {"tried": 0, "rows kept": 0})
        for k in range(kills):
            before, how = contents(place.out), (signal.SIGKILL, signal.SIGINT)[k % 2]
            code, errors = disturbed(place, make(10 + k), chance.uniform(0.0, 0.95 * seconds), how)
            word, fault = judged(place, before, code, errors, how)
            found["tried"] += 1
            found[word] = found.get(word, 0) + 1
            found["rows kept"] += any(q for p in place.partials() for q in p.glob("*.csv"))
            wrong += [f"{name}, {k}, {word}: {fault}"] if fault else []
            wrong += _next_run(place, make(10 + k), name) if k % 5 == 4 or k == kills - 1 else []
    return counts, wrong


def _next_run(place, words, name):
    """What is wrong with the next undisturbed run of a command: it names what is left, and sweeps what is not."""
    kept = [p for p in place.partials() if any(q.name[0] != "." for q in p.iterdir())]
    code, errors, _ = place.run(words)
    wrong = [f"{name}: next run {code} {errors[-300:]}"] if code else []
    wrong += [f"{name}: {p.name} is not named" for p in kept if p.name not in errors or not p.exists()]
    wrong += [f"{name}: {left} stay" for left in [place.left()] if left]
    wrong += [f"{name}: {p.name} stays" for p in place.partials() if p not in kept]
    if fault := fault_of_results(place.out):
        wrong.append(f"{name}: {fault}")
    for path in kept:
        shutil.rmtree(path)
    return wrong


def killed(quick):
    """The table of disturbed runs; anything wrong is an exception."""
    names = ("run", "run, in time", "couple", "compare", "build")
    with tempfile.TemporaryDirectory() as folder:
        counts, wrong = campaign(folder, names, 2 if quick else KILLS)
    if wrong:
        raise AssertionError("\n".join(wrong))
    words = ("tried", "killed", "interrupted", "before it began", "finished", "rows kept")
    rows = [[name, *(found.get(word, 0) for word in words), 0] for name, found in counts.items()]
    rows.append(["all", *(sum(row[i] for row in rows) for i in range(1, len(words) + 2))])
    told = (
        f"Seed {SEED}. A signal (kill or Ctrl-C) comes at a random moment of a run into a folder with earlier results. "
        "Right: these are whole, or those of the new run are; exit code 130 and no traceback after Ctrl-C (before it "
        "began: Python itself was loading, and ended as it does); every table that a killed run has left has whole "
        "rows; the next run names what is left, sweeps temporary folders, and ends well."
    )
    return lines(table(["command", *words, "failed"], rows), told)


# Scenes that somebody has spoiled

MUTANTS = 1000
OUTCOMES = ("tried", "ran", "ended unconverged", "refused in a sentence")
SCENES = ("tether_in_wind", "typical_section", "hencky", "airbag", "v3_kite", "v3_kite_dynamic", "v3_kite_detailed")
WEIGHTS = (6, 8, 2, 2, 4, 2, 1)
VALUES = ("0", "-1", "1e300", "-1e300", "1e-300", "nan", "inf", "", "x", "3.5", "=1+1", "true", "\x00", "\x1b[31m", "é")
VALUES += ("99999999999999999999", '"', "[1, 2]", "1e5", "0.001", "2", "-0.0")
CELL = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?|[A-Za-z_]\w*")


def spoiled(text, chance):
    """A text with one thing changed, as slips of the hand and of editors change it."""
    rows = text.splitlines(keepends=True) or [""]
    at = chance.randrange(len(rows))

    def value():
        found = list(CELL.finditer(text))
        if not found:
            return text + chance.choice(VALUES)
        spot = chance.choice(found)
        return text[: spot.start()] + chance.choice(VALUES) + text[spot.end() :]

    def character():
        spot = chance.randrange(len(text) + 1)
        return text[:spot] + chance.choice("\x00,;\"'\n=[]{}#-+.\ufeffé ") + text[spot + chance.randrange(2) :]

    ways = (
        value, value, value, character,
        lambda: "".join(rows[:at] + rows[at + 1 :]),
        lambda: "".join([*rows[:at], rows[at], *rows[at:]]),
        lambda: text[: chance.randrange(len(text) + 1)],
        lambda: "".join([*rows[:at], rows[chance.randrange(len(rows))], *rows[at + 1 :]]),
        lambda: "".join([*rows[:1], *chance.sample(rows[1:], len(rows) - 1)]),
    )  # fmt: skip
    return chance.choice(ways)()


def mutant(source, folder, chance):
    """A copy of a scene with one to three of its files spoiled."""
    shutil.copytree(source, folder)
    names = sorted(p.name for p in folder.iterdir() if p.suffix in (".toml", ".csv", ".msh"))
    for _ in range(chance.choice((1, 1, 2, 3))):
        path = folder / chance.choice([*names, "scene.toml"])
        if not path.exists():
            continue
        if chance.random() < 0.03:
            path.unlink()
            continue
        data = spoiled(path.read_text(encoding="utf-8", errors="surrogateescape"), chance)
        path.write_bytes(data.encode("utf-8", errors="surrogateescape"))
    return folder


WORKER = """
import json, resource, signal, sys
resource.setrlimit(resource.RLIMIT_AS, (6 * 2**30, 6 * 2**30))
from typer.testing import CliRunner
from master.cli import app
def late(*_):
    raise TimeoutError("too slow")
signal.signal(signal.SIGALRM, late)
for line in sys.stdin:
    words = json.loads(line)
    signal.alarm(120)
    done = CliRunner().invoke(app, words)
    signal.alarm(0)
    error = None if isinstance(done.exception, (SystemExit, type(None))) else repr(done.exception)[:300]
    print("ANSWER " + json.dumps([done.exit_code, error, done.output[:2000]]), flush=True)
"""


def tried(folders, motion):
    """(exit code, traceback or None, last output) of a short run of each scene folder, in a process of their own."""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    process, found = None, []
    for folder in folders:
        if process is None or process.poll() is not None:
            _ended(process)
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
            process = subprocess.Popen([sys.executable, "-c", WORKER], env=environment, **pipes)
        more = (
            ["--stop-time", "0.1", "--step", "0.05"] if motion(folder) else ["--max-iterations", "2", "--no-stability"]
        )
        out = folder.with_name(f"{folder.name}_out")
        words = ["run", str(folder), "--backend", "in-process", "--no-report", *more, "--out", str(out)]
        process.stdin.write(json.dumps(words) + "\n")
        process.stdin.flush()
        answer = next((line for line in process.stdout if line.startswith("ANSWER ")), None)
        if answer is None:
            process.wait()
            found.append((process.returncode, f"the process ended with {process.returncode}", ""))
            continue
        found.append(tuple(json.loads(answer.removeprefix("ANSWER "))))
    _ended(process)
    return found


def _ended(process):
    """Let a worker end, where there is one."""
    if process is not None:
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(BrokenPipeError):
                pipe.close()
        process.wait()


def mutated(quick):
    """The table of spoiled scenes; a traceback, or a refusal that is no sentence, is an exception."""
    counts, wrong = mutants(12 if quick else MUTANTS)
    if wrong:
        raise AssertionError("\n".join(wrong))
    words = OUTCOMES
    rows = [[name, *(found[word] for word in words), 0] for name, found in counts.items()]
    rows.append(["all", *(sum(row[i] for row in rows) for i in range(1, len(words) + 2))])
    told = f"Seed {SEED}. One to three changes in the files of a scene, then a short run of it."
    return lines(table(["scene", *words, "failed"], rows), told)


def mutants(count, seed=SEED):
    """Scene -> counts of what came of its mutants, and what was wrong."""
    chance, source = random.Random(seed), Path(__file__).parents[1] / "scenes"
    counts, wrong = {}, []
    with tempfile.TemporaryDirectory() as place:
        names = chance.choices(SCENES, WEIGHTS, k=count)
        folders = [mutant(source / n, Path(place) / str(k) / n, chance) for k, n in enumerate(names)]
        found = tried(folders, lambda folder: "[dynamics" in (source / folder.name / "scene.toml").read_text())
        for k, (name, (code, error, output)) in enumerate(zip(names, found, strict=True)):
            word = {0: "ran", 1: "ended unconverged", 2: "refused in a sentence"}.get(code, "?")
            row = counts.setdefault(
                name, dict.fromkeys(("tried", "ran", "ended unconverged", "refused in a sentence"), 0)
            )
            row["tried"] += 1
            row[word] = row.get(word, 0) + 1
            sentence = "kitecosim: " in output or "Usage: " in output
            if error or word == "?" or (code == 2 and not sentence):
                wrong.append(f"mutant {k} of {name}: {code} {error} {output[:300]}")
    return counts, wrong


ENTRIES = (
    Table(name="runs.killed", title="Runs killed and interrupted at random moments", build=killed),
    Table(name="scenes.mutated", title="Scenes with spoiled files", build=mutated),
)
