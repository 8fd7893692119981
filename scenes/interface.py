"""The interface mesh between structure and flow, hung on the structural nodes by a linear map."""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from interface import SurfaceMesh


@dataclass(frozen=True, eq=False)
class Interface(SurfaceMesh):
    """The surface mesh of a scene, hung on its structure: nodes = `weights` (n, m) @ the m structural nodes, exactly.

    Where its panels are strips of a wing, `sections` (s+1, k+1) are node indices section by section at the `fractions`
    (k+1,) of the chord, and `panels` (k s, 4) as `station_panels` has them. Where they close a body, `trailing_edges`
    (t,2) are pairs of its nodes; `remarks` are what was changed when it was made.
    """

    weights: sp.csr_array
    sections: np.ndarray
    fractions: np.ndarray
    trailing_edges: np.ndarray | None = field(default=None, kw_only=True)
    remarks: tuple[str, ...] = field(default=(), kw_only=True)
