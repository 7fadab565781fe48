r"""Phase functions of Mie theory, by table.

The logarithm of P is interpolated in two steps, both by cubics with a continuous slope: in the
coordinate of the scattering angle

.. math:: u = \ln \frac{1 + \cos\Theta + b}{1 - \cos\Theta + f}

(b, f of 1e-6), then in the logarithm of effective radius (`radius_cubics`). The coordinate is
smooth in the cosine, with a finite derivative at exact forward and backward scattering too, and
spends as many nodes on a degree about the glory as on a quadrant elsewhere. Moments are
interpolated in radius alone; beyond those that the table has, which are enough for 64 streams, they
are integrals of its P (`mie_moments`).

Between its nodes P is within 1e-3 of Mie theory for aerosols and within 4e-3 for droplets (both the
worst of all bands, at 180 degrees; 2e-4 in C04-C07). Narrow resonances, of which sums over spheres
catch a random share, leave that theory itself uncertain by as much for large droplets in C01-C03:
the table smooths them. Averaged over the sphere P is 1, and its mean cosine is the first moment, to
2e-4, in the first and the last interval of radius to 1e-3 (tests/abi_operator/optics).
"""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..bands import OneOf, constants, one_of
from ..machine.algebra import total
from ..optical_properties import PhaseFunction
from .mie_moments import moments_of
from .mie_table import band_table, mie_table, stacked
from .pointwise import pointwise
from .radius_cubics import locate, read


@final
class MiePhase(PhaseFunction):
    """Phase function of a population of spheres, by its effective radius.

    Parameters
    ----------
    effective_radius_um
        Effective radius, of all layers or of each; constant beyond the table. [um]
    material
        Name of the table: a species of `mie_species`, or ``"droplets"``.
    band
        Name of the band.
    """

    effective_radius_um: Float[Array, ""] | Float[Array, "#layer *batch"]
    material: str = eqx.field(static=True)
    band: OneOf = eqx.field(converter=one_of)

    def moments(self, num_moments: int) -> Float[Array, "#layer moment *batch"]:
        """Legendre moments: those of the table, and beyond the 65 it has those of its P."""
        radius_um = jnp.atleast_1d(self.effective_radius_um)
        return _moments(radius_um[:, None], self.material, self.band, num_moments)

    def __call__(self, cos_scattering: Float[Array, "*batch"]) -> Float[Array, "#layer *batch"]:
        """Phase function; `cos_scattering` is 1 straight ahead. [-]"""
        radius_um = jnp.atleast_1d(self.effective_radius_um)
        nodes = constants(
            lambda name: band_table(self.material, name).coordinate, self.band, radius_um.dtype
        )
        nodes = jnp.asarray(nodes, radius_um.dtype)
        offsets = band_table(self.material, self.band.names[0]).offsets
        between = _between(cos_scattering, nodes, offsets)
        return _phase_function(radius_um, *between, self.material, self.band)


@pointwise
def _moments(
    radius_um: Float[Array, "layer 1 *batch"], material: str, band: OneOf, num_moments: int
) -> Float[Array, "layer moment *batch"]:
    row, weights = locate(radius_um[:, 0], mie_table(material).effective_radius_um)
    table, first = stacked(material, band, lambda x: moments_of(x, num_moments))
    moments = read(jnp.asarray(table, weights.dtype), row + first, weights)
    return jnp.moveaxis(moments, -1, 1)


def _between(
    cosine: Float[Array, "*batch"], nodes: Float[Array, " angle"], offsets: tuple[float, float]
) -> tuple[Int[Array, "*batch"], tuple[Float[Array, "*batch"], ...]]:
    """First of the two angles about a cosine, and the weights of value and slope at both."""
    backward, forward = offsets
    u = jnp.log((1 + cosine + backward) / (1 - cosine + forward))
    k = jnp.sum(u[..., None] >= nodes[1:-1], axis=-1, dtype=jnp.int32)
    width = nodes[k + 1] - nodes[k]
    x = (u - nodes[k]) / width
    upper, bend = x * x * (3 - 2 * x), width * x * (1 - x)
    return k, (1 - upper, (1 - x) * bend, upper, -x * bend)


@pointwise
def _phase_function(
    radius_um: Float[Array, "layer *batch"],
    angle: Int[Array, "*batch"],
    by_angle: tuple[Float[Array, "*batch"], ...],
    material: str,
    band: OneOf,
) -> Float[Array, "layer *batch"]:
    row, weights = locate(radius_um, mie_table(material).effective_radius_um)
    table, first = stacked(material, band, lambda x: x.log_phase)
    num_rows = table.shape[-1]
    flat = jnp.asarray(table, weights.dtype).reshape(-1)
    place = (first + angle) * (2 * num_rows) + row
    log_phase = jnp.zeros_like(radius_um)
    for node in range(weights.shape[-1]):
        of_node = total(
            [
                weight * flat.at[place + (k * num_rows + node)].get(mode="promise_in_bounds")
                for k, weight in enumerate(by_angle)
            ]
        )
        log_phase = log_phase + weights[..., node] * of_node
    return jnp.exp(log_phase)
