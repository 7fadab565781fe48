"""The forward model of a retrieval: state vector in, reflectance factors out."""

from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from abi_operator import BANDS, Atmosphere, Plume, State, reflectance_factor
from abi_operator.machine.sizes import chunk_of_pixels_to_read
from abi_operator.machine.speed import Kept
from abi_operator.optics import ALL_GASES, column_optics
from abi_operator.solver import sufficient_doublings

from .chunks import map_chunks
from .state_vector import StateVector


class ForwardModel(eqx.Module):
    """Reflectance factors of one column whose plume is given by x and everything else by a state.

    Parameters
    ----------
    vector
        Meaning of x.
    bands
        Bands that are measured.
    num_streams, num_doublings
        Settings of the solver; see `abi_operator.brf`. The doublings must suffice up to
        ``vector.aod_limit``, which `prepared` takes care of.
    species
        Name of the plume that is retrieved.
    gases
        Gases of the state that absorb.
    """

    vector: StateVector
    bands: tuple[str, ...] = eqx.field(static=True)
    num_streams: int = eqx.field(static=True, default=8)
    num_doublings: int | None = eqx.field(static=True, default=None)
    species: str = eqx.field(static=True, default="smoke")
    gases: tuple[str, ...] = eqx.field(static=True, default=ALL_GASES)

    def state(self, x: Float[Array, "*batch x"], state: State) -> State:
        """Put x into a state."""
        plume = self.vector.plume(x, plume_by_band(state, self.species))
        return eqx.tree_at(lambda s: s.atmosphere.plumes[self.species], state, plume)

    def __call__(self, x: Float[Array, "*batch x"], state: State) -> Float[Array, "*batch band"]:
        """Reflectance factors that the imager would see. [-]"""
        return reflectance_factor(
            self.state(x, state),
            self.bands,
            gases=self.gases,
            num_streams=self.num_streams,
            num_doublings=self.num_doublings,
        )


def plume_by_band(state: State, species: str) -> Plume:
    """The plume of a species, or `ValueError` if its optics are not specified by band."""
    plume = state.atmosphere.plumes[species]
    if not isinstance(plume, Plume):
        kind = type(plume).__name__
        raise ValueError(f"to be retrieved, {species!r} must be a Plume; got a {kind}.")
    return plume


def prepared(forward: ForwardModel, states: State) -> ForwardModel:
    """Give a forward model doublings that suffice for every optical depth up to the limit.

    Parameters
    ----------
    forward
        The forward model.
    states
        Concrete columns, batched along one leading axis.
    """
    chunk = chunk_of_pixels_to_read()
    max_tau = np.max(map_chunks(partial(_largest_tau, forward), states, chunk=chunk))
    min_mu = min(
        np.min(np.cos(x)) for x in (states.geometry.solar_zenith, states.geometry.view_zenith)
    )
    num_doublings = sufficient_doublings(float(max_tau), float(min_mu), forward.num_streams)
    return replace(forward, num_doublings=num_doublings)


@Kept
def _largest_tau(forward: ForwardModel, states: State) -> Float[Array, " column"]:
    """Optical depth of the thickest layer of each column at the limit of the state vector. [-]"""
    num_columns = states.geometry.solar_zenith.shape[0]
    thickest = jnp.full((num_columns, forward.vector.size), jnp.inf)
    thickest = thickest.at[:, 1:].set(0)
    atmospheres = forward.state(thickest, states).atmosphere

    def of_one(atmosphere: Atmosphere) -> Float[Array, ""]:
        optics = [column_optics(atmosphere, BANDS[band], forward.gases) for band in forward.bands]
        return jnp.max(jnp.stack([jnp.max(layers.tau) for layers in optics]))

    return jax.vmap(of_one)(atmospheres)
