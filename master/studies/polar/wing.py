"""A rigid wing in a wind from any side: its scene without a structure, reference values, and one point of its polar."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from interface import StepFailed
from master.commands import assigned_cores
from master.studies.polar.angles import wind_axes

TURNED = {
    "wind_direction": "the wind is turned by --alpha and --beta",
    "trim_angle": "the wing stays as it is drawn and --alpha turns the wind",
    "start_azimuth": "the wing stays as it is drawn and --beta turns the wind",
}
COEFFICIENTS = ("CL", "CD", "CS", "CM", "Cl", "Cn")
SAME = 1e-6  # m, to which the shape of a run and of the scene have to agree in their undeformed nodes


@dataclass(frozen=True, eq=False)
class Reference:
    """What coefficients are made with: `area` m^2, `chord` m and `span` m, the point `about` (3,) m that moments are
    about and `about_what` that is, and the `axes` of the wing as columns (3,3): x backward, y to the right, z up.
    """

    area: float
    chord: float
    span: float
    about: np.ndarray
    about_what: str
    axes: np.ndarray

    def record(self) -> dict[str, Any]:
        """As polar.json has it."""
        return {
            "area_m2": self.area,
            "chord_m": self.chord,
            "span_m": self.span,
            "moments_about_m": self.about,
            "moments_about": self.about_what,
            "wing_axes": self.axes.T,
        }


@dataclass(frozen=True, eq=False)
class Point:
    """One point of a polar: angles deg, `status` "converged", "diverged" (the flow has no answer), "refused" (the
    wind is none for this wing) or "crashed", a `message` that says why, and where it converged the `coefficients`, the
    `force` (3,) N and `moment` (3,) N m in the axes of the scene, the model's own scalar `outputs`, values of its
    `strips`, and `remarks`.
    """

    alpha: float
    beta: float
    status: str
    message: str
    coefficients: dict[str, float]
    force: np.ndarray
    moment: np.ndarray
    outputs: dict[str, float]
    strips: dict[str, np.ndarray]
    remarks: list[str]

    @property
    def converged(self) -> bool:
        """Whether there are values."""
        return self.status == "converged"

    @property
    def within(self) -> bool:
        """Whether it lies within what its model is known to be good for."""
        return self.converged and self.outputs.get("outside_validity", 0.0) == 0.0


class RigidWing:
    """The wing of a scene, rigid, at rest in a wind that may come from any side.

    `assigned` are settings and parameters of its flow as texts; `shape` is the folder of a run whose shape it has,
    None: its design shape; `about` a point (3,) m for the moments, None: that of the scene. Solves start from the state
    of the one before (`warm`), and again without it where that fails. ValueError in one sentence for what does not fit.
    """

    def __init__(
        self,
        name: str,
        assigned: Mapping[str, str],
        about: Sequence[float] | None = None,
        shape: Path | None = None,
        warm: bool = True,
    ) -> None:
        for parameter, why in TURNED.items():
            if parameter in assigned:
                raise ValueError(f"a polar takes no {parameter}: {why}; leave it out.")
        self.scene, self.parameters, cores = assigned_cores(name, dict(assigned), _flow_alone)
        self._core, self.warm, self.shape = cores["aero"], warm, shape
        displacement, azimuth = (None, 0.0) if shape is None else shape_of(shape, self.scene)
        if displacement is not None:
            self._core.set("displacement", displacement)
        self._start = self._core.save()
        self.reference = _reference(self.scene, azimuth)
        self._core_about = self.reference.about
        if about is not None:
            self.reference = replace(self.reference, about=_point(about), about_what="given point")
        named = {v.name: v for v in self._core.variables if v.causality == "output"}
        ours = {*COEFFICIENTS, "alpha_deg", "beta_deg"}
        self._scalars = {n: f"model.{n}" if n in ours else n for n, v in named.items() if v.shape == ()}
        for replaced in ("CL", "CD", "CS"):  # the same but for sideslip and beyond 90 degrees
            self._scalars.pop(replaced, None)
        self.units = {self._scalars[n]: named[n].unit for n in self._scalars}
        self.descriptions = {self._scalars[n]: named[n].description for n in self._scalars}
        self._of_strips = [n for n, v in named.items() if v.counts == "strip"]

    def parameter_values(self) -> dict[str, Any]:
        """Values of all parameters of the flow but the wind direction, which every point has of its own."""
        names = [v.name for v in self._core.variables if v.causality == "parameter" and v.name not in TURNED]
        return {name: self._core.get(name) for name in names}

    def state(self) -> Any:
        """The state of its flow, to start from again with `resume`."""
        return self._core.save()

    def resume(self, state: Any) -> None:
        """Start from a state of its flow."""
        self._core.restore(state)

    def at(self, alpha: float, beta: float) -> Point:
        """The point at angles deg."""
        try:
            message = self._solved(wind_axes(alpha, beta)[0])
        except ValueError as error:
            return self._without(alpha, beta, "refused", str(error))
        except Exception as error:
            # a defect at one point must not end the others
            self._core.restore(self._start)
            return self._without(alpha, beta, "crashed", f"{type(error).__name__}: {error}")
        return self._without(alpha, beta, "diverged", message) if message else self._point(alpha, beta)

    def _solved(self, direction: np.ndarray) -> str:
        """Solve for a wind to the `direction` (3,) in the axes of the wing; "" or why there is no answer."""
        reason = ""
        for cold in (False, True) if self.warm else (True,):
            if cold:
                self._core.restore(self._start)
            self._core.set("wind_direction", self.reference.axes @ direction)
            try:
                self._core.step(0.0, 0.0)
                return ""
            except StepFailed as error:
                reason = str(error)
        return reason

    def _without(self, alpha: float, beta: float, status: str, message: str) -> Point:
        none = np.full(3, np.nan)
        nothing = dict.fromkeys(COEFFICIENTS, np.nan)
        text = " ".join(message.split())
        return Point(alpha, beta, status, text, nothing, none, none, dict.fromkeys(self.units, np.nan), {}, [])

    def _point(self, alpha: float, beta: float) -> Point:
        ref, core = self.reference, self._core
        force = core.get("force")
        moment = core.get("moment") - np.cross(ref.about - self._core_about, force)
        pressure = 0.5 * float(core.get("air_density")) * float(core.get("wind_speed")) ** 2 * ref.area
        drag, lift, side = wind_axes(alpha, beta) @ (ref.axes.T @ force) / pressure
        backward, pitch, up = ref.axes.T @ moment / pressure
        values = lift, drag, side, pitch / ref.chord, -backward / ref.span, -up / ref.span
        found = dict(zip(COEFFICIENTS, (float(v) for v in values), strict=True))
        outputs = {label: float(core.get(name)) for name, label in self._scalars.items()}
        strips = {name: core.get(name) for name in self._of_strips}
        remarks = self.scene.remarks({v.name: core.get(v.name) for v in core.variables})
        return Point(alpha, beta, "converged", "", found, force, moment, outputs, strips, remarks)


def _flow_alone(scene: Any) -> dict[str, Any]:
    """Its aerodynamic core; ValueError in one sentence where there is no wing in its flow."""
    if scene.wing_model is None:
        raise ValueError(f"scene '{scene.name}' has no wing in a flow, so that it has no polar; name one with [aero].")
    return {"aero": scene.aero_core()}


def _reference(scene: Any, azimuth: float) -> Reference:
    """Reference values of a scene whose wing stands at an `azimuth` rad from where it is drawn."""
    drawn, now = scene.heading.axes({}), scene.heading.axes({"start_azimuth": azimuth})
    nodes, given = scene.interface.nodes[np.unique(scene.interface.panels)], scene.aero
    across = np.array([0.0, 1.0, 0.0]) if drawn is None else drawn[:, 1]
    span = given.reference_span or float(np.ptp(nodes @ across))
    chord = given.reference_chord or given.reference_area / span
    what, about = scene.moments_about
    return Reference(given.reference_area, chord, span, np.array(about), what, np.eye(3) if now is None else now)


def _point(about: Sequence[float]) -> np.ndarray:
    point = np.asarray(about, dtype=float)
    if point.shape != (3,) or not np.all(np.isfinite(point)):
        raise ValueError("--about takes a point of three finite numbers, as 0.25,0,0.")
    return point


def shape_of(folder: Path, scene: Any) -> tuple[np.ndarray, float]:
    """Displacement (n,3) m of the interface and azimuth rad of the wing in the results of a run of this scene.
    ValueError in one sentence where they are none, or of another scene or of other settings.
    """
    try:
        content = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        with (folder / "interface.csv").open(encoding="utf-8", newline="") as file:
            rows = [[float(row[f"{k}{axis}_m"]) for k in ("", "d") for axis in "xyz"] for row in csv.DictReader(file)]
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(
            f"--shape {folder} has no summary.json and interface.csv of a run ({reason}); name the folder of one."
        ) from None
    if content.get("scene") != scene.name:
        raise ValueError(
            f"--shape {folder} is a run of scene '{content.get('scene')}', not of '{scene.name}'; name another folder."
        )
    table, nodes = np.array(rows).reshape(-1, 6), scene.interface.nodes
    if len(table) != len(nodes) or np.abs(table[:, :3] - table[:, 3:] - nodes).max() > SAME:
        raise ValueError(
            f"--shape {folder} is a run with other settings, whose interface is not that of the scene here; give "
            "the same ones with --set."
        )
    if not np.all(np.isfinite(table)):
        raise ValueError(f"--shape {folder} is a run that ended without a shape; name one that converged.")
    parameters = content.get("settings", {}).get("parameters", {})
    return table[:, 3:], float(parameters.get("aero.start_azimuth", 0.0))
