"""The generated parts of the documentation: markers name what exists, figures are there, results replace old ones."""

import json
import re

import pytest
from typer.testing import CliRunner

from benchmarks import __main__ as command_line
from benchmarks import registry
from benchmarks.docs import MARKER, ROOT, MissingResult, known_fragments, markers, pages, write
from benchmarks.registry import Case, Table, registered
from benchmarks.text import command

IMAGE = re.compile(r"!\[[^\]]*\]\(([^)\s]+)\)")
PAGES = pages()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_marker_names_a_fragment_and_every_part_names_its_command(page):
    text = page.read_text(encoding="utf-8")
    assert set(markers(text)) <= known_fragments()
    for match in MARKER.finditer(text):
        name = match.group(2)
        entries = {"cases": CASES, "machine": []}.get(name, [name.removesuffix(".svg")])
        assert "`.venv/bin/python -m benchmarks run" in match.group(0)
        for entry in entries:
            assert command(entry) in match.group(0)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_figure_of_a_page_exists(page):
    wanted = IMAGE.findall(page.read_text(encoding="utf-8"))
    missing = [path for path in wanted if "://" not in path and not (page.parent / path).is_file()]
    assert not missing


CASES = [name for name, entry in registered().items() if isinstance(entry, Case)]


def test_every_case_and_table_is_shown_on_a_page():
    shown = {name.removesuffix(".svg") for page in PAGES for name in markers(page.read_text(encoding="utf-8"))}
    shown |= set(CASES) if "cases" in shown else set()
    assert not set(registered()) - shown


def test_no_figure_is_kept_that_no_page_shows():
    kept = {path.name for path in (ROOT / "docs" / "figures").glob("*.svg")}
    shown = {path.rpartition("/")[2] for page in PAGES for path in IMAGE.findall(page.read_text(encoding="utf-8"))}
    assert {name for name in kept if name.removesuffix(".svg") in registered()} <= shown


OPEN = "<!-- generated: python -m benchmarks docs {} -->"
PAGE = f"Before.\n\n{OPEN.format('v3_aero.stall')}\nold\n<!-- end -->\n\nAfter.\n"


@pytest.fixture
def root(tmp_path):
    """A documentation with one page and results for one table."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("No markers.\n")
    (tmp_path / "docs" / "page.md").write_text(PAGE)
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "v3_aero.stall.md").write_text("| new |\n")
    return tmp_path


def test_results_replace_what_stands_between_the_markers_and_nothing_else(root):
    changed = write(root / "results", root=root)
    assert [page.name for page in changed] == ["page.md"]
    text = (root / "docs" / "page.md").read_text()
    assert text == PAGE.replace("old\n", "\n| new |\n\n")
    assert not write(root / "results", root=root)  # once more changes nothing


def test_a_figure_is_copied_and_linked_from_where_the_page_stands(root):
    for name in (".svg", ".md"):
        (root / "results" / f"saddle.nodes{name}").write_text("<svg/>")
    part = f"{OPEN.format('saddle.nodes.svg')}\n<!-- end -->\n"
    for page, link in (("README.md", "docs/figures"), ("docs/page.md", "figures")):
        (root / page).write_text(part)
        write(root / "results", root=root)
        assert f"]({link}/saddle.nodes.svg)" in (root / page).read_text()
    assert (root / "docs" / "figures" / "saddle.nodes.svg").is_file()


def test_a_case_that_is_named_gets_a_new_section_among_those_of_all_cases(root):
    first, second, third = (registered()[name] for name in CASES[:3])
    page = "\n".join(
        [OPEN.format("cases"), "", *(f"## {case.title}\n\nold\n" for case in (first, second, third)), "<!-- end -->\n"]
    )
    (root / "docs" / "page.md").write_text(page)
    for name in (".svg", ".md"):
        (root / "results" / f"{second.name}{name}").write_text("new")
    assert write(root / "results", [second.name], root=root)
    text = (root / "docs" / "page.md").read_text()
    figure = f"![{second.title}](figures/{second.name}.svg)\n\nFigure: {second.title}; {command(second.name)}."
    assert text == page.replace(f"## {second.title}\n\nold\n", f"## {second.title}\n\n{figure}\n\nnew\n")
    assert (root / "docs" / "figures" / f"{second.name}.svg").read_text() == "new"
    (root / "docs" / "page.md").write_text(page.replace(second.title, "Another title"))
    with pytest.raises(MissingResult, match=f"no section of {second.name}"):
        write(root / "results", [second.name], root=root)


def test_a_missing_result_is_named_with_the_command_that_makes_it_and_no_page_is_touched(root):
    (root / "README.md").write_text(f"{OPEN.format('v3_aero.errors')}\nkept\n<!-- end -->\n")
    with pytest.raises(MissingResult, match=f"v3_aero.errors.md is missing; {command('v3_aero.errors')}"):
        write(root / "results", root=root)
    assert (root / "docs" / "page.md").read_text() == PAGE
    assert write(root / "results", ["v3_aero.stall"], root=root)  # asked for by name it needs no other


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (f"{OPEN.format('no.such')}\n<!-- end -->\n", "no.such, which the registry does not have"),
        (f"{OPEN.format('v3_aero.stall')}\nno end\n", "marker is not of the form"),
        (f"{OPEN.format('v3_aero.stall')}\n{PAGE}", "marker is not of the form"),
    ],
)
def test_a_marker_that_is_wrong_is_refused_with_the_page(root, text, sentence):
    (root / "docs" / "page.md").write_text(text)
    with pytest.raises(ValueError, match=rf"docs/page.md.*{re.escape(sentence)}"):
        write(root / "results", root=root)


def test_figures_of_a_quick_run_do_not_reach_the_pages(root):
    (root / "docs" / "page.md").write_text(f"{OPEN.format('machine')}\n<!-- end -->\n")
    (root / "results" / "machine.json").write_text(json.dumps({"quick": True}))
    with pytest.raises(MissingResult, match="quick run"):
        write(root / "results", root=root)


def test_the_command_line_lists_everything_and_refuses_what_there_is_not():
    listed = CliRunner().invoke(command_line.app, ["list"]).output
    assert all(name in listed for name in registered())
    for verb, sentence in (("run", "no case or table nonsense"), ("docs", "no case, table or part of a page nonsense")):
        refused = CliRunner().invoke(command_line.app, [verb, "nonsense"])
        assert refused.exit_code == 2
        assert f"there is {sentence}" in refused.output


def test_a_failure_is_the_exit_code_of_the_run(tmp_path, monkeypatch):
    def broken(quick):
        raise RuntimeError("not today")

    entries = [Table("sample.broken", "Broken", broken), Table("sample.good", "Good", lambda quick: "| fine |")]
    for names, code in ((["sample.broken", "sample.good"], 1), (["sample.good"], 0)):
        chosen = [entry for entry in entries if entry.name in names]
        monkeypatch.setattr(registry, "chosen", lambda _, chosen=chosen: chosen)
        done = CliRunner().invoke(command_line.app, ["run", "--out", str(tmp_path)])
        assert done.exit_code == code
        assert (tmp_path / "sample.good.md").is_file()
    assert not (tmp_path / "sample.broken.md").exists()
