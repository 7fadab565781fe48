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
from stress_retrievals_pixels import Pixels, with_cloud

from abi_operator import State
from abi_operator.instrument import Imager
from retrievals import Observation, Prior

WRONG = 30.0
"""How often the noise is as large, in a measurement that went wrong."""
DARKER, COLDER = 0.05, 10.0
"""By how much the ground of a fire's pixel differs from what the retrieval is told [-], [K]."""
CEILING = 310.0
"""Of C07, in brightness temperature, where it saturates: in most of the pixels with a fire. [K]"""


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
    prior: Prior | None
    told: bool = True


Case = Callable[[Pixels], Stressed]


def _as_seen(pixels: Pixels, times: float = 1.0) -> Stressed:
    return Stressed(pixels.seen(times=times), pixels.states, pixels.prior)


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
    measured, saturated = np.array(seen.measured), np.array(seen.saturated)
    measured[:, bands] *= 0.8
    saturated[:, bands] = True
    return Stressed(
        _changed(seen, measured=measured, saturated=saturated), pixels.states, pixels.prior
    )


def _low_ceiling(pixels: Pixels) -> Stressed:
    """A ceiling of C07 that is the same for all, as it says nothing of a pixel where it is."""
    imager = Imager(fire_saturation_temperature=CEILING)
    return Stressed(pixels.seen(imager=imager), pixels.states, pixels.prior)


def _untold_noise(pixels: Pixels) -> Stressed:
    quiet, loud = pixels.seen(), pixels.seen(times=10.0)
    return Stressed(_changed(loud, sigma=quiet.sigma), pixels.states, pixels.prior, told=False)


def _one_band_wrong(pixels: Pixels, band: int) -> Stressed:
    seen = pixels.seen()
    measured = np.array(seen.measured)
    measured[:, band] += WRONG * np.asarray(seen.sigma)[:, band]
    return Stressed(_changed(seen, measured=measured), pixels.states, pixels.prior, told=False)


def _prior(pixels: Pixels, narrower: float) -> Stressed:
    """A prior by which there is ten times as much."""
    kind = pixels.kind
    mean = np.array(kind.vector.x(*kind.mean))
    if pixels.name == "fire":
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
    warmth = np.asarray(states.surface_temperature) + warmer
    wrong = dataclasses.replace(states, albedo=albedo, surface_temperature=warmth)
    return Stressed(pixels.seen(), wrong, pixels.prior, told=False)


def _without_prior(pixels: Pixels, case: Case) -> Stressed:
    return case(pixels)._replace(prior=None)


CLOUDS: dict[str, Case] = {
    "cloud of 5, known": partial(_cloud, depth=5.0, known=True),
    "cloud of 0.3, not known": partial(_cloud, depth=0.3, known=False),
    "cloud of 5, not known": partial(_cloud, depth=5.0, known=False),
    "cloud of 5 known where there is none": partial(_cloud, depth=5.0, known=True, there=False),
}

OF_PLUMES: dict[str, Case] = {
    "as the imager sees it": _as_seen,
    "noise ten times as large": partial(_as_seen, times=10.0),
    "the same, not told": _untold_noise,
    "prior ten times too large": partial(_prior, narrower=1.0),
    "prior ten times too large and sure": partial(_prior, narrower=10.0),
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
    "as the imager sees it": _as_seen,
    "noise ten times as large": partial(_as_seen, times=10.0),
    "the same, not told": _untold_noise,
    "prior ten times too large": partial(_prior, narrower=1.0),
    "prior ten times too large and sure": partial(_prior, narrower=10.0),
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
    "no prior": partial(_without_prior, case=_as_seen),
    "no prior, noise ten times as large": partial(
        _without_prior, case=partial(_as_seen, times=10.0)
    ),
    f"no prior, C07 ends at {CEILING:.0f} K": partial(_without_prior, case=_low_ceiling),
    "no prior, C05 and C06 missing": partial(_without_prior, case=lambda p: _without(p, 0, 1)),
}

CASES: dict[str, dict[str, Case]] = {"smoke": OF_PLUMES, "ash": OF_PLUMES, "fire": OF_FIRES}
"""Cases of each kind, by what happened."""
