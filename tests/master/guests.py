"""FMUs of other makers with one peculiarity each, compiled from `guest.c` with code that a test gives."""

import functools
from pathlib import Path

from tests.master.toy_fmus import library, packed

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
def compiled(definitions):
    """The bytes of a library with these macros."""
    return library("guest.c", "-w", *(f"-D{key}={value}" for key, value in definitions))


def guest(folder, name, variables, units="", types="", attributes="", **code):
    """An FMU `name`.fmu in a folder, with code for `step`, `enter`, `exit`, `read`, `save`, `begin` and expressions for
    `status`, `terminated`, `last`, `environment`.
    """
    content = compiled(tuple(sorted((key.upper(), value) for key, value in code.items())))
    return packed(Path(folder) / f"{name}.fmu", described(name, variables, units, types, attributes), content)


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
