"""What the assembly asks of the places where loads act. A new kind is one file with one subclass of `LoadGroup`."""

from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
import scipy.sparse as sp

from interface.mirror import canonical_chains


class Load:
    """Values that act on a `LoadGroup`: arrays whose first axis counts its elements, or values for all of them."""

    def select(self, rows) -> Self:
        """The values on the chosen elements; what is no array holds for all."""
        return self._each(lambda a: a[rows])

    def between(self, other: "Load", share: float) -> "Load":
        """Linearly between these values (share 0) and those of another load of the same kind (1)."""
        pairs = {f.name: (getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}  # type: ignore[arg-type]
        return replace(other, **{  # type: ignore[type-var]
            k: a + share * (b - a) if isinstance(a, np.ndarray) and a is not b else b for k, (a, b) in pairs.items()
        })  # fmt: skip

    def _each(self, change) -> Self:
        parts = {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]
        return replace(self, **{k: change(v) for k, v in parts.items() if isinstance(v, np.ndarray)})  # type: ignore[type-var]


@dataclass(frozen=True, eq=False)
class LoadGroup:
    """Elements with m corners each that carry loads of one kind.

    `nodes` (e,m) are nodes of a surface, and surface nodes = weights @ structural nodes, `weights` (s,n) sparse; None
    where they are structural nodes themselves. Loads are no part of it: they come with every solve.
    """

    nodes: np.ndarray
    weights: sp.csr_array | None = field(default=None, kw_only=True)

    def __len__(self):
        return len(self.nodes)

    def select(self, rows) -> Self:
        """The chosen elements on the same surface."""
        parts = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "weights"}
        return replace(self, **{k: v[rows] for k, v in parts.items() if isinstance(v, np.ndarray)})

    @staticmethod
    def canonical(nodes):
        """See ElementGroup."""
        return canonical_chains(nodes)

    def forces(self, points, load: Any, velocities=None):
        """External forces (e,m,3) N on the corners at `points` (e,m,3) m, which move with `velocities` m/s, if any."""
        raise NotImplementedError

    def forces_and_tangents(self, points, load: Any, velocities=None):
        """Forces (e,m,3) N, and their derivatives (e,3m,3m) by points N/m and by velocities N s/m (None: none)."""
        raise NotImplementedError
