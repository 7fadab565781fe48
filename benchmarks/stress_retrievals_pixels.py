"""Pixels with a known truth, of smoke, ash, fires or cloud, and what the imager reports of them."""

from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from retrievals_pixels import random_states

from abi_operator import Atmosphere, Fire, LiquidCloud, State
from abi_operator.instrument import IMAGER, Imager
from retrievals import ForwardModel, Observation, Prior, StateVector, measurement, prepared
from retrievals.declarations import fire, liquid_cloud, plume

LAYER = 17
"""Of 20, counted from the top, the one from 4 to 6 km, in which the clouds are."""
SMOKE_ABOVE = 7e3, 9e3
"""Base and top of the smoke above a cloud that is retrieved. [m]"""


class Kind(NamedTuple):
    """Something to retrieve.

    Parameters
    ----------
    bands
        In which it is seen, the one that tells most of it last.
    vector
        Unknowns.
    mean, spread
        Of the prior, from which the truth is drawn: in the units of the unknowns, and the standard
        deviation in x [-].
    amount
        How much there is: the index of the unknown that a wrong prior has wrong.
    reported, relative
        What the errors that are printed are of, one of the unknowns or of what is derived of them,
        and whether they are relative to the truth.
    """

    bands: tuple[str, ...]
    vector: StateVector
    mean: tuple[float, ...]
    spread: tuple[float, ...]
    amount: int
    reported: str
    relative: bool = False


_REFLECTED = ("C01", "C02", "C03")
KINDS = {
    "smoke": Kind(_REFLECTED, plume("smoke", ssa=True), (0.4, 0.0), (0.7, 0.5), 0, "aod_550"),
    "ash": Kind(
        _REFLECTED, plume("ash", effective_radius=True), (0.4, 3.0), (0.7, 0.5), 0, "aod_550"
    ),
    # As the quantities declare it: most burn in less than 1 % of the pixel, at 450 to 1,300 K.
    "fire": Kind(
        ("C05", "C06", "C07"), fire(), (800.0, 1e-3), (1.0, 0.5), 1, "fire_emitted_power", True
    ),
    # The same of cloud: thicknesses of 1 to 70, droplets of 4 to 22 um.
    "cloud": Kind(
        ("C02", "C06"),
        liquid_cloud(),
        (10.0, 10.0),
        (1.5, 1.0),
        0,
        "cloud_optical_thickness",
        True,
    ),
}
"""What the command retrieves, by name."""


class Pixels:
    """Pixels with a truth and what is seen of it.

    Parameters
    ----------
    name, num_pixels, streams, seed
        One of `KINDS`, how many, of how many streams of the solver, drawn by which seed.
    """

    def __init__(self, name: str, num_pixels: int, streams: int, seed: int = 3) -> None:
        rng = np.random.default_rng(seed)
        self.name, self.kind = name, KINDS[name]
        bands, vector = self.kind.bands, self.kind.vector
        if name in _STATES:
            self.states = _STATES[name](rng, num_pixels, bands)
        else:
            self.states = random_states(rng, num_pixels, bands, name)
        # Cloudy columns take as many doublings: the same program for all cases.
        self.forward = prepared(
            ForwardModel(vector, bands, streams, gases=()), with_cloud(self.states, 1.0)
        )
        mean = np.asarray(vector.x(*self.kind.mean))
        self.prior = Prior(mean, np.diag(np.square(self.kind.spread)))
        drawn = rng.standard_normal((num_pixels, vector.size))
        self.truth = mean + drawn * np.array(self.kind.spread)
        self.noise = rng.standard_normal((num_pixels, len(bands)))

    def seen(
        self,
        states: State | None = None,
        times: float = 1.0,
        imager: Imager = IMAGER,
        truth: np.ndarray | None = None,
    ) -> Observation:
        """What an imager reports, its noise so many times as large and known to be."""
        bands, truth = self.kind.bands, self.truth if truth is None else truth
        values = np.asarray(self.forward(truth, self.states if states is None else states))
        sigma = times * np.asarray(measurement(values, bands).sigma)
        seen = measurement(values + sigma * self.noise, bands, imager)
        return Observation(seen.measured, sigma, seen.saturated)


def _hot_ground(rng: np.random.Generator, num_pixels: int, bands: tuple[str, ...]) -> State:
    """Random columns with temperatures, in whose ground something burns."""
    clear = random_states(rng, num_pixels, bands)
    air, n = clear.atmosphere, num_pixels
    temperature = np.linspace(210.0, 295.0, air.pressure.shape[1]) + rng.uniform(-8, 8, (n, 1))
    return State(
        Atmosphere(air.pressure, air.height, air.liquid, {}, temperature=temperature),
        clear.albedo,
        clear.geometry,
        temperature[:, -1] + 3,
        Fire(np.full(n, 0.01), np.full(n, 700.0)),
    )


def _cloudy(rng: np.random.Generator, num_pixels: int, bands: tuple[str, ...]) -> State:
    """Random columns with a cloud, above which there could be smoke, and is none."""
    clear = random_states(rng, num_pixels, bands)
    return with_smoke_above(with_cloud(clear, 10.0), 0.0)


_STATES = {"fire": _hot_ground, "cloud": _cloudy}


def with_smoke_above(states: State, aod_550: float) -> State:
    """The same columns with smoke from 7 to 9 km, of an optical depth at 550 nm. [-]"""
    base, top = (np.full(len(states.geometry.solar_zenith), x) for x in SMOKE_ABOVE)
    return eqx.tree_at(
        lambda s: [
            getattr(s.atmosphere.plumes["smoke"], x) for x in ("base", "top", "extinction_550")
        ],
        states,
        [base, top, aod_550 / (top - base)],
    )


def with_cloud(states: State, optical_depth: float) -> State:
    """The same columns with a cloud of droplets at 4 to 6 km, above or in the plume.

    Parameters
    ----------
    states
        Columns.
    optical_depth
        Of the cloud. [-]
    """
    known: Any = states.atmosphere.liquid.mass_path
    mass = np.zeros_like(known)
    # Of 10 um: depth 3 / 2 of the mass over density and radius, 4 / 3 pi r^3 of mass each.
    mass[:, LAYER] = optical_depth * 1e3 * 10e-6 / 1.5
    cloud = LiquidCloud(mass, mass / (4 / 3 * np.pi * 1e3 * (10e-6) ** 3))
    return eqx.tree_at(lambda s: s.atmosphere.liquid, states, cloud)
