"""The FMU of a closed wing whose strips have section polars."""

import zipfile

import numpy as np

from fmus.builder import build
from tests.fmus.importer import Importer
from tests.scenes.test_body_polars import STATIONS, TABLE, curves, made


def test_it_answers_as_the_core_in_this_process_and_carries_no_other_method(tmp_path):
    scene = made(tmp_path, TABLE, stations_csv=STATIONS, polars_csv=curves(inner=0.01, outer=0.03))
    (path,) = build(scene, tmp_path)
    core = scene.aero_core()
    with Importer(path) as fmu:
        for k in range(2):
            bent = 0.02 * k * np.sin(scene.interface.nodes[:, [1, 2, 0]])
            core.set("displacement", bent)
            fmu.set(displacement=np.ravel(bent).tolist())
            core.step(float(k), 1.0)
            fmu.slave.doStep(float(k), 1.0)
            for variable in core.variables:
                name = variable.name
                assert np.ravel(fmu.get(name)).tolist() == np.ravel(core.get(name)).tolist(), name
    with zipfile.ZipFile(path) as archive:
        assert not [name for name in archive.namelist() if "/aero/vortex_step/" in name]
