"""What the binary of an FMU (fmus/front/slave.c) asks of Python: an instance, and what it has logged."""

import importlib
import importlib.util
import sys
from pathlib import Path
from typing import Any


def instance(resources: str, name: str, visible: bool) -> Any:
    """A new slave of the FMU with these resources.

    Its class is one of the project's, or that of the script which slavemodule.txt names, as PythonFMU has it.
    """
    folder = Path(resources)
    stem = (folder / "slavemodule.txt").read_text(encoding="utf-8").strip()
    if (folder / "fmus" / f"{stem}.py").is_file():
        module = importlib.import_module(f"fmus.{stem}")
    else:
        spec = importlib.util.spec_from_file_location(stem, folder / f"{stem}.py")
        if spec is None or spec.loader is None:
            raise ImportError(f"The FMU has no script {stem}.py.")
        module = sys.modules[stem] = importlib.util.module_from_spec(spec)  # where states find their classes
        spec.loader.exec_module(module)
    own = [value for value in vars(module).values() if isinstance(value, type) and value.__module__ == module.__name__]
    slaves = [value for value in own if hasattr(value, "do_step")]
    return slaves[-1](instance_name=name, resources=resources, visible=visible)


def drained(queue: list[Any]) -> list[tuple[int, str, str]]:
    """Status, category and text of the messages of a slave, taken from its queue."""
    messages = [(int(message.status), message.category or "logStatusError", message.msg) for message in queue]
    queue.clear()
    return messages
