"""A command in a process of its own, which foreign code may end: what it left is then told in one sentence.

An FMU that calls abort or exit takes its process with it. The process that waits loads nothing of it.
"""

import contextlib
import ctypes
import mmap
import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOM = 256  # bytes for the name of who is called
DIES_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux
FORWARDED = ("SIGINT", "SIGTERM", "SIGHUP")
EXIT_ENDED = 1


class SharedState:
    """Memory that both processes see: whether the work has come to an end, and whose code runs now."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, 1 + ROOM)

    def call(self, name: str) -> None:
        """The participant whose code runs from now on; "" where none does."""
        text = name.encode()[: ROOM - 1]
        self._memory[1 : 2 + len(text)] = text + b"\0"

    def end(self) -> None:
        """The work has come to an end, whatever that is."""
        self._memory[0] = 1

    @property
    def ended(self) -> bool:
        """Whether it has."""
        return bool(self._memory[0])

    @property
    def called(self) -> str:
        """The participant whose code runs."""
        return self._memory[1:].partition(b"\0")[0].decode("utf-8", "replace")


def possible() -> bool:
    """Whether a command can have a process of its own: on systems that fork, where it writes to real files."""
    real = sys.stdout is sys.__stdout__ and sys.stderr is sys.__stderr__
    return hasattr(os, "fork") and real and threading.active_count() == 1


def isolated(work: Callable[[Callable[[str], Any]], int], out: Path) -> int:
    """The exit code of `work(watch)`, run in a process of its own that writes results to `out`; in this one where that
    is not possible. `work` tells `watch` whose code it calls.

    A process that was ended before the work was done is told on standard error.
    """
    if not possible():
        return work(lambda name: None)
    sys.stdout.flush()
    sys.stderr.flush()
    shared, parent = SharedState(), os.getpid()
    child = os.fork()
    if child == 0:
        _follow(parent)
        try:
            return work(shared.call)
        finally:
            shared.end()
    status = _awaited(child)
    code = os.waitstatus_to_exitcode(status)
    if shared.ended:
        return code if code >= 0 else EXIT_ENDED
    how = f"with {signal.Signals(-code).name}" if code < 0 else f"by exit({code})"
    who = f"participant {shared.called} ended the process" if shared.called else "the process was ended"
    partial = out.with_name(f"{out.name}.partial")
    there = (partial / "results.csv").is_file()
    left = f"what was written until then is in {partial}" if there else "nothing was written until then"
    print(f"kitecosim: {who} {how}; {left}.", file=sys.stderr)
    return EXIT_ENDED


def _follow(parent: int) -> None:
    """In the new process: signals of the terminal come from the one that waits, and its end is the end of this."""
    os.setpgid(0, 0)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DIES_WITH_PARENT, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(EXIT_ENDED)


def _awaited(child: int) -> int:
    """The status with which a process ended; signals meanwhile are for it."""
    numbers = [getattr(signal, name) for name in FORWARDED if hasattr(signal, name)]

    def forward(number: int, frame: Any) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, number)

    before = {number: signal.signal(number, forward) for number in numbers}
    try:
        return os.waitpid(child, 0)[1]
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
