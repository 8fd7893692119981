"""The vortex-step method: lifting-line strips with section polars; see `aero.vortex_step`."""


def wing_loads(options):
    """Pressure, and shear unless the polars are those of a plate that carries pressure only."""
    return ("pressure",) if options["section_force"] == "normal" else ("pressure", "shear")


def wing_model(wing):
    """A `VortexStepModel` on the strips of the wing."""
    from aero.vortex_step import SurfaceGrid, VortexStep, VortexStepModel

    names = "induction", "direction", "circulation_speed", "section_force", "camber"
    options = {name: wing.options[name] for name in names}
    grid = SurfaceGrid(wing.sections, wing.fractions)
    return VortexStepModel(VortexStep(wing.polars(), grid, **options), wing.symmetric)
