"""What goes wrong with pixels, or is other than a retrieval is told.

A case makes of pixels what a retrieval is given. All have as many pixels in as many bands, so that
they are solved by the same compiled programs; those without prior by one more.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from stress_retrievals_pixels import Pixels, with_cloud, with_smoke_above

from abi_operator import State
from abi_operator.instrument import Imager
from retrievals import Observation, Prior, noise_sigma

WRONG = 30.0
"""How often the noise is as large, in a measurement that went wrong."""
DARKER, COLDER = 0.05, 10.0
"""By how much the ground of a fire's or a cloud's pixel is other than the retrieval is told
[-], [K]."""
SMOKE = 0.5
"""Optical depth at 550 nm of smoke above a cloud. [-]"""
THIN, THICK = 0.01, 10.0
"""By how much clouds are thinner or thicker than usual that hardly show, or no more. [-]"""
CEILING = 310.0
"""Of C07, in brightness temperature, where it saturates: in most of the pixels with a fire. [K]"""
BRIGHTEST = 0.3
"""Of C02, in reflectance factor, where it saturates: in two thirds of the clouds. [-]"""


class Stressed(NamedTuple):
    """What a retrieval is given, and what was true.

    Parameters
    ----------
    observations, states, prior
        What the retrieval is given.
    told
        Whether that is all true.
    truth
        What is to be found, None for that of the pixels.
    """

    observations: Observation
    states: State
    prior: Prior | None
    told: bool = True
    truth: np.ndarray | None = None


Case = Callable[[Pixels], Stressed]


def as_seen(pixels: Pixels, times: float = 1.0) -> Stressed:
    """Nothing is wrong; the noise may be so many times as large."""
    return Stressed(pixels.seen(times=times), pixels.states, pixels.prior)


def changed(observation: Observation, **fields: Any) -> Observation:
    """An observation of which something is other."""
    return dataclasses.replace(observation, **fields)


def _without(pixels: Pixels, *bands: int) -> Stressed:
    seen = pixels.seen()
    measured = np.array(seen.measured)
    measured[:, bands] = np.nan
    return Stressed(changed(seen, measured=measured), pixels.states, pixels.prior)


def _saturated(pixels: Pixels, *bands: int) -> Stressed:
    """Bands that could report four fifths of what there was."""
    seen = pixels.seen()
    measured, saturated = np.array(seen.measured), np.array(seen.saturated)
    measured[:, bands] *= 0.8
    saturated[:, bands] = True
    return Stressed(
        changed(seen, measured=measured, saturated=saturated), pixels.states, pixels.prior
    )


def _bright_ceiling(pixels: Pixels) -> Stressed:
    """A ceiling of C02 that is the same for all, as it says nothing of a pixel where it is."""
    seen = pixels.seen()
    measured, sigma = np.array(seen.measured), np.array(seen.sigma)
    saturated = measured[:, 0] >= BRIGHTEST
    sigma[saturated, 0] = noise_sigma(BRIGHTEST, "C02")
    measured[saturated, 0] = BRIGHTEST
    bounds = np.array(seen.saturated)
    bounds[:, 0] |= saturated
    known = changed(seen, measured=measured, sigma=sigma, saturated=bounds)
    return Stressed(known, pixels.states, pixels.prior)


def _low_ceiling(pixels: Pixels) -> Stressed:
    """A ceiling of C07 that is the same for all, as it says nothing of a pixel where it is."""
    imager = Imager(fire_saturation_temperature=CEILING)
    return Stressed(pixels.seen(imager=imager), pixels.states, pixels.prior)


def untold_noise(pixels: Pixels) -> Stressed:
    """Noise ten times as large as the retrieval takes it to be."""
    quiet, loud = pixels.seen(), pixels.seen(times=10.0)
    return Stressed(changed(loud, sigma=quiet.sigma), pixels.states, pixels.prior, told=False)


def _one_band_wrong(pixels: Pixels, band: int) -> Stressed:
    seen = pixels.seen()
    measured = np.array(seen.measured)
    measured[:, band] += WRONG * np.asarray(seen.sigma)[:, band]
    return Stressed(changed(seen, measured=measured), pixels.states, pixels.prior, told=False)


def wrong_prior(pixels: Pixels, narrower: float) -> Stressed:
    """A prior by which there is ten times as much."""
    kind = pixels.kind
    mean = np.array(kind.vector.x(*kind.mean))
    if pixels.name in ("fire", "cloud"):
        more = [10.0 * x if i == kind.amount else x for i, x in enumerate(kind.mean)]
        mean = np.asarray(kind.vector.x(*more))
    else:  # in the logarithm that x is of optical depths far below their limit
        mean[kind.amount] += np.log(10.0)
    prior = Prior(mean, pixels.prior.S_prior / narrower**2)
    return Stressed(pixels.seen(), pixels.states, prior, told=False)


def _holed(pixels: Pixels, place: Callable[[State], Any]) -> Stressed:
    """NaN in something that is known of every other pixel."""
    known = np.array(place(pixels.states))
    known[::2] = np.nan
    states = eqx.tree_at(place, pixels.states, known)
    return Stressed(pixels.seen(), states, pixels.prior)


def _cloud(pixels: Pixels, depth: float, known: bool, there: bool = True) -> Stressed:
    """A cloud that the retrieval knows or not, or that it assumes where there is none."""
    cloudy = with_cloud(pixels.states, depth)
    seen = pixels.seen(cloudy if there else pixels.states)
    return Stressed(seen, cloudy if known else pixels.states, pixels.prior, told=known == there)


def _ground(pixels: Pixels, warmer: float = 0.0, brighter: float = 0.0) -> Stressed:
    """A ground that the retrieval takes for warmer [K], or for brighter in all bands."""
    states = pixels.states
    albedo = {band: np.asarray(values) + brighter for band, values in states.albedo.items()}
    warmth: Any = states.surface_temperature
    if warmth is not None:
        warmth = np.asarray(warmth) + warmer
    wrong = dataclasses.replace(states, albedo=albedo, surface_temperature=warmth)
    return Stressed(pixels.seen(), wrong, pixels.prior, told=False)


def _as_much(pixels: Pixels, times: float, known: bool) -> Stressed:
    """Thicker or thinner than drawn by as much for all in the mean, which the prior says or not."""
    kind = pixels.kind
    values = [times * x if i == kind.amount else x for i, x in enumerate(kind.mean)]
    mean = np.asarray(kind.vector.x(*values))
    truth = pixels.truth + mean - pixels.prior.x_prior
    prior = Prior(mean, pixels.prior.S_prior) if known else pixels.prior
    return Stressed(pixels.seen(truth=truth), pixels.states, prior, known, truth)


def _smoke_above(pixels: Pixels, known: bool) -> Stressed:
    smoky = with_smoke_above(pixels.states, SMOKE)
    return Stressed(pixels.seen(smoky), smoky if known else pixels.states, pixels.prior, told=known)


def _nowhere(pixels: Pixels) -> Stressed:
    """Half of the columns have no water, so that nothing says where a cloud would be."""
    dry = pixels.states.atmosphere.liquid
    paths = [np.array(x) for x in (dry.mass_path, dry.number_path)]
    for path in paths:
        path[::2] = 0
    states = eqx.tree_at(
        lambda s: [s.atmosphere.liquid.mass_path, s.atmosphere.liquid.number_path],
        pixels.states,
        paths,
    )
    return Stressed(pixels.seen(), states, pixels.prior)


def _without_prior(pixels: Pixels, case: Case) -> Stressed:
    return case(pixels)._replace(prior=None)


OF_ALL: dict[str, Case] = {
    "as the imager sees it": as_seen,
    "noise ten times as large": partial(as_seen, times=10.0),
    "the same, not told": untold_noise,
    "prior ten times too large": partial(wrong_prior, narrower=1.0),
    "prior ten times too large and sure": partial(wrong_prior, narrower=10.0),
}

CLOUDS: dict[str, Case] = {
    "cloud of 5, known": partial(_cloud, depth=5.0, known=True),
    "cloud of 0.3, not known": partial(_cloud, depth=0.3, known=False),
    "cloud of 5, not known": partial(_cloud, depth=5.0, known=False),
    "cloud of 5 known where there is none": partial(_cloud, depth=5.0, known=True, there=False),
}

OF_PLUMES: dict[str, Case] = {
    **OF_ALL,
    "C02 missing": lambda p: _without(p, 1),
    "C01 and C02 missing": lambda p: _without(p, 0, 1),
    "all bands missing": lambda p: _without(p, 0, 1, 2),
    "C03 saturated": lambda p: _saturated(p, 2),
    "all bands saturated": lambda p: _saturated(p, 0, 1, 2),
    f"C01 too bright by {WRONG:.0f} sigma": partial(_one_band_wrong, band=0),
    "albedo NaN in half of the pixels": lambda p: _holed(p, lambda s: s.albedo["C02"]),
    **CLOUDS,
}

OF_FIRES: dict[str, Case] = {
    **OF_ALL,
    "C05 missing": lambda p: _without(p, 0),
    "C05 and C06 missing": lambda p: _without(p, 0, 1),
    "C07 missing": lambda p: _without(p, 2),
    "all bands missing": lambda p: _without(p, 0, 1, 2),
    f"C07 ends at {CEILING:.0f} K": _low_ceiling,
    "all bands saturated": lambda p: _saturated(p, 0, 1, 2),
    f"C06 too bright by {WRONG:.0f} sigma": partial(_one_band_wrong, band=1),
    "ground's temperature NaN in half of the pixels": lambda p: _holed(
        p, lambda s: s.surface_temperature
    ),
    f"ground colder by {COLDER:.0f} K than told": partial(_ground, warmer=COLDER),
    f"ground darker by {DARKER:g} than told": partial(_ground, brighter=DARKER),
    **CLOUDS,
    "no prior": partial(_without_prior, case=as_seen),
    "no prior, noise ten times as large": partial(
        _without_prior, case=partial(as_seen, times=10.0)
    ),
    f"no prior, C07 ends at {CEILING:.0f} K": partial(_without_prior, case=_low_ceiling),
    "no prior, C05 and C06 missing": partial(_without_prior, case=lambda p: _without(p, 0, 1)),
}

OF_CLOUDS: dict[str, Case] = {
    **OF_ALL,
    "C02 missing": lambda p: _without(p, 0),
    "C06 missing": lambda p: _without(p, 1),
    "all bands missing": lambda p: _without(p, 0, 1),
    f"C02 ends at {BRIGHTEST:g}": _bright_ceiling,
    "all bands saturated": lambda p: _saturated(p, 0, 1),
    f"C06 too bright by {WRONG:.0f} sigma": partial(_one_band_wrong, band=1),
    "albedo NaN in half of the pixels": lambda p: _holed(p, lambda s: s.albedo["C02"]),
    "no cloud water in half of the pixels": _nowhere,
    "a hundred times thinner, known": partial(_as_much, times=THIN, known=True),
    "a hundred times thinner, not known": partial(_as_much, times=THIN, known=False),
    "ten times thicker, known": partial(_as_much, times=THICK, known=True),
    "ten times thicker, not known": partial(_as_much, times=THICK, known=False),
    f"smoke of {SMOKE:g} above, known": partial(_smoke_above, known=True),
    f"smoke of {SMOKE:g} above, not known": partial(_smoke_above, known=False),
    f"ground darker by {DARKER:g} than told": partial(_ground, brighter=DARKER),
    "no prior": partial(_without_prior, case=as_seen),
    "no prior, noise ten times as large": partial(
        _without_prior, case=partial(as_seen, times=10.0)
    ),
    "no prior, C06 missing": partial(_without_prior, case=lambda p: _without(p, 1)),
    "no prior, a hundred times thinner": partial(
        _without_prior, case=partial(_as_much, times=THIN, known=True)
    ),
}

CASES: dict[str, dict[str, Case]] = {
    "smoke": OF_PLUMES,
    "ash": OF_PLUMES,
    "fire": OF_FIRES,
    "cloud": OF_CLOUDS,
}
"""Cases of each kind, by what happened."""
