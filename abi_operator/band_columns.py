"""From states to the columns that the solver is given: one for each band and exponential term."""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .atmosphere import State
from .bands import BANDS, check_bands
from .optics import column_optics
from .solver import cos_scattering_angle


class BandColumns(NamedTuple):
    """Solver's columns of one state or many.

    Parameters
    ----------
    layers
        Arguments of `solver.toa_brf` by name; after the axes of the states one of columns, the
        bands' terms one after the other.
    weight
        Weight of each of these columns in each band. [-]
    """

    layers: dict[str, Array]
    weight: Float[Array, "*batch band column"]

    def summed(self, terms: Float[Array, "*batch column"]) -> Float[Array, "*batch band"]:
        """Sum over each band's terms."""
        return jnp.sum(self.weight * terms[..., None, :], axis=-1)

    def repeated(self, by_band: Array) -> Array:
        """What bands have, on the axis after the batch's, for each of their columns."""
        band = jnp.argmax(self.weight > 0, axis=-2)
        band = band.reshape(*band.shape, *(1,) * (by_band.ndim - band.ndim))
        return jnp.take_along_axis(by_band, band, axis=self.weight.ndim - 2)


def checked_bands(state: State, bands: Sequence[str]) -> tuple[str, ...]:
    """Bands as a tuple, or `ValueError` for one that is unknown or without albedo."""
    bands = check_bands(bands)
    for name in bands:
        if name not in state.albedo:
            raise ValueError(f"state.albedo has no {name!r}; it holds {list(state.albedo)}.")
    return bands


def uniform(state: State) -> tuple[State, tuple[int, ...]]:
    """Give all leaves one floating type, and check that they share the batch's shape.

    Returns
    -------
    The state, and the shape of the batch.
    """
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


@partial(jax.jit, static_argnums=(1, 2, 3))
def band_columns(
    state: State, bands: tuple[str, ...], gases: tuple[str, ...], num_moments: int
) -> BandColumns:
    """Columns of a `uniform` state, one or a batch, for the solver.

    Parameters
    ----------
    state
        What the columns hold.
    bands, gases
        Which bands, and which gases absorb.
    num_moments
        Legendre moments that the solver reads.
    """

    def function(column: State) -> BandColumns:
        return _of_one_state(column, bands, gases, num_moments)

    for _ in state.geometry.solar_zenith.shape:
        function = jax.vmap(function)
    return function(state)


def _of_one_state(
    state: State, bands: tuple[str, ...], gases: tuple[str, ...], num_moments: int
) -> BandColumns:
    geometry = state.geometry
    mu0, mu, relative_azimuth = geometry.mu0, geometry.mu, geometry.relative_azimuth
    cosine = cos_scattering_angle(mu0, mu, relative_azimuth)
    found: dict[str, list[Any]] = {}
    weights = []
    for name in bands:
        optics = column_optics(state.atmosphere, BANDS[name], gases)
        count = optics.weight.shape[0]
        of_band = {
            "tau": optics.tau,
            "ssa": optics.ssa,
            "moments": jnp.repeat(optics.moments(num_moments)[None], count, axis=0),
            "phase_function": jnp.repeat(optics.phase_function(cosine)[None], count, axis=0),
            "albedo": jnp.repeat(state.albedo[name], count),
            "mu0": jnp.repeat(mu0, count),
            "mu": jnp.repeat(mu, count),
            "relative_azimuth": jnp.repeat(relative_azimuth, count),
        }
        for key, value in of_band.items():
            found.setdefault(key, []).append(value)
        weights.append(optics.weight)
    layers = {key: jnp.concatenate(values) for key, values in found.items()}
    return BandColumns(layers, jax.scipy.linalg.block_diag(*weights))
