"""Bad input on the command line: exit code 2, one line on standard error, nothing written."""

import subprocess
import sys
import warnings

import pytest
from typer.testing import CliRunner

from master.cli import app
from tests.scenes.broken import copy_of, edited


def _refused(arguments, out):
    result = CliRunner().invoke(app, [*arguments, "--out", str(out)])
    assert result.exit_code == 2, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert "Traceback" not in result.output
    assert result.stdout == ""
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("kitecosim: ")
    assert not out.exists() or not any(out.iterdir())
    return lines[0]


def _set(*pairs):
    return [a for pair in pairs for a in ("--set", pair)]


WORDS = {
    "unknown scene": (["no_such_scene"], ["no_such_scene", "v3_kite"]),
    "unknown scheme": (["v3_kite", "--scheme", "newton"], ["newton", "iqn-ils"]),
    "unknown backend": (["v3_kite", "--backend", "cloud"], ["cloud", "in-process"]),
    "unknown parameter": (["v3_kite", *_set("wind_sped=12")], ["wind_sped", "wind_speed"]),
    "output as parameter": (["v3_kite", *_set("CL=1")], ["CL"]),
    "no wind": (["v3_kite", *_set("wind_speed=0")], ["wind_speed"]),
    "negative wind": (["v3_kite", *_set("wind_speed=-1")], ["wind_speed", "-1"]),
    "NaN wind": (["v3_kite", *_set("wind_speed=nan")], ["wind_speed", "finite"]),
    "infinite wind": (["v3_kite", *_set("wind_speed=inf")], ["wind_speed", "finite"]),
    "wind in words": (["v3_kite", *_set("wind_speed=strong")], ["wind_speed", "strong"]),
    "vector for scalar": (["v3_kite", *_set("wind_speed=12,0,0")], ["wind_speed"]),
    "scalar for vector": (["v3_kite", *_set("wind_direction=1")], ["wind_direction"]),
    "two components": (["v3_kite", *_set("wind_direction=1,0")], ["wind_direction"]),
    "wind from nowhere": (["v3_kite", *_set("wind_direction=0,0,0")], ["wind_direction"]),
    "no value": (["v3_kite", *_set("wind_speed=")], ["--set", "NAME=VALUE"]),
    "no name": (["v3_kite", *_set("=12")], ["--set", "NAME=VALUE"]),
    "no equals sign": (["v3_kite", *_set("wind_speed")], ["--set", "NAME=VALUE"]),
    "maybe symmetric": (["v3_kite", *_set("symmetric=maybe")], ["symmetric", "maybe"]),
    "half symmetric": (["v3_kite", *_set("symmetric=0.5")], ["symmetric"]),
    "unknown option of a setting": (["v3_kite", *_set("chord=curved")], ["chord", "curved"]),
    "setting out of range": (["v3_kite", *_set("panels_per_section=0")], ["panels_per_section"]),
    "parameter of another scene": (["typical_section", *_set("power_tape_length=3")], ["power_tape_length"]),
    "tape of no length": (["v3_kite", *_set("power_tape_length=0")], ["power_tape_length"]),
    "hurricane": (["v3_kite", *_set("wind_speed=1e200")], ["wind"]),
    "air of lead": (["v3_kite", *_set("air_density=1e308")], ["air"]),
    "cross wind only": (["typical_section", *_set("wind_direction=0,1,0")], ["wind"]),
    "tolerance zero": (["v3_kite", "--tolerance", "0"], ["--tolerance"]),
    "tolerance NaN": (["v3_kite", "--tolerance", "nan"], ["--tolerance"]),
    "force tolerance negative": (["v3_kite", "--force-tolerance", "-1"], ["--force-tolerance"]),
    "no iterations": (["v3_kite", "--max-iterations", "0"], ["--max-iterations"]),
    "relaxation NaN": (["v3_kite", "--scheme", "relaxation", "--relaxation", "nan"], ["--relaxation"]),
    "relaxation of the explicit scheme": (["v3_kite", "--scheme", "explicit", "--relaxation", "0.5"], ["--relaxation"]),
}


@pytest.mark.parametrize("wrong", WORDS)
@pytest.mark.parametrize("backend", ["in-process", "fmu"])
def test_bad_run_is_refused_before_anything_is_written(wrong, backend, tmp_path):
    arguments, words = WORDS[wrong]
    given = arguments if "--backend" in arguments else [*arguments, "--backend", backend]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        line = _refused(["run", *given], tmp_path / "out")
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    "wrong", [w for w, (a, _) in WORDS.items() if not {"--scheme", "--backend"} & set(a) and "--set" in a]
)
def test_bad_build_is_refused_before_anything_is_written(wrong, tmp_path):
    arguments, words = WORDS[wrong]
    line = _refused(["build", *arguments], tmp_path / "out")
    for word in words:
        assert word in line


def test_broken_scene_folder_is_refused(tmp_path):
    folder = copy_of("typical_section", tmp_path)
    edited(folder, "nodes.csv", "te_left,1.0", "te_left,one")
    for command in ("run", "build"):
        line = _refused([command, str(folder)], tmp_path / "out")
        assert "typical_section/nodes.csv row 3: x_m 'one'" in line


def test_results_folder_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "out").write_text("keep me")
    result = CliRunner().invoke(
        app, ["run", "typical_section", "--backend", "in-process", "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert (tmp_path / "out").read_text() == "keep me"


def test_whole_process_ends_with_code_2_and_one_line(tmp_path):
    command = [
        sys.executable,
        "-m",
        "master",
        "run",
        "v3_kite",
        "--set",
        "wind_speed=0",
        "--out",
        str(tmp_path / "out"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert "wind_speed" in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_reader_that_has_heard_enough_is_no_error():
    """As `kitecosim scenes | head -1`; 141 is what a shell makes of SIGPIPE."""
    process = subprocess.Popen(
        [sys.executable, "-m", "master", "scenes", "typical_section"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait(60) == 141
    process.stderr.close()
