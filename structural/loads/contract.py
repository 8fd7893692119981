"""What the assembly asks of the places where loads act. A new kind is one file with one subclass of `LoadGroup`."""

from dataclasses import Field, dataclass, field, fields, replace
from typing import Any, ClassVar, Self

import numpy as np
import scipy.sparse as sp

from interface.mirror import canonical_chains


class Load:
    """Values that act on a `LoadGroup`, a frozen dataclass: arrays with a row an element, but those named in `uniform`,
    and numbers for all elements.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # a subclass is a dataclass

    uniform: ClassVar[tuple[str, ...]] = ()

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """Name -> array with a row an element."""
        parts = {f.name: getattr(self, f.name) for f in fields(self)}
        return {k: v for k, v in parts.items() if isinstance(v, np.ndarray) and k not in self.uniform}

    def select(self, rows) -> Self:
        """The values on the chosen elements."""
        return replace(self, **{k: a[rows] for k, a in self.arrays.items()})

    def between(self, other: "Load", share: float) -> "Load":
        """Linearly between these values (share 0) and those of another load of the same kind (1); None counts as zero,
        and what is no number is that of the other.
        """
        pairs = {f.name: (getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}
        return replace(other, **{k: _between(*pair, share) for k, pair in pairs.items()})


def _between(a, b, share):
    if a is b or not isinstance(b if a is None else a, np.ndarray | float | int):
        return b
    a, b = (0.0 * b if a is None else a), (0.0 * a if b is None else b)
    return a + share * (b - a)


@dataclass(frozen=True, eq=False)
class LoadGroup:
    """Elements with m corners each that carry loads of one kind.

    `nodes` (e,m) are nodes of a surface, and surface nodes = weights @ structural nodes, `weights` (s,n) sparse; None
    where they are structural nodes themselves. Loads are no part of it: they come with every solve.
    """

    takes: ClassVar[type[Load]] = Load  # the kind of load

    nodes: np.ndarray
    weights: sp.csr_array | None = field(default=None, kw_only=True)

    def __len__(self):
        return len(self.nodes)

    def select(self, rows) -> Self:
        """The chosen elements on the same surface: `rows` of every array with a row an element."""
        parts = {f.name: getattr(self, f.name) for f in fields(self) if f.init and f.name != "weights"}
        ours = {k: v for k, v in parts.items() if isinstance(v, np.ndarray) and v.ndim and len(v) == len(self)}
        return replace(self, **{k: v[rows] for k, v in ours.items()})

    def require(self, load: Load, name: str) -> None:
        """ValueError in one sentence for a load of another kind, or with another number of elements than this group,
        which a structure calls `name`.
        """
        if not isinstance(load, self.takes):
            raise ValueError(f"load group '{name}' takes a {self.takes.__name__}, not a {type(load).__name__}.")
        for what, array in load.arrays.items():
            if len(array) != len(self):
                raise ValueError(f"load group '{name}' has {len(self)} elements; {what} has values for {len(array)}.")

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
