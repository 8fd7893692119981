"""Ballooned cells beside their closed form: slices of them, and whole wings of constant profile made of a scene."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import scenes
from master.report.panels import panel_loads
from master.report.ribs import ribs

from .ballooning import ballooned, cell_slice, free_cell, held_cell, straight_ribs
from .registry import Table
from .text import table

WIDTH, HEIGHT = 0.5, 0.4  # m, of the cells of a wing as drawn, and of its ribs
CELLS, PRESSURE = 4, 100.0  # Pa
STIFFNESS, NU = 1e4, 0.3  # E h N/m, as the cloth of the thesis (table 4.2), and Poisson's ratio
PANELS = 10  # round the profile, a m of chord
POINTS = 161  # of a side of the profile

SCENE = """title = "Wing of prismatic cells"
description = "A straight wing whose ribs are as high over nearly all of their chord."

[body]
shape = "parafoil"
profile = "flat.dat"
span = {span}
chord = {chord}
arc = 0.0
cells = {cells}
panels = {panels}
panel_spacing = "uniform"
strips = {strips}

[structure]
gravity = 0.0
symmetric = true

[membranes]
shape = "body"
panel_shortening = {shortening}

[membranes.size]
rib_rows = 2

[membranes.supports]
{supports}

[membranes.fabrics.cloth]
stiffness = {stiffness}
poisson = {nu}

