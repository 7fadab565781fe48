"""From the pixels of an observation to those of a scene: the same ones, or the nearest."""

import numpy as np
import scipy.spatial
import xarray as xr

from abi_operator.files import InputError

EARTH_RADIUS_KM = 6371.0
"""Mean radius of the Earth, as of a sphere; (IUGG 1980: 6371.0). [km]"""
SAME = 0.1
"""Distance, in grid spacings of the scene, up to which two pixels are at one place. [-]"""


def placed(
    latitude: np.ndarray,
    longitude: np.ndarray,
    image: xr.Dataset,
    nearest_km: float | None,
    path: object,
) -> tuple[np.ndarray, np.ndarray]:
    """Index of the observed pixel, of all in a row, for each pixel of a scene (y, x); -1 for none.

    Beside it (y, x) how far that pixel is away, as a chord on a sphere of radius 1. [-]

    Parameters
    ----------
    latitude, longitude
        Of the observed pixels (row, column). [degree]
    image
        The scene.
    nearest_km
        How far the nearest pixel may be; None where grids have to be the same. [km]
    path
        The observation's file, for what is said of it.

    Raises
    ------
    InputError
        Where the grids differ and no distance is given, or none of the scene is observed.
    """
    own = image["latitude"].values, image["longitude"].values
    if nearest_km is None:
        _check_same(latitude, longitude, own, path)
        return np.arange(latitude.size).reshape(latitude.shape), np.zeros(latitude.shape)
    if not nearest_km > 0:
        raise InputError(f"the nearest pixel is some km away, above 0; got {nearest_km:g}.")
    fine = np.isfinite(latitude) & np.isfinite(longitude)
    if not fine.any():
        raise InputError(f"{path} has no finite latitude and longitude.")
    tree = scipy.spatial.KDTree(_unit(latitude[fine], longitude[fine]))
    apart, index = tree.query(_unit(*own), distance_upper_bound=_chord(nearest_km))
    found = np.where(index < tree.n, np.flatnonzero(fine)[np.minimum(index, tree.n - 1)], -1)
    if not (found >= 0).any():
        raise InputError(f"no pixel of {path} is within {nearest_km:g} km of the scene.")
    return found, apart


def once_each(index: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """Indices of observed pixels (y, x) of which none is there twice; the others become -1.

    What was observed once is one measurement with one error, however fine the scene is. Of the
    scene's pixels that have the same observed one the nearest keeps it, and of several that are
    as near the first.

    Parameters
    ----------
    index
        Observed pixel for each pixel of a scene (y, x), -1 for none.
    apart
        Distance between both, in any unit.
    """
    row = index.ravel()
    nearest_first = np.argsort(apart.ravel(), kind="stable")
    _, first = np.unique(row[nearest_first], return_index=True)
    kept = np.full_like(row, -1)
    chosen = nearest_first[first]
    kept[chosen] = row[chosen]
    return kept.reshape(index.shape)


def spacing_km(latitude: np.ndarray, longitude: np.ndarray) -> float:
    """Median distance of neighbours in a row of a grid, or in a column where rows are of one pixel.

    Of a single pixel it is 0. [km]
    """
    points = _unit(latitude, longitude)
    axis = 1 if latitude.shape[1] > 1 else 0
    apart = np.linalg.norm(np.diff(points, axis=axis), axis=-1)
    return float(np.median(2 * np.arcsin(apart / 2))) * EARTH_RADIUS_KM if apart.size else 0.0


def _check_same(
    latitude: np.ndarray,
    longitude: np.ndarray,
    own: tuple[np.ndarray, np.ndarray],
    path: object,
) -> None:
    advice = "regrid it, or take the nearest of its pixels with --nearest KM"
    if latitude.shape != own[0].shape:
        raise InputError(
            f"{path} has {latitude.shape[0]} x {latitude.shape[1]} pixels and the scene "
            f"{own[0].shape[0]} x {own[0].shape[1]}; {advice}."
        )
    chord = np.linalg.norm(_unit(latitude, longitude) - _unit(*own), axis=-1)
    apart = 2 * np.arcsin(np.minimum(chord / 2, 1)) * EARTH_RADIUS_KM
    largest = float(np.max(apart)) if np.isfinite(apart).all() else np.inf
    if not largest <= SAME * spacing_km(*own):
        raise InputError(
            f"pixels of {path} are up to {largest:.3g} km away from those of the scene, which are "
            f"{spacing_km(*own):.3g} km apart; {advice}."
        )


def _unit(latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    """Places on a sphere of radius 1, (*shape, 3)."""
    phi, lam = np.radians(latitude), np.radians(longitude)
    return np.stack([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)], -1)


def _chord(distance_km: float) -> float:
    return 2 * np.sin(min(distance_km / EARTH_RADIUS_KM, np.pi) / 2)
