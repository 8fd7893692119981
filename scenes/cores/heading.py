"""Which way a kite looks: its own axes, x downwind and y along the span, in which a turned kite is the one drawn."""

from typing import Any

import numpy as np

from interface import Variable
from interface.vectors import azimuth, azimuth_axes, rotated

SMALLEST = 1e-9  # rad: less is the rounding of tables


class Heading:
    """The axes of a scene's kite, turned about z from the global ones by `drawn` rad as its tables have it.

    What is `home` is as the solvers see it: wings in the x-z plane whatever the azimuth. The kite is turned by the
    parameter `start_azimuth` beyond that about the upright axis through `about` (3,) m, its pivot or the middle of its
    tips. A rigid body of a mesh from a file may be drawn any way: it looks into the wind of its scene. Where neither
    turns it, home is where it is, to the last bit.
    """

    def __init__(self, scene):
        nodes, struts = scene.members.nodes, scene.struts
        tips = np.zeros((2, 3)) if not len(struts) else nodes[struts[[0, -1]]].mean(axis=1)
        across = tips[1] - tips[0]
        angle = azimuth([across[1], -across[0], 0.0])
        if scene.structure is None and scene.body is not None and scene.body.shape == "mesh-file":
            angle = azimuth(scene.aero.wind_direction)
        self.drawn = angle if abs(angle) > SMALLEST and _turnable(scene.members.fixed) else 0.0
        self.about = tips.mean(axis=0) if scene.pivot is None else nodes[scene.pivot]
        self._home = self.about
        if self.drawn:  # as far from the plane y = 0 as it is from the plane half way between the tips
            aside = (self.about - tips.mean(axis=0)) @ azimuth_axes(self.drawn)[:, 1]
            self._home = np.array([self.about[0], aside, self.about[2]])

    def axes(self, values):
        """Columns (3,3) of the axes of the kite with these values of parameters; None where they are global."""
        angle = self.drawn + float(values.get("start_azimuth", 0.0))
        return None if angle == 0.0 else azimuth_axes(angle)

    def home(self, points):
        """Points (n,3) m of the tables as the solvers see them."""
        return points if self.drawn == 0.0 else (points - self.about) @ azimuth_axes(self.drawn) + self._home

    def placed(self, points, axes):
        """Points (n,3) m at home where they are with the `axes` of the kite."""
        return points if axes is None else (points - self._home) @ axes.T + self.about

    def taken_home(self, points, axes):
        """Points (n,3) m at home that stand at these places with the `axes` of the kite: `placed`, undone."""
        return points if axes is None else (points - self.about) @ axes + self._home

    def inward(self, vectors, values):
        """Vectors (...,3) in the axes of the kite with these values of parameters."""
        return inward(vectors, self.axes(values))

    def started(self, points, values):
        """Points (n,3) m of the tables where the kite starts: nose-up by `trim_angle`, turned by `start_azimuth`."""
        angle, axes = float(values.get("trim_angle", 0.0)), self.axes(values)
        if axes is None:
            return rotated(points, angle, self.about)
        return self.placed(rotated(self.home(points), angle, self._home), axes)


def inward(vectors, axes):
    """Vectors (...,3) in the axes of the kite."""
    return vectors if axes is None or vectors is None else vectors @ axes


def outward(vectors, axes):
    """Vectors (...,3) of the kite in the global axes."""
    return vectors if axes is None else vectors @ axes.T


def azimuth_variables(scene):
    """The parameter of both sides that turns a kite to the wind, where it has a trim angle."""
    if scene.trim is not None:
        text = "rigid rotation about the upright axis through the pivot in which the kite starts, after trim_angle; "
        text += "its plane of symmetry turns with it"
        kind: dict[str, Any] = {"causality": "parameter", "variability": "fixed", "unit": "rad"}
        yield Variable("start_azimuth", **kind, minimum=-7.0, maximum=7.0, description=text)


def start_azimuth(scene, direction):
    """Angle rad about the upright axis through the pivot by which a kite starts turned, so that it looks into a wind to
    this `direction` (3,); 0 in an upright wind, and where its supports do not let it turn.
    """
    nodes, fixed = scene.members.nodes, scene.members.fixed
    direction = np.asarray(direction, float)
    if direction.shape != (3,) or scene.pivot is None or not _turnable(fixed):
        return 0.0
    if np.any(nodes[fixed.any(axis=1), :2] != nodes[scene.pivot, :2]):
        return 0.0
    if not np.hypot(*direction[:2]) > SMALLEST * np.linalg.norm(direction):
        return 0.0
    angle = azimuth(direction) - scene.heading.drawn
    angle -= 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
    return angle if abs(angle) > SMALLEST else 0.0


def _turnable(fixed):
    """Whether supports (n,3) hold x and y alike, so that they are the same from every side."""
    return bool(np.array_equal(fixed[:, 0], fixed[:, 1]))
