"""From a user's files to a folder with the simulated scene.

This is where readers and scenes meet: `open_scene` opens and checks everything, `simulate_scene`
writes the result and pictures of every time.
"""

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from .drawing import Painter
from .files import (
    InputError,
    Parts,
    ResultWriter,
    WrfSeries,
    check_variables,
    note_files,
    noted_files,
    open_wrf_series,
    projected,
    read_fires,
    read_mcd43a1,
    read_plume,
    read_result,
    rounded,
    stored,
)
from .files.stored import ALL, IMAGE
from .nomenclature import OPTIONAL_RESULT
from .optics import ash, smoke
from .radiance import THERMAL
from .report import account_lines, flag_lines, plume_lines
from .request import PLUME_AOD, check_effects
from .request import Request as Request
from .request import Species as Species
from .scene import (
    CLASSES,
    PlumeSpecification,
    check_absorption,
    check_aod_550,
    check_background_aerosol,
    check_classes,
    check_cloud_optics,
    check_emissivity,
    check_fires,
    check_gases,
    check_ground,
    check_ice_albedo,
    check_ice_optics,
    check_land_albedo,
    check_microphysics,
    check_ocean_wind,
    check_sight,
    classes_present,
    completion_heights,
    fires_inside,
    has_hot_ground,
    highest_top,
    nearest_standard_atmosphere,
    row_blocks,
    run,
    scenario,
    variables_of_result,
)

RESULT = "result.nc"

# Atmospheric columns in memory at a time.
_BLOCK_COLUMNS = 16384


