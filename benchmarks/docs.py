"""Puts the results of runs into the documentation, between markers, and their figures into docs/figures.

    <!-- generated: python -m benchmarks docs v3_aero.strips -->
    ...
    <!-- end -->

names a fragment: an entry of the registry (its table), `ENTRY.svg` (its figure), `cases` (a section for every case) or
`machine`. What stands between the markers is replaced, everything else is left alone.
"""

import json
import os
import re
import shutil
from pathlib import Path

from .registry import Case, matches, registered
from .text import PYTHON, command

ROOT = Path(__file__).resolve().parents[1]
MARKER = re.compile(r"(<!-- generated: python -m benchmarks docs (\S+) -->\n).*?(<!-- end -->)", re.DOTALL)
OPENING = re.compile(r"<!-- generated:[^\n]*")


class MissingResult(ValueError):
    """A fragment that a page asks for has not been made; the sentence says how to make it."""


def pages(root=ROOT):
    """The pages that may contain generated parts."""
    return [root / "README.md", *sorted((root / "docs").rglob("*.md"))]


def known_fragments():
    """Names that a marker may carry."""
    entries = registered()
    figures = [f"{name}.svg" for name, entry in entries.items() if isinstance(entry, Case) or entry.draw]
    return {*entries, *figures, "cases", "machine"}


def markers(text):
    """Names of the fragments that a page asks for; ValueError where a marker is malformed or not closed."""
    found = [m.group(2) for m in MARKER.finditer(text)]
    swallowed = any(OPENING.search(m.group(0), 1) for m in MARKER.finditer(text))
    if swallowed or len(found) != len(OPENING.findall(text)):
        form = "`<!-- generated: python -m benchmarks docs NAME -->`, a line of its own, up to `<!-- end -->`"
        raise ValueError(f"a marker is not of the form {form}.")
    return found


def write(results: Path, names=(), root=ROOT):
    """Replace the generated parts of all pages, or those of `names`; the pages that changed.

    Nothing is written unless every fragment is there.
    """
    for name in names:
        if not any(matches(part, name) for part in known_fragments()):
            raise ValueError(
                f"there is no case, table or part of a page {name}; `{PYTHON} -m benchmarks list` shows them."
            )
    new = {}
    for page in pages(root):
        text = page.read_text(encoding="utf-8")
        try:
            asked = markers(text)
        except ValueError as error:
            raise ValueError(f"{page.relative_to(root)}: {error}") from None
        unknown = sorted(set(asked) - known_fragments())
        if unknown:
            raise ValueError(f"{page.relative_to(root)} asks for {unknown[0]}, which the registry does not have.")
        figures = Path(os.path.relpath(root / "docs" / "figures", page.parent)).as_posix()

        def part(m, figures=figures):
            if names and not any(matches(m.group(2), name) for name in names):
                return _cases(m.group(0), names, results, root, figures) if m.group(2) == "cases" else m.group(0)
            return f"{m.group(1)}\n{fragment(m.group(2), results, root, figures)}\n\n{m.group(3)}"

        new[page] = text, MARKER.sub(part, text)
    for page, (_, text) in new.items():
        page.write_text(text, encoding="utf-8")
    return [page for page, (old, text) in new.items() if old != text]


def fragment(name, results: Path, root=ROOT, figures="figures"):
    """Markdown of a fragment from the results; its figure is copied to docs/figures."""
    if name == "machine":
        return _machine(results)
    if name == "cases":
        cases = [e for e in registered().values() if isinstance(e, Case)]
        return "\n\n".join(_section(case, results, root, figures) for case in cases)
    if name.endswith(".svg"):
        return _figure(registered()[name.removesuffix(".svg")], results, root, figures)
    return _read(results / f"{name}.md", name).strip()


def _cases(part, names, results, root, figures):
    """The part `cases` with new sections of the cases that are named, and the others as they are."""
    for case in (e for e in registered().values() if isinstance(e, Case) and any(matches(e.name, n) for n in names)):
        old = re.compile(rf"^## {re.escape(case.title)}\n.*?(?=^## |^<!-- end -->)", re.DOTALL | re.MULTILINE)
        if not old.search(part):
            raise MissingResult(f"the part cases has no section of {case.name}; write all of it: name `cases`.")
        new = f"{_section(case, results, root, figures)}\n\n"
        part = old.sub(lambda _, new=new: new, part)
    return part


def _section(case, results, root, figures):
    table = fragment(case.name, results, root, figures)
    return f"## {case.title}\n\n{_figure(case, results, root, figures)}\n\n{table}"


def _figure(case, results, root, figures):
    source = results / f"{case.name}.svg"
    _read(source, case.name)
    (root / "docs" / "figures").mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, root / "docs" / "figures" / source.name)
    return f"![{case.title}]({figures}/{source.name})\n\nFigure: {case.title}; {command(case.name)}."


def _read(path, name):
    if not path.is_file():
        raise MissingResult(f"{path} is missing; {command(name)} makes it.")
    return path.read_text(encoding="utf-8")


def _machine(results):
    found = json.loads(_read(results / "machine.json", ""))
    if found["quick"]:
        raise MissingResult(f"{results} is from a quick run; `{PYTHON} -m benchmarks run` makes what the pages show.")
    threads = ", ".join(f"{name}={value}" for name, value in found["threads"].items())
    versions = ", ".join(f"{name} {found[name]}" for name in ("python", "numpy", "scipy", "fmpy", "pythonfmu"))
    return (
        f"Machine of these figures: {found['processor']}, {found['cores']} cores, {found['system']}; {versions}; "
        f"{threads}. `{PYTHON} -m benchmarks run`"
    )
