"""Number of particles from their mass, by the assumptions of a scheme."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .closures import Closure, Predicted, soft_limits
from .schemes import size_distribution


def number_concentration(
    scheme: str,
    name: str,
    content: Float[Array, "*n"],
    temperature: Float[Array, "*n"] | None = None,
    *,
    assume: str | None = None,
    closure: Closure | None = None,
) -> Float[Array, "*n"]:
    r"""Number of particles per volume of air, where a model gives their mass. [m-3]

    The mean mass m of a particle by the closure is held between the limits of the scheme, in
    quadrature,

    .. math:: N = q \sqrt{\frac{1}{m^2 + m_\mathrm{smallest}^2} + \frac{1}{m_\mathrm{largest}^2}} ,

    which is smooth, proportional to q at small contents, and within 1 % of q / m where m is seven
    times the one limit and a seventh of the other.

    Parameters
    ----------
    scheme, name
        Scheme and class of hydrometeor, names in `SCHEMES`.
    content
        Mass of the class per volume of air, mixing ratio times density. [kg m-3]
    temperature
        Temperature of the air, which some closures need. [K]
    assume
        Scheme whose assumptions are used where `scheme` is not in `SCHEMES`.
    closure
        What gives number, in place of the scheme's own.

    Raises
    ------
    ValueError
        Where the scheme is unknown and none is assumed, has no such class, or predicts its number.
    """
    distribution = size_distribution(scheme, name, assume=assume)
    closure = distribution.closure if closure is None else closure
    if isinstance(closure, Predicted):
        raise ValueError(
            f"scheme {scheme!r} predicts the number of {name!r}: use the model's own, or give the "
            "closure to assume."
        )
    mass = closure.mean_mass(content, temperature, distribution.law, distribution.nu)
    smallest, largest = distribution.smallest_mass, distribution.largest_mass
    # In units of the smallest mass, whose square underflows in single precision.
    inverse = jnp.sqrt(1 / (1 + (mass / smallest) ** 2) + (smallest / largest) ** 2)
    return jnp.where(content >= 0, content, 0) / smallest * inverse


def number_path(
    scheme: str,
    name: str,
    mass_path: Float[Array, "*batch layer"],
    thickness: Float[Array, "*batch layer"],
    temperature: Float[Array, "*batch layer"] | None = None,
    *,
    assume: str | None = None,
    closure: Closure | None = None,
) -> Float[Array, "*batch layer"]:
    """Number of particles in each layer per horizontal area, as a `Hydrometeor` carries it. [m-2]

    Parameters
    ----------
    scheme, name
        Scheme and class of hydrometeor, names in `SCHEMES`.
    mass_path, thickness
        Mass of the class in the layer per horizontal area; depth of the layer. [kg m-2], [m]
    temperature
        Mean temperature of the layer, which some closures need. [K]
    assume, closure
        As in `number_concentration`.
    """
    content = mass_path / thickness
    number = number_concentration(
        scheme, name, content, temperature, assume=assume, closure=closure
    )
    return number * thickness


def droplet_shape(scheme: str, number: Float[Array, "*n"]) -> Float[Array, "*n"]:
    r"""Shape nu of the size distribution of cloud droplets, by their number. [-]

    Thompson: nu = 1000 cm-3 / N + 2, up to 15. Morrison, after Martin et al. (1994) [1]_:
    nu = 1 / eta^2 - 1 with eta = 0.2714 + 0.0005714 N / cm-3, between 2 and 10. The rounding of the
    one is left out, and limits are smooth, so that number has a derivative.

    Parameters
    ----------
    scheme
        ``"thompson"`` or ``"morrison"``.
    number
        Number of droplets per volume of air. [m-3]

    References
    ----------
    .. [1] G. M. Martin, D. W. Johnson and A. Spice, "The measurement and parameterization of
       effective radius of droplets in warm stratocumulus clouds", J. Atmos. Sci., 51, 1823-1842,
       1994, doi:10.1175/1520-0469(1994)051<1823:TMAPOE>2.0.CO;2
    """
    if scheme == "thompson":
        # The eighth power makes a bend so short that N = 1e8 m-3 has a shape of 11.9 for 12.
        return 2 + ((number / 1e9) ** 8 + (1 / 13) ** 8) ** -0.125
    if scheme == "morrison":
        eta = 0.2714 + 0.0005714e-6 * number
        return soft_limits(1 / eta**2 - 1, 2.0, 10.0, 0.2)
    raise ValueError(f"no droplet shape of scheme {scheme!r}; have ['thompson', 'morrison'].")
