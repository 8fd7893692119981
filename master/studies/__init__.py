"""Comparison of coupling schemes: every scheme on every scene, counted, timed, and kept in files."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from master.coupling.convergence import required_count
from master.coupling.participants.blocks import assignment_text
from master.coupling.schemes import SCHEMES
from master.report.results_folder import ResultsFolder
from master.report.tables import plain, versions
from master.studies.couplings import coupling_cells, is_coupling
from master.studies.files import FILES, Store
from master.studies.flat import flat_rows
from master.studies.grid import Cell, code_digest, grid, scheme_variants
from master.studies.pool import rows

__all__ = ["compare"]


def compare(
    scenes: str | Path | Sequence[str | Path],
    schemes: str | Sequence[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    sweep: Mapping[str, Sequence[Any]] | None = None,
    settings: Mapping[str, Any] | None = None,
    *,
    orders: str | Sequence[str] = ("serial",),
    backend: str = "in-process",
    tolerance: float = 1e-5,
    force_tolerance: float = 0.01,
    max_iterations: int = 200,
    stop_time: float | None = None,
    step: float | None = None,
    repeat: int = 1,
    jobs: int | None = None,
    out: str | Path | None = None,
    recompute: bool = False,
    fresh: bool = False,
    force: bool = False,
    progress: Callable[[int, int, dict[str, Any] | None], Any] | None = None,
) -> list[dict[str, Any]]:
    """Solve every scene with every scheme; a flat dict per cell, such that `pandas.DataFrame` makes a table of them.

    What is compared may be coupling files too (`kitecosim couple`; .toml, .ssp), whose FMUs are then coupled with each
    scheme; tolerances and limits are theirs.

    A cell is a scene with settings and a scheme with parameters; each begins at the scene's start. `schemes`
    are names of `master.coupling.SCHEMES`, all that the backend allows if None. `parameters` maps names of scheme
    parameters to a value or several, `iqn-ils.omega0` for one scheme, `omega` for all that have it. `settings` maps
    names of settings and parameters of the scenes to a value, `sweep` to several; a scene's name in front keeps them to
    that scene. All combinations are solved, in each of the `orders` of exchange ("serial", "parallel"). `tolerance` m,
    `force_tolerance` N and `max_iterations` are those of `master.coupling.solve`; wall times are of the solve with the
    median one of `repeat`. Transient scenes go to `stop_time` s in communication steps of `step` s (None: their own),
    each step solved to `tolerance` m in `max_iterations` at most.

    `jobs` worker processes with one BLAS thread each (None: one a core) solve the cells. They start Python again and
    load the calling script, so the call must stand below `if __name__ == "__main__":`. With `jobs=0` all is solved in
    this process. A cell whose process dies, or that ends in an exception, has the status "crashed" and a `message`.

    With `out`, finished cells are kept in `out`/cells and taken from there another time (`recompute`: solved again;
    `fresh` is its former name), and
    tables, plots and a page are written as `kitecosim compare` does, over files of others only by `force`.
    `progress(done, total, row)` is called first with the number of cells that were there and None, then after every
    cell with what is known of it.

    ValueError in one sentence for bad input. What the keys mean is in docs/compare.md.
    """
    paths = [str(s) for s in ([scenes] if isinstance(scenes, str | Path) else scenes)]
    all_ = [name for name, kind in SCHEMES.items() if backend == "in-process" or not kind.exact]
    names = all_ if schemes is None else [schemes] if isinstance(schemes, str) else list(schemes)
    options = {
        "backend": backend,
        "tolerance": tolerance,
        "force_tolerance": force_tolerance,
        "max_iterations": max_iterations,
        "repeat": repeat,
    }
    if jobs is not None:
        required_count("--jobs (0: no worker processes)", jobs, least=0)
    listed = {k: list(v) if isinstance(v, list | tuple | np.ndarray) else [v] for k, v in (parameters or {}).items()}
    for name, given in (sweep or {}).items():
        if not isinstance(given, list | tuple | range | np.ndarray):
            raise ValueError(
                f"sweep takes several values of {name} in a list, not {given!r}; settings takes a single one."
            )
    swept = {k: [assignment_text(v) for v in values] for k, values in (sweep or {}).items()}
    if empty := next((k for k, values in [*listed.items(), *swept.items()] if not len(values)), None):
        raise ValueError(f"{empty} has no values; give at least one.")
    ordered = [orders] if isinstance(orders, str) else list(orders)
    assigned = {k: assignment_text(v) for k, v in (settings or {}).items()}
    transient = {"stop_time": stop_time, "step": step}
    cells = _cells(paths, names, listed, assigned, swept, ordered, options, transient)
    if out is None:
        found = _solved(cells, jobs, None, False, progress)
        return flat_rows(cells, [found[cell.key] for cell in cells])
    from master.studies.files import write_comparison

    with ResultsFolder(Path(out), FILES, "compare", force) as results:
        found = _solved(cells, jobs, Store(Path(out)), recompute or fresh, progress)
        table = flat_rows(cells, [found[cell.key] for cell in cells])
        write_comparison(results.path, table)
        results.place()
    return table


def _cells(
    paths: Sequence[str],
    names: Sequence[str],
    listed: Mapping[str, list[Any]],
    assigned: Mapping[str, str],
    swept: Mapping[str, list[str]],
    orders: Sequence[str],
    options: Mapping[str, Any],
    transient: Mapping[str, float | None],
) -> list[Cell]:
    """The cells of scenes and of coupling files; ValueError in one sentence where there is none."""
    files = [path for path in paths if is_coupling(path)]
    of_scenes = [path for path in paths if path not in files]
    if files and not of_scenes and (assigned or swept):
        raise ValueError("--set and --sweep are for scenes; what FMUs start with is written in their coupling file.")
    cells = grid(of_scenes, names, listed, assigned, swept, orders, options, transient, bool(files))
    if files:
        shared = code_digest(), versions()
        cells += coupling_cells(files, scheme_variants(names, listed), orders, options["repeat"], transient, *shared)
    if not cells:
        raise ValueError("FMUs give no derivatives, which the schemes named need; name another.")
    return cells


def _solved(
    cells: Sequence[Cell],
    jobs: int | None,
    store: Store | None,
    recompute: bool,
    progress: Callable[[int, int, dict[str, Any] | None], Any] | None,
) -> dict[str, dict[str, Any]]:
    """Key -> row of all cells: of those that the `store` has, unless they are to be computed again, and of those that
    are solved, which it keeps.
    """
    found = {} if store is None or recompute else store.finished(cells)
    if progress is not None:
        progress(len(found), len(cells), None)
    left = [cell for cell in cells if cell.key not in found]
    for cell, row in rows(left, min(os.cpu_count() or 1, len(left)) if jobs is None else jobs):
        row = plain(row)  # as it comes back from a file
        found[cell.key] = row
        if store is not None and row["status"] != "crashed":  # what crashed is tried again another time
            store.write(cell, row)
        if progress is not None:
            progress(len(found), len(cells), {"case": cell.case, "label": cell.label, **row})
    return found
