"""The reference problems are what they claim: closed forms, conservation, tangents, wave speed, stability bound."""

import numpy as np
import pytest
from scipy.sparse import diags_array, eye_array, kron
from scipy.sparse.linalg import splu

from benchmarks.reference_problems import AddedMass
from benchmarks.reference_tubes import RingWallTube, Tube
from master.coupling.acceleration import IQNILS, ConstantRelaxation
from master.coupling.fixed_point import fixed_point


def dense(bands, width):
    """The matrix (n, n) of band storage (2 width + 1, n)."""
    n = bands.shape[1]
    J = np.zeros((n, n))
    for row in range(n):
        for column in range(max(0, row - width), min(n, row + width + 1)):
            J[row, column] = bands[width + row - column, column]
    return J


def slope(residual, x, step):
    """Central differences of a residual, (n, n); steps (n,) in the unit of each unknown."""
    return np.array([(residual(x + e) - residual(x - e)) / (2.0 * e.sum()) for e in np.diag(step)]).T


def test_flow_tangent_of_the_elastic_tube_is_the_slope_of_its_residual():
    rng = np.random.default_rng(0)
    tube = Tube(N=6)
    a = 1.0 + 0.1 * rng.standard_normal(7)
    x = rng.standard_normal(14)
    x[::2] += 10.0

    def residual(x):
        return tube.flow_residual(a, x[::2], x[1::2])[0]

    J = dense(tube.flow_residual(a, x[::2], x[1::2])[1], 4)
    # the residual is quadratic, so that central differences are exact; rounding 1e-16 |F| / step
    assert slope(residual, x, np.full(14, 1e-3)) == pytest.approx(J, abs=1e-9)


def test_flow_tangent_of_the_ring_wall_tube_is_the_slope_of_its_residual():
    rng = np.random.default_rng(0)
    tube = RingWallTube(m=7)
    r = tube.r0 * (1.0 + 0.02 * rng.standard_normal(7))
    areas = (np.interp(np.arange(8) - 0.5, np.arange(7), np.pi * radii**2) for radii in (r, tube.r1))
    known = (np.pi * (r**2 - tube.r1**2), *areas)
    x = np.empty(15)
    x[::2], x[1::2] = 0.2 * rng.standard_normal(8), 1e3 * rng.standard_normal(7)

    def residual(x):
        return tube.flow_residual(*known, x[::2], x[1::2])[0]

    J = dense(tube.flow_residual(*known, x[::2], x[1::2])[1], 2)
    # quadratic where the flow does not turn within a step of 1e-5 m/s and 1e-2 Pa; rounding 1e-16 |F| / step
    assert slope(residual, x, np.tile([1e-5, 1e-2], 8)[:15]) == pytest.approx(J, abs=1e-9)


@pytest.mark.parametrize("mode", [1, 2, 10])
def test_a_sine_of_pressure_moves_the_ring_wall_by_its_stiffness_and_inertia(mode):
    tube = RingWallTube()
    s = np.sin(mode * np.pi * (np.arange(tube.m) + 0.5) / tube.m)
    tube.r1, tube.r2 = tube.r0 + 3e-5 * s, tube.r0 - 1e-5 * s
    k2 = (2.0 / tube.dz * np.sin(0.5 * mode * np.pi / tube.m)) ** 2  # of the second difference; (mode pi / l)^2
    assert k2 == pytest.approx((mode * np.pi / tube.l) ** 2, rel=(mode * np.pi / tube.m) ** 2 / 12.0)
    # (rho_s h / dt^2) (y - 2 y1 + y2) + (b3 + b2 k^2 + b1 k^4) y = p
    K = tube.b3 + tube.b2 * k2 + tube.b1 * k2**2
    y = (100.0 + tube.inertia * (2.0 * 3e-5 + 1e-5)) / (tube.inertia + K)
    # 1e-12: rounding times the condition of the wall, at most 3
    assert tube.wall(100.0 * s) - tube.r0 == pytest.approx(y * s, rel=1e-9, abs=1e-12 * tube.r0)


def marched(tube, steps):
    """Times (steps,), pressures (steps, m), and volume that came in through the ends, m^3, of converged steps."""
    scheme, times, pressures, entered = IQNILS(), [], [], 0.0
    for _ in range(steps):
        result = fixed_point(tube.G, tube.x0, scheme, residual_rtol=1e-8)
        assert result.status == "converged", result.message
        out, into = tube.outflow(result.x)
        entered += (into - out) * tube.dt
        times.append(tube.t)
        pressures.append(tube.p)
        tube.advance(result.x)
    return np.array(times), np.array(pressures), entered


