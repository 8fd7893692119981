"""What the commands build and host-env do: FMUs of a scene, and the environment that hosts need for them."""

import shlex
import sys
from pathlib import Path

from master.commands import prepared, results_folder

OTHER_BINARY = (
    "kitecosim: note: FMUs built here carry PythonFMU's binary, as that of kitecosim was not compiled when it was "
    "installed (is there a C compiler?); a C or C++ host needs the variables of `kitecosim host-env --preload`."
)


def build_scene(name: str, assigned: dict[str, str], out: Path, ssp: bool = False, fmi: int = 2) -> int:
    """Build the two FMUs of a scene, and its SSP if wanted; the exit code."""
    from fmus.builder import build, own_binary
    from fmus.ssp import package

    if ssp and fmi != 2:
        raise ValueError("--ssp connects FMUs of FMI 2; leave --fmi out.")
    scene, given = prepared(name, assigned)
    results_folder(out)
    mark = "_fmi3" if fmi == 3 else ""
    names = [f"{scene.name}{end}" for end in (f"_structural{mark}.fmu", f"_aero{mark}.fmu", *([".ssp"] if ssp else []))]
    if folders := [n for n in names if (out / n).is_dir()]:
        raise ValueError(f"--out {out} has a folder where {folders[0]} should go; name another folder.")
    try:
        paths = build(scene, out, given, fmi=fmi)
        for path in (*paths, package(scene.name, paths, out)) if ssp else paths:
            print(path)
        if own_binary() is None:
            print(OTHER_BINARY, file=sys.stderr)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ValueError(f"--out {out} cannot be written to ({reason}); name another one.") from None
    return 0


def print_host_environment(preload: bool) -> int:
    """Print what a host without Python needs in its environment, as lines of a shell."""
    from fmus.builder import own_binary
    from fmus.host import host_environment

    for name, value in host_environment(preload).items():
        print(f"export {name}={shlex.quote(value)}")
    if own_binary() is None and not preload:
        print(OTHER_BINARY, file=sys.stderr)
    return 0
