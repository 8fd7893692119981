"""Packages of SSP 1.0 written by hand, for tests of `kitecosim couple`."""

import zipfile
from pathlib import Path

NAMES = " ".join(
    f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{long}"'
    for short, long in (
        ("ssc", "Common"),
        ("ssd", "Description"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
    )
)
UNITS = """<ssd:Units>
  <ssc:Unit name="N"><ssc:BaseUnit kg="1" m="1" s="-2"/></ssc:Unit>
  <ssc:Unit name="kN"><ssc:BaseUnit kg="1" m="1" s="-2" factor="1000"/></ssc:Unit>
  <ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
  <ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>
  <ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>
  <ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>
  <ssc:Unit name="span"/>
</ssd:Units>"""


def connectors(**kinds):
    """Connectors by name: the kind, and a unit behind a blank; a dot in a name is written as __."""
    made = []
    for name, text in kinds.items():
        kind, _, unit = text.partition(" ")
        about = f'<ssc:Real unit="{unit}"/>' if unit else ""
        made.append(f'<ssd:Connector name="{name.replace("__", ".")}" kind="{kind}">{about}</ssd:Connector>')
    return f"<ssd:Connectors>{''.join(made)}</ssd:Connectors>"


def component(name, fmu, inside="", more=""):
    """A component from resources/."""
    return f'<ssd:Component name="{name}" source="resources/{fmu}" {more}>{inside}</ssd:Component>'


def link(start, end, inside="", more=""):
    """A connection between element/connector, or a connector alone of the system."""
    ends = ""
    for side, text in (("start", start), ("end", end)):
        element, slash, connector = text.rpartition("/")
        ends += (f'{side}Element="{element}" ' if slash else "") + f'{side}Connector="{connector}" '
    return f"<ssd:Connection {ends}{more}>{inside}</ssd:Connection>"


def linear(factor=1, offset=0):
    """A linear transformation."""
    return f'<ssc:LinearTransformation factor="{factor}" offset="{offset}"/>'


def system(name, elements, links, inside=""):
    """A system."""
    return (
        f'<ssd:System name="{name}">{inside}<ssd:Elements>{elements}</ssd:Elements>'
        f"<ssd:Connections>{links}</ssd:Connections></ssd:System>"
    )


def parameters(**values):
    """A parameter set; a value is a number or text with a unit behind a blank."""
    listed = ""
    for name, value in values.items():
        kind = {bool: "Boolean", int: "Integer", float: "Real"}.get(type(value), "Real")
        text, _, unit = str(value).partition(" ")
        about = f' unit="{unit}"' if unit else ""
        text = text.lower() if kind == "Boolean" else text
        name = name.replace("__", ".")
        listed += f'<ssv:Parameter name="{name}"><ssv:{kind} value="{text}"{about}/></ssv:Parameter>'
    units = UNITS.replace("ssd:Units", "ssv:Units")
    inside = f"<ssv:Parameters>{listed}</ssv:Parameters>{units}"
    return f'<ssv:ParameterSet {NAMES} version="1.0" name="p">{inside}</ssv:ParameterSet>'


def mapping(*entries):
    """A parameter mapping of (source, target, what is inside)."""
    listed = "".join(
        f'<ssm:MappingEntry source="{a}" target="{b}">{inside}</ssm:MappingEntry>' for a, b, inside in entries
    )
    return f'<ssm:ParameterMapping {NAMES} version="1.0">{listed}</ssm:ParameterMapping>'


def bound(*sets, mapped=""):
    """Parameter bindings: sets in place, or files by their name."""
    made = ""
    inside = f"<ssd:ParameterMapping>{mapped}</ssd:ParameterMapping>" if mapped.startswith("<") else (
        f'<ssd:ParameterMapping source="{mapped}"/>' if mapped else ""
    )  # fmt: skip
    for one in sets:
        if one.startswith("<"):
            made += (
                f"<ssd:ParameterBinding><ssd:ParameterValues>{one}</ssd:ParameterValues>{inside}</ssd:ParameterBinding>"
            )
        else:
            made += f'<ssd:ParameterBinding source="{one}">{inside}</ssd:ParameterBinding>'
    return f"<ssd:ParameterBindings>{made}</ssd:ParameterBindings>"


def structure(whole, times='startTime="0" stopTime="1"', units=UNITS):
    """SystemStructure.ssd around a system."""
    experiment = f"<ssd:DefaultExperiment {times}/>" if times else ""
    inside = f"{whole}{units}{experiment}"
    name = "ssd:SystemStructureDescription"
    return f'<?xml version="1.0"?>\n<{name} {NAMES} version="1.0" name="x">{inside}</{name}>'


def packed(path, ssd, fmus, **files):
    """The package with a structure, FMUs and other files (a slash in a name is written as __)."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", ssd)
        for fmu in fmus:
            archive.write(fmu, f"resources/{Path(fmu).name}")
        for name, text in files.items():
            archive.writestr(name.replace("__", "/").replace("_dot_", "."), text)
    return path
