"""A column to test optics on, and Mie theory to test cloud against."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from independent_mie import sphere_efficiencies

from abi_operator.atmosphere import Atmosphere, LiquidCloud
from abi_operator.bands import BANDS
from abi_operator.optics import ash, smoke
from abi_operator.optics.water import REFRACTIVE_INDEX

SURFACE_HEIGHT = 300.0
SURFACE_PRESSURE = 97500.0


@pytest.fixture
def make_atmosphere():
    """Builder of a column to 20 km with plumes and three cloudy layers; the others are clear."""

    def make(num_layers=10, dtype=float, plumes=None):
        height = np.linspace(20000.0, 0.0, num_layers + 1)
        mass, number = np.zeros(num_layers), np.zeros(num_layers)
        mass[-4:-1] = [0.02, 0.05, 0.01]
        number[-4:-1] = [1.5e10, 2e10, 3e10]
        if plumes is None:
            bands = ("C01", "C06")
            plumes = {
                "smoke": smoke(0.8, brightness=0.7, base=1130.0, top=3170.0, bands=bands),
                "ash": ash(0.5, brightness=0.4, base=8210.0, top=10930.0, bands=bands),
            }
        atmosphere = Atmosphere(
            pressure=SURFACE_PRESSURE * np.exp(-height / 8000.0),
            height=height + SURFACE_HEIGHT,
            liquid=LiquidCloud(mass, number),
            plumes=plumes,
        )
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), atmosphere)

    return make


@pytest.fixture(scope="session")
def droplet_mie():
    """Mie theory for gamma distributions (nu = 7) of droplets: Q_ext, Q_abs and asymmetry.

    Sums over 2000 diameters, equidistant in their logarithm, miss narrow resonances: the means are
    good to 6e-4 in Q_ext and 3e-4 in asymmetry (against 40000 diameters).
    """
    diameter = np.geomspace(0.5, 160.0, 2000)

    @functools.cache
    def spheres(band):
        wavelength = BANDS[band].wavelength_um
        return sphere_efficiencies(REFRACTIVE_INDEX[band], diameter / 2, wavelength)

    def means(band, effective_radius_um):
        q_ext, q_sca, directed = spheres(band)
        slope = 10 / (2 * effective_radius_um)
        area = np.exp(10 * np.log(slope * diameter) - slope * diameter)
        area /= area.sum()
        scattering = area @ q_sca
        return area @ q_ext, area @ q_ext - scattering, area @ directed / scattering

    return means
