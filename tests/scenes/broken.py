"""Copies of built-in scenes with one thing changed."""

import shutil
from pathlib import Path

import scenes

BUILT_IN = Path(scenes.__file__).resolve().parent


def copy_of(name, folder):
    """A copy of a built-in scene in `folder`, under its own name."""
    target = Path(folder) / name
    shutil.copytree(BUILT_IN / name, target)
    return target


def edited(scene, file, old, new):
    """Replace the first `old` of a file; the text must be there, so that a test cannot pass by missing its target."""
    path = scene / file
    text = path.read_text(encoding="utf-8")
    assert old in text, f"{old!r} is not in {file}"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def built(scene, settings=None):
    """The scene with its solver cores and everything that is read lazily; None for a side that it does not have."""
    loaded = scenes.load(scene, settings or {})
    cores = loaded.cores()
    return loaded, cores.get("structural"), cores.get("aero")
