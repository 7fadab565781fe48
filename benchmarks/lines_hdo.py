r"""The O-D stretch of HDO at 2724 cm-1, of which one may have no records: an estimate of its lines.

Its P branch lies in the short-wave half of C07, and is most of what vapour absorbs there. The lines
are those of an asymmetric rotor, with the constants of the ground state [1]_ and those of the upper
state made less by what stretching one bond costs; they are some cm-1 off, which a band average does
not see. How strong the band is follows from H2-16O, whose symmetric and antisymmetric stretch, of
which there are records, have between them the strength of two O-H bonds, whatever their directions:

.. math:: S_\mathrm{OD} = \tfrac12 (S_{\nu_1} + S_{\nu_3})\, \mu_\mathrm{OH} / \mu_\mathrm{OD}

with reduced masses mu: a bond that is twice as heavy moves less. The ratio of the two bands gives
the angle between the changing dipole and the bond, 23 degrees outwards, so that the band of HDO is
mostly of type a. Rotation stretches the bond, which makes lines of the P branch stronger and of the
R branch weaker by the factor of Herman and Wallis for a diatomic molecule,

.. math:: F(m) = \Bigl(1 - 4 m\, \frac{B}{\omega}\, \frac{\mu_0}{\mu' r}\Bigr)^2, \qquad
   m = -J'',\ 0,\ J'' + 1

with the permanent dipole along the bond, 0.66 D, and its change with the length, 0.75 D / 1e-10 m.
Anharmonicity, the coupling to 2 nu2 and the dipole across the bond, which are left out, make the
lines in C07 uncertain by some 20 %. `lines_transmittance.py` prints what that is in transmittance;
LOWTRAN7, whose band model of vapour knows HDO, absorbs somewhat more between 2600 and 2700 cm-1.
Widths are those of lines of H2-16O of middling J, 0.09 cm-1 in air.

Used by `lines_of_air.py`, for what vapour has beside H2-16O.

References
----------
.. [1] F. C. De Lucia, R. L. Cook, P. Helminger and W. Gordy, "Millimeter and submillimeter wave
   rotational spectrum and centrifugal distortion effects of HDO", J. Chem. Phys., 55, 5334-5339,
   1971, doi:10.1063/1.1675674
"""

import numpy as np
from lines import SECOND_RADIATION_CONSTANT, Lines

BAND = 2723.68  # origin [cm-1]
# Strengths of nu1 and nu3 of H2-16O, of which the records of HITRAN 2020 from the ground state are
# the sums. [cm-1 / (molecule cm-2)]
SYMMETRIC, ANTISYMMETRIC = 5.37e-19, 7.79e-18
ABUNDANCE = 3.10693e-4  # natural [-] (HITRAN)
LARGEST_J = 18
HERMAN_WALLIS = 4 * (7.75 / BAND) * 0.657 / (0.75 * 0.958)
MEGAHERTZ = 1 / 29979.2458  # [cm-1]
# A, B, C, and the quartic constants Delta_J, Delta_JK, Delta_K, delta_J, delta_K. [MHz]
GROUND = (701931.5, 272912.6, 192055.2, 10.84, 34.21, 377.1, 3.647, 63.09)
# Stretching a bond along the axis of the smallest inertia takes 1 and 1.7 % of A and of B and C.
UPPER = (0.99 * GROUND[0], 0.983 * GROUND[1], 0.983 * GROUND[2], *GROUND[3:])
MASSES = {"H": 1.007825, "D": 2.014102, "O": 15.994915}
BOND_ANGLE, BOND = np.deg2rad(104.48), 0.9578  # of water [rad], [1e-10 m]


def hdo_lines() -> Lines:
    """Lines of the O-D stretch, natural abundance counted."""
    a, b = _direction(SYMMETRIC / ANTISYMMETRIC)
    lower = {j: _states(j, GROUND) for j in range(LARGEST_J + 2)}
    upper = {j: _states(j, UPPER) for j in range(LARGEST_J + 2)}
    rows = []
    for j in range(LARGEST_J + 1):
        for above in range(max(j - 1, 0), j + 2):
            strength = _strengths(above, upper[above][1], j, lower[j][1], a, b)
            m = {-1: -j, 0: 0, 1: j + 1}[above - j]
            strength = strength * (1 - HERMAN_WALLIS * m) ** 2
            position = BAND + upper[above][0][:, None] - lower[j][0]
            energy = np.broadcast_to(lower[j][0], position.shape)
            rows.append(np.stack([position, strength, energy], -1).reshape(-1, 3))
    position, strength, energy = np.concatenate(rows).T
    warm = np.exp(-SECOND_RADIATION_CONSTANT * energy / 296)
    weight = strength * warm * position * -np.expm1(-SECOND_RADIATION_CONSTANT * position / 296)
    heavy = _reduced("D") / _reduced("H")
    total = ABUNDANCE * (SYMMETRIC + ANTISYMMETRIC) / 2 / heavy
    intensity = total * weight / weight.sum()
    kept = intensity > 1e-6 * intensity.max()
    position, intensity, energy = (x[kept] for x in (position, intensity, energy))
    same = np.ones_like(position)
    return Lines((1, 4), position, intensity, 0.09 * same, 0.4 * same, energy, 0.7 * same, 0 * same)


