"""FMUs of FMI 3.0 for tests of `kitecosim couple`: one with a variable of every type, compiled from C."""

from pathlib import Path

from fmpy import platform_tuple

from tests.master.toy_fmus import library, packed

KINDS = ("Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean")
HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="signals" instantiationToken="signals" generationTool="a text editor">
  <CoSimulation modelIdentifier="signals" canGetAndSetFMUState="true" canSerializeFMUState="true"
    canHandleVariableCommunicationStepSize="true"/>
  <TypeDefinitions>
    <EnumerationType name="gear"><Item name="first" value="1"/><Item name="second" value="2"/></EnumerationType>
  </TypeDefinitions>
  <ModelVariables>
"""
TAIL = """    <UInt64 name="rows" valueReference="60" causality="structuralParameter" variability="fixed" start="2"/>
    <Int32 name="steps" valueReference="40" causality="output"/>
    <Int32 name="trouble" valueReference="41" causality="parameter" variability="fixed" start="0"/>
    <Enumeration name="x_gear" valueReference="48" causality="input" declaredType="gear" start="1"/>
    <Enumeration name="y_gear" valueReference="68" causality="output" declaredType="gear"/>
    <String name="label" valueReference="42" causality="parameter" variability="fixed"><Start value="none"/></String>
    <String name="labels" valueReference="44" causality="parameter" variability="fixed">
      <Dimension start="2"/><Start value="a"/><Start value="b"/></String>
    <UInt64 name="far" valueReference="43" causality="output"/>
    <Binary name="image" valueReference="45" causality="output"/>
    <Float64 name="sample" valueReference="47" causality="output" variability="discrete" clocks="46"/>
    <Clock name="tick" valueReference="46" causality="input" intervalVariability="triggered"/>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
"""


def description():
    """The model description: an input x_KIND and an output y_KIND of each kind, and what else there is."""
    lines = []
    for k, kind in enumerate(KINDS):
        for letter, causality, reference in (("x", "input", k), ("y", "output", k + 20)):
            size = '<Dimension valueReference="60"/><Dimension start="3"/>' if k == 0 else '<Dimension start="2"/>'
            start = "1 2 3 4 5 6" if k == 0 else "false false" if kind == "Boolean" else "0 0"
            more = f' start="{start}"' if letter == "x" else ""
            more += ' min="0" max="200"' if kind == "UInt8" else ""
            alias = '<Alias name="matrix"/>' if (kind, letter) == ("Float64", "y") else ""
            about = f'name="{letter}_{kind}" valueReference="{reference}" causality="{causality}"{more}'
            lines.append(f"    <{kind} {about}>{size}{alias}</{kind}>\\n")
    return HEAD + "".join(lines) + TAIL


def signals_fmu(folder):
    """signals.fmu in a folder, compiled."""
    return packed(Path(folder) / "signals.fmu", description(), library("signals.c"), platform_tuple)
