"""Clear brightness temperatures of C07 line by line, beside the operator's.

    python benchmarks/lines_temperature.py FOLDER

FOLDER is that of `lines_transmittance.py`. Of the four standard atmospheres over ground of the
temperature of the air above it, albedo 0.05, by night and with the sun at 30 and 60 degrees, seen
at 0 and 60 degrees: emission and transmission at each wavenumber by itself (source functions
straight in depth between levels, the sky's light that the ground reflects by 3 angles, no
scattering), averaged over the response, against `brightness_temperature` with the same gases, those
of which there are lines: vapour and N2O. Both turn radiance into temperature by what they find for
black bodies. The last column is the operator's as vapour and N2O would have it that were not there.
"""

import argparse
import itertools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from lines_of_air import PROFILES, Spectrum, planck, response_of, spectrum

from abi_operator import Geometry, State, brightness_temperature
from abi_operator.planck import wavenumber_radiance_factor
from abi_operator.satellites import solar_irradiance

ALBEDO = 0.05
GASES = ("H2O", "N2O")
VIEWS, SUNS = (0.0, 60.0), (None, 30.0, 60.0)  # zenith angles [deg]
SUN = 5778.0  # temperature of a body with the sun's colour in C07 [K]


class Light:
    """Radiances of one column at each wavenumber. [W m-2 sr-1 (cm-1)-1]"""

    def __init__(self, found: Spectrum) -> None:
        self.grid = found.grid
        self.depth = np.sum(list(found.depths.values()), axis=0)
        temperature = np.asarray(found.column.temperature)
        self.ground = float(temperature[-1])
        self.level = np.stack([planck(self.grid, t) for t in temperature])
        response = response_of("C07", self.grid)
        self.share = response / response.sum()

    def emitted(self, mu: float, down: bool) -> np.ndarray:
        """What the air gives off at its lower or upper end."""
        seen = np.zeros_like(self.grid)
        layers = range(len(self.depth))
        for k in layers if down else reversed(layers):
            near, far = (k + 1, k) if down else (k, k + 1)
            depth = np.maximum(self.depth[k] / mu, 1e-9)
            left = np.exp(-depth)
            slope = (1 - (1 + depth) * left) / depth
            own = self.level[near] * (1 - left) + (self.level[far] - self.level[near]) * slope
            seen = seen * left + own
        return seen

    def top(self, view: float, sun: float | None) -> float:
        """Radiance at the top in a direction, averaged over the response."""
        mu = np.cos(np.deg2rad(view))
        whole = self.depth.sum(axis=0)
        nodes, weights = np.polynomial.legendre.leggauss(3)
        sky = sum(
            w * x * self.emitted(x, down=True)
            for x, w in zip((nodes + 1) / 2, weights, strict=True)
        )
        up = (1 - ALBEDO) * planck(self.grid, self.ground) + ALBEDO * sky
        seen = up * np.exp(-whole / mu) + self.emitted(mu, down=False)
        if sun is not None:
            mu0 = np.cos(np.deg2rad(sun))
            colour = planck(self.grid, SUN)
            mean = 1e-3 * solar_irradiance("C07") / wavenumber_radiance_factor("C07")
            irradiance = mean * colour / (self.share @ colour)
            seen = seen + ALBEDO / np.pi * mu0 * irradiance * np.exp(-whole * (1 / mu + 1 / mu0))
        return float(self.share @ seen)

    def temperature(self, radiance: float) -> float:
        """Of the black body with this radiance. [K]"""
        trial = np.arange(200.0, 400.0, 1.0)
        known = np.log([self.share @ planck(self.grid, t) for t in trial])
        return float(np.interp(np.log(radiance), known, trial))


def operator(found: Spectrum, view: float, sun: float | None, gases: tuple[str, ...]) -> float:
    """The operator's brightness temperature. [K]"""
    ground = found.column.temperature
    assert ground is not None
    angles = np.deg2rad([120.0 if sun is None else sun, view, 90.0])
    state = State(
        found.column,
        {"C07": jnp.asarray(ALBEDO)},
        Geometry(*map(jnp.asarray, angles)),
        surface_temperature=ground[-1],
    )
    return float(brightness_temperature(state, gases=gases))


def main(folder: Path) -> None:
    """Print the table and the largest difference."""
    print("| profile | view | sun | lines [K] | operator [K] | difference [K] | no gas [K] |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    largest = 0.0
    for name in PROFILES:
        found = spectrum(folder, name, "C07")
        light = Light(found)
        for view, sun in itertools.product(VIEWS, SUNS):
            exact = light.temperature(light.top(view, sun))
            ours, without = operator(found, view, sun, GASES), operator(found, view, sun, ())
            largest = np.maximum(largest, abs(ours - exact))
            when = "night" if sun is None else f"{sun:.0f}"
            numbers = f"{exact:.2f} | {ours:.2f} | {ours - exact:+.2f} | {without:.2f}"
            print(f"| {name} | {view:.0f} | {when} | {numbers} |")
    print(f"\nlargest difference: {largest:.2f} K")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    jax.config.update("jax_enable_x64", True)
    main(parser.parse_args().folder)
