"""Light that the ground gives off by itself: of its heat, and of a fire smaller than a pixel."""

from jaxtyping import Array, Float

# Emissivity by surface type near 3.9 um, for albedo = 1 - emissivity. Land, after the University of
# Maryland's classes: values for 3.7-4.0 um that the cloud retrieval CLAVR-x (A. Heidinger, NOAA)
# assigns them from S. W. Seemann et al., "Development of a global infrared land surface emissivity
# database for application to clear sky sounding retrievals from multispectral satellite radiance
# measurements", J. Appl. Meteorol. Climatol., 47, 108-123, 2008, doi:10.1175/2007JAMC1590.1.
# They are means: single soils and sands reach from 0.6 to 0.95 (J. W. Salisbury and D. M. D'Aria,
# "Emissivity of terrestrial materials in the 3-5 um atmospheric window", Remote Sens. Environ., 47,
# 345-361, 1994, doi:10.1016/0034-4257(94)90102-3). Water: Fresnel's law straight down for the index
# of `ocean`; flame: black, where it is optically thick. [-]
EMISSIVITY_3900NM: dict[str, float] = {
    "evergreen needleleaf forest": 0.95,
    "evergreen broadleaf forest": 0.96,
    "deciduous needleleaf forest": 0.94,
    "deciduous broadleaf forest": 0.94,
    "mixed forest": 0.94,
    "woodland": 0.94,
    "wooded grassland": 0.93,
    "closed shrubland": 0.89,
    "open shrubland": 0.89,
    "grassland": 0.92,
    "cropland": 0.94,
    "bare": 0.86,
    "urban": 0.94,
    "snow": 0.984,
    "water": 0.978,
    "flame": 1.0,
}


def emissivity_3900nm(surface_type: str) -> float:
    """Emissivity near 3.9 um that a type of surface has where nothing better is known. [-]

    Parameters
    ----------
    surface_type
        A key of `EMISSIVITY_3900NM`.

    Raises
    ------
    ValueError
        If the type is not one of them.
    """
    if surface_type not in EMISSIVITY_3900NM:
        raise ValueError(
            f"no emissivity for surface type {surface_type!r}; have {list(EMISSIVITY_3900NM)}."
        )
    return EMISSIVITY_3900NM[surface_type]


def surface_emission(
    albedo: Float[Array, "*#batch"],
    background: Float[Array, "*#batch"],
    fire: Float[Array, "*#batch"] | float = 0.0,
    fraction: Float[Array, "*#batch"] | float = 0.0,
) -> Float[Array, "*batch"]:
    r"""Radiance that leaves the ground in all directions, with a fire in a part of it.

    .. math:: L = (1 - a)\,[p B(T_f) + (1 - p) B(T_b)]

    By Kirchhoff's law a ground of albedo a emits 1 - a of what a black one would [1]_. Fire and
    background share the albedo of the whole, and what is reflected is that of the background. Of an
    anisotropic ground it is the white-sky albedo that makes the hemisphere's emission right.

    Parameters
    ----------
    albedo
        Albedo of the ground in the band. [-]
    background
        Planck function of the ground beside the fire, B(T_b): in any unit, as the result has it;
        in a band it is the mean over its response. [W m-2 sr-1 um-1]
    fire
        Planck function of the fire, B(T_f). [W m-2 sr-1 um-1]
    fraction
        Share p of the ground that burns; a fire without a share is none. [-]

    References
    ----------
    .. [1] J. Dozier, "A method for satellite identification of surface temperature fields of
       subpixel resolution", Remote Sens. Environ., 11, 221-229, 1981,
       doi:10.1016/0034-4257(81)90021-3
    """
    return (1 - albedo) * (background + fraction * (fire - background))
