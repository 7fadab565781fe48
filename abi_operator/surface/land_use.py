"""Land use of weather models: which of its categories is which type of surface."""

# Categories of WRF by MMINLU, its name of the scheme, and the types of `emission` that they are
# (WRF's LANDUSE.TBL and VEGPARM.TBL; lakes by its ISLAKE, 51-61 the local climate zones of towns).
# What the University of Maryland's classes lack is the next of them: tundra shrubland, as their
# map of the earth has it, wetlands grass or woodland; mosaics of crops are crops.
_TOWNS = dict.fromkeys((31, 32, 33), "urban")

_USGS = {
    1: "urban",
    2: "cropland",
    3: "cropland",
    4: "cropland",
    5: "cropland",  # and grassland
    6: "cropland",  # and woodland
    7: "grassland",
    8: "open shrubland",
    9: "open shrubland",  # and grassland
    10: "wooded grassland",  # savanna
    11: "deciduous broadleaf forest",
    12: "deciduous needleleaf forest",
    13: "evergreen broadleaf forest",
    14: "evergreen needleleaf forest",
    15: "mixed forest",
    16: "water",
    17: "grassland",  # herbaceous wetland
    18: "woodland",  # wooded wetland
    19: "bare",
    20: "grassland",  # herbaceous tundra
    21: "open shrubland",  # wooded tundra
    22: "open shrubland",  # mixed tundra
    23: "bare",  # bare ground tundra
    24: "snow",
    25: "bare",  # playa
    26: "bare",  # lava
    27: "bare",  # white sand
    28: "water",  # lakes
    **_TOWNS,
}
_MODIS = {
    1: "evergreen needleleaf forest",
    2: "evergreen broadleaf forest",
    3: "deciduous needleleaf forest",
    4: "deciduous broadleaf forest",
    5: "mixed forest",
    6: "closed shrubland",
    7: "open shrubland",
    8: "woodland",  # woody savanna
    9: "wooded grassland",  # savanna
    10: "grassland",
    11: "grassland",  # permanent wetlands
    12: "cropland",
    13: "urban",
    14: "cropland",  # and natural vegetation
    15: "snow",
    16: "bare",
    17: "water",
    18: "open shrubland",  # wooded tundra
    19: "open shrubland",  # mixed tundra
    20: "bare",  # barren tundra
    21: "water",  # lakes
    **_TOWNS,
    **dict.fromkeys(range(51, 62), "urban"),
}

LAND_USE: dict[str, dict[int, str]] = {
    "USGS": _USGS,
    "USGS-RUC": _USGS,
    "MODIFIED_IGBP_MODIS_NOAH": _MODIS,
    "MODI-RUC": _MODIS,
}
"""By the name of a scheme, and by number of a category, the type of surface."""
