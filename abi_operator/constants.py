"""Physical constants, SI units unless the name says otherwise."""

# Pressure of the standard atmosphere, to which Rayleigh depths refer. [Pa]
STANDARD_PRESSURE = 101325.0
# Gas constants of dry air and of water vapour. [J kg-1 K-1] (the values WRF itself uses)
DRY_AIR_GAS_CONSTANT = 287.0
VAPOUR_GAS_CONSTANT = 461.6
# Specific heat of dry air at constant pressure over its gas constant, 7/2, inverted. [-]
KAPPA = 2.0 / 7.0
# WRF's acceleration of gravity, by which geopotential becomes height. [m s-2]
GRAVITY = 9.81
# Melting point of ice. [K]
FREEZING = 273.15
# Density of liquid water. [kg m-3]
WATER_DENSITY = 1000.0
# Distance of a geostationary satellite above the equator. [m] (GOES-R PUG, vol. 3)
SATELLITE_HEIGHT = 35786023.0
