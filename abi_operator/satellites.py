"""What the calibration of each GOES-R satellite's imager says, band by band.

The spectral responses behind these figures are NOAA's release of 2016 [1]_; what is called
integrated was integrated here over those responses. Where a figure of GOES-17 to -19 is not known,
that of GOES-16 stands in and the table says so.

References
----------
.. [1] NOAA GOES-R Calibration Working Group, ABI spectral response functions (PFM, FM2, FM3, FM4),
   2016.
.. [2] R. L. Kurucz, "Synthetic infrared spectra", in Infrared Solar Physics, IAU Symp. 154, edited
   by D. M. Rabin and J. T. Jefferies, Kluwer, 1992 (means over 1 nm as libRadtran distributes them)
"""

from typing import NamedTuple

from .bands import BANDS, check_bands

SATELLITES = ("GOES-16", "GOES-17", "GOES-18", "GOES-19")

# Solar irradiance at 1 AU. [W m-2 um-1] GOES-16, C01 to C06: the value in its L1b files. C07, and
# all of GOES-17 to -19: mean of Kurucz's spectrum [2] over the response, which agrees with those
# file values to 1.3 % in C01 and 0.4 % elsewhere. The green band has no response: mean of the same
# spectrum over 0.545 to 0.565 um (that of ASTM G173 is 1.2 % lower).
_SOLAR_IRRADIANCE = {
    "GOES-16": {
        "C01": 2017.1648,
        "green": 1871.5,
        "C02": 1631.3351,
        "C03": 957.0699,
        "C04": 360.90176,
        "C05": 242.54037,
        "C06": 76.8999,
        "C07": 9.69,
    },
    "GOES-17": {
        "C01": 2041.83,
        "green": 1871.5,
        "C02": 1628.28,
        "C03": 955.59,
        "C04": 361.61,
        "C05": 242.51,
        "C06": 77.05,
        "C07": 9.744,
    },
    "GOES-18": {
        "C01": 2040.92,
        "green": 1871.5,
        "C02": 1626.69,
        "C03": 956.15,
        "C04": 361.46,
        "C05": 242.75,
        "C06": 77.11,
        "C07": 9.578,
    },
    "GOES-19": {
        "C01": 2042.12,
        "green": 1871.5,
        "C02": 1625.50,
        "C03": 956.27,
        "C04": 358.51,
        "C05": 242.67,
        "C06": 76.99,
        "C07": 9.565,
    },
}

# Centroid of the response. [um] (integrated; those of GOES-16 are what the bands are listed by)
_CENTROID_UM = {
    "GOES-16": {name: band.wavelength_um for name, band in BANDS.items()},
    "GOES-17": {
        "C01": 0.4712,
        "green": 0.555,
        "C02": 0.6387,
        "C03": 0.8640,
        "C04": 1.3722,
        "C05": 1.6089,
        "C06": 2.2418,
        "C07": 3.8879,
    },
    "GOES-18": {
        "C01": 0.4713,
        "green": 0.555,
        "C02": 0.6392,
        "C03": 0.8637,
        "C04": 1.3725,
        "C05": 1.6081,
        "C06": 2.2414,
        "C07": 3.9052,
    },
    "GOES-19": {
        "C01": 0.4710,
        "green": 0.555,
        "C02": 0.6395,
        "C03": 0.8637,
        "C04": 1.3791,
        "C05": 1.6084,
        "C06": 2.2423,
        "C07": 3.9068,
    },
}


class Packing(NamedTuple):
    """How an L1b file packs radiance into integers: radiance = scale * count + offset.

    Counts run from 0 to 2^bits - 2; the highest integer marks missing data. The unit is the file's:
    W m-2 sr-1 um-1, but mW m-2 sr-1 (cm-1)-1 in C07.
    """

    scale: float
    offset: float
    bits: int

    @property
    def highest_count(self) -> int:
        """Count at the top of the range. [-]"""
        return 2**self.bits - 2

    @property
    def ceiling(self) -> float:
        """Highest radiance that a file can hold, in the file's unit."""
        return self.scale * self.highest_count + self.offset


# L1b files of GOES-16; taken for GOES-17 to -19 too. The bits are inferred: with them the ceilings
# are reflectance factors of 1.21 to 1.25 and, in C07, 411.9 K.
_PACKING = {
    "C01": Packing(0.8121064, -25.936647, 10),
    "C02": Packing(0.15859237, -20.289911, 12),
    "C03": Packing(0.37691253, -12.037643, 10),
    "C04": Packing(0.07073108, -4.5223684, 11),
    "C05": Packing(0.09580004, -3.0596137, 10),
    "C06": Packing(0.030088475, -0.9609507, 10),
    "C07": Packing(0.001564351, -0.0376, 14),
}


