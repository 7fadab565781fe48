"""From a user's files to a folder with the simulated scene.

This is where readers and scenes meet: `open_scene` opens and checks everything, `simulate_scene`
writes the result and a picture of every time.
"""

import warnings
from collections.abc import Iterator, Mapping
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from .bands import GRASSO2013
from .files import (
    ResultWriter,
    read_mcd43a1,
    read_plume,
    read_result,
    read_wrf,
    wrf_coordinates,
)
from .nomenclature import QUALITY_FLAGS
from .optics import ash, smoke
from .pictures import write_png
from .products import natural_color
from .scene import (
    GOES_EAST,
    PlumeSpecification,
    check_ground,
    completion_heights,
    highest_top,
    row_blocks,
    run,
    scenario,
)

RESULT = "result.nc"

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
        Output of WRF, with one time or more.
    albedo
        MODIS albedo, as `files.read_mcd43a1` takes it.
    ocean_albedo
        Albedo of water, in all bands. [-]
    plume
        Picture of a plume, as `files.read_plume` takes it.
    plume_species, plume_aod
        What the plume is made of; optical depth at 550 nm where the picture is white. [-]
    satellite_longitude
        Degrees, east positive.
    bands, broadband
        Bands to simulate, and whether broadband albedo may stand in for a missing one.
    num_streams
        Streams of the solver.
    """

    wrf: Path
    albedo: Path | None = None
    ocean_albedo: float | None = None
    plume: Path | None = None
    plume_species: Species = Species.SMOKE
    plume_aod: float = 2.0
    satellite_longitude: float = GOES_EAST
    bands: tuple[str, ...] = GRASSO2013
    broadband: bool = False
    num_streams: int = 8


class Scene(NamedTuple):
    """A request whose files have been opened and checked.

    Parameters
    ----------
    request
        What was asked for.
    coordinates
        As `files.wrf_coordinates` returns.
    albedo, plumes
        What was read.
    added_heights
        Of the levels that complete the columns. [m]
    """

    request: Request
    coordinates: xr.Dataset
    albedo: xr.Dataset | None
    plumes: dict[str, PlumeSpecification]
    added_heights: tuple[float, ...]

    @property
    def times(self) -> np.ndarray:
        """Times of the model output."""
        return self.coordinates["time"].values

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns. [-]"""
        return self.coordinates.sizes["y"], self.coordinates.sizes["x"]


def open_scene(request: Request) -> Scene:
    """Open and check all that a request names; whatever is wrong is an `InputError`."""
    coordinates = wrf_coordinates(request.wrf)
    shape = coordinates.sizes["y"], coordinates.sizes["x"]
    plumes = {}
    if request.plume is not None:
        brightness = read_plume(request.plume, shape)
        kind = {Species.SMOKE: smoke, Species.ASH: ash}[request.plume_species]
        plume = kind(request.plume_aod, bands=request.bands)
        plumes[str(request.plume_species)] = PlumeSpecification(plume, brightness)
    albedo = None
    if request.albedo is not None:
        albedo = read_mcd43a1(request.albedo, request.bands, broadband=request.broadband)
    tops = []
    for time in range(coordinates.sizes["time"]):
        check_ground(wrf_coordinates(request.wrf, time), albedo, request.ocean_albedo)
        for rows in row_blocks(shape, _BLOCK_COLUMNS):
            tops.append(highest_top(read_wrf(request.wrf, time, rows)))
    return Scene(request, coordinates, albedo, plumes, completion_heights(max(tops)))


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
        plumes=scene.plumes,
        satellite_longitude=request.satellite_longitude,
        bands=request.bands,
        added_heights=scene.added_heights,
    )
    with ResultWriter(
        folder / RESULT,
        times=scene.times,
        shape=scene.shape,
        moving=bool(scene.coordinates.attrs["moving_nest"]),
    ) as writer:
        account = run(
            lambda time, rows: specify(read_wrf(request.wrf, time, rows), rows=rows),
            scene.times,
            scene.shape,
            writer.write,
            num_streams=request.num_streams,
            block_columns=_BLOCK_COLUMNS,
        )
        files = {"wrf": request.wrf, "albedo": request.albedo, "plume": request.plume}
        account |= {f"{kind}_file": path.name for kind, path in files.items() if path is not None}
        writer.add_attributes(account)
    with read_result(folder / RESULT) as result:
        pictures = _draw(result, folder)
        return Report([RESULT, *pictures], [*_flag_lines(result), *_account_lines(account)])


def _draw(result: xr.Dataset, folder: Path) -> list[str]:
    """Draw every time in natural colours, where the bands for it were simulated."""
    colours = ("C01", "C02", "C03")
    if not set(colours) <= set(result["band"].values.tolist()):
        warnings.warn(f"no pictures were drawn: they need {', '.join(colours)}.", stacklevel=2)
        return []
    names = []
    for time in result["time"].values:
        brf = result["brf"].sel(time=time)
        rgb = natural_color({band: brf.sel(band=band).values for band in colours})
        stamp = np.datetime_as_string(time, unit="s").replace(":", "")
        names.append(f"natural_color_{stamp}.png")
        write_png(folder / names[-1], np.asarray(rgb))
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
        yield f"droplet number, assumed: {account['assumed_droplet_number']}"
    kinds = str(account.get("unsimulated_condensate")).replace("; ", ", ")
    for name, fate in (
        ("unsimulated_condensate_share", f"not simulated ({kinds})"),
        ("ice_as_droplets_share", "ice, simulated as droplets"),
    ):
        if account[name]:
            yield f"{100 * float(account[name]):.2g} % of the condensate's mass: {fate}"
