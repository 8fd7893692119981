"""What other makers' FMUs do in a coupling: times, names, folders, messages, states, initial values, refused steps."""

import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import platform

from master import couple
from master.coupling.march import march
from master.fmu_coupling.archive import model_description
from master.fmu_coupling.initial import groups
from tests.master.guests import coupling, described, guest, lin
from tests.master.test_connections import oscillator
from tests.master.test_couple_signals import SCHEMES, coupled, refusal

UY = [("u", 0, "input", "Real", ""), ("y", 1, "output", "Real", "")]
PAIR = [("a.y", "b.u"), ("b.y", "a.u")]


# Times


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
@pytest.mark.parametrize("substeps", [1, 3, 7])
@pytest.mark.parametrize(
    ("start", "stop", "step"),
    [(0.0, 0.3, 0.1), (0.0, 0.7, 0.1), (0.0, 2.3, 0.1), (-1.0, 0.0, 0.1), (1e5, 1e5 + 1, 0.1)],
)
def test_no_fmu_is_stepped_beyond_the_stop_time_that_it_was_told(tmp_path, scheme, substeps, start, stop, step):
    guest(tmp_path, "stopper", UY, step="if (me->stops && t + h > me->stop) return 3; r[1] = 1.0 - 0.5 * r[0]")
    lin(tmp_path)
    a = {"fmu": "stopper.fmu", "substeps": substeps}
    content = coupling({"a": a, "b": "lin"}, PAIR, stop, step, scheme=scheme)
    content["time"]["start"] = start
    result = coupled(tmp_path, content)
    assert result.status == "converged", result.message
    assert result.time == pytest.approx(stop, rel=1e-12)  # rounding


def test_the_last_step_is_shorter_by_the_rounding_where_the_stop_time_is_another_sum():
    ends = []
    exchange = oscillator(0.1, stop=0.3)  # 3 * 0.1 and 0.2 + 0.1 are 0.30000000000000004
    mass = exchange.participants["mass"]
    mass.advance = lambda t, dt, advance=mass.advance: (ends.append(t + dt), advance(t, dt))
    assert march(exchange, None, 3 * 0.1).status == "converged"
    assert ends == pytest.approx([0.1, 0.2, 0.3])
    assert ends[-1] <= 0.3


# Names, folders, messages


def test_every_instance_has_the_name_of_its_participant(tmp_path):
    named = [*UY, ("north", 2, "output", "Boolean", ""), ("south", 3, "output", "Boolean", "")]
    begin = 'b[2] = !strcmp(me->name, "north"); b[3] = !strcmp(me->name, "south")'
    guest(tmp_path, "house", named, begin=begin)
    links = [("north.y", "south.u"), ("south.y", "north.u")]
    record = ["north.north", "north.south", "south.north", "south.south"]
    content = coupling({"north": "house", "south": "house"}, links, record=record, scheme="explicit")
    assert list(map(float, coupled(tmp_path, content).values.values())) == [1.0, 0.0, 0.0, 1.0]


def test_participants_without_a_name_of_their_own_have_one_each(tmp_path):
    from master.coupling import FmuParticipant

    path = lin(tmp_path)
    with FmuParticipant(path) as one, FmuParticipant(path) as two, FmuParticipant(path, instance="three") as three:
        assert [one.instance, two.instance, three.instance] == ["lin", "lin_2", "three"]


@pytest.mark.parametrize("where", ["begin", "enter", "exit", "step"])
def test_an_fmu_that_leaves_the_working_directory_misplaces_nothing(tmp_path, monkeypatch, where):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    guest(tmp_path, "wanderer", UY, **{where: f'chdir("{elsewhere}")'})
    lin(tmp_path)
    file = tmp_path / "pair.toml"
    file.write_text(
        '[time]\nstop = 0.3\nstep = 0.1\n[participants.a]\nfmu = "wanderer.fmu"\n[participants.b]\nfmu = "lin.fmu"\n'
        '[[connections]]\nfrom = "a.y"\nto = "b.u"\n[[connections]]\nfrom = "b.y"\nto = "a.u"\n'
    )
    monkeypatch.chdir(tmp_path)
    result = couple("pair.toml", "results/pair")
    assert result.status == "converged", result.message
    assert os.getcwd() == str(tmp_path)
    assert {p.name for p in (tmp_path / "results/pair").glob("[!.]*")} >= {"results.csv", "steps.csv", "summary.json"}
    assert not list(elsewhere.iterdir())