[aero]
method = "panel"
internal_pressure_coefficient = 1.0
wind_speed = 10.0
air_density = 1.2
reference_area = 1.0
reference_chord = 1.0
reference_span = 1.0
"""


def flat_profile(thickness):
    """Points (k,2) in chords of a profile as thick from one thickness behind the nose, which is half an ellipse, to one
    before the trailing edge, which two parabolas form.
    """
    x = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, POINTS)))
    from_nose, from_tail = np.minimum(x / thickness, 1.0), np.minimum((1.0 - x) / thickness, 1.0)
    half = 0.5 * thickness * np.sqrt(1.0 - (1.0 - from_nose) ** 2) * (1.0 - (1.0 - from_tail) ** 2)
    return np.concatenate([np.column_stack([x, half])[::-1], np.column_stack([x, -half])[1:]])


def wing_scene(folder, chord, strips, shortening, held):
    """The scene, in a new folder, of a wing with this chord m, strips a cell and [membranes] panel_shortening.

    Ribs are `held`, or upright only but for the middle one.
    """
    folder.mkdir()
    np.savetxt(folder / "flat.dat", flat_profile(HEIGHT / chord), header="flat", comments="")
    middle = CELLS // 2 + 1
    axes = {k: "xyz" if held or k == middle else "z" for k in range(1, CELLS + 2)}
    text = SCENE.format(
        span=CELLS * WIDTH,
        chord=chord,
        cells=CELLS,
        panels=round(PANELS * chord),
        strips=strips,
        shortening=[list(pair) for pair in shortening],
        supports="\n".join(f'rib_{k} = "{value}"' for k, value in axes.items()),
        stiffness=STIFFNESS,
        nu=NU,
    )
    (folder / "scene.toml").write_text(text)
    return scenes.load(folder)


@dataclass(frozen=True, eq=False)
class InflatedWing:
    """A wing under pressure alone: places `y` (r,p) m of its ribs along the span, at the shares `share` (p,) of the
    chord as drawn; of the sides of these, in the cell to the right of the middle, the Cauchy `stress` (p,) N/m across
    the span and Barlow's p R (p,), as ribs.csv has them, at `side` (p,).
    """

    y: np.ndarray
    share: np.ndarray
    stress: np.ndarray
    barlow: np.ndarray
    side: np.ndarray

    @property
    def spacing(self):
        """Mean spacing m of ribs."""
        return float(np.ptp(self.y.mean(axis=1)) / (len(self.y) - 1))

    @property
    def slope(self):
        """By how much m the spacing grows from the nose to the trailing edge, on a line through its values away from
        both.
        """
        flat = (self.share > 0.15) & (self.share < 0.85)
        spacing = (self.y[-1] - self.y[0]) / (len(self.y) - 1)
        return float(np.polyfit(self.share[flat], spacing[flat], 1)[0])


def inflated_wing(chord=4.0, strips=4, shortening=((0.0, 0.0), (1.0, 0.0)), held=False):
    """The `InflatedWing` of `wing_scene` in equilibrium under PRESSURE on all of its skin, with no wind."""
    with tempfile.TemporaryDirectory() as parent:
        scene = wing_scene(Path(parent) / "wing", chord, strips, shortening, held)
        core = scene.structural_core()
    panels = scene.interface.panels
    core.set("pressure", np.full(len(panels), PRESSURE))
    core.step(0.0, 1.0)
    position = scene.interface.nodes + core.get("displacement")
    flow = {"wind_speed": 10.0, "wind_direction": [1.0, 0.0, 0.0], "air_density": 1.2, "pressure": core.get("pressure")}
    loads = panel_loads(position, panels, {name: np.asarray(value) for name, value in flow.items()})
    found = ribs(scene.members, {name: core.get(name) for name in core.names}, scene.interface, position, loads)
    rib, cell = found[CELLS // 2]
    share = rib.design[:, 0]
    y = np.array([position[one.nodes, 1] for one, _ in found])
    return InflatedWing(y, share, cell.stress, cell.barlow, 0.5 * (share + np.roll(share, -1)))


def plane_strain(stiffness, nu=NU):
    """K N/m of cloth that keeps its length along the chord."""
    return stiffness / (1.0 - nu**2)


# The table

STRIPS = (2, 4, 8)
CHORDS = (4.0, 8.0, 16.0)  # m
STIFF = 1e7  # N/m: strains of 1e-5
# Slices of cells 1 m wide as drawn: height m, E h N/m, shortening %, whether ribs are held.
SLICES = (
    (0.4, STIFF, 0.0, False),
    (1.0, STIFF, 0.0, False),
    (2.0, STIFF, 0.0, False),
    (0.6, STIFF, -8.0, False),
    (0.6, STIFF, 8.0, False),
    (0.6, 1e3, 0.0, False),
    (0.6, 1e4, -4.0, True),
    (0.6, 1e4, 0.0, True),
    (0.6, 1e4, 4.0, True),
)


def closed_cell(height, stiffness, shortening, held):
    """The cell of an entry of `SLICES` in closed form."""
    width, k = 1.0 - 0.01 * shortening, plane_strain(stiffness)
    if held:
        return held_cell(width, 1.0, height, PRESSURE, k)
    return free_cell(width, height, PRESSURE, k)


def slice_rows(strips):
    """Rows of a table of SLICES: contraction of the spacing and p R over p w, in closed form and by membranes."""
    for height, stiffness, shortening, held in SLICES:
        exact = closed_cell(height, stiffness, shortening, held)
        found = [ballooned(cell_slice(1.0, height, n, stiffness, NU, shortening, held=held), PRESSURE) for n in strips]
        row = ["held" if held else "free", f"{1.0 / height:.4g}", f"{PRESSURE / stiffness:.0e}", f"{shortening:g}"]
        row += [f"{100.0 * (1.0 - one.spacing):.2f}" for one in (exact, *found)]
        yield row + [f"{one.tension / PRESSURE:.4f}" for one in (exact, *found)]


def wing_rows(chords):
    """Rows of a table of wings: contraction, by how much 8 % of shortening narrow the wing, and how far shortening from
    0 to 8 % along the chord turns the ribs, beside the closed form.
    """
    k, tapered = plane_strain(STIFFNESS), ((0.0, 0.0), (1.0, 8.0))
    plain, narrow = (free_cell(w * WIDTH, HEIGHT, PRESSURE, k).spacing for w in (1.0, 0.92))
    widths = WIDTH * np.linspace(1.0, 0.92, 41)
    for chord in chords:
        wings = [inflated_wing(chord, 4, ((0.0, s), (1.0, s))) for s in (0.0, 8.0, 4.0)]
        turned = inflated_wing(chord, 4, tapered).slope - wings[2].slope
        row = [f"{chord / WIDTH:g}", 100.0 * (1.0 - wings[0].spacing / WIDTH), 100.0 * (1.0 - plain / WIDTH)]
        row += [100.0 * (1.0 - wings[1].spacing / wings[0].spacing), 100.0 * (1.0 - narrow / plain)]
        row += [1e3 * turned, 1e3 * chord * straight_ribs(widths, HEIGHT, chord, PRESSURE, k)[1]]
        yield [row[0], *(f"{value:.2f}" for value in row[1:])]


def ballooning(quick):
    """Slices of cells and whole wings beside the closed form."""
    strips, chords = (STRIPS[:2], CHORDS[:1]) if quick else (STRIPS, CHORDS)
    each = ["closed form", *(f"{n} strips" for n in strips)]
    head = ["ribs", "w / h", "p w / (E h)", "shortening %"]
    head += [f"contraction %, {name}" for name in each] + [f"tension / (p w), {name}" for name in each]
    wing = ["chord / w", "contraction %", "closed form", "narrower by 8 % of shortening %", "closed form"]
    wing += ["spacing at the tail less that at the nose, mm", "closed form"]
    return "\n".join(
        [
            *table(head, slice_rows(strips)),
            "",
            "Slices of cells in plane strain, of cloth w wide as drawn, ribs free to come together or held where they "
            f"are drawn; Poisson's ratio {NU:g}.",
            "",
            *table(wing, wing_rows(chords)),
            "",
            "Whole wings of four cells with 4 strips each, ribs upright and else free, closed at nose, tail and tips. "
            "The last two columns are for shortening from none at the nose to 8 % at the tail.",
        ]
    )


ENTRIES = (Table("parafoil.ballooning", "Ballooned cells beside their closed form", ballooning),)
