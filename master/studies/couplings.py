"""Coupling files (`kitecosim couple`) as cells of a comparison: the same FMUs with every scheme."""

import hashlib
import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from master.coupling.schemes import SCHEMES, defaults
from master.fmu_coupling import Document, couple
from master.studies.grid import Cell

BACKEND = "couple"  # of such cells
SUFFIXES = (".toml", ".ssp")


def is_coupling(path: str) -> bool:
    """Whether what is to be compared is a coupling file and no scene."""
    return Path(path).suffix in SUFFIXES and not Path(path).is_dir()


def coupling_cells(
    paths: Sequence[str],
    variants: Sequence[tuple[str, dict[str, Any], str]],
    orders: Sequence[str],
    repeat: int,
    times: Mapping[str, float | None],
    code: str,
    versions: dict[str, str],
) -> list[Cell]:
    """The cells of coupling files: each with every variant of a scheme (name, parameters, label) in every order.

    Tolerances and limits are those of the file, times too unless others are given (`stop_time`, `step`). Schemes that
    need derivatives have no cell, as FMUs give none. ValueError in one sentence for a file that is wrong.
    """
    cells = []
    for path in paths:
        document = _read(path, times)
        s = document.settings
        for (name, chosen, label), order in itertools.product(variants, orders):
            if SCHEMES[name].exact:
                continue
            own = s.parameters if name == s.scheme else {}
            transient = s.mode == "transient"
            cells.append(
                Cell(
                    Path(path).stem, str(Path(path).absolute()), {}, Path(path).stem, name,
                    {**defaults(name, order), **own, **chosen}, label if order == "serial" else f"{label} {order}",
                    order, BACKEND, s.rtol if isinstance(s.rtol, float) else min(dict(s.rtol).values()), 0.0,  # type: ignore[arg-type]
                    s.max_iterations, repeat, s.stop if transient else None, s.step if transient else None,
                    f"{_digest(document, path)}-{code}", versions,
                )
            )  # fmt: skip
    return cells


def _read(path: str, times: Mapping[str, float | None]) -> Document:
    """The document of a file, whose own scheme need not be one that its FMUs allow."""
    try:
        return Document.read(path, _settings(None, {}, "serial", times))
    except ValueError:
        return Document.read(path, _settings("explicit", {}, "serial", times))


def _settings(
    scheme: str | None, parameters: Mapping[str, Any], order: str, times: Mapping[str, float | None]
) -> dict[str, dict[str, Any]]:
    """What of a coupling file is replaced."""
    given = {"stop": times.get("stop_time"), "step": times.get("step")}
    coupling = {} if scheme is None else {"scheme": scheme, "parameters": dict(parameters), "order": order}
    return {"time": {key: value for key, value in given.items() if value is not None}, "coupling": coupling}


def _digest(document: Document, path: str) -> str:
    """Hash of a coupling file and of its FMUs."""
    found = hashlib.sha256(Path(path).read_bytes())
    for member in document.participants.values():
        found.update(member.fmu.read_bytes())
    return found.hexdigest()[:16]


def coupled_row(cell: Cell) -> dict[str, Any]:
    """The row of a cell of a coupling file; a scheme that its FMUs do not allow is "unavailable"."""
    begin = time.perf_counter()
    times = {"stop_time": cell.stop_time, "step": cell.step}
    try:
        document = Document.read(cell.folder, _settings(cell.scheme, cell.parameters, cell.order, times))
    except ValueError as error:
        return {"status": "unavailable", "message": str(error)}
    results = [couple(document) for _ in range(cell.repeat)]
    result = sorted(results, key=lambda one: one.seconds["total"] - one.seconds["set_up"])[(cell.repeat - 1) // 2]
    total = result.seconds["total"] - result.seconds["set_up"]
    apart = sum(result.seconds[name] for name in document.participants)
    transient = document.settings.mode == "transient"
    ends = [np.ravel(value) for value in result.values.values()]
    return {
        "status": result.status,
        "message": result.message,
        "coupling_iterations": result.evaluations,
        "communication_steps": len(result.steps) if transient else None,
        "recoveries": sum(result.steps.recoveries),
        "histories": {"evaluations_history": list(result.steps.iterations)} if transient else {},
        "displacement": np.concatenate(ends).tolist() if ends else [],
        "settings": {"coupling": {k: v for k, v in asdict(document.settings).items() if np.isscalar(v)}},
        "seconds": {"total": total, "master": total - apart, "cell": time.perf_counter() - begin},
    }
