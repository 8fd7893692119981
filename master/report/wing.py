"""Tubes, canopy and lines of an inflatable wing: what they carry, how far they stretch, where they do most."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from master.report.sections import wing_sections

OF_TUBES = ("tube_load", "tube_strain", "tube_rest_length", "tube_length")
SHOWN = 3  # largest values that are named
ALIKE = 1e-4  # values this close, as part of the larger, count as one: left and right of a symmetric wing
NAMED = 4  # most names that a row of the result gives one value


@dataclass(frozen=True, eq=False)
class TubeState:
    """Parts of inflated tubes: `names`, the names of the `tube` that each belongs to, `ends` (t,2) nodes, `radius` (t,)
    m, `load` (t,) the bending moment over that of collapse, `strain` (t,), and `rest_length` and `length` (t,) m.
    """

    names: tuple[str, ...]
    tube: tuple[str, ...]
    ends: np.ndarray
    radius: np.ndarray
    load: np.ndarray
    strain: np.ndarray
    rest_length: np.ndarray
    length: np.ndarray

    @property
    def collapsed(self) -> np.ndarray:
        """Which parts carry the moment of collapse or more, (t,) bool."""
        return self.load >= 1.0


def tube_state(members: Any, blocks: dict[str, np.ndarray]) -> TubeState | None:
    """The tubes of a scene's `members` in the state `blocks`, None where there are none."""
    wing = getattr(members, "wing", None)
    if wing is None or not {*OF_TUBES, "position"} <= blocks.keys():
        return None
    t = wing.tubes
    return TubeState(t.names, t.tube, t.ends, t.radius, *(blocks[name] for name in OF_TUBES))


def canopy_springs(members: Any) -> np.ndarray:
    """Which elements are the tension-only springs of the canopy of an inflatable wing, (e,) bool."""
    wing = getattr(members, "wing", None)
    springs = set() if wing is None else {spring[0] for spring in wing.springs}
    return np.array([name in springs for name in members.names], dtype=bool)


def largest(values: np.ndarray, names: Any) -> list[dict[str, Any]]:
    """The SHOWN largest values above zero, each with the `names` that share it but for ALIKE, in their order."""
    out: list[tuple[float, list[int]]] = []
    for i in np.argsort(-values, kind="stable"):
        if not values[i] > 0.0:
            break
        if out and values[i] >= out[-1][0] * (1.0 - ALIKE):
            out[-1][1].append(int(i))
        elif len(out) == SHOWN:
            break
        else:
            out.append((float(values[i]), [int(i)]))
    return [{"value": value, "names": [names[i] for i in sorted(rows)]} for value, rows in out]


def wing_results(members: Any, blocks: dict[str, np.ndarray]) -> dict[str, Any] | None:
    """Largest strains and loads, what collapsed and the camber of an inflatable wing, as summary.json holds them."""
    tubes = tube_state(members, blocks)
    if tubes is None:
        return None
    names, strain, tension = members.names, blocks["strain"], blocks["tension"]
    canopy, line = canopy_springs(members), members.lines
    found: dict[str, Any] = {
        "tubes": {
            "parts": len(tubes.names),
            "largest_moment_over_collapse": largest(tubes.load, tubes.names),
            "largest_strain": largest(tubes.strain, tubes.names),
            "collapsed": {tubes.names[i]: float(tubes.load[i]) for i in np.flatnonzero(tubes.collapsed)},
        },
        "canopy": {
            "springs": int(canopy.sum()),
            "slack": int(np.count_nonzero(canopy & (tension <= 0.0))),
            "largest_strain": largest(np.where(canopy, strain, 0.0), names),
        },
        "lines": {"largest_strain": largest(np.where(line, strain, 0.0), names)},
    }
    sections = wing_sections(members.wing, blocks["position"])
    if sections is not None:
        c = sections.most
        found["largest_camber"] = {
            "camber_over_c": float(sections.camber[c]),
            "x_over_c": float(sections.place[c]),
            "arc_m": float(sections.arc[c]),
            "column": c + 1,
            "strut": bool(sections.strut[c]),
        }
    return found


def wing_rows(members: Any, blocks: dict[str, np.ndarray]) -> list[tuple[str, str]]:
    """The rows of the result on lines, canopy and tubes of an inflatable wing, none for any other."""
    found = wing_results(members, blocks)
    if found is None:
        return []
    tubes, canopy = found["tubes"], found["canopy"]
    collapsed = [f"{name} ({100.0 * load:.0f} %)" for name, load in tubes["collapsed"].items()]
    rows = [
        ("largest line strains", _named(found["lines"]["largest_strain"], "{:.3g} %")),
        ("largest canopy strains", _named(canopy["largest_strain"], "{:.3g} %")),
        ("slack canopy", f"{canopy['slack']} of {canopy['springs']} springs"),
        ("largest tube strains", _named(tubes["largest_strain"], "{:.3g} %")),
        ("largest tube moments", _named(tubes["largest_moment_over_collapse"], "{:.0f} % of collapse")),
        ("collapsed parts of tubes", ", ".join(collapsed) or "none"),
    ]
    if "largest_camber" in found:
        most = found["largest_camber"]
        place = f"at x/c {most['x_over_c']:.2f}, arc {abs(most['arc_m']):.2f} m from mid-span"
        what = "a strut" if most["strut"] else "canopy between struts"
        rows.append(("largest camber", f"{100.0 * most['camber_over_c']:.2f} % of the chord\n{place} ({what})"))
    return rows


def _named(values: list[dict[str, Any]], form: str) -> str:
    """Values in percent with the names that have them, a line for each."""
    out = []
    for entry in values:
        names = entry["names"]
        more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
        out.append(f"{form.format(100.0 * entry['value'])} in {', '.join(names[:NAMED])}{more}")
    return ";\n".join(out) or "none"
