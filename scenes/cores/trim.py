"""Where a kite starts: turned as a rigid body about its bridle point until nothing pitches it."""

from typing import Any

import numpy as np

from aero.trim import Trims, trims
from interface import StepFailed

from ..schema import SceneError
from .core import Core
from .heading import inward


def trim_points(scene, parameters: dict[str, Any], cores: dict[str, Core]) -> Trims:
    """Nose-up rotations (rad) about the pivot where air and weight together do not pitch the wing, as stiff as drawn;
    its `start` is the first where the moment falls with the angle and the wing lifts.

    `parameters` are given to the `cores`, which are as they were otherwise. Raises `SceneError` where the range given
    in [trim] holds no such start, ValueError for a value that a core refuses.
    """
    core, structure = cores["aero"], cores["structural"]
    for name, value in parameters.items():
        owners = [c for c in (core, structure) if name in {v.name for v in c.variables if v.causality == "parameter"}]
        if not owners:
            raise SceneError(f"scene '{scene.name}' has no parameter '{name}'; correct its name.")
        for owner in owners:
            owner.set(name, value)
    before = core.save()
    try:
        return _trims(scene, core, structure)
    finally:
        core.restore(before)


def _trims(scene, core, structure):
    names = {v.name for v in core.variables}
    if scene.pivot is None:
        raise SceneError(f"{scene.name}/scene.toml: [trim] needs [structure] pivot, the node to turn about; add it.")
    wind = core.get("wind_direction")
    if not np.hypot(wind[0], wind[1]) > 1e-6 * np.linalg.norm(wind):
        raise SceneError(
            f"{scene.name}: the wind blows straight {'up' if wind[2] > 0.0 else 'down'}, where a kite has no attitude "
            "to start in; give wind_direction a horizontal part, or set trim_angle."
        )
    members, nodes = scene.members, scene.interface.nodes
    heading, azimuth = scene.heading, {"start_azimuth": float(core.get("start_azimuth"))}
    axes = heading.axes(azimuth)
    about = members.nodes[scene.pivot]
    wing_mass = members.wing_mass.sum()
    if "wing_mass" in {v.name for v in structure.variables}:
        wing_mass = float(structure.get("wing_mass"))
    weight = float(structure.get("gravity")) * members.mass_with(wing_mass)

    def loads(angle: float) -> tuple[float, float]:
        turned = azimuth | {"trim_angle": angle}
        core.set("displacement", heading.started(nodes, turned) - nodes)
        try:
            core.step(0.0, 0.0)
        except StepFailed as error:
            raise SceneError(f"{scene.name}: no trim angle can be found for this wind: {error}") from None
        arm = inward(heading.started(members.nodes, turned) - about, axes)[:, 0]
        air = inward(core.get("moment") + (core.get("line_moment") if "line_moment" in names else 0.0), axes)
        return float(air[1] + weight @ arm), float(core.get("CL"))

    low, high = np.deg2rad(scene.trim.lowest_deg), np.deg2rad(scene.trim.highest_deg)
    found = trims(loads, low, high, scene.wing_model.smooth)
    if found.start is not None:
        return found
    raise SceneError(_none(scene, core, found, weight, axes))


def _none(scene, core, found, weight, axes):
    """Why there is no angle to start from, in one sentence."""
    low, high = scene.trim.lowest_deg, scene.trim.highest_deg
    lift = float(core.get("CL")) * float(core.get("wind_speed")) ** 2
    lift *= 0.5 * float(core.get("air_density")) * scene.aero.reference_area
    where = ", ".join(f"{np.rad2deg(p.angle):.3g}" for p in found.points)
    sense = " (it rises, so that the angle between is not stable)" if found.points else ""
    if any(p.stable for p in found.points):
        sense = f" (it falls through zero at {where} degrees, but the wing does not lift there)"
    side = inward(core.get("wind_direction"), axes)
    aside = abs(np.rad2deg(np.arctan2(side[1], side[0])))
    turn = f"turn the kite to the wind, which comes {aside:.3g} degrees from the side (start_azimuth); "
    return (
        f"{scene.name}: no trim angle between {low:g} and {high:g} degrees, where the pitching "
        f"moment about the pivot falls through zero: air and weight pitch with {found.first:.4g} N m at the lowest and "
        f"{found.last:.4g} N m at the highest{sense}, with {weight.sum():.4g} N of weight and {lift:.4g} N of lift "
        f"there; {turn if aside > 1.0 else ''}check masses, diameters and polars, or raise wind_speed so that the wind "
        "can carry the kite, or widen [trim]."
    )
