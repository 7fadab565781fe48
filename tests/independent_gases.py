"""Absorption by gases in NumPy: amounts of gas written anew, coefficients read as data.

An exponential sum is a table of fitted numbers; they are the package's own (`optics.gas.tables`),
since copying them here would add nothing. What they are multiplied by is not: every amount below
follows from the definition of its quantity.
"""

import numpy as np

from abi_operator.optics.gas.tables import TABLES

STANDARD_PRESSURE = 101325.0
# Exponent of pressure and reference mole fraction of each mixed gas and band, in the order of the
# tables: HITRAN-like scaling of a fit to 6SV2.1 in C05 and C06, of LOWTRAN's amounts in C07.
MIXED = {
    "C02": {"O2": (0.0, None)},
    "C05": {"CO2": (0.4341, 400e-6), "CH4": (0.2195, 1.85e-6)},
    "C06": {"CH4": (0.2708, 1.85e-6), "N2O": (0.066, 0.33e-6)},
    "C07": {
        "CO2": (1.0, 330e-6),
        "CH4": (0.81, 1.7e-6),
        "N2O": (0.79, 0.32e-6),
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
    above = np.concatenate([[0.0], np.cumsum(centimetres)])

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
        density = pressure / STANDARD_PRESSURE * 296.0 / temperature
        return [lines, air["vapour"] * density]
    if band == "C05":
        return [mixed("CO2"), mixed("CH4"), centimetres]
    if band == "C06":
        return [
            mixed("CH4"),
            mixed("N2O"),
            centimetres,
            centimetres,
            np.diff(above**2),
        ]
    lines = air["vapour"] * (pressure / STANDARD_PRESSURE) ** 1.36
    return [mixed("CO2"), mixed("CH4"), mixed("N2O"), mixed("N2"), lines]


def terms(air, band):
    """Weights, and absorption depth of each term in each layer, (term, layer). [-]"""
    table = TABLES[band]
    depth = np.zeros((len(table.weight), air["vapour"].size))
    for absorber, amount in zip(table.absorbers, amounts(air, band), strict=True):
        depth += np.outer(absorber.coefficients, amount)
    return np.array(table.weight), depth
