"""Peak memory of the points of one case, each in a process forked from this fresh one: `python -m benchmarks.memory`.

Prints a JSON list, MB, in the order of the case's points.
"""

import json
import os
import sys
from pathlib import Path

from .registry import registered


def resident(field):
    """VmRSS (now) or VmHWM (peak) of this process, MB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(field)) / 1024.0


def growth(case, point):
    """Peak resident memory, MB, above that before the set-up, of one solve in a forked process."""
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            before = resident("VmRSS")
            with case.prepare(*point) as work:
                work()
                os.write(write, repr(resident("VmHWM") - before).encode())
            code = 0
        finally:
            os._exit(code)
    os.close(write)
    with os.fdopen(read) as pipe:
        text = pipe.read()
    _, status = os.waitpid(pid, 0)
    if status or not text:
        raise SystemExit(f"{case.name} {point}: no memory was measured, the process ended with status {status}")
    return float(text)


if __name__ == "__main__":
    chosen = registered()[sys.argv[1]]
    print(json.dumps([growth(chosen, point) for point in chosen.points("--quick" in sys.argv)]))
