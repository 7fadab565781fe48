r"""Absorption by gases in one band, as a sum of exponentials."""

from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...atmosphere import Atmosphere
from ...bands import Band
from ...optical_properties import OpticalProperties
from .tables import TABLES

ALL_GASES = ("O3", "H2O", "CO2", "CH4", "N2O", "O2", "N2")
"""Gases that absorb in some band; of oxygen and nitrogen air has the same everywhere."""


def gas_absorption(
    atmosphere: Atmosphere, band: Band, gases: Sequence[str] = ALL_GASES
) -> OpticalProperties:
    r"""Absorption by the gases of one column, by the sum of exponentials of the band.

    .. math:: T(m) = \sum_t w_t \exp\Bigl(-m \sum_k \tau_{tk}\Bigr), \qquad
       \tau_{tk} = \sum_g c_{tg}\, u_{gk}

    with additive amounts u of each gas g in the layers k. The sums of several gases in a band are
    fitted as one, in which each gas alone and all together have the transmittance that was
    published (`tables` states the errors). Where the gases asked for are grey, there is one term.

    Parameters
    ----------
    atmosphere
        One column; without `Gases` nothing absorbs. Temperature is read in C04.
    band
        One of `BANDS`.
    gases
        Gases that are to absorb, of `ALL_GASES`.

    Raises
    ------
    ValueError
        Where a band or a gas is not known, or the column lacks a temperature that is needed.
    """
    if band.name not in TABLES:
        raise ValueError(f"no gas absorption for band {band.name!r}; have {list(TABLES)}.")
    unknown = [gas for gas in gases if gas not in ALL_GASES]
    if unknown:
        raise ValueError(f"gases {unknown} are not known; choose from {ALL_GASES}.")
    table = TABLES[band.name]
    dtype = atmosphere.pressure.dtype
    absorbers = [a for a in table.absorbers if a.gas in gases]
    if atmosphere.gases is None or not absorbers:
        nothing = jnp.zeros((1, atmosphere.pressure.shape[0] - 1), dtype)
        return OpticalProperties(nothing, jnp.ones(1, dtype), ())
    terms = len(table.weight)
    if all(len(set(a.coefficients)) == 1 for a in absorbers):
        terms = 1
    weight = jnp.asarray(table.weight if terms > 1 else (1.0,), dtype)
    coefficients = jnp.asarray([a.coefficients[:terms] for a in absorbers], dtype)
    amounts = jnp.stack([a.amount(atmosphere) for a in absorbers])
    extinction = jnp.sum(coefficients[:, :, None] * amounts[:, None, :], axis=0)
    return OpticalProperties(extinction, weight, ())


def transmittance(
    optics: OpticalProperties, air_mass: Float[Array, "*path"]
) -> Float[Array, "*path"]:
    r"""Direct transmittance of a column, :math:`\sum_t w_t \exp(-m \sum_k \tau_{tk})`. [-]

    Parameters
    ----------
    optics
        What attenuates, by absorption and by scattering.
    air_mass
        Length of the path relative to the vertical: :math:`1 / \mu` one way, or
        :math:`1 / \mu_0 + 1 / \mu` to the ground and back. [-]
    """
    depth = jnp.sum(optics.extinction, axis=1)
    return jnp.sum(optics.weight * jnp.exp(-air_mass[..., None] * depth), axis=-1)
