"""From a user's files to a folder with the simulated scene.

This is where readers and scenes meet: `open_scene` opens and checks everything, `simulate_scene`
writes the result and pictures of every time.
"""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from .bands import GRASSO2013
from .files import (
    ResultWriter,
    WrfSeries,
    note_files,
    noted_files,
    open_wrf_series,
    read_mcd43a1,
    read_plume,
    read_result,
)
from .nomenclature import QUALITY_FLAGS
from .optics import ALL_GASES, ash, smoke
from .pictures import grey, write_png
from .products import natural_color
from .radiance import THERMAL
from .scene import (
    CLASSES,
    DropletNumber,
    Emissivity,
    IceAlbedo,
    LandAlbedo,
    PlumeSpecification,
    check_absorption,
    check_classes,
    check_emissivity,
    check_gases,
    check_ground,
    check_ice_albedo,
    check_land_albedo,
    check_microphysics,
    check_sight,
    classes_present,
    completion_heights,
    highest_top,
    nearest_standard_atmosphere,
    negative_lines,
    row_blocks,
    run,
    scenario,
)

RESULT = "result.nc"

# Attributes of the scene that say where a quantity comes from, and what to call it.
_SOURCES = {
    "surface_albedo_source": "albedo of the ground",
    "emissivity_source": "emissivity of the ground in C07",
    "surface_temperature_source": "temperature of the ground",
}

# The same for how many columns something covers.
_COVERS = {
    "last_resort_albedo_count": "land with the albedo of last resort",
    "sea_ice_count": "ice on the sea",
    "snow_count": "snow on the ground",
}

# Brightness temperatures that are black and white in a picture. [K]
_GREYS = (320.0, 220.0)
# Atmospheric columns in memory at a time.
_BLOCK_COLUMNS = 16384


class Species(StrEnum):
    """Plumes with published optics."""

    SMOKE = "smoke"
    ASH = "ash"


