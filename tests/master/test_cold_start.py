"""What asking for help and loading a room brings into memory. Times depend on the machine, what is loaded does not."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import master
from master.coupling import SCHEMES
from master.moved import MOVED

ROOT = Path(__file__).resolve().parents[2]
ROOMS = {"structural", "aero", "scenes", "fmus"}
HEAVY = {"numpy", "scipy", "fmpy", "pythonfmu", "rich"}
ON_DEMAND = {"matplotlib", "numba", "rich", "tqdm", "meshio", "jinja2", "typer"}  # drawn, shown, hot or asked for


def process(*arguments):
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def loaded(script):
    """Top-level packages in memory after a script."""
    ending = "\nimport sys\nprint('\\nloaded', *{name.partition('.')[0] for name in sys.modules})"
    return set(process("-W", "error", "-c", script + ending).splitlines()[-1].split()[1:])


HELP = """
import sys
from master.cli import main
sys.argv = ["kitecosim", *{words!r}]
try:
    main()
except SystemExit as end:
    assert end.code == 0, end.code
"""


@pytest.mark.parametrize("command", [[], ["run"], ["build"], ["scenes"]], ids=" ".join)
def test_help_is_given_without_solvers_numpy_or_rich(command):
    found = loaded(HELP.format(words=[*command, "--help"]))
    assert {"master", "typer"} <= found
    assert not found & (HEAVY | ROOMS)


def test_help_says_whole_sentences_and_lists_what_there_is():
    text = process("-m", "master", "--help")
    for command in ("run", "build", "scenes"):
        line = next(line for line in text.splitlines() if line.split()[:1] == [command])
        assert line.endswith(".")
        assert not line.endswith("...")
    assert "--scheme" in process("-m", "master", "run", "--help")


@pytest.mark.parametrize("room", ["structural", "aero", "scenes", "master"])
def test_a_room_loads_nothing_that_only_drawing_or_showing_needs(room):
    assert not loaded(f"import {room}") & ON_DEMAND


def test_the_package_alone_loads_no_numpy_and_a_fixed_point_needs_nothing_else():
    assert not loaded("import master") & HEAVY
    script = "from master import IQNILS, fixed_point; fixed_point(lambda x: x / 2, [1.0], IQNILS(), atol=1e-9)"
    assert not loaded(script) & (HEAVY - {"numpy"} | ROOMS)


@pytest.mark.parametrize(
    "first",
    [
        "",
        "import master.coupling.fixed_point",
        "import master.coupling.acceleration",
        "import master.coupling",
        "from master.coupling.fixed_point import FixedPointResult",
        "import master; master.FixedPointResult",
        "import master.fixed_point as f; assert callable(f)",  # its name in releases up to 0.1
    ],
)
def test_the_public_names_are_the_same_objects_whichever_module_was_loaded_first(first):
    process(
        "-W",
        "error",
        "-c",
        f"{first}\n"
        "import master, sys\n"
        "from master import *\n"
        "from master import fixed_point as f\n"
        "module = sys.modules['master.coupling.fixed_point']\n"
        "assert f is fixed_point is master.fixed_point is module.fixed_point\n"
        "assert FixedPointResult is module.FixedPointResult\n"
        "assert IQNILS is master.IQNILS is sys.modules['master.coupling.acceleration'].IQNILS\n"
        "assert {Aitken, ConstantRelaxation} == {master.Aitken, master.ConstantRelaxation}\n",
    )


def test_modules_are_found_under_their_former_names_and_say_where_they_are_now():
    names = (
        ("acceleration", "NewtonKrylov"),
        ("checkpoint", "read"),
        ("comparison", "compare"),
        ("exchange", "Exchange"),
        ("fixed_point", "fixed_point"),
        ("foreign", "opened"),
        ("march", "march"),
        ("participants", "FmuParticipant"),
        ("run", "coupled_run"),
        ("run", "summary"),
        ("schemes", "SCHEMES"),
        ("spectrum", "dominant_eigenvalue"),
        ("stability", "static_stability"),
        ("steady", "steady"),
        ("still_air", "StillAir"),
    )
    assert {former for former, _ in names} == set(MOVED)
    for former, name in names:
        with pytest.warns(DeprecationWarning, match=rf"master\.{former} has moved: take {name} from master\."):
            found = getattr(import_module(f"master.{former}"), name)
        assert found is SCHEMES or found.__module__.split(".")[1] in ("coupling", "fmu_coupling", "report", "studies")
    script = "import master.exchange\nfrom master.march import march\nassert master.exchange.Exchange and march\n"
    done = process("-W", "always", "-c", script)
    assert done == ""
    with pytest.raises(AttributeError, match=r"module 'master\.run' has no attribute 'moon'"):
        _ = import_module("master.run").moon


def test_the_public_names_are_listed_and_others_do_not_exist():
    assert set(master.__all__) <= set(dir(master))
    assert all(callable(getattr(master, name)) for name in master.__all__)
    with pytest.raises(AttributeError, match="module 'master' has no attribute 'moon'"):
        _ = master.moon
