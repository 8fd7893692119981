"""What follows from values, kept as long as these are the same arrays."""

from collections.abc import Callable
from typing import Any


class Remembered:
    """One thing made from arrays, made anew when one of them is another array; values are never changed in place."""

    def __init__(self, make: Callable[..., Any]):
        self._make = make
        self._of: tuple[Any, ...] | None = None
        self._made: Any = None

    def __call__(self, *of: Any) -> Any:
        known = self._of
        if known is None or len(known) != len(of) or any(a is not b for a, b in zip(known, of, strict=True)):
            self._made, self._of = self._make(*of), of
        return self._made
