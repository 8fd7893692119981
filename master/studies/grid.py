"""The cells of a comparison: each scene with each set of its settings, with each scheme and set of its parameters."""

import hashlib
import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from master.commands import BACKENDS, prepared
from master.coupling.convergence import required_count, required_number
from master.coupling.equilibrium import require_structure
from master.coupling.exchange import ORDERS
from master.coupling.schemes import SCHEMES, defaults
from master.coupling.simulation import PARAMETERS
from master.report.tables import versions
from master.restart import files_digest
from master.transient import transient_times

# What a change of the code must not leave unnoticed; report and studies only show the numbers.
_NUMBERS = dict.fromkeys(("interface", "structural", "aero", "scenes", "master"), "**/*.py") | {"fmus": "*.py"}
_SHOWN = ("report", "studies", "cli.py", "moved.py")


@dataclass(frozen=True)
class Cell:
    """One entry of a comparison, complete: what it solves, with which scheme, to which tolerances.

    `folder` is the scene's folder, `assigned` its settings and parameters that differ from the scene's own, as texts,
    `parameters` all parameters of the scheme. A transient scene goes to `stop_time` s in steps of `step` s, others
    have neither. `case` and `label` name scene and scheme in tables. `digest` stands for
    the contents of the folder and of the code, `versions` for the packages.
    """

    scene: str
    folder: str
    assigned: dict[str, str]
    case: str
    scheme: str
    parameters: dict[str, Any]
    label: str
    order: str
    backend: str
    tolerance: float
    force_tolerance: float
    max_iterations: int
    repeat: int
    stop_time: float | None
    step: float | None
    digest: str
    versions: dict[str, str] = field(repr=False)

    @property
    def key(self) -> str:
        """Name of the file of this cell: hash of all that decides its result, not of how it is called in tables."""
        defining = {k: v for k, v in asdict(self).items() if k not in ("case", "label", "folder")}
        return hashlib.sha256(json.dumps(defining, sort_keys=True).encode()).hexdigest()[:24]


def grid(
    scenes: Sequence[str],
    schemes: Sequence[str],
    parameters: Mapping[str, Sequence[Any]],
    assigned: Mapping[str, str],
    sweep: Mapping[str, Sequence[str]],
    orders: Sequence[str],
    options: Mapping[str, Any],
    transient: Mapping[str, float | None],
    others: bool = False,
) -> list[Cell]:
    """All cells in the order of the scenes, their settings, the schemes, their parameters, the orders of exchange.

    Names in `parameters` may have a scheme in front, those of `assigned` and `sweep` a scene: `iqn-ils.reuse`,
    `v3_kite.wind_speed`; without it they go to all that have them. `others`: there are cells beside those of scenes.
    ValueError in one sentence for whatever is wrong.
    """
    _checked(scenes, schemes, orders, options, others)
    if not scenes:
        return []
    variants = scheme_variants(schemes, parameters)
    cases = _cases(scenes, assigned, sweep)
    found, code = versions(), code_digest()
    if (
        not others
        and not any(scene.transient for scene, _, _ in cases)
        and any(value is not None for value in transient.values())
    ):
        raise ValueError("--stop-time and --step are for transient scenes, and none is compared; leave them out.")
    cells = []
    for scene, given, case in cases:
        require_structure(scene)
        stop, step = None, None
        if scene.transient:
            stop, step = transient_times(scene, transient.get("stop_time"), transient.get("step"))
        digest = f"{_digest(scene.folder, ['**/*'])}-{code}"
        for (name, chosen, label), order in itertools.product(variants, orders):
            shown = label if order == ORDERS[0] else f"{label} {order}"
            used = {**defaults(name, order), **(PARAMETERS.get(name, {}) if scene.transient else {}), **chosen}
            cells.append(
                Cell(
                    scene.name, str(scene.folder), given, case, name, used, shown, order,
                    stop_time=stop, step=step, digest=digest, versions=found, **options,
                )
            )  # fmt: skip
    twice = {cell.key for cell in cells}
    if len(twice) < len(cells):
        raise ValueError("the same cell is asked for twice; name every scene, scheme and value once.")
    return cells


def _checked(
    scenes: Sequence[str], schemes: Sequence[str], orders: Sequence[str], options: Mapping[str, Any], others: bool
) -> None:
    if not scenes and not others:
        raise ValueError("there is nothing to compare; name a scene, for example v3_kite.")
    if not schemes:
        raise ValueError(f"there is no scheme to compare; choose from: {', '.join(SCHEMES)}.")
    for name in schemes:
        if name not in SCHEMES:
            raise ValueError(f"there is no scheme '{name}'; choose from: {', '.join(SCHEMES)}.")
    for order in orders:
        if order not in ORDERS:
            raise ValueError(f"there is no order '{order}'; choose from: {', '.join(ORDERS)}.")
    if options["backend"] not in BACKENDS:
        raise ValueError(f"there is no backend '{options['backend']}'; choose one of: {', '.join(BACKENDS)}.")
    exact = [name for name in schemes if SCHEMES[name].exact]
    if exact and options["backend"] == "fmu":
        raise ValueError(f"scheme {exact[0]} needs directional derivatives, which FMUs lack; use --backend in-process.")
    for key in ("tolerance", "force_tolerance"):
        required_number(f"--{key.replace('_', '-')}", options[key])
    for key in ("max_iterations", "repeat"):
        required_count(f"--{key.replace('_', '-')}", options[key])


