"""The files of an SSP: unpacked, found by the URIs in them, read as XML. Refusals are one sentence with the file."""

import re
import zipfile
import zlib
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

from interface import irregular
from master.coupling.participants.fmu import LARGEST
from master.coupling.participants.private_folder import PrivateFolder

STRUCTURE = "SystemStructure.ssd"
SSP = re.compile(r"\{http://ssp-standard\.org/SSP1/\w+\}(\w+)")


class Files:
    """The unpacked files of the SSP `file`, in `folder`; they are there until `close`, or as long as this object."""

    def __init__(self, file: str | Path) -> None:
        self.file = str(file)
        if other := irregular(file):
            raise ValueError(f"{file} is {other}; name a package (.ssp).")
        if not Path(file).exists():
            raise ValueError(f"there is no file {file}; name a package (.ssp).")
        self._private = PrivateFolder()
        self.folder = self._private.path
        try:
            self._unpack()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Remove the unpacked files; once is enough."""
        self._private.close()

    def refused(self, sentence: str) -> ValueError:
        """The refusal of what is in the package; its folder is not named."""
        return ValueError(f"{self.file}: {sentence}".replace(f"{self.folder}/", ""))

    def _unpack(self) -> None:
        try:
            with zipfile.ZipFile(self.file) as archive:
                self._require_fit(archive.infolist())
                archive.extractall(self.folder)
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
            raise self.refused(f"is no whole zip archive ({str(error).rstrip('.')}); export it again.") from None
        except RuntimeError as error:  # zipfile has no other word for it
            raise self.refused(f"cannot be unpacked ({str(error).rstrip('.')}); store it without a password.") from None
        except OSError as error:
            why = (error.strerror or str(error)).lower()
            raise self.refused(f"cannot be unpacked in {self.folder} ({why}).") from None

    def _require_fit(self, entries: list[zipfile.ZipInfo]) -> None:
        names = [entry.orig_filename for entry in entries]
        for name in names:
            if "\\" in name:
                raise self.refused(f"has the entry {name!r}, with a backslash; zip it with / between folders.")
            if name.startswith("/") or ".." in PurePosixPath(name).parts:
                raise self.refused(f"has the entry {name!r}, which leads out of the package; zip it anew.")
        size = sum(entry.file_size for entry in entries)
        if size > LARGEST:
            raise self.refused(f"takes {size / 2**30:.3g} GiB unpacked, more than {LARGEST / 2**30:g}.")
        plain = [str(PurePosixPath(name)) for name in names]
        if STRUCTURE not in plain:
            inside = next((name for name in plain if name.endswith(f"/{STRUCTURE}")), None)
            others = [name for name in plain if name.endswith(".ssd")]
            what = f"it has {inside}: zip the content of that folder, not the folder" if inside else (
                f"it has {', '.join(others)}" if others else "is it a package of SSP?"
            )  # fmt: skip
            raise self.refused(f"has no {STRUCTURE} at its top; {what.rstrip('.')}{'' if what.endswith('?') else '.'}")

    def xml(self, name: str, wanted: str) -> ElementTree.Element:
        """The root of a file, which must be a `wanted` of SSP 1."""
        try:
            root = ElementTree.parse(self.folder / name).getroot()
        except ElementTree.ParseError as error:
            raise self.refused(f"{name} is no XML: {error}.") from None
        except (OSError, ValueError, LookupError) as error:
            raise self.refused(f"{name} cannot be read ({error}).") from None
        self.require(root, wanted, name)
        return root

    def require(self, root: ElementTree.Element, wanted: str, name: str) -> None:
        """Refuse what is not a `wanted` of SSP 1."""
        if local(root) != wanted:
            raise self.refused(f"{name} holds {root.tag!r} and not a {wanted} of SSP 1.0; export it as that.")
        version = root.get("version", "")
        if not version.startswith("1."):
            raise self.refused(
                f"{name} is of version {version or '(none)'} of SSP, and 1.0 is read; export it as that."
            )

    def found(self, source: str, what: str) -> str:
        """The name of a file that a URI leads to, relative to the package."""
        try:
            parts = urlsplit(source)
        except ValueError:
            raise self.refused(f"{what} has the source '{source}', which is no URI; correct it.") from None
        if parts.scheme or parts.netloc:
            raise self.refused(
                f"{what} has the source '{source}', and only files of the package are read; put it there."
            )
        if parts.fragment or not parts.path:
            raise self.refused(
                f"{what} has the source '{source}', and references to a part of a file are not supported."
            )
        path = PurePosixPath(unquote(parts.path))
        if "\0" in str(path):
            raise self.refused(f"{what} has the source '{source}', which names no file; correct it.")
        if path.is_absolute() or ".." in path.parts:
            raise self.refused(f"{what} has the source '{source}', which leads out of the package; put it there.")
        if not (self.folder / path).is_file():
            raise self.refused(f"{what} has the source '{source}', which the package does not hold.")
        return str(path)


def local(element: ElementTree.Element) -> str:
    """The name of an element of SSP 1 without its namespace; "" for those of others."""
    match = SSP.fullmatch(element.tag) if isinstance(element.tag, str) else None
    return match[1] if match else ""
