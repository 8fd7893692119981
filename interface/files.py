"""What may be read: regular files only, and names that every table, page and description can hold."""

import stat
import unicodedata
from pathlib import Path

KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}
FORMULA = "=+-@"  # beginnings that a spreadsheet takes for a formula


def irregular(path: str | Path) -> str:
    """What a path leads to if that is no regular file, "" where it is one or where there is none: a pipe may never
    end, and a device may be anything.
    """
    try:
        return KINDS.get(stat.S_IFMT(Path(path).stat().st_mode), "")
    except (OSError, ValueError):
        return ""


def unprintable(text: str) -> str:
    """The first character of a text that XML, CSV or a terminal cannot show, as Python writes it, "" without one."""
    bad = (c for c in text if unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp") or c in "\ufffe\uffff")
    return next((repr(c)[1:-1] for c in bad), "")


def misnamed(name: str) -> str:
    """Why a text cannot be a name in tables, "" where it can."""
    if bad := unprintable(name):
        return f"has the control character {bad}"
    return f"begins with {name[0]}, which spreadsheets take for a formula" if name[:1] and name[0] in FORMULA else ""
