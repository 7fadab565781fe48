"""The reflectance of a plume in one band as a function of its single-scattering albedo there."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..atmosphere import Plume, State
from ..files import InputError
from ..reflectance import brf
from ..settings import Settings


class PlumeBand(eqx.Module):
    """Columns with a plume, one band of which is looked at.

    Parameters
    ----------
    states
        The columns, one leading axis on every leaf.
    species
        Name of the plume in them, a `Plume`, which has a single-scattering albedo of its own.
    band
        Name of the band.
    settings
        How to simulate; with an error budget, roots would be those of its errors.
    """

    states: State
    species: str = eqx.field(static=True)
    band: str = eqx.field(static=True)
    settings: Settings = eqx.field(static=True)

    def __check_init__(self) -> None:
        plumes = self.states.atmosphere.plumes
        if not isinstance(plumes.get(self.species), Plume):
            raise InputError(
                f"there is no plume {self.species!r} with a single-scattering albedo of its own; "
                f"there are {sorted(plumes) or 'none'}."
            )

    @property
    def ssa(self) -> Float[Array, " column"]:
        """Single-scattering albedo of the plume in the band, as it is. [-]"""
        return _ssa_of(self.states, self.species)[self.band]

    def with_ssa(self, ssa: Float[Array | np.ndarray, "*#column"]) -> State:
        """The columns with another single-scattering albedo of the plume in the band. [-]"""
        full = jnp.broadcast_to(jnp.asarray(ssa, self.ssa.dtype), self.ssa.shape)
        by_band = {**_ssa_of(self.states, self.species), self.band: full}
        return eqx.tree_at(lambda s: _ssa_of(s, self.species), self.states, by_band)

    def brf(self, ssa: Float[Array | np.ndarray, "*#column"]) -> Float[Array, " column"]:
        """Bidirectional reflectance factor in the band with that single-scattering albedo. [-]"""
        return brf(self.with_ssa(ssa), (self.band,), **self.settings._asdict())[..., 0]

    def slope(self) -> np.ndarray:
        """Derivative of `brf` in the single-scattering albedo, as it is, of each column. [-]"""
        ssa = jnp.asarray(self.ssa)
        # Columns do not see each other: one direction holds the slopes of all.
        _, slope = jax.jvp(self.brf, (ssa,), (jnp.ones_like(ssa),))
        return np.asarray(slope)


def _ssa_of(states: Any, species: str) -> Any:
    return states.atmosphere.plumes[species].ssa
