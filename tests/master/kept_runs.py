"""Coupled solves that are interrupted with a checkpoint, for tests of restarts."""

from benchmarks.problems import in_process
from master import restart
from master.coupling import scheme, solve

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
    keeper = restart.CheckpointWriter(path, 1, coupling, used, about(name, coupling, scheme=method, order=order))

    def hold(search, snapshot):
        keeper(search, snapshot)
        if len(search.history) == at:
            raise Interrupted

    return solve(coupling, used, atol=1e-7, order=order, hold=hold), coupling, used
