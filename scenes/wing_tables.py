"""The wing of a scene's tubes: its mesh for the settings, and the masses of its nodes."""

from .tables import SceneError
from .wing_mesh import read_wing_mesh


def wing_of(folder, structure, settings, labels, nodes):
    """The mesh of the wing; `SceneError` in one sentence where a key is missing or a value has no meaning."""
    label = f"{folder.name}/scene.toml"
    for key in ("ribs", "tube_pressure", "canopy_stiffness", "canopy_shear_stiffness"):
        if structure[key] is None:
            raise SceneError(f"{label}: [structure] lacks '{key}', which tubes need; add it.")
    if structure["tube_pressure"] <= 0.0:
        raise SceneError(f"{label}: [structure] tube_pressure must be above zero Pa; a tube without it is a rag.")
    stations, subdivisions = (int(settings.get(f"canopy_{k}", d)) for k, d in (("stations", 6), ("subdivisions", 1)))
    return read_wing_mesh(folder, structure, labels, nodes, stations, subdivisions)


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
