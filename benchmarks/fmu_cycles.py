"""Whether FMUs leave anything behind: a thousand times made, initialised, stepped and freed, each way in a process."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from .fmu_fuzz import unpacked
from .fmu_raw import OK, Instance, Library
from .registry import Table
from .text import lines, table

CYCLES, SETTLED = 1000, 100  # and after how many the memory is taken as settled
SCENE = "v3_kite"
# Growth from SETTLED to the end, MB, that is no leak but pages that the allocators of C and Python have not given back.
# An instance that stayed would be seen: its arrays take more than 0.05 MB, in a thousand cycles more than 50.
BOUND = 3.0


def used():
    """Resident memory of this process in MB, its mappings of files, as libraries are, and its open files (Linux)."""
    resident = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    files = [line for line in Path("/proc/self/maps").read_text().splitlines() if "/" in line]
    return resident, len(files), len(os.listdir("/proc/self/fd"))


def loaded_once(folders):
    """One cycle of all FMUs whose libraries stay loaded, as a function."""
    libraries = [Library(folder) for folder in folders]

    def cycle():
        for library in libraries:
            instance = Instance(library)
            statuses = [instance.initialise(), instance.step(), instance.saved()[0], instance.call("Terminate")]
            instance.free()
            if max(statuses) != OK:
                raise RuntimeError(f"a cycle of {library.name} ended with {statuses}: {instance.log}")

    return cycle


def loaded_anew(folders):
    """One cycle of all FMUs as participants, which unpack and load the library and put both away."""
    from master.coupling import FmuParticipant

    def cycle():
        for folder in folders:
            with FmuParticipant(Path(folder).with_suffix(".fmu")) as participant:
                participant.step(0.0, 1.0)
                participant.save()

    return cycle


WAYS = {"library loaded once": loaded_once, "unpacked and loaded anew": loaded_anew}


def endured(way, folders, cycles):
    """Seconds a cycle, and what is `used` after SETTLED (or half) of the cycles and at the end."""
    cycle = WAYS[way](folders)
    begin = time.perf_counter()
    for k in range(cycles):
        if k == min(SETTLED, cycles // 2):
            settled = used()
        cycle()
    return (time.perf_counter() - begin) / cycles, settled, used()


def cycles_in_process(way, folders, cycles):
    """`endured` in a process of its own, where a warning is an error."""
    given = [way, json.dumps([str(folder) for folder in folders]), str(cycles)]
    command = [sys.executable, "-W", "error", "-m", __name__, *given]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def left_behind(settled, end):
    """What has grown, in words; nothing where all is in order."""
    grown = [f"{end[0] - settled[0]:.2f} MB"] if end[0] - settled[0] > BOUND else []
    grown += [
        f"{b - a} {what}"
        for a, b, what in zip(settled[1:], end[1:], ("mapped files", "open files"), strict=True)
        if b > a
    ]
    return ", ".join(grown)


def cycles(quick):
    """The table; growth beyond the bound is an exception."""
    count, rows = 20 if quick else CYCLES, []
    with tempfile.TemporaryDirectory() as folder:
        folders = list(unpacked(folder, [(SCENE, "structural"), (SCENE, "aero")]).values())
        for way in WAYS:
            seconds, settled, end = cycles_in_process(way, folders, count)
            if not quick and (grown := left_behind(settled, end)):
                raise AssertionError(f"{way}: {grown} more after {count} cycles than after {SETTLED}.")
            rows.append([way, count, 1e3 * seconds, settled[0], end[0] - settled[0]])
            rows[-1] += [f"{a} → {b}" for a, b in zip(settled[1:], end[1:], strict=True)]
    head = ["way", "cycles", "ms a cycle", f"memory after {SETTLED}, MB", "growth to the end, MB"]
    told = (
        "A cycle makes the two FMUs of the V3 kite, initialises them, steps once, takes a state that it leaves to the "
        f"instance to free, and frees them. Growth of up to {BOUND:g} MB is what allocators hold back."
    )
    return lines(table([*head, "mapped files", "open files"], rows), told)


if __name__ == "__main__":
    print(json.dumps(endured(sys.argv[1], json.loads(sys.argv[2]), int(sys.argv[3]))))

ENTRIES = (Table(name="fmus.cycles", title="FMUs made and freed a thousand times", build=cycles),)