@pytest.mark.parametrize("environment", ["(void *)1", "(void *)2", "NULL", "me", "me->callbacks->environment"])
def test_a_message_is_of_the_participant_that_is_called(tmp_path, environment):
    lin(tmp_path)
    code = {"environment": environment, "step": 'if (t > 0.15) { SAY(3, "the weather file ends here"); return 3; }'}
    guest(tmp_path, "weather", UY, **code)
    content = coupling({"quiet": "lin", "weather": "weather"}, [("quiet.y", "weather.u")], 0.3, scheme="explicit")
    result = coupled(tmp_path, content, out=tmp_path / "out", report=False)
    assert result.message.endswith("participant weather refused a step: the weather file ends here.")
    said = json.loads((tmp_path / "out/summary.json").read_text())["fmu_messages"]
    assert said == {"quiet": [], "weather": ["the weather file ends here"]}


@pytest.mark.parametrize("where", ["begin", "enter", "exit", "step", "read"])
def test_an_error_that_is_logged_in_a_call_that_succeeds_is_shown_and_taken(tmp_path, where):
    guest(tmp_path, "alarmist", UY, **{where: 'SAY(3, "licence expires in 3 days")'})
    lin(tmp_path)
    result = coupled(tmp_path, coupling({"a": "alarmist", "b": "lin"}, PAIR))
    assert result.status == "converged", result.message
    if where == "begin":
        assert result.logs["a"] == [(3, "licence expires in 3 days")]
    else:
        assert "participant a logged an error and went on: licence expires in 3 days" in result.remarks


# States


@pytest.mark.parametrize("order", ["serial", "parallel"])
@pytest.mark.parametrize("code", ["return 3", "abort()"])
def test_the_explicit_scheme_saves_no_states(tmp_path, code, order):
    guest(tmp_path, "forgetful", UY, save=code, step="r[1] = 0.5 * r[0]")
    lin(tmp_path)
    content = coupling({"a": "forgetful", "b": "lin"}, PAIR, scheme="explicit", order=order)
    assert coupled(tmp_path, content).status == "converged"


@pytest.mark.parametrize("scheme", SCHEMES)
def test_where_nothing_is_sent_back_no_scheme_saves_states(tmp_path, scheme):
    guest(tmp_path, "forgetful", UY, save="abort()", step="r[1] = 0.5 * r[0]")
    lin(tmp_path)
    content = coupling({"a": "forgetful", "b": "lin"}, [("a.y", "b.u")], scheme=scheme)
    assert coupled(tmp_path, content).status == "converged"
    none = 'canGetAndSetFMUstate="false"'
    guest(tmp_path, "forgetful", UY, attributes=none, step="r[1] = 0.5 * r[0]")
    assert coupled(tmp_path, content).status == "converged"


@pytest.mark.parametrize("scheme", SCHEMES[1:])
def test_a_memoryless_fmu_is_not_asked_for_states(tmp_path, scheme):
    guest(tmp_path, "forgetful", UY, save="abort()", step="r[1] = 0.5 * r[0]")
    lin(tmp_path)
    a = {"fmu": "forgetful.fmu", "memoryless": True}
    assert coupled(tmp_path, coupling({"a": a, "b": "lin"}, PAIR, scheme=scheme)).status == "converged"


def test_a_state_that_an_implicit_scheme_needs_and_cannot_have_is_said_with_the_remedy(tmp_path):
    guest(tmp_path, "forgetful", UY, save="return 3")
    lin(tmp_path)
    result = coupled(tmp_path, coupling({"a": "forgetful", "b": "lin"}, PAIR))
    assert result.status == "diverged"
    assert "participant a could not save its state" in result.message
    assert "use the explicit scheme" in result.message