def _reduced(atom: str) -> float:
    return MASSES["O"] * MASSES[atom] / (MASSES["O"] + MASSES[atom])


def _direction(ratio: float) -> tuple[float, float]:
    """Of the dipole that the O-D bond changes: cosines with the axes a and b."""
    # Two dipoles at an angle to the axis between the bonds add to the one band and to the other.
    from_middle = np.arctan(1 / np.sqrt(ratio))
    half = BOND_ANGLE / 2
    atoms = BOND * np.array([[0, 0], [np.cos(half), np.sin(half)], [np.cos(half), -np.sin(half)]])
    masses = np.array([MASSES["O"], MASSES["D"], MASSES["H"]])
    atoms = atoms - masses @ atoms / masses.sum()
    # The axis a of least inertia is the direction in which the masses are spread most.
    _, axes = np.linalg.eigh((masses[:, None] * atoms).T @ atoms)
    dipole = np.array([np.cos(from_middle), np.sin(from_middle)])
    b, a = axes.T @ dipole
    return float(a), float(b)


def _states(j: int, constants: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Energies [cm-1] and states, by K from -J to J, of the rotor. (Watson's A form, a as z)"""
    a, b, c, d_j, d_jk, d_k, e_j, e_k = MEGAHERTZ * np.array(constants)
    k = np.arange(-j, j + 1)
    square = j * (j + 1)
    energy = (b + c) / 2 * square + (a - (b + c) / 2) * k**2
    energy = energy - d_j * square**2 - d_jk * square * k**2 - d_k * k**4
    matrix = np.diag(energy)
    if j > 0:
        low = k[:-2]
        steps = (square - low * (low + 1)) * (square - (low + 1) * (low + 2))
        beside = (b - c) / 4 - e_j * square - e_k / 2 * (low**2 + (low + 2) ** 2)
        matrix = matrix + np.diag(beside * np.sqrt(steps), 2) + np.diag(beside * np.sqrt(steps), -2)
    return np.linalg.eigh(matrix)


def _strengths(
    above: int, upper: np.ndarray, j: int, lower: np.ndarray, a: float, b: float
) -> np.ndarray:
    """Line strengths from J to J' for a dipole of length 1; over all J' they add up to 2 J + 1."""
    matrix = np.zeros((2 * above + 1, 2 * j + 1))
    for k in range(-j, j + 1):
        for q, part in ((-1, b / np.sqrt(2)), (0, a), (1, -b / np.sqrt(2))):
            if abs(k + q) <= above:
                matrix[k + q + above, k + j] += part * _coupling(j, k, q, above)
    return (2 * j + 1) * (upper.T @ matrix @ lower) ** 2


def _coupling(j: int, k: int, q: int, above: int) -> float:
    """Clebsch-Gordan coefficient of (J, k) and (1, q) in (J', k + q)."""
    m = k + q
    if above == j + 1:
        squares = {
            0: (j - m + 1) * (j + m + 1) / ((2 * j + 1) * (j + 1)),
            1: (j + m) * (j + m + 1) / ((2 * j + 1) * (2 * j + 2)),
            -1: (j - m) * (j - m + 1) / ((2 * j + 1) * (2 * j + 2)),
        }
        return float(np.sqrt(squares[q]))
    if above == j:
        if q == 0:
            return m / np.sqrt(j * (j + 1)) if j else 0.0
        squares = {1: (j + m) * (j - m + 1), -1: (j - m) * (j + m + 1)}
        return float(-q * np.sqrt(squares[q] / (2 * j * (j + 1)))) if j else 0.0
    squares = {
        0: (j - m) * (j + m) / (j * (2 * j + 1)),
        1: (j - m) * (j - m + 1) / (2 * j * (2 * j + 1)),
        -1: (j + m + 1) * (j + m) / (2 * j * (2 * j + 1)),
    }
    return float((-1 if q == 0 else 1) * np.sqrt(squares[q]))
