"""Coupled pairs for the verification tests, in-process and as FMUs, from one set of parameters."""

import contextlib

import scenes
from fmus.builder import build
from master.coupling import Coupling
from master.participants import FmuParticipant


def loaded(name, settings, parameters):
    """The scene, and its parameters with the trim angle that belongs to them."""
    scene = scenes.load(name, settings)
    if scene.content["trim"] is not None:
        parameters = {**parameters, "trim_angle": scene.trim_angle(parameters)}
    return scene, parameters


def in_process(name, settings=None, **parameters):
    """The two solver cores of a scene at their start, coupled."""
    scene, given = loaded(name, settings, parameters)
    return Coupling.in_process(scene, given)


@contextlib.contextmanager
def as_fmus(folder, name, settings=None, **parameters):
    """The two FMUs of a scene, built into `folder`, coupled."""
    scene, given = loaded(name, settings, parameters)
    paths = build(scene, folder, given)
    with FmuParticipant(paths[0]) as structural, FmuParticipant(paths[1]) as aero:
        yield Coupling(structural, aero)
