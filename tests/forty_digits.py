"""The discrete-ordinate problem of one column, evaluated with 40 digits.

It shares no code with the solver, and no algorithm: a layer's reflection and transmission come
from the Taylor series of its matrix exponential and from doubling, layers are joined by adding,
thermal emission enters the exponential as one more component. Matrices are dense over (nodes, sun,
views), unscaled and not symmetric. Numbers are balls (`flint.arb`) that contain what rounding has
done to them; a result whose ball is wider than 1e-40 of it is refused, unless it is narrower than
1e-60 of the sources: where nothing emits and nothing is lit the result is 0, of which no ball is a
part. So this decides which of two solvers is right where they differ.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from flint import arb, arb_mat, ctx
from forty_digit_layers import emitting, identity, scattering
from forty_digit_nodes import gauss, leaning

# 77 digits, of which exponentials, recursions and the pessimism of balls take 10 to 25.
BITS = 256
RADIUS = 1e-40
NOTHING = 1e-60


class Ground(NamedTuple):
    """A ground that is not Lambertian, in float64.

    `brdf(mu_out, mu_in, relative_azimuth)` is pi times the bidirectional reflectance distribution
    function, and `mode(m, mu_out, mu_in)` the rho_m of sum (2 - delta_m0) rho_m cos(m azimuth).
    """

    brdf: Callable[[float, float, float], float]
    mode: Callable[[int, float, float], float]


class _Layer(NamedTuple):
    """A scaled layer; `secant` attenuates the sun, `planck` is at its top and bottom."""

    tau: arb
    ssa: arb
    moments: list[arb]
    secant: arb
    planck: tuple[arb, arb]


class _Directions(NamedTuple):
    """Nodes, then the sun, then the views, with their quadrature weights."""

    cosines: list[arb]
    weights: list[arb]
    sun: int


def _legendre(m: int, degrees: int, mu: arb) -> list[arb]:
    """sqrt((l - m)! / (l + m)!) P_l^m(mu) for l below `degrees`, zero for l < m."""
    value = arb(1)
    for i in range(1, m + 1):
        value *= (1 - mu * mu).sqrt() * (arb(2 * i - 1) / (2 * i)).sqrt()
    out, before = [arb(0)] * m, arb(0)
    for degree in range(m, degrees):
        out.append(value)
        up, down = arb((degree + 1) ** 2 - m * m).sqrt(), arb(degree**2 - m * m).sqrt()
        before, value = value, ((2 * degree + 1) * mu * value - down * before) / up
    return out


def _matrices(
    layer: _Layer, functions: list, m: int, directions: _Directions, corrected: bool
) -> tuple[arb_mat, arb_mat]:
    """A and B of one mode: dt/dtau = A s, ds/dtau = B t with s = up + down, t = up - down."""
    cosines, weights, sun = directions
    size, out = len(cosines), []
    for parity in (0, 1):
        degrees = range(m + parity, len(layer.moments), 2)
        left = arb_mat([[f[degree] for degree in degrees] for f in functions])
        strength = [layer.ssa * (2 * degree + 1) * layer.moments[degree] for degree in degrees]
        right = [
            [w * f[degree] * s for w, f in zip(weights, functions, strict=True)]
            for degree, s in zip(degrees, strength, strict=True)
        ]
        kernel = (left * arb_mat(right)).tolist() if strength else [[arb(0)] * size] * size
        rows = []
        for i in range(size):
            # Nothing feeds the sun; the light it sends to a view at once may be added elsewhere.
            row = [int(i == j) - (arb(0) if i == sun else kernel[i][j]) for j in range(size)]
            if corrected and i > sun:
                row[sun] = arb(0)
            rows.append([x / cosines[i] for x in row])
        rows[sun][sun] = layer.secant
        out.append(arb_mat(rows))
    return out[0], out[1]


def _reflection(ground: float | Ground, m: int, directions: _Directions) -> arb_mat:
    """Reflection of the ground in one mode; a `Ground` sends nothing from the sun to the views."""
    cosines, weights, sun = directions
    size = len(cosines)
    rows = [[arb(0)] * size for _ in range(size)]
    for i in range(size):
        for j in range(sun + 1):
            if i == sun or (isinstance(ground, Ground) and i > sun and j == sun):
                continue
            if isinstance(ground, Ground):
                rho = (-1) ** m * arb(ground.mode(m, float(cosines[i]), float(cosines[j])))
            else:
                rho = arb(float(ground)) if m == 0 else arb(0)
            rows[i][j] = 2 * rho * cosines[j] * weights[j]
    return arb_mat(rows)


def _mode(
    layers: list[_Layer],
    ground: float | Ground,
    emission: arb | None,
    m: int,
    directions: _Directions,
    corrected: bool,
) -> tuple[arb_mat, arb_mat]:
    """Reflection of layers and ground in one mode, and what leaves their top by emission."""
    cosines, _, sun = directions
    size = len(cosines)
    one = identity(size)
    functions = [_legendre(m, len(layers[0].moments), c) for c in cosines]
    below = _reflection(ground, m, directions)
    glow = arb_mat([[arb(0) if i == sun or emission is None else emission] for i in range(size)])
    for layer in reversed(layers):
        if layer.tau == 0:
            continue
        a, b = _matrices(layer, functions, m, directions, corrected)
        steepest = max(float(1 / min(cosines)), float(layer.secant))
        if emission is None:
            reflection, transmission = scattering(a, b, layer.tau / 2, steepest)
        else:
            source = [-2 * (1 - layer.ssa) / c for c in cosines]
            source[sun] = arb(0)
            reflection, transmission, up, down = emitting(a, b, layer.tau, steepest, source)
        between = (one - below * reflection).inv()
        if emission is not None:
            top, bottom = layer.planck
            planck = arb_mat([[top], [(bottom - top) / layer.tau]])
            glow = up * planck + transmission * (between * (glow + below * (down * planck)))
        below = reflection + transmission * (between * (below * transmission))
    return below, glow


def _scaled(column: tuple, secant, planck_levels, num_streams: int, delta_m: bool) -> list[tuple]:
    """delta-M scaled layers, each with omega / (1 - omega f) and all its moments."""
    out = []
    for i, (t, w, chi) in enumerate(zip(*column, strict=True)):
        t, w, chi = arb(float(t)), arb(float(w)), [arb(float(c)) for c in chi]
        f = chi[num_streams] if delta_m else arb(0)
        kept = [(c - f) / (1 - f) for c in chi[:num_streams]]
        planck = (arb(float(planck_levels[i])), arb(float(planck_levels[i + 1])))
        ratio = w / (1 - w * f)
        scaled = _Layer((1 - w * f) * t, (1 - f) * ratio, kept, arb(secant[i]), planck)
        out.append((scaled, ratio, chi))
    return out


def _direct(
    scaled: list[tuple], ground, corrected: bool, sun: arb, view: arb, azimuth: arb, exact=None
) -> arb:
    """Light scattered once or reflected once, exactly, for an irradiance of pi.

    `exact` is the phase function of each layer, None for the sum of its moments.
    """
    angle = -view * sun
    angle -= (1 - view * view).sqrt() * (1 - sun * sun).sqrt() * azimuth.cos()
    degrees = range(len(scaled[0][2]) if corrected and exact is None else 0)
    # Not by recursion, in which balls grow by a digit in three degrees.
    polynomials = [(2 * degree + 1) * angle.legendre_p(degree) for degree in degrees]
    total, passed = arb(0), arb(0)
    for i, (layer, ratio, chi) in enumerate(scaled):
        both = 1 / view + layer.secant
        if corrected:
            if exact is None:
                phase = sum((p * c for p, c in zip(polynomials, chi, strict=True)), arb(0))
            else:
                phase = arb(float(exact[i]))
            part = (-passed).exp() * -(-both * layer.tau).expm1() / both
            total += ratio * phase * part / (4 * view)
        passed += both * layer.tau
    if isinstance(ground, Ground):
        brdf = ground.brdf(float(view), float(sun), float(azimuth))
        total += sun * arb(brdf) * (-passed).exp()
    return total


def _known(found: arb, sources: float) -> float:
    """The middle of a ball, which is 0 where the ball reaches it.

    Raises ArithmeticError where the ball is too wide.
    """
    if not float(found.rad()) <= max(RADIUS * abs(float(found)), NOTHING * sources):
        raise ArithmeticError(f"the result is only known as {found}.")
    return 0.0 if found.contains(0) else float(found)


def forty_digit_radiance(
    tau,
    ssa,
    moments,
    albedo,
    mu0,
    mu,
    relative_azimuth,
    num_streams,
    corrected,
    *,
    solar_irradiance=0.0,
    planck_levels=None,
    surface_emission=0.0,
    isotropic_top=0.0,
    secant=None,
    delta_m=True,
    phase_function=None,
    on_double_gauss=False,
):
    """Radiance at the top of one column in the units of its sources.

    `moments` has axes ``layer moment``; `mu` and `relative_azimuth` are numbers or lists of views.
    `albedo` is a number or a `Ground`, `secant` replaces 1/mu0 in each layer's attenuation of the
    sun, and `corrected` adds the exact single scattering, of one view that of `phase_function`
    where it is given. Nodes are the solver's, or CDISORT's with `on_double_gauss`. Numbers enter as
    float64, exactly.
    """
    before, ctx.prec = ctx.prec, BITS
    try:
        count = num_streams // 2
        pairs = (gauss if on_double_gauss else leaning)(count)
        sun = arb(float(mu0))
        views = [arb(float(x)) for x in np.atleast_1d(mu)]
        azimuths = [arb(float(x)) for x in np.atleast_1d(relative_azimuth)]
        directions = _Directions(
            [*(x for x, _ in pairs), sun, *views],
            [*(w for _, w in pairs), arb(1), *[arb(0)] * len(views)],
            count,
        )
        shines = planck_levels is not None or surface_emission != 0
        planck_levels = np.zeros(len(tau) + 1) if planck_levels is None else planck_levels
        secant = [1 / sun] * len(tau) if secant is None else [float(x) for x in secant]
        scaled = _scaled((tau, ssa, moments), secant, planck_levels, num_streams, delta_m)
        layers = [layer for layer, *_ in scaled]
        # Sunlight so far for an irradiance of pi.
        solar = [
            _direct(scaled, albedo, corrected, sun, view, azimuth, phase_function)
            for view, azimuth in zip(views, azimuths, strict=True)
        ]
        thermal = [arb(0)] * len(views)
        for m in range(num_streams if solar_irradiance else 1):
            unscattered = all(c == 0 for layer in layers for c in layer.moments[m:])
            if m and unscattered and not isinstance(albedo, Ground):
                break
            emission = arb(float(surface_emission)) if shines and m == 0 else None
            reflection, glow = _mode(layers, albedo, emission, m, directions, corrected)
            for v, azimuth in enumerate(azimuths):
                row = count + 1 + v
                factor = (1 if m == 0 else 2) * (-1) ** m * (m * azimuth).cos()
                solar[v] += factor * reflection[row, count] / 2
                if m == 0:
                    fallen = sum((reflection[row, j] for j in range(count)), arb(0))
                    thermal[v] = glow[row, 0] + arb(float(isotropic_top)) * fallen
        flux = arb(float(solar_irradiance)) / arb.pi()
        radiances = [flux * s + t for s, t in zip(solar, thermal, strict=True)]
        sources = max(solar_irradiance, surface_emission, isotropic_top, *planck_levels)
        values = [_known(x, float(sources)) for x in radiances]
        return np.array(values) if np.ndim(mu) else values[0]
    finally:
        ctx.prec = before


def forty_digit_albedo(tau, ssa, moments, albedo, mu0, num_streams):
    """Plane albedo of one column, from the mean over azimuth at the nodes alone. [-]

    Arguments as of `forty_digit_radiance`.
    """
    before, ctx.prec = ctx.prec, BITS
    try:
        pairs, sun = leaning(num_streams // 2), arb(float(mu0))
        cosines, weights = (
            [*own, last] for own, last in zip(zip(*pairs, strict=True), (sun, arb(1)), strict=True)
        )
        directions = _Directions(cosines, weights, len(pairs))
        scaled = _scaled(
            (tau, ssa, moments), [1 / sun] * len(tau), np.zeros(len(tau) + 1), num_streams, True
        )
        layers = [layer for layer, *_ in scaled]
        reflection, _ = _mode(layers, albedo, None, 0, directions, False)
        up = [w * x * reflection[i, len(pairs)] for i, (x, w) in enumerate(pairs)]
        return _known(sum(up, arb(0)) / sun, 1.0)
    finally:
        ctx.prec = before


def forty_digit_brf(*column, on_double_gauss=False):
    """Bidirectional reflectance factor; arguments as `cdisort.cdisort_brf`, and whose nodes."""
    how = {"solar_irradiance": 1.0, "on_double_gauss": on_double_gauss}
    mu0 = column[4]
    return np.pi * forty_digit_radiance(*column, **how) / mu0
