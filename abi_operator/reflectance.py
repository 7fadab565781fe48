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
import numpy as np
from jaxtyping import Array, Float

from .atmosphere import State
from .bands import BANDS, GRASSO2013, check_bands
from .optics import ALL_GASES, column_optics
from .solver import cos_scattering_angle, toa_brf


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
    bands = check_bands(bands)
    for name in bands:
        if name not in state.albedo:
            raise ValueError(f"state.albedo has no {name!r}; it holds {list(state.albedo)}.")
    state, batch = _uniform(state)
    inputs = _jitted_inputs(state, bands, tuple(gases), num_streams + 1)
    *layers, phase_function, weight = inputs
    terms = toa_brf(
        *layers,
        num_streams=num_streams,
        num_modes=num_modes,
        phase_function=phase_function,
        num_doublings=num_doublings,
    )
    return jnp.sum(weight * terms[..., None, :], axis=-1).reshape(*batch, len(bands))


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


def _uniform(state: State) -> tuple[State, tuple[int, ...]]:
    """Give all leaves one floating type, and check that they share the batch's shape."""
    leaves = jax.tree.leaves(state)
    arrays = [x for x in leaves if hasattr(x, "dtype")]
    dtype = jax.dtypes.canonicalize_dtype(np.result_type(*(x.dtype for x in arrays), np.float16))
    state = jax.tree.map(lambda x: jnp.asarray(x).astype(dtype), state)
    batch = state.geometry.solar_zenith.shape
    for path, leaf in jax.tree_util.tree_leaves_with_path(state):
        if leaf.shape[: len(batch)] != batch:
            raise ValueError(
                f"state{jax.tree_util.keystr(path)} has shape {leaf.shape}, but solar_zenith has "
                f"{batch}: a batch of columns needs the same leading axes on every leaf."
            )
    return state, batch


def _column_inputs(
    state: State, bands: tuple[str, ...], gases: tuple[str, ...], num_moments: int
) -> tuple[Array, ...]:
    """Solver inputs of one column, bands and their exponential terms on one leading axis.

    The last entry is the weight of each term in each band's sum, ``band term``.
    """
    geometry = state.geometry
    mu0, mu, relative_azimuth = geometry.mu0, geometry.mu, geometry.relative_azimuth
    cosine = cos_scattering_angle(mu0, mu, relative_azimuth)
    tau, ssa, moments, albedo, phase, weights = [], [], [], [], [], []
    for name in bands:
        layers = column_optics(state.atmosphere, BANDS[name], gases)
        terms = layers.weight.shape[0]
        tau.append(layers.tau)
        ssa.append(layers.ssa)
        moments.append(jnp.repeat(layers.moments(num_moments)[None], terms, axis=0))
        phase.append(jnp.repeat(layers.phase_function(cosine)[None], terms, axis=0))
        albedo.append(jnp.repeat(state.albedo[name], terms))
        weights.append(layers.weight)
    weight = jax.scipy.linalg.block_diag(*weights)
    total = weight.shape[1]
    directions = [jnp.repeat(x, total) for x in (mu0, mu, relative_azimuth)]
    stacked = [jnp.concatenate(x) for x in (tau, ssa, moments, albedo)]
    return *stacked, *directions, jnp.concatenate(phase), weight


def _batched_inputs(
    state: State, bands: tuple[str, ...], gases: tuple[str, ...], num_moments: int
) -> tuple[Array, ...]:
    def function(column: State) -> tuple[Array, ...]:
        return _column_inputs(column, bands, gases, num_moments)

    for _ in state.geometry.solar_zenith.shape:
        function = jax.vmap(function)
    return function(state)


_jitted_inputs = jax.jit(_batched_inputs, static_argnums=(1, 2, 3))
