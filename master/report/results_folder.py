"""The folder of the results of a command: written beside it as OUT.partial, put in its place at the end, as a whole.

What belongs to earlier results is told by a marker in the folder, with the names and contents of its files. A run that
is refused, fails or is killed takes nothing of them away; of two runs into one folder the last to finish has it.
"""

import contextlib
import hashlib
import itertools
import json
import logging
import os
import re
import shutil
import signal
import threading
from collections.abc import Collection, Iterator
from pathlib import Path, PurePosixPath
from types import FrameType, TracebackType
from typing import Any, Self

from master.coupling.participants.private_folder import Hold, hold
from master.report.record import clear_leftovers, named

MARKER = ".kitecosim.json"
REPLACED = ".kitecosim.replaced"  # earlier results, for the moment in which the new ones take their place
LAYOUT = 1
_LOG = logging.getLogger("kitecosim")


class ResultsFolder:
    """The folder `out` for the results of a command; files are written to `path`, and `place` puts them into `out`.

    `names` are those of all files that the command may write, with "/" where they are in a folder. ValueError in one
    sentence where that cannot be, or where one of them is there that no earlier results own, unless by `force`.
    `group` are the commands that share their results: those of the same group go when new ones come, others stay;
    where a group is to `keep` them, only files of the same names go.
    """

    def __init__(
        self, out: Path, names: Collection[str], group: str = "run", force: bool = False, keep: bool = False
    ) -> None:
        self.out, self.named, self._names = _resolved(out), out, sorted(names)
        self._group, self._force, self._keep = group, force, keep
        with self._alone():
            self._recover()
            self._require()
        self.path, self._hold = self._begun()
        self.placed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if not self.placed:
            if not _files(self.path):
                shutil.rmtree(self.path, ignore_errors=True)
            elif error is not None:
                error.add_note(f"what was written until then is in {_shown(self.path)}")
        self._hold.release()

    def place(self) -> list[str]:
        """Put what was written into the folder, and remove the earlier results; the names of the new files.

        ValueError in one sentence where files of others have come there in the meantime; the results stay in `path`.
        """
        new = {name: _digest(self.path / name) for name in _files(self.path)}
        with uninterrupted(), self._alone():
            foreign = [name for name in new if (self.out / name).is_dir()]
            foreign += [] if self._force else _foreign(self.out, list(new))
            if foreign:
                raise ValueError(
                    f"--out {self.named} has got a {foreign[0]} of somebody else; the results are in "
                    f"{_shown(self.path)}."
                )
            before = _owned(self.out)
            stale = [n for n, entry in before.items() if entry["by"] == self._group and n not in new and not self._keep]
            stale = [n for n in stale if not _changed(self.out / n, before[n])]
            stay = {n: entry for n, entry in before.items() if n not in new and n not in stale}
            made = {n: {"by": self._group, "sha256": digest} for n, digest in new.items()}
            _mark(self.path, {"state": "complete", "files": dict(sorted((stay | made).items())), "stale": stale})
            _moved(self.path, self.out)
            self.placed = True
            self._hold.release()
        return list(new)

    def _alone(self) -> Hold:
        """No other run puts results into the folder, or looks what is there, until it is released."""
        return hold(self.out.parent, wait=True) or Hold(None)

    def _require(self) -> None:
        """ValueError in one sentence for a folder that is no place for results."""
        named, out = self.named, self.out
        if (out / "scene.toml").exists():
            raise ValueError(
                f"--out {named} is a scene folder, whose tables would be overwritten; name another folder."
            )
        for name in self._names:
            if (out / name).is_dir():
                raise ValueError(f"--out {named} has a folder where {name} should go; name another folder.")
        if out.exists() and not out.is_dir():
            raise ValueError(f"--out {named} cannot be made a folder (not a directory); name another one.")
        foreign = [] if self._force else _foreign(out, self._names)
        if foreign:
            more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
            why = "that have changed since" if foreign[0] in _owned(out) else "that are not known to be results"
            raise ValueError(
                f"--out {named} has files {why}: {foreign[0]}{more}; name another folder, or add --force to replace "
                "them."
            )

    def _begun(self) -> tuple[Path, Hold]:
        """A folder to write to, which this process holds; what runs that were broken off have left is named."""
        above = self.out if _fixed(self.out) else self.out.parent
        taken = {path for path in self._left() if _taken(path)}
        try:
            above.mkdir(parents=True, exist_ok=True)
            while True:
                path = next(p for p in map(above.joinpath, self._partials()) if p not in taken)
                taken.add(path)
                with contextlib.suppress(FileExistsError):
                    path.mkdir()
                    held = hold(path, wait=True)
                    if held is not None or path.is_dir():  # else it was swept in this moment
                        _mark(path, {"state": "under way"})
                        return path, held or Hold(None)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise ValueError(f"--out {self.named} cannot be made a folder ({reason}); name another one.") from None

    def _partials(self) -> Iterator[str]:
        """OUT.partial, then OUT.partial-2 and so on."""
        name = f"{self.out.name or 'results'}.partial"
        yield name
        yield from (f"{name}-{number}" for number in itertools.count(2))

    def _left(self) -> list[Path]:
        """What is there of such names: beside the folder, or in it where it cannot be exchanged."""
        first = re.escape(next(self._partials()))
        found = []
        for above in (self.out.parent, self.out):
            with contextlib.suppress(OSError):
                found += [above / name for name in sorted(os.listdir(above)) if re.fullmatch(rf"{first}(-\d+)?", name)]
        return found

    def _recover(self) -> None:
        """Put complete results in place whose run was killed in the moment in which it did so."""
        for path in self._left():
            if _marker(path).get("state") != "complete":
                continue
            with hold(path) or Hold(None) as held:
                if held.holds and _marker(path).get("state") == "complete":
                    _moved(path, self.out)
                    _LOG.warning(
                        "kitecosim: note: %s has now the whole results of a run that was killed as it put them there.",
                        _shown(self.out),
                    )
        if _marker(self.out):
            shutil.rmtree(self.out / REPLACED, ignore_errors=True)
        for folder in {PurePosixPath(name).parent for name in self._names}:
            clear_leftovers(self.out / folder, [PurePosixPath(name).name for name in self._names])


