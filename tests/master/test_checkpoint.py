"""Checkpoints: a run that is interrupted anywhere goes on to the last bit as if it had not been."""

import contextlib
import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import master
from benchmarks.problems import in_process
from fmus.builder import archive
from master import checkpoint, commands, restart
from master.acceleration import IQNILS, IQNIMVJ, Aitken, ConstantRelaxation
from master.coupling import solve
from master.exchange import Connection, Exchange
from master.march import march
from master.participants import FmuParticipant
from master.schemes import SCHEMES, scheme
from tests.fmus.toy_fmu import Toy as Core
from tests.fmus.toy_fmu import ToyFmu
from tests.master.toys import Mass, Spring

ROOT = Path(master.__file__).parents[1]
MARCHING = {
    "explicit": lambda: None,
    "relaxation": lambda: ConstantRelaxation(0.9),
    "aitken": Aitken,
    "iqn-ils": IQNILS,
    "iqn-imvj": IQNIMVJ,
}
DT, STEPS = 0.05, 8


def oscillator(dt=DT, time=0.0):
    connections = [Connection("spring", "f", "mass", "f"), Connection("mass", "x", "spring", "x")]
    return Exchange(
        {"spring": Spring(4.0, 1.0), "mass": Mass(1.0, forces=-5.0)}, connections, dt, time, {"mass": 2}, rollback=True
    )  # fmt: skip


def alive(exchange):
    return sum(p.alive for p in exchange.participants.values())


@pytest.mark.parametrize("name", MARCHING)
def test_a_march_goes_on_bitwise_from_every_step(name, tmp_path):
    options = {"rtol": 1e-9, "predictor": "quadratic"}
    exchange, used, files = oscillator(), MARCHING[name](), []

    def keep(now):
        files.append(tmp_path / f"{len(files)}.checkpoint")
        checkpoint.write(files[-1], {"step": len(files)}, checkpoint.of_march(exchange, used, now))

    whole = march(exchange, used, STEPS * DT, hold=keep, **options)
    assert whole.status == "converged"
    assert alive(exchange) == 0
    for k, file in enumerate(files[:-1]):
        about, content = checkpoint.read(file)
        assert about == {"step": k + 1}
        again, fresh = oscillator(), MARCHING[name]()
        begun = checkpoint.march_of(again, content, fresh)
        assert again.time == (k + 1) * DT
        rest = march(again, fresh, STEPS * DT, begun=begun, **options)
        assert np.array_equal(rest.x, whole.x)
        assert rest.steps == whole.steps  # times, statuses, evaluations, residuals
        assert rest.evaluations == whole.evaluations
        for p in ("mass", "spring"):
            for block, values in again.participants[p].values.items():
                assert np.array_equal(values, exchange.participants[p].values[block])
        assert alive(again) == 0


@pytest.mark.parametrize("name", ["explicit", "iqn-ils"])
def test_a_march_of_fmus_goes_on_bitwise_in_new_instances(name, tmp_path):
    path = tmp_path / "toy.fmu"
    path.write_bytes(archive("toy", ToyFmu(Core(), instance_name="toy"), {}))

    @contextlib.contextmanager
    def pair():
        with FmuParticipant(path, {"gain": 0.9}) as a, FmuParticipant(path, {"gain": 0.7}) as b:
            a.set("load", np.arange(6.0).reshape(2, 3))
            links = [Connection("a", "position", "b", "load"), Connection("b", "position", "a", "load")]
            yield Exchange({"a": a, "b": b}, links, 0.1, rollback=True)

    files = []
    with pair() as exchange:
        used = MARCHING[name]()

        def keep(now):
            files.append(tmp_path / f"{len(files)}.checkpoint")
            checkpoint.write(files[-1], {}, checkpoint.of_march(exchange, used, now))

        whole = march(exchange, used, 0.6, hold=keep)
        assert whole.status == "converged"
    for file in files[:-1]:
        with pair() as exchange:
            used = MARCHING[name]()
            begun = checkpoint.march_of(exchange, checkpoint.read(file)[1], used)
            rest = march(exchange, used, 0.6, begun=begun)
            assert np.array_equal(rest.x, whole.x)
            assert rest.steps == whole.steps
            assert not exchange.participants["a"]._states


