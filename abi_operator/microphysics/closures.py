r"""How a scheme that carries mass alone implies the number of particles.

Each closure gives the mean mass of a particle from the mass content of the air and, some, from
temperature. It is a frozen pytree: its figures are leaves that can be replaced, traced and
differentiated.

Powers of content below 1 have no derivative at zero content; here they count as zero there, with
derivative zero, and `number_concentration` then holds the mean mass above that of the smallest
particle, so that number is a smooth function of content from zero on.
"""

import math
from abc import abstractmethod

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..constants import FREEZING
from .gamma import MassLaw, log_gamma, log_moment


def soft_limits(
    x: Float[Array, "*n"], lower: float | Array, upper: float | Array, width: float
) -> Float[Array, "*n"]:
    """`x` held between two limits, approached exponentially.

    Parameters
    ----------
    x, lower, upper
        What is held, and between what.
    width
        Distance from a limit within which `x` is bent, by up to 0.7 of it at the limit itself.
    """
    above = lower + width * jax.nn.softplus((x - lower) / width)
    return upper - width * jax.nn.softplus((upper - above) / width)


def positive_power(x: Float[Array, "*n"], power: float) -> Float[Array, "*n"]:
    """x^power; 0, with derivative 0, where `x` is not positive."""
    positive = x > 0
    return jnp.where(positive, jnp.where(positive, x, 1) ** power, 0)


class Closure(eqx.Module):
    """Mean mass of a particle, from what a model carries."""

    @abstractmethod
    def mean_mass(
        self,
        content: Float[Array, "*n"],
        temperature: Float[Array, "*n"] | None,
        law: MassLaw,
        nu: float,
    ) -> Float[Array, "*n"]:
        """Mean mass of a particle. [kg]

        Parameters
        ----------
        content
            Mass of the class per volume of air. [kg m-3]
        temperature
            Temperature of the air; read by some closures alone. [K]
        law, nu
            Mass of one particle by its diameter, and shape of the size distribution.
        """


class Predicted(Closure):
    """No closure: the scheme predicts the number itself."""

    def mean_mass(self, content, temperature, law, nu):
        """Refused: the model's own number is to be used."""
        raise ValueError("this class has a predicted number: use the model's own, or a closure.")


class FixedNumber(Closure):
    """The same number of particles wherever there are any.

    Parameters
    ----------
    number
        Number of particles per volume of air. [m-3]
    """

    number: float | Float[Array, ""]

    def mean_mass(self, content, temperature, law, nu):
        """Content shared by the number. [kg]"""
        return jnp.where(content > 0, content, 0) / self.number


class Intercept(Closure):
    r"""A distribution dN/dD = N0 D^nu exp(-Lam D) of fixed N0.

    .. math:: \Lambda^{-(\nu + \beta + 1)} = \frac{q}{\alpha N_0 \Gamma(\nu + \beta + 1)}, \qquad
       \bar m = \alpha\, \frac{\Gamma(\nu + \beta + 1)}{\Gamma(\nu + 1)}\, \Lambda^{-\beta}

    Parameters
    ----------
    intercept
        N0. [m-4], where nu is 0
    """

    intercept: float | Float[Array, ""]

    def mean_mass(self, content, temperature, law, nu):
        """Mean mass by the slope that the content implies. [kg]"""
        return _of_intercept(content, self.intercept, law, nu)


class SnowIntercept(Closure):
    r"""Snow whose intercept grows with cold, as in the single-moment schemes of WRF [1]_.

    .. math:: N_0 = 2 \times 10^6\, \exp(0.12\, (T_0 - T))

    held between its value at 0 deg C and 1e11 m-4. The exponent is bent within half a degree of
    either end, so that temperature has a derivative there.

    Parameters
    ----------
    intercept, rate, largest
        N0 at 0 deg C, its growth with cold, and its limit. [m-4], [K-1], [m-4]

    References
    ----------
    .. [1] S.-Y. Hong, J. Dudhia and S.-H. Chen, "A revised approach to ice microphysical processes
       for the bulk parameterization of clouds and precipitation", Mon. Wea. Rev., 132, 103-120,
       2004, doi:10.1175/1520-0493(2004)132<0103:ARATIM>2.0.CO;2, eq. 6
    """

    intercept: float | Float[Array, ""] = 2e6
    rate: float | Float[Array, ""] = 0.12
    largest: float | Float[Array, ""] = 1e11

    def mean_mass(self, content, temperature, law, nu):
        """Mean mass by the slope that content and temperature imply. [kg]"""
        cold = self.rate * (FREEZING - _required(temperature, self))
        limit = jnp.log(jnp.asarray(self.largest / self.intercept, cold.dtype))
        intercept = self.intercept * jnp.exp(soft_limits(cold, 0.0, limit, 0.05))
        return _of_intercept(content, intercept, law, nu)


