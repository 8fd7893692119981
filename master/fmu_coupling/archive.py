"""What is wrong with an FMU as an archive, before anything of it is run: one sentence that names it and the remedy."""

import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.etree import ElementTree

from fmpy import sharedLibraryExtension

DESCRIPTION = "modelDescription.xml"
REALS = ("Real", "Float32", "Float64", "Clock")
WHOLE = ("Integer", "Enumeration", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64")
NUMBERS = ("min", "max", "nominal", "start")  # attributes of variables and types


def model_description(path: str | Path) -> ElementTree.Element:
    """The root of the model description of an FMU that is a sound archive, its numbers checked; else ValueError."""
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        _require_names(path, names)
        if archive.getinfo(DESCRIPTION).flag_bits & 0x1:
            raise ValueError(f"{path} is encrypted; pack it again without a password.")
        content = archive.read(DESCRIPTION)
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise ValueError(f"{path}: its {DESCRIPTION} is no XML ({error}); export or fetch the FMU again.") from None
    if root.tag != "fmiModelDescription":
        raise ValueError(
            f"{path}: its {DESCRIPTION} is no model description but a document <{root.tag}>; export or fetch the FMU "
            "again."
        )
    if root.get("fmiVersion") is None:
        raise ValueError(f"{path}: its {DESCRIPTION} has no fmiVersion; export the FMU again.")
    _require_numbers(path, root)
    return root


def _require_names(path: str | Path, names: Sequence[str]) -> None:
    """Refuse archives whose entries have other names than FMI gives them."""
    back = next((name for name in names if "\\" in name), None)
    if back is not None:
        raise ValueError(
            f"{path} has entries with backslashes, as {back}, and FMI separates folders by /; pack its content again "
            "with a tool that keeps to that."
        )
    if DESCRIPTION in names:
        return
    inner = next((name for name in names if name.rsplit("/", 1)[-1] == DESCRIPTION), None)
    if inner is None:
        other = next((name for name in names if name.casefold() == DESCRIPTION.casefold()), None)
        what = "is empty" if not names else f"calls its {DESCRIPTION} {other}" if other else f"has no {DESCRIPTION}"
        raise ValueError(f"{path} is no FMU: it {what}; export it again.")
    folder = inner[: -len(DESCRIPTION)]
    how = "entries that begin with ./" if folder == "./" else f"all its content in the folder {folder}"
    raise ValueError(
        f"{path} has {how}, and FMI wants {DESCRIPTION} at the top; pack what lies in that folder again, without the "
        "folder itself."
    )


def _require_numbers(path: str | Path, root: ElementTree.Element) -> None:
    """Refuse numbers that are none, as those with a decimal comma, by the name of the variable."""
    for variable in root.iterfind("ModelVariables/*"):
        name = variable.get("name", "")
        for element in (variable, *variable):
            of = f"its variable {name}"
            if element.get("valueReference") is not None:
                _require_number(path, of, "valueReference", element.get("valueReference", ""), int)
            _require_numbers_of(path, of, element, element.tag)
    for simple in root.iterfind("TypeDefinitions/*"):
        for element in (simple, *simple):
            _require_numbers_of(path, f"its type {simple.get('name')}", element, element.tag.removesuffix("Type"))
    for unit in root.iterfind("UnitDefinitions/Unit"):
        for element in unit:
            for key in ("factor", "offset"):
                if element.get(key) is not None:
                    _require_number(path, f"its unit {unit.get('name')}", key, element.get(key, ""), float)
    for experiment in root.iterfind("DefaultExperiment"):
        for key, text in experiment.attrib.items():
            _require_number(path, "its DefaultExperiment", key, text, float)


def _require_numbers_of(path: str | Path, of: str, element: ElementTree.Element, kind: str) -> None:
    make: Callable[[str], object] | None = float if kind in REALS else int if kind in WHOLE else None
    if make is None:
        return
    for key in NUMBERS:
        text = element.get(key)
        if text is not None:
            for part in text.split() if key == "start" else [text]:
                _require_number(path, of, key, part, make)


def _require_number(path: str | Path, of: str, key: str, text: str, make: Callable[[str], object]) -> None:
    try:
        make(text)
    except ValueError:
        point = text.replace(",", ".")
        what = "number" if make is float else "whole number"
        hint = f"write {point}" if point != text and re.fullmatch(r"[-+.\deE]+", point) else "export it again"
        raise ValueError(
            f"{path}: {of} has {key} = '{text}', which is no {what}; {hint} in its {DESCRIPTION}."
        ) from None


def require_library(path: str | Path, identifier: str | None, here: str) -> None:
    """ValueError where an FMU has no library of the name that its model identifier gives it for the platform `here`."""
    with zipfile.ZipFile(path) as archive:
        names = [name for name in archive.namelist() if not name.endswith("/")]
    if not identifier:
        raise ValueError(f"{path}: its {DESCRIPTION} has no modelIdentifier; export the FMU again.")
    built_for = sorted({name.split("/")[1] for name in names if re.match("binaries/[^/]+/.", name)})
    if here not in built_for:
        if not built_for and any(name.startswith("sources/") for name in names):
            raise ValueError(
                f"{path} holds sources only and no library for {here}; compile it, for instance by `fmpy compile "
                f"{path}`."
            )
        what = ", ".join(built_for) or "no platform"
        raise ValueError(f"{path} is built for {what}, not for {here}; export it for this platform.")
    wanted = f"{identifier}{sharedLibraryExtension}"
    found = [name.rsplit("/", 1)[1] for name in names if name.startswith(f"binaries/{here}/")]
    if wanted not in found:
        libraries = [name for name in found if name.endswith(sharedLibraryExtension)] or found
        raise ValueError(
            f"{path}: its binaries/{here} holds {', '.join(sorted(libraries))}, and not {wanted}, which its "
            f"modelIdentifier asks for; rename the library in the archive, or export the FMU again."
        )
