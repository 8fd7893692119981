"""Small kites of random shape, stiffness, wind and trim, made of the tables of a shipped one; (seed, folder) -> a scene
there and the options of its run.
"""

import csv
import re
import shutil

import numpy as np

from .kite_balance import rows, vectors

# Of the shape: size, and stretching along each axis; of rest lengths, pair by pair; of tapes; of stiffness and mass.
SIZE, STRETCH, LENGTHS, TAPES, FACTOR = (0.3, 2.0), 0.08, 0.01, 0.02, 2.0
WIND, MODULUS, TILT = (6.0, 22.0), (0.3e9, 100e9), 0.15
TAPE_NAMES = ("power_tape", "steering_tape_left", "steering_tape_right")
AREA = 19.753  # m2 of the shipped kite, for which its coefficients are


def _write(path, table):
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, table[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)


def _mapped(folder, names, columns, stretch):
    table = rows(folder / names)
    for row, place in zip(table, vectors(table, *columns) * np.tile(stretch, len(columns) // 3), strict=True):
        row.update(zip(columns, map(repr, map(float, place)), strict=True))
    _write(folder / names, table)


def _lengths(places, index, table):
    legs = [np.diff(places[[index[label] for label in row["nodes"].split()]], axis=0) for row in table]
    return np.array([np.linalg.norm(leg, axis=1).sum() for leg in legs])


def _pair(name):
    """What an element and its mirror image have in common: dia_5a and dia_5b cross in the bay in the middle."""
    return re.sub("^(dia_.)[ab]", r"\1", name.replace("_left", "").replace("_right", ""))


def random_kite(rng, shipped, folder):
    """A kite in `folder` from the tables in `shipped`: words for `kitecosim run` and the modulus Pa of its lines."""
    shutil.copytree(shipped, folder)
    size = float(np.exp(rng.uniform(*np.log(SIZE))))
    stretch = size * rng.uniform(1.0 - STRETCH, 1.0 + STRETCH, 3)
    nodes = rows(folder / "nodes.csv")
    index, before = {row["node"]: k for k, row in enumerate(nodes)}, vectors(nodes, "x_m", "y_m", "z_m")
    after, factors, tapes = before * stretch, {}, {}
    for name, spread in (("springs.csv", 0.3 * LENGTHS), ("lines.csv", LENGTHS)):
        table = rows(folder / name)
        grown = _lengths(after, index, table) / _lengths(before, index, table)
        for row, growth in zip(table, grown, strict=True):
            factor = factors.setdefault(_pair(row["name"]), rng.uniform(1.0 - spread, 1.0 + spread))
            length = float(row["rest_length_m"]) * growth * factor
            row["rest_length_m"] = repr(float(length))
            if "diameter_m" in row:
                row["diameter_m"] = repr(float(row["diameter_m"]) * size)
            else:
                row["stiffness_N_per_m"] = repr(float(row["stiffness_N_per_m"]) * size)
                row["mass_kg"] = repr(float(row["mass_kg"]) * size**2)
            if row["name"] in TAPE_NAMES:
                tapes[row["name"]] = length
        _write(folder / name, table)
    _mapped(folder, "nodes.csv", ("x_m", "y_m", "z_m"), stretch)
    _mapped(folder, "sections.csv", ("le_x_m", "le_y_m", "le_z_m", "te_x_m", "te_y_m", "te_z_m"), stretch)
    masses = rows(folder / "masses.csv")
    for row in masses:
        row["mass_kg"] = repr(float(row["mass_kg"]) * size**2)
    _write(folder / "masses.csv", masses)
    toml = folder / "scene.toml"
    area = float(AREA * stretch[0] * stretch[1])
    toml.write_text(toml.read_text().replace(f"reference_area = {AREA:g}", f"reference_area = {area!r}"))
    return _options(rng, tapes)


def _options(rng, tapes):
    modulus = float(np.exp(rng.uniform(*np.log(MODULUS))))
    given = {"wind_speed": float(rng.uniform(*WIND)), "line_modulus": modulus}
    given["line_drag"] = str(rng.choice(["on", "on", "off"]))
    if steered := rng.random() < 0.4:
        given["symmetric"] = 0
    for name, length in tapes.items():
        side = rng.uniform(1.0 - TAPES, 1.0 + TAPES)
        if name == "power_tape" or steered:
            given[f"{name}_length"] = float(length * side)
    if steered:
        given["wind_direction"] = f"1,{rng.uniform(-TILT, TILT):.6f},{rng.uniform(-TILT, TILT):.6f}"
    words = ["--scheme", str(rng.choice(["iqn-ils", "iqn-ils", "iqn-imvj", "aitken"]))]
    return [*words, *(w for k, v in given.items() for w in ("--set", f"{k}={v}"))], modulus
