"""Checked reading of tables of a TOML file: every refusal is one sentence that names file, table, key and remedy."""

import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from interface import irregular


def toml_content(path: Path, what: str) -> dict[str, Any]:
    """The content of a TOML file; ValueError in one sentence, with the line of a mistake, if it cannot be read."""
    if other := irregular(path):
        raise ValueError(f"{path} is {other}; name a TOML file that describes {what}.")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"there is no file {path}; name a TOML file that describes {what}.") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({(error.strerror or str(error)).lower()}).") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not text in UTF-8; name a TOML file that describes {what}.") from None
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: this is not TOML: {error}.") from None


def nearest(name: str, known: Iterable[str], noun: str = "it has") -> str:
    """What to write instead of an unknown name: those that look like it, else what there is."""
    known = list(known)
    folded = {k.casefold(): k for k in reversed(known)}
    close = [folded[k] for k in difflib.get_close_matches(name.casefold(), list(folded), 3, 0.6)]
    if close:
        return f"did you mean {' or '.join(close)}?"
    more = f" and {len(known) - 12} more" if len(known) > 12 else ""
    return f"{noun}: {', '.join(known[:12]) or 'none'}{more}."


def one_valued(pairs: Iterable[tuple[float, float]]) -> dict[float, float]:
    """Pairs (sent, arriving) as a table; ValueError, without a full stop, where one value would arrive as two."""
    table: dict[float, float] = {}
    for sent, arriving in pairs:
        if table.setdefault(sent, arriving) != arriving:
            raise ValueError(f"it has {sent:g} twice, with {table[sent]:g} and {arriving:g}; leave one of them")
    return table


class Table:
    """A table of a file under its name there, as [time]; `file` is what messages call the file."""

    def __init__(self, file: str, name: str, content: Any) -> None:
        self.file, self.name = file, name
        if not isinstance(content, Mapping):
            raise self.wrong(f"must be a table, not {content!r}.")
        self.content: dict[str, Any] = dict(content)

    def wrong(self, sentence: str) -> ValueError:
        """The refusal of the table, in one sentence."""
        return ValueError(f"{self.file}: {self.name + ' ' if self.name else ''}{sentence}")

    def refused(self, key: str, sentence: str) -> ValueError:
        """The refusal of a key, in one sentence."""
        return ValueError(f"{self.file}: {self.name + ' ' if self.name else ''}{key} {sentence}")

    def require_only(self, *known: str) -> None:
        """Refuse keys that are not among the known ones."""
        for key in self.content:
            if key not in known:
                raise self.wrong(f"knows no key '{key}'; {nearest(key, known)}")

    def table(self, key: str) -> "Table":
        """A table within; an empty one if it is not there."""
        name = self.name[1:-1]
        return Table(self.file, f"[{name}.{key}]" if name else f"[{key}]", self.content.get(key, {}))

    def tables(self, key: str) -> list["Table"]:
        """An array of tables; each is known by its number from 1."""
        listed = self.content.get(key, [])
        if not isinstance(listed, list):
            raise self.refused(key, f"must be tables, each headed [[{key}]].")
        return [Table(self.file, f"[[{key}]] {number}:", entry) for number, entry in enumerate(listed, 1)]

    def text(self, key: str, default: str | None = None, options: Iterable[str] = ()) -> str:
        """A text, one of the options where there are any; without a default it has to be there."""
        value = self._given(key, default)
        if not isinstance(value, str) or not value:
            raise self.refused(key, f"must be a text in quotes, not {value!r}.")
        options = list(options)
        if options and value not in options:
            raise self.refused(key, f"is '{value}', which there is not; choose one of: {', '.join(options)}.")
        return value

    def number(self, key: str, default: float | None = None, positive: bool = False) -> float:
        """A finite number, above zero if `positive`; without a default it has to be there."""
        value = self._given(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise self.refused(key, f"must be a number, not {value!r}.")
        if positive and not value > 0.0:
            raise self.refused(key, f"must be above zero, not {value}.")
        return float(value)

    def factor(self, key: str = "factor") -> float:
        """A number other than zero, 1 where there is none."""
        value = self.number(key, 1.0)
        if value == 0.0:
            raise self.refused(key, "must not be zero, as nothing would arrive; leave it out for 1.")
        return value

    def whole(self, key: str, default: int, least: int = 1) -> int:
        """A whole number of at least `least`."""
        value = self._given(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise self.refused(key, f"must be a whole number of at least {least}, not {value!r}.")
        return value

    def boolean(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self._given(key, default)
        if not isinstance(value, bool):
            raise self.refused(key, f"must be true or false, not {value!r}.")
        return value

    def texts(self, key: str, default: Iterable[str] = ()) -> list[str]:
        """A list of texts."""
        value = self.content.get(key, list(default))
        if not isinstance(value, list) or not all(isinstance(v, str) and v for v in value):
            raise self.refused(key, f"must be a list of names in quotes, not {value!r}.")
        return value

    def _given(self, key: str, default: Any) -> Any:
        value = self.content.get(key, default)
        if value is None:
            raise self.wrong(f"lacks {key}; give it.")
        return value
