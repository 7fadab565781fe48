"""The forward model of a retrieval: state vector in, what the imager would measure out."""

from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from abi_operator import BANDS, Atmosphere, State, radiance, reflectance_factor
from abi_operator.instrument import reflectance_factor_from_radiance
from abi_operator.machine.sizes import chunk_of_pixels_to_read
from abi_operator.machine.speed import Kept
from abi_operator.optics import ALL_GASES, column_optics
from abi_operator.settings import NUM_STREAMS
from abi_operator.solver import sufficient_doublings

from .chunks import map_chunks
from .state_vector import StateVector

THERMAL = "C07"
"""The band that is measured as radiance, as files hold it; the others are reflectance factors."""


@dataclass(frozen=True)
class ForwardModel:
    """What is measured of one column, of which x gives a part and a state everything else.

    Parameters
    ----------
    vector
        Meaning of x.
    bands
        Bands that are measured.
    num_streams, num_doublings
        Settings of the solver; see `abi_operator.brf`. The doublings must suffice for every x,
        which `prepared` takes care of.
    gases
        Gases of the state that absorb.
    satellite
        Whose response and solar irradiance.
    error_budget
        Relative error that the solver may make for speed; see `abi_operator.brf`. None for no
        error, as a fit that is to be exact needs it. [-]
    plume_edges
        Whether levels go with the edges of plumes; see `abi_operator.brf`. None leaves it to
        `prepared`, which has them where x moves the base or the top of a plume.
    """

    vector: StateVector
    bands: tuple[str, ...]
    num_streams: int = NUM_STREAMS
    num_doublings: int | None = None
    gases: tuple[str, ...] = ALL_GASES
    satellite: str = "GOES-16"
    error_budget: float | None = None
    plume_edges: bool | None = None

    def state(self, x: Float[Array, "*batch x"], state: State) -> State:
        """Put x into a state."""
        return self.vector.state(x, state)

    def __call__(
        self,
        x: Float[Array, "*batch x"],
        state: State,
        sun_distance: Float[Array | np.ndarray, "*batch"] | None = None,
    ) -> Float[Array, "*batch band"]:
        """What is measured of a state into which x is put.

        Parameters
        ----------
        x
            Without units, as `StateVector.x` makes it of quantities (..., x). [-]
        state
            What is known of as many columns, whose axes lead those of layers and levels.
        sun_distance
            Distance of the sun of each column, None for 1. [AU]

        Returns
        -------
        Array
            As of `measured` (..., band).
        """
        return self.measured(self.state(x, state), sun_distance)

    def measured(
        self, full: State, sun_distance: Float[Array | np.ndarray, "*batch"] | None = None
    ) -> Float[Array, "*batch band"]:
        """Reflectance factors of C01 to C06 [-], and the radiance of C07 [W m-2 sr-1 um-1].

        Where there is a fire, what it gives off is part of the reflectance factors.

        Parameters
        ----------
        full
            The state, with all that is retrieved.
        sun_distance
            Distance of the sun [AU], None for 1: beside what the ground and a fire give off,
            sunlight counts for less the farther the sun is. Reflected light alone does not tell.
        """
        settings = {
            "gases": self.gases,
            "num_streams": self.num_streams,
            "num_doublings": self.num_doublings,
            "satellite": self.satellite,
            "error_budget": self.error_budget,
            "plume_edges": self.plume_edges,
        }
        if THERMAL not in self.bands and full.fire is None:
            return reflectance_factor(full, self.bands, **settings)
        distance = 1.0 if sun_distance is None else jnp.asarray(sun_distance)
        seen = radiance(full, self.bands, sun_distance=distance, **settings)
        columns = [
            seen[..., i]
            if band == THERMAL
            else reflectance_factor_from_radiance(seen[..., i], band, self.satellite, distance)
            for i, band in enumerate(self.bands)
        ]
        return jnp.stack(columns, axis=-1)


def prepared(forward: ForwardModel, states: State) -> ForwardModel:
    """Give a forward model doublings that suffice for every x, and levels that go with plumes.

    Parameters
    ----------
    forward
        The forward model.
    states
        Concrete columns, batched along one leading axis.

    Returns
    -------
    ForwardModel
        The same with ``num_doublings``, and with ``plume_edges`` where these were left open and x
        moves the base or the top of a plume.
    """
    chunk = chunk_of_pixels_to_read()
    tau = map_chunks(partial(_largest_tau, forward), states, chunk=chunk)
    # A column that is no number is none with any doublings, and asks for none of the others'.
    max_tau = np.max(np.where(np.isfinite(tau), tau, 0))
    cosines = (np.cos(x) for x in (states.geometry.solar_zenith, states.geometry.view_zenith))
    min_mu = min(np.min(np.where(x > 0, x, 1.0)) for x in cosines)  # below the horizon: none
    known = float(max_tau), float(min_mu), forward.num_streams, max_tau.dtype
    num_doublings = sufficient_doublings(*known)
    edges = forward.plume_edges
    if edges is None and forward.vector.moves_plumes(states):
        edges = True
    return replace(forward, num_doublings=num_doublings, plume_edges=edges)


@Kept
def _largest_tau(forward: ForwardModel, states: State) -> Float[Array, " column"]:
    """Optical depth of the thickest layer of each column at the extremes of x. [-]

    Extremes at which it is no number are left out; where it is none at any, neither is this.
    """
    num_columns = states.geometry.solar_zenith.shape[0]
    extremes = product(*(q.transform.extremes for q in forward.vector.quantities))

    def of_one(atmosphere: Atmosphere) -> Float[Array, ""]:
        optics = [column_optics(atmosphere, BANDS[band], forward.gases) for band in forward.bands]
        return jnp.max(jnp.stack([jnp.max(layers.tau) for layers in optics]))

    def at(x: Float[Array, " x"]) -> Float[Array, " column"]:
        everywhere = jnp.broadcast_to(x, (num_columns, x.size))
        return jax.vmap(of_one)(forward.state(everywhere, states).atmosphere)

    # At infinite x a quantity may be none, of which the other extremes know nothing.
    return jnp.nanmax(jax.lax.map(at, jnp.array(list(extremes))), axis=0)
