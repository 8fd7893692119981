"""Hencky's membrane as nets of springs: what a net can do and what not, in numbers."""

import functools

import numpy as np

from .particle_membrane import CORE, RADIUS, Net, disc, inflated, series
from .plots import STYLES
from .registry import Table
from .text import PYTHON, lines, table

# p Pa and E w N/m of the two loads: what the thesis computed, and what its table B.2 says.
LOADS = {"small": (100.0, 0.01 * 311488.0), "large": (1e5, 311488.0)}
# Net, and Poisson's ratio of the sheet that it stands for.
NETS = {
    "edges (eq. 7.2)": (Net(), 0.0),
    "edges, twice the pressure (eq. 7.7)": (Net(pressure=2.0), 0.0),
    "edges and diagonals, G of ν = 0": (Net(diagonal=0.5), 0.0),
    "edges and diagonals, G of ν = 0.34": (Net(diagonal=0.5 / 1.34), 0.34),
    "fitted edges and diagonals": (Net(fitted=True), 1.0 / 3.0),
}
LAYOUTS = ("blocked", "mapped", "concentric")
THESIS = 0.0218  # m, both of its meshes


def load(name):
    """q = p a / (E w) of a load, and E w N/m."""
    pressure, stiffness = LOADS[name]
    return pressure * RADIUS / stiffness, stiffness


@functools.cache
def solved(name, layout, net, n):
    """The net `net` of NETS in equilibrium under a load."""
    q, stiffness = load(name)
    return inflated(n, q, NETS[net][0], layout, stiffness=stiffness)


def over_series(name, layout, net, n, nu=None):
    """Deflection of the centre over that of the series with the Poisson's ratio of the net, or another."""
    found = solved(name, layout, net, n)
    if found.status != "converged":
        return np.nan
    return found.centre / RADIUS / series(load(name)[0], NETS[net][1] if nu is None else nu)


def _rows(name, sizes):
    rows = []
    for layout in LAYOUTS:
        for net, (_, nu) in NETS.items():
            off = [f"{100.0 * (over_series(name, layout, net, n) - 1.0):+.1f}" for n in sizes]
            finest = solved(name, layout, net, sizes[-1])
            skew = 100.0 * (finest.deflection(0.5, 0.0) / finest.deflection(0.5, 0.25 * np.pi) - 1.0)
            rows.append([layout, net, f"{nu:.3g}", f"{1e3 * finest.centre:.2f}", *off, f"{skew:+.1f}",
                         finest.unstable_modes])  # fmt: skip
    return rows


def _nets(quick):
    sizes = (4, 8) if quick else (4, 8, 16, 32)
    heads = ["layout", "net", "ν", f"centre mm, n = {sizes[-1]}", *(f"off %, n = {n}" for n in sizes), "skew %",
             "unstable"]  # fmt: skip
    text = []
    for name in LOADS:
        q, _ = load(name)
        text.append(
            f"q = p a / (E w) = {q:.4f}; series: {1e3 * RADIUS * series(q, 0.0):.2f} mm with ν = 0, "
            f"{1e3 * RADIUS * series(q, 1 / 3):.2f} with 1/3, {1e3 * RADIUS * series(q, 0.34):.2f} with 0.34."
        )
        text.append("\n".join(table(heads, _rows(name, sizes))))
    rows = []
    for n in (5, 10):
        q, stiffness = load("small")
        single, double = (1e3 * inflated(n, q, net, stiffness=stiffness).centre for net in (Net(), Net(pressure=2.0)))
        rows.append([len(disc(n)[0]), f"{single:.2f}", f"{double:.2f}", f"{1e3 * THESIS:.1f}"])
    text.append("\n".join(table(["particles", "edges, mm", "twice the pressure, mm", "thesis, mm"], rows)))
    text.append(
        "Off: deflection of the centre against the series (Hencky, Fichter) with the ν of the row, the one that the "
        "net's stiffness is taken from; n cells a side of the square core (blocked, 0.6 n rings around it) or of the "
        "square (mapped, concentric). Skew: deflection at half the radius along the x axis over that along the "
        "diagonal, on the finest net; a mesh turned by 45° turns it with it. Unstable: directions in which the "
        f"equilibrium of the finest net is unstable. The core of blocked nets reaches {CORE:g} of the radius."
    )
    text.append(WORDS)
    return lines(text[:1], *text[1:])


