"""What `kitecosim couple` takes beside the FMUs: loading many scalar connections, and a step over its bare C calls."""

import shutil
import subprocess
import tempfile
import time
import zipfile
from pathlib import Path

from fmpy import platform, sharedLibraryExtension

from master.fmu_coupling import Document, opened

from .exchange import median
from .registry import Table

SOURCE = """
#include <stdlib.h>
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *a, int b, const char *c, const char *d, const void *e, int f, int g)
{ return calloc(2 * SIZE, sizeof(double)); }
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int a, double b, double d, int e, double f) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2GetReal(void *c, const unsigned r[], size_t n, double v[])
{ for (size_t i = 0; i < n; i++) v[i] = ((double *)c)[r[i]]; return 0; }
int fmi2SetReal(void *c, const unsigned r[], size_t n, const double v[])
{ for (size_t i = 0; i < n; i++) ((double *)c)[r[i]] = v[i]; return 0; }
int fmi2DoStep(void *c, double t, double h, int no)
{ double *x = c; for (int i = 0; i < SIZE; i++) x[SIZE + i] = 1.0 + 0.5 * x[i]; return 0; }
"""


def fmu(folder, size):
    """An FMU of so many inputs and outputs, y = 1 + u / 2."""
    folder = Path(folder)
    (folder / "many.c").write_text(SOURCE)
    library = folder / f"many{sharedLibraryExtension}"
    compiler = shutil.which("cc") or "gcc"
    subprocess.run(
        [compiler, "-shared", "-fPIC", "-O1", f"-DSIZE={size}", "-o", library, folder / "many.c"], check=True
    )
    variables = "".join(
        f'<ScalarVariable name="{name}_{k}" valueReference="{at + k}" causality="{causality}"><Real{start}/>'
        "</ScalarVariable>"
        for name, at, causality, start in (("u", 0, "input", ' start="0"'), ("y", size, "output", ""))
        for k in range(size)
    )
    path = folder / "many.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="2.0" modelName="many" guid="many"><CoSimulation modelIdentifier="many"/>'
            f"<ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>",
        )
        archive.write(library, f"binaries/{platform}/{library.name}")
    return path


def content(size):
    """Two such FMUs that feed each other, one connection a variable."""
    links = [{"from": f"a.y_{k}", "to": f"b.u_{k}"} for k in range(size)]
    links += [{"from": f"b.y_{k}", "to": f"a.u_{k}"} for k in range(size)]
    two = {"a": {"fmu": "many.fmu"}, "b": {"fmu": "many.fmu"}}
    settings = {"time": {"stop": 1.0, "step": 0.1}, "coupling": {"scheme": "explicit"}}
    return settings | {"participants": two, "connections": links}


def bare(exchange, size):
    """The C calls of a step alone: a set or get for every variable, and the step."""
    calls = []
    for participant in exchange.participants.values():
        own = participant.fmu
        calls += [(c.set_, c.arguments) for c in (own._channel(f"u_{k}") for k in range(size))]
        calls.append((own._step, (own._component, 0.0, 0.1, 0)))
        calls += [(c.get_, c.arguments) for c in (own._channel(f"y_{k}") for k in range(size))]

    def work():
        for function, arguments in calls:
            function(*arguments)

    return work


def scalars(quick):
    """Markdown: loading and stepping two FMUs with many scalar connections."""
    rows = []
    for connections in (60,) if quick else (60, 600, 6000):
        size = connections // 2
        with tempfile.TemporaryDirectory() as folder:
            fmu(folder, size)
            begin = time.perf_counter()
            with opened(Document.of(content(size), folder)) as exchange:
                ready = time.perf_counter() - begin
                x = exchange.present()
                step = median(lambda exchange=exchange, x=x: exchange.evaluate(x), 7)
                raw = median(bare(exchange, size), 7)
        rows.append(f"| {connections} | {ready:.2f} | {1e3 * step:.2f} | {1e3 * raw:.2f} | {step / raw:.1f} |")
    head = (
        "| connections | load and initialise, s | step, ms | its C calls alone, ms | ratio |\n|---|---|---|---|---|\n"
    )
    return (
        head + "\n".join(rows) + "\n\nTwo compiled FMUs without work of their own, every variable a block of its own."
    )


ENTRIES = (Table(name="exchange.scalars", title="Scalar connections of `kitecosim couple`", build=scalars),)
