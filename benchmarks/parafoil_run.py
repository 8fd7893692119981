"""One coupled run of a parafoil, measured in a process of its own: `python -m benchmarks.parafoil_run MESH WIND`.

Prints JSON: what the table of meshes shows, seconds of set-up and solve, the share of each part of the work, peak
memory. Shares come from the profiler of the standard library, which adds little to work on whole arrays.
"""

import cProfile
import json
import pstats
import resource
import sys
import time

import numpy as np

MEGABYTES = 1.0 / 1024.0  # of the KB that Linux counts
# part -> (end of the file's path, function): cumulative time there; parts of one solver add up to less than all of it.
STRUCTURE = {
    "factorisation": (("structural/solve/linear.py", "factorised"), ("structural/solve/newton.py", "_factors")),
    "assembly": (("structural/assembly.py", "_evaluated"),),
}
FLOW = {
    "matrix": (("aero/panel/influence.py", "_influence"),),
    "loads": (("aero/panel/model.py", "_loads"),),
    "far field": (("aero/panel/model.py", "_far"),),
}
SOLVER = ("aero/panel/solver.py", "solve")


def seconds_in(stats, places):
    """Cumulative seconds of functions."""
    return sum(
        times[3]
        for (path, _, name), times in stats.items()
        if any(path.endswith(end) and name == function for end, function in places)
    )


def parts(stats, seconds):
    """Seconds of each part of a solve."""
    found = {name: seconds_in(stats, places) for name, places in STRUCTURE.items()}
    found["other structure"] = seconds["structural"] - sum(found.values())
    flow = {name: seconds_in(stats, places) for name, places in FLOW.items()}
    flow["solve"] = seconds_in(stats, [SOLVER]) - flow["matrix"]
    flow["other flow"] = seconds["aero"] - sum(flow.values())
    return found | flow | {"transfer and scheme": seconds["total"] - seconds["structural"] - seconds["aero"]}


def main(mesh, wind):
    """Flies the kite of 160 m2 on a mesh."""
    import scenes
    from master.coupling import Coupling, scheme, solve

    from .parafoils import LARGE, cells

    begin = time.perf_counter()
    coupling = Coupling.in_process(scenes.load(LARGE, {"variant": mesh}), {"wind_speed": wind})
    ready = time.perf_counter()
    with cProfile.Profile() as profile:
        end = solve(coupling, scheme("iqn-ils", coupling))
    stats = pstats.Stats(profile).stats
    peak = MEGABYTES * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    size = float(np.linalg.norm(end.displacement))
    found = {"cells": cells(coupling, end), "residual": end.history[-1]["residual_m"] / size, "memory_MB": peak}
    found |= {"setup_s": ready - begin, "solve_s": end.seconds["total"], "parts": parts(stats, end.seconds)}
    print(json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
