"""Write the inputs of the demonstration's scene."""

from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from .air import make_air, santa_ana, with_hydrostatic_height
from .albedo_file import write_albedo
from .clouds import cloud_mixing_ratio, make_clouds, make_weather, saturate
from .fire_table import write_fires
from .grid import make_grid
from .landscape import make_landscape
from .plume_picture import make_smoke
from .wrf_file import FILE_NAME, write_wrf


class DemoInputs(NamedTuple):
    """The files of a demonstration: model output, MODIS albedo, a picture of the smoke and a table
    of the fires that it comes from.
    """

    wrf: Path
    albedo: Path
    plume: Path
    fires: Path


def write_demo(folder: str | PathLike[str], *, size: int = 64, seed: int = 0) -> DemoInputs:
    """Write model output, albedo, a plume picture and fires of a smoky Californian coast.

    The scene is 256 km wide around 33.5 N 117.5 W, on 23 October 2007 at 18 UTC.

    Parameters
    ----------
    folder
        Where to write, made if need be.
    size
        Rows and columns of the scene, 8 or more. [-]
    seed
        Another seed is another coast with other clouds and other smoke. [-]
    """
    if size < 8:
        raise ValueError(f"a demonstration has 8 rows and columns or more; got {size=}.")
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    names = FILE_NAME, "albedo.nc", "plume.png", "fires.csv"
    paths = DemoInputs(*(folder / name for name in names))
    land_rng, cloud_rng, smoke_rng = np.random.default_rng(seed).spawn(3)
    landscape = make_landscape(land_rng)
    grid = make_grid(size)
    distance = landscape.coast_distance(grid.east, grid.north)
    terrain = landscape.terrain(grid.east, grid.north, distance)
    marine = 1 / (1 + np.exp(np.clip(distance / 8e3, -50, 50)))
    clear = make_air(terrain, marine)
    clouds = make_clouds(make_weather(cloud_rng), grid, distance, terrain)
    cloud_water = cloud_mixing_ratio(clouds, clear)
    air = with_hydrostatic_height(saturate(clear, cloud_water), terrain, cloud_water)
    write_wrf(paths.wrf, grid, air, cloud_water, terrain, distance > 0, santa_ana(marine))
    write_albedo(paths.albedo, landscape, grid.spacing)
    smoke = make_smoke(smoke_rng, grid)
    picture = np.flipud(np.rint(255 * smoke.brightness).astype(np.uint8))
    Image.fromarray(picture).save(paths.plume)
    write_fires(paths.fires, smoke)
    return paths
