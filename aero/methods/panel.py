"""The 3D panel method for closed wings: sources and doublets on their surface; see `aero.panel`."""

from aero.model import Option

OF_BODIES = True
OPTIONS = {
    "internal_pressure_coefficient": Option(0.0, minimum=-10.0, maximum=10.0),
    "follow": Option("inside", ("inside", "all")),
    "wake": Option("straight", ("straight", "relaxed")),
    "kinematic_viscosity": Option(1.46e-5, minimum=1e-9, maximum=1.0),
    "transition": Option("turbulent", ("turbulent", "peak", "laminar")),
    "profile_drag_coefficient": Option(0.0, minimum=0.0, maximum=10.0),
}


def wing_loads(options):
    """Shear: what the flow does outside; pressure: that inside, or both where all of it turns with the surface."""
    return ("pressure", "shear")


def wing_model(wing):
    """A `PanelModel` of a closed wing."""
    from aero.panel.model import PanelModel

    return PanelModel(wing)
