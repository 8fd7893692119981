"""Linear membranes in force per length, and what is left of their stress when they wrinkle instead of being compressed.

Stress S (2nd Piola-Kirchhoff, N/m) and strain E (Green-Lagrange) are written in the axes 1 and 2 of the fibres as
(S11, S22, S12) and (E11, E22, 2 E12), component first, so that every step is arithmetic on rows of points.

Wrinkling: a fabric without bending stiffness folds at no cost, so that its energy is the least over all additional
strains by which it may shorten (Pipkin 1986, 1994; Steigmann and Pipkin 1989: relaxed energy, tension field). The
stress is then the projection of the unwrinkled C E on the stresses without compression, in the norm of the
compliance:

    S = argmin 1/2 (S - C E) : C^-1 : (S - C E)  over  S >= 0 (no negative eigenvalue).

The cone is convex and the norm strictly so: there is one answer, it is continuous in E, and its energy
W = 1/2 S : C^-1 : S is convex. Three states: taut, S = C E; slack, S = 0, where no fibre is stretched (E <= 0); else
wrinkled, S = s n n^T.

The direction of a wrinkled point. Lengths along 1 and 2 are scaled by E1^(1/4) and E2^(1/4), after which the compliance
knows one number k = (kappa - 1) / 2, kappa = sqrt(E1 E2) (1 / (2 G) - nu12 / E1), 0 for an isotropic membrane. With
twice the scaled angle psi of n, and the scaled strain of mean m and deviator R (cos alpha, sin alpha), W is the
largest value of

    w(psi) = N^2 / (2 c),   N = m + R cos(psi - alpha),   c = 1 + k sin^2 psi.

c is the same at psi, -psi and pi - psi, so the largest N of the four lies in the quadrant of alpha: only that one is
searched, and the other maxima, which orthotropic membranes have, need not be met. In the first quadrant w' = 0 reads

    R (1 + k) cos(alpha) / cos(psi) + m k - R sin(alpha) / sin(psi) = 0,

which rises from minus to plus infinity: one root.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

SLACK, WRINKLED, TAUT = 0, 1, 2  # states of a point
# Newton iterations for the direction of wrinkles, bisection where they leave the bracket: six do nearly always.
DIRECTION_ITERATIONS = 80
ROUNDING = 1e-12  # relative, of constants that are computed from others


@dataclass(frozen=True, eq=False)
class LinearMembrane:
    """Linear stress in the axes of the fibres: `E1`, `E2` (e,) N/m (modulus times thickness) along and across them,
    `nu12` (e,) contraction across over stretch along, `G` (e,) N/m in shear. nu21 = nu12 E2 / E1.

    `wrinkles`: without compression (tension field); else it resists compression as it does tension, up to buckling of
    the mesh. ValueError in one sentence for values that no material has.
    """

    E1: np.ndarray
    E2: np.ndarray
    nu12: np.ndarray
    G: np.ndarray
    wrinkles: bool = True

    def __post_init__(self):
        for name in ("E1", "E2", "G"):
            values = getattr(self, name)
            bad = ~(np.isfinite(values) & (values > 0.0))
            if bad.any():
                row = int(np.argmax(bad))
                raise ValueError(
                    f"membrane element number {row + 1} has {name} = {values[row]:g} N/m; it must be above zero."
                )
        bad = ~(self.nu12**2 < self.E1 / self.E2)
        if bad.any():
            row = int(np.argmax(bad))
            nu, e1, e2 = self.nu12[row], self.E1[row], self.E2[row]
            raise ValueError(
                f"membrane element number {row + 1} has nu12 = {nu:g} with E1 = {e1:g} and E2 = {e2:g} N/m; the size "
                f"of nu12 must be below sqrt(E1/E2) = {np.sqrt(e1 / e2):.4g}, or stretching would set energy free."
            )

    def __len__(self):
        return len(self.E1)

    def select(self, rows):
        """The membranes of the chosen elements."""
        parts = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{k: v[rows] for k, v in parts.items() if isinstance(v, np.ndarray)})

    def scaled(self, factor):
        """The membranes with `factor` (e,) times their stiffness."""
        return replace(self, E1=factor * self.E1, E2=factor * self.E2, G=factor * self.G)

    @property
    def isotropic(self):
        """Whether no direction of an element differs from another, (e,), to rounding."""
        same = np.abs(self.E1 - self.E2) <= ROUNDING * self.E1
        return same & (np.abs(2.0 * (1.0 + self.nu12) * self.G - self.E1) <= ROUNDING * self.E1)

    @property
    def plane(self):
        """C11, C12, C22 (e,) N/m of the plane stress C E; C33 is G."""
        factor = 1.0 / (1.0 - self.nu12**2 * self.E2 / self.E1)
        return factor * self.E1, factor * self.nu12 * self.E2, factor * self.E2

    @property
    def stiffest(self):
        """Largest stiffness (e,) N/m."""
        c11, _, c22 = self.plane
        return np.maximum(np.maximum(c11, c22), self.G)

    def strain(self, stress):
        """Strain (3,...,e) of a taut membrane under `stress` (3,...,e) N/m."""
        s1, s2, s12 = stress
        across = self.nu12 / self.E1
        return np.stack([s1 / self.E1 - across * s2, s2 / self.E2 - across * s1, s12 / self.G])

    def energy(self, strain):
        """Energy J/m^2 (...,e) at a `strain` (3,...,e): half of S : C^-1 : S."""
        stress, _ = self.response(strain, tangents=False)
        return 0.5 * np.sum(stress * self.strain(stress), axis=0)

    def response(self, strain, tangents=True, rounding=0.0):
        """Stress (3,...,e) N/m at a `strain` (3,...,e), and its derivative by the strain, the rows
        (11, 12, 13, 22, 23, 33) of a symmetric matrix (6,...,e) N/m; None without `tangents`.

        Where no strain is larger than `rounding`, a number or (...,e), the state is chance, and the derivative that of
        a taut membrane.
        """
        c11, c12, c22 = self.plane
        e1, e2, gamma = strain
        stress = np.stack([c11 * e1 + c12 * e2, c12 * e1 + c22 * e2, self.G * gamma])
        slope = None
        if tangents:
            slope = np.zeros((6, *e1.shape))
            slope[0], slope[1], slope[3], slope[5] = c11, c12, c22, self.G
        if self.wrinkles:
            taut = _non_negative(*stress)
            slack = ~taut & _non_negative(-e1, -e2, 0.5 * gamma)
            stress[:, slack] = 0.0
            known = np.abs(strain).max(axis=0) > rounding
            if slope is not None:
                slope[:, slack & known] = 0.0
            wrinkled = ~(taut | slack)
            rows = np.nonzero(wrinkled)[-1]
            if len(rows):
                found = self.select(rows)._wrinkled(strain[:, wrinkled], tangents)
                stress[:, wrinkled] = found[0]
                if slope is not None:
                    slope[:, wrinkled] = np.where(known[wrinkled], found[1], slope[:, wrinkled])
        return stress, slope

    def state(self, strain):
        """SLACK, WRINKLED or TAUT (...,e) at a `strain` (3,...,e); TAUT everywhere if the membrane does not wrinkle."""
        e1, e2, gamma = strain
        if not self.wrinkles:
            return np.full(e1.shape, TAUT)
        c11, c12, c22 = self.plane
        taut = _non_negative(c11 * e1 + c12 * e2, c12 * e1 + c22 * e2, self.G * gamma)
        return np.where(taut, TAUT, np.where(_non_negative(-e1, -e2, 0.5 * gamma), SLACK, WRINKLED))

    def _wrinkled(self, strain, tangents):
        """Stress (3,w) and slope (6,w) of points that are wrinkled, of which this has the rows (w,)."""
        root1, root2 = np.sqrt(self.E1), np.sqrt(self.E2)
        root12 = np.sqrt(root1 * root2)
        k = 0.5 * (root1 * root2 * (0.5 / self.G - self.nu12 / self.E1) - 1.0)
        k[self.isotropic] = 0.0  # and the direction is known without a search
        e1, e2, e12 = root1 * strain[0], root2 * strain[1], 0.5 * root12 * strain[2]
        mean, half = 0.5 * (e1 + e2), 0.5 * (e1 - e2)
        cos, sin = _wrinkle_direction(mean, np.abs(half), np.abs(e12), k)
        cos, sin = np.copysign(cos, half), np.copysign(sin, e12)
        c = 1.0 + k * sin * sin
        n = np.maximum(mean + half * cos + e12 * sin, 0.0)
        by_strain = np.stack([0.5 * root1 * (1.0 + cos), 0.5 * root2 * (1.0 - cos), 0.5 * root12 * sin])
        stress = (n / c) * by_strain
        if not tangents:
            return stress, None
        # d2W/dE2 = w_EE - w_Epsi w_psiE / w_psipsi, where N' = N c' / (2 c)
        dc, ddc = 2.0 * k * sin * cos, 2.0 * k * (cos * cos - sin * sin)
        turn = np.stack([-0.5 * root1 * sin, 0.5 * root2 * sin, 0.5 * root12 * cos]) - (0.5 * dc / c) * by_strain
        curvature = (half * cos + e12 * sin) / c - n * (0.25 * dc * dc / c - 0.5 * ddc) / (c * c)  # -w_psipsi / N
        spin = n / (c * c * np.where(curvature > 0.0, curvature, np.inf))
        pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
        return stress, np.stack([by_strain[i] * by_strain[j] / c + spin * turn[i] * turn[j] for i, j in pairs])


def isotropic_membrane(stiffness, nu, wrinkles=True):
    """Membrane of E h = `stiffness` (e,) N/m and Poisson's ratio `nu` (e,), the same in all directions.

    ValueError in one sentence unless -1 < nu < 1.
    """
    stiffness, nu = np.broadcast_arrays(np.asarray(stiffness, float), np.asarray(nu, float))
    bad = ~(np.abs(nu) < 1.0)
    if bad.any():
        row = int(np.argmax(bad))
        raise ValueError(
            f"membrane element number {row + 1} has nu = {nu[row]:g}; Poisson's ratio of an isotropic membrane lies "
            "between -1 and 1."
        )
    return LinearMembrane(stiffness, stiffness, nu, stiffness / (2.0 * (1.0 + nu)), wrinkles)


def _non_negative(s1, s2, s12):
    """Whether a symmetric 2 x 2 matrix has no negative eigenvalue."""
    return (s1 + s2 >= 0.0) & (s1 * s2 >= s12 * s12)


def _wrinkle_direction(m, a, b, k):
    """cos psi and sin psi in the first quadrant with a (1 + k) sin psi - b cos psi + m k sin psi cos psi = 0; a and b
    are not negative.
    """
    p = a * (1.0 + k)
    t = m * k
    psi = np.arctan2(b, p)
    rows = np.flatnonzero(t)
    if len(rows):
        psi[rows] = _first_quadrant_root(psi[rows], p[rows], b[rows], t[rows])
    return np.cos(psi), np.sin(psi)


def _first_quadrant_root(psi, p, q, t):
    """Root of p sin psi - q cos psi + t sin psi cos psi, from -q at 0 to p at a right angle, by bracketed Newton."""
    low, high = np.zeros_like(psi), np.full_like(psi, 0.5 * np.pi)
    scale = p + q + np.abs(t)
    for _ in range(DIRECTION_ITERATIONS):
        cos, sin = np.cos(psi), np.sin(psi)
        value = p * sin - q * cos + t * sin * cos
        slope = p * cos + q * sin + t * (cos * cos - sin * sin)
        low, high = np.where(value <= 0.0, psi, low), np.where(value >= 0.0, psi, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = psi - value / slope
        new = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        change = np.abs(new - psi)
        psi = new
        if np.all((change <= 3e-16) | (np.abs(value) <= 1e-17 * scale)):
            break
    return psi
