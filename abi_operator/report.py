"""Lines that tell of a simulated scene: its flags, its plumes, what was assumed and left out."""

from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from .nomenclature import QUALITY_FLAGS
from .scene import CLASSES, COUNTED_OVER, PlumeSpecification, negative_lines

# Attributes of the scene that say where a quantity comes from, and what to call it.
_SOURCES = {
    "surface_albedo_source": "albedo of the ground",
    "emissivity_source": "emissivity of the ground in C07",
    "surface_temperature_source": "temperature of the ground",
}

# By the attribute of that name.
_CLOUD_OPTICS = {"mie": "Mie theory", "mitchell": "modified anomalous diffraction"}

# The same for how many columns something covers.
_COVERS = {
    "last_resort_albedo_count": "land with the albedo of last resort",
    "sea_ice_count": "ice on the sea",
    "snow_count": "snow on the ground",
    "kernel_count": "land that reflects by kernels",
    "water_count": "water that glints",
}


def flag_lines(result: xr.Dataset) -> Iterator[str]:
    """How many pixels of all times carry which flag."""
    flags = result["quality_flag"].values
    counts = {name: np.count_nonzero(flags & bit) for name, bit in QUALITY_FLAGS.items()}
    flagged = ", ".join(f"{name} {count}" for name, count in counts.items() if count)
    num_times = result.sizes.get("time", 1)
    of_all = f" of {num_times} times" if num_times > 1 else ""
    yield f"{flags.size} pixels{of_all}; flagged: {flagged or 'none'}"


def plume_lines(plumes: Mapping[str, PlumeSpecification]) -> Iterator[str]:
    """Where the plumes are, and how thick."""
    for species, (plume, brightness) in plumes.items():
        largest = float(plume.aod_550) * float(brightness.max())
        base, top = (float(height) / 1000 for height in (plume.base, plume.top))
        yield (
            f"plume of {species}: {np.count_nonzero(brightness)} of {brightness.size} columns, "
            f"optical depth at 550 nm up to {largest:.2g}, {base:g} to {top:g} km above the ground"
        )


def account_lines(account: Mapping[str, str | int | float]) -> Iterator[str]:
    """What was assumed and left out; of several times, that counts are sums over them."""
    times = str(account[COUNTED_OVER]).split(",")[0] if COUNTED_OVER in account else ""
    summed = f" (sum over {times})" if times else ""
    lowest, highest = (
        f"{float(account[f'{end}_model_top_pressure']) / 100:.0f}"
        for end in ("smallest", "largest")
    )
    pressure = lowest if lowest == highest else f"{lowest} to {highest}"
    yield f"air above {pressure} hPa: {account['air_above_model']}"
    if account["assumed_droplet_number_count"]:
        number = account["assumed_droplet_number"], account["assumed_droplet_number_source"]
        yield "droplet number, assumed: {} ({})".format(*number)
    if "standard_atmosphere" in account:
        yield f"ozone, and vapour and temperature above: {account['standard_atmosphere']}"
    yield f"gases that absorb: {account['gases']}"
    yield f"optics of cloud droplets: {_CLOUD_OPTICS[str(account['cloud_optics'])]}"
    if "background_aerosol" in account:
        yield f"background aerosol: {account['background_aerosol']}"
    for name in CLASSES:
        if f"assumed_{name}_number_count" in account:
            yield f"number of {name}, assumed: as the microphysics {account['microphysics']} does"
    for name, words in _SOURCES.items():
        if name in account:
            yield f"{words}: {account[name]}"
    for name, words in _COVERS.items():
        if name in account:
            yield f"{words}: {account[name]} columns{summed}"
    if "fire_count" in account:
        shared = account["fires_joined_count"]
        joined = f"; {shared} share a column with others" if shared else ""
        yield (
            f"fires: {account['fire_count']} in {account['burning_columns_count']} "
            f"columns{joined}{summed}"
        )
    if account["unsimulated_condensate_share"]:
        share = 100 * float(account["unsimulated_condensate_share"])
        kinds = str(account["unsimulated_condensate"]).replace("; ", ", ")
        yield f"{share:.2g} % of the condensate's mass: not simulated ({kinds})"
    for line in negative_lines(account):
        yield line + summed
