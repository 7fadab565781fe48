"""Absorption by gases in NumPy: amounts of gas written anew, coefficients read as data.

An exponential sum is a table of fitted numbers; they are the package's own (`optics.gas.tables`),
since copying them here would add nothing. What they are multiplied by is not: every amount below
follows from the definition of its quantity.
"""

import numpy as np

from abi_operator.optics.gas.tables import TABLES

STANDARD_PRESSURE = 101325.0
# Exponent of pressure and reference mole fraction of each mixed gas and band, in the order of the
# tables: HITRAN-like scaling of a fit to 6SV2.1 in C05 and C06, of LOWTRAN's amounts in C07, but of
# N2O there of a fit to its lines.
MIXED = {
    "C02": {"O2": (0.0, None)},
    "C05": {"CO2": (0.4341, 400e-6), "CH4": (0.2195, 1.85e-6)},
    "C06": {"CH4": (0.2708, 1.85e-6), "N2O": (0.066, 0.33e-6)},
    "C07": {
        "CO2": (1.0, 330e-6),
        "CH4": (0.81, 1.7e-6),
        "N2O": (0.4, 0.33e-6),
        "N2": (0.92, None),
    },
}


def amounts(air, band):
    """Amount of each absorber of a band in every layer, in the order of its table.

    Parameters
    ----------
    air
        Dictionary of arrays: pressure [Pa] and temperature [K] of the levels, vapour [kg m-2] and
        ozone [DU] of the layers, and the mole fractions CO2, CH4, N2O. [-]
    band
        Name of the band.
    """
    centimetres = air["vapour"] / 10.0  # 1 kg m-2 is 1 mm of water
    ozone = air["ozone"] / 1000.0
    pressure = 0.5 * (air["pressure"][:-1] + air["pressure"][1:])
    temperature = 0.5 * (air["temperature"][:-1] + air["temperature"][1:])
    # Pressure of the vapour itself, of the mass that it has in the layer's air.
    humidity = 9.80665 * air["vapour"] / np.diff(air["pressure"])
    own = pressure * humidity / (0.622 + 0.378 * humidity)
    density = pressure / STANDARD_PRESSURE * 296.0 / temperature
    own_continuum = air["vapour"] * own / STANDARD_PRESSURE * (296.0 / temperature) ** 7
    foreign_continuum = air["vapour"] * density

    def mixed(gas):
        exponent, reference = MIXED[band][gas]
        share = 1.0 if reference is None else air[gas] / reference
        amount_above = (air["pressure"][1:] / STANDARD_PRESSURE) ** (1.0 + exponent)
        return share * np.diff(amount_above, prepend=0.0)

    if band == "C01":
        return [ozone]
    if band == "C02":
        return [ozone, centimetres, mixed("O2")]
    if band == "C03":
        return [centimetres]
    if band == "C04":
        warmth = (temperature - 250.0) / 250.0
        lines = air["vapour"] * (pressure / 5e4) ** 0.8823
        lines = lines * (1.0 - 0.8018 * warmth - 0.5533 * warmth**2)
        return [lines, foreign_continuum]
    if band == "C05":
        return [mixed("CO2"), mixed("CH4"), centimetres]
    if band == "C06":
        return [
            mixed("CH4"),
            mixed("N2O"),
            air["vapour"] * (pressure / STANDARD_PRESSURE) ** 0.7,
            own_continuum,
            foreign_continuum,
        ]
    lines = air["vapour"] * (pressure / STANDARD_PRESSURE) ** 0.3
    lines = lines * (1.0 + 1.5 * (temperature - 250.0) / 250.0)
    dry = [mixed(gas) for gas in MIXED[band]]
    return [*dry, lines, own_continuum, foreign_continuum]


def terms(air, band):
    """Weights, and absorption depth of each term in each layer, (term, layer). [-]"""
    table = TABLES[band]
    depth = np.zeros((len(table.weight), air["vapour"].size))
    for absorber, amount in zip(table.absorbers, amounts(air, band), strict=True):
        depth += np.outer(absorber.coefficients, amount)
    return np.array(table.weight), depth