@pytest.mark.parametrize("pulse", [1.0, 1333.2])
def test_a_pulse_travels_with_the_moens_korteweg_speed(pulse):
    tube = RingWallTube(l=0.1, m=200, pulse=pulse)
    t, p, _ = marched(tube, 200)
    cells = np.array([10, 60])
    passed = [t @ p[:, c] / p[:, c].sum() for c in cells]
    speed = (cells[1] - cells[0]) * tube.dz / (passed[1] - passed[0])
    # The first moment in time moves with the speed of long waves, whatever the dispersion. Linear: what has not passed
    # after 20 ms, when the reflection (path 0.17 m) is still away, is 3e-5 of the peak. A finite pulse is faster by
    # its own velocity, p / (rho c) = 4 % of c, and stiffening by as much, both weighted with p in [0, p].
    tolerance = 1e-3 if pulse == 1.0 else 0.04
    assert tube.wave_speed <= speed * (1.0 + 1e-3)
    assert speed == pytest.approx(tube.wave_speed, rel=tolerance)


def test_the_volume_of_the_ring_wall_tube_is_what_came_in_through_its_ends():
    tube = RingWallTube()
    before = tube.volume(tube.x0)
    _, _, entered = marched(tube, 40)
    # p / b3 = 2 % of radius over 3 ms of the wave speed, 17 mm: 7.9e-5 m^2 x 4 % x 17 mm = 5.4e-8 m^3, less end effects
    assert entered == pytest.approx(5.4e-8, rel=0.1)
    # velocities are exact to 1e-12 of the wave speed: 40 steps of 1e-4 s, 7.9e-5 m^2, 5.7 m/s make 2e-18
    assert tube.volume(tube.x0) - before == pytest.approx(entered, abs=1e-17)


def test_a_tube_at_rest_stays_at_rest():
    tube = RingWallTube(pulse=0.0)
    result = fixed_point(tube.G, tube.x0, IQNILS(), residual_rtol=1e-8)
    assert result.iterations == 1
    assert np.array_equal(result.x, np.full(tube.m, tube.r0))


def added_mass_of_a_channel(cells_x=60, cells_y=20):
    """Largest eigenvalue [m] of wall pressure over -rho_f x wall acceleration, from Laplace's equation in the channel.

    p = 0 at both ends, p_y = 0 on the axis y = 0, p_y = -rho_f (wall acceleration) on the wall y = R; second
    differences on a grid, Neumann conditions by mirror points.
    """
    dx, dy = AddedMass.L / cells_x, AddedMass.R / cells_y
    nx, ny = cells_x - 1, cells_y + 1
    X = diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(nx, nx)) / dx**2
    Y = diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(ny, ny)).tolil()
    Y[0, 1] = Y[-1, -2] = 2.0
    laplace = kron(Y / dy**2, eye_array(nx)) + kron(eye_array(ny), X)
    flux = np.zeros((nx * ny, nx))  # the mirror point beyond the wall has p + 2 dy p_y
    flux[-nx:] = -2.0 / dy * np.eye(nx)
    p = splu(laplace.tocsc()).solve(flux)
    return float(np.linalg.eigvals(p[-nx:]).real.max())


def test_added_mass_is_that_of_laplaces_equation_in_the_channel():
    mu = added_mass_of_a_channel()
    # second differences: (pi dx / L)^2 / 12 = 2.3e-4 in x, (pi R / L)^2 / 12 / 20^2 less in y
    assert AddedMass().mu.max() == pytest.approx(mu, rel=3e-4)


@pytest.mark.parametrize("ratio", [0.01, 0.1, 1.0, 10.0])
def test_relaxation_bound_follows_from_laplaces_equation_and_is_sharp_at_every_mass_ratio(ratio):
    """A mode's error shrinks by 1 - omega (1 - lambda), lambda = -rho_f mu / (rho_s h + a dt^2).

    So omega < 2 / (1 - lambda) for the largest mu. `ratio` is rho_s h / (rho_f mu_max).
    """
    mu = added_mass_of_a_channel()
    h = ratio * AddedMass.rho_f * mu / AddedMass.rho_s
    omega = 2.0 / (1.0 + AddedMass.rho_f * mu / (AddedMass.rho_s * h + AddedMass.a * AddedMass.dt**2))
    assert omega == pytest.approx(AddedMass(h).critical_omega, rel=3e-4)  # as that of mu, above

    start = np.zeros(30)
    start[0] = 1.0  # the critical mode; 0.96 and 1.04 a coupling iteration: 340 to 1e-6, 230 to the limit of growth
    problem = AddedMass(h)
    options = {"residual_rtol": 1e-6, "max_iterations": 1000, "stall_window": 0}
    below, above = (
        fixed_point(problem.G, start, ConstantRelaxation(f * omega), **options).status for f in (0.98, 1.02)
    )
    assert (below, above) == ("converged", "diverged")
    assert fixed_point(problem.G, start, IQNILS(), residual_rtol=1e-8).status == "converged"
