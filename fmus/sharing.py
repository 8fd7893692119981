"""What the FMUs of one process share: the packages that every FMU carries, and the interpreter."""

import _ctypes
import contextlib
import ctypes
import importlib
import os
import sys
from pathlib import Path

import scenes

PACKAGES = ("interface", "structural", "aero", "scenes", "fmus")  # what an FMU carries


def share_modules(resources: Path) -> None:
    """Load the packages from one place, let them find their modules later too, and leave the search path as it was.

    A process has each package once, from an installation or from the first FMU that needed it. The folder of that FMU
    may be deleted before the last module is imported: this FMU's folder and an installation are places to look in then.
    """
    origin = str(Path(scenes.__file__).parents[1])  # the solvers come from where the scenes come from
    sys.path.insert(0, origin)
    packages = [importlib.import_module(name) for name in (*PACKAGES, "pythonfmu")]
    sys.path.remove(origin)
    if str(resources) in sys.path:
        sys.path.remove(str(resources))
    for package in packages:
        name = package.__name__
        found = (finder.find_spec(name, None) for finder in sys.meta_path if hasattr(finder, "find_spec"))
        installed = next((spec.submodule_search_locations or [] for spec in found if spec), [])
        package.__path__ = _present([*package.__path__, str(resources / name), *installed])
        for inner, module in list(sys.modules.items()):  # those inside it that are loaded already
            if inner.startswith(f"{name}.") and hasattr(module, "__path__"):
                below = inner.removeprefix(f"{name}.").split(".")
                module.__path__ = _present([*module.__path__, *(str(Path(p, *below)) for p in package.__path__)])


def _present(places: list[str]) -> list[str]:
    """Those of the places that are folders, each once."""
    return [place for place in dict.fromkeys(places) if Path(place).is_dir()]


def end_cleanly(resources: Path) -> None:
    """Let go of the interpreter as the first thing when the process exits.

    Left to itself, PythonFMU's binary does it while it is unloaded, twice, the second time on freed memory and, where
    it owns the interpreter, after the libraries of numpy and scipy have ended: the process may abort or hang at exit,
    after correct results. Its own function, called before all that, leaves nothing to do for the two. The binary of
    this project (fmus/binary) has no such function, and needs none.
    """
    for path in (resources.parent / "binaries").glob("*/*.so"):
        with contextlib.suppress(OSError, AttributeError):  # of another platform, or made otherwise
            library = ctypes.CDLL(str(path), mode=os.RTLD_NOLOAD | os.RTLD_NOW)  # and thereby never unmapped
            if not hasattr(library, "finalizePythonInterpreter"):
                _ctypes.dlclose(library._handle)  # but this one is, when the host lets go of it
                continue
            last = ctypes.cast(library.finalizePythonInterpreter, ctypes.c_void_p)
            getattr(ctypes.CDLL(None), "__cxa_atexit")(last, None, None)
