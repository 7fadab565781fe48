"""An image of smoke that is retrieved as a whole, some of whose pixels go wrong.

A bad pixel must not spoil those beside it, unless their codes say so: these are counted on their
own, too. All cases have the same pixels, and are solved by the same compiled programs.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import equinox as eqx
import numpy as np
import scipy.ndimage
from retrievals_smooth import field
from stress_retrievals_cases import WRONG, Stressed, as_seen, changed, untold_noise, wrong_prior
from stress_retrievals_judged import Judged, weighed
from stress_retrievals_pixels import Pixels

from retrievals import Minimiser, retrieve_pixels
from retrievals.inverse import DEFAULT_MINIMISER
from retrievals.smooth import retrieve_smooth, smoothness

LENGTH = 4.0
"""Correlation length of the image, and of the retrieval where nothing else is said. [pixel]"""
SIDE = 16
"""Of the image. [pixel]"""
BRIGHT, FAINT = 0.9, 1e-160
"""What a cloud reflects, and a sigma whose square is no number. [-]"""


class Image(Pixels):
    """A square of pixels, each with a ground, air and geometry of its own, under smooth smoke.

    Parameters
    ----------
    streams, side, seed
        Streams of the solver, pixels of a side, and seed of what is drawn.
    """

    def __init__(self, streams: int, side: int = SIDE, seed: int = 3) -> None:
        super().__init__("smoke", side**2, streams, seed)
        self.side = side
        rng = np.random.default_rng(seed)
        fields = [field(rng, side, LENGTH).ravel() for _ in self.kind.spread]
        self.truth = self.prior.x_prior + np.array(self.kind.spread) * np.stack(fields, axis=-1)

    def within(self, rows: slice, columns: slice) -> np.ndarray:
        """Which pixels lie there, in the order of the pixels."""
        chosen = np.zeros((self.side, self.side), bool)
        chosen[rows, columns] = True
        return chosen.ravel()


class Broken(NamedTuple):
    """What a retrieval of an image is given.

    Parameters
    ----------
    given
        As of single pixels.
    bad
        Which pixels something happened to alone.
    length
        That the retrieval takes the image to have. [pixel]
    """

    given: Stressed
    bad: np.ndarray
    length: float = LENGTH


class JudgedImage(NamedTuple):
    """What became of an image.

    Parameters
    ----------
    judged
        All of its pixels.
    beside
        Which are neighbours of bad ones, also by a corner, and not bad themselves.
    steps
        Joint steps. [-]
    """

    judged: Judged
    beside: np.ndarray
    steps: int

    @property
    def success_beside(self) -> float:
        """Share of successes of the neighbours. [-]"""
        return float(np.mean(self.judged.success[self.beside]))

    @property
    def held_beside(self) -> float:
        """Share of the truths that the successes among them hold; NaN without any. [-]"""
        chosen = self.judged.success & self.beside
        if not chosen.any():
            return np.nan
        return float(np.mean(np.abs(self.judged.departures[chosen]) <= 1.96))


def judged_image(image: Image, name: str, minimiser: Minimiser = DEFAULT_MINIMISER) -> JudgedImage:
    """Retrieve an image to which one of `IMAGES` has happened."""
    broken = IMAGES[name](image)
    given, shape = broken.given, (image.side, image.side)
    assert given.prior is not None
    how = {"prior": given.prior, "minimiser": minimiser}
    found = retrieve_smooth(
        image.forward,
        given.observations,
        given.states,
        smooth=smoothness(np.ones(shape, bool), broken.length),
        **how,
    )
    alone = retrieve_pixels(image.forward, given.observations, given.states, **how)
    steps = np.max(found.inversion.num_steps - alone.inversion.num_steps)
    bad = broken.bad.reshape(shape)
    beside = scipy.ndimage.binary_dilation(bad, np.ones((3, 3))) & ~bad
    return JudgedImage(weighed(image, given, found), beside.ravel(), int(steps))


def _whole(image: Image, case: Callable[[Image], Stressed], longer: float = 1.0) -> Broken:
    """What happens to all pixels alike, and how much longer they are taken to be smooth."""
    given = case(image)
    nothing = image.within(slice(0), slice(0))
    return Broken(given._replace(told=given.told and longer == 1), nothing, longer * LENGTH)


def _block(image: Image) -> Broken:
    """Nothing measured in a block."""
    bad, seen = image.within(slice(5, 10), slice(5, 10)), image.seen()
    measured = np.where(bad[:, None], np.nan, seen.measured)
    given = Stressed(changed(seen, measured=measured), image.states, image.prior)
    return Broken(given, bad)


def _stripe(image: Image) -> Broken:
    """A ground that is no number along two columns."""
    bad = image.within(slice(None), slice(7, 9))
    albedo = np.where(bad, np.nan, image.states.albedo["C02"])
    states = eqx.tree_at(lambda s: s.albedo["C02"], image.states, albedo)
    return Broken(Stressed(image.seen(), states, image.prior), bad)


def _one(image: Image, sigmas: float = 0.0, bright: bool = False, faint: bool = False) -> Broken:
    """A pixel too bright in C01 by so many sigma, or a cloud, or with a sigma next to none."""
    bad, seen = image.within(slice(7, 8), slice(7, 8)), image.seen()
    measured, sigma = np.array(seen.measured), np.array(seen.sigma)
    measured[bad, 0] += sigmas * sigma[bad, 0]
    if bright:
        measured[bad] = BRIGHT
    if faint:
        sigma[bad] = FAINT
    given = Stressed(changed(seen, measured=measured, sigma=sigma), image.states, image.prior)
    return Broken(given._replace(told=False), bad)


def _saturated(image: Image) -> Broken:
    """A block saturated in all bands, which could report four fifths of what there was."""
    bad, seen = image.within(slice(5, 10), slice(5, 10)), image.seen()
    measured = np.where(bad[:, None], 0.8, 1) * seen.measured
    saturated = np.array(seen.saturated) | bad[:, None]
    given = changed(seen, measured=measured, saturated=saturated)
    return Broken(Stressed(given, image.states, image.prior), bad)


IMAGES: dict[str, Callable[[Image], Broken]] = {
    "as the imager sees it": partial(_whole, case=as_seen),
    "noise ten times as large": partial(_whole, case=partial(as_seen, times=10.0)),
    "the same, not told": partial(_whole, case=untold_noise),
    "prior ten times too large": partial(_whole, case=partial(wrong_prior, narrower=1.0)),
    "prior ten times too large and sure": partial(_whole, case=partial(wrong_prior, narrower=10.0)),
    "length ten times too large": partial(_whole, case=as_seen, longer=10.0),
    "length ten times too small": partial(_whole, case=as_seen, longer=0.1),
    "5 x 5 pixels missing": _block,
    "5 x 5 pixels saturated": _saturated,
    "albedo NaN in two columns": _stripe,
    f"one pixel's C01 too bright by {WRONG:.0f} sigma": partial(_one, sigmas=WRONG),
    f"one pixel as bright as a cloud, {BRIGHT:g}": partial(_one, bright=True),
    f"one pixel's sigma {FAINT:g}": partial(_one, faint=True),
}
"""What happens to an image."""