def scheme_variants(
    schemes: Sequence[str], given: Mapping[str, Sequence[Any]]
) -> list[tuple[str, dict[str, Any], str]]:
    """(scheme, its parameters that are given, label) of every combination of the values given."""
    lists: dict[str, dict[str, Sequence[Any]]] = {name: {} for name in schemes}
    for key, values in given.items():
        prefix, _, name = key.rpartition(".")
        owners = [s for s in ([prefix] if prefix else schemes) if s in SCHEMES and name in SCHEMES[s].parameters]
        if prefix and prefix not in schemes:
            known = "compared" if prefix in SCHEMES else "there"
            raise ValueError(
                f"--parameters {key}: scheme '{prefix}' is not {known}; schemes are: {', '.join(schemes)}."
            )
        if not owners:
            has = "; ".join(f"{s}: {', '.join(SCHEMES[s].parameters) or 'none'}" for s in schemes)
            raise ValueError(f"--parameters {key}: no scheme compared has a parameter '{name}'; they have: {has}.")
        for owner in owners:
            lists[owner][name] = _kinds_like(key, values, SCHEMES[owner].parameters[name])
    out = []
    for owner, values_of in lists.items():
        for combination in itertools.product(*values_of.values()):
            chosen = dict(zip(values_of, combination, strict=True))
            needed: dict[str, Any] = {"product": np.copy} if SCHEMES[owner].exact else {}
            SCHEMES[owner](**needed, **chosen)  # refuses what it does not take
            label = " ".join([owner, *(f"{k}={_text(v)}" for k, v in chosen.items())])
            out.append((owner, chosen, label))
    return out


def _cases(scenes: Sequence[str], assigned: Mapping[str, str], sweep: Mapping[str, Sequence[str]]) -> list[Any]:
    """(loaded scene, its assigned names and texts, case) of every combination of the swept values."""
    if both := [key for key in assigned if key in sweep]:
        raise ValueError(f"'{both[0]}' is both set and swept; do one of the two.")
    # what is said of one scene goes before what is said of all
    pairs = sorted([*((k, [v]) for k, v in assigned.items()), *sweep.items()], key=lambda pair: "." in pair[0])
    described = [(name, *_names(name)) for name in scenes]
    labels = [label for _, label, _ in described]
    used: set[str] = set()
    out = []
    for path, label, known in described:
        mine: dict[str, Sequence[str]] = {}
        for key, values in pairs:
            prefix, _, name = key.rpartition(".")
            # a single scene answers for itself, in the words of `kitecosim run`
            if prefix == label or (not prefix and (name in known or len(scenes) == 1)):
                used.add(key)
                mine[name] = values
        mine = dict(sorted(mine.items(), key=lambda item: len(item[1]) > 1))  # swept ones last
        for combination in itertools.product(*mine.values()):
            given = dict(zip(mine, combination, strict=True))
            case = " ".join([label, *(f"{k}={v}" for k, v in given.items())])
            out.append((prepared(path, given)[0], given, case))
    for key in [*assigned, *sweep]:
        if key not in used:
            raise ValueError(
                f"none of the scenes {', '.join(labels)} takes '{key}'; `kitecosim scenes` lists what they take."
            )
    return out


def _names(path: str) -> tuple[str, set[str]]:
    """Name of a scene, and the names of its settings and parameters."""
    scene, _, cores = prepared(path, {})
    parameters = {v.name for core in cores.values() for v in core.variables if v.causality == "parameter"}
    return scene.name, parameters | set(scene.offers)


def _kinds_like(key: str, values: Sequence[Any], default: Any) -> list[Any]:
    """The values with texts turned into what the default is."""
    out: list[Any] = []
    for value in values:
        if isinstance(value, str):
            words = {"true": True, "on": True, "yes": True, "false": False, "off": False, "no": False, "none": None}
            try:
                number = float(value)
                value = int(number) if isinstance(default, int) and number == int(number) else number
            except (ValueError, OverflowError):
                if value.lower() not in words and isinstance(default, int | float):
                    raise ValueError(
                        f"--parameters {key}: '{value}' is not a number; its default is {default}."
                    ) from None
                value = words.get(value.lower(), value)
        if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        out.append(value)
    return out


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _digest(folder: Path, patterns: Iterable[str], but: Sequence[str] = ()) -> str:
    """Hash of names and contents of the files of a folder."""
    found = (p for pattern in patterns for p in folder.glob(pattern) if p.is_file())
    inside = (p for p in found if not p.is_symlink() or p.resolve().is_relative_to(folder.resolve()))
    names = [p.relative_to(folder) for p in inside]
    kept = [n.as_posix() for n in names if n.parts[0] not in but and "__pycache__" not in n.parts]
    return files_digest(folder, kept)


def code_digest() -> str:
    """Hash of the code that makes the numbers."""
    parts = []
    for package, pattern in _NUMBERS.items():
        spec = find_spec(package)
        for folder in (spec.submodule_search_locations or []) if spec else []:
            parts.append(_digest(Path(folder), [pattern], _SHOWN if package == "master" else ()))
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:16]
