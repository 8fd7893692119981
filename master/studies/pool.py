"""Cells in worker processes, one process a job, so that a process that dies takes no other cell with it."""

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from master.report.results_folder import uninterrupted
from master.studies.cells import crashed, solved
from master.studies.grid import Cell

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
DIED = "its process ended without an answer (killed, out of memory, or a fault in compiled code)"


def rows(cells: Sequence[Cell], jobs: int) -> Iterator[tuple[Cell, dict[str, Any]]]:
    """Cells with their rows as they are finished, in `jobs` processes; 0: in this one, in their order.

    RuntimeError if worker processes do not start. On leaving early, the processes are ended.
    """
    if jobs == 0:
        yield from ((cell, solved(cell)) for cell in cells)
        return
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise RuntimeError("compare was called while a worker process started; see compare about the `__main__` guard.")
    others = set(multiprocessing.active_children())
    slots: dict[int, ProcessPoolExecutor] = {}
    try:
        with _one_thread():
            yield from _shared_out(list(cells), jobs, slots)
    finally:
        for pool in slots.values():
            pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()


def _shared_out(cells: list[Cell], jobs: int, slots: dict[int, ProcessPoolExecutor]) -> Iterator[Any]:
    waiting = iter(cells)
    running: dict[Future[dict[str, Any]], tuple[int, Cell]] = {}

    def begin(slot: int) -> None:
        cell = next(waiting, None)
        if cell is None:
            return
        if slot not in slots:
            slots[slot] = _started(slot)
        with _uninterrupted():
            running[slots[slot].submit(solved, cell)] = slot, cell

    for slot in range(min(jobs, len(cells))):
        begin(slot)
    while running:
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            slot, cell = running.pop(future)
            try:
                row = future.result()
            except BrokenProcessPool:
                slots.pop(slot).shutdown(wait=False)
                row = crashed(DIED)
            begin(slot)
            yield cell, row


def _started(slot: int) -> ProcessPoolExecutor:
    """A pool of one process; the first is asked whether it starts at all."""
    pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _ignore_interrupt)
    if slot == 0:
        try:
            with _uninterrupted():
                asked = pool.submit(os.getpid)
            asked.result()
        except BrokenProcessPool:
            raise RuntimeError(
                "the worker processes do not start; in a script, call compare below `if __name__ == '__main__':`, or "
                "with jobs=0."
            ) from None
    return pool


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes that start meanwhile hear of no interrupt before they ignore it, as they inherit the mask; this one
    hears of it afterwards, whichever of its threads it reaches.
    """
    with uninterrupted():
        if not hasattr(signal, "pthread_sigmask"):
            yield
            return
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _ignore_interrupt() -> None:
    """Ctrl-C reaches all processes of a terminal; the first one ends the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Processes started meanwhile load their BLAS with one thread: the matrices are small, and the cores are taken."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
