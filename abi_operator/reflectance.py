"""The operator: from a specified state to the reflectances that the ABI would see.

The reflectance factor of ABI files is rho = pi d^2 L / E0, with L the radiance, E0 the band's solar
irradiance at 1 AU and d the distance of the sun in AU. It contains the cosine of the solar zenith
angle, rho = mu0 * brf, and depends on d and E0 no longer once L is the answer to that sunlight;
`brf`, the bidirectional reflectance factor, is 1 for a white Lambertian ground without air. Both
are of sunlight alone: what the ground and the air emit in C07 is not in them.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .atmosphere import State
from .bands import GRASSO2013
from .optics import ALL_GASES
from .optics_and_solver import Inputs, Options, solve
from .state_checks import check_state, checked_bands, is_concrete, uniform


def brf(
    state: State,
    bands: Sequence[str] = GRASSO2013,
    *,
    satellite: str = "GOES-16",
    gases: Sequence[str] = ALL_GASES,
    num_streams: int = 8,
    num_modes: int | None = None,
    num_doublings: int | None = None,
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
    satellite
        Optics are those of GOES-16 for all; that of GOES-19 is refused where its gas absorption is
        another (C04).
    gases
        Which of the atmosphere's gases absorb; ``()`` leaves them all out.
    num_streams, num_modes, num_doublings
        Accuracy and cost of the solver; see `solver.toa_brf`. With `num_doublings` None every layer
        is exact, but for derivatives inside `jax.jit` and loops, where optical depths cannot be
        read: columns with a layer thicker than 1000 are NaN there.

    Returns
    -------
    One value per column and band, in the order of `bands`.

    Raises
    ------
    ValueError
        If a band or the satellite is unknown, a band missing from the state, a leaf's axes do not
        match, or (where values can be read) as `check_state`.
    """
    options = Options(
        checked_bands(state, bands, gases, satellite),
        (),
        satellite,
        tuple(gases),
        num_streams,
        num_modes,
    )
    state, _ = uniform(state)
    if is_concrete(state):
        check_state(state)
    value = solve(Inputs(state, {}), options, num_doublings)
    return _lit(value, state.geometry.solar_zenith, state.geometry.view_zenith)


def reflectance_factor(
    state: State,
    bands: Sequence[str] = GRASSO2013,
    *,
    satellite: str = "GOES-16",
    gases: Sequence[str] = ALL_GASES,
    num_streams: int = 8,
    num_modes: int | None = None,
    num_doublings: int | None = None,
) -> Float[Array, "*batch band"]:
    """Reflectance factor pi d^2 L / E0 as in ABI files, mu0 times `brf`, and 0 by night. [-]

    Arguments and errors are those of `brf`; where the satellite is out of sight it is NaN.
    """
    value = brf(
        state,
        bands,
        satellite=satellite,
        gases=gases,
        num_streams=num_streams,
        num_modes=num_modes,
        num_doublings=num_doublings,
    )
    return _with_the_suns_cosine(value, state.geometry.solar_zenith, state.geometry.view_zenith)


# One program each, and not one for every operation, forward and backward.


@jax.jit
def _with_the_suns_cosine(value: Array, solar_zenith: Array, view_zenith: Array) -> Array:
    mu0, mu = (jnp.cos(jnp.asarray(x, value.dtype))[..., None] for x in (solar_zenith, view_zenith))
    # Where brf is NaN its derivative in mu0 would be too.
    lit = (mu0 > 0) & (mu > 0)
    by_day = jnp.where(lit, mu0, 0) * jnp.where(lit, value, 0)
    return jnp.where(mu > 0, by_day, jnp.nan)


@jax.jit
def _lit(value: Array, solar_zenith: Array, view_zenith: Array) -> Array:
    """`value` where the sun is up and the satellite in sight, else NaN."""
    up = (jnp.cos(solar_zenith) > 0) & (jnp.cos(view_zenith) > 0)
    return jnp.where(up[..., None], value, jnp.nan)
