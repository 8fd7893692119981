"""The energies that the structure of a transient scene reports, and their balance."""

import numpy as np
import pytest

from scenes import load

from .test_transient_core import DT, _blown, _tether

BALANCE = ("kinetic_energy", "elastic_energy", "external_work", "reeling_work", "dissipated_energy", "numerical_loss")


def _energies(core):
    return [float(core.get(name)) for name in BALANCE]


def _open(core):
    """What the balance J does not account for: what was stored at the start."""
    kinetic, elastic, work, reeled, heat, lost = _energies(core)
    return kinetic + elastic - work - reeled + heat + lost


def _paid_out(h):
    """Energies J after a tether of 300 m in the wind was paid out at 2 m/s for 2 s, and the work of its tension J."""
    core = _blown(_tether(start_in_equilibrium=1.0, longest_step=h))
    core.step(0.0, h)
    core.set("tether_length_rate", 2.0)
    shares = core.get("rest_length") / 300.0
    before, done = shares @ core.get("tension"), 0.0
    for k in range(1, round(2.0 / h) + 1):
        core.set("loads_vary", float(k > 1))  # the rate jumps
        core.step(k * h, h)
        after = shares @ core.get("tension")
        done -= 0.5 * (before + after) * 2.0 * h
        before = after
    return _energies(core), done


def test_line_paid_out_faster_than_it_stretches_does_the_work_of_its_tension_at_every_step():
    """A step pays out more than the stretch that it meets, after the first ones."""
    coarse, fine = _paid_out(0.05), _paid_out(0.01)
    for (kinetic, _, _, reeled, _, lost), done in (coarse, fine):
        assert reeled == pytest.approx(done, rel=0.05)  # the mean of both ends is poor where a step lets all of it go
        assert abs(lost) < 0.2 * kinetic  # what the scheme damps where the tether jerks taut in the wind
    assert coarse[0][3] == pytest.approx(fine[0][3], rel=0.05)


def test_the_balance_of_energies_closes_whatever_is_set_on_the_way():
    """To rounding: through added inertia of the air, tapes that move, other lines and masses."""
    scene = load("v3_kite_dynamic")
    core, flow = scene.structural_core(), scene.aero_core()
    for name, value in scene.with_trim({}).items():
        for one in (core, flow):
            one.set(name, value)
    core.set("added_mass_coefficient", 1.0)
    stored = []
    for k in range(12):
        flow.set("displacement", core.get("displacement"))
        flow.set("velocity", core.get("velocity"))
        flow.set("wind_speed", 12.0 + 0.3 * k)
        core.set("steering_tape_left_length_rate", 1.0 if k > 3 else 0.0)
        if k == 8:
            core.set("line_modulus", 0.6e9)
            core.set("wing_mass", 30.0)
        flow.step(0.02 * k, 0.02)
        for name in ("pressure", "shear", "line_load"):
            core.set(name, flow.get(name))
        core.step(0.02 * k, 0.02)
        stored.append(_open(core))
    assert stored[0] > 100.0  # J in the lines at the start
    assert np.ptp(stored) < 1e-11 * max(map(abs, _energies(core)))  # rounding


def test_what_is_stored_in_the_shape_of_the_tables_is_known_before_the_first_step():
    core = _tether(tether_length=299.0)
    stretched = 0.5 * 70e9 * 0.25 * np.pi * 0.004**2 / 299.0  # EA s^2 / 2 l, s = 1 m
    assert float(core.get("elastic_energy")) == pytest.approx(stretched, rel=1e-9)
    _blown(core).step(0.0, DT)
    assert _open(core) == pytest.approx(stretched, rel=1e-9)
