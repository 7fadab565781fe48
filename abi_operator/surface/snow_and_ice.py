"""Albedo of snow and of sea ice in the bands of sunlight, by type."""

# Snow: white-sky albedo of a deep layer of ice spheres of 100 and 500 um effective radius, by Mie
# theory (the index of `optics.ice_tables`) and `solver.toa_albedo`, after W. J. Wiscombe and S. G.
# Warren, "A model for the spectral albedo of snow. I: Pure snow", J. Atmos. Sci., 37, 2712-2733,
# 1980, doi:10.1175/1520-0469(1980)037<2712:AMFTSA>2.0.CO;2, whose new snow has 50 to 100 um and
# whose old snow more; benchmarks/make_snow_albedo.py prints it. Clean, flat and free of trees. The
# formula of A. A. Kokhanovsky and E. P. Zege, "Scattering optics of snow", Appl. Opt., 43,
# 1589-1602, 2004, doi:10.1364/AO.43.001589, gives the same where ice absorbs little. Sea ice
# without snow: means over 0.25-0.69, 0.69-1.19 and 1.19-2.38 um of E. E. Ebert and J. A. Curry, "An
# intermediate one-dimensional thermodynamic sea ice model for investigating ice-atmosphere
# interactions", J. Geophys. Res., 98, 10085-10109, 1993, doi:10.1029/93JC00656, table 2, as ECMWF's
# IFS uses them; over the sun's spectrum they are 0.53, and 0.49 (clear) to 0.54 (cloudy) were found
# for first-year ice of more than 0.7 m by R. E. Brandt et al., "Surface albedo of the Antarctic sea
# ice zone", J. Climate, 18, 3606-3622, 2005, doi:10.1175/JCLI3489.1, table 1. Thin ice is much
# darker (0.14 for nilas, there), and so are melt ponds. [-]
SNOW_AND_ICE_ALBEDO: dict[str, dict[str, float]] = {
    "new snow": {
        "C01": 0.995,
        "green": 0.984,
        "C02": 0.967,
        "C03": 0.888,
        "C04": 0.477,
        "C05": 0.081,
        "C06": 0.135,
    },
    "old snow": {
        "C01": 0.990,
        "green": 0.965,
        "C02": 0.932,
        "C03": 0.766,
        "C04": 0.207,
        "C05": 0.012,
        "C06": 0.023,
    },
    "bare sea ice": {
        "C01": 0.778,
        "green": 0.778,
        "C02": 0.778,
        "C03": 0.443,
        "C04": 0.055,
        "C05": 0.055,
        "C06": 0.055,
    },
}


def snow_and_ice_albedo(surface_type: str, band: str) -> float:
    """Albedo of a type of snow or ice in a band of sunlight. [-]

    Parameters
    ----------
    surface_type
        A key of `SNOW_AND_ICE_ALBEDO`.
    band
        Name of the band.

    Raises
    ------
    ValueError
        If the type is not one of them, or the band is not one of sunlight alone.
    """
    if surface_type not in SNOW_AND_ICE_ALBEDO:
        raise ValueError(
            f"no albedo for surface type {surface_type!r}; have {list(SNOW_AND_ICE_ALBEDO)}."
        )
    by_band = SNOW_AND_ICE_ALBEDO[surface_type]
    if band not in by_band:
        raise ValueError(f"no albedo of {surface_type} in band {band!r}; have {list(by_band)}.")
    return by_band[band]
