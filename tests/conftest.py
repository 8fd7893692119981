"""Settings that hold for every test; they are made before numpy is first imported."""

import os

# One BLAS thread: the order of sums, and so the last digits, does not depend on the machine's cores.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(variable, "1")
os.environ.setdefault("MPLBACKEND", "Agg")  # no screen


def _verdict(outcome, report):
    if outcome == "skipped":
        return f"not run: {report.longrepr[2].removeprefix('Skipped: ')}"
    message = getattr(getattr(report.longrepr, "reprcrash", None), "message", "").removeprefix("Failed: ")
    return f"{outcome}, {message}" if message.startswith("not run: ") else outcome


def pytest_terminal_summary(terminalreporter):
    """The table of tools that FMUs were run in; here, as worker processes alone load tests/interop/conftest.py."""
    from tests.interop.tools import Row

    rows = [("tool", "version", "order", "largest difference", "verdict")]
    for outcome in ("passed", "skipped", "failed", "error"):
        for report in terminalreporter.stats.get(outcome, ()):
            for values in (value for name, value in getattr(report, "user_properties", ()) if name == "tool"):
                row = Row(**values)
                size = "" if row.difference is None else f"{row.difference:.1e}" if row.difference else "0"
                rows.append((row.tool, row.version, row.order, size, _verdict(outcome, report)))
    if len(rows) == 1:
        return
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    terminalreporter.section("FMUs in other tools")
    for cells in rows:
        terminalreporter.line(" | ".join(f"{cell:{width}}" for cell, width in zip(cells, widths, strict=True)).rstrip())
