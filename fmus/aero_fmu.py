"""The aerodynamic solver of a scene as an FMU."""

from fmus.adapter import Core, CoreFmu
from scenes import Scene


class AeroFmu(CoreFmu):
    """Takes the displacements of the interface nodes, gives the loads on the interface panels."""

    title = "Aerodynamic solver"
    # The loads on the wing as it starts are those of its displaced shape.
    at_start: tuple[str, ...] = ("parameter", "input")

    @staticmethod
    def scene_core(scene: Scene) -> Core:
        """The aerodynamic core of the scene."""
        core: Core = scene.aero_core()
        return core
