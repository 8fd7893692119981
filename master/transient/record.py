"""What a run in motion leaves while it goes on: a row a communication step, curves for plots, shapes at some times."""

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from master.participants import Participant
from master.report.record import Curve, Rows
from master.transient.simulation import Simulation

SHAPES = 48  # most shapes kept


class Recorder:
    """Follows a run into `folder`; as a context manager it leaves what there is if the run breaks off.

    `curves` name -> values over time of every scalar and vector output; `shapes` (time s, positions (n,3) m), thinned
    out by half whenever there are more than SHAPES.
    """

    def __init__(self, folder: Path, participants: dict[str, Participant], scene: Any) -> None:
        self._folder, self._scene = folder, scene
        self._names = dict(_outputs(participants))
        self.curves = {name: Curve() for name in self._names}
        self.shapes: list[tuple[float, np.ndarray]] = []
        self._every = self._seen = 0
        self._rows: Rows | None = None

    @property
    def fresh(self) -> bool:
        """Whether nothing has been taken down yet."""
        return self._rows is None

    def __call__(self, at: float, run: Simulation) -> None:
        """Take down a communication step, or the start."""
        steps = run.steps
        known = len(steps) > 0 and at > 0.0
        row: list[Any] = [repr(at), steps.statuses[-1] if known else "start"]
        row += [steps.iterations[-1] if known else 0, repr(steps.residuals[-1]) if known else ""]
        for name, (side, block) in self._names.items():
            values = np.ravel(run.participants[side].get(block))
            self.curves[name].add(at, values)
            row += map(repr, values.tolist())
        if self._rows is None:
            self._rows = Rows(self._folder / "history.csv", self._header())
        self._rows.add(row)
        self._keep(at, run)

    def _keep(self, at: float, run: Simulation) -> None:
        self._every = self._every or 1
        if self._seen % self._every == 0:
            self.shapes.append((at, run.participants["structural"].get("position")))
            if len(self.shapes) > SHAPES:
                self.shapes, self._every = self.shapes[::2], 2 * self._every
        self._seen += 1

    def _header(self) -> list[str]:
        header = ["time_s", "status", "evaluations", "residual"]
        for name, (side, block) in self._names.items():
            size = self._sizes[side, block]
            header += [name] if size == 1 else [f"{name}[{k + 1}]" for k in range(size)]
        return header

    @property
    def _sizes(self) -> dict[tuple[str, str], int]:
        return {(side, block): len(np.atleast_1d(self.curves[n].values[0])) for n, (side, block) in self._names.items()}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._rows is not None:
            self._rows.close()


def _outputs(participants: dict[str, Participant]) -> Iterator[tuple[str, tuple[str, str]]]:
    """Name -> side and block of every output of one or three values; with the side in front where both have it."""
    names = [b for p in participants.values() for b, c in p.causality.items() if c == "output"]
    for side in ("structural", "aero"):
        participant = participants.get(side)
        if participant is None:
            continue
        for block, causality in participant.causality.items():
            if causality == "output" and participant.blocks[block] in ((), (3,)):
                yield (f"{side}.{block}" if names.count(block) > 1 else block), (side, block)
