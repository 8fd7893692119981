"""The vortex-step method: lifting-line strips with section polars; see `aero.vortex_step`."""

from aero.model import Option

OPTIONS = {
    "induction": Option(True),
    "direction": Option("bound", ("bound", "control")),
    "circulation_speed": Option("local", ("local", "far")),
    "section_force": Option("lift-drag", ("lift-drag", "normal")),
}


def wing_loads(options):
    """Pressure, and shear unless the polars are those of a plate that carries pressure only."""
    return ("pressure",) if options["section_force"] == "normal" else ("pressure", "shear")


def wing_model(wing):
    """A `VortexStepModel` on the strips of the wing."""
    from aero.vortex_step import SurfaceGrid, VortexStep, VortexStepModel

    options = {name: wing.options[name] for name in (*OPTIONS, "camber")}
    grid = SurfaceGrid(wing.sections, wing.fractions)
    method = VortexStep(wing.polars(), grid, **options)
    return VortexStepModel(method, wing.symmetric, wing.transient, wing.mesh.nodes)
