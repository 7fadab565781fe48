"""The scenario: one time of a scene as the operator sees it, and the truth of its simulation."""

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from ..bands import GRASSO2013, check_bands
from ..files.netcdf import cf_attributes
from ..nomenclature import QUALITY_FLAGS, SCENARIO
from .account import condensate_account, condensate_warnings, model_attributes, pressure_range
from .albedo import surface_albedo
from .angles import angle_flags, find_angles
from .checks import check_scenario
from .column_air import complete_air, completion_heights, highest_top
from .liquid import DropletNumber, condensate, liquid_paths
from .species import PlumeSpecification, plume_variables

GOES_EAST = -75.2
"""Longitude of GOES-16 and its successors in the east. [degree]"""


def scenario(
    model: xr.Dataset,
    *,
    albedo: xr.Dataset | None = None,
    ocean_albedo: float | None = None,
    plumes: Mapping[str, PlumeSpecification] | None = None,
    satellite_longitude: float = GOES_EAST,
    bands: Sequence[str] = GRASSO2013,
    droplet_number: DropletNumber | None = None,
    added_heights: Sequence[float] | None = None,
    rows: slice = slice(None),
) -> xr.Dataset:
    """Specify a scene, or a block of its rows, from a model's output.

    The columns are completed to the top of the atmosphere (`complete_air`), cloud water becomes
    paths (`liquid_paths`), the ground gets its albedo (`surface_albedo`), sun and satellite their
    places (`find_angles`), and the plumes are added. Condensate that is not simulated is warned of.

    Parameters
    ----------
    model
        One time of a model Dataset, whole or a block of rows.
    albedo
        Albedo of the ground as `files.read_mcd43a1` returns it. [-]
    ocean_albedo
        Albedo of water, or of all that `albedo` lacks where the model has no land mask. [-]
    plumes
        Plumes by species, in the whole scene.
    satellite_longitude
        Longitude of the geostationary satellite. [degree]
    bands
        Bands to be simulated.
    droplet_number
        Number of droplets where the model has none; None for `DropletNumber`'s defaults. [m-3]
    added_heights
        Heights of levels to add above the model's top; None for `completion_heights` of this block.
        The blocks of a scene need the same. [m]
    rows
        The rows of the scene that `model` holds.

    Returns
    -------
    xarray.Dataset
        Variables of `nomenclature.SCENARIO` and of the plumes; coordinates ``band`` and ``time``.
        Attributes account for what was assumed, completed and left out (`add_accounts`).

    Raises
    ------
    InputError
        Where the albedo is missing or does not cover the scene, or a value is out of its range.
    """
    bands = check_bands(bands, GRASSO2013)
    droplet_number = droplet_number or DropletNumber()
    if added_heights is None:
        added_heights = completion_heights(highest_top(model))
    pressure, height, top_pressure = complete_air(model, tuple(added_heights))
    liquid = liquid_paths(model, droplet_number)
    ground, ground_source = surface_albedo(model, bands, albedo, ocean_albedo)
    position = {name: model[name].values for name in ("latitude", "longitude")}
    time = model["time"].values
    angles = find_angles(time, **position, satellite_longitude=satellite_longitude)
    no_albedo = np.uint8(QUALITY_FLAGS["no_albedo"]) * np.isnan(ground).any(axis=0)
    fields = {
        "pressure": pressure,
        "height": height,
        "liquid_mass_path": _below(liquid.mass, len(added_heights)),
        "liquid_number_path": _below(liquid.number, len(added_heights)),
        "surface_albedo": ground,
        "solar_zenith_angle": angles.solar_zenith,
        "view_zenith_angle": angles.view_zenith,
        "relative_azimuth_angle": angles.relative_azimuth,
        "quality_flag": angle_flags(angles) | no_albedo,
    }
    dataset = xr.Dataset(
        {name: (SCENARIO[name].dims, field, cf_attributes(name)) for name, field in fields.items()},
        coords={name: (SCENARIO[name].dims, x, cf_attributes(name)) for name, x in position.items()}
        | {"band": list(bands), "time": time},
    )
    for species, specification in (plumes or {}).items():
        dataset = dataset.assign(plume_variables(species, specification, bands, rows))
    check_scenario(dataset, first_row=rows.start or 0)
    weighed = condensate(model)
    for sentence in condensate_warnings(weighed):
        warnings.warn(sentence, UserWarning, stacklevel=2)
    attributes = {
        "satellite_longitude": satellite_longitude,
        "air_above_model": "US Standard Atmosphere 1976, scaled to the pressure at the model's top",
        "num_levels_above_model": len(added_heights),
        "surface_albedo_source": ground_source,
        "assumed_droplet_number": droplet_number.describe(model),
        "assumed_droplet_number_count": liquid.num_assumed,
    }
    return dataset.assign_attrs(
        model_attributes(model)
        | attributes
        | pressure_range(top_pressure)
        | condensate_account(weighed)
    )


def _below(layers: np.ndarray, num_added: int) -> np.ndarray:
    """Layers of the model under as many empty ones."""
    return np.concatenate([np.zeros((num_added, *layers.shape[1:])), layers])
