"""Closed wings for the panel method, and models of the flow around them."""

from functools import cache

import numpy as np

from aero.methods import method_options, wing_model
from aero.model import Flow, Wing
from interface import SurfaceMesh
from scenes.builders.profiles import naca
from scenes.builders.wings import Planform, mirrored_wing, span_shares


@cache
def wing(strips=6, panels=30, profile="0012", closed="flat", **planform):
    """A closed wing with strips to each side and tips `closed` flat or round, rectangular of aspect ratio 6 unless the
    `planform` says otherwise.
    """
    form = Planform(**{"span": 6.0, "root": 1.0, "tip": 1.0, **planform})
    sections = form.stations(span_shares(strips, "cosine")).sections(naca(profile).points(panels))
    return mirrored_wing(sections, closed)


def panel_model(surface, symmetric=True, polars=None, **options):
    """The `PanelModel` of a surface."""
    chosen = {name: option.default for name, option in method_options("panel").items()} | options
    mesh = SurfaceMesh(surface.nodes, surface.panels)
    return wing_model("panel", Wing(mesh, chosen, symmetric, polars=polars, trailing_edges=surface.trailing_edges))


def values(model, **given):
    """Values of the parameters of a model: their starts, or as `given`."""
    starts = {v.name: np.asarray(v.start, float) for v in model.variables if v.causality == "parameter"}
    return starts | {name: np.asarray(value, float) for name, value in given.items()}


def direction(alpha, beta=0.0):
    """Direction of a wind at angles rad: from below, and from the left."""
    return np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])


def flow(surface, alpha=0.08, beta=0.0, speed=10.0, **more):
    """A stream of 1.2 kg/m^3 around a surface as it is."""
    return Flow(surface.nodes, direction(alpha, beta), speed, 1.2, **more)
