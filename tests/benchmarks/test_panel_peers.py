"""Peers of the panel method: what is said where they are missing, and shapes that lattices take from closed wings."""

import numpy as np
import pytest

from benchmarks import panel_peers
from benchmarks.panel_peers import METHODS, PEERS, SHAPES, missing, own_panels, peers


def test_one_sentence_says_which_peers_are_missing_and_what_brings_them(monkeypatch):
    monkeypatch.setattr(panel_peers, "installed", lambda package: None)
    assert missing(PEERS) == (
        "pyapm, AeroSandbox and openaerostruct are not installed; `pip install -c constraints.txt -e '.[peers]'` "
        "brings them."
    )
    assert missing(PEERS[:1]).startswith("pyapm is not installed; ")
    text = peers(quick=True)
    assert text.count("not installed") == 1
    rows = [line for line in text.splitlines() if line.startswith("| rect")]
    assert len(rows) == sum(package is None for package, _, _ in METHODS.values())
    monkeypatch.setattr(panel_peers, "installed", lambda package: "1.0")
    assert missing(PEERS) == ""


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)
def test_edges_of_a_closed_wing_are_one_chord_apart_in_its_sections(shape):
    mesh = shape.meshes[0]
    leading, trailing = shape.edges(shape.surface(*mesh), mesh[1])
    chord = np.linalg.norm(trailing - leading, axis=1)
    np.testing.assert_allclose((trailing - leading)[:, 1:], 0.0, atol=1e-12)  # along x, to rounding
    if "circular" in shape.name:
        assert chord.max() == pytest.approx(1.0, abs=1e-12)  # its diameter
    else:
        np.testing.assert_allclose(chord, 1.0, atol=1e-12)
    assert (leading[0] == leading[-1]).all() == shape.ring


def test_a_half_and_a_whole_wing_have_the_same_lift_and_drag():
    shape = SHAPES[0]
    strips, panels = shape.meshes[0]
    surface = shape.surface(strips, panels)
    (some, *half), (all_, *whole) = (own_panels(s, shape, surface, panels) for s in (True, False))
    assert all_ == 2 * some
    # mirrored panels are divided along other diagonals; the equations are solved to 1e-10
    np.testing.assert_allclose(half, whole, rtol=1e-6)
