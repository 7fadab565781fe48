"""All that interacts with light in one column."""

from ..atmosphere import Atmosphere
from ..bands import Band
from ..optical_properties import OpticalProperties
from .aerosol import aerosol
from .cloud import liquid_cloud
from .rayleigh import rayleigh


def column_optics(atmosphere: Atmosphere, band: Band) -> OpticalProperties:
    """Optical properties of air, plumes and liquid cloud together, in one band.

    Scatterers come in the order air, plumes by name, cloud.

    Parameters
    ----------
    atmosphere
        One column.
    band
        Band, in which every plume must be specified.
    """
    optics = rayleigh(atmosphere, band)
    for plume in sorted(atmosphere.plumes):
        optics = optics + aerosol(atmosphere, plume, band)
    return optics + liquid_cloud(atmosphere, band)
