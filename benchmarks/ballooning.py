"""The ballooning of a ram-air cell under one pressure everywhere: a prismatic cell in closed form, and slices of wings
of such cells, made of membranes by the generator of parafoils.

A cell is a strip of cloth w wide above and below, between two ribs of height h at the spacing s, long in the direction
of the chord, along which nothing strains. Cloth under the pressure p is a cylinder: an arc of the radius R, of half the
angle phi, with the force p R per length (Barlow), stretched by lambda,

    lambda w = 2 R phi,   s = 2 R sin phi,   p R = lambda S,   S = K (lambda^2 - 1) / 2,   K = E h / (1 - nu^2),

hence lambda^2 = 1 + p w / (K phi): the cloth is longer by as much, whoever holds the ribs. Where they are held s is
given. Where they may come together, the pressure on the cut through the middle of a cell, of the height h + 2 R (1 -
cos phi), is what the cloth carries above and below, 2 p R, so that

    2 R cos phi = h:

the centre of the arcs is halfway up the rib, as the ram-air thesis draws it (2.3.2). Cloth that does not stretch has
phi / cos phi = w / h then and encloses the largest volume that it can. Ribs carry p s from the upper to the lower
cloth; those that stretch are higher by lambda_h, lambda_h K_rib (lambda_h^2 - 1) / 2 = p s.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, fsolve

from scenes.builders.mesh import TriangleMesh
from scenes.builders.parafoils import panels_across, parafoil
from scenes.builders.patterns import fibre_angles, shortened
from scenes.builders.ram_air import ram_air_mesh
from structural import Assembly, FaceLoad, Faces, Loads, Structure, equilibrium
from structural.elements.membrane_results import membrane_state, reactions
from structural.elements.membranes import Membranes, flat_patterns
from structural.materials.membranes import isotropic_membrane

DEPTH = 0.02  # m of a slice along the chord, one panel
ROWS = 2  # sides of a rib from the lower to the upper cloth
LEAST, MOST = 1e-9, np.pi - 1e-9  # rad, half the angle of an arc


@dataclass(frozen=True)
class Cell:
    """A ballooned cell: `spacing` m of its ribs, `radius` m and half the `angle` rad of its arcs, `tension` N/m of the
    cloth across the ribs, its `stretch`, the `height` m of its ribs.
    """

    spacing: float
    radius: float
    angle: float
    tension: float
    stretch: float
    height: float


def _arc(width, pressure, stiffness, angle, height):
    stretch = float(np.sqrt(1.0 + pressure * width / (stiffness * angle)))
    radius = stretch * width / (2.0 * angle)
    return Cell(2.0 * radius * np.sin(angle), radius, angle, pressure * radius, stretch, height)


def rib_height(height, pull, stiffness):
    """Height m of a rib under `pull` N per m of chord, `height` m at rest, K `stiffness` N/m; its chord keeps its
    length.
    """
    if np.isinf(stiffness):
        return height
    return height * brentq(lambda v: 0.5 * stiffness * v * (v**2 - 1.0) - pull, 1.0, 1.0 + pull / stiffness + 1.0)


def free_cell(width, height, pressure=1.0, stiffness=np.inf, rib_stiffness=np.inf):
    """The cell whose ribs may come together: cloth `width` m across, ribs `height` m high at rest, K N/m of both."""

    def excess(angle):
        cell = _arc(width, pressure, stiffness, angle, height)
        return 2.0 * cell.radius * np.cos(angle) - rib_height(height, pressure * cell.spacing, rib_stiffness)

    angle = brentq(excess, LEAST, 0.5 * np.pi, xtol=1e-15)
    spacing = _arc(width, pressure, stiffness, angle, height).spacing
    return _arc(width, pressure, stiffness, angle, rib_height(height, pressure * spacing, rib_stiffness))


def held_cell(width, spacing, height, pressure=1.0, stiffness=np.inf):
    """The cell whose ribs are held at the `spacing` m: cloth `width` m across, K `stiffness` N/m. ValueError for cloth
    that neither is wider than that nor stretches.
    """
    if width <= spacing and np.isinf(stiffness):
        raise ValueError(f"cloth {width:g} m wide that does not stretch is no arc between ribs {spacing:g} m apart.")
    angle = brentq(lambda a: _arc(width, pressure, stiffness, a, height).spacing - spacing, LEAST, MOST, xtol=1e-15)
    return _arc(width, pressure, stiffness, angle, height)


def pull_on_end_rib(cell, pressure):
    """N per m of chord by which the cloth of the last cell pulls its rib inward, less the pressure on the tip."""
    return 2.0 * cell.tension * np.cos(cell.angle) - pressure * cell.height


def straight_ribs(widths, height, chord, pressure=1.0, stiffness=np.inf):
    """Mean spacing m and its slope over the chord of ribs that may come together and turn in plan, but stay straight:
    cloth `widths` m across at equal steps along the chord m, ribs as high everywhere. Nothing pulls or turns the last
    one: the pull on it, and its moment, are zero over the chord.
    """
    arm = np.linspace(-0.5 * chord, 0.5 * chord, len(widths))

    def left(values):
        mean, slope = values
        cells = [held_cell(w, mean + slope * x, height, pressure, stiffness) for w, x in zip(widths, arm, strict=True)]
        pull = np.array([pull_on_end_rib(cell, pressure) for cell in cells]) / (pressure * height)
        return np.trapezoid(pull, arm) / chord, np.trapezoid(pull * arm, arm) / chord**2

    start = free_cell(float(np.mean(widths)), height, pressure, stiffness).spacing
    mean, slope = fsolve(left, [start, 0.0], xtol=1e-12)
    return float(mean), float(slope)


# Slices of a wing of such cells


@dataclass(frozen=True, eq=False)
class Slice:
    """A slice between two planes of symmetry x = const of a wing of cells: `nodes` (n,3) m as drawn, `fixed` (n,3),
    the `group` of membranes and which of its triangles are `skin` (e,), those of them that are cloth `across` (e,)
    from rib to rib, and nodes (k,m) of the `sections` from tip to tip, those of `ribs` (r,) standing at ribs.
    """

    nodes: np.ndarray
    fixed: np.ndarray
    group: Membranes
    skin: np.ndarray
    across: np.ndarray
    sections: np.ndarray
    ribs: np.ndarray


def rectangular_section(height):
    """Points (n,2) m of a rectangle, x and z, from the middle of its rear side over the upper side and back."""
    top, none = 0.5 * height, 0.0
    return np.array([[DEPTH, none], [DEPTH, top], [none, top], [none, none], [none, -top], [DEPTH, -top]])


def cell_slice(spacing, height, strips, stiffness, nu=0.0, shortening=0.0, cells=2, held=False, rib_stiffness=np.inf):
    """Slice of a wing of `cells` with ribs `spacing` m apart as drawn, its cloth cut narrower by `shortening` per cent,
    `strips` from rib to rib, E h `stiffness` and `rib_stiffness` N/m.

    Ribs are held upright, in full where they are `held`, and the middle one stays in its plane; but with a
    `rib_stiffness` that is finite they are free to stretch. What closes the tips is half as stiff as a rib, since it
    has half the load.
    """
    section = rectangular_section(height)
    at = spacing * np.arange(cells // 2 + 1)
    ribs = np.stack([np.column_stack([section[:, 0], np.full(len(section), y), section[:, 1]]) for y in at])
    surface = parafoil(ribs, strips)
    mesh = ram_air_mesh(surface.nodes, surface.panels, surface.sections[surface.ribs], ROWS, None, True)
    rows, _, direction = panels_across(surface)
    # front and rear of the slice are open; ribs and what closes the tips have triangles without area there
    middle = mesh.nodes[mesh.triangles].mean(axis=1)[:, 0] / DEPTH
    kept = np.flatnonzero((middle > 1e-9) & (middle < 1.0 - 1e-9))
    triangles = mesh.triangles[kept]
    across, skin = np.isin(kept, rows), np.isin(kept, mesh.triangle_parts["skin"])
    cloth = TriangleMesh(mesh.nodes, triangles[across])
    pattern = flat_patterns(mesh.nodes, triangles)
    angle = fibre_angles(cloth, pattern[across], direction[np.searchsorted(rows, kept[across])])
    pattern[across] = shortened(pattern[across], 1.0 - 0.01 * shortening, 1.0, angle)
    stretches = np.isfinite(rib_stiffness)
    firm = rib_stiffness if stretches else stiffness
    moduli = np.where(across, stiffness, np.where(skin, 0.5 * firm, firm))
    group = Membranes(triangles, pattern, isotropic_membrane(moduli, np.full(len(kept), nu)))
    fixed = _supports(mesh.nodes, np.unique(triangles), at, held, stretches)
    return Slice(mesh.nodes, fixed, group, skin, across, surface.sections, surface.ribs)


def _supports(nodes, used, at, held, stretches):
    """Fixed directions (n,3): see `cell_slice`."""
    fixed = np.zeros(nodes.shape, dtype=bool)
    fixed[:, 0] = True
    loose = np.ones(len(nodes), dtype=bool)
    loose[used] = False
    fixed[loose] = True
    on_rib = np.isclose(np.abs(nodes[:, 1])[:, None], at).any(axis=1)
    fixed[on_rib, 2] |= not stretches
    fixed[on_rib & np.isclose(nodes[:, 2], 0.0), 2] = True
    fixed[np.isclose(nodes[:, 1], 0.0), 1] = True
    fixed[on_rib, 1] |= held
    return fixed


@dataclass(frozen=True, eq=False)
class Ballooned:
    """A slice under pressure: `status`, mean `spacing` m of its ribs, the Cauchy stress across the ribs as the mean
    `tension` N/m of its cloth by area, `height` m of the middle rib, and what the last rib, where it is held, is pulled
    inward by, `pull` N per m of chord.
    """

    status: str
    spacing: float
    tension: float
    height: float
    pull: float


def ballooned(slice_, pressure):
    """The `Ballooned` equilibrium of a slice under a pressure on its cloth and what closes its tips."""
    group, skin = slice_.group, slice_.skin
    structure = Structure(slice_.nodes, slice_.fixed, (group,), {"skin": Faces(group.nodes[skin])})
    loads = Loads(np.zeros_like(slice_.nodes), {"skin": FaceLoad(np.full(np.count_nonzero(skin), float(pressure)))})
    found = equilibrium(Assembly(structure), loads, slice_.nodes, atol=0.0, rtol=1e-9)
    x, ribs = found.x, slice_.sections[slice_.ribs]
    outline = ribs[:, ~np.isclose(slice_.nodes[ribs[0], 2], 0.0)]  # the points halfway up are on no cloth
    y, z = x[outline, 1], x[outline[len(ribs) // 2], 2]
    tension = _tension_across(group, slice_.across, x)
    at_last = np.isclose(slice_.nodes[:, 1], slice_.nodes[:, 1].max())
    pull = reactions(structure, x, loads)[at_last, 1].sum() / DEPTH
    return Ballooned(found.status, np.ptp(y.mean(axis=1)) / (len(ribs) - 1), tension, np.ptp(z), pull)


def _tension_across(group, cloth, x):
    """Mean Cauchy stress N/m of triangles `cloth` (e,) normal to the chord, along which they keep their length."""
    state, corner = membrane_state(group, x), x[group.nodes]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    across = np.cross(normal, [1.0, 0.0, 0.0])
    cosine2 = np.einsum("ei,ei->e", across, state.direction) ** 2 / np.einsum("ei,ei->e", across, across)
    stress = cosine2 * state.cauchy[:, 0] + (1.0 - cosine2) * state.cauchy[:, 1]
    return np.average(stress[cloth], weights=state.area[cloth])
