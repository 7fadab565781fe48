r"""Mass of a plume's mineral particles over a square metre, from what is retrieved of them.

Of spheres with the effective radius r, the density :math:`\rho` and the mean extinction efficiency
Q at 550 nm, the optical depth :math:`\tau` is that of the mass

.. math:: M = \frac{4 \rho\, r\, \tau}{3\, Q(r)}

(:math:`\rho` times volume, which is 4 r / 3 times area, which is :math:`\tau / Q`). Q is that of
the size distributions of which `abi_operator.optics` has tables; the density is assumed, and the
mass proportional to it.
"""

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

# Of minerals, 2.6 g cm-3 (M. Hess et al., "Optical properties of aerosols and clouds: the software
# package OPAC", Bull. Amer. Meteor. Soc., 79, 831-844, 1998,
# doi:10.1175/1520-0477(1998)079<0831:OPOAAC>2.0.CO;2). Of Eyjafjallajokull's ash 2.16 +- 0.13 was
# measured (A. Rocha-Lima et al., Atmos. Chem. Phys., 14, 10649-10661, 2014,
# doi:10.5194/acp-14-10649-2014), for which all masses are less by a sixth. [kg m-3]
DENSITY = {"ash": 2600.0, "dust": 2600.0}

# As `python benchmarks/retrievals_mass.py` prints them, at radii that are equidistant in their
# logarithm. [um], [-]
_RADIUS_LIMITS = (0.25, 20.0)
_EFFICIENCY = {
    "ash": (
        *(2.234, 2.645, 2.813, 2.770, 2.624, 2.472, 2.355),
        *(2.273, 2.214, 2.170, 2.135, 2.108, 2.086, 2.069),
    ),
    "dust": (
        *(2.096, 2.546, 2.767, 2.766, 2.638, 2.486, 2.363),
        *(2.277, 2.216, 2.171, 2.136, 2.108, 2.086, 2.069),
    ),
}
_GRAM = 1e3  # per kg
_METRE = 1e-6  # per um


def extinction_efficiency(
    species: str, effective_radius_um: Float[Array, "*n"]
) -> Float[Array, "*n"]:
    """Mean extinction efficiency at 550 nm of ash or dust, linear in the logarithm of radius. [-]

    Parameters
    ----------
    species
        ``"ash"`` or ``"dust"``.
    effective_radius_um
        Effective radius, 0.25 to 20; beyond, Q is that of the limit. [um]
    """
    values = jnp.asarray(_EFFICIENCY[species], effective_radius_um.dtype)
    first, last = (jnp.log(jnp.asarray(x, values.dtype)) for x in _RADIUS_LIMITS)
    nodes = jnp.linspace(first, last, values.size, dtype=values.dtype)
    return jnp.interp(jnp.log(effective_radius_um), nodes, values)


@dataclass(frozen=True)
class MassLoading:
    """Mass loading of a species, as a `Derived` reads it."""

    species: str

    def __call__(
        self, _: Any, aod_550: Float[Array, "*n"], effective_radius_um: Float[Array, "*n"]
    ) -> Float[Array, "*n"]:
        """Mass of optical depth and effective radius [um]. [g m-2]"""
        efficiency = extinction_efficiency(self.species, effective_radius_um)
        length = effective_radius_um * _METRE * 4 / 3
        return DENSITY[self.species] * _GRAM * length * aod_550 / efficiency