# Initial values


def lag(folder, name="lag"):
    """A filter that starts in the steady state of its input."""
    guest(folder, name, UY, exit="r[1] = r[0]", step="r[1] += (1.0 - exp(-h)) * (r[0] - r[1])")


@pytest.mark.parametrize("late", ["begin", "exit"])
@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
@pytest.mark.parametrize("names", [("s", "f", "g"), ("g", "f", "s"), ("f", "s", "g")])
def test_what_sources_send_arrives_in_the_initialisation_in_the_order_of_the_graph(tmp_path, names, scheme, late):
    guest(tmp_path, "source", [("y", 1, "output", "Real", "")], **{late: "r[1] = 5.0"})
    lag(tmp_path)
    fmus = {"s": "source", "f": "lag", "g": "lag"}
    content = coupling({n: fmus[n] for n in names}, [("s.y", "f.u"), ("f.y", "g.u")], 0.3, scheme=scheme)
    content["results"] = {"record": ["f.u", "f.y", "g.y"]}
    seen = []
    result = coupled(tmp_path, content, follow=lambda n, t, r, values: seen.append([*map(float, values.values())]))
    assert result.status == "converged", result.message
    # to the last bit at the start; a prediction of constants has the rounding of its sum
    assert seen[0] == [5.0, 5.0, 5.0]
    assert np.array(seen) == pytest.approx(5.0, rel=1e-14)


def test_an_input_with_a_start_value_in_the_file_keeps_it_in_the_initialisation(tmp_path):
    guest(tmp_path, "source", [("y", 1, "output", "Real", "")], begin="r[1] = 5.0")
    lag(tmp_path)
    f = {"fmu": "lag.fmu", "start": {"u": 2.0}}
    seen = []
    content = coupling({"s": "source", "f": f}, [("s.y", "f.u")], 0.1, record=["f.y"])
    coupled(tmp_path, content, follow=lambda n, t, r, values: seen.append(float(values["f.y"])))
    assert seen[0] == 2.0


@pytest.mark.parametrize("gain", [0.5, -0.9, -3.0, 4.0])
def test_a_loop_of_outputs_that_follow_inputs_at_once_settles_in_the_initialisation(tmp_path, gain):
    guest(tmp_path, "a", UY, read=f"r[1] = 1.0 + {gain} * r[0]")
    guest(tmp_path, "b", UY, read="r[1] = r[0]")
    seen = []
    content = coupling({"a": "a", "b": "b"}, PAIR, 0.1, record=["a.y", "b.y"])
    coupled(tmp_path, content, follow=lambda n, t, r, values: seen.append([*map(float, values.values())]))
    assert seen[0] == pytest.approx(
        [1.0 / (1.0 - gain)] * 2, rel=1e-6
    )  # of the tolerance of the loop, 1e-8 / (1 - gain)


def test_participants_are_initialised_after_what_they_depend_on_and_loops_together():
    from master.coupling.exchange import Connection

    links = [Connection(a, "y", b, "u") for a, b in ("ab", "bc", "cb", "cd", "ed")]
    assert groups(list("dcbae"), links) == [["a"], ["c", "b"], ["e"], ["d"]]
    assert groups(list("xy"), []) == [["x"], ["y"]]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_an_output_that_is_not_there_before_the_first_step_is_stood_in_for_by_the_start_of_its_target(
    tmp_path, scheme, order
):
    guest(tmp_path, "late", UY, begin="r[1] = NAN", step="r[1] = 0.5 * r[0]")
    lin(tmp_path)
    b = {"fmu": "lin.fmu", "start": {"u": 4.0}}
    content = coupling({"b": b, "a": "late"}, PAIR, scheme=scheme, order=order, rtol=1e-4)
    result = coupled(tmp_path, content, out=tmp_path / "out")
    assert result.status == "converged", result.message
    assert any("a.y is not finite before the first step; the start value of b.u" in r for r in result.remarks)


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_an_output_that_is_nan_in_a_step_is_named_with_its_participant(tmp_path, scheme):
    guest(tmp_path, "late", UY, step="r[1] = t > 0.35 ? NAN : 0.0")
    lin(tmp_path)
    result = coupled(tmp_path, coupling({"a": "late", "b": "lin"}, PAIR, scheme=scheme))
    assert result.status == "diverged"
    assert "participant a sent y = nan" in result.message


