"""A small file of every format that is read, as what writes it does; damaged copies are of these.

All lie in one folder: a retrieval is scored against ``result.nc`` beside it, and what was observed
is laid on its grid.
"""

import netCDF4
import numpy as np
import xarray as xr

from abi_operator.demo import write_demo
from abi_operator.files import Parts, ResultWriter, read_result
from abi_operator.files.abandoned import PARTS
from abi_operator.guard.baseline import Baseline, history_line, write_baseline
from abi_operator.guard.evaluation import Jacobians, Request
from abi_operator.guard.outputs import Outputs
from abi_operator.nomenclature import SCENARIO
from retrievals.product import Field, make_product
from retrievals.tuning.fixed_grid import scan_angles

PRIOR = "# what is known\n[aod_550]\nmean = 0.5\nsigma = 0.3\n"
FIRES = """latitude,longitude,temperature,area,start,end
33.10,-116.90,900,2.5e4,2007-10-23T18:00,2007-10-24T03:00
33.25,-116.75,1100,1e4,,
"""
SIZES = {"band": 2, "layer": 3, "level": 4, "y": 4, "x": 3}
TIMES = np.array(["2007-10-23T18:00:00"], "datetime64[ns]")
RESULT = "result.nc"
BOUNDS = tuple(f"aod_550_{side}_{share}" for share in (68, 95) for side in ("lower", "upper"))
PROJECTION = {
    "semi_major_axis": 6378137.0,
    "semi_minor_axis": 6356752.31414,
    "perspective_point_height": 35786023.0,
    "longitude_of_projection_origin": -105.0,
    "sweep_angle_axis": "x",
}


def write_originals(folder):
    """Path of the file of each format, by its name in `hostile.READERS`."""
    demo = write_demo(folder, size=8)
    found = {"wrf": demo.wrf, "mcd43": demo.albedo, "plume": demo.plume}
    for kind, name, text in (("prior", "prior.toml", PRIOR), ("fires", "fires.csv", FIRES)):
        found[kind] = folder / name
        found[kind].write_text(text)
    found["result"] = folder / RESULT
    write_result(found["result"])
    with read_result(found["result"]) as result:
        image = result.load()
    for kind, write in (
        ("observed", write_named),
        ("radiance", write_radiance),
        ("imagery", write_imagery),
        ("retrieval", write_retrieval),
    ):
        found[kind] = folder / f"{kind}.nc"
        write(found[kind], image)
    found["baseline"] = folder / "baseline.nc"
    write_small_baseline(found["baseline"])
    found["part"] = write_part(folder)
    return found


def write_result(path):
    """A result with all that a scenario has, a plume's depth and light."""
    rng = np.random.default_rng(7)

    def values(*dims):
        return dims, rng.uniform(size=[SIZES[dim] for dim in dims])

    y, x = np.meshgrid(np.arange(SIZES["y"]), np.arange(SIZES["x"]), indexing="ij")
    position = {
        "latitude": (("y", "x"), 33 + 0.036 * y),
        "longitude": (("y", "x"), 0.043 * x - 117),
    }
    fields = {name: values(*v.dims) for name, v in SCENARIO.items() if name not in position}
    fields["quality_flag"] = ("y", "x"), rng.integers(0, 32, (4, 3))
    fields |= {name: values("band", "y", "x") for name in ("reflectance_factor", "brf")}
    fields["smoke_aod_550"] = values("y", "x")
    scene = xr.Dataset(fields, {"band": ["C01", "C02"], "time": TIMES[0], **position})
    attributes = {"bands": "C01 C02"}
    with ResultWriter(path, times=TIMES, shape=(4, 3), attributes=attributes) as writer:
        writer.write(0, slice(0, 4), scene)


def write_named(path, image):
    """Variables of two bands with latitude and longitude."""
    factor = image["reflectance_factor"].values[0]
    fields = {f"C0{k + 1}": (("lat", "lon"), factor[k], {"units": "1"}) for k in range(2)}
    fields |= {name: (("lat", "lon"), image[name].values) for name in ("latitude", "longitude")}
    xr.Dataset(fields, attrs={"time_coverage_start": "2007-10-23T18:01:17.2Z"}).to_netcdf(path)


