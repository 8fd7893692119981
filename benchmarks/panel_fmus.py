"""What an FMU of a closed wing of many panels costs: size, and time and memory in fmpy and in libcosim."""

import json
import os
import subprocess
import sys
import tempfile
import time
import zipfile
from importlib import metadata
from itertools import pairwise
from pathlib import Path

import scenes
from fmus.builder import build

from .harness import ROOT
from .memory import resident
from .registry import Table
from .text import lines, table

LIMIT = 600  # s, of one host
OTHER_WIND = 11.0  # m/s, of the step, so that it has to solve
HOSTS = (("fmpy", 2), ("fmpy", 3), ("libcosim", 2))
SCENE = """title = "Rectangular wing of {count} panels"
description = "NACA 0012, aspect ratio 6, 5 degrees."

[body]
shape = "wing"
profile = "naca 0012"
span = 6.0
chord = 1.0
panels = {panels}
strips = {strips}
strip_spacing = "cosine"

[aero]
method = "panel"
symmetric = true
wind_speed = 10.0
wind_direction = [0.9961946980917455, 0.0, 0.08715574274765817]
air_density = 1.225
reference_area = 6.0
"""


def wing(folder, about):
    """The scene of a wing of about so many panels, four times as many round the profile as strips of each half."""
    strips = round(0.5 * (0.5 * about) ** 0.5)
    panels = 2 * round(0.25 * about / strips)
    place = Path(folder) / f"wing_{about}"
    place.mkdir()
    (place / "scene.toml").write_text(SCENE.format(count=about, panels=panels, strips=strips))
    return scenes.load(str(place))


def in_fmpy(path, fmi):
    """Seconds to read the description, to unpack and instantiate, to initialise, and for one step."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    marks = [time.perf_counter()]
    description = fmpy.read_model_description(path)
    marks.append(time.perf_counter())
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(path, folder)
        of = {"guid": description.guid} if fmi == 2 else {"guid": description.instantiationToken}
        kind = FMU2Slave if fmi == 2 else FMU3Slave
        fmu = kind(**of, unzipDirectory=folder, modelIdentifier=description.coSimulation.modelIdentifier)
        fmu.instantiate()
        marks.append(time.perf_counter())
        if fmi == 2:
            fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        marks.append(time.perf_counter())
        wind = next(v.valueReference for v in description.modelVariables if v.name == "wind_speed")
        (fmu.setReal if fmi == 2 else fmu.setFloat64)([wind], [OTHER_WIND])
        fmu.doStep(0.0, 1.0)
        marks.append(time.perf_counter())
        fmu.terminate()
        fmu.freeInstance()
    return [b - a for a, b in pairwise(marks)]


def in_libcosim(path, fmi):
    """The same as `in_fmpy`; libcosim reads and unpacks at once, instantiates as it adds the FMU, and initialises with
    the first step.
    """
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_step_size(1_000_000_000)  # ns
    marks = [time.perf_counter()]
    slave = CosimLocalSlave(str(path), "wing")
    marks.append(time.perf_counter())
    index = execution.add_local_slave(slave)
    wind = next(v.reference for v in execution.slave_variables(index) if v.name == b"wind_speed")
    manipulator = CosimManipulator.create_override()
    execution.add_manipulator(manipulator)
    marks.append(time.perf_counter())
    for _ in range(2):
        if not execution.step():
            raise RuntimeError("libcosim refused a step.")
        marks.append(time.perf_counter())
        manipulator.slave_real_values(index, [wind], [OTHER_WIND])
    return [b - a for a, b in pairwise(marks)]


def hosted(host, path, fmi):
    """Seconds of a host in a process of its own, and the growth of its memory up to its peak, MB."""
    command = [sys.executable, "-m", "benchmarks.panel_fmus", host, str(path), str(fmi)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT, check=False)
    if done.returncode:
        raise RuntimeError(f"{host} does not run {path.name}: {(done.stderr or done.stdout).strip()[-500:]}")
    return json.loads(done.stdout.splitlines()[-1])


def cost(about):
    """Rows of FMUs of a wing of about so many panels."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        scene = wing(folder, about)
        count = len(scene.interface.panels)
        made = {}
        for fmi in (2, 3):
            begin = time.perf_counter()
            (path,) = build(scene, folder, reference=False, fmi=fmi)
            made[fmi] = path, time.perf_counter() - begin
        for host, fmi in HOSTS:
            path, seconds = made[fmi]
            with zipfile.ZipFile(path) as file:
                text = file.getinfo("modelDescription.xml").file_size / 1e6
            size = path.stat().st_size / 1e6
            head = [str(count), str(fmi), f"{seconds:.2f}", f"{size:.2f}", f"{text:.2f}", host]
            if host == "libcosim" and not with_libcosim():
                rows.append([*head, *["–"] * 5])
                continue
            found = hosted(host, path, fmi)
            rows.append([*head, *(f"{v:.2f}" for v in found[:-1]), f"{found[-1]:.0f}"])
    return rows


def with_libcosim():
    """Whether libcosimpy is installed."""
    try:
        metadata.version("libcosimpy")
    except metadata.PackageNotFoundError:
        return False
    return True


def sizes(quick):
    """Numbers of panels that are measured: `KITECOSIM_PANELS` of the environment, "20000" or several with commas."""
    given = os.environ.get("KITECOSIM_PANELS")
    if given:
        return [int(text) for text in given.split(",")]
    return [500] if quick else [500, 2000]


def fmu_size(quick):
    """Markdown: size, time and memory of FMUs of wings."""
    rows = [row for about in sizes(quick) for row in cost(about)]
    names = ("panels", "FMI", "build, s", "FMU, MB", "modelDescription.xml, MB", "host", "read, s", "instantiate, s")
    return lines(
        table((*names, "initialise, s", "step, s", "memory, MB"), rows),
        "The aerodynamic FMU of a rectangular wing, without reference results, its half solved; each host in a process "
        "of its own, in which memory is the growth up to its peak. Instantiate: in fmpy unpacking included, which "
        "libcosim does as it reads. Initialise: the first solve, with influences and factors; in libcosim with the "
        f"first step, which need not solve again. Step: in a wind of {OTHER_WIND:g} m/s instead of 10 m/s. libcosim "
        "takes FMI 2 only.",
        ""
        if with_libcosim()
        else "libcosimpy is not installed; `pip install -c constraints.txt -e '.[interop]'` brings it.",
    )


ENTRIES = (Table("panel.fmu_size", "What an FMU of a closed wing costs over its panels", fmu_size),)

if __name__ == "__main__":
    host, path, fmi = sys.argv[1:]
    before = resident("VmRSS")
    seconds = {"fmpy": in_fmpy, "libcosim": in_libcosim}[host](path, int(fmi))
    print(json.dumps([*seconds, resident("VmHWM") - before]))
