"""Smoke, ash and dust from the result of a simulation."""

from collections.abc import Sequence
from typing import Any

import xarray as xr

from .declarations import AOD_LIMIT, plume
from .images import retrieve_image

BANDS = ("C01", "C02", "C03")
"""Bands that are used by default: in C06, smoke is hardly seen."""


def retrieve_smoke(
    dataset: xr.Dataset,
    *,
    bands: Sequence[str] = BANDS,
    retrieve_ssa: bool = False,
    aod_limit: float = AOD_LIMIT,
    **how: Any,
) -> xr.Dataset:
    """Retrieve smoke: optical depth, and if wished how much it absorbs.

    Parameters
    ----------
    dataset, bands, **how
        As of `retrieve_image`.
    retrieve_ssa
        Whether single-scattering albedo is unknown too, by one shift of its logit in all bands.
    aod_limit
        Optical depths from here on are out of reach. [-]
    """
    vector = plume("smoke", ssa=retrieve_ssa, aod_limit=aod_limit)
    about = {"title": "Smoke retrieved from synthetic imagery", "aod_limit": aod_limit}
    return retrieve_image(dataset, vector, bands=bands, species="smoke", attributes=about, **how)
