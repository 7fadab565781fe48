"""A plume tuned to its own image: what its stated errors are worth, and whether a misfit is told.

    python benchmarks/tuning.py [--size 32] [--seeds 100] [--wrong-seeds 5] [--only NAMES]

The scene is the demonstration's, simulated whole at 8 streams; of each seed, the world is the same
with another plume: strength exp(0.3 n), the logit of the single-scattering albedo shifted by 0.4 n,
height of its middle 1,500 to 5,000 m (n normal). The world is simulated (`scene.simulate`), seen by
the imager (`scene.observed`, with its noise) and tuned to as ``abi-operator tune`` does, which
begins at the scene's plume. Names are paper (C01 C02 C03 C06 without gases), cirrus (C04 as well,
with gases), calibration (each band's gain wrong by 3 %, and unknown to the fit) and wrong.

- coverage: of each number, the share of fits whose error is within one and two stated standard
  deviations (0.683 and 0.954 where these are right), mean and root mean square of error over
  standard deviation (0 and 1), the stated one, its root mean square, and fits of a told misfit.
- wrong: worlds that the model is not of, and one that it is of. Printed are fits of which the
  misfit was told, the reduced chi-square beside what noise has, and the largest errors of the
  numbers in stated standard deviations: what would have been believed.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator import MiePlume, brf
from abi_operator.demo import write_demo
from abi_operator.files import read_result
from abi_operator.instrument import Imager
from abi_operator.machine.speed import use_compilation_cache, use_compiler_flags
from abi_operator.optics import ALL_GASES
from abi_operator.scene import column_states, observed, simulate
from abi_operator.simulation import Request, open_scene, simulate_scene
from retrievals.tuning import Errors, tuned

PAPER, CIRRUS = ("C01", "C02", "C03", "C06"), ("C01", "C02", "C03", "C04", "C06")
NUMBERS = ("strength", "ssa", "height")
THICKNESS = 2000.0  # of the demonstration's smoke [m]
WHOLE: dict[str, Any] = {"num_streams": 8, "error_budget": None}  # as the demonstration is solved


def scene_of(size, bands, gases):
    """The demonstration's scene, simulated whole."""
    with tempfile.TemporaryDirectory() as folder:
        inputs = write_demo(Path(folder) / "inputs", size=size)
        request = Request(
            inputs.wrf, inputs.albedo, 0.03, inputs.plume, bands=bands, gases=gases
        )._replace(**WHOLE)
        simulate_scene(open_scene(request), Path(folder))
        with read_result(Path(folder) / "result.nc") as result:
            return result.isel(time=0).load()


def world_of(image, strength, shift, height):
    """The scene's image with another plume."""
    ssa = image["smoke_ssa"]
    changes = {
        "smoke_extinction_550": image["smoke_extinction_550"] * strength,
        "smoke_ssa": 1 / (1 + (1 - ssa) / ssa * np.exp(-shift)),
        "smoke_base": xr.zeros_like(image["smoke_base"]) + height - THICKNESS / 2,
        "smoke_top": xr.zeros_like(image["smoke_top"]) + height + THICKNESS / 2,
    }
    return simulate(image.assign(changes), **WHOLE)


def plume_of(rng):
    """A plume's numbers, as `NUMBERS` are fitted."""
    return np.exp(0.3 * rng.standard_normal()), 0.4 * rng.standard_normal(), rng.uniform(1.5e3, 5e3)


def seen(world, seed, calibration=False):
    """What the imager reports of a world, as `read_observed` has it."""
    report = observed(world, Imager(), seed=seed, calibration=calibration)
    kept = report[["reflectance_factor", "saturated"]].reset_coords(drop=True)
    names = {"observed_files": "", "observed_variables": "", "regridding": "none"}
    return kept.drop_attrs().assign_attrs(names)


def coverage(name, size, num_seeds):
    bands, gases = (CIRRUS, ALL_GASES) if name == "cirrus" else (PAPER, ())
    image = scene_of(size, bands, gases)
    errors = Errors(calibration=name == "calibration")
    pulls, sigmas, missed, told = [], [], [], 0
    for seed in range(num_seeds):
        truth = np.array(plume_of(np.random.default_rng(seed)))
        found = tuned(
            image,
            seen(world_of(image, *truth), seed, errors.calibration),
            NUMBERS,
            errors=errors,
        )
        value, sigma = (found[x].values[: len(NUMBERS)] for x in ("value", "sigma"))
        pulls.append((value - truth) / sigma)
        sigmas.append(sigma)
        missed.append(value - truth)
        told += found.attrs["misfit_found"]
    pulls, sigmas, missed = np.array(pulls), np.array(sigmas), np.array(missed)
    count = int(found.attrs["num_measurements"])
    print(
        f"\n{name}: {num_seeds} fits of {count} measurements in {', '.join(bands)}; "
        f"misfit told in {told}\n"
    )
    print("| number | within 1 sigma | within 2 | mean | rms | stated sigma | rms error |")
    print(f"|{' --- |' * 7}")
    for k, number in enumerate(NUMBERS):
        shares = [f"{np.mean(np.abs(pulls[:, k]) <= width):.3f}" for width in (1, 2)]
        moments = [f"{pulls[:, k].mean():+.2f}", f"{np.sqrt(np.mean(pulls[:, k] ** 2)):.2f}"]
        sizes = [f"{x:.3g}" for x in (sigmas[:, k].mean(), np.sqrt(np.mean(missed[:, k] ** 2)))]
        print(f"| {number} | {' | '.join([*shares, *moments, *sizes])} |", flush=True)