# Rounding


VESSEL = [("q", 0, "input", "Real", ""), ("h", 1, "output", "Real", ""), ("h0", 2, "parameter", "Real", ""),
          ("sign", 3, "parameter", "Real", 'start="1"')]  # fmt: skip
PIPE = [("ha", 0, "input", "Real", ""), ("hb", 1, "input", "Real", ""), ("q", 2, "output", "Real", "")]


@pytest.mark.parametrize("scheme", ["iqn-ils", "aitken", "iqn-imvj"])
@pytest.mark.parametrize("kind", ["float", "double"])
@pytest.mark.parametrize("begin", [(2e5, 1e5), (1.5e5, 1.5e5)])
def test_levels_that_become_even_are_found_in_a_few_evaluations_a_step(tmp_path, kind, begin, scheme):
    guest(tmp_path, "vessel", VESSEL, exit="r[1] = r[2]", step="r[1] += h * r[3] * r[0]")
    guest(tmp_path, "pipe", PIPE, step=f"r[2] = ({kind})r[0] - ({kind})r[1]")
    left = {"fmu": "vessel.fmu", "start": {"h0": begin[0], "sign": -1.0}}
    right = {"fmu": "vessel.fmu", "start": {"h0": begin[1], "sign": 1.0}}
    links = [("left.h", "pipe.ha"), ("right.h", "pipe.hb"), ("pipe.q", "left.q"), ("pipe.q", "right.q")]
    fmus = {"left": left, "pipe": "pipe", "right": right}
    result = coupled(tmp_path, coupling(fmus, links, 60.0, scheme=scheme))
    assert result.status == "converged", result.message
    assert result.evaluations < 4 * 600
    level = 0.5 * sum(begin)
    assert result.values["left.h"] == pytest.approx(level, rel=1e-5)  # what single precision leaves
    assert result.values["right.h"] == pytest.approx(level, rel=1e-5)


def test_a_tolerance_below_noise_ends_with_block_residual_tolerance_and_remedy(tmp_path):
    noise = "me->asked++; r[1] = 1.0 + 0.5 * r[0] + 1e-3 * sin(12.9898 * (me->asked = rand()))"
    guest(tmp_path, "noisy", UY, step=noise)
    lin(tmp_path)
    result = coupled(tmp_path, coupling({"a": "noisy", "b": "lin"}, PAIR, max_iterations=60))
    assert result.status in ("stalled", "max_iterations", "diverged")
    assert "b.y has a residual of" in result.message
    assert "its tolerance is" in result.message
    assert "raise atol or rtol" in result.message


# Steps that are not made


def test_an_fmu_that_asks_for_the_end_ends_the_run_with_what_it_wants_and_what_there_is(tmp_path):
    code = {"step": "if (t + h > 0.55) return 2; r[1] = 0.5 * r[0]", "terminated": "1", "last": "0.5"}
    guest(tmp_path, "ender", UY, **code)
    lin(tmp_path)
    for scheme in SCHEMES:
        out = tmp_path / scheme
        content = coupling({"a": "ender", "b": "lin"}, PAIR, scheme=scheme, strict=False)
        result = coupled(tmp_path, content, out=out, report=False)
        assert (result.status, result.message) == ("terminated", "participant a asks to end the simulation at 0.5 s.")
        assert result.time == pytest.approx(0.5)
        assert json.loads((out / "summary.json").read_text())["status"] == "terminated"
        assert len((out / "results.csv").read_text().splitlines()) == 1 + 6


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_a_step_that_an_fmu_shortens_is_told_with_the_step_to_take(tmp_path, scheme):
    count = "me->steps++;"
    guest(tmp_path, "short", UY, step=f"{count} if (t > 0.5) return 2", last="1.5", save="")
    lin(tmp_path)
    result = coupled(
        tmp_path, coupling({"a": "short", "b": "lin"}, PAIR, 3.0, 1.0, scheme=scheme, predictor="constant")
    )
    assert result.status == "diverged"
    assert "participant a refused a step: it came to 1.5 s only, not to 2 s; take a step of 0.5 s" in result.message
    assert result.steps.iterations[-1] == 1  # the same step is not asked for twice


