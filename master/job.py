"""A run of a scene that is asked for on the command line."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from master.restart import NO_FILES, Files


@dataclass(frozen=True, eq=False)
class Job:
    """A run that is asked for: the `scene`, `given` parameters, `choices` of the command line, the folder `out`, the
    checkpoints, the texts `assigned` on the command line, and what a restart has `kept` besides.
    """

    scene: Any
    given: dict[str, Any]
    choices: dict[str, Any]
    out: Path
    files: Files = NO_FILES
    assigned: dict[str, str] = field(default_factory=dict)
    kept: list[str] = field(default_factory=list)

    @property
    def about(self) -> dict[str, Any]:
        """What a checkpoint says of the run."""
        scene = {"scene": self.scene.name, "scene_settings": self.scene.settings}
        return {**scene, "parameters": _plain(self.given), **self.choices}

    def clear(self, names: Iterable[str]) -> None:
        """Remove files of these names, and FMUs that this run has not built: what stands in the folder is never of an
        earlier run. Called when all input is known to be good.
        """
        for name in names:
            (self.out / name).unlink(missing_ok=True)
        for side in ("structural", "aero") if self.choices["backend"] == "in-process" else ():
            (self.out / "fmus" / f"{self.scene.name}_{side}.fmu").unlink(missing_ok=True)

    @property
    def remembered(self) -> list[str]:
        """A remark on what a restart has from its checkpoint."""
        return [f"as in the checkpoint: {', '.join(self.kept)}"] if self.kept else []


def _plain(given: dict[str, Any]) -> dict[str, Any]:
    """Parameters as numbers and lists, to be compared and written."""
    return {name: np.asarray(value, dtype=float).tolist() for name, value in given.items()}
