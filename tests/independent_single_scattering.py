"""Light scattered once, in NumPy: what Nakajima and Tanaka (1988) put in for what streams make."""

import numpy as np


def cos_scattering(mu0, mu, relative_azimuth):
    """Cosine of the scattering angle; azimuth 0 with sun and satellite on the same side. [-]"""
    return -mu0 * mu - np.sqrt((1 - mu0**2) * (1 - mu**2)) * np.cos(relative_azimuth)


def correction(tau, ssa, moments, phase, mu0, mu, relative_azimuth, num_streams):
    """Exact single scattering less that of the truncated phase functions, as a BRF. [-]

    Parameters
    ----------
    tau, ssa, moments
        Of the layers, top first; moments (layer, moment) without 2l + 1. [-]
    phase
        Phase function of each layer at the scattering angle, mean 1 over the sphere. [-]
    mu0, mu, relative_azimuth
        Directions. [-], [-], [rad]
    num_streams
        At which the phase functions are truncated by delta-M.
    """
    peak = moments[:, num_streams]
    degrees = 2 * np.arange(num_streams) + 1
    kept = (moments[:, :num_streams] - peak[:, None]) * degrees
    cosine = cos_scattering(mu0, mu, relative_azimuth)
    truncated = np.array([np.polynomial.legendre.legval(cosine, k) for k in kept])
    scaled = (1 - ssa * peak) * tau
    slant = scaled * (1 / mu + 1 / mu0)
    above = np.concatenate([[0.0], np.cumsum(slant)[:-1]])
    source = ssa / (1 - ssa * peak) * (phase - truncated)
    return np.sum(source * np.exp(-above) * -np.expm1(-slant)) / (4 * (mu + mu0))
