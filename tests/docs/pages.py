"""Pages as tests see them: their code blocks, the files that they give, and the output that they promise.

A block is fenced. A line `` `folder/file` `` right above a block makes it the content of that file. A `text` block is
the output of the `python` or `sh` block before it; a line `...` in it stands for any lines.
"""

import contextlib
import io
import os
import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

from typer.testing import CliRunner

DOCS = Path(__file__).parents[2] / "docs"
UPDATE = "UPDATE_DOCS"  # set to 1, the tests write what the blocks print into the pages instead of comparing

_FENCE = re.compile(r"^(?:`(?P<file>[\w./-]+)`\n+)?```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
_HEADING = re.compile(r"^## (.*)$", re.MULTILINE)
_NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?|nan|inf")


@dataclass(frozen=True)
class Block:
    """A fenced block: its kind, its text, the file that it gives if any, where its text stands in the page, and the
    heading of the second level above it."""

    kind: str
    text: str
    file: str | None
    span: tuple[int, int]
    line: int
    section: str


def blocks(page):
    """The fenced blocks of a page in their order."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            m["kind"],
            m["text"],
            m["file"],
            m.span("text"),
            text[: m.start("kind")].count("\n") + 1,
            "".join(_HEADING.findall(text[: m.start()])[-1:]),
        )
        for m in _FENCE.finditer(text)
    ]


def give_files(page, folder):
    """Write the files that a page gives below `folder`."""
    for block in blocks(page):
        if block.file is not None:
            path = folder / block.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")


@dataclass
class Session:
    """Runs the blocks of one page: `python` in one namespace, `sh` through the command line of this project."""

    page: Path
    namespace: dict = field(default_factory=dict)

    def output(self, block):
        """What a block prints."""
        return self._python(block) if block.kind == "python" else "".join(map(self._command, block.text.splitlines()))

    def _python(self, block):
        printed = io.StringIO()
        padded = "\n" * block.line + block.text  # so that a traceback names the line of the page
        with contextlib.redirect_stdout(printed):
            exec(compile(padded, str(self.page), "exec"), self.namespace)
        return printed.getvalue()

    @staticmethod
    def _command(line):
        from master.cli import app

        words = shlex.split(line, comments=True)
        if not words:
            return ""
        program, *arguments = words
        if Path(program).name != "kitecosim":
            raise ValueError(f"only kitecosim can be run, not {program!r}")
        return CliRunner().invoke(app, arguments).output


def differences(promised, printed):
    """Lines of the promised output that the printed one lacks, in order; else what it has beyond them.

    A number may be off by one in its last place and by 1 %: what other processors and library versions do to
    figures that end an iteration is far smaller, and what would mislead a reader is larger.
    """
    lacking, rest = [], [line.rstrip() for line in printed.splitlines() if line.strip()]
    gap = False
    for line in (line.rstrip() for line in promised.splitlines() if line.strip()):
        if line.strip() == "...":
            gap = True
            continue
        candidates = range(len(rest)) if gap else range(min(1, len(rest)))
        found = next((i for i in candidates if _alike(line, rest[i])), None)
        if found is None:
            lacking.append(line)
            continue
        rest, gap = rest[found + 1 :], False
    return lacking if gap or lacking else rest  # more output than promised is a difference too


def _alike(promised, printed):
    if _words(promised) != _words(printed):
        return False
    pairs = zip(_NUMBER.findall(promised), _NUMBER.findall(printed), strict=True)
    return all(a == b or abs(float(a) - float(b)) <= _slack(a) for a, b in pairs)


def _words(line):
    return re.sub(r"[\s─━┌┐└┘│]+", " ", _NUMBER.sub("#", line)).strip()


def _slack(number):
    digits, _, exponent = number.lower().partition("e")
    place = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    return 1.01 * place + 0.01 * abs(float(number))


def checked(page, session=None, section=None):
    """Run all blocks of a page, or of a section of it, in order in the working directory or in a session; what the text
    blocks promise and do not get.

    Where `UPDATE_DOCS` is set, the text blocks without gaps are replaced by what was printed.
    """
    session, wrong, printed, new = session or Session(page), [], None, []
    for block in blocks(page):
        if section not in (None, block.section):
            continue
        if block.file is None and block.kind in ("python", "sh"):
            printed = session.output(block)
        elif block.kind == "text" and printed is not None:
            if lacking := differences(block.text, printed):
                wrong.append(f"{page.name} line {block.line}: differs at {lacking[0]!r}; printed was:\n{printed}")
                new.append((block.span, printed))
            printed = None
    if os.environ.get(UPDATE) == "1":
        text = page.read_text(encoding="utf-8")
        for (start, stop), output in reversed(new):
            if "..." not in text[start:stop]:
                text = text[:start] + "\n".join(line.rstrip() for line in output.splitlines()) + "\n" + text[stop:]
        page.write_text(text, encoding="utf-8")
    return wrong