@pytest.mark.parametrize(
    ("status", "says"),
    [
        (2, "it returned fmi2Discard from fmi2DoStep at 0.4 s and logged no reason"),
        (3, "it returned fmi2Error from fmi2DoStep and logged no reason"),
        (4, "ended with fmi2Fatal: no reason logged"),
        (7, "it returned status 7, which FMI does not know, from fmi2DoStep"),
    ],
)
def test_every_status_is_told_in_words(tmp_path, status, says):
    guest(tmp_path, "bad", UY, step=f"if (t > 0.35) return {status}")
    lin(tmp_path)
    result = coupled(tmp_path, coupling({"a": "bad", "b": "lin"}, PAIR, scheme="explicit"))
    assert result.status == "diverged"
    assert says in result.message


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_a_step_that_is_pending_is_waited_for(tmp_path, scheme):
    code = {"step": "me->asked = 0; r[1] = 0.5 * r[0]; me->time = t + h; return 5", "status": "me->asked > 3 ? 0 : 5"}
    guest(tmp_path, "slow", UY, **code)
    lin(tmp_path)
    result = coupled(tmp_path, coupling({"a": "slow", "b": "lin"}, PAIR, scheme=scheme))
    assert result.status == "converged", result.message


def test_a_step_that_stays_pending_without_an_answer_is_refused_in_words(tmp_path):
    lin(tmp_path)
    guest(tmp_path, "mute", UY, step="return 5", answer="3")
    result = coupled(tmp_path, coupling({"a": "mute", "b": "lin"}, PAIR, scheme="explicit"))
    assert "it is still at the step (fmi2Pending), and does not tell by fmi2GetStatus when it is done" in result.message


FILE = """
[time]
stop = 1.0
step = 0.1
[participants.one]
fmu = "ender.fmu"
[participants.two]
fmu = "lin.fmu"
[[connections]]
from = "one.y"
to = "two.u"
[[connections]]
from = "two.y"
to = "one.u"
"""


