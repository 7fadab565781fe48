"""All that interacts with light in one column."""

from collections.abc import Sequence

from ..atmosphere import Atmosphere
from ..bands import AnyBand
from ..optical_properties import OpticalProperties
from .aerosol import aerosol, background
from .cloud import liquid_cloud
from .gas import ALL_GASES, gas_absorption
from .hydrometeor import hydrometeor
from .rayleigh import rayleigh


def column_optics(
    atmosphere: Atmosphere, band: AnyBand, gases: Sequence[str] = ALL_GASES
) -> OpticalProperties:
    """Optical properties of all that a column holds, in one band.

    Scatterers come in the order air, plumes by name, background aerosol, liquid cloud, hydrometeor
    classes by name.

    Parameters
    ----------
    atmosphere
        One column.
    band
        Band, in which every plume must be specified.
    gases
        Which of the atmosphere's gases absorb; see `gas_absorption`.
    """
    optics = rayleigh(atmosphere, band) + gas_absorption(atmosphere, band, gases)
    for plume in sorted(atmosphere.plumes):
        optics = optics + aerosol(atmosphere, plume, band)
    if atmosphere.background is not None:
        optics = optics + background(atmosphere, band)
    optics = optics + liquid_cloud(atmosphere, band)
    for name in sorted(atmosphere.hydrometeors):
        optics = optics + hydrometeor(atmosphere, name, band)
    return optics
