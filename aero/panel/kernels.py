"""The compiled kernels (kernels.c), where they were compiled when the project was installed."""

import ctypes
import os
import platform
import sys
import sysconfig
from functools import cache
from pathlib import Path

import numpy as np

CARRIED = "_kernels.so"  # what FMUs call the library, which is that of 64-bit Linux
_DOUBLES = ctypes.c_void_p


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
        library.panel_influence.argtypes = [
            *(_DOUBLES, _DOUBLES, _DOUBLES, ctypes.c_long, _DOUBLES, ctypes.c_long, ctypes.c_double),
            *(_DOUBLES, ctypes.c_long, _DOUBLES, _DOUBLES, ctypes.c_long),
        ]
        return library
    return None


def _kept(path):
    """A file in memory with what was read of the library before its folder was deleted. OSError if nothing was."""
    content = __spec__.loader.get_data(str(path))
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


def _address(array):
    return None if array is None else array.ctypes.data


def influence(library, geometry, points, reach, own, strengths, doublets, potential, threads):
    """Adds to `doublets` (p,m) and sets `potential` (p,k) of `strengths` (m,k), each unless None; C-contiguous all.

    MemoryError where there is too little of it.
    """
    near, far = (np.ascontiguousarray(table) for table in (geometry.near, geometry.far))
    failed = library.panel_influence(
        *(_address(near), _address(far), _address(own), len(near), _address(points), len(points), reach),
        *(_address(strengths), 0 if strengths is None else strengths.shape[1], _address(doublets)),
        *(_address(potential), threads),
    )
    if failed:
        raise MemoryError("no memory is left for the sums of the panels' influence")
