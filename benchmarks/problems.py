"""Problems that several cases measure: coupled pairs, and the plate with a closed form."""

import contextlib
import functools
import tempfile

import numpy as np

import scenes
from fmus.builder import build
from master.coupling import Coupling, FmuParticipant

# Published figures of the V3 kite are without line drag: where a scene can model it, comparisons with them leave it
# out. {} compares with what the scenes ship.
SETTINGS = {"line_drag": "off"}


def published(name, settings=None):
    """Settings of a scene for a comparison with published figures: SETTINGS as far as the scene has them, and these."""
    known = scenes.load(name).offers
    return {**{k: v for k, v in SETTINGS.items() if k in known}, **(settings or {})}


def has_setting(name, setting):
    """Whether a scene has a setting of this name."""
    return setting in scenes.load(name).offers


def frozen(settings):
    """A mapping as a sorted tuple of pairs, for caches."""
    return tuple(sorted((settings or {}).items()))


@functools.lru_cache(maxsize=256)
def _loaded(name, settings, parameters):
    scene = scenes.load(name, dict(settings))
    return scene, scene.with_trim({k: np.array(v) for k, v in parameters})


def loaded(name, settings=None, **parameters):
    """A scene, and the parameters of its cores with the trim angle that belongs to them."""
    scene, given = _loaded(name, frozen(settings), frozen(parameters))
    return scene, dict(given)


def in_process(name, settings=None, **parameters):
    """The two solver cores of a scene at their start, coupled."""
    return Coupling.in_process(*loaded(name, settings, **parameters))


@contextlib.contextmanager
def as_fmus(name, settings=None, **parameters):
    """The two FMUs of a scene at their start, coupled."""
    scene, given = loaded(name, settings, **parameters)
    with tempfile.TemporaryDirectory() as folder:
        paths = build(scene, folder, given)
        with FmuParticipant(paths[0]) as structural, FmuParticipant(paths[1]) as aero:
            yield Coupling(structural, aero)


BACKENDS = {"in-process": lambda *a, **k: contextlib.nullcontext(in_process(*a, **k)), "FMU": as_fmus}


# The typical section: plate of 1 m chord and 1 m^2 on vertical springs of zero rest length, 2000 N/m in all, with
# c_n = 2 pi (alpha_0 + theta) and load normal to the plate. Variant -> elastic axis [chord fractions].
AXIS, ALPHA_0, DENSITY = {"divergent": 0.4, "restoring": 0.1}, 0.005, 1.225


def divergence_pressure(variant):
    """Dynamic pressure q_D = K / (2 pi e) Pa with K = 2000 N/m a (1 - a) chord^2 and e = a - 1/4; negative if e < 0."""
    axis = AXIS[variant]
    return 2000.0 * axis * (1.0 - axis) / (2.0 * np.pi * (axis - 0.25))


def plate_wind(variant, theta):
    """Parameters of the wind that holds the plate at the twist theta rad: q = q_D sin(theta) / (alpha_0 + theta)."""
    q = divergence_pressure(variant) * np.sin(theta) / (ALPHA_0 + theta)
    direction = (float(np.cos(ALPHA_0)), 0.0, float(np.sin(ALPHA_0)))
    return {"wind_speed": float(np.sqrt(2.0 * q / DENSITY)), "wind_direction": direction}


def twist(displacement):
    """Nose-up rotation rad of the plate from the displacement of its first section's edges."""
    leading, trailing = displacement[0], displacement[2]
    return float(np.arctan2(leading[2] - trailing[2], 1.0 + trailing[0] - leading[0]))