def _taken(path: Path) -> bool:
    """Whether a run still writes to a folder, or has left something there, which is named; nothing of worth goes."""
    with hold(path) or Hold(None) as held:
        if not held.holds:
            return True
        files = _files(path)
        if not files and set(os.listdir(path)) <= {MARKER, f"{MARKER}.part"}:
            shutil.rmtree(path, ignore_errors=True)
            return os.path.lexists(path)
        if _marker(path):
            _LOG.warning(
                "kitecosim: note: %s has what a run that was broken off had written (%s); it stays there until you "
                "remove it.",
                _shown(path),
                ", ".join(files[:3]) + (f" and {len(files) - 3} more" if len(files) > 3 else ""),
            )
        return True


def _resolved(out: Path) -> Path:
    try:
        return out.resolve()
    except (OSError, RuntimeError) as error:
        raise ValueError(f"--out {out} cannot be made a folder ({str(error).lower()}); name another one.") from None


def _shown(path: Path) -> Path:
    """A path as short as it can be said from here."""
    with contextlib.suppress(ValueError, OSError):
        return path.relative_to(Path.cwd())
    return path


def _fixed(out: Path) -> bool:
    """Whether a folder cannot be exchanged for another: somebody works in it, or it is where a disk is mounted."""
    if not out.is_dir():
        return False
    with contextlib.suppress(OSError):
        if Path.cwd().is_relative_to(out):
            return True
    return os.path.ismount(out) or not os.access(out.parent, os.W_OK)


def _files(folder: Path) -> list[str]:
    """The files in a folder and those below it, but for the marker and what is under way."""
    found = [p.relative_to(folder).as_posix() for p in sorted(folder.rglob("*")) if not p.is_dir() or p.is_symlink()]
    return [name for name in found if not PurePosixPath(name).parts[0].startswith(".")]


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _marker(folder: Path) -> dict[str, Any]:
    """The content of the marker in a folder; {} where there is none of this layout."""
    try:
        content = json.loads((folder / MARKER).read_text(encoding="utf-8"))
        if content["layout"] == LAYOUT and isinstance(content["state"], str):
            return dict(content)
    except (OSError, ValueError, LookupError, TypeError):
        pass
    return {}


def _mark(folder: Path, content: dict[str, Any]) -> None:
    part = folder / f"{MARKER}.part"
    with named(part):
        part.write_text(json.dumps({"layout": LAYOUT, **content}, indent=1) + "\n", encoding="utf-8")
    part.replace(folder / MARKER)


def _owned(folder: Path) -> dict[str, dict[str, str]]:
    """Name -> group and SHA-256 of the files of earlier results."""
    files = _marker(folder).get("files", {})
    good = isinstance(files, dict) and all(isinstance(e, dict) and {"by", "sha256"} <= e.keys() for e in files.values())
    return files if good and all(_inside(name) for name in files) else {}


def _inside(name: str) -> bool:
    path = PurePosixPath(name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts


def _changed(path: Path, entry: dict[str, str]) -> bool:
    try:
        return path.is_symlink() or _digest(path) != entry["sha256"]
    except OSError:
        return True


def _foreign(out: Path, names: Collection[str]) -> list[str]:
    """Those of the names that are there and that the results there do not own as they are."""
    there, owned = [name for name in names if os.path.lexists(out / name)], _owned(out)
    return [name for name in there if name not in owned or _changed(out / name, owned[name])]


def _moved(path: Path, out: Path) -> None:
    """Put complete results from `path` into `out`. Killed anywhere in it, it can be called again."""
    content, new = _marker(path), _files(path)
    if path.parent != out and set(_everything(out)) <= _with_folders([*content["stale"], *new]):
        with contextlib.suppress(OSError):  # of a folder that somebody has mounted, say
            if out.exists():
                out.rename(path / REPLACED)
            path.rename(out)
            shutil.rmtree(out / REPLACED, ignore_errors=True)
            return
    for name in new:
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).replace(out / name)
    for name in content["stale"]:
        (out / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # others are in it
            (out / name).parent.rmdir()
    (path / MARKER).replace(out / MARKER)
    shutil.rmtree(path, ignore_errors=True)


def _with_folders(names: Collection[str]) -> set[str]:
    return {str(part) for name in names for part in (PurePosixPath(name), *PurePosixPath(name).parents)}


def _everything(folder: Path) -> list[str]:
    """All there is in a folder and below it but the marker, folders too."""
    return [name for p in folder.rglob("*") if (name := p.relative_to(folder).as_posix()) != MARKER]


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """An interrupt (Ctrl-C) that comes meanwhile comes at its end."""
    if threading.current_thread() is not threading.main_thread():  # no other one is interrupted
        yield
        return
    came: list[FrameType | None] = []
    before = signal.signal(signal.SIGINT, lambda _, frame: came.append(frame))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came:
            signal.raise_signal(signal.SIGINT)
