"""Random calls of FMI 2.0, most of them wrong, and what has to hold of every one of them."""

from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, create_string_buffer

import numpy as np

from .fmu_raw import CATEGORIES, DISCARD, ERROR, OK, START, TYPES
from .fmu_values import reals, references, sentence

TIMES = (0.0, 1.0, 0.5, -1.0, 1e-300, 1e9, 1e300, -1e300, np.nan, np.inf, 5e-324, 1e-9)
NAMES = (b"logStatusError", b"logStatusDiscard", b"logAll", b"", b"%n%s", b"logStatusError ", b"\xff\xfe", b"x" * 5000)


class Broken(AssertionError):
    """What did not hold."""


class Sequence:
    """Calls on one instance, with another one beside it whose states are foreign; `trace` tells them in order."""

    def __init__(self, rng, one, other, foreign):
        self.rng, self.one, self.other = rng, one, other
        self.foreign = foreign  # serialised states of other FMUs
        self.wanted = set(CATEGORIES.values())  # the categories that are logged
        self.states, self.bad = [], set()  # handles ever seen, and those of bytes that were no state
        self.contents = []
        self.trace, self.statuses = [], {OK: 0, DISCARD: 0, ERROR: 0}

    # What holds of every call

    def check(self, told, status, expected=None):
        """Judge the last call; `expected` is a status or a set of them."""
        log = self.one.log
        self.trace.append(f"{told} -> {status}" + "".join(f"; {text[:300]!r}" for _, _, text in log[:2]))
        if status not in self.statuses:
            raise Broken(f"status {status}")
        self.statuses[status] += 1
        if expected is not None and status not in (expected if isinstance(expected, set) else {expected}):
            raise Broken(f"status {status} instead of {expected}")
        if status == OK and log:
            raise Broken("a message without need")
        if status != OK and CATEGORIES[status] in self.wanted and status not in [s for s, _, _ in log]:
            raise Broken("no message of that status")
        for heard, category, text in log:
            if category.decode() not in self.wanted or CATEGORIES.get(heard) != category.decode():
                raise Broken(f"a message of category {category}")
            if problem := sentence(text):
                raise Broken(f"a message that {problem}")
        return status

    # Values

    def kind(self):
        return str(self.rng.choice(list(TYPES), p=(0.8, 0.1, 0.1)))

    def set(self):
        kind = self.kind()
        told, places = references(self.rng, self.one.library)
        known = [self._kind_of(r) for r in places]
        if known and all(k is not None for k in known) and self.rng.random() < 0.85:
            kind = known[0]  # mostly the right type
        fits = all(k == kind for k in known)
        old = self.one.get(kind, places)[1] if fits else np.zeros(len(places))
        if kind == "Real":
            with np.errstate(all="ignore"):  # which is what is wanted here
                how, values = reals(self.rng, old)
        else:
            how, values = "whole", self.rng.choice([0, 1, 1, 2, -1, 2**31 - 1, -(2**31)], len(places))
        expected = None
        if not fits or (kind == "Real" and not np.isfinite(values).all()):
            expected = ERROR
        elif not places:
            expected = OK
        before = self.one.values("input", "parameter") if self.rng.random() < 0.6 else None
        status = self.one.set(kind, places, values)
        self.check(f"Set{kind} {told}[{len(places)}] {how} {np.asarray(values)[:3].tolist()}", status, expected)
        if before is not None and status != OK and self.one.values("input", "parameter") != before:
            raise Broken("a refused value that did not leave the old ones")

    def _kind_of(self, reference):
        for kind, _, own in self.one.library.blocks.values():
            if own[0] <= reference <= own[-1]:
                return kind
        return None

    def get(self):
        kind = self.kind()
        told, places = references(self.rng, self.one.library)
        fits = all(self._kind_of(r) == kind for r in places)
        status, _ = self.one.get(kind, places)
        self.check(f"Get{kind} {told}[{len(places)}]", status, None if fits else ERROR)

    def strings(self):
        verb, places = str(self.rng.choice(["Get", "Set"])), list(range(int(self.rng.integers(3))))
        self.check(f"{verb}String", self.one.strings(verb, places), ERROR if places else OK)

    # Steps and life

    def step(self):
        rng = self.rng
        time = float(rng.choice(TIMES)) if rng.random() < 0.3 else 1.0
        size = float(rng.choice(TIMES)) if rng.random() < 0.3 else 1.0
        before = self.one.values("output")
        goes = np.isfinite(time) and 0.0 < size < np.inf
        status = self.one.step(time, size)
        self.check(f"DoStep {time!r} {size!r}", status, {OK, DISCARD} if goes else DISCARD)
        if status == OK:
            outputs = self.one.get("Real", self.one.library.places("output", kind="Real"))[1]
            if not np.isfinite(outputs).all():
                raise Broken("an output that is not finite after a step")
        elif self.one.values("output") != before:
            raise Broken("outputs that changed in a discarded step")

    def life(self):
        rng = self.rng
        name = str(rng.choice(["EnterInitializationMode", "ExitInitializationMode", "SetupExperiment", "Terminate",
                               "Reset", "CancelStep"], p=(0.25, 0.35, 0.15, 0.1, 0.1, 0.05)))  # fmt: skip
        times = [float(t) for t in rng.choice(TIMES, 3)]
        given = (int(rng.integers(2)), times[0], times[1], int(rng.integers(2)), times[2])
        status = self.one.call(name, *(given if name == "SetupExperiment" else ()))
        self.check(name, status, {"Reset": OK, "CancelStep": ERROR}.get(name))

    def initialise(self):
        for given in START:
            self.check(given[0], self.one.call(*given))

    # States

    def handle(self):
        """Told, a handle, and whether it is one of the instance's own (None: not known)."""
        rng = self.rng
        choice = int(rng.integers(8))
        if choice < 5 and self.states:
            state = self.states[int(rng.integers(len(self.states)))]
            return "kept", c_void_p(state)
        if choice == 5:
            status, state = self.other.saved()
            if status == OK:
                return "foreign", state
        return "odd", c_void_p([None, 8, 2**63, 12345678][int(rng.integers(4))])

    def state(self):
        rng = self.rng
        match str(rng.choice(["save", "restore", "free", "serialise", "read"], p=(0.3, 0.3, 0.1, 0.12, 0.18))):
            case "save":
                told, old = self.handle() if rng.random() < 0.2 else ("new", c_void_p())
                self.check(f"GetFMUstate {told}", self.one.call("GetFMUstate", byref(old)), OK)
                self.states.append(old.value)
                self.bad.discard(old.value)
            case "restore":
                told, state = self.handle()
                self.check(
                    f"SetFMUstate {told}", self.one.call("SetFMUstate", state), None if told == "kept" else ERROR
                )
            case "free":
                told, state = self.handle()
                value = state.value
                wanted = {"kept": None, "foreign": ERROR}.get(told, ERROR if value else OK)
                self.check(f"FreeFMUstate {told}", self.one.call("FreeFMUstate", byref(state)), wanted)
            case "serialise":
                told, state = self.handle()
                size = c_size_t(0)
                status = self.one.call("SerializedFMUstateSize", state, byref(size))
                self.check(f"SerializedFMUstateSize {told}", status, None if told == "kept" else ERROR)
                if status == OK:
                    status, content = self.one.serialised(state)
                    self.check("SerializeFMUstate", status, OK)
                    self.contents += [content] if state.value not in self.bad else []
                    short = create_string_buffer(size.value)
                    status = self.one.call("SerializeFMUstate", state, short, c_size_t(size.value // 2))
                    self.check("SerializeFMUstate short", status, ERROR)
            case "read":
                told, content = self.content()
                status, state = self.one.read(content)
                self.check(f"DeSerializeFMUstate {told}", status, OK if told == "own" else ERROR)
                if status != OK:  # bytes of no state, or of another FMU's, leave none
                    return
                self.states.append(state.value)
                (self.bad.discard if told == "own" else self.bad.add)(state.value)
                if rng.random() < 0.5:
                    status = self.one.call("SetFMUstate", state)
                    self.check(f"SetFMUstate read {told}", status, OK if told == "own" else ERROR)

    def content(self):
        """Told, and a serialised state: own, of another FMU, cut, changed or none."""
        rng = self.rng
        match int(rng.integers(5)):
            case 0 | 1 if self.contents:
                return "own", self.contents[-1]
            case 2:
                return "foreign", self.foreign[int(rng.integers(len(self.foreign)))]
            case 3:
                content = self.foreign[0]
                return "cut", content[: int(rng.integers(len(content)))]
            case _:
                content = bytearray((self.contents or self.foreign)[-1])
                content[int(rng.integers(len(content)))] ^= int(rng.integers(1, 256))
                return "changed", bytes(content)

    # Others

    def logging(self):
        rng = self.rng
        on = int(rng.random() < 0.7)
        chosen = [NAMES[i] for i in rng.integers(0, len(NAMES), int(rng.integers(4)))]
        status = self.one.log_only(on, chosen)
        known = set(CATEGORIES.values())
        some = known if not chosen or b"logAll" in chosen else {c.decode("latin-1") for c in chosen} & known
        self.wanted = some if on else set()
        self.check(f"SetDebugLogging {on} {[c[:20] for c in chosen]}", status, OK)

    def query(self):
        rng, kind = self.rng, int(self.rng.integers(-1, 6))
        number, whole, text = c_double(), c_int(), c_char_p()
        match int(rng.integers(6)):
            case 0:
                status, wanted = self.one.call("GetRealStatus", kind, byref(number)), OK if kind == 2 else DISCARD
            case 1:
                status, wanted = self.one.call("GetBooleanStatus", kind, byref(whole)), OK if kind == 3 else DISCARD
            case 2:
                status, wanted = self.one.call("GetStatus", kind, byref(whole)), DISCARD
            case 3:
                status, wanted = self.one.call("GetIntegerStatus", kind, byref(whole)), DISCARD
            case 4:
                status, wanted = self.one.call("GetStringStatus", kind, byref(text)), DISCARD
            case _:
                one, order = (c_uint * 1)(0), (c_int * 1)(1)
                status = self.one.call("SetRealInputDerivatives", one, c_size_t(1), order, byref(number))
                wanted = ERROR
        self.check(f"status query {kind}", status, wanted)

    ACTS = (("set", 0.36), ("step", 0.17), ("get", 0.1), ("life", 0.1), ("state", 0.15), ("logging", 0.04),
            ("query", 0.04), ("strings", 0.02), ("initialise", 0.02))  # fmt: skip

    def run(self, calls, initialise):
        """Make the calls, after initialisation or not."""
        if initialise:
            self.initialise()
        names, shares = zip(*self.ACTS, strict=True)
        for name in self.rng.choice(names, calls, p=shares):
            getattr(self, str(name))()
