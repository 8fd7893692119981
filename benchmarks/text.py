"""Markdown: tables, and the fragments that the documentation shows of cases and tables."""

import math

from .harness import COLUMNS, columns_of, exponents
from .registry import Case, Multiples

LONG = 60  # rows; a longer table is folded away
PYTHON = ".venv/bin/python"  # as commands on the pages are to be typed


def table(names, rows):
    """Lines of a markdown table; numbers with four digits."""
    out = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    return out + ["| " + " | ".join(cell(c) for c in row) + " |" for row in rows]


def cell(value):
    """A cell: text as it is, numbers with four significant digits, an empty one for what is undefined."""
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.4g}"
    return str(value)


def lines(rows, *sentences):
    """Markdown of a table and sentences below it, a paragraph each."""
    return "\n".join([*rows, *(part for sentence in sentences if sentence for part in ("", sentence))])


def command(name):
    """How to make an entry, as a line of markdown."""
    return f"`{PYTHON} -m benchmarks run {name}`"


def error_label(case: Case):
    """What the error is, with its unit where it has one."""
    return case.error if case.unit == "1" else f"{case.error}, {case.unit}"


def case_fragment(case: Case, rows):
    """What the documentation shows of a case beside its figure: what was varied and compared, the table, exponents."""
    own = [c for c in columns_of(rows) if c not in COLUMNS]
    several = len(case.series) > 1
    ratio = any(not math.isnan(r["time_ratio"]) for r in rows)
    statuses = {r["status"] for r in rows} != {"converged"}
    head = [*(["series"] if several else []), case.knob, *(["status"] if statuses else [])]
    head += [error_label(case), "time, ms", *([f"time / {case.ratio_to}"] if ratio else [])]
    head += ["memory, MB"] if case.memory else []
    head += [case.labels.get(c, c) for c in own]
    body = []
    for r in rows:
        row = [*([r["series"]] if several else []), cell(r["value"]), *([r["status"]] if statuses else [])]
        row += [f"{r['error']:.2e}", 1e3 * r["time_s"], *([r["time_ratio"]] if ratio else [])]
        row += [f"{r['memory_MB']:.1f}"] if case.memory else []
        body.append(row + [r.get(c, math.nan) for c in own])
    found = [f"{p:.2f} ({s})" if s else f"{p:.2f}" for s, p in exponents(case, rows).items()]
    if len(found) > 1 and len({text.partition(" ")[0] for text in found}) == 1:
        found = [f"{found[0].partition(' ')[0]} in every series"]
    fit = ""
    if found and case.fit:
        since = f" from {case.fit.least:g}" if case.fit.least else ""
        fit = f"Fitted exponents, {case.fit.law}^p{since}: {', '.join(found)}."
    told = f"Varied: {case.knob}. Error: {error_label(case)}. Reference: {case.reference}."
    rows_of = "\n".join(table(head, body))
    if len(rows) > LONG:
        rows_of = f"<details><summary>{len(rows)} points</summary>\n\n{rows_of}\n\n</details>"
    parts = told, rows_of, fit, _slowest(case, rows), case.note
    return "\n\n".join(part for part in parts if part)


def _slowest(case, rows):
    if not isinstance(case.plot, Multiples):
        return ""
    slow = max(rows, key=lambda r: r["time_s"])
    count = sum(r["status"] == "converged" for r in rows)
    return (
        f"{count} of {len(rows)} points converged; the slowest point took {1e3 * slow['time_s']:.0f} ms "
        f"({case.knob} = {slow['value']:g}, {slow['series']}, {slow['status']})."
    )
