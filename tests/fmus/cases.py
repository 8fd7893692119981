"""Every built-in scene, and every setting of it changed once: later scenes and settings are tested without a word."""

import scenes


FEW = 3  # of a longer list of options, as of load cases, the last one stands for the others


def _cases():
    for name in scenes.available():
        yield name, {}
        for key, option in scenes.load(name).content["settings"].items():
            others = [v for v in option.get("options", [option["default"] + 1]) if v != option["default"]]
            for value in others if len(others) <= FEW else others[-1:]:
                yield name, {key: value}


CASES = list(_cases())


def label(case):
    """The name of a case in a test report."""
    name, settings = case
    return "-".join([name, *(f"{key}={value}" for key, value in settings.items())])


def start(scene):
    """Start values of parameters that a coupled simulation of the scene begins with."""
    return {} if scene.content["trim"] is None else {"trim_angle": scene.trim_angle()}
