"""A core that evaluates a body of panels at a point, and its FMU. Inside the FMU this is the script."""

import numpy as np

from aero.panel.influence import PanelGeometry, induced_velocity, influence
from aero.panel.kernels import compiled
from fmus.adapter import CoreFmu
from interface import Variable

NODES = np.array(
    [[1.0, 0.0, 0.0], [0.0, 1.2, 0.1], [-0.9, 0.0, 0.0], [0.1, -1.0, 0.0], [0.0, 0.0, 0.8], [0.0, 0.1, -1.0]]
)
PANELS = np.array([[0, 1, 4, 4], [1, 2, 4, 4], [2, 3, 4, 4], [3, 0, 4, 4], [0, 3, 2, 1]])


class Body:
    """Potentials and velocity of a wedge of unit source and doublet densities at `point`."""

    def __init__(self):
        self.variables = (
            Variable("point", (3,), unit="m"),
            Variable("potential", (2,), "output", unit="m2/s"),
            Variable("velocity", (3,), "output", unit="m/s"),
            Variable("in_c", (), "output", kind="boolean"),
        )
        self.values = {v.name: np.zeros(v.shape) for v in self.variables}

    def set(self, block, values):
        self.values[block] = np.array(values, dtype=float)

    def get(self, block):
        return self.values[block]

    def look(self):
        pass

    def step(self, t, dt):
        geometry, ones = PanelGeometry.of(NODES, PANELS), np.ones(len(PANELS))
        points = self.values["point"][None]
        doublets, sources = influence(geometry, points, ones)
        self.values["potential"] = np.array([doublets.sum(), sources[0]])
        self.values["velocity"] = induced_velocity(geometry, points, ones, 2.0 * ones)[0]
        self.values["in_c"] = np.array(float(compiled() is not None))

    def save(self):
        return {name: value.copy() for name, value in self.values.items()}

    def restore(self, state):
        self.values = {name: value.copy() for name, value in state.items()}


class BodyFmu(CoreFmu):
    """The body as an FMU."""

    title = "Body"

    def __init__(self, core=None, **kwargs):
        super().__init__(core or Body(), **kwargs)