def write_radiance(path, image):
    """An ABI file of the radiance of one band, on a grid of scan angles around the scene."""
    radiance = {"Rad": (("y", "x"), np.linspace(5.0, 300.0, 144).reshape(12, 12), _RADIANCE)}
    constants = {"esun": ((), 2017.18), "earth_sun_distance_anomaly_in_AU": ((), 0.995)}
    _write_abi(path, image, radiance | constants)


def write_imagery(path, image):
    """Likewise its cloud and moisture imagery, packed as ABI's is."""
    factor = np.linspace(0.02, 1.1, 144).reshape(12, 12)
    _write_abi(path, image, {"CMI": (("y", "x"), factor, {"units": "1"})})


_RADIANCE = {"units": "W m-2 sr-1 um-1"}


def _write_abi(path, image, variables):
    angles = scan_angles(image["latitude"].values, image["longitude"].values, PROJECTION)
    x, y = (np.linspace(a.min() - 1e-5, a.max() + 1e-5, 12) for a in angles)
    variables |= {
        "DQF": (("y", "x"), np.zeros((12, 12), np.int8)),
        "band_id": (("band",), np.array([2], np.int8)),
        "goes_imager_projection": ((), np.int32(0), PROJECTION),
    }
    attributes = {"time_coverage_start": "2007-10-23T18:01:17.2Z"}
    xr.Dataset(variables, {"y": y[::-1], "x": x}, attributes).to_netcdf(path)


def write_retrieval(path, image):
    """What a retrieval of smoke makes of the result."""
    rng = np.random.default_rng(8)
    codes = rng.choice([0, 0, 0, 1, 5], (1, 4, 3)).astype(np.int8)
    attempted = codes != 1
    number = int(attempted.sum())
    fields = {
        name: Field(rng.uniform(0.1, 0.9, number), "1", name)
        for name in ("aod_550", "aod_550_sigma", *BOUNDS, "cost")
    }
    fields["ssa"] = Field(rng.uniform(0.8, 1.0, (2, number)), "1", "ssa", ("band",))
    fields["num_values"] = Field(np.full(number, 2, np.int16), "1", "measurements")
    names = ("C01", "C02"), ("aod_550",)
    about = {"bands": "C01 C02", "kind": "smoke", "num_streams": 2}
    product = make_product(image, codes, attempted, fields, names, about)
    compressed = {name: {"zlib": True, "complevel": 1} for name in product.data_vars}
    product.to_netcdf(path, encoding=compressed)


def write_small_baseline(path):
    """A baseline of two columns, as no operator computed it."""
    rng = np.random.default_rng(9)
    value, jacobian = rng.uniform(size=(2, 2)), rng.uniform(size=(2, 2, 3))
    jacobian[0, :, 2] = np.nan  # a column without that input
    state = rng.uniform(size=(2, 3))
    state[0, 2] = np.nan
    outputs = Outputs(
        ("radiance.C01", "green"),
        ("W m-2 sr-1 um-1", "1"),
        ("no column",),
        rng.uniform(size=(3, 2)),
        rng.uniform(size=(3, 2, 2)),
    )
    quantity = np.full((2, 2), "brf", object)
    names = ("dark", "bright"), ("C01", "C02"), ("albedo.C01", "albedo.C02", "geometry.view_zenith")
    settings = {"num_streams": 2, "gases": "none"}
    request = Request(("C01", "C02"), {"num_streams": 2})
    units = ("1", "1", "rad")
    of = Jacobians(*names, units, quantity, value, jacobian, state, request, settings, outputs)
    write_baseline(path, Baseline(of, "two.py:columns", {}, (history_line("saved"),)))


def write_part(folder):
    """What a run that ended early has kept."""
    (folder / PARTS).mkdir()
    rng = np.random.default_rng(10)
    arrays = {"brf": rng.uniform(size=(2, 4, 3)), "quality_flag": rng.integers(0, 32, (4, 3))}
    Parts(folder).keep("part", arrays)
    return (folder / PARTS / "part.npz").rename(folder / "part.npz")


def changed(path, copy, change):
    """A copy of a NetCDF file to which `change` was done, of the open file."""
    copy.write_bytes(path.read_bytes())
    with netCDF4.Dataset(copy, "a") as file:
        change(file)
    return copy