WORDS = (
    "What a net of springs can and cannot do. Springs on the edges carry stress along the lines of the mesh only. They "
    "have no Poisson effect, and no stiffness in shear: pulled at 45° to its lines a square net has none at all, where "
    "a sheet with ν = 0 has E w. On the disc the answer is therefore that of the mesh. At the small load fine meshes "
    "are 2 % above the series for ν = 0 on a blocked mesh, whose lines run nearly along the principal stresses (radii "
    "and circles), 9 % on a mapped square and 27 % on concentric squares. Refinement does not cure it, and the "
    "equilibrium of fine blocked nets is unstable in a few directions. Diagonals with the shear modulus give the "
    "shear, but pull along the edges too: with the G of ν = 0 a square cell has C_1111 = 1.5 and C_1122 = 0.5 E w "
    "where the sheet has 1 and 0, and the disc deflects 11 to 15 % too little. With the G of ν = 0.34 they happen to "
    "make the Poisson effect as well (C_1122 = 0.37, the sheet 0.38 E w), with C_1111 = 1.37 for 1.13, and the disc is "
    "2 % below to 4 % above the series. No other ν can be had exactly: central forces obey Cauchy's relation "
    "C_1122 = C_1212, so an isotropic net has ν = 1/3, whatever its springs. Stiffness fitted quad by quad to that "
    "sheet (on squares: edges 3/4, diagonals 3/8 of E w) comes to 0.1 % of the series for 1/3 on the "
    "mapped square and 0.8 % "
    "on the blocked mesh at the small load, 3 % on concentric squares with their kinks; the series for 0.34 is 0.3 % "
    "lower. At the large load 2.5 and 3.2 % remain, where the series itself and a membrane under follower pressure "
    "differ by 1.0 to 1.6 %. The 28 % of the thesis: blocked nets with its 96 and 361 particles under twice the "
    "pressure, as its eq. 7.7 has it, deflect by 21.3 and 21.8 mm, under the pressure itself by 16.8 and 17.2 mm, "
    "within 1.2 % of the series. That its meshes are blocked is inferred from these two numbers; on the other layouts "
    "twice the pressure would have given 37 to 59 %."
)


def picture(path):
    """Centre over n, and profiles of the finest nets along the axis and the diagonal, at the small load."""
    import matplotlib
    from matplotlib.figure import Figure

    q, _ = load("small")
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        look = {"svg.hashsalt": "particles.hencky", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3}
        matplotlib.rcParams.update(look)
        figure = Figure(figsize=(9.0, 4.0), layout="constrained")
        left, right = figure.subplots(1, 2)
        sizes = (4, 8, 16, 32)
        for k, net in enumerate(NETS):
            for layout, dash in zip(LAYOUTS, ("-", "--", ":"), strict=True):
                at = [over_series("small", layout, net, n, nu=0.0) for n in sizes]
                style = {**STYLES[k], "linestyle": dash, "markersize": 4.0, "markerfacecolor": "white"}
                left.plot(sizes, at, label=net if layout == "blocked" else None, **style)
        for nu in (0.0, 1.0 / 3.0):
            left.axhline(series(q, nu) / series(q, 0.0), color="0.5", linewidth=0.8)
        left.set_xscale("log", base=2)
        left.set(xlabel="n (blocked: full, mapped: dashed, concentric: dotted)", ylabel="w centre / series with ν = 0")
        left.set_ylim(top=2.0)
        left.legend(fontsize=7, framealpha=0.9, loc="upper right")
        rho = np.linspace(0.0, 1.0, 60)
        right.plot(rho, 1e3 * RADIUS * series(q, 0.0, rho), color="0.6", linewidth=3.0, label="series, ν = 0")
        for k, layout in enumerate(LAYOUTS):
            for angle, dash, word in ((0.0, "-", "axis"), (0.25 * np.pi, "--", "diagonal")):
                net = solved("small", layout, "edges (eq. 7.2)", 32)
                w = [1e3 * net.deflection(r, angle) for r in rho]
                right.plot(rho, w, color=STYLES[k]["color"], linestyle=dash, linewidth=1.0, label=f"{layout}, {word}")
        right.set(xlabel="radius c / a", ylabel="deflection, mm", title="edges only, n = 32")
        right.legend(fontsize=7, framealpha=0.9)
        figure.suptitle("Hencky's membrane as a net of springs, q = 0.0046", fontsize=10)
        figure.supxlabel(f"{PYTHON} -m benchmarks run particles.hencky", fontsize=6.5, color="0.35")
        figure.savefig(path, format=path.suffix[1:], metadata={"Date": None} if path.suffix == ".svg" else None)


ENTRIES = (
    Table("particles.hencky", "Hencky's membrane: what nets of springs can and cannot do", _nets, picture),
)  # fmt: skip