class Scene(NamedTuple):
    """A request whose files have been opened and checked.

    Parameters
    ----------
    request
        What was asked for.
    series
        As `files.open_wrf_series` returns.
    coordinates
        As `files.wrf_coordinates` returns, of all times and the place of the first one simulated.
    albedo, plumes, fires
        What was read.
    chosen_times
        Indices of the times to simulate. [-]
    added_heights
        Of the levels that complete the columns. [m]
    hydrometeors
        Classes that the scene has beside cloud water.
    standard_atmosphere
        Name of that which completes the columns.
    hot_ground
        Whether the ground shines in C05 and C06 without a fire, somewhere and at some time.
    """

    request: Request
    series: WrfSeries
    coordinates: xr.Dataset
    albedo: xr.Dataset | None
    plumes: dict[str, PlumeSpecification]
    fires: xr.Dataset | None
    chosen_times: tuple[int, ...]
    added_heights: tuple[float, ...]
    hydrometeors: tuple[str, ...]
    standard_atmosphere: str
    hot_ground: bool

    @property
    def times(self) -> np.ndarray:
        """Times to simulate."""
        return self.coordinates["time"].values[list(self.chosen_times)]

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns. [-]"""
        return self.coordinates.sizes["y"], self.coordinates.sizes["x"]


def open_scene(request: Request) -> Scene:
    """Open and check all that a request names; whatever is wrong is an `InputError`."""
    _check_request(request)
    series = open_wrf_series(request.wrf)
    times = series.find(request.time)
    coordinates = series.coordinates(times[0])
    shape = coordinates.sizes["y"], coordinates.sizes["x"]
    plumes = _plumes(request, shape)
    albedo = _albedo(request, series.times[list(times)])
    fires = None if request.fires is None else read_fires(request.fires)
    inside = None
    tops, present, hot_ground = [], set(), False
    with series.opened() as read:
        for time in times:
            place = series.coordinates(time)
            check_sight(place, request.satellite, request.satellite_longitude)
            check_ground(
                place,
                request.bands,
                albedo,
                request.ocean_albedo,
                request.emissivity,
                request.land_albedo,
                request.ocean_wind,
            )
            if fires is not None:
                found = fires_inside(fires, place)
                inside = found if inside is None else inside | found
            for rows in row_blocks(shape, _BLOCK_COLUMNS):
                model = read(time, rows)
                check_land_albedo(request.land_albedo, model)
                if request.ocean_wind is not None:
                    check_ocean_wind(request.ocean_wind, model)
                if set(request.bands) & set(THERMAL):
                    check_emissivity(request.emissivity, model)
                if request.droplet_number is not None:
                    request.droplet_number.over(model)
                tops.append(highest_top(model))
                hot_ground = hot_ground or has_hot_ground(model)
                present.update(classes_present(model, request.microphysics))
    if inside is not None:
        check_fires(inside, request.bands)
    scene = Scene(
        request,
        series,
        coordinates,
        albedo,
        plumes,
        fires,
        times,
        completion_heights(max(tops)),
        tuple(x for x in CLASSES if x in present)
        if request.hydrometeors is None
        else request.hydrometeors,
        nearest_standard_atmosphere(
            coordinates["latitude"].values, coordinates["time"].values[times[0]]
        ),
        hot_ground,
    )
    if not {*request.variables} <= {ALL, IMAGE}:
        check_variables(request.variables, _variables_of(scene))
    return scene


def _check_request(request: Request) -> None:
    """Raise `InputError` for whatever is wrong with a request before any file is opened."""
    check_absorption(request.satellite, request.bands, check_gases(request.gases))
    check_classes(request.hydrometeors or ())
    check_microphysics(request.microphysics)
    check_cloud_optics(request.cloud_optics)
    check_ice_optics(request.ice_optics)
    check_background_aerosol(request.background_aerosol)
    if request.plume_aod is not None:
        check_aod_550(request.plume_aod, "the plume")
    check_ice_albedo(request.sea_ice_albedo, "sea ice")
    check_ice_albedo(request.snow_albedo, "snow")
    check_effects(request)
    _check_variables(request)


def _plumes(request: Request, shape: tuple[int, int]) -> dict[str, PlumeSpecification]:
    """The plume of which a picture is given, by its species."""
    if request.plume is None:
        return {}
    brightness = read_plume(request.plume, shape)
    species = request.plume_species or Species.SMOKE
    aod = PLUME_AOD if request.plume_aod is None else request.plume_aod
    plume = {Species.SMOKE: smoke, Species.ASH: ash}[species](aod, bands=request.bands)
    return {str(species): PlumeSpecification(plume, brightness)}


def _albedo(request: Request, times: np.ndarray) -> xr.Dataset | None:
    """What the albedo file has for these times, if there is one."""
    if request.albedo is None:
        return None
    return read_mcd43a1(
        request.albedo,
        tuple(band for band in request.bands if band not in THERMAL),
        broadband=request.broadband,
        kernels=request.land_kernels,
        times=times,
    )


def _check_variables(request: Request) -> None:
    check_variables(request.variables)
    if set(request.variables) & set(OPTIONAL_RESULT) and not set(request.bands) & set(THERMAL):
        raise InputError(
            f"{', '.join(OPTIONAL_RESULT)} is of {', '.join(THERMAL)}; simulate it, or leave the "
            "variable out."
        )


def _specified(scene: Scene) -> Callable[..., xr.Dataset]:
    """`scene.scenario` of this scene, of a model Dataset and the `rows` that it holds."""
    request = scene.request
    return partial(
        scenario,
        albedo=scene.albedo,
        ocean_albedo=request.ocean_albedo,
        ocean_wind=request.ocean_wind,
        land_albedo=request.land_albedo,
        sea_ice_albedo=request.sea_ice_albedo,
        snow_albedo=request.snow_albedo,
        emissivity=request.emissivity,
        plumes=scene.plumes,
        fires=scene.fires,
        hot_ground=scene.hot_ground,
        satellite=request.satellite,
        satellite_longitude=request.satellite_longitude,
        bands=request.bands,
        gases=request.gases,
        hydrometeors=scene.hydrometeors,
        microphysics=request.microphysics,
        droplet_number=request.droplet_number,
        cloud_optics=request.cloud_optics,
        ice_optics=request.ice_optics,
        flat_sun=request.flat_sun,
        background_aerosol=request.background_aerosol,
        standard_atmosphere=scene.standard_atmosphere,
        added_heights=scene.added_heights,
    )


def _variables_of(scene: Scene) -> set[str]:
    """Names of the variables that the result will have, of which the first row has all."""
    row = slice(0, 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what there is to be said the simulation says
        model = scene.series.read(scene.chosen_times[0], row)
        return variables_of_result(_specified(scene)(model, rows=row))


class Report(NamedTuple):
    """Names of the files written, and lines to print."""

    files: list[str]
    lines: list[str]


def simulate_scene(scene: Scene, folder: Path) -> Report:
    """Write the result and a picture of every time.

    What an earlier run has kept of the same scene in the folder, `output_folder` having found it
    there, is not computed again.
    """
    request, specify = scene.request, _specified(scene)

    moving = bool(scene.coordinates.attrs["moving_nest"]) and len(scene.times) > 1
    painter = Painter(
        folder, scene.times, scene.shape[0], rayleigh_correction=request.rayleigh_correction
    )
    parts = Parts(folder)
    with (
        scene.series.opened() as read,
        ResultWriter(
            folder / RESULT,
            times=scene.times,
            shape=scene.shape,
            moving=moving,
            grid=None if moving else projected(scene.coordinates),
            command=request.command,
        ) as writer,
    ):

        def read_block(time: int, rows: slice) -> xr.Dataset:
            return rounded(specify(read(scene.chosen_times[time], rows), rows=rows))

        def write_block(time: int, rows: slice, result: xr.Dataset) -> None:
            writer.write(time, rows, stored(result, request.variables))
            painter.add(time, rows, result)

        account = run(
            read_block,
            scene.times,
            scene.shape,
            write_block,
            num_streams=request.num_streams,
            error_budget=request.error_budget,
            block_columns=_BLOCK_COLUMNS,
            parts=parts,
        )
        wrf = dict.fromkeys(scene.series.places[time][0].name for time in scene.chosen_times)
        account["wrf_file"] = "; ".join(wrf)
        files = {"albedo": request.albedo, "plume": request.plume, "fires": request.fires}
        account |= {f"{kind}_file": path.name for kind, path in files.items() if path is not None}
        writer.add_attributes(account)
    with read_result(folder / RESULT) as result:
        lines = [*flag_lines(result), *plume_lines(scene.plumes), *account_lines(account)]
    if parts.num_found:
        lines.append(f"simulated before, by a run that had ended early: {parts.num_found} blocks")
    note_files(folder / RESULT, painter.names)
    return Report([RESULT, *painter.names], lines)


def pictures_of_before(folder: Path) -> list[str]:
    """Names of the pictures of the result that is in a folder, which another will replace."""
    return noted_files(folder / RESULT)
