"""An inflated tube in pure bending: of membranes, as a beam of the project's laws, and as Comer and Levy have it."""

import functools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from structural import Assembly, FaceLoad, Loads, breukels_tube, equilibrium, inflatable_tube
from structural.elements.membrane_results import membrane_state
from structural.materials.membranes import TAUT

from .cantilevers import cantilever, straight, tip_loaded
from .membrane_models import tube
from .membrane_references import FIRST_WRINKLE, tube_of_curvature, tube_of_moment
from .plots import STYLES
from .registry import Table
from .text import PYTHON, lines, table

RADIUS, HALF, NU = 0.1, 0.3, 0.3  # m, half the length of the membranes, Poisson's ratio
PRESSURE, STIFFNESS = 2e4, 4e6  # Pa, E h N/m: strains p r / (E h) of 5e-4
STIFFER = 10.0  # a second tube has this much more E h, nearer to the small strains of the closed form
FIT_PRESSURE = 0.3e5  # Pa, in the middle of what was measured for the fits
# Moments over pi p r^3; the coarse set is for a quick run.
MOMENTS = (0.1, 0.3, 0.48, 0.49, 0.5, 0.51, 0.52, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.97, 0.99)
COARSE = (0.3, 0.48, 0.52, 0.8)
AROUND, ALONG = 16, 8  # quadratic triangles over half the circumference and half the length
MOST_ITERATIONS = 200


@dataclass(frozen=True)
class Bent:
    """A tube under a moment over pi p r^3: `curvature` times E h / p, `wrinkled` share of the circumference away from
    the ends, status of the solve.
    """

    curvature: float
    wrinkled: float
    status: str


def membrane_tubes(moments, stiffness=STIFFNESS, around=AROUND, along=ALONG):
    """Moment -> `Bent` of a tube of membranes with E h `stiffness` N/m, each solved from the one before; nothing after
    one that has no equilibrium.
    """
    s = tube(around, along, RADIUS, HALF, stiffness, NU)
    assembly, skin = Assembly(s), s.groups[0]
    on = {name: FaceLoad(np.full(len(group), PRESSURE)) for name, group in s.load_groups.items()}
    away = s.nodes[skin.nodes[:, :3]].mean(axis=1)[:, 0] < 0.6 * HALF
    whole = 0.5 * np.pi * PRESSURE * RADIUS**3  # half of the circumference is modelled, with half the moment
    x, rotations, out = s.nodes, None, {}
    for moment in (0.0, *moments):
        loads = Loads(np.zeros_like(s.nodes), on, np.array([[0.0, -moment * whole, 0.0]]))
        found = equilibrium(
            assembly, loads, x, atol=0.0, rtol=1e-9, rotations=rotations, max_iterations=MOST_ITERATIONS
        )
        if not found.converged:
            out[moment] = Bent(np.nan, np.nan, found.status)
            break
        x, rotations = found.x, found.rotations
        turn = np.arctan2(rotations[0][2, 0], rotations[0][0, 0])
        area = skin.area[away]
        wrinkled = float(area @ (membrane_state(skin, x).state[away] < TAUT) / area.sum())
        out[moment] = Bent(float(turn) * stiffness / (HALF * PRESSURE), wrinkled, found.status)
    del out[0.0]
    return out


def laws():
    """Name -> section of one tube, its pressure and the E h N/m that curvatures are made dimensionless with."""
    shear = STIFFNESS / (2.0 * (1.0 + NU))
    fits = breukels_tube(FIT_PRESSURE, np.array([RADIUS]))
    return {
        "fabric": (inflatable_tube(PRESSURE, np.array([RADIUS]), STIFFNESS, shear), PRESSURE, STIFFNESS),
        "fits": (fits, FIT_PRESSURE, float(fits.initial_bending[0]) / (np.pi * RADIUS**3)),
    }


def beam_tube(law, moment):
    """`Bent` of two beam elements of one of the `laws`, 1 m long, under a moment over pi p r^3 at the free end."""
    section, pressure, stiffness = laws()[law]
    section = section.select(np.zeros(2, dtype=int))
    size = moment * np.pi * pressure * RADIUS**3
    found = tip_loaded(cantilever(straight(2), section), moment=(0.0, 0.0, size), atol=1e-9 * size)
    r = found.rotations[-1]
    return Bent(float(np.arctan2(r[1, 0], r[0, 0])) * stiffness / pressure, np.nan, found.status)


def collapse_of(law):
    """Moment of collapse of a law over pi p r^3."""
    section, pressure, _ = laws()[law]
    return float(section.bending.collapse[0]) / (np.pi * pressure * RADIUS**3)


def onset_of(law):
    """Moment over pi p r^3 at which a law says that wrinkles begin."""
    section, pressure, _ = laws()[law]
    return float(section.wrinkling[0]) / (np.pi * pressure * RADIUS**3)


def softened_of(law, share=0.99):
    """Moment over pi p r^3 at which the secant stiffness of a law has fallen to a `share` of the initial one."""
    section, pressure, stiffness = laws()[law]
    unit = np.pi * pressure * RADIUS**3

    def left(moment):
        kappa, _ = section.bending.bend(np.array([[moment * unit]]))
        return moment / (float(kappa[0, 0]) * stiffness / pressure) - share

    return brentq(left, 1e-3, 0.99 * collapse_of(law))


@functools.cache
def compared(moments):
    """Moment -> Comer and Levy's curvature, that of the two tubes of membranes, and of the beams by law; nan beyond a
    collapse.
    """
    membranes = [membrane_tubes(moments, factor * STIFFNESS) for factor in (1.0, STIFFER)]
    nothing = Bent(np.nan, np.nan, "")
    out = {}
    for moment in moments:
        beams = {law: beam_tube(law, moment) if moment < collapse_of(law) else nothing for law in laws()}
        bent = [tubes.get(moment, nothing) for tubes in membranes]
        out[moment] = tube_of_moment(np.pi * moment).curvature, bent, beams
    return out