def mie_world(image, radius):
    """The scene's image with smoke of spheres, of the same optical depth."""
    bands = PAPER
    states = column_states(image, bands)
    own = states.atmosphere.plumes["smoke"]
    radii = jnp.full(np.shape(own.base), radius)
    spheres = MiePlume(own.base, own.top, own.extinction_550, own.brightness, radii, "smoke")
    air = replace(states.atmosphere, plumes={"smoke": spheres})
    states = replace(states, atmosphere=air)
    mu0 = np.cos(np.asarray(states.geometry.solar_zenith))
    factor = np.asarray(brf(states, bands, gases=(), **WHOLE)) * mu0[:, None]
    shape = image["reflectance_factor"].shape
    values = np.moveaxis(factor.reshape(*shape[1:], len(bands)), -1, 0)
    ratio = values / image["reflectance_factor"]
    return image.assign(
        radiance=image["radiance"] * ratio, reflectance_factor=image["reflectance_factor"] * ratio
    )


def wrong(size, num_seeds):
    image = scene_of(size, PAPER, ())
    brightness = image["smoke_brightness"]
    worlds = {
        "as the model has it": world_of(image, 1.0, 0.0, 2000.0),
        "smoke of Mie spheres, 0.10 um": mie_world(image, 0.10),
        "smoke of Mie spheres, 0.20 um": mie_world(image, 0.20),
        "ground brighter by a tenth": simulate(
            image.assign(surface_albedo=1.1 * image["surface_albedo"]), **WHOLE
        ),
        "twice the droplets in clouds": simulate(
            image.assign(liquid_number_path=2 * image["liquid_number_path"]), **WHOLE
        ),
        "the picture of the plume one pixel off": simulate(
            image.assign(smoke_brightness=brightness.roll(x=1)), **WHOLE
        ),
    }
    truth = np.array([1.0, 0.0, 2000.0])
    print(f"\nwrong: {num_seeds} fits of each\n")
    heads = "| world | told | reduced chi-square | noise has | strength | ssa | height |"
    print(f"{heads} strength, ssa_shift, height found |\n|{' --- |' * 8}")
    for name, world in worlds.items():
        _row(image, name, world, num_seeds, truth)
    own = worlds["as the model has it"]
    _row(image, "gains wrong by 3 %, taken as exact", own, num_seeds, truth, calibration=True)


def _row(image, name, world, num_seeds, truth, calibration=False):
    told, chi, pulls, values = 0, [], [], []
    for seed in range(num_seeds):
        found = tuned(image, seen(world, seed, calibration), NUMBERS)
        told += found.attrs["misfit_found"]
        chi.append(found.attrs["chi_square"])
        pulls.append(np.abs(found["value"].values - truth) / found["sigma"].values)
        values.append(found["value"].values)
    largest = " | ".join(f"{x:.1f}" for x in np.max(pulls, axis=0))
    mean = ", ".join(f"{x:.4g}" for x in np.mean(values, axis=0))
    scatter = found.attrs["chi_square_scatter"]
    print(
        f"| {name} | {told} of {num_seeds} | {min(chi):.3f} to {max(chi):.3f} | "
        f"1 +- {scatter:.3f} | {largest} | {mean} |",
        flush=True,
    )


def main():
    form = argparse.RawTextHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("--size", type=int, default=32)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--wrong-seeds", type=int, default=5)
    parser.add_argument("--only", default="paper,cirrus,calibration,wrong")
    arguments = parser.parse_args()
    use_compiler_flags()
    use_compilation_cache()
    jax.config.update("jax_enable_x64", True)
    for name in arguments.only.split(","):
        if name == "wrong":
            wrong(arguments.size, arguments.wrong_seeds)
        else:
            coverage(name, arguments.size, arguments.seeds)


if __name__ == "__main__":
    main()
