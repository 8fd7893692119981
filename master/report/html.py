"""HTML pages that need no other file, from the templates of this package and of others."""

import base64
from collections.abc import Mapping
from importlib.resources import files
from typing import Any


def html(package: str, template: str, figures: Mapping[str, tuple[str, bytes]], **values: Any) -> str:
    """A page from a template file of a package, which may import the macros of parts.html.

    `figures` maps names to captions and SVG files; the template gets them embedded, and the `values` by their names.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    def source(name: str, of: str = "master.report") -> str:
        return files(of).joinpath(name).read_text(encoding="utf-8")

    embedded = [
        {"name": name, "caption": caption, "data": base64.b64encode(svg).decode("ascii")}
        for name, (caption, svg) in figures.items()
    ]
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, loader=FunctionLoader(source)
    )
    return environment.from_string(source(template, package)).render(figures=embedded, **values)
