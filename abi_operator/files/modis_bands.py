"""How MODIS albedo becomes albedo in the bands of ABI.

Both the reader of MODIS files and the demonstration that writes one take their numbers from here.
"""

from typing import NamedTuple

WHITE_SKY = (1.0, 0.189184, -1.377622)
"""Weights of f_iso, f_vol and f_geo in white-sky albedo [1]_.

References
----------
.. [1] C. B. Schaaf et al., "First operational BRDF, albedo nadir reflectance products from MODIS",
   Remote Sens. Environ., 83, 135-148, 2002, doi:10.1016/S0034-4257(02)00091-3
"""


class AlbedoRegression(NamedTuple):
    """Albedo of an ABI band, ``offset + sum(weight * albedo[MODIS band])``. [-]"""

    weights: dict[str, float]
    offset: float


MODIS_TO_ABI: dict[str, AlbedoRegression] = {
    "C01": AlbedoRegression({"Band3": 1.0057}, 0.0),
    "C02": AlbedoRegression({"Band1": 0.983}, 0.0018),
    "C03": AlbedoRegression({"Band2": 1.003}, 0.0009),
    "C06": AlbedoRegression({"Band7": 0.897, "Band6": 0.0745}, 0.0033),
}
"""Regression over 600 canopies and soils simulated with PROSAIL; it does not hold for snow."""

BROADBAND_STAND_IN: dict[str, str] = {"C01": "vis", "C02": "vis", "C03": "nir"}
"""Broadband that may stand in for an ABI band where a file has no spectral bands."""
