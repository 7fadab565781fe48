"""Directions of the streams."""

from functools import lru_cache

import numpy as np


@lru_cache
def double_gauss(num_streams: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on (0, 1), one set for each hemisphere.

    Parameters
    ----------
    num_streams
        Number of streams in both hemispheres together, even.

    Returns
    -------
    Cosines and weights of one hemisphere, ``num_streams / 2`` of each, float64; the weights sum
    to 1. [-]

    Raises
    ------
    ValueError
        If `num_streams` is odd or below 2.

    References
    ----------
    .. [1] J. B. Sykes, "Approximate integration of the equation of transfer", Mon. Not. R. Astron.
       Soc., 111, 377-386, 1951, doi:10.1093/mnras/111.4.377
    """
    if num_streams < 2 or num_streams % 2:
        raise ValueError(f"num_streams must be even and at least 2; got {num_streams}.")
    nodes, weights = np.polynomial.legendre.leggauss(num_streams // 2)
    return (nodes + 1) / 2, weights / 2
