"""The scene that an FMU carries: JSON and npz in its resources, with the values of parameters that it starts from."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from interface import records
from scenes import Scene

LAYOUT = 1  # of these files
JSON, NPZ = "scene.json", "scene.npz"


def scene_files(scene: Scene, side: str, parameters: Mapping[str, Any]) -> dict[str, bytes]:
    """Name -> content of the files of one side of a scene and of the start values of parameters."""
    tree, arrays = records.packed(scene.carried(side))
    content = {"layout": LAYOUT, "parameters": dict(parameters), "scene": tree}
    return {JSON: json.dumps(content, separators=(",", ":")).encode(), NPZ: records.npz(arrays)}


def read_scene(resources: Path) -> tuple[Scene, dict[str, Any]]:
    """The scene of an FMU's resources and start values of parameters; ValueError in one sentence where they are not of
    the layout that is read here.
    """
    content = json.loads((resources / JSON).read_text(encoding="utf-8"))
    layout = content.get("layout") if isinstance(content, dict) else None
    if layout != LAYOUT:
        raise ValueError(f"{JSON} has the layout {layout}; this FMU reads {LAYOUT}: build it anew.")
    try:
        scene = records.unpacked(content["scene"], records.from_npz((resources / NPZ).read_bytes()))
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise ValueError(f"{JSON} and {NPZ} hold no scene ({error}); build the FMU anew.") from None
    return scene, content["parameters"]
