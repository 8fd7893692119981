"""The texts of the page in an FMU, as HTML with places to fill in."""

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto; padding: 0 1rem }}
h1 {{ font-size: 1.6rem }} h2 {{ font-size: 1.15rem; margin-top: 2rem; border-bottom: 1px solid #ccc }}
table {{ border-collapse: collapse; margin: .7rem 0 }} td, th {{ padding: .15rem .7rem; border: 1px solid #ddd }}
th {{ background: #f2f5f8; text-align: left }} td:first-child {{ white-space: nowrap }}
code, pre {{ background: #f4f4f4; font-size: .93em }} pre {{ padding: .7rem; overflow: auto }}
summary {{ cursor: pointer }}
figure {{ margin: 1rem 0 }} figcaption {{ color: #555; font-size: .93em }}
svg {{ width: 100%; font: 11px system-ui, sans-serif }} svg text {{ fill: #444; text-anchor: middle }}
svg text.s {{ text-anchor: start }} svg text.w {{ fill: #b3421b }}
svg path {{ fill: none; stroke: #555; stroke-width: 7; stroke-linecap: round; stroke-linejoin: round }}
svg .p {{ fill: #d6e8f6; fill-opacity: .7; stroke: #1f4e79; stroke-width: 5 }}
svg .q {{ fill: #eef1d8; stroke: #7d8a5c; stroke-width: 5 }}
svg .k {{ stroke: #1f4e79; stroke-width: 9 }} svg .t {{ stroke: #8fa3b5; stroke-opacity: .8 }}
svg path.a {{ stroke-width: 1; stroke: #444 }} svg path.w {{ stroke-width: 1.4; stroke: #b3421b }}
</style></head><body>
<h1>{title}</h1>
<p>FMI {version} co-simulation. Each doStep is one exchange: set the inputs, step, get the outputs. A quasi-static
result does not depend on the size of a step.</p>
{model}<h2>Interface</h2>
<table><tr><th>name</th><th>shape</th><th>causality</th><th>unit</th><th>description</th></tr>
{interface}
</table>
<p>{naming} Inputs start at what the model description says; outputs are right from initialization mode on.</p>
<h2>Parameters</h2>
<table><tr><th>name</th><th>shape</th><th>unit</th><th>start</th><th>min</th><th>max</th><th>variability</th>
<th>description</th></tr>
{parameters}
</table>
<p>A tunable parameter may be set at any time, a fixed one until initialization mode is
left. Where there is no bound there is a dash; values outside are refused.</p>
<h2>Other outputs</h2>
<table><tr><th>name</th><th>shape</th><th>unit</th><th>description</th></tr>
{outputs}
</table>
<p>Steps that succeed say nothing of whether the model holds. <code>outside_validity</code> counts the quantities that
are beyond what it is known to be good for; limits and their sources stand in the descriptions above, and
<code>NAME_at</code> says where the largest value is, from 1, 0 for nowhere.</p>
{scene}{reference}<h2>Steps that fail, values that are refused, states</h2>
<p>A step that the solver cannot complete returns fmi2Discard and logs the reason (category logStatusDiscard); set other
inputs or restore a state, then step on.{discarded}</p>
<p>A value that is not finite or out of bounds, an output, a fixed parameter after initialization mode, a variable that
is set as another type than its own and a call out of order are refused where they come: the call returns fmi2Error, the
reason is logged (category logStatusError), the old value stays, and the next step is discarded once, for hosts that
look at steps only. A vector that does not fit as a whole is refused by the next step. Reasons are logged unless the
host turns logging off.{binary}</p>
<p>The complete state can be saved, restored and serialised; what follows a restored state is the same to the last bit,
in another process too. Bytes that are not a state are refused. A serialised state is numbers and texts (npz and JSON):
no code is run when it is read.</p>
<h2>External dependencies</h2>
{dependencies}
<h2>Licences</h2>
<p>Which licence covers what is in <code>documentation/licenses/license.txt</code>, which names the files with their
texts.</p>
</body></html>
"""

SCALARS = """A variable of shape n is the scalars name[1] to name[n], one of shape n × 3 the scalars name[i,1] to
name[i,3] along x, y and z. The value references of a variable follow each other, the last index running fastest."""
ARRAYS = """Each variable is an array of that shape; the last index, x, y, z where it is 3, runs fastest."""
TERMINATED = """ fmi2Terminated is true after a discarded step, so that importers that would repeat it end, and false
again after a good one."""

OTHER_ON_WINDOWS = """ (On Windows, where the binary is that of PythonFMU, calls that set values return fmi2OK whatever
they are given, reasons are logged only with loggingOn, fmi2Terminated stays true, and the GUID is not compared.)"""
OTHER_EVERYWHERE = """ <b>But the binaries in this FMU are those of PythonFMU</b>, as kitecosim was installed without a
C compiler. With them calls that set values return fmi2OK whatever they are given, reasons are logged only with
loggingOn, fmi2Terminated stays true, and the GUID is not compared."""

MODEL = """<h2>What it models</h2>
<p><b>{name}</b>. {about}</p>
<p>{physics}</p>
<figure>{drawing}<figcaption>The design shape in parallel views of one scale: {panels}{shown}.</figcaption></figure>
<p>Built with these settings: {settings}. They cannot be changed in the FMU.</p>
"""

PANELS = """panels of the interface, blue on the
suction side and green on the other; """
OUTLINE = """outline and trailing edges of the closed body"""

OF_STRUCTURE = """lines grey, springs dark blue"""
OF_TUBES = """; tubes as thick as they are, the mesh inside the canopy left out"""
OF_MEMBRANES = """; seams of membranes grey"""
OF_FLOW = """exposed lines, where there are any, grey"""

STRUCTURE = """This FMU is its structure: {counts}. Each step finds the static equilibrium under the loads on the
interface{weight}; {lines}pressure follows the deformed surface. The scene is quasi-static: nothing has inertia."""
WRINKLING = """ Membranes wrinkle and go slack instead of carrying compression: their stress is that of the relaxed
energy (tension field)."""
STIFF_MEMBRANES = """ Membranes resist compression as they do tension here."""
TRANSIENT_STRUCTURE = """This FMU is its structure: {counts}, with masses on the nodes and dampers in the elements. The
scene is transient: each step integrates the motion over the communication step under the loads on the
interface{weight}; {lines}pressure follows the deformed surface. While <code>loads_vary</code> is true loads go linearly
from those of the step before to the present ones, as suits masters that iterate; for those that step once, the explicit
scheme, set it to false."""
FLOW = """This FMU is the flow around it: {method}, in a uniform wind{strips}{lines}. Each step finds the loads on every
panel. The flow is steady{relative}."""
ON_STRIPS = """, on {strips} strips of the displaced wing"""
# Titles of tables of what models of the flow count by themselves.
OF_MODEL = {"strip": "Strips: index i of {indexed}, left tip first; their panels from front to rear"}
LINE_FLOW = """This FMU is the wind on {lines} exposed pieces of lines{relative}."""
RELATIVE_WIND = """, in the wind relative to each part, at the end of the step"""

OWN_BINARY = """<p>Python 3.11 or newer with numpy and scipy; the versions that it was built with are in
<code>documentation/externalDependencies.txt</code>. Hosts that are Python programs need nothing else if these are
installed there.</p>
<p>In any other host on Linux the FMU starts Python itself: the interpreter that the environment variable
<code>KITECOSIM_PYTHON</code> names, or else the first of <code>python3</code> and <code>python</code> in the path, that
has numpy, scipy and a shared library (libpython3.x.so). Where there is none, the instantiation fails and says why.
<code>kitecosim host-env</code> prints the variable for the Python in which kitecosim is installed. Nothing has to be
preloaded. The C library must be as new as where the FMU was built.</p>
"""
ALSO_WINDOWS = "<p>Only linux64 is tested. The binary for win64 is that of PythonFMU and untried.</p>"
LINUX_ONLY = "<p>There is a binary for Linux only (x86_64).</p>"
PYTHONFMU_BINARY = """<p>Python 3.11 or newer with numpy and scipy. An importer that is itself a Python program needs
nothing else if these are installed there. For any other importer, set <code>LD_PRELOAD</code> to the Python shared
library (for example /usr/lib/x86_64-linux-gnu/libpython3.11.so.1.0), <code>PYTHONHOME</code> to where that Python is
installed (/usr) and <code>PYTHONPATH</code> to the site-packages with numpy and scipy; <code>kitecosim host-env
--preload</code> prints all three. Only linux64 is tested; the binaries are
those of PythonFMU.</p>"""

DEPENDENCIES = """# This FMU runs in Python, which is not inside it: Python 3.11 or newer, and the packages below,
# one a line in the versions that will do. pip takes this file: python -m pip install -r externalDependencies.txt
# Built with Python {python}, {built}.
# index.html, External dependencies, says how a host that is no Python program finds them.
{requirements}
"""

REFERENCE = """<h2>Reference inputs and results</h2>
<p><code>documentation/{identifier}_in.csv</code> holds the inputs of {steps} steps of {step:g} s, each row from its
time on, <code>{identifier}_ref.csv</code> the results at its times, with the start values of this FMU{short}, and
<code>{identifier}_ref.opt</code> times, step and tolerances: files as in the FMI cross-check. On the machine where the
FMU was built, a tool that does the same gets the same bits; elsewhere the last digits may differ: compare to
{relative:g}, absolutely and of the largest value of the whole variable. What solvers tell of themselves (residual,
iterations) is left out. {reader}In the unpacked FMU, this compares with fmpy:</p>
<pre>{script}</pre>
"""

NO_READER = """Names of inputs have commas and stand in quotes, which fmpy's own reader of CSV files, and with it
<code>fmpy simulate --input-file</code>, does not take. """
READER = """<code>fmpy simulate {identifier}.fmu --stop-time {stop:g} --output-interval {step:g} --input-file
{identifier}_in.csv --output-file out.csv</code> finds the results again, among all outputs. """

SCRIPT = """import csv
import os

import fmpy
import numpy as np

def table(path):
    with open(path, newline="") as file:
        names, *rows = csv.reader(file)
    return np.array([tuple(map(float, row)) for row in rows], [(name, float) for name in names])

given, expected = (table(f"documentation/{identifier}_{{kind}}.csv") for kind in ("in", "ref"))
names = list(expected.dtype.names)[1:]
end = expected["time"][-1]
found = fmpy.simulate_fmu(os.getcwd(), stop_time=end, output_interval={step}, input=given, output=names)
print("largest difference", max(np.abs(found[name] - expected[name]).max() for name in names))
"""

EXCHANGE = """<h2>Order of exchange</h2>
<p>Per step, as a master that steps in turn does it: give the aerodynamic FMU the <code>displacement</code> of the
structural one and step it; give the structural FMU its {loads} and step it. Repeat until in two rounds on end
<code>displacement</code> changes by less than 1e-5 m (all entries together) and <code>imbalance_before_step</code> of
the structural FMU is below 0.01 N: a kite takes some 20 rounds, twice as many where both are stepped at once and
nothing changes at every second round. Do not begin with inputs of zero: the aerodynamic FMU starts with the
displacement that the structural one starts with. Give both FMUs the same value of <code>symmetric</code>.</p>
<p>That is the explicit scheme, which need not settle. Where it does not, pass on a part of each change, for example x
+ 0.35 (displacement − x) with x what the aerodynamic FMU got last, or take a master that accelerates (the command line
of this project). A kite may have several equilibria (folded tips; rolled over, once <code>symmetric</code> is off or
an input is not symmetric), so look at <code>CL</code> and <code>tip_span</code> of the one that was reached.</p>
"""
TRANSIENT_EXCHANGE = """<h2>Order of exchange</h2>
<p>Per communication step, as a master that steps in turn does it: give the aerodynamic FMU the
<code>displacement</code> and <code>velocity</code> of the structural one and step it; give the structural FMU its
{loads} and step it over the same time. Once a step is the explicit scheme, of first order in the step; repeated from
saved states until the motion no longer changes it is the implicit one, of second order. The explicit scheme becomes
unstable, however short the steps, where the air that moves with the structure (added mass) has more inertia than the
structure itself.</p>
"""
ALONE = """<h2>Without a flow</h2>
<p>The scene has no aerodynamic side. Set parameters, and {loads} if you want any, and step: the result is the
equilibrium under gravity, the pressures and point loads among the parameters, and what was set.</p>
"""
RIGID = """<h2>Without a structure</h2>
<p>The scene has no structural side: its wing is rigid, and the FMU an aerodynamic model by itself. Set parameters and
step: the loads are those on the shape drawn. With a <code>displacement</code> of its nodes, of any structure or as a
rigid rotation, they are those on the displaced shape.</p>
"""
TRIM = """<p><code>trim_angle</code> is where the iteration starts: the design shape, turned rigidly nose-up about the
pivot, node {pivot} at ({place}) m, by {value:.6g} rad where nothing else is set. <code>kitecosim build</code> takes the
angle at which wind and weight leave no pitching moment in the wind given there. In another wind, or far from that
angle, the first steps are further from equilibrium and may fail, or lead to another one. <code>start_azimuth</code>
turns that shape about the upright axis through the pivot, by {azimuth:.6g} rad where nothing else is set, so that it
looks into the wind given to <code>kitecosim build</code>; the plane of symmetry turns with it. Give both FMUs the same
values before they are initialized.</p>
"""
START = """<p>Both FMUs start in the equilibrium of structure and flow for the parameters given to
<code>kitecosim build</code>, at rest: a host that steps them once a step from there sees no motion until something
changes. With another wind, other tapes or masses before the first step the start is none of both together, and the
kite swings; with another <code>trim_angle</code> it is the design shape, turned by that.</p>
"""
SIGNS = """<h2>Indices and signs</h2>
<p>Global frame: z up; in the design shape x goes downwind and y towards the right wing. Coordinates are in m and those
of the design shape, from where <code>displacement</code> is counted. The corners c1 to c4 of a panel go around it; its
normal is along its area vector a = (c3 − c1) × (c4 − c2) / 2 in the displaced shape. A positive <code>pressure</code>
pushes along the normal, to the suction side: its force is pressure · a. {shear}A corner
that is listed twice makes a triangle. All indices count from 1{counted}.</p>
"""
COUNTED = ", as in the names of the scalars"
COUNTED_IN_ARRAYS = "; the first entry of an array in memory has index 1 here"
SHEAR = """That of <code>shear</code> is shear · |a|, along the global axes. The load on a panel is the sum of both:
<code>pressure</code> alone is what turns with the panel, not the pressure difference across it. """
