"""Attitudes without pitching moment: all zeros of a moment curve, and which of them a kite starts from."""

import numpy as np
import pytest

from aero.trim import trims

ZEROS = np.deg2rad([-3.0, 4.0, 15.0])  # of a moment that falls, rises and falls again


def moment(angle):
    return -float(np.prod(angle - ZEROS))


def test_all_zeros_are_found_with_their_sense():
    found = trims(lambda a: (moment(a), 1.0), np.deg2rad(-10.0), np.deg2rad(30.0))
    assert [p.angle for p in found.points] == pytest.approx(ZEROS, abs=1e-6)
    assert [p.stable for p in found.points] == [True, False, True]
    assert (found.first, found.last) == (moment(np.deg2rad(-10.0)), moment(np.deg2rad(30.0)))


def test_a_kite_starts_at_the_first_stable_one_that_lifts():
    assert trims(lambda a: (moment(a), 1.0), -0.2, 0.6).start.angle == pytest.approx(ZEROS[0], abs=1e-6)
    # lift from one degree on: the stable attitude below it hangs the kite upside down
    found = trims(lambda a: (moment(a), a - np.deg2rad(1.0)), -0.2, 0.6)
    assert found.start.angle == pytest.approx(ZEROS[2], abs=1e-6)
    assert trims(lambda a: (moment(a), -1.0), -0.2, 0.6).start is None


def test_a_moment_that_only_rises_has_no_start():
    found = trims(lambda a: (a - 0.1, 1.0), -0.2, 0.6)
    assert ([p.stable for p in found.points], found.start) == ([False], None)


def test_a_flow_that_answers_otherwise_when_asked_again_still_has_its_zeros():
    asked = []

    def stalling(angle):
        again = angle in asked
        asked.append(angle)
        return (1.0 if again else moment(angle)), 1.0

    assert [p.angle for p in trims(stalling, -0.2, 0.6).points] == pytest.approx(ZEROS, abs=1e-6)


def test_a_smooth_flow_is_looked_at_seldom_and_never_twice():
    looked = []
    found = trims(lambda a: (looked.append(a), (moment(a), 1.0))[1], np.deg2rad(-20.0), np.deg2rad(30.0), smooth=True)
    assert found.start.angle == pytest.approx(ZEROS[0], abs=1e-3)
    assert len(looked) == len(set(looked)) <= 24
