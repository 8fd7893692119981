"""The compiled kernels (potentials.c, velocities.c), where they were compiled when the project was installed."""

import ctypes
import os
import platform
import sys
import sysconfig
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

CARRIED = "_kernels.so"  # what FMUs call the library, which is that of 64-bit Linux
_ARRAY, _COUNT, _NUMBER = ctypes.c_void_p, ctypes.c_long, ctypes.c_double
SIGNATURES = {
    "panel_potentials": [*[_ARRAY] * 3, _COUNT, _ARRAY, _COUNT, _NUMBER, _ARRAY, _COUNT, _ARRAY, _ARRAY, _COUNT],
    "strip_potentials": [_ARRAY, _COUNT, _ARRAY, _COUNT, _ARRAY, _COUNT],
    "panel_velocities": [*[_ARRAY] * 3, _COUNT, _ARRAY, _COUNT, _NUMBER, _ARRAY, _COUNT],
    "strip_velocities": [_ARRAY, _ARRAY, _COUNT, _ARRAY, _COUNT, _NUMBER, _ARRAY, _COUNT],
}


@cache
def _library():
    """The library beside this module, None where there is none that this machine can load."""
    names = [f"_kernels{sysconfig.get_config_var('EXT_SUFFIX')}"]
    if sys.platform == "linux" and platform.machine() == "x86_64":
        names.append(CARRIED)
    for path in map(Path(__file__).with_name, names):
        try:
            library = ctypes.CDLL(str(path if path.is_file() else _kept(path)))
        except OSError:
            continue
        for name, types in SIGNATURES.items():
            getattr(library, name).argtypes = types
        return library
    return None


def _kept(path):
    """A file in memory with what was read of the library before its folder was deleted. OSError if nothing was."""
    loader: Any = __spec__.loader
    content = loader.get_data(str(path))
    file = os.memfd_create(path.name)  # stays open: the loader knows libraries by their names, and numbers return
    os.write(file, content)
    return f"/proc/self/fd/{file}"


def compiled(kernel=None):
    """The library to use, or None for numpy: as `kernel` says, "compiled" or "numpy", or else the environment variable
    KITECOSIM_PANEL_KERNEL, or else the library where there is one. ValueError for another name, and where the library
    is wanted and missing.
    """
    kernel = kernel or os.environ.get("KITECOSIM_PANEL_KERNEL") or None
    if kernel not in (None, "compiled", "numpy"):
        raise ValueError(f"The kernel of the panel method is 'compiled' or 'numpy', not {kernel!r}.")
    library = None if kernel == "numpy" else _library()
    if kernel == "compiled" and library is None:
        raise ValueError(
            "The compiled kernel of the panel method is missing; install a C compiler (Debian: gcc), then kitecosim "
            "again, or use the kernel 'numpy'."
        )
    return library


def call(library, name, *given):
    """Calls a function of the library with arrays, None for one that is not there, and numbers.

    Arrays are of 64-bit numbers and C-contiguous. MemoryError where a thread gets no room.
    """
    values = (x.ctypes.data if isinstance(x, np.ndarray) else x for x in given)
    if getattr(library, name)(*values):
        raise MemoryError("No memory is left for the sums of the panels' influence.")
