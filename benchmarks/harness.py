"""Measures a case: run time, error, memory and counts of every point -> rows, CSV and what was wrong."""

import csv
import json
import math
import os
import platform
import statistics
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import numpy as np

from .registry import Case

ROOT = Path(__file__).resolve().parents[1]
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
COLUMNS = (
    "case", "knob", "value", "error", "unit", "time_s", "memory_MB", "series", "status", "time_min_s", "time_ratio",
)  # fmt: skip
# No further repeat of a point whose measurements have taken this long, s.
PATIENCE = 1.5


def measured(case: Case, quick=False, memory=True, progress=lambda done, total: None):
    """A row (dict) for every point of a case.

    The first round warms up caches and gives answers and counts (with `quick` it is the only one). Then the points are
    timed in turn, round after round, so that a disturbance of the machine meets all of them: `time_s` is the median of
    a point's rounds, `time_ratio` that of its ratios to the `ratio_to` series within the rounds. `memory_MB` see
    `peak_memory`.
    """
    points = case.points(quick)
    rounds = 1 if quick else case.repeats + 1
    times = {point: [] for point in points}
    outcomes = {}
    for turn in range(rounds):
        for k, point in enumerate(points):
            progress(turn * len(points) + k, rounds * len(points))
            if sum(times[point]) * case.loops > PATIENCE:
                continue
            outcome, seconds = _timed(case, point)
            outcomes.setdefault(point, outcome)
            if turn > 0 or quick:
                times[point].append(seconds)
    peaks = peak_memory(case, quick) if memory and case.memory else {}
    return [_row(case, p, outcomes[p], times, peaks.get(p, math.nan)) for p in points]


def _timed(case, point):
    with case.prepare(*point) as work:
        begin = time.perf_counter()
        for _ in range(case.loops):
            outcome = work()
        return outcome, (time.perf_counter() - begin) / case.loops


def _row(case, point, outcome, times, memory):
    series, value = point
    took, truth = times[point], case.truth(series, value)
    base = times.get((case.ratio_to, value), [])
    ratios = [a / b for a, b in zip(took, base, strict=False)]
    return {
        "case": case.name,
        "knob": case.knob,
        "value": value,
        "error": case.distance(outcome.answer, truth),
        "unit": case.unit,
        "time_s": statistics.median(took),
        "memory_MB": memory,
        "series": series,
        "status": outcome.status,
        "time_min_s": min(took),
        "time_ratio": statistics.median(ratios) if ratios else math.nan,
        **outcome.columns,
        **case.further(outcome.answer, truth),
    }


def peak_memory(case: Case, quick=False):
    """(series, value) -> growth of the resident memory, MB, up to its peak during set-up and one solve.

    Each point runs in its own process, forked from a fresh one that has loaded the libraries and nothing else, so that
    neither memory kept by earlier points nor that of Python and its libraries counts, while that of compiled solvers
    does (VmHWM - VmRSS of Linux; tracemalloc would not see SuperLU).
    """
    command = [sys.executable, "-m", "benchmarks.memory", case.name, *(["--quick"] if quick else [])]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)
    if done.returncode:
        raise RuntimeError(f"the memory of {case.name} could not be measured: {done.stderr.strip()[-500:]}")
    points = case.points(quick)
    return dict(zip(points, json.loads(done.stdout.splitlines()[-1]), strict=True))


def wrong(case: Case, rows):
    """Sentences about rows whose status or error is not what the case allows."""
    out = []
    judged = set(case.values) if case.finer is None else {{"larger": max, "smaller": min}[case.finer](case.values)}
    for row in rows:
        where = " ".join(f"{case.name} {row['series']} at {case.knob} {row['value']}".split())
        if row["status"] not in case.statuses:
            out.append(f"{where} ended as {row['status']}.")
        elif row["status"] == "converged" and row["value"] in judged and not row["error"] <= case.bound:
            out.append(f"{where} has an error of {row['error']:.3g} {case.unit}, more than {case.bound:g}.")
    return out


def exponents(case: Case, rows):
    """Series -> fitted exponent of `case.fit`, where at least three points allow one."""
    out = {}
    for series in dict.fromkeys(r["series"] for r in rows) if case.fit else ():
        fit = case.fit
        own = [r for r in rows if r["series"] == series and r["status"] == "converged"]
        pairs = [(r[fit.x], r[fit.y]) for r in own if r[fit.x] >= fit.least and r[fit.y] > fit.floor]
        if len(pairs) >= 3:
            x, y = np.log(np.array(pairs, float)).T
            out[series] = float(np.polyfit(x, y, 1)[0])
    return out


def columns_of(rows):
    """CSV columns: `COLUMNS`, then those of the outcomes in the order of their first appearance."""
    return list(dict.fromkeys([*COLUMNS, *(key for row in rows for key in row)]))


def write_csv(path, rows):
    """The rows as CSV; missing and undefined values are empty."""
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.DictWriter(file, columns_of(rows), restval="", lineterminator="\n")
        out.writeheader()
        out.writerows({k: "" if isinstance(v, float) and math.isnan(v) else v for k, v in r.items()} for r in rows)


def machine(quick):
    """What the figures were made on."""
    processor = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return {
        "processor": processor,
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in ("numpy", "scipy", "fmpy", "pythonfmu")},
        "threads": {name: os.environ.get(name, "not set") for name in THREADS},
        "quick": quick,
    }
