"""Are the result codes of retrievals true to what happened to the measurements?

    python benchmarks/stress_retrievals.py [--pixels 256] [--streams 4]

Random pixels of `retrievals_pixels`, smoke of known optical depth and single-scattering albedo,
seen in C01, C02 and C03 with the imager's noise; then something is wrong with them (`CASES`).
Printed are shares of the result codes, and of those that say success: how many hold the truth
within 1.96 posterior standard deviations, and the largest error in these. Where the retrieval is
told all that is wrong, success must hold the truth as often as it claims; where it is not, it
should say ``poor_fit``, as far as three bands can tell.
"""

import argparse
import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from retrievals_pixels import random_states

from abi_operator import LiquidCloud, State
from abi_operator.machine.speed import use_compilation_cache, use_compiler_flags
from retrievals import (
    ForwardModel,
    Minimiser,
    Observation,
    Prior,
    ResultCode,
    measurement,
    prepared,
    retrieve_pixels,
)
from retrievals.declarations import plume
from retrievals.inverse import DEFAULT_MINIMISER

BANDS = ("C01", "C02", "C03")
SPREAD = 0.7, 0.5  # of the prior, in ln aod_550 and the logit of ssa
MEAN = 0.4
LAYER = 17  # of 20, the one from 4 to 6 km, counted from the top, has the cloud
WRONG = 30.0  # how often the noise is as large, in a measurement that went wrong


class Stressed(NamedTuple):
    """What a retrieval is given, and what was true.

    Parameters
    ----------
    observations, states, prior
        What the retrieval is given.
    told
        Whether that is all true.
    """

    observations: Observation
    states: State
    prior: Prior
    told: bool = True


class Pixels:
    """Pixels with a truth and what is seen of it.

    Parameters
    ----------
    num_pixels, streams, seed
        How many, of how many streams of the solver, drawn by which seed.
    """

    def __init__(self, num_pixels: int, streams: int, seed: int = 3) -> None:
        self.rng = np.random.default_rng(seed)
        self.states = random_states(self.rng, num_pixels, BANDS)
        vector = plume("smoke", ssa=True)
        forward = ForwardModel(vector, BANDS, streams, gases=())
        # Cloudy columns take as many doublings: the same program for all cases.
        self.forward = prepared(forward, self.cloudy(1.0))
        mean = np.asarray(vector.x(MEAN, 0.0))
        self.prior = Prior(mean, np.diag(np.square(SPREAD)))
        drawn = self.rng.standard_normal((num_pixels, 2))
        self.truth = mean + drawn * np.array(SPREAD)
        self.noise = self.rng.standard_normal((num_pixels, len(BANDS)))

    def cloudy(self, optical_depth: float) -> State:
        """The same columns with a cloud of droplets at 4 to 6 km, above or in the plume."""
        mass = np.zeros_like(self.states.atmosphere.liquid.mass_path)
        # Of 10 um: depth 3 / 2 of the mass over density and radius, 4 / 3 pi r^3 of mass each.
        mass[:, LAYER] = optical_depth * 1e3 * 10e-6 / 1.5
        cloud = LiquidCloud(mass, mass / (4 / 3 * np.pi * 1e3 * (10e-6) ** 3))
        return eqx.tree_at(lambda s: s.atmosphere.liquid, self.states, cloud)

    def seen(self, states: State | None = None, times: float = 1.0) -> Observation:
        """What the imager reports, its noise so many times as large and known to be."""
        values = np.asarray(self.forward(self.truth, self.states if states is None else states))
        sigma = times * np.asarray(measurement(values, BANDS).sigma)
        return Observation(values + sigma * self.noise, sigma)


def _changed(observation: Observation, **fields: Any) -> Observation:
    return dataclasses.replace(observation, **fields)


def _without(pixels: Pixels, *bands: int) -> Stressed:
    seen = pixels.seen()
    measured = np.array(seen.measured)
    measured[:, bands] = np.nan
    return Stressed(_changed(seen, measured=measured), pixels.states, pixels.prior)


def _saturated(pixels: Pixels, *bands: int) -> Stressed:
    """Bands that could report four fifths of what there was."""
    seen = pixels.seen()
    measured, saturated = np.array(seen.measured), np.zeros(seen.measured.shape, bool)
    measured[:, bands] *= 0.8
    saturated[:, bands] = True
    return Stressed(
        _changed(seen, measured=measured, saturated=saturated), pixels.states, pixels.prior
    )


def _untold_noise(pixels: Pixels) -> Stressed:
    quiet, loud = pixels.seen(), pixels.seen(times=10.0)
    return Stressed(_changed(loud, sigma=quiet.sigma), pixels.states, pixels.prior, told=False)


def _one_band_wrong(pixels: Pixels) -> Stressed:
    seen = pixels.seen()
    measured = np.array(seen.measured)
    measured[:, 0] += WRONG * np.asarray(seen.sigma)[:, 0]
    return Stressed(_changed(seen, measured=measured), pixels.states, pixels.prior, told=False)


