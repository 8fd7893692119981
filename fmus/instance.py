"""What the binary of an FMU (fmus/binary/slave.c) asks of Python: an instance, and what it has logged."""

import importlib
import sys
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any

_LOCK = RLock()  # a script runs once, also where two threads make the first instances at once


def instance(resources: str, name: str, visible: bool) -> Any:
    """A new slave of the FMU with these resources.

    Its class is one of the project's, or that of the script which slavemodule.txt names, as PythonFMU has it.
    """
    folder = Path(resources)
    stem = (folder / "slavemodule.txt").read_text(encoding="utf-8").strip()
    if (folder / "fmus" / f"{stem}.py").is_file():
        module = importlib.import_module(f"fmus.{stem}")
    else:
        module = _script(stem, folder / f"{stem}.py")
    own = [value for value in vars(module).values() if isinstance(value, type) and value.__module__ == module.__name__]
    slaves = [value for value in own if hasattr(value, "do_step")]
    if not slaves:
        raise ValueError(f"{stem}.py has no class with a method do_step.")
    return slaves[-1](instance_name=name, resources=resources, visible=visible)


def _script(stem: str, path: Path) -> ModuleType:
    """The module of a script, where states find their classes; the one that is there, if it is of the same text."""
    text = path.read_text(encoding="utf-8")
    with _LOCK:
        module = sys.modules.get(stem)
        if module is None or vars(module).get("_text") != text:
            module = sys.modules[stem] = ModuleType(stem)
            vars(module)["__file__"] = str(path)
            exec(compile(text, str(path), "exec"), vars(module))
            vars(module)["_text"] = text  # it is whole
    return module


def drained(queue: list[Any]) -> list[tuple[int, str, str]]:
    """Status, category and text of the messages of a slave, taken from its queue."""
    messages, queue[:] = queue[:], []
    return [(int(m.status), _utf8(m.category or "logStatusError"), _utf8(m.msg)) for m in messages]


def _utf8(text: object) -> str:
    """A text, without what UTF-8 has no bytes for, as of the name of a file that is not in UTF-8."""
    return str(text).encode("utf-8", "backslashreplace").decode()
