"""Every built-in scene without tubes, every setting of it changed once: later ones are tested without a word."""

import scenes

FEW = 3  # of a longer list of options, as of load cases, the last one stands for the others


def _cases():
    for name in scenes.available():
        yield name, {}
        for key, option in scenes.load(name).content["settings"].items():
            values = option["options"] if "options" in option else [option["default"] + 1]
            others = [value for value in values if value != option["default"]]
            for value in others if len(others) <= FEW else others[-1:]:
                yield name, {key: value}


CASES = [case for case in _cases() if scenes.load(*case).members.wing is None]  # the others: test_inflatable.py


def label(case):
    """The name of a case in a test report."""
    name, settings = case
    return "-".join([name, *(f"{key}={value}" for key, value in settings.items())])


def start(scene):
    """Start values of parameters that a coupled simulation of the scene begins with."""
    return {} if scene.content["trim"] is None else {"trim_angle": scene.trim_angle()}
