r"""The sea: sun glint of a rough surface, foam, and light that comes out of the water.

Symbols: :math:`\theta_i, \theta_v` zenith angles of incident and reflected light,
:math:`\Delta\phi` the azimuth between them (pi in the glint), :math:`\mu` their cosines,
:math:`\sigma^2` the variance of slopes, :math:`\theta_n` the tilt of the facet that reflects one
into the other and :math:`\chi` the angle of incidence on it:

.. math:: 4\cos^2\chi = (\mu_i + \mu_v)^2 + h, \qquad \tan^2\theta_n = \frac{h}{(\mu_i + \mu_v)^2},
   \qquad h = \sin^2\theta_i + \sin^2\theta_v + 2\sin\theta_i\sin\theta_v\cos\Delta\phi .
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .azimuth import azimuth_mode, glint_azimuths, sine_of

# Refractive index n - ik of pure water at the centroids of GOES-16. [-] (D. J. Segelstein, "The
# complex refractive index of water", M.S. thesis, University of Missouri-Kansas City, 1981; n
# interpolated linearly, k log-log, from the tables of refractiveindex.info, CC0)
PURE_WATER: dict[str, tuple[float, float]] = {
    "C01": (1.3419, 7.228e-10),
    "green": (1.3356, 2.674e-9),
    "C02": (1.3312, 1.569e-8),
    "C03": (1.3244, 3.527e-7),
    "C04": (1.3145, 6.239e-5),
    "C05": (1.3094, 8.859e-5),
    "C06": (1.2825, 3.635e-4),
    "C07": (1.3406, 3.769e-3),
}
# What 34.3 g of salt in 1 kg add to n. [-] (as in 6SV: E. F. Vermote et al., "Second Simulation of
# the Satellite Signal in the Solar Spectrum, 6S: an overview", IEEE Trans. Geosci. Remote Sens.,
# 35, 675-686, 1997, doi:10.1109/36.581987)
SALT = 0.006
# Effective reflectance of foam, young and old, interpolated to the centroids; none is known beyond
# 2.5 um. [-] (P. Koepke, "Effective reflectance of oceanic whitecaps", Appl. Opt., 23, 1816-1824,
# 1984, doi:10.1364/AO.23.001816, as tabulated every 0.1 um in 6SV)
FOAM_REFLECTANCE: dict[str, float] = {
    "C01": 0.22,
    "green": 0.22,
    "C02": 0.22,
    "C03": 0.212,
    "C04": 0.137,
    "C05": 0.100,
    "C06": 0.063,
    "C07": 0.0,
}
# Reflectance of clear sea water below its surface, as seen above it: rounded, a default to be
# replaced. It is nearly constant where there is little chlorophyll, below 0.25 mg m-3. [-] (clear
# waters: H. R. Gordon and D. K. Clark, "Clear water radiances for atmospheric correction of coastal
# zone color scanner imagery", Appl. Opt., 20, 4175-4180, 1981, doi:10.1364/AO.20.004175)
WATER_REFLECTANCE: dict[str, float] = {
    "C01": 0.02,
    "green": 0.01,
    "C02": 0.002,
    "C03": 0.0,
    "C04": 0.0,
    "C05": 0.0,
    "C06": 0.0,
    "C07": 0.0,
}
# How far `modes` spreads the glint: 0.1 is the best of 0.05 to 1 where nodes are few. [-]
SPREAD = 0.1


class Ocean(eqx.Module):
    r"""Glint by Cox and Munk [1]_ with Fresnel's and Smith's [3]_ laws, foam [2]_ and the water.

    .. math:: \rho = (1 - W)(\rho_{glint} + \rho_{water}) + W\rho_{foam}, \qquad
       W = 2.95\times10^{-6}\, U^{3.52},

    see `glint`, `foam_fraction`; light out of the water is Lambertian and of a reflectance that
    holds what its surface lets in and out. The sea is as rough from all sides (Cox and Munk find
    the variance along the wind up to twice that across it).

    Winds are not clipped: above 37 m/s, where W would be above 1, they are refused with the state
    (`check_state`), and storms above 15 m/s lie beyond what Cox and Munk saw. A dead calm is still
    rough, with a variance of 0.003.

    Parameters
    ----------
    wind_speed
        Wind speed U, 0 or more (10 m above the sea for the foam, 12.5 m for the slopes). [m s-1]
    refractive_index, absorption_index
        n and k of sea water in a band. [-]
    water_reflectance
        Reflectance of the water below its surface. [-]
    foam_reflectance
        Reflectance of foam. [-]
    num_azimuths
        Nodes from which `modes` integrates the glint, crowded towards it as its width demands. At
        any wind 12 of them give the first 16 modes to 1e-6 of the mean, 24 the first 32 to 1e-10
        and 48 the first 64 to 1e-12; modes of twice their number are wrong.

    References
    ----------
    .. [1] C. Cox and W. Munk, "Measurement of the roughness of the sea surface from photographs of
       the sun's glitter", J. Opt. Soc. Am., 44, 838-850, 1954, doi:10.1364/JOSA.44.000838
    .. [2] E. C. Monahan and I. G. O'Muircheartaigh, "Optimal power-law description of oceanic
       whitecap coverage dependence on wind speed", J. Phys. Oceanogr., 10, 2094-2099, 1980,
       doi:10.1175/1520-0485(1980)010<2094:OPLDOO>2.0.CO;2
    .. [3] B. G. Smith, "Geometrical shadowing of a random rough surface", IEEE Trans. Antennas
       Propag., 15, 668-671, 1967, doi:10.1109/TAP.1967.1138991
    """

    wind_speed: Float[Array, "*#batch"]
    refractive_index: Float[Array, "*#batch"]
    absorption_index: Float[Array, "*#batch"]
    water_reflectance: Float[Array, "*#batch"]
    foam_reflectance: Float[Array, "*#batch"]
    num_azimuths: int = eqx.field(static=True, default=48)

    def brdf(
        self,
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
        relative_azimuth: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        """Bidirectional reflectance factor. [-]

        Parameters
        ----------
        mu_out, mu_in
            Cosines of the zenith angles of reflected and incident light, both above 0. [-]
        relative_azimuth
            0 where light is sent back to where it came from, pi in the glint. [rad]
        """
        foam = foam_fraction(self.wind_speed)
        return (1 - foam) * self._glint(mu_out, mu_in, relative_azimuth) + self._lambertian(foam)

    def modes(
        self,
        m: int | Int[Array, ""],
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        """Azimuth mode m of `brdf`. [-]"""
        mu_out, mu_in = jnp.broadcast_arrays(mu_out, mu_in)
        width = glint_width(mu_out, mu_in, slope_variance(self.wind_speed))
        azimuth, weight = glint_azimuths(self.num_azimuths, width)
        glint = azimuth_mode(m, self._glint(mu_out[None], mu_in[None], azimuth), azimuth, weight)
        foam = foam_fraction(self.wind_speed)
        constant = jnp.where(jnp.asarray(m) == 0, self._lambertian(foam), 0)
        return (1 - foam) * glint + constant

    def white_sky_albedo(self) -> Float[Array, "*batch"]:
        r"""Share of isotropic light that is reflected, the mean of all directions. [-]

        By 16 directions each way: right to 3e-5 in a calm and to 1e-9 from 1 m/s on.
        """
        x, weight = np.polynomial.legendre.leggauss(16)
        fields = jnp.broadcast_arrays(*jax.tree.leaves(self))
        shape = (x.size,) + (1,) * fields[0].ndim
        mu = jnp.asarray((1 + x) / 2, fields[0].dtype).reshape(shape)
        projected = jnp.asarray(weight / 2, mu.dtype).reshape(shape) * mu
        mean = replace(self, num_azimuths=16).modes(0, mu[:, None], mu[None])
        return 4 * jnp.sum(projected[:, None] * projected[None] * mean, axis=(0, 1))

    def _glint(self, mu_out: Array, mu_in: Array, relative_azimuth: Array) -> Array:
        variance = slope_variance(self.wind_speed)
        index, absorption = self.refractive_index, self.absorption_index
        return glint(mu_out, mu_in, relative_azimuth, variance, index, absorption)

    def _lambertian(self, foam: Array) -> Array:
        return (1 - foam) * self.water_reflectance + foam * self.foam_reflectance


def ocean(
    wind_speed: Float[Array, "*#batch"],
    band: str,
    water_reflectance: Float[Array, "*#batch"] | None = None,
    foam_reflectance: Float[Array, "*#batch"] | None = None,
) -> Ocean:
    """The sea in a band, of the usual salinity.

    Parameters
    ----------
    wind_speed
        Wind speed. [m s-1]
    band
        Name of the band.
    water_reflectance, foam_reflectance
        As in `Ocean`; None for the defaults of the band. [-]

    Raises
    ------
    ValueError
        If the band is not known.
    """
    if band not in PURE_WATER:
        raise ValueError(f"no sea water for band {band!r}; have {list(PURE_WATER)}.")
    dtype = wind_speed.dtype
    index, absorption = PURE_WATER[band]
    if water_reflectance is None:
        water_reflectance = jnp.asarray(WATER_REFLECTANCE[band], dtype)
    if foam_reflectance is None:
        foam_reflectance = jnp.asarray(FOAM_REFLECTANCE[band], dtype)
    return Ocean(
        wind_speed,
        jnp.asarray(index + SALT, dtype),
        jnp.asarray(absorption, dtype),
        water_reflectance,
        foam_reflectance,
    )


def slope_variance(wind_speed: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    r"""Variance of the slopes in both directions together, :math:`0.003 + 0.00512\,U`. [-]"""
    return 0.003 + 0.00512 * wind_speed


def foam_fraction(wind_speed: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    r"""Share of the sea under foam, :math:`2.95\times10^{-6}\,U^{3.52}`. [-]"""
    return 2.95e-6 * wind_speed**3.52


def glint(
    mu_out: Float[Array, "*#shape"],
    mu_in: Float[Array, "*#shape"],
    relative_azimuth: Float[Array, "*#shape"],
    variance: Float[Array, "*#shape"],
    refractive_index: Float[Array, "*#shape"],
    absorption_index: Float[Array, "*#shape"],
) -> Float[Array, "*shape"]:
    r"""Reflectance factor of a surface of facets that are tilted at random.

    .. math:: \rho = \frac{F(\chi)}{4\mu_i\mu_v\cos^4\theta_n}\,
       \frac{e^{-\tan^2\theta_n/\sigma^2}}{\sigma^2}\,
       \frac{1}{1 + \Lambda(\mu_i) + \Lambda(\mu_v)}

    The last factor is the share of facets that see both sun and satellite [1]_, [2]_, without
    which more light than falls in would leave at grazing angles; with it a perfect mirror loses
    what would meet the sea twice.

    Parameters
    ----------
    mu_out, mu_in, relative_azimuth
        As in `Ocean.brdf`. [-], [rad]
    variance
        Variance of slopes. [-]
    refractive_index, absorption_index
        n and k of sea water. [-]

    References
    ----------
    .. [1] M. I. Sancer, "Shadow-corrected electromagnetic scattering from a randomly rough
       surface", IEEE Trans. Antennas Propag., 17, 577-585, 1969, doi:10.1109/TAP.1969.1139516
    .. [2] L. Tsang, J. A. Kong and R. T. Shin, "Theory of Microwave Remote Sensing", Wiley, 1985
    """
    vertical, horizontal = (mu_out + mu_in) ** 2, _horizontal(mu_out, mu_in, relative_azimuth)
    steepness = horizontal / vertical
    fresnel = fresnel_reflectance(
        0.5 * jnp.sqrt(vertical + horizontal), refractive_index, absorption_index
    )
    visible = 1 / (1 + _shadowing(mu_out, variance) + _shadowing(mu_in, variance))
    slopes = jnp.exp(-steepness / variance) / variance
    return fresnel * visible * slopes * (1 + steepness) ** 2 / (4 * mu_out * mu_in)


def _horizontal(mu_out: Array, mu_in: Array, relative_azimuth: Array) -> Array:
    """Square of the horizontal part of the sum of both directions."""
    out, into = sine_of(mu_out), sine_of(mu_in)
    return (out - into) ** 2 + 4 * out * into * jnp.cos(relative_azimuth / 2) ** 2


def _shadowing(mu: Array, variance: Array) -> Array:
    r"""Smith's :math:`\Lambda = \tfrac12(\tfrac{t}{\sqrt\pi} e^{-1/t^2} - \mathrm{erfc}\tfrac1t)`.

    t is sigma tan(theta). Below 0.04 it is 0 to 1e-270, and its formula 0 times infinity.
    """
    slope = jnp.sqrt(variance) * sine_of(mu) / mu
    flat = slope < 0.04
    t = jnp.where(flat, 1, slope)
    value = 0.5 * (t / float(np.sqrt(np.pi)) * jnp.exp(-1 / t**2) - jax.scipy.special.erfc(1 / t))
    return jnp.where(flat, 0, value)


def fresnel_reflectance(
    cosine: Float[Array, "*#shape"],
    refractive_index: Float[Array, "*#shape"],
    absorption_index: Float[Array, "*#shape"],
) -> Float[Array, "*shape"]:
    r"""Share of unpolarised light that a flat surface reflects.

    With :math:`(a - ib)^2 = (n - ik)^2 - \sin^2\chi`:

    .. math:: R_s = \frac{(a - \cos\chi)^2 + b^2}{(a + \cos\chi)^2 + b^2}, \qquad
       R_p = R_s \frac{(a - \sin\chi\tan\chi)^2 + b^2}{(a + \sin\chi\tan\chi)^2 + b^2} .

    Parameters
    ----------
    cosine
        Cosine of the angle of incidence chi. [-]
    refractive_index, absorption_index
        n and k of what lies behind the surface; n is above 1. [-]
    """
    sine_squared = (1 - cosine) * (1 + cosine)
    difference = refractive_index**2 - absorption_index**2 - sine_squared
    product = refractive_index * absorption_index
    a = jnp.sqrt(0.5 * (difference + jnp.sqrt(difference**2 + 4 * product**2)))
    b = product / a
    across = ((a - cosine) ** 2 + b**2) / ((a + cosine) ** 2 + b**2)
    # Times cosine, so that light along the surface does no harm.
    along = (a * cosine - sine_squared) ** 2 + (b * cosine) ** 2
    along = along / ((a * cosine + sine_squared) ** 2 + (b * cosine) ** 2)
    return 0.5 * across * (1 + along)


def glint_width(
    mu_out: Float[Array, "*#shape"],
    mu_in: Float[Array, "*#shape"],
    variance: Float[Array, "*#shape"],
) -> Float[Array, "*shape"]:
    r"""Width of the glint in azimuth, 1 where it has none. [rad]

    As a function of azimuth the slopes' density is :math:`\exp(-\kappa\cos\Delta\phi)`, with
    :math:`\kappa = 2\sin\theta_i\sin\theta_v / (\sigma(\mu_i + \mu_v))^2`.
    """
    sharpness = 2 * sine_of(mu_out) * sine_of(mu_in) / (variance * (mu_out + mu_in) ** 2)
    return 1 / jnp.sqrt(1 + SPREAD * sharpness)
