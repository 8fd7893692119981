"""What the assembly asks of a family of elements. A new family is one file with one subclass of `ElementGroup`."""

from dataclasses import dataclass, fields, replace

import numpy as np

from interface.mirror import canonical_chains


@dataclass(frozen=True, eq=False)
class Configuration:
    """A shape of the structure: node positions `x` (n,3) m, `rotations` (r,3,3) of its frames, None without any, and
    node velocities `v` (n,3) m/s where it moves.
    """

    x: np.ndarray
    rotations: np.ndarray | None = None
    v: np.ndarray | None = None


def translations(nodes):
    """Dofs (e, 3m) of elements that know the positions of their nodes (e, m) only."""
    return (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 3 * nodes.shape[1])


class ElementGroup:
    """Elements of one family with equally many nodes each; a frozen dataclass of arrays whose first axis counts them.

    A subclass has `nodes` (e,m) indices and gives `forces` and `forces_and_tangents`; all else has an answer that
    suits most. Whatever changes between solves (rest lengths, pressures) is an attribute like any other: the assembly
    knows connectivity only, and takes a group of new values for every solve.
    """

    nodes: np.ndarray
    names: tuple[str, ...] = ()

    def __len__(self):
        return len(self.nodes)

    def label(self, row):
        """What a message calls an element."""
        return self.names[row] if self.names else f"number {row + 1} of {type(self).__name__}"

    def select(self, rows):
        """The chosen elements: `rows` of every array, of names, and of attributes that can `select` themselves."""

        def chosen(value):
            if isinstance(value, np.ndarray):
                return value[rows]
            if isinstance(value, tuple):
                return tuple(np.array(value, dtype=object)[rows]) if value else value
            return value.select(rows) if hasattr(value, "select") else value

        return replace(self, **{f.name: chosen(getattr(self, f.name)) for f in fields(self)})

    # Where the elements stand in the structure

    def dofs(self, node_count):
        """Dofs (e,d) that the forces act on: 3 node + axis for positions, 3 (node_count + frame) + axis for spins."""
        return translations(self.nodes)

    @staticmethod
    def canonical(nodes):
        """Rows (e,m) of nodes in an order in which an element and one that lists its nodes otherwise are the same."""
        return canonical_chains(nodes)

    def properties(self):
        """Name -> values (e,) that an element shares with its mirror image in a symmetric structure."""
        return {}

    # Forces

    def forces(self, at):
        """Internal forces (e,d) N, moments N m, in the `Configuration` at: the gradient of the energy if it has one."""
        raise NotImplementedError

    def forces_and_tangents(self, at):
        """Internal forces (e,d), and their derivatives (e,d,d) by the dofs: the consistent tangent."""
        raise NotImplementedError

    def energy(self, at):
        """Strain energy J of all elements; None for a family whose forces have none."""
        return None

    @property
    def damped(self):
        """Whether the elements resist motion too."""
        return False

    def damping_forces(self, at):
        """Internal forces (e,d) N of the dampers alone, in a moving configuration."""
        raise NotImplementedError

    def damping_forces_and_tangents(self, at, isotropic=False):
        """Forces (e,d) N of the dampers, derivatives (e,d,d) by positions N/m and by velocities N s/m.

        `isotropic` asks for the simplified derivative of the PSM thesis, where a family has it.
        """
        raise NotImplementedError

    def reeling_power(self, at):
        """Power W that changes of rest length put into the dampers."""
        return 0.0

    # Variants of them

    def undamped(self):
        """The same elements without dampers."""
        return self

    def never_slack(self):
        """The same elements able to push; the group itself where all are."""
        return self

    # What solvers need to know of them

    def slackening_stiffness(self):
        """Stiffness (e,) N/m that an element loses when it goes slack; zero for those that never do."""
        return np.zeros(len(self.nodes))

    def rounding(self, reach):
        """Force (e,) N over machine epsilon by which rounding of lengths may change the forces of an element whose
        coordinates are up to `reach` m.
        """
        return np.zeros(len(self.nodes))

    def softenable(self):
        """Largest force N, stiffness times length, of the elements that a difficult solve may begin with softened."""
        return 0.0

    def softened(self, load):
        """The group with what is `softenable` in series with a spring that a `load` N stretches to twice its length."""
        return self
