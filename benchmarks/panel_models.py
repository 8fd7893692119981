"""Bodies and wings for the benchmarks of the panel method, and the flow around them."""

import functools

import numpy as np

from aero.methods import method_options, wing_model
from aero.model import Flow, Wing
from interface import SurfaceMesh
from scenes.builders.profiles import naca
from scenes.builders.wings import BoxWing, Planform, mirrored_wing, span_shares

SPEED, DENSITY = 10.0, 1.2
PRESSURE = 0.5 * DENSITY * SPEED**2


def rectangular(strips, panels, span=6.0, sweep=0.0):
    """A wing of chord 1 m with NACA 0012, `strips` to each side and `panels` round the profile."""
    form = Planform(span, 1.0, 1.0, sweep=sweep)
    return mirrored_wing(form.stations(span_shares(strips, "cosine")).sections(naca("0012").points(panels)))


def box_wing(strips, panels, thickness="0012", plate=None, corner=3):
    """The box wing of the ram-air thesis, section 4.1.1, with `strips` on half of each wing, on each `plate`, else
    about as wide ones, and on each `corner`.
    """
    box = BoxWing(12.0, 2.4, 1.0, 0.15, strips, plate or max(2, round(0.45 * strips)), corner, "cosine")
    return box.surface(naca(thickness).points(panels))


def panel_model(surface, **options):
    """The panel method for a surface, and the values of its parameters."""
    chosen = {name: option.default for name, option in method_options("panel").items()} | options
    mesh = SurfaceMesh(surface.nodes, surface.panels)
    model = wing_model("panel", Wing(mesh, chosen, True, trailing_edges=surface.trailing_edges))
    return model, {v.name: np.asarray(v.start, float) for v in model.variables if v.causality == "parameter"}


def stream(nodes, degrees):
    """The flow at an angle to the x axis."""
    a = np.deg2rad(degrees)
    return Flow(nodes, np.array([np.cos(a), 0.0, np.sin(a)]), SPEED, DENSITY)


@functools.cache
def wing_of(panels):
    """The rectangular wing whose half has about so many panels, four times as many round the profile as strips."""
    strips = max(3, round(0.5 * np.sqrt(panels)))
    return rectangular(strips, 2 * round(0.5 * panels / strips))


def bent(nodes, tips):
    """Nodes with the tips some m up."""
    lifted = nodes.copy()
    lifted[:, 2] += tips * (nodes[:, 1] / nodes[:, 1].max()) ** 2
    return lifted
