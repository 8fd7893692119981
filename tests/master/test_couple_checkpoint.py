"""A coupling of FMUs of any maker that is stopped continues from its checkpoint bitwise as if it had not been."""

import numpy as np
import pytest

from master import couple
from master.coupling.checkpoint import Files, read
from master.fmu_coupling.document import Document
from tests.master.test_couple import braked, oscillator


def run(folder, content, files, **options):
    return couple(Document.of(content, folder), files=files, **options)


@pytest.mark.parametrize("scheme", ["explicit", "aitken", "iqn-ils", "iqn-imvj"])
@pytest.mark.parametrize("predictor", ["constant", "quadratic"])
def test_a_run_in_two_parts_equals_the_whole(serialising, tmp_path, scheme, predictor):
    settings = {"scheme": scheme, "predictor": predictor}
    whole = run(serialising, oscillator(**settings), Files())
    file = tmp_path / "half.ckp"
    run(serialising, oscillator(stop=0.5, **settings), Files(file, every=3))
    assert read(file)[0]["steps"] == 5  # the last step is kept whatever `every` says
    rest = run(serialising, oscillator(**settings), Files(restart=file))
    assert rest.status == whole.status == "converged"
    for name, values in whole.values.items():
        assert np.array_equal(rest.values[name], values)
    assert rest.steps.times == whole.steps.times
    assert rest.steps.iterations == whole.steps.iterations


def test_the_results_of_a_continued_run_begin_where_it_begins(serialising, tmp_path):
    file = tmp_path / "half.ckp"
    run(serialising, oscillator(stop=0.5), Files(file))
    run(serialising, oscillator(), Files(restart=file), out=tmp_path / "rest", report=False)
    times = np.loadtxt(tmp_path / "rest" / "results.csv", delimiter=",", skiprows=1)[:, 0]
    assert times == pytest.approx(np.arange(0.5, 1.05, 0.1), abs=1e-12)  # rounding


def test_another_scheme_step_and_stop_go_on_from_the_same_state(serialising, tmp_path):
    file = tmp_path / "half.ckp"
    run(serialising, oscillator(stop=0.5), Files(file))
    rest = run(serialising, oscillator(step=0.05, stop=1.5, scheme="aitken"), Files(restart=file))
    assert rest.status == "converged"
    assert rest.time == pytest.approx(1.5, abs=1e-12)  # rounding
    exact = np.array([1.0, 0.5]) * np.cos(3.0)
    # (2 dt)^2 / 12 of the phase 2 t with dt = 0.1 up to 0.5 s: 3e-3; half the step takes a quarter of it
    assert rest.values["wall.position"] == pytest.approx(exact, abs=5e-3)


def test_what_cannot_be_kept_is_refused_before_anything_is_run(toy_fmus, with_wheel, tmp_path):
    for content, reason in ((oscillator(), "canSerializeFMUstate"), (braked(), "cannot save its state")):
        with pytest.raises(ValueError, match=reason):
            run(with_wheel, content, Files(tmp_path / "a.ckp"))
    assert not (tmp_path / "a.ckp").exists()


@pytest.mark.parametrize(
    ("change", "restart", "says"),
    [
        ({}, "missing.ckp", r"missing\.ckp cannot be read"),
        ({"stop": 0.2}, "half.ckp", r"\[time\] stop = 0\.2 lies before the 0\.5 s of the checkpoint .*half\.ckp"),
        ({"step": 0.3, "stop": 0.9}, "half.ckp", r"no whole number of steps of 0\.3 after the 0\.5 s of the check"),
        ({"order": "parallel"}, "half.ckp", "has the unknowns"),
    ],
)
def test_a_restart_that_is_refused_leaves_the_results_as_they_were(serialising, tmp_path, change, restart, says):
    out = tmp_path / "out"
    run(serialising, oscillator(stop=0.5), Files(tmp_path / "half.ckp"), out=out)
    before = {path: path.read_bytes() for path in out.iterdir()}
    assert {path.name for path in before} >= {"results.csv", "steps.csv", "summary.json"}
    with pytest.raises(ValueError, match=says):
        run(serialising, oscillator(**change), Files(restart=tmp_path / restart), out=out)
    assert {path: path.read_bytes() for path in out.iterdir()} == before


def test_the_results_of_another_run_go_with_the_next(serialising, tmp_path):
    run(serialising, oscillator(stop=0.5), Files(), out=tmp_path)
    assert (tmp_path / "results.png").exists()
    run(serialising, oscillator(stop=0.5), Files(), out=tmp_path, report=False)
    assert sorted(path.name for path in tmp_path.glob("[!.]*")) == ["results.csv", "steps.csv", "summary.json"]
