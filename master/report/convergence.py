"""The plot of how a coupled solve converged."""

from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.figures import DARK, MIDDLE, legend_beside, stacked, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def convergence_figure(
    history: list[dict[str, float]],
    title: str,
    tolerance: float | None = None,
    force_tolerance: float | None = None,
    residual_N: float | None = None,
) -> "Figure":
    """Interface residual m, out-of-balance force N and Newton iterations over the coupling iterations.

    `history` has a row per coupling iteration; panels whose columns it lacks are left out. `residual_N` is the force
    with the flow evaluated again at the end.
    """
    from matplotlib.ticker import MaxNLocator

    k = np.array([row["iteration"] for row in history])

    def column(name: str) -> np.ndarray | None:
        return np.array([row[name] for row in history]) if history and name in history[0] else None

    imbalance = column("structural.imbalance_before_step")
    solvers = {"structure": "structural", "flow": "aero"}
    newton = {label: column(f"{key}.newton_iterations") for label, key in solvers.items()}
    newton_shown = {label: n for label, n in newton.items() if n is not None}
    labels = ["interface residual, m"]
    labels += [] if imbalance is None else ["out-of-balance force, N"]
    labels += ["Newton iterations"] if newton_shown else []
    with style():
        heights = [2.0, *([] if imbalance is None else [1.6]), *([1.1] if newton_shown else [])]
        figure, panels = stacked(title, heights, labels, "coupling iteration")
        left = iter(panels)
        panel = next(left)
        _log(panel, k, column("residual_m"), "o-", "||x\u0303 \u2212 x||\u2082", tolerance, "m")
        if imbalance is not None:
            panel = next(left)
            again = residual_N if residual_N is not None and np.isfinite(residual_N) and residual_N > 0.0 else None
            _log(panel, k, imbalance, "s-", "before the\nstructural step", force_tolerance, "N", again)
        if newton_shown:
            panel = next(left)
            for i, (label, n) in enumerate(newton_shown.items()):
                look: dict[str, Any] = {"color": DARK} if i == 0 else {"color": "0.85", "hatch": "/////"}
                panel.bar(k + 0.4 * (i - 0.5 * (len(newton_shown) - 1)), n, 0.4, label=label, ec=DARK, lw=0.5, **look)
            panel.yaxis.set_major_locator(MaxNLocator(4, integer=True))
            legend_beside(panel)
        panels[0].xaxis.set_major_locator(MaxNLocator(15, integer=True, min_n_ticks=1))
        panels[0].set_xlim(0.4, max(k, default=1.0) + 0.6)
    return figure


def _log(
    panel: "Axes",
    k: np.ndarray,
    values: np.ndarray | None,
    look: str,
    label: str,
    limit: float | None,
    unit: str,
    again: float | None = None,
) -> None:
    """Values over k on a logarithmic axis of whole decades, with the tolerance as a dashed line."""
    from matplotlib.ticker import FuncFormatter

    values = np.full(len(k), np.nan) if values is None else values
    values = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
    panel.set_yscale("log")
    panel.minorticks_off()
    panel.yaxis.set_major_formatter(FuncFormatter(lambda y, _: power_of_ten(y)))  # formulas are slow to set
    panel.plot(k, values, look, color=DARK, label=label)
    if again is not None:
        panel.plot(k[-1:], [again], "D", color="white", mec=DARK, ms=5.0, label="flow evaluated\nagain at the end")
    if limit is not None:
        panel.axhline(limit, color=MIDDLE, ls="--", label=f"tolerance {limit:g} {unit}")
    shown = np.array([v for v in (*values, limit, again) if v is not None and np.isfinite(v)])
    if len(shown):
        low, high = np.floor(np.log10(0.5 * shown.min())), np.ceil(np.log10(2.0 * shown.max()))
        panel.set_ylim(10.0**low, 10.0**high)
    legend_beside(panel)


def power_of_ten(value: float) -> str:
    """10 with the rounded exponent of the value in superscript digits."""
    raised = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")
    return "10" + str(round(np.log10(value))).translate(raised)
