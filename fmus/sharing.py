"""What the FMUs of one process share: the interpreter."""

import _ctypes
import contextlib
import ctypes
import os
from pathlib import Path


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
