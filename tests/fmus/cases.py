"""Every built-in scene, and every setting of it changed once: later scenes and settings are tested without a word."""

import scenes


def _cases():
    for name in scenes.available():
        yield name, {}
        for key, option in scenes.load(name).content["settings"].items():
            for value in option["options"] if "options" in option else [option["default"] + 1]:
                if value != option["default"]:
                    yield name, {key: value}


CASES = list(_cases())


def label(case):
    """The name of a case in a test report."""
    name, settings = case
    return "-".join([name, *(f"{key}={value}" for key, value in settings.items())])


def start(scene):
    """Start values of parameters that a coupled simulation of the scene begins with."""
    return {} if scene.content["trim"] is None else {"trim_angle": scene.trim_angle()}
