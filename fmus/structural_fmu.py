"""The structural solver of a scene as an FMU."""

from fmus.adapter import Core, CoreFmu
from scenes import Scene


class StructuralFmu(CoreFmu):
    """Takes the loads on the interface panels, gives the displacements of the interface nodes."""

    title = "Structural solver"

    @staticmethod
    def scene_core(scene: Scene) -> Core:
        """The structural core of the scene."""
        core: Core = scene.structural_core()
        return core
