"""Whether the FMUs give in: ten thousand random sequences of calls, in processes that may die."""

import collections
import json
import os
import pickle
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import fmpy
import numpy as np

from .registry import Table
from .text import lines, table

SEQUENCES, SEED = 10_000, 2024
COARSE = {"canopy_stations": 2}
# FMU (scene, side) -> its share; those of the detailed scenes take some ten times as long a step.
SHARES = {
    ("v3_kite", "structural"): 0.29,
    ("v3_kite", "aero"): 0.30,
    ("typical_section", "structural"): 0.17,
    ("typical_section", "aero"): 0.17,
    ("v3_kite_detailed", "structural"): 0.02,
    ("v3_kite_detailed", "aero"): 0.03,
    ("v3_hanging_test", "structural"): 0.02,
}
CALLS = (5, 26)  # of a sequence


def unpacked(folder, chosen=tuple(SHARES)):
    """Folders of the FMUs, unpacked: side -> path."""
    import scenes
    from fmus.builder import build

    for name in dict.fromkeys(name for name, _ in chosen):
        settings = COARSE if "canopy_stations" in scenes.load(name).offers else {}
        for path in build(scenes.load(name, settings), folder):
            fmpy.extract(str(path), str(Path(folder) / path.stem))
    return {(name, side): Path(folder) / f"{name}_{side}" for name, side in chosen}


def legal(folders):
    """FMU -> (serialised state of a converged explicit exchange, legal inputs, bytes of the outputs of a step)."""
    from .fmu_raw import Instance, Library, settled

    libraries = {key: Library(folder) for key, folder in folders.items()}
    found = {}
    for name in dict.fromkeys(name for name, _ in folders):
        pair = {side: Instance(libraries[key]) for key in folders for side in [key[1]] if key[0] == name}
        for instance in pair.values():
            instance.initialise()
        for t in range(30):
            for side, other in (("aero", "structural"), ("structural", "aero")):
                if side in pair:
                    for block, (kind, causality, places) in pair[side].library.blocks.items():
                        if causality == "input" and other in pair and block in pair[other].library.blocks:
                            values = pair[other].get(kind, pair[other].library.blocks[block][2])[1]
                            pair[side].set(kind, places, values)
                    pair[side].step(float(t))
        for side, instance in pair.items():
            places = instance.library.places("input", kind="Real")
            values = 1.01 * instance.get("Real", places)[1]  # so that a step has something to solve
            values += 2.0 if not values.any() else 0.0
            content = instance.serialised(instance.saved()[1])[1]
            inputs = {"Real": (places, values)}
            found[name, side] = content, inputs, settled(instance, content, inputs)
    return found


def run_one(k, seed, libraries, known, pool):
    """One sequence; a record of it as a dictionary, with `problem` where something did not hold."""
    from .fmu_calls import Broken, Sequence
    from .fmu_raw import CATEGORIES, Instance, settled

    rng = np.random.default_rng([seed, k])
    keys = list(libraries)
    shares = np.array([SHARES[key] for key in keys])
    key = keys[int(rng.choice(len(keys), p=shares / shares.sum()))]
    mate = keys[int(rng.integers(len(keys)))]
    for used in (key, mate):
        if used not in pool:
            pool[used] = Instance(libraries[used])
    content, inputs, expected = known[key]
    fresh = k % 2 == 1 and rng.random() < 0.5
    instance = Instance(libraries[key]) if fresh else pool[key]
    other = pool[mate] if pool[mate] is not instance else Instance(libraries[key])
    instance.slowest, calls = (0.0, ""), instance.calls
    foreign = [part for of, (part, _, _) in known.items() if of != key] or [b"none"]
    sequence = Sequence(rng, instance, other, foreign)
    record = {"k": k, "fmu": "_".join(key), "problem": ""}
    try:
        if k % 2 == 0:
            sequence.contents.append(content)
            settled(instance, content, inputs)
        elif not fresh:
            sequence.check("Reset", instance.call("Reset"), 0)
        sequence.run(int(rng.integers(*CALLS)), k % 2 == 1 and rng.random() < 0.6)
        instance.log_only(1, [])
        sequence.wanted = set(CATEGORIES.values())
        if settled(instance, content, inputs) != expected:
            raise Broken("other bits after the legal state was restored")
    except (Broken, RuntimeError) as error:
        record["problem"] = f"{error} after {' | '.join(sequence.trace[-12:])}"
    if not fresh and (record["problem"] or rng.random() < 0.02):
        pool.pop(key).free()
    elif fresh:
        instance.free()
    if other not in pool.values() and other is not instance:
        other.free()
    record |= {"calls": instance.calls - calls, "slowest": instance.slowest, "statuses": sequence.statuses}
    return record


