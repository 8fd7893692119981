"""Models of the flow around a wing, by the name of their method in scene.toml."""

from aero import AeroModel
from aero.vortex_step import SurfaceGrid, VortexStep, VortexStepModel


def vortex_step(scene) -> AeroModel:
    """The vortex-step method on the strips of the interface."""
    content, interface = scene.content["aero"], scene.interface
    wing = VortexStep(
        scene.strip_polars(),
        SurfaceGrid(interface.sections, interface.fractions),
        induction=content["induction"],
        direction=content["direction"],
        circulation_speed=content["circulation_speed"],
        section_force=content["section_force"],
        camber=scene.settings.get("camber_feedback", "off") == "on",
    )
    return VortexStepModel(wing, scene.content["structure"]["symmetric"])


METHODS = {"vortex-step": vortex_step}


def wing_model(scene) -> AeroModel:
    """The model that the scene's [aero] method names."""
    return METHODS[scene.content["aero"]["method"]](scene)
