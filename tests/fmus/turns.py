"""Instances of FMUs under loads and displacements of their own, stepped in turn or each from a thread."""

import threading

from benchmarks.fmu_raw import OK, Instance, Library

STEPS = 12


def instances(given):
    """An initialised instance for each (folder, factor), one library a folder."""
    libraries = {folder: Library(folder) for folder, _ in given}
    made = [(Instance(libraries[folder]), factor) for folder, factor in given]
    assert all(instance.initialise() == OK for instance, _ in made)
    return made


def stepped(instance, factor, t):
    """Outputs, as bytes, after a step with inputs that move with time."""
    for block, (kind, causality, places) in instance.library.blocks.items():
        if causality == "input":
            size = {"pressure": 10.0, "displacement": 1e-3}.get(block, 0.1)
            values = [size * factor * (1.0 + 0.1 * ((3 * t + 7 * i) % 11)) for i in range(len(places))]
            assert instance.set(kind, places, values) == OK
    assert instance.step(float(t)) == OK, instance.log
    return instance.values("output")


def in_turn(given):
    """Outputs of every instance, joined, where each makes a step before any makes the next."""
    made = instances(given)
    parts = [[stepped(instance, factor, t) for instance, factor in made] for t in range(STEPS)]
    return [b"".join(own) for own in zip(*parts, strict=True)]


def in_threads(given):
    """The same, where every instance is stepped by a thread of its own."""
    found: list[bytes] = [b""] * len(given)

    def work(k, instance, factor):
        found[k] = b"".join(stepped(instance, factor, t) for t in range(STEPS))

    threads = [threading.Thread(target=work, args=(k, *one)) for k, one in enumerate(instances(given))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found