def bounds(found, which):
    """Of one of the two tubes of membranes in what `compared` found: the largest moments over pi p r^3 at which it is
    taut, and at which it has an equilibrium, and the next ones.
    """
    bent = {moment: tubes[which] for moment, (_, tubes, _) in found.items()}
    taut = max(m for m, b in bent.items() if b.wrinkled == 0.0)
    wrinkled = min(m for m, b in bent.items() if b.wrinkled > 0.0)
    held = max(m for m, b in bent.items() if b.status == "converged")
    return taut, wrinkled, held, min((m for m in bent if m > held), default=np.nan)


def bent_tube(quick):
    """Curvature over moment of membranes and beams beside the closed form; first wrinkle and collapse."""
    found = compared(COARSE if quick else MOMENTS)

    def beside(value, exact):
        off = 100.0 * (value / exact - 1.0)
        return ["" if np.isnan(value) else f"{value:.4f}", "" if np.isnan(off) else f"{off:+.2f}"]

    rows = []
    for moment, (exact, membranes, beams) in found.items():
        row = [f"{moment:.2f}", f"{exact:.4f}"]
        for bent in membranes:
            share = "" if np.isnan(bent.wrinkled) else f"{100.0 * bent.wrinkled:.0f}"
            row += [*beside(bent.curvature, exact), share, bent.status]
        for bent in beams.values():
            row += beside(bent.curvature, exact)
        rows.append(row)
    strains = [RADIUS * PRESSURE / STIFFNESS / factor for factor in (1.0, STIFFER)]
    names = ["M / (π p r³)", "Comer and Levy"]
    for strain in strains:
        names += [f"membranes, p r / (E h) = {strain:g}", "off, %", "not taut, %", "status"]
    names += ["beam, law `fabric`", "off, %", "beam, law `fits`", "off, %"]
    taut, wrinkled, held, end = bounds(found, 0)
    return lines(
        table(names, rows),
        "Curvature times E h / p. "
        f"First wrinkle, over π p r³: Comer and Levy {FIRST_WRINKLE / np.pi:g}; membranes between {taut:g} and "
        f"{wrinkled:g}; law `fabric` {onset_of('fabric'):g}; the fits do not know it, their secant stiffness has "
        f"fallen by 1 % at {softened_of('fits'):.2f}. "
        f"Collapse: Comer and Levy 1, at infinite curvature; the last equilibrium of the membranes is at "
        f"{_until(held, end)}, with {STIFFER:g} times the E h at {_until(*bounds(found, 1)[2:])}: the "
        "closed form is of vanishing strains. "
        f"Law `fabric` {collapse_of('fabric'):.2f}, where nine tenths of the circumference are slack; the fits "
        f"{collapse_of('fits'):.2f}.",
        f"Tube of r = {RADIUS:g} m. Membranes: {AROUND} x {ALONG} x 2 quadratic triangles on a quarter, rigid plates "
        f"at the ends, p = {1e-5 * PRESSURE:g} bar, E h = {1e-6 * STIFFNESS:g} MN/m; the beam with the law `fabric` is "
        f"of the same fabric. The fits (Breukels 2011) at {1e-5 * FIT_PRESSURE:g} bar, E h from their initial "
        "stiffness, EI = E h π r³.",
    )


def _until(held, end):
    """The last moment with an equilibrium in words, and the next one that was tried."""
    return f"{held:g}, the largest of the moments," if np.isnan(end) else f"{held:g} (none found at {end:g})"


def picture(path):
    """Moment over curvature of the closed form, membranes and beams."""
    import matplotlib
    from matplotlib.figure import Figure

    found = compared(MOMENTS)
    moments = np.array(list(found))
    curvature = np.linspace(0.0, 4.0, 200)
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(
            {"svg.hashsalt": "membranes.tube", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3}
        )
        figure = Figure(figsize=(6.4, 4.2), layout="constrained")
        axes = figure.subplots()
        exact = np.array([tube_of_curvature(c).moment for c in curvature]) / np.pi
        axes.plot(curvature, exact, color="0.6", linewidth=3.0, label="Comer and Levy")
        parts = {"membranes": [tubes[0] for _, tubes, _ in found.values()]}
        parts |= {f"beam, law `{law}`": [beams[law] for _, _, beams in found.values()] for law in laws()}
        for style, (name, bent) in zip(STYLES, parts.items(), strict=False):
            look = {**style, "markersize": 4.5, "linewidth": 1.0, "markerfacecolor": "white"}
            axes.plot([b.curvature for b in bent], moments, label=name, **look)
        for height, word in ((0.5, "first wrinkle"), (1.0, "collapse")):
            axes.axhline(height, color="0.4", linewidth=0.7, linestyle=":")
            axes.annotate(word, (curvature[-1], height), ha="right", va="bottom", fontsize=7.5)
        axes.set_xlim(0.0, curvature[-1])
        axes.set_xlabel("curvature times E h / p")
        axes.set_ylabel("moment over π p r³")
        axes.legend(fontsize=7.5, framealpha=0.9)
        figure.suptitle("An inflated tube in pure bending", fontsize=10)
        figure.supxlabel(f"{PYTHON} -m benchmarks run membranes.tube", fontsize=6.5, color="0.35")
        figure.savefig(path, format=path.suffix[1:], metadata={"Date": None} if path.suffix == ".svg" else None)


ENTRIES = (
    Table(
        name="membranes.tube",
        title="An inflated tube in pure bending: of membranes, as a beam, and in closed form",
        build=bent_tube,
        draw=picture,
    ),
)
