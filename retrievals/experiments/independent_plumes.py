"""Plumes whose truth the inversion does not share.

The truth has the phase functions of Mie theory, particles of another size in every pixel, a plume
0.5 km higher than is believed, and strips of different optical depth and albedo. The inversion has
the phase function of Henyey and Greenstein, particles of one size and one column.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import scipy

from abi_operator import MiePlume, Plume, State
from abi_operator.optics import mie_optics

from ..declarations import plume
from ..kinds import BANDS
from ..prior import Prior
from ..state_vector import StateVector
from . import scenes
from .independent_case import RAISED, STRIPS, UNEVEN_GROUND, Case, Drawn, Reported, uneven

MEAN_AOD, SIGMAS = 0.4, (0.7, 0.3)
"""Of the prior: optical depth, and x. [-]"""
RADII_UM = {"smoke": (0.12, 0.17), "ash": (2.0, 4.5), "dust": (1.0, 2.2)}
"""That the truth is drawn from. [um]"""

_ALBEDO = (0.02, 0.25)
_UNEVEN_PLUME = 0.3  # relative standard deviation among the strips


def independent_plume(species: str) -> Case:
    """Optical depth and single-scattering albedo of a plume from C01 C02 C03."""
    vector = plume(species, ssa=True)
    return Case(
        BANDS,
        (),
        vector,
        Prior(np.asarray(vector.x(MEAN_AOD, 0.0)), np.diag(np.square(SIGMAS))),
        (f"{species} aod_550", f"{species} ssa C02"),
        partial(_drawn, vector, species),
        partial(_reported, vector, species),
    )


def _drawn(vector: StateVector, species: str, rng: np.random.Generator, num_pixels: int) -> Drawn:
    n = num_pixels
    aod = MEAN_AOD * np.exp(SIGMAS[0] * rng.standard_normal(n))
    smallest, largest = np.log(RADII_UM[species])
    radius = np.exp(rng.uniform(smallest, largest, n))
    albedo = rng.uniform(*_ALBEDO, (n, len(BANDS)))
    geometry = scenes.random_directions(rng, n)
    of_plume = uneven(rng, n, _UNEVEN_PLUME)
    of_ground = uneven(rng, n, UNEVEN_GROUND)
    base = np.full(n * STRIPS, scenes.BASE[species] + RAISED)
    mie = MiePlume(
        base=jnp.asarray(base),
        top=jnp.asarray(base + scenes.THICKNESS),
        extinction_550=jnp.asarray((aod[:, None] * of_plume).ravel() / scenes.THICKNESS),
        brightness=jnp.ones(n * STRIPS),
        effective_radius_um=jnp.repeat(jnp.asarray(radius), STRIPS),
        species=species,
    )
    cells = State(
        scenes.clear_air(n * STRIPS, {species: mie}),
        {b: jnp.asarray((albedo[:, i, None] * of_ground).ravel()) for i, b in enumerate(BANDS)},
        jax.tree.map(lambda angle: jnp.repeat(angle, STRIPS), geometry),
    )
    known = scenes.known_plume(species, n, BANDS)
    air = scenes.clear_air(n, {species: known})
    believed = scenes.with_albedo(State(air, {}, geometry), albedo, BANDS)
    spheres = [mie_optics(species, jnp.asarray(radius), band) for band in BANDS]
    ssa = np.stack([1 - np.asarray(s.coalbedo) for s in spheres], axis=-1)
    # The shift of the logit of the believed ssa that is nearest to the truth in all bands.
    assumed = np.stack([np.asarray(known.ssa[band]) for band in BANDS], axis=-1)
    shift = np.mean(scipy.special.logit(ssa) - scipy.special.logit(assumed), axis=-1)
    x = np.asarray(vector.x(jnp.asarray(aod), jnp.asarray(shift)))
    return Drawn(cells, believed, x, np.stack([aod, ssa[:, BANDS.index("C02")]]))


def _reported(
    vector: StateVector, species: str, x: np.ndarray, covariance: np.ndarray, believed: State
) -> Reported:
    """Optical depth and ssa in C02."""
    values = vector.values(jnp.asarray(x))
    known = believed.atmosphere.plumes[species]
    assert isinstance(known, Plume)
    logit = scipy.special.logit(np.asarray(known.ssa["C02"]))
    ssa = scipy.special.expit(logit + np.asarray(values["ssa_shift"]))
    variance = np.diagonal(covariance, axis1=-2, axis2=-1)
    of_aod, of_shift = (np.asarray(vector.slopes(jnp.asarray(x))) * np.sqrt(variance)).T
    found = np.stack([np.asarray(values["aod_550"]), ssa])
    return found, np.stack([of_aod, ssa * (1 - ssa) * of_shift])
