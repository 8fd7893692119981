"""The page documentation/index.html of an FMU: its variables, what their indices count, and how it is stepped."""

import html
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from fmus.adapter import CoreFmu
from scenes import Scene

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title></head><body>
<h1>{title}</h1>
<p>FMI 2.0 co-simulation. Each doStep is one exchange: set the inputs, step, get the outputs. A quasi-static result does
not depend on the size of a step.</p>
<h2>Variables</h2>
<table border="1"><tr><th>name</th><th>shape</th><th>causality</th><th>unit</th><th>description</th></tr>
{variables}
</table>
<p>A variable of shape n is the scalars name[1] to name[n], one of shape n × 3 the scalars name[i,1] to name[i,3] along
x, y and z. The value references of a variable follow each other, the last index running fastest.</p>
{scene}<h2>Steps that fail, values that are refused, states</h2>
<p>A step that the solver cannot complete returns fmi2Discard and logs the reason (category logStatusDiscard); set other
inputs or restore a state, then step on. The calls that set values return fmi2OK whatever they are given. An output, or
a fixed parameter after the initialisation, is refused and logged at once (category logStatusError), and the next step
is discarded. A value that is not finite or out of bounds is refused and logged when the solver gets it, at the latest
in the next step; steps are discarded until a valid value is set.</p>
<p>After a discarded step fmi2GetBooleanStatus answers true for fmi2Terminated, and from then on: that comes from
PythonFMU and is no end, the FMU steps on. The GUID given to fmi2Instantiate is not compared; a wrong one is accepted.
The complete state can be saved, restored and serialised.</p>
<h2>External dependencies</h2>
<p>Python 3.11 or newer with numpy and scipy. An importer that is itself a Python program needs nothing else if these
are installed there. For any other importer, set <code>LD_PRELOAD</code> to the Python shared library (for example
/usr/lib/x86_64-linux-gnu/libpython3.11.so.1.0) and <code>PYTHONPATH</code> to the site-packages with numpy and
scipy. Only linux64 is tested; binaries for other platforms are those of PythonFMU.</p>
<h2>Licences</h2>
<p>The licences of the solvers and of PythonFMU are in documentation/licenses; those of the scene's data, where it has
any, are beside the data in resources/scene.</p>
</body></html>
"""

EXCHANGE = """<h2>Order of exchange</h2>
<p>Per step, as a master that steps in turn does it: give the aerodynamic FMU the <code>displacement</code> of the
structural one and step it; give the structural FMU its {loads} and step it. Repeat until <code>displacement</code> no
longer changes: a kite takes some 20 rounds to 1e-5 m, twice as many where both are stepped at once and nothing changes
at every second round. That is the explicit scheme: it need not settle, and a kite may have several equilibria (folded
tips, rolled over), so look at lift and span of the one that was reached. Passing on only a part of each change, or a
master that accelerates (the command line of this project), settles where it does not.</p>
"""
ALONE = """<h2>Without a flow</h2>
<p>The scene has no aerodynamic side. Set parameters, and {loads} if you want any, and step: the result is the
equilibrium under gravity, the point loads among the parameters, and what was set.</p>
"""
TRIM = """<p><code>trim_angle</code> is where the iteration starts: the design shape, turned rigidly nose-up about the
pivot, by {value:.6g} rad where nothing else is set. <code>kitecosim build</code> takes the angle at which wind and
weight leave no pitching moment in the wind given there. In another wind, or far from that angle, the first steps are
further from equilibrium and may fail, or lead to another one. Give both FMUs the same value before they are
initialised.</p>
"""
SIGNS = """<h2>Indices and signs</h2>
<p>Global frame: x downwind, y towards the right wing, z up. Coordinates are in m and those of the design shape, from
where <code>displacement</code> is counted. The corners c1 to c4 of a panel go around it; its normal is along its area
vector a = (c3 − c1) × (c4 − c2) / 2 in the displaced shape. A positive <code>pressure</code> pushes along the normal,
to the suction side: its force is pressure · a. {shear}A corner
that is listed twice makes a triangle. All indices count from 1, as in the names of the scalars.</p>
"""
SHEAR = "That of <code>shear</code> is shear · |a|, along the global axes. "
Rows = Iterable[Sequence[Any]]


def page(instance: CoreFmu, scene: Scene | None = None) -> str:
    """The HTML text for the FMU of `instance`; with the `scene` that it is of, what the indices count there."""
    blocks = [
        (v.name, _shape(v.shape), v.causality, v.unit, v.description + (" of each, by name below" if v.labels else ""))
        for v, _ in instance.blocks.values()
    ]
    title = html.escape(instance.description or instance.title)
    parts = "" if scene is None else _scene(instance, scene)
    return PAGE.format(title=title, variables=_rows(blocks), scene=parts)


def _shape(shape: tuple[int, ...]) -> str:
    return " × ".join(map(str, shape)) or "scalar"


def _scene(instance: CoreFmu, scene: Scene) -> str:
    """Order of exchange, signs, and a table for every kind of thing that an index counts."""
    blocks = instance.blocks
    loads = [f"<code>{name}</code>" for name in ("pressure", "shear", "line_load") if name in blocks]
    text = (EXCHANGE if scene.has_flow else ALONE).format(loads=", ".join(loads))
    if "trim_angle" in blocks:
        text += TRIM.format(value=instance.get_real([blocks["trim_angle"][1].start])[0])
    text += SIGNS.format(shear=SHEAR if "shear" in blocks else "")
    return text + "".join(_table(*table) for table in _tables(blocks, scene))


def _tables(blocks: Iterable[str], scene: Scene) -> Iterable[tuple[str, str, Rows]]:
    """Title, header and rows of the tables; what no block of the FMU is indexed by is left out."""
    mesh, members = scene.interface, scene.members
    yield "Interface nodes: index i of displacement[i,·]", "i x y z", _numbered(mesh.nodes)
    panels = "Panels: index i of " + " and ".join(
        f"{b}[i{k}]" for b, k in (("pressure", ""), ("shear", ",·")) if b in blocks
    )
    yield f"{panels}; their corners are interface nodes", "i c1 c2 c3 c4", _numbered(mesh.panels + 1)
    if len(mesh.lines):
        lines = zip(mesh.lines + 1, mesh.diameter, members.leg_names, strict=True)
        title = "Exposed lines: index i of line_load[i,·]; from interface node to interface node"
        yield title, "i from to diameter element", _numbered([*ends, diameter, name] for ends, diameter, name in lines)
    if "alpha" in blocks:
        strips, rows = (n - 1 for n in mesh.sections.shape)
        title = "Strips: index i of alpha[i] and circulation[i], left tip first; their panels from front to rear"
        heads = "front rear" if rows == 2 else " ".join(f"panel_{k + 1}" for k in range(rows))
        yield title, f"i {heads}", _numbered([i + k * strips for k in range(rows)] for i in range(1, strips + 1))
    if "tension" in blocks:
        chains = [nodes for group in members.chains for nodes in group.nodes]
        paths = (" – ".join(members.labels[n] for n in chain) for chain in chains)
        two_way = np.concatenate([group.two_way for group in members.chains])
        kinds = np.where(two_way, "spring", "tension only")
        indexed = " and ".join(f"{b}[i]" for b in ("tension", "strain") if b in blocks)
        title = f"Elements: index i of {indexed}; with their structural nodes, by name"
        yield title, "i name kind nodes", _numbered(zip(members.names, kinds, paths, strict=True))
    if members.wing is not None and "tube_load" in blocks:
        tubes = members.wing.tubes
        ends = (" – ".join(members.labels[n] for n in pair) for pair in tubes.ends)
        title = "Parts of tubes: index i of tube_load[i] and tube_strain[i]; with their structural nodes, by name"
        yield title, "i name diameter nodes", _numbered(zip(tubes.names, 2.0 * tubes.radius, ends, strict=True))
    if "position" in blocks:
        nodes = zip(members.labels, members.nodes, strict=True)
        title = "Structural nodes: index i of position[i,·]"
        yield title, "i name x y z", _numbered([label, *place] for label, place in nodes)


def _numbered(rows: Iterable[Iterable[Any]]) -> Rows:
    return [[i, *row] for i, row in enumerate(rows, 1)]


def _table(title: str, header: str, rows: Rows) -> str:
    heads = "".join(f"<th>{head}</th>" for head in header.split())
    return (
        f'<details><summary>{title}</summary>\n<table border="1"><tr>{heads}</tr>\n{_rows(rows)}\n</table></details>\n'
    )


def _rows(rows: Rows) -> str:
    return "\n".join("<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row) + "</tr>" for row in rows)


def _cell(value: Any) -> str:
    """Text of a cell; numbers in nine digits, and no finer than 1e-12, where zeros have their rounding."""
    return f"{round(value, 12) + 0.0:.9g}" if isinstance(value, float) else html.escape(str(value))