class PlanckCoefficients(NamedTuple):
    """In-band Planck radiance in closed form, fk1 / (exp(fk2 / (bc1 + bc2 T)) - 1).

    fk1 in mW m-2 sr-1 (cm-1)-1, fk2 and bc1 in K, bc2 without unit; `factor` is the radiance in
    W m-2 sr-1 um-1 that makes 1 mW m-2 sr-1 (cm-1)-1, from the widths of the response in wavenumber
    and in wavelength.
    """

    fk1: float
    fk2: float
    bc1: float
    bc2: float
    factor: float


# C07 of GOES-16: L1b files. C07 of the others: fk1 and fk2 of the centroid of the response in
# wavenumber (which gives those of GOES-16's files to all their digits), bc1 and bc2 fitted to the
# response at the temperatures of the Earth. C05 and C06: fitted at 250 to 1500 K by
# benchmarks/fit_planck.py, which also gives all factors and errors.
_PLANCK = {
    "GOES-16": {
        "C05": PlanckCoefficients(2859506.5, 8942.2746, 0.407319, 0.9998055, 3.861254),
        "C06": PlanckCoefficients(1056397.9, 6416.4303, 0.132564, 0.9999200, 1.988416),
        "C07": PlanckCoefficients(202263.0, 3698.19, 0.43361, 0.99939, 0.660195),
    },
    "GOES-17": {
        "C05": PlanckCoefficients(2862873.0, 8945.7825, 0.410769, 0.9998036, 3.864275),
        "C06": PlanckCoefficients(1057669.9, 6419.0046, 0.132373, 0.9999202, 1.990012),
        "C07": PlanckCoefficients(203135.32, 3703.5037, 0.449235, 0.999368, 0.662078),
    },
    "GOES-18": {
        "C05": PlanckCoefficients(2866886.5, 8949.9609, 0.410422, 0.9998039, 3.867888),
        "C06": PlanckCoefficients(1058288.3, 6420.2554, 0.132697, 0.9999200, 1.990787),
        "C07": PlanckCoefficients(200441.35, 3687.0589, 0.452287, 0.999362, 0.656205),
    },
    "GOES-19": {
        "C05": PlanckCoefficients(2865655.2, 8948.6795, 0.410677, 0.9998068, 3.866743),
        "C06": PlanckCoefficients(1056972.7, 6417.5938, 0.132138, 0.9999204, 1.989138),
        "C07": PlanckCoefficients(200248.06, 3685.8734, 0.493841, 0.999303, 0.655737),
    },
}


def check_satellite(name: str) -> str:
    """Return `name`, or raise `ValueError` if it is no satellite of this series."""
    if name not in SATELLITES:
        raise ValueError(f"satellite {name!r} is not known; choose from {list(SATELLITES)}.")
    return name


def solar_irradiance(band: str, satellite: str = "GOES-16") -> float:
    """Solar irradiance of a band at 1 AU. [W m-2 um-1]"""
    return _look_up(_SOLAR_IRRADIANCE, band, satellite)


def centroid_um(band: str, satellite: str = "GOES-16") -> float:
    """Centroid of a band's response. [um]"""
    return _look_up(_CENTROID_UM, band, satellite)


def packing(band: str, satellite: str = "GOES-16") -> Packing:
    """Scale, offset and bits of a band in L1b files; there are none of the green band."""
    check_satellite(satellite)
    if band not in _PACKING:
        raise ValueError(f"L1b files have no band {band!r}; choose from {list(_PACKING)}.")
    return _PACKING[band]


def planck_coefficients(band: str, satellite: str = "GOES-16") -> PlanckCoefficients:
    """Coefficients of the Planck radiance of a band in which fires and the ground emit."""
    coefficients = _PLANCK[check_satellite(satellite)]
    if band not in coefficients:
        raise ValueError(
            f"emission in band {band!r} is negligible; choose from {list(coefficients)}."
        )
    return coefficients[band]


def gas_fit_covers(satellite: str, band: str) -> bool:
    """Whether absorption fitted to GOES-16's response holds in this satellite's band.

    The fits of gas absorption stand for one response per band. Centroids agree within 1.4 nm in
    C01, C02, C03, C05 and C06, but C04 sits on the flank of the strong water-vapour band at 1.38
    um, and GOES-19's response there lies elsewhere: its centroid is 1.3791 um and its width 15.8
    nm, against 1.373 um and 14 nm of GOES-16 to -18.

    Parameters
    ----------
    satellite, band
        Names, ``"GOES-19"`` and ``"C04"`` for example.
    """
    check_satellite(satellite)
    check_bands((band,))
    return (satellite, band) != ("GOES-19", "C04")


def _look_up(table: dict[str, dict[str, float]], band: str, satellite: str) -> float:
    check_satellite(satellite)
    check_bands((band,))
    return table[satellite][band]
