"""What all rooms agree on: vectors and the geometry of interface panels, named blocks of values, one kind of failure,
what may be read and how things may be called.

A leaf: it imports nothing of the project, so that structure and flow need not know each other to mean the same panel.
"""

import time

from .failures import SimulationEnded, StepDiscarded, StepFailed
from .files import irregular, misnamed, unprintable
from .mesh import SurfaceMesh
from .mirror import MIRROR, UprightPlane, mirror_permutation, mirror_rows
from .panels import area_vectors, corner_shares
from .validity import Criterion
from .variables import Variable
from .vectors import cross, rotation, spin, turned

LOADED_AT = time.time()  # s; what is changed later is not what this process runs

__all__ = [
    "LOADED_AT",
    "MIRROR",
    "Criterion",
    "SimulationEnded",
    "StepDiscarded",
    "StepFailed",
    "SurfaceMesh",
    "UprightPlane",
    "Variable",
    "area_vectors",
    "corner_shares",
    "cross",
    "irregular",
    "mirror_permutation",
    "mirror_rows",
    "misnamed",
    "rotation",
    "spin",
    "turned",
    "unprintable",
]
