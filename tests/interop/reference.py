"""What the pair of FMUs has to give: the same exchange by a plain loop over the two solver cores of the scene.

The orders of exchange:

serial                  flow, its loads to the structure, structure, its displacement to the flow (Gauss-Seidel)
parallel                both at once, then all values go over (Jacobi); before the first step the flow gets the
                        displacement of the structure as it starts, and the structure the loads on that wing
parallel, undeformed    as parallel, but the first loads are those on a wing without any displacement
"""

import csv
from functools import cache

import numpy as np

import scenes
from fmus.description import scalar_names
from master.coupling import SCHEMES, Coupling, solve

SCENE, WIND = "v3_kite", 12.0  # m/s, where the explicit scheme settles
STEPS = 60  # communication steps of 1 s; in either order the pair is at rest after 41 or fewer
LOADS = ("pressure", "shear", "line_load")
COMPARED = (("structural", "displacement"), *(("aero", name) for name in (*LOADS, "CL")))

# Largest difference between a tool and the loop, in m, Pa, N/m and 1. The FMUs do what the cores do, and no tool
# changes a value on its way, so that nothing but zero is expected; a library that sums in another order would give
# 1e-12 (as the first loads do where a wing is displaced by rounding), and another order of exchange 1e-1 and more.
SAME = 1e-9

# Largest distance of a pair at rest from the equilibrium that the master finds, m: solver_tolerance of the structure is
# 1e-6 N, which leaves 1e-9 m in every load path of this kite; a hundred times that.
AT_REST = 1e-7


@cache
def scene():
    return scenes.load(SCENE)


@cache
def names():
    """The compared scalars, (side, name), in the order of the columns below."""
    blocks = {(side, v.name): v for side, core in scene().cores().items() for v in core.variables}
    return [(side, name) for side, block in COMPARED for name in scalar_names(blocks[side, block])]


@cache
def trajectory(order, steps=STEPS, tune=None):
    """Values of `names` after every step, (steps, names). `tune`: step before which the wind is set, and the wind."""
    cores = scene().cores()
    structural, aero = cores["structural"], cores["aero"]
    for name, value in scene().with_trim({"wind_speed": WIND}).items():
        for core in (structural, aero):
            if name in {v.name for v in core.variables}:
                core.set(name, np.array(value))

    def displace():
        aero.set("displacement", structural.get("displacement"))

    def load():
        aero.look()  # before the first step: the loads on the wing as it starts
        for name in LOADS:
            structural.set(name, aero.get(name))

    if order == "parallel, undeformed":
        aero.set("displacement", np.zeros_like(structural.get("displacement")))
    elif order == "parallel":
        displace()
    load()
    displace()
    rows = []
    for k in range(steps):
        if tune and k == tune[0]:
            aero.set("wind_speed", np.array(tune[1]))
        aero.step(float(k), 1.0)
        if order == "serial":
            load()
        structural.step(float(k), 1.0)
        displacement = structural.get("displacement")
        rows.append(np.concatenate([np.ravel(displacement), *(np.ravel(aero.get(b)) for b in (*LOADS, "CL"))]))
        load()
        displace()
    return np.array(rows)


@cache
def equilibrium():
    """Displacement at the equilibrium that the master finds by its quasi-Newton scheme, m, as `names` has it."""
    coupling = Coupling.in_process(scene(), {"wind_speed": WIND})
    result = solve(coupling, SCHEMES["iqn-ils"](), atol=1e-9, force_tolerance=1e-5)
    assert result.status == "converged", result.message
    return np.ravel(result.displacement)


def written(path):
    """Values of `names` in a CSV file with columns `side.name`, (rows, names)."""
    with open(path, newline="") as file:
        header, *rows = csv.reader(file)
    columns = [header.index(f"{side}.{name}") for side, name in names()]
    return np.array([[float(row[k]) for k in columns] for row in rows])


def difference(values, order, **options):
    """The largest difference of values (steps, names) from the loop."""
    return float(np.abs(values - trajectory(order, len(values), **options)).max())


def distance(values):
    """How far the last displacement is from the equilibrium, m."""
    shape = equilibrium()
    return float(np.abs(values[-1, : shape.size] - shape).max())
