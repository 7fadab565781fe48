"""Albedo in the bands of ABI from albedo in the land bands of MODIS."""

from collections.abc import Mapping
from typing import NamedTuple

from jaxtyping import Array, Float


class BandRegression(NamedTuple):
    """Albedo of an ABI band, ``offset + sum(weight * albedo[MODIS band])``. [-]"""

    weights: dict[str, float]
    offset: float = 0.0


# Centres of MODIS bands 5 and 6 and of C04 between them. [um] (MODIS: 1.230-1.250, 1.628-1.652)
_BAND5_UM, _BAND6_UM, _C04_UM = 1.24, 1.64, 1.3732
_SHARE6 = (_C04_UM - _BAND5_UM) / (_BAND6_UM - _BAND5_UM)

# Regressions of this project over 600 canopies and soils simulated with PROSAIL (S. Jacquemoud et
# al., "PROSPECT + SAIL models: a review of use for vegetation characterization", Remote Sens.
# Environ., 113, S56-S66, 2009, doi:10.1016/j.rse.2008.01.026; Python package `prosail`), whose
# spectra were averaged over the responses of Terra's MODIS and of GOES-16; standard errors 0.0001,
# 0.0012, 0.0011, 0.001 and 0.0027 for C01, C02, C03, C05 and C06. "green" and Band4 share their
# centre. C04 is no regression but lies on the line between its neighbours: water vapour hides the
# ground there. [-]
MODIS_TO_ABI: dict[str, BandRegression] = {
    "C01": BandRegression({"Band3": 1.0057}),
    "green": BandRegression({"Band4": 1.0}),
    "C02": BandRegression({"Band1": 0.983}, 0.0018),
    "C03": BandRegression({"Band2": 1.003}, 0.0009),
    "C04": BandRegression({"Band5": 1 - _SHARE6, "Band6": _SHARE6}),
    "C05": BandRegression({"Band5": -0.045, "Band6": 1.043}, -0.0021),
    "C06": BandRegression({"Band7": 0.897, "Band6": 0.0745}, 0.0033),
}


def modis_to_abi(modis: Mapping[str, Float[Array, "*n"]], band: str) -> Float[Array, "*n"]:
    r"""Albedo in a band of ABI, linear in the albedos of MODIS.

    .. math:: a = c_0 + \sum_i c_i\, a_i

    The regressions know vegetation and soil. They do not hold for snow, whose albedo falls steeply
    between the near-infrared bands (at 2.24 um it is about 0.07, at 2.13 um about 0.02 [1]_), nor
    for burnt or flooded ground without a check. What they give is not clipped: C05 falls below 0
    where Band6 is below 0.002 plus 0.043 times Band5, as it may be over clear water.

    The f_iso of kernel weights follow the same line, their f_vol and f_geo the same without its
    constant, as all three weights enter an albedo linearly.

    Parameters
    ----------
    modis
        Albedo by band of MODIS, ``"Band1"`` to ``"Band7"``; those that `band` needs suffice. [-]
    band
        Name of the ABI band.

    Raises
    ------
    ValueError
        If there is no regression for `band`, or a MODIS band that it needs is missing.

    References
    ----------
    .. [1] D. E. Bowker et al., "Spectral reflectances of natural targets for use in remote sensing
       studies", NASA Reference Publication 1139, 1985
    """
    if band not in MODIS_TO_ABI:
        raise ValueError(f"no regression on MODIS for band {band!r}; have {list(MODIS_TO_ABI)}.")
    weights, offset = MODIS_TO_ABI[band]
    missing = [name for name in weights if name not in modis]
    if missing:
        raise ValueError(
            f"albedo in band {band!r} needs MODIS {list(weights)}; missing {missing}, "
            f"got {list(modis)}."
        )
    first, *others = [weight * modis[name] for name, weight in weights.items()]
    return sum(others, start=first) + offset
