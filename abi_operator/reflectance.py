"""The operator: from a specified state to the reflectances that the ABI would see.

The reflectance factor of ABI files is rho = pi d^2 L / E0, with L the radiance, E0 the band's solar
irradiance at 1 AU and d the distance of the sun in AU. It contains the cosine of the solar zenith
angle, rho = mu0 * brf, and depends on d and E0 no longer once L is the answer to that sunlight;
`brf`, the bidirectional reflectance factor, is 1 for a white Lambertian ground without air. Both
are of sunlight alone: what the ground and the air emit in C07 is not in them.
"""

from collections.abc import Sequence
from typing import Unpack

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._keywords import with_keywords
from .atmosphere import State
from .bands import GRASSO2013
from .geometry import is_up
from .optics_and_solver import Inputs, Options, solve
from .settings import ByName, Settings, settings_of
from .state_checks import check_state, checked_bands, is_concrete, uniform


@with_keywords(ByName, Settings())
def brf(
    state: State,
    bands: Sequence[str] = GRASSO2013,
    **settings: Unpack[ByName],
) -> Float[Array, "*batch band"]:
    """Bidirectional reflectance factor at the top of the atmosphere, by band. [-]

    Differentiable in every floating leaf of the state, forward and reverse; may be called under
    `jax.jit`, `jax.vmap` and `jax.grad`. NaN, with derivative 0, where the sun or the satellite
    stands at or below the horizon (`quality_flags`).

    Parameters
    ----------
    state
        One column, or a batch of columns: the same axes leading on every leaf.
    bands
        Names of the bands to simulate, each present in the state's albedo and plumes.
    **settings
        Satellite, gases and accuracy: the fields of `Settings`.

    Returns
    -------
    One value per column and band, in the order of `bands`.

    Raises
    ------
    ValueError
        If a band or the satellite is unknown, a band missing from the state, a leaf's axes do not
        match, or (where values can be read) as `check_state`.
    """
    how = settings_of(settings)
    bands = checked_bands(state, bands, how.gases, how.satellite)
    options = Options(bands, (), how)
    state, _ = uniform(state)
    if is_concrete(state):
        check_state(state)
    value = solve(Inputs(state, {}), options)
    return _lit(value, state.geometry.solar_zenith, state.geometry.view_zenith)


@with_keywords(ByName, Settings())
def reflectance_factor(
    state: State,
    bands: Sequence[str] = GRASSO2013,
    **settings: Unpack[ByName],
) -> Float[Array, "*batch band"]:
    """Reflectance factor pi d^2 L / E0 as in ABI files, mu0 times `brf`, and 0 by night. [-]

    Arguments and errors are those of `brf`; where the satellite is out of sight it is NaN.
    """
    value = brf(state, bands, **settings)
    return with_the_suns_cosine(value, state.geometry.solar_zenith, state.geometry.view_zenith)


# One program each, and not one for every operation, forward and backward.


@jax.jit
def with_the_suns_cosine(
    value: Float[Array, "*batch band"],
    solar_zenith: Float[Array, "*batch"],
    view_zenith: Float[Array, "*batch"],
) -> Float[Array, "*batch band"]:
    """Reflectance factor of a bidirectional one: 0 by night, NaN with the satellite out of sight.

    Parameters
    ----------
    value
        Bidirectional reflectance factor. [-]
    solar_zenith, view_zenith
        Zenith angles of sun and satellite. [rad]
    """
    sun, view = (jnp.asarray(x, value.dtype)[..., None] for x in (solar_zenith, view_zenith))
    # Where brf is NaN its derivative in mu0 would be too.
    lit = is_up(sun) & is_up(view)
    by_day = jnp.where(lit, jnp.cos(sun), 0) * jnp.where(lit, value, 0)
    return jnp.where(is_up(view) & ~jnp.isnan(sun), by_day, jnp.nan)


@jax.jit
def _lit(value: Array, solar_zenith: Array, view_zenith: Array) -> Array:
    """`value` where the sun is up and the satellite in sight, else NaN."""
    up = is_up(solar_zenith) & is_up(view_zenith)
    return jnp.where(up[..., None], value, jnp.nan)
