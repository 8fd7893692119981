"""Answers to compare membranes with: an axisymmetric membrane by shooting, and wrinkled beams in closed form."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

# Published figures of the square airbag (ram-air thesis 3.5.1, table 3.3): what the limit of the model is taken to be.
AIRBAG_HEIGHT, AIRBAG_STRESS = 0.2152, 3.91e6  # m; Pa, at the centre


def circular_membrane(q, nu):
    """Deflection over radius of the centre of a flat round membrane, held at its edge, under a follower pressure
    q = p a / (E h), St. Venant-Kirchhoff: what membrane elements converge to.

    With r(R), z(R) of the material circle R and the stretches lambda_1 = sqrt(r'^2 + z'^2), lambda_2 = r / R, the
    stationary value of int (W - ...) R dR is R S1 z' = -q r^2 / 2 and (R S1 r')' = S2 r / R + q r z'. Shooting from the
    stretch at the centre to r(1) = 1; the series of Hencky has the direction of the pressure and small strains instead.
    """
    k = 1.0 / (1.0 - nu * nu)

    def stresses(r, radial, place):
        e2 = 0.5 * ((r / place) ** 2 - 1.0)
        square = (radial**2 + 0.25 * q * q * r**4) / place**2  # (S1 lambda_1)^2
        s = np.sqrt(square)
        for _ in range(60):
            change = (s - k * (0.5 * (square / s**2 - 1.0) + nu * e2)) / (1.0 + k * square / s**3)
            s -= change
            if abs(change) <= 1e-16:
                break
        return s, k * (e2 + nu * 0.5 * (square / s**2 - 1.0))

    def slopes(place, y):
        r, radial, _ = y
        s1, s2 = stresses(r, radial, place)
        dz = -0.5 * q * r * r / (place * s1)
        return [radial / (place * s1), s2 * r / place + q * r * dz, dz]

    def shot(stretch):
        begin = 1e-6
        s = 0.5 * (stretch**2 - 1.0) / (1.0 - nu)
        start = [stretch * begin, begin * s * stretch, 0.0]
        return solve_ivp(slopes, [begin, 1.0], start, rtol=1e-11, atol=1e-14, method="DOP853").y[:, -1]

    size = q ** (2.0 / 3.0)
    stretch = brentq(lambda c: shot(c)[0] - 1.0, 1.0 + 0.02 * size, 1.0 + 1.5 * size, xtol=1e-14)
    return float(-shot(stretch)[2])


def wrinkled_tube(moment):
    """Curvature of an inflated tube times E h / p under `moment` / (pi p r^3) (Comer and Levy 1963): below 1/2 a beam,
    above it with wrinkles up to the angle theta0 from the compressed side.
    """

    def carried(theta):
        left = np.sin(theta) + (np.pi - theta) * np.cos(theta)
        return (2.0 * np.pi - 2.0 * theta + np.sin(2.0 * theta)) / (4.0 * left)

    if moment <= 0.5:
        return moment
    theta = brentq(lambda t: carried(t) - moment, 0.0, np.pi - 1e-3)
    return 0.5 * np.pi / (np.sin(theta) + (np.pi - theta) * np.cos(theta))


def wrinkled_strip(moment):
    """Width of the wrinkled band over the height of a strip under `moment` / (P h), and its curvature times E h^2 /
    (2 P), h the height and E per length (Stein and Hedgepeth 1961).
    """
    if moment <= 1.0 / 6.0:
        return 0.0, 6.0 * moment
    band = 3.0 * moment - 0.5
    return band, 1.0 / (1.0 - band) ** 2