def work(folder, seed, ks):
    """The sequences of one worker, each announced and recorded as a line on the standard output."""
    from .fmu_raw import Library

    folders, known = pickle.loads((Path(folder) / "legal.pickle").read_bytes())
    libraries = {key: Library(path) for key, path in folders.items()}
    pool: dict = {}
    for k in ks:
        print(f"begin {k}", flush=True)
        print(json.dumps(run_one(k, seed, libraries, known, pool)), flush=True)


def worker(folder, seed, ks, records, every):
    """Run sequences in processes, the next one where one dies."""
    ks = list(ks)
    while ks:
        command = [sys.executable, "-W", "error", "-m", __name__, str(folder), str(seed), json.dumps(ks)]
        with tempfile.TemporaryFile() as errors:
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process:
                at = None
                for line in process.stdout:
                    if line.startswith("begin "):
                        at = int(line.split()[1])
                        continue
                    records.append(json.loads(line))
                    every(records)
                    ks.remove(at)
                    at = None
            errors.seek(0)
            said = errors.read().decode(errors="replace").strip()
        if said or process.returncode or ks:
            where = f"sequence {at}" if at is not None else "between sequences"
            dead = f"{where}: the process ended with {process.returncode} and said {said[-3000:]!r}"
            records.append({"k": at, "fmu": "", "problem": dead, "calls": 0, "slowest": (0.0, ""), "statuses": {}})
            if at is None:
                return
            ks.remove(at)


def campaign(sequences, seed=SEED, chosen=tuple(SHARES), workers=2, every=lambda records: None):
    """Records of all sequences, in their order."""
    records: list[dict] = []
    with tempfile.TemporaryDirectory() as folder:
        prepare = [sys.executable, "-W", "error", "-m", __name__, folder, json.dumps(list(chosen))]
        subprocess.run(prepare, check=True)
        parts = [range(first, sequences, workers) for first in range(workers)]
        threads = [threading.Thread(target=worker, args=(folder, seed, part, records, every)) for part in parts]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return sorted(records, key=lambda record: -1 if record["k"] is None else record["k"])


def fuzz(quick):
    """The campaign as a table; what did not hold is an exception that names seed and sequence."""
    begin = time.perf_counter()
    records = campaign(200 if quick else SEQUENCES, workers=os.cpu_count() or 1)
    minutes = (time.perf_counter() - begin) / 60.0
    if wrong := [record for record in records if record["problem"]]:
        told = "\n".join(f"sequence {r['k']} of {r['fmu']}: {r['problem']}" for r in wrong[:20])
        raise AssertionError(f"{len(wrong)} of {len(records)} sequences (seed {SEED}) broke a rule:\n{told}")
    rows = []
    for fmu in dict.fromkeys("_".join(key) for key in SHARES):
        own = [record for record in records if record["fmu"] == fmu]
        counted = sum((collections.Counter(record["statuses"]) for record in own), collections.Counter())
        seconds, name = max((tuple(record["slowest"]) for record in own), default=(0.0, ""))
        statuses = [counted[status] for status in ("0", "2", "3")]
        calls = sum(record["calls"] for record in own)
        rows.append([fmu, len(own), calls, *statuses, f"{seconds:.2f}", f"fmi2{name}"])
    head = ["FMU", "sequences", "calls", "judged OK", "Discard", "Error", "slowest call, s", "which"]
    told = (
        f"Seed {SEED}; {minutes:.1f} minutes in {os.cpu_count()} processes. Half of the sequences begin from a coupled "
        "state, half from a new or reset instance. In every one: no end of the process, no call above 20 s (100 s of "
        "the inflatable wings), no status but OK, Discard and Error, a sentence of that status for the latter two and "
        "none for the first, the old values after a refused one, the old outputs after a discarded step, finite ones "
        "after any other; and after the coupled state was restored, a step to the same bits as in the process that "
        "made it."
    )
    return lines(table(head, rows), told)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        made = unpacked(sys.argv[1], [tuple(key) for key in json.loads(sys.argv[2])])
        (Path(sys.argv[1]) / "legal.pickle").write_bytes(pickle.dumps((made, legal(made))))
    else:
        work(sys.argv[1], int(sys.argv[2]), json.loads(sys.argv[3]))

ENTRIES = (Table(name="fmus.fuzz", title="Random sequences of calls of FMI", build=fuzz),)
