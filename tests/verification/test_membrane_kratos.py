"""The airbag in the membrane elements of Kratos, where it is installed: the same forces, the same shape from flat."""

import numpy as np
import pytest

from benchmarks import kratos, membrane_kratos
from benchmarks.membrane_kratos import (
    PACKAGES,
    PRESSURE,
    KratosAirbag,
    airbag_in_kratos,
    height_and_stress,
    relaxation_masses,
    relaxed,
)
from benchmarks.membrane_models import airbag, inflated

with_kratos = pytest.mark.skipif(not kratos.has(*PACKAGES), reason=kratos.NOT_INSTALLED)


@with_kratos
@pytest.mark.parametrize("n", [4, 10])
def test_our_equilibrium_is_one_of_the_membrane_elements_of_kratos(n):
    nodes, fixed, group = airbag(n)
    found, _, _ = inflated(nodes, fixed, group, PRESSURE)
    bag = KratosAirbag(nodes, fixed, group.nodes, PRESSURE)
    u = found.x - nodes
    assert found.converged
    # both meet 1e-9 of the load: the elements, the law and the pressure are the same to rounding
    assert np.linalg.norm(bag.forces(u)) <= 1e-9 * bag.load(u)
    # and so is the stress, in Pa
    assert bag.stress_at_centre(u) == pytest.approx(1e6 * height_and_stress(group, found.x)[1], rel=1e-9)
    # and not because the forces are small anywhere near: 0.1 mm off they are not
    off = u + np.where(fixed, 0.0, 1e-4)
    assert np.linalg.norm(bag.forces(off)) > 1e-3 * bag.load(off)


@with_kratos
def test_the_forces_of_kratos_relax_the_flat_airbag_to_our_height_and_stress():
    nodes, fixed, group = airbag(4)
    ours, _, _ = inflated(nodes, fixed, group, PRESSURE)
    theirs = relaxed(KratosAirbag(nodes, fixed, group.nodes, PRESSURE), group, np.zeros_like(nodes))
    assert theirs.status == "converged"
    # a residual of 1e-5 of the load leaves the shape uncertain by about as much
    assert theirs.displacements[0, 2] == pytest.approx(ours.x[0, 2], rel=1e-4)


@with_kratos
def test_newton_iterations_of_kratos_come_to_our_equilibrium_linearly():
    nodes, fixed, group = airbag(4)
    found, _, _ = inflated(nodes, fixed, group, PRESSURE)
    near = found.x - nodes + np.where(fixed, 0.0, 1e-6 * np.random.default_rng(1).normal(size=nodes.shape))
    norms = np.array(KratosAirbag(nodes, fixed, group.nodes, PRESSURE).newton(near, 15))
    steps = norms[6:] / norms[5:-1]
    assert norms[-1] < 0.05 * norms[0]
    assert np.all((steps > 0.5) & (steps < 1.0))  # 0.90 seen; a consistent tangent would square the residual


def test_relaxation_masses_are_stable_for_the_stiffest_mode():
    nodes, _, group = airbag(3)
    n = len(nodes)
    at_rest = group.smoothing()  # E h int dN_a/dX . dN_b/dX, in all directions
    whole = np.zeros((n, n))
    for corners, block in zip(group.nodes, at_rest, strict=True):
        whole[np.ix_(corners, corners)] += block[::3, ::3]
    masses = relaxation_masses(group, n)[:, 0]
    frequency = np.linalg.eigvalsh(whole / np.sqrt(np.outer(masses, masses)))[-1]
    assert frequency <= 4.0  # of central differences with steps of 1: omega^2 <= 4


def test_without_kratos_the_table_says_so_in_a_sentence(monkeypatch):
    monkeypatch.setattr(membrane_kratos.kratos, "has", lambda *packages: False)
    assert airbag_in_kratos(True).startswith("Kratos is not installed; `pip install")
    nodes, fixed, group = airbag(2)
    with pytest.raises(ModuleNotFoundError, match="Kratos is not installed; pip install"):
        KratosAirbag(nodes, fixed, group.nodes, PRESSURE)
