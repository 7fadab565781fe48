"""Published optics of smoke and ash in the ABI bands.

Extinction is listed relative to 0.555 um, as the sources have it, and converted once to 0.550 um,
to which a plume's extinction refers, by interpolating the logarithm of extinction linearly in the
logarithm of wavelength between C01 and 0.555 um.
"""

import math
from typing import NamedTuple

from ..bands import BANDS

LISTED_UM = 0.555
REFERENCE_UM = 0.550


class AerosolOptics(NamedTuple):
    """By band: extinction relative to 0.550 um, single-scattering albedo, asymmetry factor. [-]"""

    relative_extinction: dict[str, float]
    ssa: dict[str, float]
    asymmetry: dict[str, float]


def referred_to_550(rows: dict[str, tuple[float, float, float]]) -> AerosolOptics:
    """Convert rows of extinction relative to 0.555 um, single-scattering albedo and asymmetry."""
    angstrom = -math.log(rows["C01"][0]) / math.log(BANDS["C01"].wavelength_um / LISTED_UM)
    at_550 = (REFERENCE_UM / LISTED_UM) ** -angstrom
    return AerosolOptics(
        {band: extinction / at_550 for band, (extinction, _, _) in rows.items()},
        {band: ssa for band, (_, ssa, _) in rows.items()},
        {band: asymmetry for band, (_, _, asymmetry) in rows.items()},
    )


# Biomass-burning model of 6SV2.1 (Vermote et al. 1997, doi:10.1109/36.581987), which is AERONET's
# Amazonian forest smoke (Dubovik et al. 2002, doi:10.1175/1520-0469(2002)059<0590:VOAAOP>2.0.CO;2),
# log-log between the wavelengths of its table at the centroids of GOES-16. [-] C07 is extrapolated
# from the last wavelength, 3.75 um: Mie theory on the sizes and index of its source gives 0.055,
# 0.853 and 0.703. Both take the index of refraction that was measured at 0.44-1.02 um.
SMOKE = referred_to_550(
    {
        "C01": (1.3573, 0.9391, 0.6585),
        "green": (1.0000, 0.9319, 0.6207),
        "C02": (0.7477, 0.9234, 0.5831),
        "C03": (0.3827, 0.8961, 0.4994),
        "C04": (0.1460, 0.8397, 0.4731),
        "C05": (0.1121, 0.8248, 0.5074),
        "C06": (0.0782, 0.8220, 0.6180),
        "C07": (0.0567, 0.8539, 0.6980),
    }
)

# Mie theory (miepython 3) for spheres at the centroids of GOES-16: lognormal, effective radius
# 3 um, geometric standard deviation 2, after the single micron-sized mode that Prata and Grant
# (2001, doi:10.1002/qj.49712757615) found at Ruapehu; index of refraction 1.53 - 0.0015i in every
# band. A constant index absorbs more in the blue than in the near infrared, which makes the ash
# brown. Measured indices at 0.45-0.65 um are 1.55 to 1.63 with 0.0005i to 0.0021i (Ball et al.
# 2015, doi:10.1002/2015JD023521). [-]
ASH = referred_to_550(
    {
        "C01": (0.9873, 0.9062, 0.7883),
        "green": (1.0000, 0.9173, 0.7762),
        "C02": (1.0122, 0.9264, 0.7659),
        "C03": (1.0471, 0.9424, 0.7405),
        "C04": (1.1246, 0.9622, 0.7048),
        "C05": (1.1572, 0.9675, 0.6954),
        "C06": (1.2208, 0.9766, 0.6828),
        "C07": (1.2058, 0.9860, 0.6764),
    }
)
