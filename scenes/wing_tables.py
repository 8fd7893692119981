"""The wing of a scene's tubes: what it needs, its mesh for the settings, and the masses of its nodes."""

from .tables import SceneError
from .wing_mesh import read_wing_mesh

NEEDED = ("ribs", "tube_pressure", "canopy_stiffness", "canopy_shear_stiffness")
OF_FABRIC = ("tube_stiffness", "tube_shear_stiffness")
# Keys and settings that say nothing without tubes, and settings that say nothing with them.
_ONLY_TUBES = (*NEEDED, *OF_FABRIC, "attachments", "wing_mass", "canopy_density", "hold")
_TUBE_SETTINGS = ("canopy_stations", "canopy_subdivisions", "tube_law")
_STRUT_SETTINGS = ("chord", "panels_per_section")


def check_wing_keys(folder, structure, settings):
    """`SceneError` in one sentence where a key or a setting is missing for the kind of wing, or means nothing to it."""
    label, tubes = f"{folder.name}/scene.toml", bool(structure["tubes"])
    if not tubes and (odd := [key for key in _ONLY_TUBES if structure[key]]):
        raise SceneError(f"{label}: [structure] {odd[0]} means nothing without 'tubes'; add these or remove it.")
    for key in _STRUT_SETTINGS if tubes else _TUBE_SETTINGS:
        if key in settings:
            kind = "tubes and ribs" if tubes else "springs and struts"
            raise SceneError(f"{label}: [settings.{key}] means nothing to a wing of {kind}; remove it.")
    if not tubes:
        return
    fabric = OF_FABRIC if settings.get("tube_law") == "fabric" else ()
    for key in (*NEEDED, *fabric):
        if structure[key] is None:
            raise SceneError(f"{label}: [structure] lacks '{key}', which tubes need; add it.")
    if structure["tube_pressure"] <= 0.0:
        raise SceneError(
            f"{label}: [structure] tube_pressure must be above zero; give the pressure in the tubes less that of the "
            "air around them, in Pa."
        )
    for key, least in (("canopy_stations", 2), ("canopy_subdivisions", 1)):
        value = settings.get(key, least)
        if not isinstance(value, int) or value < least:
            raise SceneError(f"{label}: [settings.{key}] must be a whole number, {least} or more; it is {value}.")


def wing_of(folder, structure, settings, labels, nodes, fixed):
    """The mesh of the wing between `nodes` (n,3) m named `labels`; `fixed` (n,3) nodes cannot ride on a tube."""
    stations, subdivisions = settings.get("canopy_stations", 6), settings.get("canopy_subdivisions", 1)
    return read_wing_mesh(folder, structure, labels, nodes, fixed, stations, subdivisions)


def wing_masses(folder, structure, wing):
    """Masses (n,) kg of the wing: the canopy by its area, the rest of `wing_mass` along the tubes (LEI thesis 6.2)."""
    canopy = float(wing.canopy_mass.sum())
    total = canopy if structure["wing_mass"] is None else structure["wing_mass"]
    if total < canopy:
        raise SceneError(
            f"{folder.name}/scene.toml: [structure] wing_mass of {total:g} kg is less than the canopy's {canopy:.3g} "
            "kg; correct wing_mass or canopy_density."
        )
    return wing.canopy_mass + (total - canopy) * wing.tube_length / wing.tube_length.sum()
