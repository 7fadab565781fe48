"""Mie theory for many spheres at once, in NumPy, and means over distributions of their sizes.

The series are those of Bohren and Huffman (1983), chapter 4; `test_mie.py` holds them against
miepython, which takes the spheres one by one.
"""

import functools

import numpy as np

CHUNK = 512  # spheres at a time


def series(index, x):
    """Coefficients a_n and b_n, n = 1, 2, ..., of spheres of size parameter x, (n, sphere).

    Logarithmic derivative downwards, Riccati-Bessel functions upwards; zero beyond the usual
    length x + 4.05 x^(1/3) + 2 of the series. The index is n - ik.
    """
    last = (x + 4.05 * np.cbrt(x) + 2).astype(int)
    longest = int(last.max())
    z = 1 / (index * x)
    derivative = np.zeros((longest + 1, x.size), complex)
    below = np.zeros(x.size, complex)
    beyond = max(longest, int(1 / np.abs(z).min()))
    for n in range(beyond + 16 + int(8 * np.cbrt(beyond)), 0, -1):
        ratio = n * z
        below = ratio - 1 / (below + ratio)  # now that of n - 1
        if n - 1 <= longest:
            derivative[n - 1] = below
    psi, chi = np.empty((2, longest + 2, x.size))  # of n - 1 in row n
    psi[0], psi[1] = np.cos(x), np.sin(x)
    chi[0], chi[1] = -np.sin(x), np.cos(x)
    for n in range(1, longest + 1):
        step = (2 * n - 1) / x
        psi[n + 1] = step * psi[n] - psi[n - 1]
        chi[n + 1] = step * chi[n] - chi[n - 1]
    xi = psi + 1j * chi
    n = np.arange(1, longest + 1)[:, None]
    electric, magnetic = derivative[1:] / index + n / x, derivative[1:] * index + n / x
    a = (electric * psi[2:] - psi[1:-1]) / (electric * xi[2:] - xi[1:-1])
    b = (magnetic * psi[2:] - psi[1:-1]) / (magnetic * xi[2:] - xi[1:-1])
    beyond = n > last
    a[beyond], b[beyond] = 0, 0
    return a, b


def efficiencies(index, x, a, b):
    """Q_ext, Q_sca and Q_sca times the asymmetry factor of each sphere. [-]"""
    n = np.arange(1, len(a) + 1)[:, None]
    extinction = np.sum((2 * n + 1) * (a + b).real, axis=0)
    scattering = np.sum((2 * n + 1) * (abs(a) ** 2 + abs(b) ** 2), axis=0)
    along = (n * (n + 2) / (n + 1))[:-1] * (a[:-1] * a[1:].conj() + b[:-1] * b[1:].conj())
    across = (2 * n + 1) / (n * (n + 1)) * a * b.conj()
    directed = 2 * np.sum(along.real, axis=0) + 2 * np.sum(across.real, axis=0)
    if index.imag == 0:
        extinction = scattering
    return 2 / x**2 * np.stack([extinction, scattering, directed])


def chunks(radius_um, wavelength_um):
    """Size parameters in pieces of nearly one size, each with the slice of the spheres it is."""
    x = 2 * np.pi * radius_um / wavelength_um
    first = 0
    while first < x.size:
        piece = slice(first, min(first + CHUNK, np.searchsorted(x, 1.4 * x[first])))
        yield piece, x[piece]
        first = piece.stop


def sphere_efficiencies(index, radius_um, wavelength_um):
    """`efficiencies` of spheres of rising radius, (3, sphere). [-]"""
    found = np.empty((3, radius_um.size))
    for piece, x in chunks(radius_um, wavelength_um):
        found[:, piece] = efficiencies(index, x, *series(index, x))
    return found


def lognormal(radius_um, effective_radius_um, log_width):
    """Share of each sphere in the volume of a lognormal distribution, radii equidistant in log.

    The median radius of volume is exp(width^2 / 2) effective radii (Hansen and Travis, 1974).
    """
    median = effective_radius_um * np.exp(log_width**2 / 2)
    share = np.exp(-((np.log(radius_um / median) / log_width) ** 2) / 2)
    return share / share.sum()


@functools.cache
def _angles(longest):
    """Gauss nodes and weights, and (2n + 1) / (n (n + 1)) times pi_n + tau_n and pi_n - tau_n."""
    cosine, weight = np.polynomial.legendre.leggauss(longest + 40)
    return cosine, weight, *angular_functions(cosine, longest)


def angular_functions(cosine, longest):
    """(2n + 1) / (n (n + 1)) times pi_n + tau_n and pi_n - tau_n, (angle, n)."""
    plus, minus = np.empty((2, cosine.size, longest))
    before, here = np.zeros_like(cosine), np.ones_like(cosine)
    for n in range(1, longest + 1):
        tau = n * cosine * here - (n + 1) * before
        scale = (2 * n + 1) / (n * (n + 1))
        plus[:, n - 1], minus[:, n - 1] = scale * (here + tau), scale * (here - tau)
        before, here = here, ((2 * n + 1) * cosine * here - (n + 1) * before) / n
    return plus, minus


def phase_functions(index, radius_um, wavelength_um, areas, cosine, num_moments):
    """Moments and phase functions of distributions of spheres, mean 1 over the sphere.

    Parameters
    ----------
    index, radius_um, wavelength_um
        n - ik; radii, rising; wavelength. [-], [um], [um]
    areas
        Geometric cross section of each sphere in each distribution, (distribution, sphere).
    cosine
        Cosines of the scattering angles wanted. [-]
    num_moments
        Legendre moments wanted, 80 at most: Gauss sums over |S1|^2 + |S2|^2 are exact then.

    Returns
    -------
    Moments (distribution, moment) without 2l + 1, and P (distribution, angle). [-]
    """
    moments = np.zeros((len(areas), num_moments))
    wanted = np.zeros((len(areas), cosine.size))
    for piece, x in chunks(radius_um, wavelength_um):
        a, b = series(index, x)
        longest = 32 * (1 + len(a) // 32)  # few lengths, so that angles can be kept
        nodes, weight, *functions = _angles(longest)
        of_sphere = areas[:, piece] / x**2

        def intensity(functions, a=a, b=b, of_sphere=of_sphere):
            total = 0.0
            for angular, coefficients in zip(functions, (a + b, a - b), strict=True):
                for part in (coefficients.real, coefficients.imag):
                    total = total + (angular[:, : len(a)] @ part) ** 2
            return of_sphere @ total.T

        legendre = np.polynomial.legendre.legvander(nodes, num_moments - 1)
        moments += intensity(functions) @ (weight[:, None] * legendre)
        wanted += intensity(angular_functions(cosine, len(a)))
    return moments / moments[:, :1], 2 * wanted / moments[:, :1]
