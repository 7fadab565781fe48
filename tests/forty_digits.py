"""The discrete-ordinate problem of one column, evaluated with 40 digits.

It shares no code with the solver. Matrices are dense over (nodes, sun, view), unscaled and not
symmetric; layers start so thin that the rational tanh is exact to 40 digits. It decides which of
two solvers is right where they differ.
"""

import mpmath
import numpy as np
from mpmath import mp, mpf


def _gauss(count):
    """Gauss-Legendre nodes and weights on (0, 1), by Newton's method from float64."""
    nodes, weights = [], []
    for guess in np.polynomial.legendre.leggauss(count)[0]:
        x = mpmath.findroot(lambda t: mpmath.legendre(count, t), mpf(float(guess)))
        slope = count * (x * mpmath.legendre(count, x) - mpmath.legendre(count - 1, x))
        slope /= x * x - 1
        nodes.append((x + 1) / 2)
        weights.append(1 / ((1 - x * x) * slope * slope))
    return nodes, weights


def _legendre(m, degrees, mu):
    """sqrt((l - m)! / (l + m)!) P_l^m(mu) for l below `degrees`, zero for l < m."""
    value = mpf(1)
    for i in range(1, m + 1):
        value *= mp.sqrt(1 - mu * mu) * mp.sqrt(mpf(2 * i - 1) / (2 * i))
    out, before = [mpf(0)] * m, mpf(0)
    for degree in range(m, degrees):
        out.append(value)
        up, down = mp.sqrt(mpf((degree + 1) ** 2 - m * m)), mp.sqrt(mpf(degree**2 - m * m))
        before, value = value, ((2 * degree + 1) * mu * value - down * before) / up
    return out


def _layer(a, b, tau):
    """Half-layer admittance and impedance, doubled from a layer of tau / 2^k."""
    size = a.rows
    one = mp.eye(size)
    thick = tau * max(abs(a[i, i]) for i in range(size))
    doublings = max(0, int(mp.ceil(mp.log(max(thick, mpf(1)) * 4000, 2))))
    h = tau / 2 ** (doublings + 1)
    x = h * h * b * a
    phi = (945 * one + 105 * x + x * x) * ((945 * one + 420 * x + 15 * x * x) ** -1)
    admittance, impedance = h * a * phi, phi * h * b
    for _ in range(doublings):
        k = (one + impedance * admittance) ** -1
        admittance, impedance = 2 * admittance * k, 2 * k * impedance
    return admittance, impedance


def forty_digit_brf(tau, ssa, moments, albedo, mu0, mu, relative_azimuth, num_streams, corrected):
    """Bidirectional reflectance factor; arguments as `cdisort.cdisort_brf`."""
    with mp.workdps(45):
        count = num_streams // 2
        nodes, weights = _gauss(count)
        sun, view, size = count, count + 1, count + 2
        mu0, mu, albedo = mpf(float(mu0)), mpf(float(mu)), mpf(float(albedo))
        cosines, quadrature = [*nodes, mu0, mu], [*weights, mpf(1), mpf(0)]
        layers, single, above = [], mpf(0), mpf(0)
        secant = 1 / mu + 1 / mu0
        angle = -mu * mu0 - mp.sqrt(1 - mu * mu) * mp.sqrt(1 - mu0 * mu0) * mp.cos(
            mpf(float(relative_azimuth))
        )
        for t, w, chi in zip(tau, ssa, moments, strict=True):
            t, w, chi = mpf(float(t)), mpf(float(w)), [mpf(float(c)) for c in chi]
            f = chi[num_streams]
            scaled = (1 - w * f) * t
            chi_scaled = [(c - f) / (1 - f) for c in chi[:num_streams]]
            layers.append((scaled, w * (1 - f) / (1 - w * f), chi_scaled))
            if corrected:
                before, here, phase = mpf(1), angle, mpf(1)
                for degree in range(1, len(chi)):
                    phase += (2 * degree + 1) * chi[degree] * here
                    before, here = (
                        here,
                        ((2 * degree + 1) * angle * here - degree * before) / (degree + 1),
                    )
                part = mp.exp(-secant * above) * -mp.expm1(-secant * scaled)
                single += w * phase / (1 - w * f) * part / (4 * mu * mu0 * secant)
            above += scaled
        total = single
        for m in range(num_streams):
            functions = [_legendre(m, num_streams, c) for c in cosines]
            reflection = mp.zeros(size)
            if m == 0:
                for i in range(size):
                    for j in range(size):
                        right = mu0 if j == sun else cosines[j] * quadrature[j]
                        reflection[i, j] = 0 if i == sun or j == view else 2 * albedo * right
            stack = mp.eye(size) - 2 * reflection / (1 + albedo) if m == 0 else mp.eye(size)
            for scaled, w, chi in reversed(layers):
                a, b = mp.zeros(size), mp.zeros(size)
                for i in range(size):
                    for j in range(size):
                        even = odd = mpf(0)
                        blocked = i == sun or j == view or (corrected and (i, j) == (view, sun))
                        for degree in range(m, num_streams):
                            if blocked:
                                break
                            term = w * (2 * degree + 1) * chi[degree]
                            term *= functions[i][degree] * functions[j][degree] * quadrature[j]
                            even += term if (degree + m) % 2 == 0 else 0
                            odd += term if (degree + m) % 2 else 0
                        own = mpf(1 if i == j else 0)
                        a[i, j] = (own - even) / cosines[i]
                        b[i, j] = (own - odd) / cosines[i]
                admittance, impedance = _layer(a, b, scaled)
                one = mp.eye(size)
                middle = ((one + stack * impedance) ** -1) * (stack + admittance)
                stack = (admittance + middle) * ((one + impedance * middle) ** -1)
            corner = 2 * ((mp.eye(size) + stack) ** -1)[view, sun]
            factor = (1 if m == 0 else 2) * (-1) ** m * mp.cos(m * mpf(float(relative_azimuth)))
            total += factor * corner / (2 * mu0)
        return float(total)