def command(folder, *options):
    line = [sys.executable, "-m", "master", "couple", "pair.toml", "--no-report", *options]
    return subprocess.Popen(line, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.parametrize(
    ("code", "how"),
    [
        ("abort()", "with SIGABRT"),
        ("exit(0)", "by exit(0)"),
        ("_exit(3)", "by exit(3)"),
        ("*(volatile int *)0 = 1", "with SIGSEGV"),
    ],
)
def test_an_fmu_that_ends_the_process_leaves_what_was_written_and_a_sentence(tmp_path, code, how):
    guest(tmp_path, "ender", UY, step=f"if (t > 0.55) {{ {code}; }} r[1] = 0.5 * r[0]")
    lin(tmp_path)
    (tmp_path / "pair.toml").write_text(FILE)
    done = command(tmp_path)
    _, error = done.communicate(timeout=60)
    assert done.returncode == 1
    partial = tmp_path / "results/pair.partial"
    left = f"what was written until then is in {partial}."
    assert error.splitlines()[-1] == f"kitecosim: participant one ended the process {how}; {left}"
    assert len((partial / "results.csv").read_text().splitlines()) == 1 + 7  # the start and six steps


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_signal_to_the_command_ends_the_process_of_the_fmus_too(tmp_path, number):
    guest(
        tmp_path,
        "ender",
        UY,
        step='usleep(100000); FILE *f = fopen("pid", "w"); fprintf(f, "%d\\n", getpid()); fclose(f)',
    )
    lin(tmp_path)
    (tmp_path / "pair.toml").write_text(FILE)
    done, there = command(tmp_path), tmp_path / "pid"
    for _ in range(600):
        if there.exists() and there.read_text().endswith("\n"):
            break
        time.sleep(0.05)
    own = int(there.read_text())
    assert own != done.pid
    done.send_signal(number)
    done.communicate(timeout=60)
    assert done.returncode == (130 if number == signal.SIGINT else -number)
    for _ in range(200):
        if not Path(f"/proc/{own}").exists() or "State:\tZ" in Path(f"/proc/{own}/status").read_text():
            return
        time.sleep(0.05)
    pytest.fail("the FMUs go on")


# Archives


def packed(path, entries):
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in entries.items():
            archive.writestr(name, content)


SOUND = described("lin", UY)
LIBRARY = f"binaries/{platform}/lin.so"


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        ({"./modelDescription.xml": SOUND, f"./{LIBRARY}": ""}, "has entries that begin with ./, and FMI wants"),
        ({"lin/modelDescription.xml": SOUND, f"lin/{LIBRARY}": ""}, "has all its content in the folder lin/"),
        ({"modelDescription.xml": SOUND, LIBRARY.replace("/", "\\"): ""}, "has entries with backslashes, as binaries"),
        ({"ModelDescription.xml": SOUND, LIBRARY: ""}, "it calls its modelDescription.xml ModelDescription.xml"),
        ({LIBRARY: ""}, "is no FMU: it has no modelDescription.xml"),
        ({}, "is no FMU: it is empty"),
        ({"modelDescription.xml": "<html><body>404</body></html>", LIBRARY: ""}, "but a document <html>"),
        ({"modelDescription.xml": SOUND[:-30], LIBRARY: ""}, "its modelDescription.xml is no XML"),
        ({"modelDescription.xml": SOUND.replace(' fmiVersion="2.0"', ""), LIBRARY: ""}, "has no fmiVersion"),
        ({"modelDescription.xml": SOUND.replace("<Real />", '<Real min="-1,5"/>'), LIBRARY: ""},
         "its variable y has min = '-1,5', which is no number; write -1.5"),
        ({"modelDescription.xml": SOUND.replace('start="0"', 'start="0,5"'), LIBRARY: ""},
         "its variable u has start = '0,5', which is no number; write 0.5"),
        ({"modelDescription.xml": described("lin", UY, types='<SimpleType name="T"><Real max="1,5"/></SimpleType>')},
         "its type T has max = '1,5'"),
        ({"modelDescription.xml": described("lin", UY, '<Unit name="mm"><BaseUnit m="1" factor="0,001"/></Unit>')},
         "its unit mm has factor = '0,001'"),
        ({"modelDescription.xml": SOUND, LIBRARY.replace("lin.so", "model.so"): ""},
         "holds model.so, and not lin.so, which its modelIdentifier asks for"),
        ({"modelDescription.xml": SOUND, "sources/lin.c": ""}, "holds sources only and no library for"),
        ({"modelDescription.xml": SOUND}, "is built for no platform"),
        ({"modelDescription.xml": SOUND, "binaries/vax/lin.so": ""}, "is built for vax, not for"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_an_archive_is_said_before_the_run(tmp_path, entries, says):
    packed(tmp_path / "lin.fmu", entries)
    text = refusal(tmp_path, coupling({"a": "lin", "b": "lin"}, PAIR))
    assert says in text
    assert text.endswith(".")


def test_numbers_of_a_sound_model_description_are_taken(tmp_path):
    text = SOUND.replace("<Real />", '<Real min="-1.5e3" max="+INF" nominal="1"/>')
    packed(tmp_path / "lin.fmu", {"modelDescription.xml": text})
    assert model_description(tmp_path / "lin.fmu").get("modelName") == "lin"
    assert np.isinf(float("+INF"))
