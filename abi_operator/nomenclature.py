"""One word per quantity: the variables of every Dataset in this project, with units and meaning.

Three Datasets follow each other, and each is described by names of this table:

- the **model Dataset** that a reader returns: what a weather model wrote, in these names, SI,
  *top first* (layer 0 is the uppermost), dimensions ``time layer y x`` (``level`` for edges);
- the **scenario**: one time of a scene (``layer y x``), completed to the top of the atmosphere,
  with clouds as paths, surface albedo by band, angles in degrees and the plumes that were
  specified. It is the truth, and everything that the operator reads;
- the **result**: the scenario, the reflectances simulated from it and the optical depths they
  contain. A retrieval reads it back.

Variables of a plume begin with the species' name (``smoke_``, ``ash_``).
"""

from typing import NamedTuple


class Variable(NamedTuple):
    """Dimensions, units (UDUNITS) and meaning of a Dataset variable; CF standard name if any."""

    dims: tuple[str, ...]
    units: str
    long_name: str
    standard_name: str | None = None


HORIZONTAL = ("y", "x")

MODEL: dict[str, Variable] = {
    "latitude": Variable(HORIZONTAL, "degrees_north", "latitude", "latitude"),
    "longitude": Variable(HORIZONTAL, "degrees_east", "longitude", "longitude"),
    "layer_pressure": Variable(("layer", "y", "x"), "Pa", "pressure at mid-layer", "air_pressure"),
    "surface_pressure": Variable(
        HORIZONTAL, "Pa", "pressure at the ground", "surface_air_pressure"
    ),
    "height": Variable(("level", "y", "x"), "m", "height above sea level", "altitude"),
    "temperature": Variable(("layer", "y", "x"), "K", "air temperature", "air_temperature"),
    "vapour_mixing_ratio": Variable(
        ("layer", "y", "x"), "kg kg-1", "water vapour per mass of dry air", "humidity_mixing_ratio"
    ),
    "cloud_mixing_ratio": Variable(
        ("layer", "y", "x"), "kg kg-1", "cloud water per mass of dry air"
    ),
    "cloud_number_mixing_ratio": Variable(
        ("layer", "y", "x"), "kg-1", "cloud droplets per mass of dry air"
    ),
    "rain_mixing_ratio": Variable(("layer", "y", "x"), "kg kg-1", "rain per mass of dry air"),
    "ice_mixing_ratio": Variable(("layer", "y", "x"), "kg kg-1", "cloud ice per mass of dry air"),
    "snow_mixing_ratio": Variable(("layer", "y", "x"), "kg kg-1", "snow per mass of dry air"),
    "graupel_mixing_ratio": Variable(("layer", "y", "x"), "kg kg-1", "graupel per mass of dry air"),
    "hail_mixing_ratio": Variable(("layer", "y", "x"), "kg kg-1", "hail per mass of dry air"),
    "land_mask": Variable(HORIZONTAL, "1", "1 over land, 0 over water", "land_binary_mask"),
}

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
    "rayleigh_optical_depth": Variable(("band", "y", "x"), "1", "optical depth of the air"),
    "liquid_optical_depth": Variable(("band", "y", "x"), "1", "optical depth of the cloud"),
}
"""The result has also ``{species}_optical_depth`` (band, y, x) and ``{species}_aod_550`` (y, x)."""

QUALITY_FLAGS: dict[str, int] = {
    "grazing_sun": 1,  # solar zenith angle above 80 degrees: plane-parallel air is a poor model
    "night": 2,  # sun at or below the horizon: reflectance factor 0, brf undefined
    "no_albedo": 4,  # the albedo file has no valid inversion here: nothing simulated
    "grazing_view": 8,  # view zenith angle above 80 degrees
    "out_of_sight": 16,  # satellite at or below the horizon: nothing simulated
}
"""Bits of ``quality_flag``; 0 is an unrestricted pixel."""

GRAZING_ZENITH = 80.0
"""Zenith angle from which `QUALITY_FLAGS` call sun or view grazing. [degree]"""


def variable(name: str) -> Variable | None:
    """Look a Dataset variable up by name; None where the project does not define it."""
    for table in (RESULT, SCENARIO, MODEL):
        if name in table:
            return table[name]
    species, _, quantity = name.partition("_")
    if quantity == "optical_depth":
        return Variable(("band", "y", "x"), "1", f"optical depth of the {species} plume")
    if quantity == "aod_550":
        return Variable(HORIZONTAL, "1", f"optical depth of the {species} plume at 550 nm")
    return PLUME.get(quantity)