def interrupted(step, name="iqn-ils", **options):
    """What a checkpoint after a step of a march holds."""
    exchange, used, kept = oscillator(), MARCHING[name](), []
    march(exchange, used, step * DT, hold=lambda now: kept.append(pickle.dumps(
        checkpoint.of_march(exchange, used, now)
    )), **options)  # fmt: skip
    return pickle.loads(kept[-1])


def test_a_march_may_go_on_with_another_scheme_tolerance_predictor_and_step():
    content = interrupted(4, rtol=1e-6)
    exchange = oscillator(dt=0.5 * DT)
    used = Aitken()
    begun = checkpoint.march_of(exchange, content, used)  # no history of IQN-ILS for it
    result = march(exchange, used, STEPS * DT, begun=begun, rtol=1e-10, predictor="quadratic")
    assert result.status == "converged"
    assert len(result.steps) == 4 + 2 * 4
    assert result.time == pytest.approx(STEPS * DT, abs=1e-15)
    assert np.diff(result.steps.times) == pytest.approx([DT] * 3 + [0.5 * DT] * 8, abs=1e-15)
    assert begun.predictor.kind == "quadratic"


def test_a_march_that_goes_on_remembers_steps_that_did_not_converge():
    content = interrupted(2, "relaxation", rtol=1e-15, max_iterations=1, strict=False)
    exchange = oscillator()
    result = march(exchange, IQNILS(), STEPS * DT, begun=checkpoint.march_of(exchange, content))
    assert result.status == "max_iterations"
    assert "step 1" in result.message


def test_a_march_of_the_other_order_or_of_other_participants_is_refused_in_one_sentence():
    content = interrupted(2)
    exchange = oscillator()
    begun = checkpoint.march_of(exchange, content)
    with pytest.raises(ValueError, match=r"unknowns.*\.$"):
        march(exchange, IQNILS(), 1.0, order="parallel", begun=begun)
    other = Exchange({"a": Spring(1.0), "b": Mass(1.0)}, [Connection("a", "f", "b", "f")], rollback=True)
    with pytest.raises(ValueError, match=r"other participants.*\.$"):
        checkpoint.march_of(other, content)
    with pytest.raises(ValueError, match=r"not of a run through time\.$"):
        checkpoint.march_of(exchange, {"search": None})
    with pytest.raises(ValueError, match=r"not of a coupled equilibrium\.$"):
        checkpoint.search_of(in_process("typical_section"), content)


CASES = {
    "section": ("typical_section", {"wind_speed": 15.0}),
    "kite": ("v3_kite", {"wind_speed": 12.0}),
}


def about(name, coupling, **choices):
    """What the command line writes into a checkpoint, with the choices that matter here."""
    settings, parameters = {}, dict(CASES[name][1])
    return {
        "scene": CASES[name][0],
        "scene_settings": settings,
        "parameters": parameters,
        "scheme": "iqn-ils",
        "order": "serial",
        "tolerance": 1e-7,
        "max_iterations": 200,
        **choices,
    }


class Interrupted(Exception):
    """The power went out."""


def begun(name, path, at, method="iqn-ils", order="serial"):
    """A solve that is interrupted right after the checkpoint before coupling iteration `at` (counted from 0)."""
    coupling = in_process(CASES[name][0], **CASES[name][1])
    used = scheme(method, coupling, order)
    keeper = restart.Keeper(path, 1, coupling, used, about(name, coupling, scheme=method, order=order))

    def hold(search, warmth):
        keeper(search, warmth)
        if len(search.history) == at:
            raise Interrupted

    return solve(coupling, used, atol=1e-7, order=order, hold=hold), coupling, used


def assert_same(again, whole):
    assert again.status == whole.status
    assert np.array_equal(again.displacement, whole.displacement)
    assert again.residual_N == whole.residual_N
    assert len(again.history) == len(whole.history)
    for a, b in zip(again.history, whole.history, strict=True):
        assert a == b or all(a[k] == b[k] or np.isnan(a[k]) for k in b)  # omega, columns, residuals, all outputs