def _prior(pixels: Pixels, factor: float, narrower: float) -> Stressed:
    """A prior whose mean optical depth is so many times as large."""
    mean = pixels.prior.x_prior + np.log(factor) * np.array([1.0, 0.0])
    prior = Prior(mean, pixels.prior.S_prior / narrower**2)
    return Stressed(pixels.seen(), pixels.states, prior, told=False)


def _albedo_missing(pixels: Pixels) -> Stressed:
    """NaN in the ground of every other pixel."""
    albedo = {k: np.array(v) for k, v in pixels.states.albedo.items()}
    albedo["C02"][::2] = np.nan
    states = dataclasses.replace(pixels.states, albedo=albedo)
    return Stressed(pixels.seen(), states, pixels.prior)


def _cloud(pixels: Pixels, depth: float, known: bool, there: bool = True) -> Stressed:
    """A cloud that the retrieval knows or not, or that it assumes where there is none."""
    cloudy = pixels.cloudy(depth)
    seen = pixels.seen(cloudy if there else pixels.states)
    return Stressed(seen, cloudy if known else pixels.states, pixels.prior, told=known == there)


CASES = {
    "as the imager sees it": lambda p: Stressed(p.seen(), p.states, p.prior),
    "noise ten times as large": lambda p: Stressed(p.seen(times=10.0), p.states, p.prior),
    "the same, not told": _untold_noise,
    "prior ten times too large": lambda p: _prior(p, 10.0, 1.0),
    "prior ten times too large and sure": lambda p: _prior(p, 10.0, 10.0),
    "C02 missing": lambda p: _without(p, 1),
    "C01 and C02 missing": lambda p: _without(p, 0, 1),
    "all bands missing": lambda p: _without(p, 0, 1, 2),
    "C03 saturated": lambda p: _saturated(p, 2),
    "all bands saturated": lambda p: _saturated(p, 0, 1, 2),
    f"C01 too bright by {WRONG:.0f} sigma": _one_band_wrong,
    "albedo NaN in half of the pixels": _albedo_missing,
    "cloud of 5, known": lambda p: _cloud(p, 5.0, known=True),
    "cloud of 0.3, not known": lambda p: _cloud(p, 0.3, known=False),
    "cloud of 5, not known": lambda p: _cloud(p, 5.0, known=False),
    "cloud of 5 known where there is none": lambda p: _cloud(p, 5.0, known=True, there=False),
}


class Judged(NamedTuple):
    """Result codes of all pixels, errors of x in posterior standard deviations, and of aod_550."""

    codes: np.ndarray
    departures: np.ndarray
    errors: np.ndarray
    told: bool

    @property
    def success(self) -> np.ndarray:
        """Which say success."""
        return self.codes == ResultCode.SUCCESS

    def share(self, code: ResultCode) -> float:
        """Share of a result code. [-]"""
        return float(np.mean(self.codes == code))

    @property
    def coverage(self) -> np.ndarray:
        """Share of successes that hold the truth within 1.96 sigma, of each element of x. [-]"""
        return np.mean(self.departures[self.success] <= 1.96, axis=0)


def judged(pixels: Pixels, name: str, minimiser: Minimiser = DEFAULT_MINIMISER) -> Judged:
    """Retrieve pixels to which a case has happened."""
    given = CASES[name](pixels)
    found = retrieve_pixels(
        pixels.forward, given.observations, given.states, prior=given.prior, minimiser=minimiser
    )
    inversion = found.inversion
    sigma = np.sqrt(np.diagonal(inversion.covariance, axis1=1, axis2=2))
    values = [
        np.asarray(pixels.forward.vector.values(x)["aod_550"]) for x in (inversion.x, pixels.truth)
    ]
    departures = np.abs(np.asarray(inversion.x) - pixels.truth) / sigma
    return Judged(found.codes, departures, np.abs(values[0] - values[1]), given.told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pixels", type=int, default=256)
    parser.add_argument("--streams", type=int, default=4)
    arguments = parser.parse_args()
    use_compiler_flags()
    use_compilation_cache()
    jax.config.update("jax_enable_x64", True)
    pixels = Pixels(arguments.pixels, arguments.streams)
    print(
        "| what happened | result codes [%] | aod_550 held [%] | ssa held [%] | largest error of "
        "aod_550 |\n| --- | --- | --- | --- | --- |"
    )
    for name in CASES:
        found = judged(pixels, name)
        shares = {code.name.lower(): 100 * found.share(code) for code in ResultCode}
        codes = ", ".join(f"{code} {share:.1f}" for code, share in shares.items() if share)
        held = ["-", "-", "-"]
        if found.success.any():
            held = [f"{100 * x:.1f}" for x in found.coverage]
            held.append(f"{found.errors[found.success].max():.2g}")
        print(f"| {name}{'' if found.told else ' *'} | {codes} | {' | '.join(held)} |", flush=True)
    print("\n\\* The retrieval is told other than what is true.")


if __name__ == "__main__":
    main()
