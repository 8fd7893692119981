"""A state that was written to a file goes on in a process that loads the FMUs afresh, to the last bit."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fmu_fuzz import unpacked
from benchmarks.fmu_raw import DISCARD, ERROR, OK, Instance, Library

MORE = 3
WIND = {0: 0.999, 2: 0.03}  # components of the direction that is set at last


def pair(folders):
    """The initialised structural and aerodynamic instances of unpacked FMUs."""
    made = [Instance(Library(folder)) for folder in folders]
    assert [instance.initialise() for instance in made] == [OK, OK]
    return made


def block(instance, name):
    return instance.library.blocks[name][2]


def exchange(structural, aero, t):
    """One explicit exchange at time t; all values of both after it, as bytes."""
    for giver, taker, names in (
        (structural, aero, ("displacement",)),
        (aero, structural, ("pressure", "shear", "line_load")),
    ):
        for name in names:
            values = giver.get("Real", block(giver, name))[1]
            assert taker.set("Real", block(taker, name), values) == OK
        assert taker.step(t) == OK, taker.log
    return b"".join(one.values("input", "parameter", "output") for one in (structural, aero))


def set_wind(aero, components):
    """Set some components of the direction of the wind."""
    places = [block(aero, "wind_direction")[k] for k in components]
    return aero.set("Real", places, list(components.values()))


def under_way(structural, aero):
    """Nothing special."""


def discarded(structural, aero):
    """The last step of both was refused: a load that nothing carries, a wing that is one point."""
    places = block(structural, "pressure")
    assert structural.set("Real", places, np.full(len(places), -1e7)) == OK
    places = block(aero, "displacement")
    assert aero.set("Real", places, np.full(len(places), 1e200)) == OK
    assert [structural.step(9.0), aero.step(9.0)] == [DISCARD, DISCARD]


def half_set(structural, aero):
    """One component of the wind's direction was set, and the three of them are none yet; the other is to follow."""
    assert set_wind(aero, {0: 0.0}) == OK


def refused(structural, aero):
    """A value was refused, so that the next step is to be discarded."""
    discarded(structural, aero)
    assert aero.set("Real", block(aero, "wind_speed"), [-1.0]) == ERROR


def go_on(structural, aero, moment):
    """What follows the state: values of both after MORE exchanges, with the wind of WIND."""
    if moment == "refused":
        assert aero.step(9.0) == DISCARD
        assert aero.log[-1][2].startswith(b"wind_speed must be between")
    assert set_wind(aero, WIND) == OK
    return [exchange(structural, aero, 10.0 + k) for k in range(MORE)]


def read(folder, moment):
    """The same in a process that has the FMUs and the files of the states only."""
    made = pair([Path(folder) / f"v3_kite_{side}" for side in ("structural", "aero")])
    for instance in made:
        status, state = instance.read((Path(folder) / f"{instance.library.name}.state").read_bytes())
        assert status == OK
        assert instance.call("SetFMUstate", state) == OK, instance.log
    (Path(folder) / "found").write_bytes(b"".join(go_on(*made, moment)))
    for instance in made:
        instance.free()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    unpacked(folder, [("v3_kite", "structural"), ("v3_kite", "aero")])
    return folder


@pytest.mark.parametrize("moment", [under_way, discarded, half_set, refused], ids=lambda moment: moment.__name__)
def test_a_new_process_goes_on_from_a_file_as_the_old_one_does(folder, moment):
    made = pair([folder / f"v3_kite_{side}" for side in ("structural", "aero")])
    for t in range(4):
        exchange(*made, float(t))
    moment(*made)
    for instance in made:
        status, content = instance.serialised(instance.saved()[1])
        assert status == OK
        (folder / f"{instance.library.name}.state").write_bytes(content)
    expected = go_on(*made, moment.__name__)
    assert len(set(expected)) == MORE  # the exchanges have not settled: there is something to miss
    for instance in made:
        instance.free()
    code = f"from tests.fmus.test_rollback import read; read({str(folder)!r}, {moment.__name__!r})"
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (folder / "found").read_bytes() == b"".join(expected)
