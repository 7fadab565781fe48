"""Liquid cloud: its optical thickness, and the effective radius of its droplets."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from abi_operator import LiquidCloud
from abi_operator.constants import WATER_DENSITY
from abi_operator.optics import effective_radius

from ..quantities import Derived, Quantity
from ..state_vector import StateVector
from ..transforms import Bounded

_MICRON = 1e-6  # [m]


def liquid_cloud() -> StateVector:
    """State vector of liquid cloud: optical thickness and effective radius of its droplets.

    The cloud has to be in the state, with any mass and number above 0, as without them nothing
    tells where it is: its layers keep their shares of the optical thickness, and all get one
    effective radius. Optical thickness is that of droplets with an extinction efficiency of 2,
    :math:`3 W / (2 \\rho_w r_\\mathrm{eff})`.
    """
    place = "atmosphere.liquid"
    thickness = Quantity(
        "cloud_optical_thickness",
        "1",
        "optical thickness of the liquid cloud",
        place,
        Bounded(0.0, 150.0),
        with_optical_thickness,
        sigma=1.5,
        mean=10.0,
        get=optical_thickness,
        # Thin ones, too: from 1 on some of 0.1 end where much larger droplets explain as much.
        starts=(0.1, 0.3, 1.0, 3.0, 10.0, 40.0),
    )
    radius = Quantity(
        "cloud_effective_radius_um",
        "um",
        "effective radius of the cloud's droplets",
        place,
        Bounded(2.0, 40.0, logarithmic=True),
        with_droplet_radius,
        sigma=1.0,
        mean=10.0,
        get=mean_droplet_radius_um,
        starts=(6.0, 10.0, 20.0),
    )
    path = Derived("liquid_water_path", "kg m-2", "mass of liquid water", place, _water_path)
    return StateVector((thickness, radius), (path,))


def optical_thickness(cloud: LiquidCloud) -> Float[Array, "*batch"]:
    """Optical thickness of a cloud whose droplets have an extinction efficiency of 2. [-]"""
    return jnp.sum(_layers_of(cloud), axis=-1)


def with_optical_thickness(cloud: LiquidCloud, value: Float[Array, "*batch"]) -> LiquidCloud:
    """A cloud of the same droplets, more or fewer of them."""
    factor = (value / optical_thickness(cloud))[..., None]
    return _with_paths(cloud, cloud.mass_path * factor, cloud.number_path * factor)


def with_droplet_radius(cloud: LiquidCloud, value: Float[Array, "*batch"]) -> LiquidCloud:
    """A cloud of the same optical thickness, layer by layer, with droplets of one radius. [um]"""
    radius = effective_radius(cloud)
    cloudy = ~(radius <= 0)  # what is no number stays none
    growth = jnp.where(cloudy, value[..., None] * _MICRON / jnp.where(cloudy, radius, 1), 1)
    # Mass is optical thickness times radius, and number is mass by radius cubed.
    return _with_paths(cloud, cloud.mass_path * growth, cloud.number_path / growth**2)


def _layers_of(cloud: LiquidCloud) -> Float[Array, "*batch layer"]:
    radius = effective_radius(cloud)
    cloudy = ~(radius <= 0)  # what is no number stays none
    thickness = 1.5 * cloud.mass_path / WATER_DENSITY / jnp.where(cloudy, radius, 1)
    return jnp.where(cloudy, thickness, 0)


def _with_paths(cloud: LiquidCloud, mass: Array, number: Array) -> LiquidCloud:
    return eqx.tree_at(lambda c: (c.mass_path, c.number_path), cloud, (mass, number))


def mean_droplet_radius_um(cloud: LiquidCloud) -> Float[Array, "*batch"]:
    """Effective radius of all droplets together, 3 W / (2 rho tau); NaN without cloud. [um]"""
    path = _water_path(cloud)
    thickness = optical_thickness(cloud)
    cloudy = thickness > 0
    radius = 1.5 * path / WATER_DENSITY / jnp.where(cloudy, thickness, 1) / _MICRON
    return jnp.where(cloudy, radius, jnp.nan)


def _water_path(cloud: LiquidCloud) -> Float[Array, "*batch"]:
    return jnp.sum(jnp.asarray(cloud.mass_path), axis=-1)
