"""The derived green of a scene beside simulated light of 0.555 um (Figs. 2 and 3 of the paper)."""

import numpy as np
import xarray as xr

from ..files import InputError
from ..products import GREEN_RECIPES, cira_stretch, derived_green, natural_color
from ..scene import species_of
from .figure import Figure
from .nir_study import brf_by_band
from .panels import Panel, change_map, scatter
from .pixel_kinds import CLOUD, EITHER, NOT_TOLD, cloud_depth, depths_of, ground_kinds
from .result_checks import check_result
from .scene_study import chosen_pixels

_NEEDED = ("C01", "C02", "C03", "green")
_READ = ("reflectance_factor", "surface_albedo", "solar_zenith_angle", "quality_flag")


def green_figure(image: xr.Dataset) -> Figure:
    """Natural colours with either green, their difference, and both against each other.

    At the top of the atmosphere, without the air taken out, as in the paper: of either kind the
    picture has the same red and blue. The lines are of pixels with cloud and without, over water
    and over land: where a result cannot tell them (`pixel_kinds.ground_kinds`), over either, and a
    line says so.

    Parameters
    ----------
    image
        Result of a simulation at one time, with C01, C02, C03 and green; what has layers is not
        needed (``--variables image``).

    Raises
    ------
    InputError
        Where a band is missing or another part of the result, or the sun shines on no pixel.
    """
    check_result(image, [*_READ, *depths_of(image)])
    lacking = sorted(set(_NEEDED) - set(image["band"].values.tolist()))
    if lacking:
        raise InputError(
            f"the result has no band {', '.join(lacking)}; simulate it (--bands "
            f"{','.join(_NEEDED)}, or abi-operator demo --plume ash)."
        )
    brf = brf_by_band(image)
    red, blue, near, simulated = (brf[band] for band in ("C02", "C01", "C03", "green"))
    found = {x: np.asarray(derived_green(red, blue, near, recipe=x)) for x in GREEN_RECIPES}
    kinds = _kinds(image, chosen_pixels(image, None, "all") & np.isfinite(simulated))
    lines = [f"Derived green less simulated, brf: {'mean':>22} {'deviation':>10} {'pixels':>8}"]
    for name, green in found.items():
        for kind, chosen in kinds.items():
            off = (green - simulated)[chosen]
            if off.size:
                numbers = f"{off.mean():+10.4f} {off.std():10.4f} {off.size:8d}"
                lines.append(f"{name:>14} {kind:>30} {numbers}")
    if f"clear {EITHER}" in kinds:
        lines.append(NOT_TOLD)
    paper = found["grasso2013"]
    off = paper - simulated
    largest, high = (float(np.nanpercentile(x, 99.5)) for x in (np.abs(off), simulated))
    good = kinds["all"]
    both = np.asarray(cira_stretch(np.stack([red, simulated, blue], axis=-1)))
    panels = [
        Panel("Green derived by Eq. (1)", np.asarray(natural_color(brf))),
        Panel("Green simulated, 0.555 um", both),
        change_map("Derived less simulated, brf", off, largest, ""),
        scatter("Derived against simulated", simulated[good], paper[good], high, "brf"),
    ]
    fields = {"green_derived": paper, "green_simulated": simulated}
    return Figure(
        panels, 2, lines, fields, "At the top of the atmosphere; the air is in both pictures."
    )


def _kinds(image: xr.Dataset, good: np.ndarray) -> dict[str, np.ndarray]:
    cloudy = cloud_depth(image, "C03") >= CLOUD
    inside = np.zeros_like(good)
    for species in species_of(image):
        inside |= image[f"{species}_brightness"].values > 0
    clear, grounds = good & ~cloudy, ground_kinds(image)
    return {
        "all": good,
        **{f"clear {name}": clear & ~inside & ground for name, ground in grounds.items()},
        **{f"plume over {name}": clear & inside & ground for name, ground in grounds.items()},
        "cloud": good & cloudy,
    }
