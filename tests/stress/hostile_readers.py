"""What is read of each format, number by number, beside what the numbers may be.

A reader is all that the commands do with a file before they compute. It yields what it has read as
`Read`, so that a copy which is read is known to hold nothing that no file of its kind can hold.
"""

import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np

from abi_operator.files import (
    InputError,
    Parts,
    noted_files,
    open_wrf_series,
    read_fires,
    read_mcd43a1,
    read_plume,
    read_result,
    read_white_sky,
    read_wrf,
    reading,
    wrf_coordinates,
)
from abi_operator.files.abandoned import PARTS
from abi_operator.files.plausible import plausible
from abi_operator.guard.baseline import read_baseline
from abi_operator.guard.comparison import compare
from abi_operator.ranges import FINITE, SHARE, Range
from retrievals import declarations
from retrievals.prior_file import read_prior
from retrievals.product_file import read_retrieval
from retrievals.scoring import format_report, score_retrieval
from retrievals.tuning import read_observed


class Read(NamedTuple):
    """Numbers that were read, their range, and whether some may be missing, as NaN or NaT."""

    name: str
    values: np.ndarray
    allowed: Range = FINITE
    missing: bool = False

    @property
    def nonsense(self):
        """The first number that is none of these, in words; empty where there is none."""
        values = np.asarray(self.values)
        if values.dtype.kind in "mM":
            values = np.where(np.isnat(values), np.nan, values.astype(np.int64).astype(float))
        fine = self.allowed.holds(values) | (self.missing & np.isnan(values))
        return "" if fine.all() else f"{self.name} is {values[~fine].flat[0]}"


def read_model(path):
    place, block = wrf_coordinates(path), read_wrf(path, 0)
    yield Read("time", open_wrf_series(path).times)
    for dataset in (place, block):
        for name, array in dataset.variables.items():
            low, high, _ = plausible(str(name))
            slack = 1e-6 * (high - low) if np.isfinite(high - low) else 0.0
            yield Read(str(name), array.values, Range(low - slack, high + slack))


def read_albedo(path):
    albedo = read_mcd43a1(path, ("C01", "C02"), kernels=True)
    yield Read("surface_albedo", albedo["surface_albedo"].values, SHARE, missing=True)
    of_modis = read_white_sky(path, ("Band1", "Band2"))
    yield Read("white_sky_albedo", of_modis["white_sky_albedo"].values, missing=True)
    for name in ("volume_kernel_weight", "geometric_kernel_weight"):
        yield Read(name, albedo[name].values, Range(-40.0, 40.0), missing=True)
    for dataset in (albedo, of_modis):
        if "albedo_quality" in dataset:  # files need not have it
            quality = dataset["albedo_quality"].values
            yield Read("albedo_quality", np.isin(quality, (0, 1, 255)), Range(1, 1))
        yield Read("lat", dataset["lat"].values, Range(-90, 90))


def read_picture(path):
    yield Read("brightness", read_plume(path, (8, 8)), SHARE)


def read_table(path):
    fires = read_fires(path)
    yield Read("latitude", fires["latitude"].values, Range(-90, 90))
    yield Read("area", fires["area"].values, Range(0, 1e10, "(]"))
    for name in ("start", "end"):
        yield Read(name, fires[name].values, missing=True)


def read_whole_result(path):
    """As commands do, which wait with reading until they need something."""
    folder = Path(path).resolve().parent
    for name in noted_files(path):
        assert (folder / name).resolve().parent == folder
    with reading(str(path)), read_result(path) as result:
        result.load()
    yield from read_light(path)


def read_light(path):
    """What was observed, laid on the scene beside it."""
    with read_result(Path(path).with_name("result.nc")) as scene:
        with reading(str(path)):
            seen = read_observed([path], scene.isel(time=0))
    factor = seen["reflectance_factor"].values
    yield Read("reflectance_factor", factor, Range(-0.1, 2), missing=True)
    yield Read("saturated", seen["saturated"].values, SHARE)


def read_known(path):
    known = read_prior(str(path), declarations.plume("smoke"))
    for quantity in known.quantities:
        if quantity.sigma_in_units:  # of the file
            yield Read("mean", np.array(quantity.mean), Range(0, 10))
            yield Read("sigma", np.array(quantity.sigma), Range(0, np.inf, "()"))


def read_retrieved(path):
    """As it is scored, against the result beside it."""
    retrieval = read_retrieval(path)
    with read_result(Path(path).with_name("result.nc")) as truth:
        format_report(score_retrieval(truth, retrieval))
    success = retrieval["result_code"].values == 0
    for name, high in (("aod_550", 20.0), ("aod_550_sigma", np.inf)):
        if name in retrieval:  # of an error it is only known that it is one
            yield Read(name, retrieval[name].values[success], Range(0, high, "[)"))


def read_guarded(path):
    """As it is compared with what is computed now."""
    stored = read_baseline(path).jacobians
    now = read_baseline(Path(path).with_name("baseline.nc")).jacobians
    bool(compare(stored, now))
    for name in ("value", "jacobian", "state"):
        yield Read(name, getattr(stored, name), missing=True)


def read_kept(path):
    """A part that cannot be read is computed again."""
    folder = Path(path).parent
    copy = folder / PARTS / Path(path).with_suffix(".npz").name
    shutil.copy(path, copy)
    try:
        found = Parts(folder).find(copy.stem)
    finally:
        copy.unlink()
    if found is None:
        raise InputError("not found")
    shutil.copy(folder / "part.npz", copy)
    kept = Parts(folder).find(copy.stem)
    copy.unlink()
    same = found.keys() == kept.keys() and all((found[x] == kept[x]).all() for x in kept)
    yield Read("part", np.array(same), Range(1, 1))


READERS = {
    "wrf": read_model,
    "mcd43": read_albedo,
    "plume": read_picture,
    "result": read_whole_result,
    "prior": read_known,
    "fires": read_table,
    "observed": read_light,
    "radiance": read_light,
    "imagery": read_light,
    "retrieval": read_retrieved,
    "baseline": read_guarded,
    "part": read_kept,
}
NETCDF = ("wrf", "mcd43", "result", "observed", "radiance", "imagery", "retrieval", "baseline")
