"""Whether a kite is in equilibrium by the files that a run has written: forces at every node from positions, rest
lengths and written loads. It shares no code with solvers, readers or the interface, which it is to judge.

For particle kites whose sections end at the structural nodes, with one strip between two struts: the mesh is leading
edge, mid-chord and trailing edge of every strut, then the ends of lines in the wind.
"""

import csv
import json
import tomllib

import numpy as np

ROPE_KNOB = 1e-3  # legs of ropes shorter than this part of the rest length end in a knob
POINTS, CORNERS = 1.0 / np.sqrt(3.0), np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def rows(path):
    """Rows of a CSV file, as dicts of text."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def vectors(table, *columns):
    """Columns of rows as an array (rows, columns)."""
    return np.array([[float(row[c]) for c in columns] for row in table]).reshape(len(table), len(columns))


class Tables:
    """What the tables of a scene say: node labels, `places` (n,3) m, `held` (n,3), `mass` (n,) kg, and of each element
    its nodes, its stiffness EA N, and whether it may push.
    """

    def __init__(self, folder, modulus=None):
        given = tomllib.loads((folder / "scene.toml").read_text())["structure"]
        self.gravity, density = given["gravity"], given.get("line_density", 0.0)
        modulus = given["line_modulus"] if modulus is None else modulus
        nodes = rows(folder / "nodes.csv")
        self.index = {row["node"]: k for k, row in enumerate(nodes)}
        self.places = vectors(nodes, "x_m", "y_m", "z_m")
        self.held = np.array([[c in (row["fixed"] or "") for c in "xyz"] for row in nodes])
        self.mass = np.zeros(len(nodes))
        for row in rows(folder / "masses.csv") if (folder / "masses.csv").exists() else []:
            self.mass[self.index[row["node"]]] += float(row["mass_kg"])
        self.elements = {}
        for row in rows(folder / "springs.csv") if (folder / "springs.csv").exists() else []:
            l0 = float(row["rest_length_m"])
            self._add(row, l0 * float(row["stiffness_N_per_m"]), True, float(row["mass_kg"]))
        for row in rows(folder / "lines.csv") if (folder / "lines.csv").exists() else []:
            area = 0.25 * np.pi * float(row["diameter_m"]) ** 2
            self._add(row, modulus * area, False, density * area * float(row["rest_length_m"]))

    def _add(self, row, ea, pushes, mass):
        nodes = [self.index[label] for label in row["nodes"].split()]
        self.elements[row["name"]] = (nodes, ea, pushes)
        legs = np.linalg.norm(np.diff(self.places[nodes], axis=0), axis=1)
        for a, b, leg in zip(nodes[:-1], nodes[1:], legs, strict=True):
            self.mass[[a, b]] += 0.5 * mass * leg / legs.sum()


def pulled(tables, x, written):
    """Forces (n,3) N of all elements at positions x (n,3) m, by EA and lengths; and the largest difference N of their
    tensions from those written.
    """
    force, worst = np.zeros_like(x), 0.0
    for row in written:
        nodes, ea, pushes = tables.elements[row["element"]]
        l0 = float(row["rest_length_m"])
        d = np.diff(x[nodes], axis=0)
        length = np.linalg.norm(d, axis=1)
        divisor = np.maximum(length, ROPE_KNOB * l0 if len(nodes) > 2 else 0.0)
        divisor = np.where(divisor > 0.0, divisor, 1.0)
        measured = (
            np.where(length < divisor, 0.5 * (length**2 / divisor + divisor), length) if len(nodes) > 2 else length
        )
        tension = ea * (measured.sum() - l0) / l0
        tension = tension if pushes else max(tension, 0.0)
        worst = max(worst, abs(tension - float(row["tension_N"])))
        pull = tension * d / divisor[:, None]
        np.add.at(force, nodes[:-1], pull)
        np.subtract.at(force, nodes[1:], pull)
    return force, worst


def corner_shares(corners):
    """Shares (4,) of a panel's force at its `corners` (4,3) m: of each shape function the area vector, along that of
    the panel. Two Gauss points each way are exact.
    """
    areas = np.zeros((4, 3))
    for u in (-POINTS, POINTS):
        for v in (-POINTS, POINTS):
            shape = 0.25 * (1.0 + CORNERS[:, 0] * u) * (1.0 + CORNERS[:, 1] * v)
            by_u = 0.25 * CORNERS[:, 0] * (1.0 + CORNERS[:, 1] * v)
            by_v = 0.25 * CORNERS[:, 1] * (1.0 + CORNERS[:, 0] * u)
            areas += shape[:, None] * np.cross(by_u @ corners, by_v @ corners)
    whole = areas.sum(axis=0)
    return areas @ whole / (whole @ whole)


def blown(out, y):
    """Forces (m,3) N of the wind on the nodes of the mesh at y (m,3) m."""
    force = np.zeros_like(y)
    for row in rows(out / "panels.csv"):
        corners = [int(row[f"node_{k}"]) - 1 for k in (1, 2, 3, 4)]
        load = np.array([float(row[f"load_{c}_Pa"]) for c in "xyz"]) * float(row["area_m2"])
        np.add.at(force, corners, corner_shares(y[corners])[:, None] * load)
    for row in rows(out / "line_loads.csv") if (out / "line_loads.csv").exists() else []:
        a, b = int(row["node_1"]) - 1, int(row["node_2"]) - 1
        load = np.array([float(row[f"load_{c}_N_per_m"]) for c in "xyz"]) * np.linalg.norm(y[b] - y[a])
        force[[a, b]] += 0.5 * load
    return force


def weights(folder, tables, count):
    """Weights (m,n) of the nodes of a mesh of `count` = m, three a strut; and how many these are, after which the ends
    of lines in the wind come.
    """
    ends = ("leading_edge_node", "trailing_edge_node")
    struts = [[tables.index[row[end]] for end in ends] for row in rows(folder / "struts.csv")]
    h = np.zeros((count, len(tables.index)))
    for k, (le, te) in enumerate(struts):
        h[3 * k, le] = h[3 * k + 2, te] = 1.0
        h[3 * k + 1, [le, te]] = 0.5
    return h, 3 * len(struts)


def judged(folder, out, force_tolerance=0.01, modulus=None):
    """What is wrong with the results in `out` of the scene in `folder`, in words; "" if nothing is.

    Positions, rest lengths, masses and written loads leave every free node out of balance by no more than asked for
    (and 1e-6 N for what rounding of positions makes); tensions are those of EA and lengths; the mesh is where its nodes
    are; forces add up to that on the supports.
    """
    tables, elements = Tables(folder, modulus), rows(out / "elements.csv")
    x = vectors(rows(out / "nodes.csv"), "x_m", "y_m", "z_m")
    y = vectors(rows(out / "interface.csv"), "x_m", "y_m", "z_m")
    h, ends = weights(folder, tables, len(y))
    size = np.abs(x).max()
    for k in range(ends, len(y)):  # ends of lines are nodes of the structure
        nearest = int(np.argmin(np.linalg.norm(x - y[k], axis=1)))
        h[k, nearest] = 1.0
    if np.abs(h @ x - y).max() > 1e-12 * size:
        return f"the mesh is {np.abs(h @ x - y).max():.3g} m off its nodes"
    if tables.held.any() and np.abs((x - tables.places)[tables.held]).max() > 1e-12 * size:
        return "a support has moved"
    pull, worst = pulled(tables, x, elements)
    stiffest = max(tables.elements[row["element"]][1] / float(row["rest_length_m"]) for row in elements)
    rounding = 1e-14 * size * stiffest
    if worst > 1e-6 + rounding:
        return f"a tension differs by {worst:.3g} N from EA times strain"
    outer = h.T @ blown(out, y)
    outer[:, 2] -= tables.mass * tables.gravity
    left = np.where(tables.held, 0.0, pull + outer)
    norm = float(np.linalg.norm(left))
    if not norm <= force_tolerance + 1e-6 + rounding:
        k = int(np.argmax(np.linalg.norm(left, axis=1)))
        return f"{norm:.3g} N out of balance, most of it at row {k + 1} of nodes.csv"
    told = json.loads((out / "summary.json").read_text())["outputs"]
    support = next(np.array(v) for k, v in told.items() if k.endswith("support_force")) if told else None
    if support is not None and np.linalg.norm(outer.sum(axis=0) - support) > 10.0 * (force_tolerance + rounding):
        return f"loads and weight are {outer.sum(axis=0)} N, on the supports there is {support} N"
    return ""
