"""The operator: from a specified state to the reflectances that the ABI would see.

The reflectance factor of ABI files is rho = pi d^2 L / E0, with L the radiance, E0 the band's solar
irradiance at 1 AU and d the distance of the sun in AU. It contains the cosine of the solar zenith
angle, rho = mu0 * brf, and depends on d and E0 no longer once L is the answer to that sunlight;
`brf`, the bidirectional reflectance factor, is 1 for a white Lambertian ground without air. Both
are of sunlight alone: what the ground and the air emit in C07 is not in them.
"""

from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float

from .atmosphere import State
from .band_columns import band_columns, checked_bands, uniform
from .bands import GRASSO2013
from .optics import ALL_GASES
from .solver import toa_brf


def brf(
    state: State,
    bands: Sequence[str] = GRASSO2013,
    *,
    gases: Sequence[str] = ALL_GASES,
    num_streams: int = 8,
    num_modes: int | None = None,
    num_doublings: int | None = None,
) -> Float[Array, "*batch band"]:
    """Bidirectional reflectance factor at the top of the atmosphere, by band. [-]

    Differentiable in every floating leaf of the state, forward and reverse; may be called under
    `jax.jit`, `jax.vmap` and `jax.grad`.

    Parameters
    ----------
    state
        One column, or a batch of columns: the same axes leading on every leaf. The sun and the
        satellite stand above the horizon.
    bands
        Names of the bands to simulate, each present in the state's albedo and plumes.
    gases
        Which of the atmosphere's gases absorb; ``()`` leaves them all out.
    num_streams, num_modes, num_doublings
        Accuracy and cost of the solver; see `solver.toa_brf`. Under a transformation, where the
        layers' optical depths cannot be read, `num_doublings` None takes enough for any cloud,
        which costs two to three times the time of a sufficient number.

    Returns
    -------
    One value per column and band, in the order of `bands`.

    Raises
    ------
    ValueError
        If a band is unknown or missing from the state, or a leaf's axes do not match.
    """
    bands = checked_bands(state, bands)
    state, batch = uniform(state)
    columns = band_columns(state, bands, tuple(gases), num_streams + 1)
    terms = toa_brf(
        **columns.layers,
        num_streams=num_streams,
        num_modes=num_modes,
        num_doublings=num_doublings,
    )
    return columns.summed(terms).reshape(*batch, len(bands))


def reflectance_factor(
    state: State,
    bands: Sequence[str] = GRASSO2013,
    *,
    gases: Sequence[str] = ALL_GASES,
    num_streams: int = 8,
    num_modes: int | None = None,
    num_doublings: int | None = None,
) -> Float[Array, "*batch band"]:
    """Reflectance factor pi d^2 L / E0 as in ABI files, mu0 times `brf`. [-]

    Arguments and errors are those of `brf`.
    """
    value = brf(
        state,
        bands,
        gases=gases,
        num_streams=num_streams,
        num_modes=num_modes,
        num_doublings=num_doublings,
    )
    mu0 = jnp.cos(jnp.asarray(state.geometry.solar_zenith, value.dtype))
    return mu0[..., None] * value
