"""The page compare.html: tables, plots and every setting of a comparison in one file that needs no other."""

from collections.abc import Mapping, Sequence
from typing import Any

from master.report.page import cell, html
from master.studies.tables import (
    HEADER,
    LEGEND,
    WORDS,
    cases,
    equilibrium,
    fewest,
    matrix,
    matrix_legend,
    shown,
    texts,
)

OPTIONS = ("backend", "tolerance", "force_tolerance", "max_iterations", "stop_time", "step", "repeat")


def page(rows: Sequence[dict[str, Any]], figures: Mapping[str, tuple[str, bytes]]) -> str:
    """The HTML text; `figures` maps names to captions and SVG files."""
    groups = cases(rows)
    keys = shown(rows)
    head, body = matrix(rows)
    header, *lines = zip(head, *body, strict=True)  # a row a scheme here, since schemes may be many
    return html(
        "master.studies",
        "compare.html",
        figures,
        findings=[f"{case}: {finding(members)}" for case, members in groups.items()],
        overview_header=["scheme", *header[1:]],
        overview=[
            [(text, False) for text in line[:1]] + [(text, "/" not in text) for text in line[1:]] for line in lines
        ],
        overview_legend=matrix_legend(rows),
        header=[(HEADER[key], key not in WORDS) for key in keys],
        tables={case: [_row(row, keys) for row in members] for case, members in groups.items()},
        legend=[(HEADER[key], LEGEND[HEADER[key]]) for key in keys if HEADER[key] in LEGEND],
        failed=[(f"{row['case']}, {row['label']}", row["message"]) for row in rows if row["status"] != "converged"],
        settings=_settings(rows),
    )


def finding(members: Sequence[dict[str, Any]]) -> str:
    """One sentence: how many converged, which one with the fewest iterations, and whether to one equilibrium."""
    good = [row for row in members if row["status"] == "converged"]
    if not good:
        return f"none of {len(members)} converged."
    least = fewest(members)
    best = [r["label"] for r in good if r["coupling_iterations"] == least and r["equilibrium"] == 1]
    names = ", ".join(best[:3]) + (f" and {len(best) - 3} more" if len(best) > 3 else "")
    text = f"{len(good)} of {len(members)} converged; fewest coupling iterations: {least} ({names})."
    others = [f"{row['label']}: {equilibrium(row)}" for row in good if row["equilibrium"] > 1]
    what = (
        "Another equilibrium was found by" if good[0]["communication_steps"] is None else "Another end was reached by"
    )
    return text + (f" {what} {'; '.join(others)}." if others else "")


def _row(row: dict[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    of = texts(row)
    bad = row["status"] != "converged" or row["equilibrium"] > 1
    return {"marked": bad, "cells": [(of[key], key not in WORDS) for key in keys]}


def _settings(rows: Sequence[dict[str, Any]]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Title and (name, value) pairs: what all cells share, then what is of each scheme and of each case."""
    out = [("All cells", [(name, cell(rows[0][name])[0]) for name in OPTIONS])]
    out[0][1].extend((k, str(v)) for k, v in rows[0].items() if k.startswith("version."))
    for label, row in {row["label"]: row for row in rows}.items():
        parameters = [(k, cell(v)[0]) for k, v in row.items() if k.startswith("scheme.")]
        out.append((f"Scheme {label}", parameters or [("parameters", "none")]))
    for case, members in cases(rows).items():
        row = next((r for r in members if r["coupling_iterations"] is not None), members[0])
        sides = ("given.", "scene.", "structural.", "aero.")
        entries = [(k, cell(v)[0]) for k, v in row.items() if k.startswith(sides)]
        out.append((f"Scene {case}", [*entries, ("digest", row["digest"])]))
    return out
