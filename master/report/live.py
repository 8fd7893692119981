"""What one sees while a coupled solve runs: a status line, or a plot of the residuals in the terminal."""

import contextlib
import math
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

Progress = Callable[[int, float], Any]

ROWS, WIDEST = 12, 70  # size of the plot in characters
TOLERANCE, POINT = "\u00b7", "\u2022"
PLAIN = str.maketrans({TOLERANCE: ".", POINT: "o"})  # for terminals that show nothing but ASCII


@contextlib.contextmanager
def progress(tolerance: float, live: bool) -> Iterator[Progress | None]:
    """A callback `progress(iteration, residual m)` that shows it on standard error.

    On a terminal a status line, with `live` a plot that grows; elsewhere nothing, with `live` a line an iteration.
    """
    if not sys.stderr.isatty():
        yield _line if live else None
        return
    from rich.console import Console

    console = Console(stderr=True)
    if live:
        from rich.live import Live
        from rich.text import Text

        history: list[float] = []
        begin = time.perf_counter()
        with Live(console=console, auto_refresh=False) as shown:

            def draw(k: int, residual: float) -> None:
                history.append(residual)
                took = time.perf_counter() - begin
                head = f"coupling iteration {k}: residual {residual:.3e} m, {took:.1f} s; dotted: {tolerance:.0e} m"
                lines = residual_plot(history, tolerance, min(WIDEST, console.width - 8))
                text = "\n".join([head, *lines])
                if not console.encoding.startswith("utf"):
                    text = text.translate(PLAIN)
                shown.update(Text(text), refresh=True)

            yield draw
        return
    with console.status("coupling ...") as status:
        yield lambda k, r: status.update(f"coupling iteration {k}: residual {r:.3e} m (tolerance {tolerance:.0e} m)")


def _line(k: int, residual: float) -> None:
    print(f"coupling iteration {k}: residual {residual:.3e} m", file=sys.stderr, flush=True)


def residual_plot(history: list[float], tolerance: float, width: int = WIDEST, rows: int = ROWS) -> list[str]:
    """Lines of text: residuals m over the last `width` coupling iterations, decades upwards, `·` at the tolerance.

    Values that are zero or not finite stand at the lower and upper edge.
    """
    width = max(1, width)
    shown = history[-width:]
    finite = [math.log10(r) for r in (*shown, tolerance) if 0.0 < r < math.inf] or [0.0]
    low, high = math.floor(min(finite)), math.ceil(max(finite))
    high = max(high, low + 1)

    def row(value: float) -> int:
        if not value < math.inf:
            return 0
        y = low if value <= 0.0 else math.log10(value)
        return round((high - y) / (high - low) * (rows - 1))

    lines = [[" "] * width for _ in range(rows)]
    lines[row(tolerance)] = [TOLERANCE] * width
    for column, value in enumerate(shown):
        lines[row(value)][column] = POINT if math.isfinite(value) else "x"
    labels = {0: f"1e{high:+03d}", rows - 1: f"1e{low:+03d}"}
    return [f"{labels.get(i, ''):>6} {''.join(line)}" for i, line in enumerate(lines)]