class IceMassPower(Closure):
    r"""Cloud ice whose number is a power of its content, as in the single-moment schemes of WRF.

    .. math:: N = 5.38 \times 10^7\, q^{0.75}

    between 1e3 and 1e6 m-3 (Hong, Dudhia and Chen, 2004, eq. 5c; see `SnowIntercept`). The limits
    are smooth: the lower one is added in quadrature, and so is, in the reciprocal, the upper one.

    Parameters
    ----------
    coefficient, power
        Of content in kg m-3. [m-3], [-]
    smallest, largest
        Limits of number. [m-3]
    """

    coefficient: float | Float[Array, ""] = 5.38e7
    power: float = eqx.field(static=True, default=0.75)
    smallest: float | Float[Array, ""] = 1e3
    largest: float | Float[Array, ""] = 1e6

    def mean_mass(self, content, temperature, law, nu):
        """Content shared by the number. [kg]"""
        relative = self.coefficient / self.smallest * positive_power(content, self.power)
        number = self.smallest * jnp.sqrt(1 + relative**2)
        number = number / jnp.sqrt(1 + (number / self.largest) ** 2)
        return jnp.where(content > 0, content, 0) / number


class FieldSnow(Closure):
    r"""Snow by the moments of Field et al. (2005) [1]_, as in the scheme of Thompson.

    With m = alpha D^2 the second moment is q / alpha; the third follows from it and from
    temperature,

    .. math:: M_3 = 10^{a(T)}\, M_2^{\,b(T)} ,

    and number is that of the gamma distribution of shape nu that has both. The many smallest
    crystals of the published distribution, which carry neither mass nor area, are not counted.
    Temperatures above -0.1 deg C count as that, with a bend of half a degree.

    References
    ----------
    .. [1] P. R. Field et al., "Parametrization of ice-particle size distributions for mid-latitude
       stratiform cloud", Q. J. R. Meteorol. Soc., 131, 1997-2017, 2005, doi:10.1256/qj.04.134,
       table 2
    """

    def mean_mass(self, content, temperature, law, nu):
        """Mean mass of the gamma distribution that has both moments. [kg]"""
        if law.power != 2:
            raise ValueError(f"the moments of Field et al. need m = alpha D^2; got {law=}.")
        celsius = _required(temperature, self) - FREEZING
        celsius = -0.1 - 0.5 * jax.nn.softplus((-0.1 - celsius) / 0.5)
        a = _field_polynomial(_FIELD_A, celsius)
        b = _field_polynomial(_FIELD_B, celsius)
        positive = content > 0
        second = jnp.where(positive, content, 1) / law.coefficient
        log_third = math.log(10) * a + b * jnp.log(second)
        # M3 / M2 = (nu + 3) / Lam, and the mean mass is alpha (nu + 1) (nu + 2) / Lam^2.
        inverse_slope = jnp.exp(log_third - jnp.log(second)) / (nu + 3)
        mass = law.coefficient * (nu + 1) * (nu + 2) * inverse_slope**2
        return jnp.where(positive, mass, 0)


class ThompsonGraupel(Closure):
    r"""Graupel whose intercept grows with its content, as in the scheme of Thompson (WRF 4).

    .. math:: \log_{10} N_0 = 3 + \tfrac27 (\log_{10} q + 8)

    with contents below 1e-9 kg m-3 counted as that, smoothly (module_mp_thompson.F of WRF 4).
    """

    def mean_mass(self, content, temperature, law, nu):
        """Mean mass by the slope that the content implies. [kg]"""
        # 1e-9 added in quadrature, in units of itself: its square underflows in single precision.
        log_content = math.log(1e-9) + jnp.log1p((1e9 * content) ** 2) / 2
        intercept = jnp.exp(math.log(10) * (3 + 16 / 7) + 2 / 7 * log_content)
        return _of_intercept(content, intercept, law, nu)


def _required(temperature: Array | None, closure: Closure) -> Array:
    if temperature is None:
        raise ValueError(f"{type(closure).__name__} needs the temperature; got None.")
    return temperature


def _of_intercept(content: Array, intercept: float | Array, law: MassLaw, nu: float) -> Array:
    """Mean mass where N0 is known."""
    order = nu + law.power + 1
    positive = content > 0
    safe = jnp.where(positive, content, 1)
    # Logarithms, as the factors of 1e-9 and 1e11 that meet here would leave single precision.
    log_scale = jnp.log(safe) - jnp.log(jnp.asarray(intercept, safe.dtype))
    log_scale = (log_scale - math.log(law.coefficient) - log_gamma(order)) / order
    log_mass = math.log(law.coefficient) + log_moment(law.power, nu) + law.power * log_scale
    return jnp.where(positive, jnp.exp(log_mass), 0)


# Coefficients of 1, T, n, T n, T^2, n^2, T^2 n, T n^2, T^3, n^3, with T in deg C, in the exponents
# a and b of M_n = 10^a M_2^b (Field et al., 2005, table 2). [-]
_FIELD_A = (
    *(5.065339, -0.062659, -3.032362, 0.029469, -0.000285),
    *(0.312550, 0.000204, 0.003199, 0.0, -0.015952),
)
_FIELD_B = (
    *(0.476221, -0.015896, 0.165977, 0.007468, -0.000141),
    *(0.060366, 0.000079, 0.000594, 0.0, -0.003577),
)


def _field_polynomial(c: tuple[float, ...], t: Array, n: int = 3) -> Array:
    """Exponent of the moment of order n, at t deg C."""
    constant = c[0] + c[2] * n + c[5] * n**2 + c[9] * n**3
    return constant + t * (c[1] + c[3] * n + c[7] * n**2 + t * (c[4] + c[6] * n + t * c[8]))
