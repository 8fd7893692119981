"""Any co-simulation FMUs coupled as a document says: in time, or to a fixed point in pseudo-time."""

import contextlib
import os
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from interface import StepFailed
from master.coupling import checkpoint
from master.coupling.checkpoint import NO_FILES, Files, Keeper
from master.coupling.exchange import Exchange
from master.coupling.fixed_point import FixedPointResult
from master.coupling.march import STATUSES, March, MarchResult, Steps, march
from master.coupling.schemes import scheme
from master.coupling.steady import Goal, Search, steady
from master.fmu_coupling.document import Document
from master.fmu_coupling.initial import initialised
from master.fmu_coupling.mapping import MappedParticipant
from master.fmu_coupling.results import RESULTS, TABLES, CoupleResult, Follower, Recorder
from master.report.results_folder import ResultsFolder


@contextlib.contextmanager
def opened(document: Document) -> Iterator[Exchange]:
    """The participants of a document, loaded and initialised, as an exchange; they are closed at the end."""
    before = Path.cwd()
    with contextlib.ExitStack() as stack:
        stack.callback(os.chdir, before)  # FMUs may leave another
        participants = {}
        places = {name: member.fmu.absolute() for name, member in document.participants.items()}
        for name, m in document.participants.items():
            made = MappedParticipant(
                places[name], m.names, m.start, document.settings.start, document.stop_told, document.described[name],
                name, initialise=False,
            )  # fmt: skip
            participants[name] = stack.enter_context(made)
        remarks = initialised(document, participants)
        exchange = document.exchange(participants)
        exchange.remarks += remarks
        yield exchange


def couple(
    document: Document | Mapping[str, Any] | str | Path,
    out: str | Path | None = None,
    report: bool = True,
    follow: Follower | None = None,
    files: Files = NO_FILES,
    force: bool = False,
) -> CoupleResult:
    """Couple the FMUs of a document, of its file, or of the content of one; results go to the folder `out` if given.

    `report` draws plots too, where matplotlib is installed. `files` says where a transient run keeps checkpoints and
    which one it continues from; the results then begin there. Files of others in the folder are replaced only by
    `force`. ValueError in one sentence for bad input, before anything
    is run; what fails in the run ends in a status.
    """
    out = None if out is None else Path(out).absolute()
    files = files.absolute()
    if not isinstance(document, Document):
        document = Document.of(document) if isinstance(document, Mapping) else Document.read(document)
    files.require_writable()
    begin = time.perf_counter()
    with contextlib.ExitStack() as stack:
        recorder = results = None
        if out is not None:
            results = stack.enter_context(ResultsFolder(Path(out), RESULTS if report else TABLES, force=force))
            recorder = stack.enter_context(Recorder(results.path, document))
        exchange = stack.enter_context(opened(document))
        ready = time.perf_counter()
        run = Run(document, exchange, [f for f in (recorder, follow) if f is not None], files)
        if recorder is not None:
            recorder.steps = run.now.steps
        ended = run.ended()
        seconds = {"total": time.perf_counter() - begin, "set_up": ready - begin, **ended.seconds}
        logs = {name: list(p.fmu.messages) for name, p in exchange.participants.items()}  # type: ignore[attr-defined]
        remarks = [*exchange.remarks, *_said(exchange), *run.keeper.remarks]
        result = CoupleResult(
            ended.status, ended.message, ended.time, ended.steps, ended.evaluations, run.values, seconds, logs, remarks
        )
        if recorder is not None and results is not None:
            recorder.finish(result, report)
            results.place()
    return result


def _said(exchange: Exchange) -> list[str]:
    """What FMUs logged as errors and went on after, and which inputs they were sent beyond their bounds."""
    found = []
    for name, participant in exchange.participants.items():
        fmu: Any = participant.fmu  # type: ignore[attr-defined]
        found += [f"{exchange.described(name)} logged an error and went on: {text}" for text in fmu.alarms]
        for block, value in fmu.outside.items():
            found.append(f"{name}.{block} was sent {value:g}, which lies beyond its bounds, and the FMU took it.")
    return found


