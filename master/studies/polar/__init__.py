"""Polars of a rigid wing: coefficients and loads over angle of attack and sideslip, and stability derivatives."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from master.coupling.participants.blocks import assignment_text
from master.report.results_folder import ResultsFolder
from master.report.tables import versions
from master.studies.polar.angles import MOST, checked
from master.studies.polar.derivatives import Derivatives, NoDerivatives, derivatives
from master.studies.polar.wing import COEFFICIENTS, Point, Reference, RigidWing

__all__ = ["COEFFICIENTS", "Derivatives", "Point", "Polar", "Reference", "RigidWing", "polar"]

Progress = Callable[[int, int, Point | None], Any]


@dataclass(frozen=True, eq=False)
class Polar:
    """A polar: the `points`, alpha by alpha for each beta in the order given, the `reference` values, `units` and
    `descriptions` of the model's own outputs by name, `derivatives` (None: not asked for, or `lacking` says why not),
    and `settings`, all that it was made with.
    """

    title: str
    method: str
    points: list[Point]
    reference: Reference
    units: dict[str, str]
    descriptions: dict[str, str]
    derivatives: Derivatives | None
    lacking: str
    settings: dict[str, Any]

    def rows(self) -> list[dict[str, Any]]:
        """A flat dict per point, such that `pandas.DataFrame` makes a table of them."""
        out = []
        for p in self.points:
            row: dict[str, Any] = {"alpha_deg": p.alpha, "beta_deg": p.beta, "status": p.status, **p.coefficients}
            row |= {f"force_{axis}_N": float(v) for axis, v in zip("xyz", p.force, strict=True)}
            row |= {f"moment_{axis}_Nm": float(v) for axis, v in zip("xyz", p.moment, strict=True)}
            out.append(row | p.outputs | {"message": p.message or "; ".join(p.remarks)})
        return out


def polar(
    scene: str | Path,
    alpha: Sequence[float],
    beta: Sequence[float] = (0.0,),
    settings: Mapping[str, Any] | None = None,
    *,
    about: Sequence[float] | None = None,
    shape: str | Path | None = None,
    with_derivatives: bool = False,
    derivatives_at: float | None = None,
    warm: bool = True,
    out: str | Path | None = None,
    report: bool = True,
    force: bool = False,
    progress: Progress | None = None,
) -> Polar:
    """The polar of the wing of a scene, rigid: all angles of attack `alpha` deg at each sideslip `beta` deg.

    The wind is turned about the wing, which keeps its design shape or has that of a run in the folder `shape`.
    `settings` maps names of settings and parameters of the flow to values; `about` is the point (3,) m that moments are
    about (None: the pivot of a kite, [aero] reference_point, or the origin). With `with_derivatives` stability
    derivatives at the angle without a pitching moment, or at `derivatives_at` deg. `warm`: points start from the state
    of the one before. A point without an answer has a status and a message. With `out` tables and, if `report`, plots
    are written into this folder, whole or not at all; `force`: also over files of others.
    `progress(done, total, point)` is called first with None, then after every point.

    ValueError in one sentence for bad input. Angles, signs and coefficients are in docs/polar.md.
    """
    alphas, betas = checked("alpha", alpha), checked("beta", beta)
    if len(alphas) * len(betas) > MOST:
        raise ValueError(f"{len(alphas)} alpha at {len(betas)} beta are more than {MOST} points; take fewer.")
    if derivatives_at is not None:
        checked("alpha", [derivatives_at])
    assigned = {key: assignment_text(value) for key, value in (settings or {}).items()}
    wing = RigidWing(str(scene), assigned, about, None if shape is None else Path(shape), warm)
    if out is None:
        return _solved(wing, alphas, betas, with_derivatives, derivatives_at, progress)
    from master.studies.polar.files import FILES, write_polar

    with ResultsFolder(Path(out), FILES, "polar", force) as results:
        found = _solved(wing, alphas, betas, with_derivatives, derivatives_at, progress)
        write_polar(results.path, found, report)
        results.place()
    return found


def _solved(
    wing: RigidWing,
    alphas: list[float],
    betas: list[float],
    with_derivatives: bool,
    derivatives_at: float | None,
    progress: Progress | None,
) -> Polar:
    """The polar of a wing, with its derivatives where they are wanted."""
    points = _swept(wing, alphas, betas, progress or (lambda done, total, point: None))
    found, lacking = None, ""
    if with_derivatives or derivatives_at is not None:
        try:
            found = derivatives(wing.at, wing.reference, points, derivatives_at)
        except NoDerivatives as reason:
            lacking = str(reason)
    used = {
        "scene": wing.scene.name,
        "scene_settings": wing.scene.settings,
        "parameters_set": {name: np.asarray(value).tolist() for name, value in wing.parameters.items()},
        "parameters": wing.parameter_values(),
        "shape": "design" if wing.shape is None else str(wing.shape),
        "warm": wing.warm,
        "versions": versions(),
    }
    return Polar(
        wing.scene.title, wing.scene.wing_model.title, points, wing.reference, wing.units, wing.descriptions, found,
        lacking, used,
    )  # fmt: skip


def _swept(wing: RigidWing, alphas: Sequence[float], betas: Sequence[float], progress: Progress) -> list[Point]:
    """Points alpha by alpha for each beta; the first of a beta starts from the first of the one before, not from where
    that has ended, perhaps stalled.
    """
    points: list[Point] = []
    state, total = wing.state(), len(alphas) * len(betas)
    progress(0, total, None)
    for b in betas:
        wing.resume(state)
        for i, a in enumerate(alphas):
            points.append(wing.at(a, b))
            if i == 0:
                state = wing.state()
            progress(len(points), total, points[-1])
    return points
