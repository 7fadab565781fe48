"""What is there: the specified state of one column.

Every class is a frozen pytree of floating arrays. One column has the shapes written here; a batch
of columns carries one more axis, leading, on every leaf. Layers and levels count from the top.
"""

import equinox as eqx
from jaxtyping import Array, Float

from .geometry import Geometry


class LiquidCloud(eqx.Module):
    """Cloud droplets of each layer, by mass and number.

    Parameters
    ----------
    mass_path
        Mass of liquid water in the layer per horizontal area. [kg m-2]
    number_path
        Number of droplets in the layer per horizontal area; read only where there is mass. [m-2]
    """

    mass_path: Float[Array, "*batch layer"]
    number_path: Float[Array, "*batch layer"]


class Plume(eqx.Module):
    """A vertically uniform aerosol layer, as Grasso et al. (2013) specify smoke and ash.

    Extinction in a band is ``brightness * extinction_550 * relative_extinction[band]`` between
    `base` and `top` and zero elsewhere, so that the column's optical depth at 550 nm is
    ``brightness * extinction_550 * (top - base)`` whatever the levels of the column.

    Parameters
    ----------
    base, top
        Lower and upper edge above the ground. [m]
    extinction_550
        Extinction coefficient at 550 nm where brightness is 1. [m-1]
    brightness
        Horizontal weight, 0 to 1 (the grey value of the picture that draws the plume). [-]
    relative_extinction, ssa, asymmetry
        By band: extinction relative to 550 nm, single-scattering albedo, asymmetry factor. [-]
    """

    base: Float[Array, "*batch"]
    top: Float[Array, "*batch"]
    extinction_550: Float[Array, "*batch"]
    brightness: Float[Array, "*batch"]
    relative_extinction: dict[str, Float[Array, "*batch"]]
    ssa: dict[str, Float[Array, "*batch"]]
    asymmetry: dict[str, Float[Array, "*batch"]]

    @property
    def aod_550(self) -> Float[Array, "*batch"]:
        """Optical depth of the plume at 550 nm. [-]"""
        return self.brightness * self.extinction_550 * (self.top - self.base)


class Atmosphere(eqx.Module):
    """Air, cloud and plumes of one column.

    Parameters
    ----------
    pressure, height
        At the levels, top first: pressure, rising; height above sea level, falling. The last level
        is the ground. [Pa], [m]
    liquid
        Cloud droplets in the layers between the levels.
    plumes
        Aerosol plumes by species name (``"smoke"``, ``"ash"``).
    """

    pressure: Float[Array, "*batch level"]
    height: Float[Array, "*batch level"]
    liquid: LiquidCloud
    plumes: dict[str, Plume]


class State(eqx.Module):
    """All that the operator needs to know of one column.

    Parameters
    ----------
    atmosphere
        Air, cloud and plumes.
    albedo
        Lambertian (white-sky) albedo of the ground by band. [-]
    geometry
        Directions of the sun and of the satellite.
    """

    atmosphere: Atmosphere
    albedo: dict[str, Float[Array, "*batch"]]
    geometry: Geometry