class Run:
    """One run of a document: `now` is where it stands, `values` the recorded blocks at the last step."""

    def __init__(
        self, document: Document, exchange: Exchange, followers: list[Follower], files: Files = NO_FILES
    ) -> None:
        self.document, self.exchange, self.followers, self.files = document, exchange, followers, files
        self.keeper = Keeper(files)
        self.values: dict[str, np.ndarray] = {}
        s = document.settings
        self.scheme = None if s.scheme == "explicit" else scheme(s.scheme, exchange, s.order, **s.parameters)
        if files.checkpoint is not None or files.restart is not None:
            self._check_checkpoints()
        if files.restart is None:
            self.now = March.beginning(exchange, s.order, s.predictor)
        else:
            self.now = self._restarted(files.restart)
        self.number = len(self.now.steps)

    def _check_checkpoints(self) -> None:
        """ValueError in one sentence where a run cannot be written to a checkpoint."""
        if self.document.settings.mode == "steady":
            raise ValueError("checkpoints are of transient runs; a steady run is one fixed point.")
        for name in self.exchange.without_rollback():
            raise ValueError(f"{self.exchange.described(name)} cannot save its state, so there are no checkpoints.")
        divided = any(count > 1 for count in self.exchange.substeps.values())
        for name, participant in self.exchange.participants.items():
            if divided and not getattr(participant, "saves_state", True):
                raise ValueError(
                    f"{self.exchange.described(name)} cannot save its state, and substeps need what it sent last, so "
                    "there are no checkpoints."
                )
            if getattr(participant, "saves_state", True) and not getattr(participant, "serialises_state", True):
                raise ValueError(
                    f"{self.exchange.described(name)} cannot write its state to a file (no canSerializeFMUstate), "
                    "so there are no checkpoints."
                )

    def _models(self) -> dict[str, str]:
        """The model of each participant."""
        return {name: described.model for name, described in self.document.described.items()}

    def _restarted(self, path: Path) -> March:
        """Where a run continues from a checkpoint; ValueError in one sentence if that is of something else."""
        scene = checkpoint.head(path).get("scene")
        if scene is not None:
            raise ValueError(f"checkpoint {path} is of `kitecosim run {scene}`; continue it with that command.")
        about, content = checkpoint.read(path)
        if about.get("models", self._models()) != self._models():
            raise ValueError(
                f"checkpoint {path} is of the models {', '.join(about['models'].values())}, this file of "
                f"{', '.join(self._models().values())}; begin without it."
            )
        try:
            with checkpoint.damaged(path):
                now = checkpoint.load_march(self.exchange, content, self.scheme)
                now.require_fields(self.exchange, self.document.settings.order)
        except ValueError as error:
            raise (error if str(path) in str(error) else ValueError(f"{path}: {error}")) from error
        self._require_times(f"the {self.exchange.time:g} s of the checkpoint {path}")
        return now

    def _require_times(self, begin: str) -> None:
        """ValueError in one sentence where the stop time does not suit where a restart begins."""
        s, exchange = self.document.settings, self.exchange
        count = round((s.stop - exchange.time) / exchange.dt)
        if count < 0:
            raise ValueError(f"{self.document.file}: [time] stop = {s.stop:g} lies before {begin}; take a later one.")
        if abs(exchange.time + count * exchange.dt - s.stop) > 1e-6 * exchange.dt:
            raise ValueError(
                f"{self.document.file}: [time] stop = {s.stop:g} is no whole number of steps of {exchange.dt:g} after "
                f"{begin}; change one."
            )

    def _hold(self, now: March) -> None:
        exchange, count = self.exchange, len(now.steps)
        last = exchange.time > self.document.settings.stop - 0.5 * exchange.dt
        about: dict[str, Any] = {"document": self.document.file, "models": self._models()}
        about |= {"time": exchange.time, "steps": count}
        self.keeper.keep(
            count, f"at {exchange.time:g} s", about, lambda: checkpoint.dump_march(exchange, self.scheme, now), last
        )

    def ended(self) -> MarchResult:
        """The run to its end."""
        self.files.begin()
        try:
            self._tell(np.nan)
        except StepFailed as error:  # of what is recorded
            return self._broken_off(f"The run cannot begin: {error}.")
        s = self.document.settings
        return self._steady() if s.mode == "steady" else self._transient()

    def _broken_off(self, message: str) -> MarchResult:
        """The end of a run that no driver has ended."""
        exchange, steps = self.exchange, self.now.steps
        if len(steps):
            steps.codes[-1] = STATUSES.index("diverged")
        seconds = dict(exchange.seconds)
        return MarchResult("diverged", message, exchange.time, self.now.x, steps, exchange.evaluations, seconds)

    def _transient(self) -> MarchResult:
        s = self.document.settings
        repeats = self.scheme is not None and bool(self.exchange.fields(s.order))
        return march(
            self.exchange,
            self.scheme,
            s.stop,
            s.order,
            s.predictor,
            s.atol,
            s.rtol,
            s.residual_rtol,
            s.max_iterations,
            s.strict,
            s.recoveries if repeats else 0,
            callback=lambda _, __: self._follow(self.now.steps.residuals[-1]),
            hold=self._hold,
            begun=self.now,
        )

    def _steady(self) -> MarchResult:
        """One fixed point, every evaluation a step in pseudo-time."""
        s, exchange, steps = self.document.settings, self.exchange, self.now.steps
        used = scheme(s.scheme, exchange, s.order, **s.parameters)
        try:
            ended = steady(exchange, used, _Evaluations(self), s.order, s.max_iterations, s.recoveries)
        except StepFailed as error:  # a participant that could not save its state, or give what is recorded
            return self._broken_off(f"The run cannot continue: {error}.")
        self.now.x = ended.found.x_tilde
        _judge(steps, ended.found)
        return MarchResult(
            ended.status, ended.message, exchange.time, self.now.x, steps, exchange.evaluations, dict(exchange.seconds)
        )

    def evaluated(self, residual: float) -> None:
        """Book an evaluation of a steady run."""
        self.now.steps.append(self.exchange.time, "max_iterations", 1, residual, 0)
        if np.isfinite(residual):
            self._follow(residual)

    def _follow(self, residual: float) -> None:
        self.number += 1
        self._tell(float(residual))

    def _tell(self, residual: float) -> None:
        values = {}
        for name, block in self.document.record:
            with self.exchange.booked(name, f"could not give {block}"):
                values[f"{name}.{block}"] = self.exchange.participants[name].get(block)
        self.values = values
        for follower in self.followers:
            follower(self.number, self.exchange.time, residual, self.values)


class _Evaluations(Goal):
    """The tolerances of a document; every evaluation is booked as a step."""

    def __init__(self, run: Run) -> None:
        s = run.document.settings
        super().__init__(s.atol, s.rtol, s.residual_rtol)
        self._run = run

    def observed(self, x: np.ndarray, x_tilde: np.ndarray, r: np.ndarray, search: Search) -> dict[str, float]:
        """See Goal."""
        self._run.evaluated(float(np.linalg.norm(r)))
        return super().observed(x, x_tilde, r, search)


def _judge(steps: Steps, found: FixedPointResult) -> None:
    """Give the last evaluation the status of the whole, and each recovery to the evaluation that it followed."""
    steps.codes[-1] = STATUSES.index(found.status)
    for event in found.recoveries:
        steps.recoveries[event.iteration - 1] += 1
        steps.messages.append((event.iteration, str(event)))
