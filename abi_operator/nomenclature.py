"""One word per quantity: the variables of every Dataset in this project, with units and meaning.

Three Datasets follow each other, and each is described by names of this table:

- the **model Dataset** that a reader returns: what a weather model wrote, in these names, SI,
  *top first* (layer 0 is the uppermost), dimensions ``time layer y x`` (``level`` for edges);
- the **scenario**: one time of a scene (``layer y x``), completed to the top of the atmosphere,
  with clouds as paths, surface albedo by band, angles in degrees, the plumes that were specified,
  and where they are to be simulated gases, other hydrometeors, temperatures (`OPTIONAL`),
  anisotropic grounds (`GROUND`) and fires (`FIRE`). It is the truth, and everything that the
  operator reads;
- the **result**: the scenario, the radiances and reflectances simulated from it and the optical
  depths they contain. A retrieval reads it back.

Variables of a plume begin with the species' name (``smoke_``, ``ash_``), paths of hydrometeors with
that of their class (``rain_``, ``snow_``).
"""

from typing import NamedTuple


class Variable(NamedTuple):
    """Dimensions, units (UDUNITS) and meaning of a Dataset variable; CF standard name if any.

    A text has no units, and ``positive`` says of a vertical coordinate where it grows.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    standard_name: str | None = None
    positive: str | None = None


HORIZONTAL = ("y", "x")

HYDROMETEORS: dict[str, str] = {
    "cloud": "cloud water",
    "rain": "rain",
    "ice": "cloud ice",
    "snow": "snow",
    "graupel": "graupel",
    "hail": "hail",
}
"""Classes of condensate in models, and how to say them. A scenario calls cloud water liquid."""

UNSIMULATED = {"other_ice": "ice of further categories"}
"""Condensate of models that is weighed and not simulated, likewise."""

MODEL: dict[str, Variable] = {
    "latitude": Variable(HORIZONTAL, "degrees_north", "latitude", "latitude"),
    "longitude": Variable(HORIZONTAL, "degrees_east", "longitude", "longitude"),
    "latitude_bounds": Variable(
        (*HORIZONTAL, "corner"), "degrees_north", "latitude of the cells' corners"
    ),
    "longitude_bounds": Variable(
        (*HORIZONTAL, "corner"), "degrees_east", "longitude of the cells' corners"
    ),
    "layer_pressure": Variable(("layer", "y", "x"), "Pa", "pressure at mid-layer", "air_pressure"),
    "surface_pressure": Variable(
        HORIZONTAL, "Pa", "pressure at the ground", "surface_air_pressure"
    ),
    "height": Variable(("level", "y", "x"), "m", "height above sea level", "altitude", "up"),
    "layer_temperature": Variable(
        ("layer", "y", "x"), "K", "air temperature at mid-layer", "air_temperature"
    ),
    "vapour_mixing_ratio": Variable(
        ("layer", "y", "x"), "kg kg-1", "water vapour per mass of dry air", "humidity_mixing_ratio"
    ),
    **{
        f"{name}_mixing_ratio": Variable(
            ("layer", "y", "x"), "kg kg-1", f"{words} per mass of dry air"
        )
        for name, words in (HYDROMETEORS | UNSIMULATED).items()
    },
    **{
        f"{name}_number_mixing_ratio": Variable(
            ("layer", "y", "x"), "kg-1", f"particles of {words} per mass of dry air"
        )
        for name, words in HYDROMETEORS.items()
    },
    **{
        f"{name}_effective_radius": Variable(
            ("layer", "y", "x"), "m", f"effective radius of {words} by the model itself"
        )
        for name, words in HYDROMETEORS.items()
    },
    "surface_temperature": Variable(
        HORIZONTAL, "K", "temperature of the ground's surface", "surface_temperature"
    ),
    "surface_emissivity": Variable(
        HORIZONTAL, "1", "broadband emissivity of the ground", "surface_longwave_emissivity"
    ),
    "land_mask": Variable(HORIZONTAL, "1", "1 over land, 0 over water", "land_binary_mask"),
    "sea_ice": Variable(HORIZONTAL, "1", "share of the water that is ice", "sea_ice_area_fraction"),
    "snow_cover": Variable(
        HORIZONTAL, "1", "share of the ground under snow", "surface_snow_area_fraction"
    ),
    "broadband_albedo": Variable(
        HORIZONTAL, "1", "albedo of the ground for all sunlight", "surface_albedo"
    ),
    "land_use": Variable(HORIZONTAL, "1", "number of the category of land use"),
    "snow_mass": Variable(HORIZONTAL, "kg m-2", "snow on the ground", "surface_snow_amount"),
    "wind_along_x": Variable(HORIZONTAL, "m s-1", "wind at 10 m along the rows of the grid"),
    "wind_along_y": Variable(HORIZONTAL, "m s-1", "wind at 10 m across the rows of the grid"),
}

BY_BAND: dict[str, Variable] = {
    "band": Variable(("band",), "", "band of the imager", "sensor_band_identifier"),
    "band_wavelength": Variable(
        ("band",),
        "um",
        "centroid of the band's response, GOES-16",
        "sensor_band_central_radiation_wavelength",
    ),
}
"""Coordinates along the bands."""

SCENARIO: dict[str, Variable] = {
    "latitude": MODEL["latitude"],
    "longitude": MODEL["longitude"],
    "pressure": Variable(("level", "y", "x"), "Pa", "pressure at the levels", "air_pressure"),
    "height": MODEL["height"],
    "liquid_mass_path": Variable(("layer", "y", "x"), "kg m-2", "cloud water of the layer"),
    "liquid_number_path": Variable(("layer", "y", "x"), "m-2", "cloud droplets of the layer"),
    "surface_albedo": Variable(
        ("band", "y", "x"), "1", "white-sky albedo of the ground", "surface_albedo"
    ),
    "solar_zenith_angle": Variable(
        HORIZONTAL, "degree", "solar zenith angle", "solar_zenith_angle"
    ),
    "view_zenith_angle": Variable(
        HORIZONTAL, "degree", "satellite zenith angle", "sensor_zenith_angle"
    ),
    "relative_azimuth_angle": Variable(
        HORIZONTAL, "degree", "azimuth between satellite and sun, 0 on the same side"
    ),
    "quality_flag": Variable(HORIZONTAL, "1", "what limits the use of this pixel", "quality_flag"),
}

OPTIONAL: dict[str, Variable] = {
    "temperature": Variable(
        ("level", "y", "x"), "K", "air temperature at the levels", "air_temperature"
    ),
    "surface_temperature": MODEL["surface_temperature"],
    "vapour": Variable(("layer", "y", "x"), "kg m-2", "water vapour of the layer"),
    "ozone": Variable(("layer", "y", "x"), "DU", "ozone of the layer"),
    "carbon_dioxide": Variable((), "1", "mole fraction of carbon dioxide in dry air"),
    "methane": Variable((), "1", "mole fraction of methane in dry air"),
    "nitrous_oxide": Variable((), "1", "mole fraction of nitrous oxide in dry air"),
}
"""What a scenario has where gases or emission are simulated. Of hydrometeors other than cloud water
it has ``{class}_mass_path`` and ``{class}_number_path`` (layer, y, x)."""

BACKGROUND: dict[str, Variable] = {
    "background_aod_550": Variable((), "1", "optical depth of the background aerosol at 550 nm"),
    "background_scale_height": Variable((), "m", "height by which it falls to 1 / e"),
    "background_relative_extinction": Variable(
        ("band",), "1", "extinction of the background aerosol relative to 550 nm"
    ),
    "background_ssa": Variable(
        ("band",), "1", "single-scattering albedo of the background aerosol"
    ),
    "background_asymmetry": Variable(("band",), "1", "asymmetry factor of the background aerosol"),
    "background_optical_depth": Variable(
        ("band", "y", "x"), "1", "optical depth of the background aerosol"
    ),
}
"""What a scenario has where there is aerosol beside the plumes, and, the last, its result."""

GROUND: dict[str, Variable] = {
    "volume_kernel_weight": Variable(
        ("band", "y", "x"), "1", "weight of the Ross-Thick kernel in the reflectance of the land"
    ),
    "geometric_kernel_weight": Variable(
        ("band", "y", "x"), "1", "weight of the Li-Sparse-Reciprocal kernel, likewise"
    ),
    "water_share": Variable(HORIZONTAL, "1", "share of the ground that is open, glinting water"),
    "wind_speed": Variable(HORIZONTAL, "m s-1", "wind speed at 10 m", "wind_speed"),
}
"""What a scenario has where its ground is not Lambertian: land by its white-sky albedo and these
weights (`surface.RossLi`), open water by its wind (`surface.Ocean`)."""

FIRE: dict[str, Variable] = {
    "fire_fraction": Variable(HORIZONTAL, "1", "share of the ground that burns"),
    "fire_temperature": Variable(HORIZONTAL, "K", "temperature of the flames"),
}
"""What a scenario has where there are fires; where nothing burns the temperature is NaN."""

FIRE_TABLE: dict[str, Variable] = {
    "latitude": Variable(("fire",), "degrees_north", "latitude", "latitude"),
    "longitude": Variable(("fire",), "degrees_east", "longitude", "longitude"),
    "temperature": Variable(("fire",), "K", "temperature of the flames"),
    "area": Variable(("fire",), "m2", "ground that burns"),
    "start": Variable(("fire",), "", "time from which on it burns, UTC"),
    "end": Variable(("fire",), "", "time at which it burns no more, UTC"),
}
"""A table of fires, as a file has it."""

PLUME: dict[str, Variable] = {
    "brightness": Variable(HORIZONTAL, "1", "horizontal weight of the plume, 0 to 1"),
    "base": Variable((), "m", "lower edge of the plume above the ground"),
    "top": Variable((), "m", "upper edge of the plume above the ground"),
    "extinction_550": Variable((), "m-1", "extinction at 550 nm where brightness is 1"),
    "relative_extinction": Variable(("band",), "1", "extinction relative to 550 nm"),
    "ssa": Variable(("band",), "1", "single-scattering albedo of the plume"),
    "asymmetry": Variable(("band",), "1", "asymmetry factor of the plume"),
}

RESULT: dict[str, Variable] = {
    "reflectance_factor": Variable(
        ("band", "y", "x"), "1", "reflectance factor pi d2 L / E0, as in ABI files (contains mu0)"
    ),
    "brf": Variable(
        ("band", "y", "x"), "1", "bidirectional reflectance factor, reflectance factor / mu0"
    ),
    "radiance": Variable(
        ("band", "y", "x"),
        "W m-2 sr-1 um-1",
        "radiance at the top of the atmosphere",
        "toa_outgoing_radiance_per_unit_wavelength",
    ),
    "rayleigh_optical_depth": Variable(("band", "y", "x"), "1", "optical depth of the air"),
    "liquid_optical_depth": Variable(("band", "y", "x"), "1", "optical depth of the cloud"),
    "outside_fitted_range": Variable(
        ("band", "y", "x"),
        "1",
        "share of hydrometeors' optical depth at sizes beyond those that optics were fitted to",
    ),
}
"""The result has also ``{species}_optical_depth`` (band, y, x) and ``{species}_aod_550`` (y, x) of
plumes, and ``{class}_optical_depth`` of hydrometeors."""

OPTIONAL_RESULT: dict[str, Variable] = {
    "brightness_temperature": Variable(
        HORIZONTAL, "K", "brightness temperature in C07", "toa_brightness_temperature"
    ),
}
"""What the result has where C07 is simulated."""

OBSERVED: dict[str, Variable] = {
    "saturated": Variable(("band", "y", "x"), "1", "1 where the imager could tell no more"),
}
"""What the result has besides where it was observed."""

QUALITY_FLAGS: dict[str, int] = {
    "grazing_sun": 1,  # solar zenith angle above 80 degrees: plane-parallel air is a poor model
    "night": 2,  # sun at or below the horizon: reflectance factor 0, brf undefined
    "no_albedo": 4,  # the albedo file has no valid inversion here: nothing simulated
    "grazing_view": 8,  # view zenith angle above 80 degrees
    "out_of_sight": 16,  # satellite at or below the horizon: nothing simulated
    "outside_fit": 32,  # hydrometeors of sizes that no fit covers, see LARGEST_SHARE_OUTSIDE
    "ground_below_zero": 64,  # an anisotropic ground reflects less than nothing towards some view
    "ground_above_one": 128,  # more light leaves an anisotropic ground than falls in
}
"""Bits of ``quality_flag``; 0 is an unrestricted pixel."""

GRAZING_ZENITH = 80.0
"""Zenith angle from which `QUALITY_FLAGS` call sun or view grazing. [degree]"""

LARGEST_SHARE_OUTSIDE = 0.1
"""Share of hydrometeors' optical depth at sizes that no fit covers, in any band, from which
`QUALITY_FLAGS` call a column ``outside_fit``. [-]"""


def variable(name: str) -> Variable | None:
    """Look a Dataset variable up by name; None where the project does not define it."""
    for table in (
        RESULT,
        SCENARIO,
        OPTIONAL,
        BACKGROUND,
        GROUND,
        FIRE,
        OPTIONAL_RESULT,
        OBSERVED,
        MODEL,
        BY_BAND,
    ):
        if name in table:
            return table[name]
    # A species may have a name of several words.
    owners = {quantity: name.removesuffix(f"_{quantity}") for quantity in (*_OF_AN_OWNER, *PLUME)}
    for quantity, owner in owners.items():
        if owner in ("", name):
            continue
        if quantity in PLUME:
            return PLUME[quantity]
        words = HYDROMETEORS.get(owner, f"the {owner} plume")
        dims, units, said = _OF_AN_OWNER[quantity]
        return Variable(dims, units, said.format(words))
    return None


_OF_AN_OWNER = {
    "optical_depth": (("band", "y", "x"), "1", "optical depth of {}"),
    "mass_path": (("layer", "y", "x"), "kg m-2", "{} of the layer"),
    "number_path": (("layer", "y", "x"), "m-2", "particles of {} of the layer"),
    "aod_550": (HORIZONTAL, "1", "optical depth of {} at 550 nm"),
}
"""Dimensions, units and meaning of what each class of hydrometeors or each plume has."""
