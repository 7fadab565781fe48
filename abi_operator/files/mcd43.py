"""MODIS albedo, MCD43A1, as the AppEEARS service of the LP DAAC delivers it in NetCDF."""

import warnings
from collections.abc import Callable, Sequence

import numpy as np
import xarray as xr

from ..bands import check_bands
from ..surface.modis_to_abi import MODIS_TO_ABI, BandRegression
from ..surface.ross_li import WHITE_SKY
from .errors import InputError
from .mcd43_layers import ADVICE, GRID, NO_INVERSION, PARAMETERS, Layers, check_grid, read_layers
from .netcdf import FilePath, cf_attributes, open_netcdf

BROADBAND_STAND_IN: dict[str, str] = {"C01": "vis", "green": "vis", "C02": "vis", "C03": "nir"}
"""Broadband that may stand in for an ABI band where a file has no spectral bands."""

KERNELS = {"volume_kernel_weight": 1, "geometric_kernel_weight": 2}
"""Weights of kernels that are not constant: ours, and their place in the file."""

# Regressions have constants, and dark ground may fall below 0 by them: down to here, two standard
# errors of the one for C06 and five of that for C05, it is black. [-]
_LOWEST_BLACK = -0.005
_QUALITY_ATTRIBUTES = {
    "flag_values": np.array([0, 1, NO_INVERSION], np.uint8),
    "flag_meanings": "full_inversion magnitude_inversion no_inversion",
}


def read_white_sky(path: FilePath, modis_bands: Sequence[str]) -> xr.Dataset:
    """Read white-sky albedo in bands of MODIS itself from an AppEEARS file of MCD43A1.

    Parameters
    ----------
    path
        The file.
    modis_bands
        ``"Band1"`` to ``"Band7"``, ``"vis"``, ``"nir"`` or ``"shortwave"``.

    Returns
    -------
    xarray.Dataset
        ``white_sky_albedo`` (modis_band, time, lat, lon) [-], f_iso + 0.189184 f_vol - 1.377622
        f_geo, NaN where the file has none, and ``albedo_quality``, the mandatory quality, if the
        file has that of all of these bands.

    Raises
    ------
    InputError
        Where the file cannot be read or lacks one of the bands.
    """
    with open_netcdf(path, advice=ADVICE) as file:
        check_grid(file, path)
        lacking = [PARAMETERS + name for name in modis_bands if PARAMETERS + name not in file]
        if lacking:
            raise InputError(f"{path} has no {', '.join(lacking)}; request them from AppEEARS.")
        layers = read_layers(file, tuple(modis_bands), path)
    white_sky = _white_sky(layers)
    dims = ("modis_band", *GRID)
    attributes = {
        "units": "1",
        "long_name": "white-sky albedo of the ground",
        "num_outside_valid_range": layers.num_invalid,
    }
    fields = {"white_sky_albedo": (dims, np.stack([white_sky[n] for n in modis_bands]), attributes)}
    if set(modis_bands) <= set(layers.quality):
        worst = np.stack([layers.quality[n] for n in modis_bands])
        fields["albedo_quality"] = (dims, worst, _QUALITY_ATTRIBUTES)
    return xr.Dataset(
        fields,
        coords={"modis_band": list(modis_bands), **layers.coordinates},
    )


def read_mcd43a1(
    path: FilePath,
    bands: Sequence[str],
    *,
    broadband: bool = False,
    kernels: bool = False,
    times: np.ndarray | None = None,
) -> xr.Dataset:
    """Read white-sky albedo in bands of ABI from an AppEEARS file of MCD43A1.

    White-sky albedo of a MODIS band is f_iso + 0.189184 f_vol - 1.377622 f_geo; that of an ABI
    band is a regression on one or two of them, `surface.MODIS_TO_ABI`.

    Parameters
    ----------
    path
        The file.
    bands
        Bands of ABI, such as ``"C01"``.
    kernels
        Whether the weights of the volume and the geometric kernel are returned, too; that of the
        constant one follows from them and the albedo.
    broadband
        Whether a broadband (vis, nir) may stand in for spectral bands that the file lacks; each
        such band is warned of.
    times
        Times of a scene (time,), UTC: only the dates that they have, the nearest to each
        (`nearest_date`), are read; None for all dates of the file.

    Returns
    -------
    xarray.Dataset
        ``surface_albedo`` (band, time, lat, lon) [-], NaN where the file has none; attributes
        count valid inversions that were held at 0 because the regression gave -0.005 or more, but
        less than 0 (``num_held_at_zero``), that were made NaN because it gave what else is outside
        0..1 (``num_outside_unit_interval``), and kernel weights outside the file's valid range
        (``num_outside_valid_range``). ``albedo_quality``, same dimensions, uint8: the worst
        mandatory quality among the MODIS bands used; 0 full inversion, 1 magnitude inversion, 255
        none; it is there if the file has that of all of them, and albedo of any quality is taken.
        ``volume_kernel_weight`` and ``geometric_kernel_weight``, likewise, of `kernels`: by
        the same regression without its constant, NaN where the albedo is. The order of ``lat`` is
        the file's.
    """
    bands = check_bands(bands, MODIS_TO_ABI)
    with open_netcdf(path, advice=ADVICE) as file:
        check_grid(file, path)
        regressions = _choose_regressions(file, bands, broadband, path)
        used = tuple(dict.fromkeys(name for r in regressions for name in r.weights))
        layers = read_layers(file, used, path, times)
    albedo, outside = _albedo(layers, regressions, bands)
    fields = {"surface_albedo": albedo}
    if set(used) <= set(layers.quality):
        fields["albedo_quality"] = _worst_quality(layers, regressions)
    for name, kernel in KERNELS.items() if kernels else ():
        weights = {n: x[..., kernel] for n, x in layers.weights.items()}
        values = np.stack([_weighted(r, weights.__getitem__) for r in regressions])
        values[outside] = np.nan
        fields[name] = (("band", *GRID), values, cf_attributes(name))
    return xr.Dataset(
        fields,
        coords={"band": list(bands), **layers.coordinates},
        attrs={key: file.attrs[key] for key in ("title", "source") if key in file.attrs},
    )