class Request(NamedTuple):
    """What to simulate, from which files.

    Parameters
    ----------
    wrf
        Output of WRF, one file or more, as `files.open_wrf_series` takes them.
    albedo
        MODIS albedo, as `files.read_mcd43a1` takes it.
    ocean_albedo
        Albedo of water, in all bands. [-]
    plume
        Picture of a plume, as `files.read_plume` takes it.
    plume_species, plume_aod
        What the plume is made of; optical depth at 550 nm where the picture is white. [-]
    bands, broadband
        Bands to simulate, and whether broadband albedo may stand in for a missing one.
    emissivity
        Of the ground in C07, as `scene.scenario` takes it.
    land_albedo, sea_ice_albedo, snow_albedo
        As `scene.scenario` takes them. [-]
    gases, hydrometeors, microphysics, droplet_number
        As `scene.scenario` takes them; of hydrometeors, None means all that the model has.
    satellite, satellite_longitude
        Name; degrees, east positive, where it does not stand at its usual place.
    time
        Index or name of the times to simulate, as `files.WrfSeries.find` takes it; None for all.
    num_streams
        Streams of the solver.
    """

    wrf: Path | Sequence[Path]
    albedo: Path | None = None
    ocean_albedo: float | None = None
    plume: Path | None = None
    plume_species: Species = Species.SMOKE
    plume_aod: float = 2.0
    bands: tuple[str, ...] = GRASSO2013
    broadband: bool = False
    emissivity: Emissivity | None = None
    gases: tuple[str, ...] = ALL_GASES
    hydrometeors: tuple[str, ...] | None = None
    microphysics: str | None = None
    droplet_number: DropletNumber | None = None
    satellite: str = "GOES-16"
    satellite_longitude: float | None = None
    time: int | str | None = None
    num_streams: int = 8
    land_albedo: LandAlbedo | None = None
    sea_ice_albedo: IceAlbedo | None = None
    snow_albedo: IceAlbedo | None = None


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
    albedo, plumes
        What was read.
    chosen_times
        Indices of the times to simulate. [-]
    added_heights
        Of the levels that complete the columns. [m]
    hydrometeors
        Classes that the scene has beside cloud water.
    standard_atmosphere
        Name of that which completes the columns.
    """

    request: Request
    series: WrfSeries
    coordinates: xr.Dataset
    albedo: xr.Dataset | None
    plumes: dict[str, PlumeSpecification]
    chosen_times: tuple[int, ...]
    added_heights: tuple[float, ...]
    hydrometeors: tuple[str, ...]
    standard_atmosphere: str

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
    check_absorption(request.satellite, request.bands, check_gases(request.gases))
    check_classes(request.hydrometeors or ())
    check_microphysics(request.microphysics)
    check_ice_albedo(request.sea_ice_albedo, "sea ice")
    check_ice_albedo(request.snow_albedo, "snow")
    series = open_wrf_series(request.wrf)
    times = series.find(request.time)
    coordinates = series.coordinates(times[0])
    shape = coordinates.sizes["y"], coordinates.sizes["x"]
    plumes = {}
    if request.plume is not None:
        brightness = read_plume(request.plume, shape)
        kind = {Species.SMOKE: smoke, Species.ASH: ash}[request.plume_species]
        plume = kind(request.plume_aod, bands=request.bands)
        plumes[str(request.plume_species)] = PlumeSpecification(plume, brightness)
    solar = tuple(band for band in request.bands if band not in THERMAL)
    albedo = None
    if request.albedo is not None and solar:
        albedo = read_mcd43a1(request.albedo, solar, broadband=request.broadband)
    tops, present = [], set()
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
        )
        for rows in row_blocks(shape, _BLOCK_COLUMNS):
            model = series.read(time, rows)
            check_land_albedo(request.land_albedo, model)
            if set(request.bands) & set(THERMAL):
                check_emissivity(request.emissivity, model)
            if request.droplet_number is not None:
                request.droplet_number.over(model)
            tops.append(highest_top(model))
            present.update(classes_present(model, request.microphysics))
    return Scene(
        request,
        series,
        coordinates,
        albedo,
        plumes,
        times,
        completion_heights(max(tops)),
        tuple(x for x in CLASSES if x in present)
        if request.hydrometeors is None
        else request.hydrometeors,
        nearest_standard_atmosphere(
            coordinates["latitude"].values, coordinates["time"].values[times[0]]
        ),
    )


class Report(NamedTuple):
    """Names of the files written, and lines to print."""

    files: list[str]
    lines: list[str]


def simulate_scene(scene: Scene, folder: Path) -> Report:
    """Write the result and a picture of every time."""
    request = scene.request
    specify = partial(
        scenario,
        albedo=scene.albedo,
        ocean_albedo=request.ocean_albedo,
        land_albedo=request.land_albedo,
        sea_ice_albedo=request.sea_ice_albedo,
        snow_albedo=request.snow_albedo,
        emissivity=request.emissivity,
        plumes=scene.plumes,
        satellite=request.satellite,
        satellite_longitude=request.satellite_longitude,
        bands=request.bands,
        gases=request.gases,
        hydrometeors=scene.hydrometeors,
        microphysics=request.microphysics,
        droplet_number=request.droplet_number,
        standard_atmosphere=scene.standard_atmosphere,
        added_heights=scene.added_heights,
    )

    def read_block(time: int, rows: slice) -> xr.Dataset:
        return specify(scene.series.read(scene.chosen_times[time], rows), rows=rows)

    with ResultWriter(
        folder / RESULT,
        times=scene.times,
        shape=scene.shape,
        moving=bool(scene.coordinates.attrs["moving_nest"]),
    ) as writer:
        account = run(
            read_block,
            scene.times,
            scene.shape,
            writer.write,
            num_streams=request.num_streams,
            block_columns=_BLOCK_COLUMNS,
        )
        wrf = dict.fromkeys(scene.series.places[time][0].name for time in scene.chosen_times)
        account["wrf_file"] = "; ".join(wrf)
        files = {"albedo": request.albedo, "plume": request.plume}
        account |= {f"{kind}_file": path.name for kind, path in files.items() if path is not None}
        writer.add_attributes(account)
    with read_result(folder / RESULT) as result:
        pictures = _draw(result, folder)
        report = Report([RESULT, *pictures], [*_flag_lines(result), *_account_lines(account)])
    note_files(folder / RESULT, pictures)
    return report


def pictures_of_before(folder: Path) -> list[str]:
    """Names of the pictures of the result that is in a folder, which another will replace."""
    return noted_files(folder / RESULT)


def _draw(result: xr.Dataset, folder: Path) -> list[str]:
    """Draw every time in natural colours and in C07, where the bands for it were simulated."""
    colours = ("C01", "C02", "C03")
    coloured = set(colours) <= set(result["band"].values.tolist())
    warm = "brightness_temperature" in result
    if not (coloured or warm):
        warnings.warn(
            f"no pictures were drawn: they need {', '.join(colours)}, or C07.", stacklevel=2
        )
    names = []
    for time in result["time"].values:
        image = result.sel(time=time)
        stamp = np.datetime_as_string(time, unit="s").replace(":", "")
        if coloured:
            brf = {band: image["brf"].sel(band=band).values for band in colours}
            names.append(f"natural_color_{stamp}.png")
            write_png(folder / names[-1], np.asarray(natural_color(brf)))
        if warm:
            names.append(f"C07_{stamp}.png")
            write_png(folder / names[-1], grey(image["brightness_temperature"].values, *_GREYS))
    return names


def _flag_lines(result: xr.Dataset) -> Iterator[str]:
    """How many pixels of all times carry which flag."""
    flags = result["quality_flag"].values
    counts = {name: np.count_nonzero(flags & bit) for name, bit in QUALITY_FLAGS.items()}
    flagged = ", ".join(f"{name} {count}" for name, count in counts.items() if count)
    yield f"{flags.size} pixels; flagged: {flagged or 'none'}"


def _account_lines(account: Mapping[str, str | int | float]) -> Iterator[str]:
    """What was assumed and left out."""
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
    for name in CLASSES:
        if f"assumed_{name}_number_count" in account:
            yield f"number of {name}, assumed: as the microphysics {account['microphysics']} does"
    for name, words in _SOURCES.items():
        if name in account:
            yield f"{words}: {account[name]}"
    for name, words in _COVERS.items():
        if name in account:
            yield f"{words}: {account[name]} columns"
    if account["unsimulated_condensate_share"]:
        share = 100 * float(account["unsimulated_condensate_share"])
        kinds = str(account["unsimulated_condensate"]).replace("; ", ", ")
        yield f"{share:.2g} % of the condensate's mass: not simulated ({kinds})"
    yield from negative_lines(account)
