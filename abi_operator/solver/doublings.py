"""How often a layer must be doubled for the rational start to be exact."""

import numpy as np

from .quadrature import double_gauss

# Largest z = tau' / (2 mu_min) of a layer for which the start of `layer.half_layer`, doubled
# 0, 1, 2, 3, 4 times, errs by 1e-12 or less; four times as much for each doubling after that.
_REACH = (0.0356, 0.0713, 0.142, 0.287, 179.0)

# Numbers of doublings that `num_doublings=None` chooses from: few, so that few programs compile.
_BUCKETS = (1, 4, 5, 6, 8, 14)

# What a program must be right for when its layers are not known as it is traced.
_UNKNOWN_TAU, _UNKNOWN_MU = 1e5, 1e-3


def sufficient_doublings(max_tau: float, min_mu: float, num_streams: int) -> int:
    """Smallest offered number of doublings that is exact for layers up to `max_tau`.

    Parameters
    ----------
    max_tau
        Largest (delta-M scaled or not) optical depth of a single layer. [-]
    min_mu
        Smallest cosine of the sun's and the view's zenith angle. [-]
    num_streams
        Number of streams; their smallest cosine counts as well.
    """
    z = max_tau / (2 * min(min_mu, double_gauss(num_streams)[0][0]))
    for doublings in _BUCKETS:
        reach = _REACH[doublings] if doublings < 5 else _REACH[4] * 4.0 ** (doublings - 4)
        if z <= reach:
            return doublings
    excess = int(np.ceil(np.log(z / _REACH[4]) / np.log(4)))
    return 4 + excess


def unknown_doublings(num_streams: int) -> int:
    """Doublings for layers that nobody knows yet: enough for tau = 1e5 at a cosine of 1e-3."""
    return sufficient_doublings(_UNKNOWN_TAU, _UNKNOWN_MU, num_streams)
