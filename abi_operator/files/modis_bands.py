"""What MODIS files hold of albedo: the reader and the demonstration that writes one agree on it.

The regressions from its bands to those of ABI are `surface.MODIS_TO_ABI`.
"""

WHITE_SKY = (1.0, 0.189184, -1.377622)
"""Weights of f_iso, f_vol and f_geo in white-sky albedo [1]_.

References
----------
.. [1] C. B. Schaaf et al., "First operational BRDF, albedo nadir reflectance products from MODIS",
   Remote Sens. Environ., 83, 135-148, 2002, doi:10.1016/S0034-4257(02)00091-3
"""


BROADBAND_STAND_IN: dict[str, str] = {"C01": "vis", "C02": "vis", "C03": "nir"}
"""Broadband that may stand in for an ABI band where a file has no spectral bands."""
