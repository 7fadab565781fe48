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

import itertools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ._numerics import safe_divide
from .machine.algebra import total, trailing
from .machine.occupied import Present, if_present, row_by_row


class PhaseFunction(eqx.Module):
    """Angular distribution of single scattering, rotationally symmetric."""

    def moments(self, num_moments: int) -> Float[Array, "#layer moment *#batch"]:
        r"""Legendre moments :math:`\chi_l`, :math:`\chi_0 = 1`, without the factor 2l + 1. [-]"""
        raise NotImplementedError

    def __call__(self, cos_scattering: Float[Array, "*batch"]) -> Float[Array, "#layer *batch"]:
        """Phase function at a scattering angle, mean 1 over the sphere. [-]"""
        raise NotImplementedError


class Scatterer(eqx.Module):
    """Scattering optical depth of each layer by one kind of particle, and its phase function; and
    where there are any, or None for everywhere. Elsewhere the depth is 0, whatever changes."""

    scattering: Float[Array, "layer *batch"]
    phase: PhaseFunction
    there: Bool[Array, "layer *batch"] | None = None


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

    extinction: Float[Array, "term layer *batch"]
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
    def tau(self) -> Float[Array, "term layer *batch"]:
        """Extinction optical depth of each layer. [-]"""
        return self.extinction

    @property
    def scattering(self) -> Float[Array, "layer *batch"]:
        """Scattering optical depth of each layer. [-]"""
        return sum((s.scattering for s in self.scatterers), jnp.zeros_like(self.extinction[0]))

    @property
    def ssa(self) -> Float[Array, "term layer *batch"]:
        """Single-scattering albedo, 0 in an empty layer. [-]"""
        return safe_divide(self.scattering, self.extinction)

    def moments(self, num_moments: int) -> Float[Array, "layer moment *batch"]:
        """Legendre moments of the mixture, weighted by scattering; 1, 0, 0, ... where none. [-]"""
        num_axes = self.extinction.ndim

        def of_kind(share: Array, phase: PhaseFunction) -> Array:
            return share[:, None] * trailing(phase.moments(num_moments), num_axes)

        layers, *batch = self.extinction.shape[1:]
        found = jnp.broadcast_to(self._mean(of_kind), (layers, num_moments, *batch))
        first = np.arange(num_moments) == 0
        return jnp.where(trailing(first, num_axes - 1), 1, found)

    def phase_function(
        self, cos_scattering: Float[Array, "*batch"]
    ) -> Float[Array, "layer *batch"]:
        """Phase function of the mixture, weighted by scattering; 0 where nothing scatters. [-]"""

        def of_kind(share: Array, phase: PhaseFunction) -> Array:
            return share * phase(cos_scattering)

        return jnp.broadcast_to(self._mean(of_kind), self.extinction.shape[1:])

    def _mean(self, of_kind: Callable[[Array, PhaseFunction], Array]) -> Array:
        """Sum over the scatterers by their shares, of each in the layers where it is; 0 of none.

        Layer by layer: of a cloud nothing is computed, value or slope, in a layer without it.
        """
        if not self.scatterers:
            return jnp.zeros((), self.extinction.dtype)
        layers = self.extinction.shape[1]
        leaves, structure = jax.tree.flatten([s.phase for s in self.scatterers])
        by_layer = [np.ndim(x) > 0 and x.shape[0] == layers for x in leaves]

        def of_layers(
            rows: tuple[list[Array], list[Array]], present: list[Present]
        ) -> Float[Array, "layer ..."]:
            scattering, own = rows[0], iter(rows[1])
            shared = [next(own) if x else y for x, y in zip(by_layer, leaves, strict=True)]
            phases = jax.tree.unflatten(structure, shared)
            each, all_of_it = zip(present, scattering, phases, strict=True), total(scattering)
            return total([if_present(x, of_kind, safe_divide(s, all_of_it), p) for x, s, p in each])

        rows = [s.scattering for s in self.scatterers], list(itertools.compress(leaves, by_layer))
        return row_by_row(of_layers, rows, [s.there for s in self.scatterers])