@pytest.mark.parametrize(
    ("name", "method", "order"),
    [("section", m, o) for m in ("iqn-ils", "iqn-imvj", "newton-krylov") for o in ("serial", "parallel")]
    + [
        ("section", "aitken", "serial"),
        ("kite", "iqn-ils", "serial"),
        ("kite", "iqn-ils", "parallel"),
        ("kite", "aitken", "serial"),
        ("kite", "newton-krylov", "serial"),
    ],
)
def test_a_coupled_solve_goes_on_bitwise_from_every_coupling_iteration(name, method, order, tmp_path):
    path = tmp_path / "kept.checkpoint"
    whole, _, used = begun(name, path, -1, method, order)
    assert whole.status == "converged"
    # every iteration of the section and of the kite by default, else the first, the second, the middle, the last
    places = range(whole.iterations)
    if name == "kite" and (method, order) != ("iqn-ils", "serial"):
        places = sorted({0, 1, whole.iterations // 2, whole.iterations - 1})
    for at in places:
        with pytest.raises(Interrupted):
            begun(name, path, at, method, order)
        coupling = in_process(CASES[name][0], **CASES[name][1])
        fresh = scheme(method, coupling, order)
        search, remarks = restart.resumed(
            path, coupling, fresh, about(name, coupling, scheme=method, order=order), {}
        )  # fmt: skip
        assert remarks == [f"went on from {path.name} after {at} coupling iterations"]
        again = solve(coupling, fresh, atol=1e-7, order=order, search=search)
        assert_same(again, whole)
        for entry in ("_shares", "_floor", "_omega", "_size"):
            assert np.array_equal(getattr(fresh, entry, None), getattr(used, entry, None))


def test_a_restart_after_all_iterations_are_used_up_ends_as_that_and_not_in_an_error(tmp_path):
    path = tmp_path / "kept.checkpoint"
    with pytest.raises(Interrupted):
        begun("kite", path, 5)
    coupling = in_process("v3_kite", **CASES["kite"][1])
    used = scheme("iqn-ils")
    search, _ = restart.resumed(path, coupling, used, about("kite", coupling, max_iterations=3), {})
    result = solve(coupling, used, atol=1e-7, max_iterations=3, search=search)
    assert (result.status, result.iterations) == ("max_iterations", 6)


def test_fewer_iterations_than_were_made_before_the_tolerance_was_tightened_end_as_max_iterations():
    coupling = in_process("typical_section", wind_speed=15.0)
    kept = []
    used = scheme("relaxation", omega=0.5)
    options = {"atol": 1e-2, "force_tolerance": 1e-6}

    def hold(search, warmth):
        if search.tighter < 1.0:
            kept.append(pickle.dumps(checkpoint.of_search(coupling, used, search, warmth)))

    solve(coupling, used, hold=hold, **options)
    assert kept
    again = in_process("typical_section", wind_speed=15.0)
    search = checkpoint.search_of(again, pickle.loads(kept[0]))
    result = solve(again, used, max_iterations=1, search=search, **options)
    assert result.status == "max_iterations"


@pytest.mark.parametrize("how", ["iterating", "converged"])
@pytest.mark.parametrize(
    ("change", "chosen", "says"),
    [
        ({"tolerance": 1e-9}, {}, "tolerance 1e-07 -> 1e-09"),
        (
            {"scheme": "aitken"},
            {},
            "aitken; coupling iterations are counted anew, without the history of another scheme",
        ),
        ({"parameters": {"wind_speed": 16.0}}, {"wind_speed": "16"}, "wind_speed 15.0 -> 16.0"),
    ],
)
def test_a_restart_with_other_settings_says_what_changed_and_finds_what_a_fresh_run_finds(
    how, change, chosen, says, tmp_path
):
    path = tmp_path / "kept.checkpoint"
    if how == "iterating":
        with pytest.raises(Interrupted):
            begun("section", path, 2)
    else:
        result, coupling, used = begun("section", path, -1)
        restart.Keeper(path, 1, coupling, used, about("section", coupling)).end(result)
    coupling = in_process("typical_section", **CASES["section"][1])
    now = about("section", coupling) | change
    used = scheme(now["scheme"])
    search, (remark,) = restart.resumed(path, coupling, used, now, chosen)
    assert says in remark
    found = solve(coupling, used, atol=now["tolerance"], search=search)
    assert found.status == "converged"
    fresh = solve(in_process("typical_section", **now["parameters"]), scheme("iqn-ils"), atol=1e-9)
    # residual of 1e-7 m over 1 - q / q_D, which is above 0.3 here
    assert np.abs(found.displacement - fresh.displacement).max() < 1e-6


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda raw: raw[: len(raw) // 2], "damaged"),
        (lambda raw: raw[:30], "damaged"),
        (lambda raw: raw[:10], "not a checkpoint"),
        (lambda raw: b"", "not a checkpoint"),
        (lambda raw: raw[:-1], "damaged"),
        (lambda raw: raw[:-9] + bytes([raw[-9] ^ 1]) + raw[-8:], "damaged"),
        (lambda raw: raw.replace(b'"scene"', b'"scene', 1), "damaged"),
        (lambda raw: checkpoint.MAGIC + b"[1, 2]\n" + raw, "damaged"),
        (lambda raw: checkpoint.MAGIC + b"null\n", "damaged"),
        (lambda raw: checkpoint.MAGIC + b"{}\n", "damaged"),
        (lambda raw: checkpoint.MAGIC + b"\xff\xfe\n", "damaged"),
        (lambda raw: b"PK\x03\x04" + raw, "not a checkpoint"),
        (lambda raw: raw.replace(b"checkpoint 1", b"checkpoint 2", 1), "not a checkpoint"),
    ],
)
def test_damaged_and_foreign_files_are_refused_in_one_sentence(spoil, says, tmp_path):
    path = tmp_path / "kept.checkpoint"
    with pytest.raises(Interrupted):
        begun("section", path, 1)
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(ValueError, match=says + r".*\.$") as caught:
        checkpoint.read(path)
    assert "\n" not in str(caught.value)


def test_a_folder_a_missing_file_and_another_scene_are_refused_in_one_sentence(tmp_path):
    for path in (tmp_path, tmp_path / "none"):
        with pytest.raises(ValueError, match=r"cannot be read.*\.$"):
            checkpoint.read(path)
    path = tmp_path / "kept.checkpoint"
    with pytest.raises(Interrupted):
        begun("section", path, 1)
    coupling = in_process("v3_kite")
    with pytest.raises(ValueError, match=r"is of scene typical_section.*\.$"):
        restart.resumed(path, coupling, IQNILS(), about("kite", coupling), {})
    coupling = in_process("typical_section")
    other = about("section", coupling, scene_settings={"variant": "restoring"})
    with pytest.raises(ValueError, match=r"has variant = .*, this run restoring.*\.$"):
        restart.resumed(path, coupling, IQNILS(), other, {})


def test_a_state_that_cannot_be_written_is_refused_and_leaves_neither_file_nor_saved_state(tmp_path):
    exchange = oscillator()

    def no(state):
        raise ValueError("its state cannot be written to a file.")

    exchange.participants["mass"].serialised = no
    with pytest.raises(ValueError, match=r"cannot be written.*\.$"):
        march(exchange, IQNILS(), DT, hold=lambda now: checkpoint.write(
            tmp_path / "x", {}, checkpoint.of_march(exchange, None, now)
        ))  # fmt: skip
    assert alive(exchange) == 0
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_takes_no_file_is_refused_in_one_sentence(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "none" / "x", tmp_path / "folder", tmp_path / "file" / "x"):
        with pytest.raises(ValueError, match=r"cannot be written \(.*\)\.$"):
            checkpoint.write(path, {}, {})
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


def test_nothing_half_written_is_ever_at_its_place(tmp_path, monkeypatch):
    path = tmp_path / "kept.checkpoint"
    checkpoint.write(path, {"step": 1}, {"x": np.arange(3.0)})
    write_bytes = Path.write_bytes

    def killed(self, data):
        write_bytes(self, data[: len(data) // 2])
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_bytes", killed)
    with pytest.raises(KeyboardInterrupt):
        checkpoint.write(path, {"step": 2}, {"x": np.arange(4.0)})
    monkeypatch.undo()
    about_, content = checkpoint.read(path)
    assert about_ == {"step": 1}
    assert np.array_equal(content["x"], np.arange(3.0))
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


KILLED = """
import os, sys
from pathlib import Path
from fmus.builder import archive
from master import checkpoint, commands, restart
write_bytes = Path.write_bytes
checkpoint.write(sys.argv[1], {"step": 1}, {"x": 1})
def die(self, data):
    write_bytes(self, data[:60])
    os._exit(9)
Path.write_bytes = die
checkpoint.write(sys.argv[1], {"step": 2}, {"x": 2})
"""


def test_a_process_that_dies_while_it_writes_leaves_the_checkpoint_before(tmp_path):
    path = tmp_path / "kept.checkpoint"
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], cwd=ROOT, check=False, timeout=60)
    assert done.returncode == 9
    assert checkpoint.read(path) == ({"step": 1}, {"x": 1})
    checkpoint.write(path, {"step": 3}, {"x": 3})  # and the rest of it is no obstacle
    assert checkpoint.read(path)[1] == {"x": 3}
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_people_can_read_the_second_line(tmp_path):
    path = tmp_path / "kept.checkpoint"
    with pytest.raises(Interrupted):
        begun("section", path, 2)
    head = json.loads(path.read_bytes().split(b"\n")[1])
    assert head["scene"] == "typical_section"
    assert head["coupling_iterations"] == 2
    assert head["status"] == "under way"


FMUS = """
import sys
from pathlib import Path
from benchmarks.problems import as_fmus
from fmus.builder import archive
from master import checkpoint, commands, restart
from master.coupling import solve
from master.schemes import scheme

path, at = Path(sys.argv[1]), int(sys.argv[2])
about = {"scene": "typical_section", "scene_settings": {}, "parameters": {}, "order": "serial"}
with as_fmus("typical_section", wind_speed=15.0) as coupling:
    used, search = scheme("iqn-ils"), None
    keeper = restart.Keeper(path if at >= 0 else None, 1, coupling, used, about)
    if at == -2:
        search, _ = restart.resumed(path, coupling, used, about, {})

    def hold(search, warmth):
        keeper(search, warmth)
        if len(search.history) == at:
            import os
            os._exit(3)

    result = solve(coupling, used, atol=1e-8, search=search, hold=hold)
    print(result.status, [float(v).hex() for v in result.displacement.ravel()])
    print([row["residual_m"].hex() for row in result.history])
"""


def test_fmus_in_a_new_process_go_on_bitwise(tmp_path):
    path = tmp_path / "kept.checkpoint"

    def process(at):
        return subprocess.run(
            [sys.executable, "-W", "error", "-c", FMUS, str(path), str(at)],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    whole = process(-1)
    assert whole.returncode == 0, whole.stderr
    assert process(2).returncode == 3
    rest = process(-2)
    assert rest.returncode == 0, rest.stderr
    assert rest.stdout == whole.stdout
    assert rest.stdout.startswith("converged")


CHOICES = {
    "scheme": "iqn-ils",
    "backend": "in-process",
    "order": "serial",
    "tolerance": 1e-5,
    "force_tolerance": 0.01,
    "max_iterations": 200,
    "relaxation": None,
    "stability": False,
    "report": False,
}


def test_the_command_goes_on_from_the_end_of_another_run_with_another_wind(tmp_path):
    path = tmp_path / "kept.checkpoint"
    keep = restart.Files(checkpoint=path)
    assert commands.run_scene("v3_kite", CHOICES, {"wind_speed": "12"}, tmp_path / "a", keep) == 0
    about_, _ = checkpoint.read(path)
    assert about_["status"] == "converged"
    onward = restart.Files(restart=path)
    counts = {}
    for name, files in (("warm", onward), ("cold", restart.Files())):
        assert commands.run_scene("v3_kite", CHOICES, {"wind_speed": "12.5"}, tmp_path / name, files) == 0
        content = json.loads((tmp_path / name / "summary.json").read_text())
        counts[name] = content["coupling_iterations"]
        assert any("wind_speed 12.0 -> 12.5" in remark for remark in content["remarks"]) == (name == "warm")
    assert counts["warm"] < counts["cold"]


def test_the_command_refuses_other_settings_of_a_scene(tmp_path):
    path = tmp_path / "kept.checkpoint"
    keep, onward = restart.Files(checkpoint=path), restart.Files(restart=path)
    assert commands.run_scene("typical_section", CHOICES, {"wind_speed": "12"}, tmp_path / "a", keep) == 0
    with pytest.raises(ValueError, match=r"has variant = divergent, this run restoring.*\.$"):
        commands.run_scene("typical_section", CHOICES, {"variant": "restoring"}, tmp_path / "b", onward)
    with pytest.raises(ValueError, match=r"--checkpoint-every must be at least 1.*\.$"):
        commands.run_scene("typical_section", CHOICES, {}, tmp_path / "c", restart.Files(path, 0))


def test_every_scheme_can_be_pickled_with_its_history():
    assert set(SCHEMES) == {"explicit", "relaxation", "aitken", "iqn-ils", "iqn-imvj", "newton-krylov"}
    coupling = in_process("typical_section", wind_speed=15.0)
    for name in SCHEMES:
        used = scheme(name, coupling)
        solve(coupling, used, max_iterations=5)
        assert type(pickle.loads(pickle.dumps(used))) is type(used)
