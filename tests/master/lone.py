"""A scene folder with particles and nothing else: neither wing nor wind, so that its interface has no node."""

import re
import shutil
from pathlib import Path

import scenes


def lone_scene(folder):
    """The tether of `tether_in_wind` without its wind but with weight, in a folder; its path."""
    path = shutil.copytree(Path(scenes.__file__).parent / "tether_in_wind", Path(folder) / "lone")
    toml = path / "scene.toml"
    text = re.sub(r"(?ms)^\[(aero|settings\.line_drag|settings\.line_area)\]\n.*?(?=^\[|\Z)", "", toml.read_text())
    toml.write_text(text.replace("gravity = 0.0", "gravity = 9.81"))
    return path
