"""FMUs of other makers for tests of `kitecosim couple`: other names, other units, with states and without.

wall:  m q'' = F - k q in two components (trapezoidal rule), variables q_1, q_2, F_1, F_2; keeps states.
fluid: load = offset - stiffness wallPos, in kN, variables wallPos.x, wallPos.y, loadX, loadY; no memory and no states.
wheel: J w' = torque - c w, compiled from C; no states, and its steps must begin where the last one ended.
"""

import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest

WALL = """
from pythonfmu import Fmi2Causality as C, Fmi2Initial as Initial, Fmi2Slave, Fmi2Variability as V, Integer, Real

class Wall(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.mass, self.stiffness, self.steps = 1.0, 1.0, 0
        given = dict(causality=C.parameter, variability=V.tunable)
        self.register_variable(Real("mass", **given))
        self.register_variable(Real("stiffness", **given))
        for i in ("1", "2"):
            for name, causality in (("F", C.input), ("q", C.output), ("v", C.local), ("F_old", C.local)):
                setattr(self, name + "_" + i, 0.0)
                exact = dict(initial=Initial.exact) if name == "v" else {}
                self.register_variable(Real(name + "_" + i, causality=causality, **exact))
            setattr(self, "q0_" + i, 0.0)
            self.register_variable(Real("q0_" + i, causality=C.parameter, variability=V.fixed))
        self.register_variable(Integer("steps", causality=C.output))

    def exit_initialization_mode(self):
        self.q_1, self.q_2, self.F_old_1, self.F_old_2 = self.q0_1, self.q0_2, self.F_1, self.F_2

    def do_step(self, t, dt):
        m, k = self.mass, self.stiffness
        for i in ("1", "2"):
            q, v, F_old, F = (getattr(self, name + "_" + i) for name in ("q", "v", "F_old", "F"))
            new = (v + 0.5 * dt / m * (F_old + F - k * (2.0 * q + 0.5 * dt * v))) / (1.0 + 0.25 * k * dt**2 / m)
            setattr(self, "q_" + i, q + 0.5 * dt * (v + new))
            setattr(self, "v_" + i, new)
            setattr(self, "F_old_" + i, F)
        self.steps += 1
        return True
"""

FLUID = """
from pythonfmu import Boolean, Fmi2Causality as C, Fmi2Slave, Fmi2Variability as V, Integer, Real, String

class Fluid(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.stiffness, self.offset, self.fail_at, self.count, self.table = 3.0, 0.0, 0, 0, "table.csv"
        self.pos, self.load = {"x": 0.0, "y": 0.0}, {"X": 0.0, "Y": 0.0}
        given = dict(causality=C.parameter, variability=V.fixed)
        self.register_variable(Real("stiffness", **given))
        self.register_variable(Real("offset", **given))
        self.register_variable(Integer("fail_at", **given))
        self.register_variable(String("table", **given))
        for key in "xy":
            get, put = (lambda key=key: self.pos[key]), (lambda value, key=key: self.pos.update({key: value}))
            self.register_variable(Real("wallPos." + key, causality=C.input, getter=get, setter=put))
        for key in "XY":
            self.register_variable(Real("load" + key, causality=C.output, getter=lambda key=key: self.load[key]))

    def exit_initialization_mode(self):
        if self.table != "table.csv":
            raise ValueError("there is no table " + self.table)
        for key in "xy":
            self.load[key.upper()] = 1e-3 * (self.offset - self.stiffness * self.pos[key])

    def do_step(self, t, dt):
        self.count += 1
        self.exit_initialization_mode()
        return self.count != self.fail_at
"""

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="wheel" guid="wheel" generationTool="a text editor">
  <CoSimulation modelIdentifier="wheel" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="torque" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="speed" valueReference="1" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="J" valueReference="2" causality="parameter" variability="fixed">
      <Real start="1" min="0.001"/></ScalarVariable>
    <ScalarVariable name="c" valueReference="3" causality="parameter" variability="fixed">
      <Real start="0" min="0"/></ScalarVariable>
    <ScalarVariable name="speed_0" valueReference="4" causality="parameter" variability="fixed">
      <Real start="0"/></ScalarVariable>
    <ScalarVariable name="steps" valueReference="5" causality="output" variability="discrete">
      <Integer/></ScalarVariable>
    <ScalarVariable name="trouble" valueReference="6" causality="parameter" variability="fixed">
      <Integer start="0"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
"""


def python_fmu(name, source, folder, **options):
    """An FMU made with PythonFMU from the source of its class."""
    from pythonfmu import FmuBuilder

    script = Path(folder) / f"{name}_slave.py"
    script.write_text(source)
    before = list(sys.path)
    try:
        made = FmuBuilder.build_FMU(script, dest=folder, **options)
    finally:
        sys.path[:] = before
    return Path(made).rename(Path(folder) / f"{name}.fmu")


def library(source, *options):
    """The bytes of a library compiled from a C file beside this one; the test is skipped where that cannot be."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("no C compiler on the path (or not Linux), so FMUs cannot be compiled")
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.so"
        command = [compiler, "-shared", "-fPIC", "-O1", *options, "-o", made, Path(__file__).with_name(source), "-lm"]
        subprocess.run(command, check=True, timeout=60)
        return made.read_bytes()


def packed(path, description, library, platform="linux64"):
    """An FMU of a model description and a library, both as their content; its path."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr(f"binaries/{platform}/{Path(path).stem}.so", library)
    return path


def wheel_fmu(folder):
    """The FMU of the wheel, compiled."""
    return packed(Path(folder) / "wheel.fmu", DESCRIPTION, library("wheel.c"))
