"""What the assembly asks of a family of elements. A new family is one file with one subclass of `ElementGroup`."""

from dataclasses import Field, dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from interface.mirror import canonical_chains, paired_rows
from interface.validity import Criterion

# Part of a change of elements over which the rate of their strain energy is a central difference: accurate to 1e-12 by
# rounding, and to its square where the energy is no polynomial of second degree.
RATE = 1e-4


@dataclass(frozen=True, eq=False)
class Configuration:
    """A shape of the structure: node positions `x` (n,3) m, nodal `rotations` (r,3,3), None without any, and node
    velocities `v` (n,3) m/s where it moves.
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

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # a subclass is a dataclass

    nodes: np.ndarray
    names: tuple[str, ...] = ()
    counted: ClassVar[str] = "element"  # what one of them is called

    def __len__(self):
        return len(self.nodes)

    def label(self, row):
        """What a message calls an element."""
        return self.names[row] if self.names else f"number {row + 1} of {type(self).__name__}"

    def select(self, rows):
        """The chosen elements: `rows` of every array with a row an element, of `names`, and of attributes that can
        `select` themselves; whatever else there is holds for all elements.
        """

        def chosen(name, value):
            if isinstance(value, np.ndarray) and value.ndim and len(value) == len(self):
                return value[rows]
            if name == "names":
                return tuple(np.array(value, dtype=object)[rows]) if value else value
            return value.select(rows) if hasattr(value, "select") else value

        return replace(self, **{f.name: chosen(f.name, getattr(self, f.name)) for f in fields(self) if f.init})

    # Where the elements stand in the structure

    def dofs(self, node_count):
        """Dofs (e,d) that the forces act on: 3 node + axis for positions, 3 (node_count + rotation) + axis
        for spins."""
        return translations(self.nodes)

    @staticmethod
    def canonical(nodes):
        """Rows (e,m) of nodes in an order in which an element and one that lists its nodes otherwise are the same."""
        return canonical_chains(nodes)

    def images(self, mirror, rotation_images):
        """Row of the mirror image of each element (e,), -1 where there is none: the one between the images of its nodes
        and of its nodal rotations. `mirror` (n,) and `rotation_images` (r,) are the images of all of them.
        """
        places = self.dofs(len(mirror)) // 3
        rotations = places[:, (places >= len(mirror)).any(axis=0)] - len(mirror)
        keys = self.canonical(self.nodes), np.sort(rotations, axis=1)
        images = self.canonical(mirror[self.nodes]), np.sort(rotation_images[rotations], axis=1)
        return paired_rows(np.hstack(keys), np.hstack(images))

    def properties(self):
        """Name -> values (e,...) that an element shares with its mirror image in a symmetric structure, here every
        array of numbers but `nodes` and other indices. Vectors count as they stand, so that a family that has some is
        solved whole until it says here what is alike.
        """
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        return {k: a for k, a in arrays.items() if isinstance(a, np.ndarray) and a.dtype.kind in "bfc"}

    # Forces

    def forces(self, at):
        """Internal forces (e,d) N, moments N m, in the `Configuration` at: the gradient of the energy if it has one."""
        raise NotImplementedError

    def forces_and_tangents(self, at):
        """Internal forces (e,d), and their derivatives (e,d,d) by the dofs: the consistent tangent.

        Spins are rotations about fixed axes. Of an energy the tangent is the second derivative along them, which is
        symmetric; the derivative of a moment m by the spin of its own node has [m]x / 2 besides, which has to be taken
        out: in equilibrium it cancels over the elements of a node, and the assembly adds that of applied moments.
        """
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

    def damper_work(self, after, begin, end):
        """Heat J of the dampers while the structure goes from the moving configuration `begin` to `end` and the
        elements change to those `after`, and the part of it J that changes of rest length put in: here the heat of the
        mean force on the way of the nodes.
        """
        if not self.damped:
            return 0.0, 0.0
        way = (end.x - begin.x)[self.nodes].reshape(len(self), -1)
        return 0.5 * float(np.sum((self.damping_forces(begin) + after.damping_forces(end)) * way)), 0.0

    def changing_work(self, after, begin, end):
        """Work J that changes of the elements to those `after` put into their strain energy, while the structure goes
        from the configuration `begin` to `end`: here the mean of its rates at both ends, of second order in the step.
        """

        def rate(at, share):  # by a small part of the change: all of it could stretch what never was so stretched
            return (self.changed(after, share + RATE).energy(at) - self.changed(after, share - RATE).energy(at)) / RATE

        return 0.0 if after is self else 0.25 * (rate(begin, 0.0) + rate(end, 1.0))

    def changed(self, after, share):
        """The elements with all of their arrays of numbers by a share (1: all of it) of the way to those of `after`."""
        own = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        numbers = {k: a for k, a in own.items() if isinstance(a, np.ndarray) and a.dtype.kind == "f"}
        return replace(self, **{k: a + share * (getattr(after, k) - a) for k, a in numbers.items()})

    # Up to where they are known to be good

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """What its elements are judged by; here nothing."""
        return ()

    def measured(self, at) -> dict[str, np.ndarray]:
        """What the elements carry and how far they stretch in a configuration, name -> values (e,): all that they are
        judged by, and what else is worth showing.
        """
        return {}

    def judged(self, measured) -> dict[str, np.ndarray]:
        """Name of each of the `criteria` -> values (e,) of the elements, from what was `measured`."""
        return {}

    @property
    def wrinkles(self):
        """Whether they may lose their stiffness in a direction without being slack, as membranes do: solvers then
        watch the energy.
        """
        return False

    def smoothing(self):
        """Stiffness (e,d,d) N/m against motion of their nodes relative to one another, in any direction: the
        Laplacian of elements that wrinkle, for steps of solvers alone; None without.
        """
        return None

    # Variants of them

    def undamped(self):
        """The same elements without dampers."""
        return self

    def never_slack(self):
        """The same elements able to push; the group itself where all are."""
        return self

    # What solvers need to know of them

    def stiffness(self, at):
        """Stiffness (e,) N/m of each element in a configuration, a scale: what Newton's method shifts by where nothing
        else is stiff, and what rounding of coordinates is multiplied by. Here the largest on the diagonal of its
        tangent by positions.
        """
        tangents = self.forces_and_tangents(at)[1]
        by_positions = self.dofs(len(at.x)) < 3 * len(at.x)
        return np.max(np.abs(np.einsum("eii->ei", tangents)), axis=1, where=by_positions, initial=0.0)

    def rounding(self, at, reach):
        """Force (e,) N over machine epsilon by which rounding may change the forces of each element in a configuration,
        whose coordinates are up to `reach` m.
        """
        return self.stiffness(at) * reach

    def only_pulling(self):
        """The same elements as `chains.Chains` that can only pull, the start of a difficult solve; None for a family
        that is nothing of the kind.
        """
        return None

    def softenable(self):
        """Largest force N, stiffness times length, of the elements that a difficult solve may begin with softened."""
        return 0.0

    def softened(self, load):
        """The group with what is `softenable` in series with a spring that a `load` N stretches to twice its length."""
        return self
