"""The US Standard Atmosphere against its published table."""

import numpy as np

from abi_operator.scene.standard_atmosphere import standard_pressure

# Pressure at the bases of the layers. [km], [hPa] (NOAA-S/T 76-1562, Table I, geopotential height)
TABLE = {0: 1013.25, 11: 226.32, 20: 54.749, 32: 8.6802, 47: 1.1091, 51: 0.66939, 71: 0.039564}
LAST_DIGIT = 5e-5


def test_pressure_is_that_of_the_published_table():
    pressure = standard_pressure(1e3 * np.array(list(TABLE)))
    np.testing.assert_allclose(pressure / 100, list(TABLE.values()), rtol=LAST_DIGIT)


def test_pressure_obeys_the_hydrostatic_equation_within_a_layer():
    height = np.array([15000.0, 15001.0, 15002.0])  # isothermal, 216.65 K
    slope = np.diff(np.log(standard_pressure(height)))
    np.testing.assert_allclose(slope, -9.80665 * 28.9644e-3 / 8.31432 / 216.65, rtol=1e-9)