def _white_sky(layers: Layers) -> dict[str, np.ndarray]:
    """White-sky albedo of bands of MODIS. [-]"""
    return {name: x @ np.array(WHITE_SKY) for name, x in layers.weights.items()}


def _weighted(regression: BandRegression, of: Callable[[str], np.ndarray]) -> np.ndarray:
    """A regression's sum over bands of MODIS, without its constant."""
    return sum((w * of(name) for name, w in regression.weights.items()), np.zeros(()))


def _albedo(
    layers: Layers, regressions: list[BandRegression], bands: tuple[str, ...]
) -> tuple[tuple, np.ndarray]:
    """Albedo of ABI bands as a variable, and where (band, time, lat, lon) it was made NaN."""
    white_sky = _white_sky(layers)
    albedo = np.stack([r.offset + _weighted(r, white_sky.__getitem__) for r in regressions])
    held = (albedo >= _LOWEST_BLACK) & (albedo < 0)
    albedo[held] = 0.0
    outside = (albedo < 0) | (albedo > 1)
    albedo[outside] = np.nan
    attributes = cf_attributes("surface_albedo") | {
        "num_held_at_zero": int(held.sum()),
        "num_outside_unit_interval": int(outside.sum()),
        "num_outside_valid_range": layers.num_invalid,
        "comment": "; ".join(
            f"{band} from {' and '.join(r.weights)}"
            for band, r in zip(bands, regressions, strict=True)
        ),
    }
    return (("band", *GRID), albedo, attributes), outside


def _worst_quality(layers: Layers, regressions: list[BandRegression]) -> tuple:
    """The worst quality among the bands that a regression has, as a variable."""
    worst = [np.maximum.reduce([layers.quality[n] for n in r.weights]) for r in regressions]
    attributes = _QUALITY_ATTRIBUTES | {
        "long_name": "worst mandatory quality of the MODIS bands used"
    }
    return ("band", *GRID), np.stack(worst), attributes


def _choose_regressions(
    file: xr.Dataset, bands: tuple[str, ...], broadband: bool, path: FilePath
) -> list[BandRegression]:
    """For each ABI band its regression on MODIS bands, or a broadband in their stead."""
    chosen, lacking, stand_ins = [], [], []
    for band in bands:
        regression = MODIS_TO_ABI[band]
        missing = [name for name in regression.weights if PARAMETERS + name not in file]
        stand_in = BROADBAND_STAND_IN.get(band)
        if stand_in is not None and PARAMETERS + stand_in not in file:
            stand_in = None
        if missing and broadband and stand_in is not None:
            warnings.warn(
                f"{path} has no {PARAMETERS}{missing[0]}; the albedo of {band} is that of the "
                f"broadband {stand_in}.",
                UserWarning,
                stacklevel=3,
            )
            regression = BandRegression({stand_in: 1.0}, 0.0)
        elif missing:
            lacking += missing
            stand_ins.append(stand_in)
        chosen.append(regression)
    if lacking:
        remedy = ""
        if None not in stand_ins:
            remedy = (
                f", or let its broadband albedo ({', '.join(dict.fromkeys(stand_ins))}) stand in "
                "for them: --broadband (in Python, broadband=True)"
            )
        names = ", ".join(PARAMETERS + name for name in dict.fromkeys(lacking))
        raise InputError(
            f"{path} has no {names}; request these layers of MCD43A1 from AppEEARS{remedy}."
        )
    return chosen
