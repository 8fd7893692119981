"""FMUs of other makers with one peculiarity each, compiled from `guest.c` with code that a test gives."""

import functools
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest

SOURCE = Path(__file__).with_name("guest.c")
LIN = {
    "variables": [("u", 0, "input", "Real", ""), ("y", 1, "output", "Real", "")],
    "step": "r[1] = 1.0 + 0.5 * r[0]",
}  # y = 1 + u / 2


def described(name, variables, units="", types="", attributes="", identifier=None):
    """The model description of variables (name, value reference, causality, type, attributes of the type)."""
    listed = "".join(
        f'<ScalarVariable name="{n}" valueReference="{v}" causality="{c}"'
        f"{'' if kind == 'Real' and c != 'parameter' else VARIABILITY[c]}>"
        f"<{kind}{_start(c, kind, more)} {more}/></ScalarVariable>"
        for n, v, c, kind, more in variables
    )
    can = "" if "canGetAndSetFMUstate" in attributes else 'canGetAndSetFMUstate="true"'
    above = (units and f"<UnitDefinitions>{units}</UnitDefinitions>") + (
        types and f"<TypeDefinitions>{types}</TypeDefinitions>"
    )
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{name}">'
        f'<CoSimulation modelIdentifier="{identifier or name}" canHandleVariableCommunicationStepSize="true" {can} '
        f"{attributes}/>"
        f"{above}<ModelVariables>{listed}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )


VARIABILITY = dict.fromkeys(("input", "output", "local"), ' variability="discrete"') | {
    "parameter": ' variability="fixed"'
}


def _start(causality, kind, more):
    if causality not in ("input", "parameter") or "start=" in more:
        return ""
    return ' start="false"' if kind == "Boolean" else ' start="0"'


@functools.cache
def library(definitions):
    """The bytes of a library with these macros; the test is skipped where there is no C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("no C compiler on the path (or not Linux), so FMUs cannot be compiled")
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "guest.so"
        options = [f"-D{key}={value}" for key, value in definitions]
        command = [compiler, "-shared", "-fPIC", "-O1", "-w", *options, "-o", made, SOURCE, "-lm"]
        subprocess.run(command, check=True, timeout=60)
        return made.read_bytes()


def guest(folder, name, variables, units="", types="", attributes="", **code):
    """An FMU `name`.fmu in a folder, with code for `step`, `enter`, `exit`, `read`, `save`, `begin` and expressions for
    `status`, `terminated`, `last`, `environment`.
    """
    content = library(tuple(sorted((key.upper(), value) for key, value in code.items())))
    path = Path(folder) / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", described(name, variables, units, types, attributes))
        archive.writestr(f"binaries/linux64/{name}.so", content)
    return path


def lin(folder, name="lin", gain=0.5, **more):
    """y = 1 + gain u."""
    code = {"step": f"r[1] = 1.0 + {gain} * r[0]"} | more
    return guest(folder, name, LIN["variables"], **code)


def coupling(participants, connections, stop=1.0, step=0.1, record=None, **settings):
    """The content of a coupling file: participants (name -> fmu or table), connections ("a.y", "b.u")."""
    content = {
        "time": {"stop": stop, "step": step},
        "coupling": settings,
        "participants": {
            name: one if isinstance(one, dict) else {"fmu": f"{one}.fmu"} for name, one in participants.items()
        },
        "connections": [dict(zip(("from", "to"), ends[:2], strict=True)) | dict(*ends[2:]) for ends in connections],
    }
    return content | ({"results": {"record": record}} if record else {})
