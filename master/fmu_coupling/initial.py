"""Initialisation of coupled FMUs: what sources send arrives before their targets compute their initial state.

FMI 2.0 lets inputs be set and outputs be read in initialization mode. FMUs are initialised in the order of the graph of
connections, so that a target gets what its source has after its own initialisation; those in a loop are in that mode
together, until what they send settles.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from interface import StepFailed
from master.coupling.acceleration import IQNILS
from master.coupling.exchange import Connection, Exchange
from master.coupling.fixed_point import fixed_point
from master.coupling.participants.blocks import Blocks
from master.coupling.rounding import ExchangeFloors, Rounding
from master.fmu_coupling.document import Document
from master.fmu_coupling.mapping import MappedParticipant

RTOL = 1e-8  # of a loop that has no values that repeat to the last bit


def initialised(document: Document, participants: Mapping[str, MappedParticipant]) -> list[str]:
    """Initialise all participants; remarks about what could not be passed on. An input with a start value in the file
    keeps it.
    """
    passed = [c for c in document.connections if not _started(document, c)]
    remarks: list[str] = []
    for group in groups(list(participants), passed):
        for name in group:
            participants[name].enter_initialization()
        into = [c for c in passed if c.target in group]
        for c in into:
            if c.source not in group:
                remarks += _pass(c, participants)
        inner = [c for c in into if c.source in group]
        if inner:
            remarks += _settle({name: participants[name] for name in group}, inner)
        for place, name in enumerate(group):
            for c in inner:
                if c.target == name and c.source in group[:place]:  # what that has after its own initialisation
                    remarks += _pass(c, participants)
            participants[name].exit_initialization()
    return list(dict.fromkeys(remarks))


def _started(document: Document, c: Connection) -> bool:
    """Whether the file gives the input of a connection, or a part of it, a start value."""
    described, start = document.described[c.target], document.participants[c.target].start
    variables = set(described.scalars(c.input))
    return any(not variables.isdisjoint(described.scalars(block)) for block in start if block in described.blocks)


def groups(names: Sequence[str], connections: Sequence[Connection]) -> list[list[str]]:
    """Participants that depend on each other in a loop, all others alone, each after what it depends on; otherwise in
    the order of the names.
    """
    place = {name: k for k, name in enumerate(names)}
    edges = np.array([(place[c.source], place[c.target]) for c in connections], dtype=int).reshape(-1, 2)
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(len(names), len(names)))
    _, of = connected_components(graph.tocsr(), connection="strong")
    before: dict[int, set[int]] = {label: set() for label in of.tolist()}
    for a, b in edges:
        if of[a] != of[b]:
            before[int(of[b])].add(int(of[a]))
    found: list[list[str]] = []
    left = list(dict.fromkeys(of.tolist()))
    while left:
        label = next(one for one in left if before[one].isdisjoint(left))
        left.remove(label)
        found.append([name for name, own in zip(names, of, strict=True) if own == label])
    return found


def _pass(c: Connection, participants: Mapping[str, MappedParticipant]) -> list[str]:
    """Pass on what a source sends; a remark where that fails. A source may have nothing before its first step."""
    try:
        values = c.applied(participants[c.source].get(c.output))
        if np.isfinite(values).all():
            participants[c.target].receive(c.input, values)
    except ValueError as error:
        return [f"{c} was not passed on in the initialisation: {error}"]
    return []


class _Initial(Blocks):
    """A participant in initialization mode: what it sends follows what it receives without a step."""

    saves_state = False

    def __init__(self, participant: MappedParticipant) -> None:
        self.name, self.blocks, self.limits = participant.name, participant.blocks, participant.limits
        self._receive, self.get = participant.receive, participant.get

    def set(self, block: str, values: Any) -> None:
        """See Participant; what a source does not have before its first step leaves the input as it is."""
        if np.isfinite(values).all():
            self._receive(block, values)

    def step(self, t: float, dt: float) -> None:
        """Nothing to do: time stands still."""


def _settle(members: Mapping[str, MappedParticipant], connections: Sequence[Connection]) -> list[str]:
    """Pass values round a loop until they repeat; by a quasi-Newton method where they do not by themselves."""
    exchange: Exchange = Exchange({n: _Initial(p) for n, p in members.items()}, connections)  # type: ignore[misc]
    who = ", ".join(members)
    try:
        x = begin = exchange.present()
        for _ in range(2 * len(members) + 1):
            x, before = exchange.evaluate(x), x
            if np.array_equal(x, before) or not np.isfinite(x).all():  # the run says what stands in for those
                return []
        found = fixed_point(
            exchange.evaluate, begin, IQNILS(), rtol=RTOL, fields=exchange.fields(), admissible=exchange.admissible(),
            floors=ExchangeFloors(Rounding(), exchange),
        )  # fmt: skip
    except StepFailed as error:
        return [f"the initial values of {who} were not passed on: {error}."]
    if not found.converged:
        return [f"the initial values of {who} do not settle: {found.message} Give one of their inputs a start value."]
    return []
