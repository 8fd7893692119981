"""A host in plain C couples the pair: same values, states that come back, refusals, threads, and a clean exit."""

import os
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import fmpy
import numpy as np
import pytest

from fmus.builder import front_binary
from tests.interop import reference
from tests.interop.conftest import program

SOURCES = [Path(__file__).parent / "host" / name for name in ("host.c", "wiring.c")]
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1"]
TUNED = 12.5  # m/s, set before the last two steps


def environments():
    """Name -> environment of a host, each from nothing: how it finds Python."""
    folder = Path(sys.executable).parent
    path = {"PATH": os.defpath, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    printed = {
        option: dict(re.findall(r"^export (\w+)=(?:'(.*)'|\S*)$", "", re.MULTILINE)) for option in ("", "--preload")
    }
    del printed
    return {
        "python3 in PATH": {**path, "PATH": f"{folder}{os.pathsep}{os.defpath}"},
        "host-env": {**path, "KITECOSIM_PYTHON": sys.executable},
    }
