"""The verdict on static stability from spectra made by hand: signs of det K and of det(I - G')."""

import numpy as np
import pytest

from master.coupling.spectrum import Eigenvalue
from master.coupling.stability import _judged


def spectrum(*ritz, settled=True):
    """What a search with these eigenvalues of G' on its subspace returns."""
    values = np.array(ritz, dtype=complex)
    first = values[np.argmax(values.real)]
    return Eigenvalue(first.real, abs(first.imag), np.ones(1), 10, settled, "", values)


@pytest.mark.parametrize(
    ("found", "unstable_modes", "verdict"),
    [
        (spectrum(0.3, -2.0), 0, True),
        (spectrum(1.1, -2.0), 0, False),
        (spectrum(1.0), 0, False),  # neutral is not stable
        (spectrum(1.5 + 0.5j, 1.5 - 0.5j, 1.2), 0, False),  # a real one above 1 behind a complex pair
        (spectrum(1.5 + 0.5j, 1.5 - 0.5j, 0.2), 0, True),  # a complex pair is no static instability
        (spectrum(0.3), 3, False),  # det K < 0 and det(I - G') > 0
        (spectrum(1.2), 1, None),  # both negative: an even number of unstable directions, perhaps none
        (spectrum(0.3), 2, None),
        (spectrum(0.3, settled=False), 3, None),  # the parity of an unknown spectrum is unknown
        (spectrum(0.3, settled=False), 0, None),
        (spectrum(np.nan, settled=False), 0, None),
    ],
)
def test_static_stability_follows_the_sign_of_the_coupled_determinant(found, unstable_modes, verdict):
    assert _judged(found, unstable_modes, symmetric=True).statically_stable is verdict
