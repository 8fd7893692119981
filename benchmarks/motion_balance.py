"""Whether a motion obeys mechanics by the files that its runs have written: energies, tensions and momentum, from
positions at the end and the history. It shares no code with solvers and readers, which it is to judge.
"""

import itertools

import numpy as np

from .kite_balance import Tables, rows, vectors

GROWN = ("kinetic_energy", "elastic_energy")
TERMS = ("external_work", "reeling_work", "dissipated_energy", "numerical_loss")
# What a scheme may make of energy, in parts of all that went in or out: more, and it is no approximation any more.
MADE = 1.0
# Largest defect of momentum with the finest steps, in parts of the impulse; and how the differences of places between
# three step sizes fall, of order one and two: half way to the next order on either side.
DEFECT, FALLS = 0.02, {1: (1.4, 2.9), 2: (2.8, 6.0)}
# Differences of places, in parts of the size, below which the tolerances of the steps show.
DROWNED = 1e-9


class Motion:
    """The files of a run in `out` of the scene in `folder`."""

    def __init__(self, folder, out):
        self.tables, self.history = Tables(folder), rows(out / "history.csv")
        self.x = vectors(rows(out / "nodes.csv"), "x_m", "y_m", "z_m")
        self.elements = rows(out / "elements.csv")
        self.size = float(max(np.abs(self.x).max(), np.abs(self.tables.places).max()))

    def column(self, name):
        """A column of the history."""
        return np.array([float(row[name]) for row in self.history])

    def columns(self, name):
        """Three columns of the history, of a vector."""
        return np.stack([self.column(f"{name}[{k}]") for k in (1, 2, 3)], axis=1)

    @property
    def weight(self):
        """Weight (3,) N of everything."""
        return np.array([0.0, 0.0, -self.tables.gravity * self.tables.mass.sum()])

    @property
    def fallen(self):
        """Work J of the weight from the tables to the end."""
        return -self.tables.gravity * float(self.tables.mass @ (self.x - self.tables.places)[:, 2])


def tension_and_energy(motion):
    """What is wrong with tensions and elastic energy at the end, from EA and lengths; "" if nothing is."""
    energy, stiffest = 0.0, 0.0
    for row in motion.elements:
        nodes, ea, pushes = motion.tables.elements[row["element"]]
        l0 = float(row["rest_length_m"])
        length = np.linalg.norm(np.diff(motion.x[nodes], axis=0), axis=1).sum()
        stretch = length - l0 if pushes else max(length - l0, 0.0)
        energy += 0.5 * ea / l0 * stretch**2
        stiffest = max(stiffest, ea / l0)
        rounding = 1e-14 * ea / l0 * motion.size
        if abs(ea * stretch / l0 - float(row["tension_N"])) > 1e-9 * abs(ea * stretch / l0) + rounding:
            return f"the tension of {row['element']} is not EA times its strain"
    told = motion.column("elastic_energy")[-1]
    if abs(energy - told) > 1e-9 * energy + 1e-14 * stiffest * motion.size**2:
        return f"an elastic energy of {told} J is told, of {energy} J by lengths"
    return ""


def energies(motion, wind):
    """What is wrong with the balance of energies; "" if nothing is."""
    kinetic, elastic = (motion.column(name) for name in GROWN)
    work, reeled, lost, numerical = (motion.column(name) for name in TERMS)
    scale = kinetic.max() + elastic.max() + np.abs(work).max() + np.abs(reeled).max() + np.abs(numerical).max()
    if np.abs(kinetic + elastic - elastic[0] - (work + reeled - lost - numerical)).max() > 1e-9 * scale:
        return "the energies do not add up"
    if kinetic.min() < 0.0 or np.diff(lost).min(initial=0.0) < -1e-9 * scale:
        return "kinetic energy or dissipation is negative"
    weights = motion.tables.gravity * float(motion.tables.mass.sum()) * motion.size
    if not wind and abs(work[-1] - motion.fallen) > 1e-9 * (scale + weights):
        return f"the weight has done {motion.fallen} J by its fall, {work[-1]} J are told"
    exchanged = elastic[0] + np.abs(np.diff(work)).sum() + np.abs(np.diff(reeled)).sum()
    if (-numerical).max() > MADE * exchanged + 1e-9 * scale:
        return f"the scheme made {(-numerical).max():.3g} J of {exchanged:.3g} J and did not say so"
    return ""


def defect(motion, wind):
    """What momentum lacks, in parts of the impulse: sum of m (x - x0) is the integral of (T - t) times the force, by
    the trapezoidal rule; the force at the beginning, where supports tell nothing yet, is extrapolated.
    """
    t = motion.column("time_s")
    force = motion.weight - motion.columns("support_force") + (motion.columns("line_force") if wind else 0.0)
    force[0] = 2.0 * force[1] - force[2]
    arm = (t[-1] - t)[:, None]
    way = motion.tables.mass @ (motion.x - motion.tables.places)
    impulse = np.trapezoid(arm * force, t, axis=0)
    taken = np.trapezoid(arm[:, 0] * (np.linalg.norm(force, axis=1) + np.linalg.norm(motion.weight)), t)
    return float(np.linalg.norm(way - impulse) / taken)


def judged(folder, outs, wind, smooth, order):
    """What is wrong with the runs in `outs` of the scene in `folder`, each with half the step of the one before; ""
    if nothing is. Of motions that are not `smooth`, energies and tensions alone are asked for.
    """
    motions = [Motion(folder, out) for out in outs]
    for motion in motions:
        if problem := tension_and_energy(motion) or energies(motion, wind):
            return problem
        if np.abs((motion.x - motion.tables.places)[motion.tables.held]).max() > 0.0:
            return "a support has moved"
    if not smooth or any(motion.column("slack_lines").any() for motion in motions):
        return ""
    coarse, fine = (defect(motion, wind) for motion in motions[-2:])
    if fine > DEFECT and fine > coarse / FALLS[1][0]:
        return f"momentum lacks {fine:.3g} of the impulse, {coarse:.3g} with steps twice as long"
    ways = [float(np.linalg.norm(b.x - a.x)) for a, b in itertools.pairwise(motions)]
    low, high = FALLS[order]
    if ways[1] > DROWNED * motions[-1].size and not low <= ways[0] / ways[1] <= high:
        return f"of order {order}, differences should fall by {2**order}; they fall by {ways[0] / ways[1]:.3g}"
    return ""
