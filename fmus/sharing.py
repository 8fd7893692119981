"""The packages that every FMU carries, and how the FMUs of one process share them."""

import importlib
import sys
from pathlib import Path

import scenes

PACKAGES = ("structural", "aero", "scenes", "fmus")  # what an FMU carries


def share_modules(resources: Path) -> None:
    """Load the packages from one place, let them find their modules later too, and leave the search path as it was.

    A process has each package once, from an installation or from the first FMU that needed it. The folder of that FMU
    may be deleted before the last module is imported: this FMU's folder and an installation are places to look in then.
    """
    origin = str(Path(scenes.__file__).parents[1])  # the solvers come from where the scenes come from
    sys.path.insert(0, origin)
    packages = [importlib.import_module(name) for name in (*PACKAGES, "pythonfmu")]
    sys.path.remove(origin)
    if str(resources) in sys.path:
        sys.path.remove(str(resources))
    for package in packages:
        name = package.__name__
        found = (finder.find_spec(name, None) for finder in sys.meta_path if hasattr(finder, "find_spec"))
        installed = next((spec.submodule_search_locations or [] for spec in found if spec), [])
        places = dict.fromkeys([*package.__path__, str(resources / name), *installed])
        package.__path__ = [place for place in places if Path(place).is_dir()]
