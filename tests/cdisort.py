"""CDISORT, by way of `nanodisort`, in this project's conventions."""

import nanodisort
import numpy as np

MAX_ABSORPTION_DEPTH = 10.0
"""Absorption depth below which CDISORT cuts a column off."""


def cdisort_brf(tau, ssa, moments, albedo, mu0, mu, relative_azimuth, num_streams, corrected):
    """Bidirectional reflectance factor of one column.

    `moments` has axes ``layer moment``, without the factor 2l + 1; `corrected` adds the single
    scattering of Nakajima and Tanaka. CDISORT's azimuth is 0 in the forward direction.
    """
    state = nanodisort.DisortState()
    state.nstr, state.nlyr, state.nmom = num_streams, len(tau), moments.shape[1] - 1
    state.ntau = state.numu = state.nphi = 1
    state.usrtau = state.usrang = state.lamber = state.quiet = True
    state.intensity_correction = state.old_intensity_correction = corrected
    state.allocate()
    state.dtauc, state.ssalb = np.ascontiguousarray(tau), np.ascontiguousarray(ssa)
    state.pmom = np.ascontiguousarray(moments.T)
    state.utau, state.umu = np.zeros(1), np.array([mu])
    state.phi = np.array([180 - np.degrees(relative_azimuth)])
    state.fbeam, state.umu0, state.phi0, state.albedo, state.accur = 1.0, mu0, 0.0, albedo, 0.0
    state.solve()
    return np.pi * state.uu[0, 0, 0] / mu0


def cut(tau, ssa):
    """End a column just above the depth at which CDISORT would; returns its tau and whether cut."""
    absorption = np.cumsum((1 - ssa) * tau)
    limit = 0.999 * MAX_ABSORPTION_DEPTH
    if absorption[-1] < limit:
        return tau, False
    last = int(np.argmax(absorption >= limit))
    shortened = np.zeros_like(tau)
    shortened[: last + 1] = tau[: last + 1]
    shortened[last] -= (absorption[last] - limit) / (1 - ssa[last])
    return shortened, True
