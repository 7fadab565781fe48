r"""The error budget: what of it each way of skipping may spend.

A budget b is a relative error of the reflectance that may be made on top of what the streams leave:
of max(brf, `LEAST_BRF`), in 99 of 100 columns. Of columns that emit it is one of the radiance, or
of that which `LEAST_BRF` would have, where it is less. Layers are merged until b times
`OF_MERGING` is estimated to be lost at a group of them (`grouping`). A column's azimuth modes end
where they count less than b times `of_modes`, and those but the mean are left out that are
expected to be less than b times `OF_NO_MODES` (`mode_sum`). A layer's doublings leave b times
`OF_DOUBLINGS` of its own response (`doublings`). A column that misses at most b times `OF_FAINT`
without any of this is not solved (`faint`). These shares were fitted by
`benchmarks/fit_budget.py` on columns of other seeds than those that `benchmarks/skipping.py` judges
them by, so that the worst of five seeds leaves a third of the budget. From `SINGLE_FROM` on
single precision is enough (`method.rounding`), which leaves next to nothing.

Groups and modes are each column's own. Of doublings a layer has as many as that column of its tile
asks for that needs most: what a column gets depends on those that it is solved with by about a
thousandth of the budget.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .depths import Depths

LEAST_BRF = 0.01
"""Smallest reflectance that an error is compared with. [-]"""
OF_MERGING = 0.35
"""Share of the budget that a group of merged layers may be estimated to lose, and to misplace of
thermal light that it scatters."""
OF_MODES = 0.2
"""Share of the budget below which an azimuth mode is the last one, up to `FITTED_TO` streams."""
FITTED_TO = 20
"""Streams up to which the shares were fitted."""
OF_FAINT = 0.7
"""Share of the budget that the light of a column may miss that is not solved (`faint`)."""
OF_DOUBLINGS = 0.2
"""Share of the budget that a layer's response may be off by."""
OF_DOUBLINGS_WARM = 2e-4
"""The same of layers that emit, whose light may be that of a cold top over a hot ground."""
OF_MODES_OF_SLOPES = 3e-4
"""Share of a column's slopes below which those of an azimuth mode in the moments are the last. Such
of a high degree are much the same in every mode, and many small ones add up to 1 %."""
OF_NO_MODES = 0.1
"""Share of the budget below which all modes but the mean are expected to stay."""
DECAY = 0.3
"""Ratio of neighbouring modes' sizes, to see a small one by chance for what it is: its neighbour
counts, times this, as well as itself, and where phase functions have peaks all that are up to
`LOOKED_BACK` before it, times this as often (`plan.Plan`)."""
LOOKED_BACK = 3
"""Modes before one of columns with peaks, by which it is seen whether it may be the last."""
FORWARD, BACKWARD = 0.75, 0.05
"""Share of what scatters, times its last moment, from which phase functions have a peak of which
modes are small by chance: forwards, over the number of streams (delta-M leaves 1 of an endlessly
sharp one, 0.5 of g = 0.85 at 8 streams), and backwards, of a moment below 0."""
SINGLE_FROM = 1e-4
"""Budget from which single precision is enough (`method.rounding`)."""
OF_SLOPES = 2e-3
"""The budget of programs for slopes, at most: a column's slopes keep about 1 % whatever else."""
THICKEST = 2.0
"""Optical depth on the way down and up of a group of layers of which slopes are wanted. [-]"""


class Faint(NamedTuple):
    """Light of columns as if they scattered hardly anything (`faint`).

    Parameters
    ----------
    light
        What the sum over all modes would be.
    missing
        How much of it may be wrong, for the view of which most is.
    """

    light: Float[Array, "*view batch"]
    missing: Float[Array, "batch"]


class Expected(NamedTuple):
    """What is known of the light of columns before they are solved; without derivatives.

    Light is a reflectance, or a radiance of columns that emit, and so is all here.

    Parameters
    ----------
    added
        Part of it that is added exactly to that of the modes, for each view.
    least
        A careful estimate of all of it, for the view that sees least.
    dark
        What a reflectance of `LEAST_BRF` is.
    aside
        A generous estimate of what any mode but the mean may add to it.
    through
        Share of the beam that meets nothing on its way to the ground and back: at least the slope
        in the albedo of a Lambertian ground. [-]
    mu0
        Cosine of the sun's zenith angle, by which reflectances are divided. [-]
    peaked
        Of layers that are solved already (`plan.Plan`); None where there are none.
    """

    added: Float[Array, "view *batch"]
    least: Float[Array, "*batch"]
    dark: Float[Array, "*batch"]
    aside: Float[Array, "*batch"]
    through: Float[Array, "*batch"]
    mu0: Float[Array, "*batch"]
    peaked: Float[Array, "*batch"] | None = None


def expected(
    added: Float[Array, "view *batch"],
    ground: Float[Array, "view *batch"] | None,
    layers: Depths,
    cosines: Float[Array, "beam *batch"],
) -> Expected:
    r"""Estimate the reflectance of a column from what is scattered once and diffused.

    .. math:: added + ground + \frac12\frac{t}{(1 + t)(1 + a)}, \qquad
       t = \tfrac34\sum\omega(1-g)\tau, \quad a = \sum(1-\omega)\tau,

    half of what a conservative atmosphere of that depth would send back, less what absorbs: seldom
    more than the reflectance, so that what is allowed as a share of it is seldom too much. Light
    that is scattered twice is to all modes together about

    .. math:: \frac{S^2}{\mu_0\mu}, \qquad S = \frac{\sum\omega\tau}{1 + \sum\omega\tau},

    four times what two thin layers would send to one another if they scattered isotropically, as
    much of it travels along them.

    Parameters
    ----------
    added, ground
        Light scattered once, and sent back by the ground alone; None of a ground that sends
        light to the modes, which is part of `added`. [-]
    layers
        What they add up to.
    cosines
        Of the sun's zenith angle and of the views'. [-]
    """
    t = 0.75 * layers.backward
    scattered = layers.scattered
    diffused = 0.5 * t / ((1 + t) * (1 + layers.absorbed))
    seen = added if ground is None else added + ground
    least = jnp.maximum(LEAST_BRF, jnp.min(seen, axis=0) + diffused)
    twice = (scattered / (1 + scattered)) ** 2 / (cosines[0] * jnp.min(cosines[1:], axis=0))
    aside = jnp.full_like(twice, jnp.inf) if ground is None else twice
    through = jnp.exp(-(1 / cosines[0] + 1 / cosines[1]) * layers.tau)
    known = Expected(added, least, jnp.full_like(least, LEAST_BRF), aside, through, cosines[0])
    return jax.lax.stop_gradient(known)


def of_modes(num_streams: int) -> float:
    """Share of the budget below which an azimuth mode is the last one.

    More streams leave more of a phase function's peak to the modes. Its modes are many of much the
    same size that change their sign again and again, and add up to more than the one at which
    they are small: above `FITTED_TO` the share falls with the square of the streams.
    """
    return OF_MODES * min(1.0, (FITTED_TO / num_streams) ** 2)


def rounds(error_budget: float | None) -> bool:
    """Whether an error budget has room for single precision."""
    return error_budget is not None and error_budget >= SINGLE_FROM
