r"""The waist: all that optics and solver share.

Every producer (air, cloud, plume) describes its part of a column by what *adds*: extinction, and
one `Scatterer` for each kind of particle. Mixing is then ``+``, and single-scattering albedo,
moments and phase function of the mixture are derived once, here. A scatterer keeps its phase
function as an object instead of a table of moments: a producer need not know how many streams the
solver has, long series of moments never exist, and the exact single scattering reads the closed
form.

Extinction has a leading axis ``term``, over which radiances are summed with `weight`: the
exponentials of a band's gas transmission. Grey matter has one term of weight 1.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._numerics import safe_divide


class PhaseFunction(eqx.Module):
    """Angular distribution of single scattering, rotationally symmetric."""

    def moments(self, num_moments: int) -> Float[Array, "#layer moment"]:
        r"""Legendre moments :math:`\chi_l`, :math:`\chi_0 = 1`, without the factor 2l + 1. [-]"""
        raise NotImplementedError

    def __call__(self, cos_scattering: Float[Array, ""]) -> Float[Array, " #layer"]:
        """Phase function at a scattering angle, mean 1 over the sphere. [-]"""
        raise NotImplementedError


class Scatterer(eqx.Module):
    """Scattering optical depth of each layer by one kind of particle, and its phase function."""

    scattering: Float[Array, " layer"]
    phase: PhaseFunction


class OpticalProperties(eqx.Module):
    """Optical properties of the layers of one column in one band.

    Parameters
    ----------
    extinction
        Extinction optical depth of each layer. [-]
    weight
        Weight of each exponential term, summing to 1. [-]
    scatterers
        What scatters in it, one entry for each kind of particle.
    """

    extinction: Float[Array, "term layer"]
    weight: Float[Array, " term"]
    scatterers: tuple[Scatterer, ...]

    def __add__(self, other: "OpticalProperties") -> "OpticalProperties":
        """Mix two sets of optical properties.

        Raises
        ------
        ValueError
            Where both have several exponential terms: only gases do, and the producer of gas
            absorption is the one that knows how its sums combine.
        """
        if min(self.weight.shape[0], other.weight.shape[0]) > 1:
            raise ValueError(
                "only one of two mixed OpticalProperties may have several exponential terms; got "
                f"{self.weight.shape[0]} and {other.weight.shape[0]}."
            )
        weight = self.weight if self.weight.shape[0] > 1 else other.weight
        extinction = self.extinction + other.extinction
        return OpticalProperties(extinction, weight, self.scatterers + other.scatterers)

    @property
    def tau(self) -> Float[Array, "term layer"]:
        """Extinction optical depth of each layer. [-]"""
        return self.extinction

    @property
    def scattering(self) -> Float[Array, " layer"]:
        """Scattering optical depth of each layer. [-]"""
        return sum((s.scattering for s in self.scatterers), jnp.zeros_like(self.extinction[0]))

    @property
    def ssa(self) -> Float[Array, "term layer"]:
        """Single-scattering albedo, 0 in an empty layer. [-]"""
        return safe_divide(self.scattering, self.extinction)

    def moments(self, num_moments: int) -> Float[Array, "layer moment"]:
        """Legendre moments of the mixture, weighted by scattering; 1, 0, 0, ... where none. [-]"""
        shape = self.extinction.shape[1], num_moments

        def of_kind(shares: Array, phase: PhaseFunction) -> Array:
            return shares[:, None] * jnp.broadcast_to(phase.moments(num_moments), shape)

        found = jnp.broadcast_to(self._mean(of_kind), shape)
        return jnp.where(np.arange(num_moments) == 0, 1, found)

    def phase_function(self, cos_scattering: Float[Array, ""]) -> Float[Array, " layer"]:
        """Phase function of the mixture, weighted by scattering; 0 where nothing scatters. [-]"""

        def of_kind(shares: Array, phase: PhaseFunction) -> Array:
            return shares * phase(cos_scattering)

        return jnp.broadcast_to(self._mean(of_kind), self.extinction.shape[1:])

    def _mean(self, of_kind: Callable[[Array, PhaseFunction], Array]) -> Array:
        """Sum over the scatterers by their shares, those of a kind as one batch; 0 of none."""
        scattering = self.scattering
        kinds: dict[Any, list[Scatterer]] = {}
        for scatterer in self.scatterers:
            kinds.setdefault(jax.tree.structure(scatterer.phase), []).append(scatterer)
        found = []
        for same in kinds.values():
            shares = safe_divide(jnp.stack([s.scattering for s in same]), scattering)
            phases = jax.tree.map(
                lambda *x: jnp.stack(jnp.broadcast_arrays(*x)), *(s.phase for s in same)
            )
            found += jnp.unstack(jax.vmap(of_kind)(shares, phases))
        return sum(found[1:], start=found[0]) if found else jnp.zeros((), scattering.dtype)
