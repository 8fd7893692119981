"""Folders that belong to a living process: temporary ones, which go with it, and those that results are written to.

A folder is held by a lock on itself, which the system gives back however a process ends. So whether a folder still has
an owner can be asked, across containers too, and no number of a process has to be trusted.
"""

import os
import shutil
import stat
import tempfile
import weakref
from pathlib import Path
from types import TracebackType
from typing import Self

PREFIX = "kitecosim."
_SWEPT: set[str] = set()  # folders for temporary files that this process has looked through


class Hold:
    """The lock of this process on a folder; it ends with `release`, or with the process."""

    def __init__(self, descriptor: int | None) -> None:
        self._descriptor = descriptor

    @property
    def holds(self) -> bool:
        """Whether it is held by now."""
        return self._descriptor is not None

    def release(self) -> None:
        """Let others have the folder; once is enough."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.release()


def hold(folder: Path, wait: bool = False) -> Hold | None:
    """The lock on a folder that is there; None where another process has it (unless this one is to `wait`), where it
    is gone, and where nobody can tell, as the system has no such locks.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        return None
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        if os.path.samestat(os.fstat(descriptor), os.lstat(folder)):  # else it was swept or renamed meanwhile
            return Hold(descriptor)
    except OSError:
        pass
    except BaseException:
        os.close(descriptor)
        raise
    os.close(descriptor)
    return None


class PrivateFolder:
    """A new temporary folder, which no other process writes to; `close`, or the end of the `with`, removes it.

    The first of a process sweeps those whose owner was killed.
    """

    def __init__(self) -> None:
        place = tempfile.gettempdir()
        if place not in _SWEPT:
            _SWEPT.add(place)
            sweep(Path(place))
        while True:
            self.path = Path(tempfile.mkdtemp(prefix=PREFIX))
            held = hold(self.path, wait=True)
            if held is not None or self.path.is_dir():  # a sweep may have come between
                break
        self._remove = weakref.finalize(self, _removed, self.path, held)

    def close(self) -> None:
        """Remove the folder; once is enough."""
        self._remove()

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def _removed(path: Path, held: Hold | None) -> None:
    shutil.rmtree(path, ignore_errors=True)
    if held is not None:
        held.release()


def sweep(place: Path) -> list[Path]:
    """Remove the temporary folders in a `place` that have no living owner; which they were."""
    found = []
    for path in place.glob(f"{PREFIX}*"):
        try:
            about = path.lstat()
        except OSError:
            continue
        mine = not hasattr(os, "getuid") or about.st_uid == os.getuid()
        held = hold(path) if stat.S_ISDIR(about.st_mode) and mine else None
        if held is not None:
            with held:
                shutil.rmtree(path, ignore_errors=True)
            found.append(path)
    return found
