"""What a host that is no Python needs in its environment to run the FMUs of this project with this interpreter."""

import importlib.util
import os
import sys
import sysconfig
from pathlib import Path

PYTHON = "KITECOSIM_PYTHON"  # names the interpreter that an FMU starts (fmus/binary/python.c)


def host_environment(preload: bool = False) -> dict[str, str]:
    """Name -> value of the environment variables, for this interpreter.

    Usually that is KITECOSIM_PYTHON alone: the FMUs open the library of that interpreter themselves. `preload` gives
    what any FMU of PythonFMU takes: LD_PRELOAD, PYTHONPATH, and PYTHONHOME, as the library would else look for its
    modules beside the first python3 in PATH, which may be another. ValueError in one sentence where this interpreter
    has no shared library, or lacks numpy or scipy.
    """
    lacking = [name for name in ("numpy", "scipy") if importlib.util.find_spec(name) is None]
    if lacking:
        raise ValueError(f"{sys.executable} has no {' and no '.join(lacking)}; install what is missing.")
    library = python_library()
    if not preload:
        return {PYTHON: sys.executable}
    paths = [path for path in sys.path if Path(path).is_dir() and Path(path).name in ("site-packages", "dist-packages")]
    return {"LD_PRELOAD": str(library), "PYTHONHOME": sys.base_prefix, "PYTHONPATH": os.pathsep.join(paths)}


def python_library() -> Path:
    """The shared library of this interpreter; ValueError where it has none."""
    get = sysconfig.get_config_var
    name = get("INSTSONAME") or get("LDLIBRARY") or ""
    folders = [
        Path(get("LIBDIR") or ""),
        Path(get("LIBDIR") or "") / (get("MULTIARCH") or ""),
        Path(sys.base_prefix, "lib"),
    ]
    for path in (folder / name for folder in folders):
        if ".so" in name and path.is_file():
            return path
    version = f"libpython{sys.version_info.major}.{sys.version_info.minor}.so"
    raise ValueError(
        f"{sys.executable} has no shared library ({version}), so that no other program can run it; take a Python that "
        f"has one (Debian: the package {version.removesuffix('.so')}; pyenv: PYTHON_CONFIGURE_OPTS=--enable-shared)."
    )
