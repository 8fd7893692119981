"""How far a result lies within what its models are known to be good for, as the participants say it themselves."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from interface import Criterion
from interface.validity import ALIKE


@dataclass(frozen=True)
class Judgement:
    """What one side is judged by, with its largest `value`, `where` that stands, and in a transient run the `time` s of
    it, None else.
    """

    side: str
    criterion: Criterion
    value: float
    where: str = ""
    time: float | None = None

    @property
    def within(self) -> bool:
        """Whether the value is within its limit."""
        return self.criterion.within(self.value)

    @property
    def text(self) -> str:
        """Quantity, value, place, time and limit in words."""
        c = self.criterion
        at = f" at {self.where}" if c.labels and self.where else f" ({self.where})" if self.where else ""
        when = "" if self.time is None else f" at {self.time:g} s"
        return f"{c.quantity} {c.text(self.value)}{at}{when}, limit {c.text(c.limit)}"

    def record(self) -> dict[str, Any]:
        """As summary.json has it."""
        c = self.criterion
        found = {"quantity": c.quantity, "value": self.value, "limit": c.limit, "source": c.source}
        found |= {"where": self.where, "within": self.within, "output": f"{self.side}.{c.name}"}
        return found if self.time is None else found | {"time": self.time}


def criteria_of(participant: Any) -> tuple[Criterion, ...]:
    """What a participant is judged by, as far as it has the outputs for it."""
    return tuple(c for c in getattr(participant, "criteria", ()) if c.name in participant.blocks)


def judgements(participants: Mapping[str, Any]) -> list[Judgement]:
    """The present outputs of all participants, judged by what each says of itself (`criteria`)."""
    return [_judged(side, p, c) for side, p in participants.items() for c in criteria_of(p)]


def _judged(side: str, participant: Any, criterion: Criterion, time: float | None = None) -> Judgement:
    place = float(participant.get(criterion.place)) if criterion.place in participant.blocks else 0.0
    return Judgement(side, criterion, float(participant.get(criterion.name)), criterion.named(place), time)


def _worse(value: float, before: float) -> bool:
    """Whether a value is above the one before by more than rounding, or no number where that was one."""
    return bool(np.isnan(value) and not np.isnan(before)) or value > before * (1.0 + ALIKE)


class Peaks:
    """The largest values of a transient run so far: every criterion of every participant with where and when."""

    def __init__(self, participants: Mapping[str, Any]) -> None:
        self._judged = [(side, p, c) for side, p in participants.items() for c in criteria_of(p)]
        self._found: dict[tuple[str, str], Judgement] = {}

    def take(self, time: float) -> None:
        """Look at the present outputs, at a time s."""
        for side, participant, criterion in self._judged:
            before, value = self._found.get((side, criterion.name)), float(participant.get(criterion.name))
            if before is None or _worse(value, before.value):
                self._found[side, criterion.name] = _judged(side, participant, criterion, time)

    @property
    def found(self) -> list[Judgement]:
        """The judgements of the largest values; none before the first step."""
        return [self._found[key] for side, _, c in self._judged if (key := (side, c.name)) in self._found]

    def record(self) -> dict[str, list[Any]]:
        """What a checkpoint keeps: output -> value, where, time."""
        return {f"{j.side}.{j.criterion.name}": [j.value, j.where, j.time] for j in self.found}

    def restore(self, record: Mapping[str, Any]) -> None:
        """Continue from what a checkpoint kept."""
        for side, _, criterion in self._judged:
            if (key := f"{side}.{criterion.name}") in record:
                self._found[side, criterion.name] = Judgement(side, criterion, *record[key])
