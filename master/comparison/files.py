"""The files of a comparison, each written whole or not at all; the same rows give the same bytes."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from master.comparison.tables import comma_separated, markdown
from master.report.tables import write_json, write_whole

FIGURES = {
    "residuals": "Interface residual over the coupling iterations. A filled dot ends a solve that converged, a red "
    "cross one that did not; the dashed line is the tolerance. Beside each scheme how many "
    "iterations it took (* to another equilibrium)",
    "iterations": "Coupling iterations of each scheme, dark where they are fewest. Hatched red bars are solves that "
    "did not converge, with the iteration at which they ended; dotted ones have found another equilibrium",
    "steps": "Coupling iterations of each communication step of scenes in motion; beside each scheme all of them",
    "omega": "Relaxation factors over the coupling iterations, where a scheme has them and they change",
}
FILES = (
    *("compare.csv", "compare.json", "compare.md", "compare.html"),
    *(f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")),
)


def lacking() -> str:
    """One sentence on what to install for plots and page, empty if it is there; nothing is loaded."""
    missing = [name for name in ("matplotlib", "jinja2") if find_spec(name) is None]
    if not missing:
        return ""
    which = " and ".join(missing) + (" is" if len(missing) == 1 else " are")
    return f"no plots and HTML page, because {which} not installed; pip install 'kitecosim[report]' brings them."


def write_comparison(out: Path, rows: Sequence[dict[str, Any]]) -> list[str]:
    """Write tables and, where their libraries are installed, plots and page; the names of the files."""
    content: dict[str, str | bytes] = {"compare.csv": comma_separated(rows), "compare.md": markdown(rows)}
    if not lacking():
        from master.comparison.figures import comparison_figures
        from master.comparison.page import page
        from master.report.figures import rendered

        images = {name: rendered(figure) for name, figure in comparison_figures(rows).items()}
        content |= {f"{name}.{kind}": data for name, image in images.items() for kind, data in image.items()}
        content["compare.html"] = page(rows, {name: (FIGURES[name], image["svg"]) for name, image in images.items()})
    for name in FILES:  # so that none of an earlier comparison stands beside them
        (out / name).unlink(missing_ok=True)
    write_json(out / "compare.json", {"cells": list(rows)})
    for name, data in content.items():
        write_whole(out / name, data)
    return [name for name in FILES if name in content or name == "compare.json"]
