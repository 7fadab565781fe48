"""The file of a retrieval, read back as it is scored."""

from os import PathLike

import numpy as np
import xarray as xr

from abi_operator.files import InputError
from abi_operator.files.netcdf import load_all, open_netcdf, require_values

from .declarations import AOD_LIMIT
from .kinds import KINDS, vector_of
from .results import ResultCode
from .scoring.held import SHARES
from .transforms import Bounded

_ADVICE = "give a file that a retrieval wrote"


def read_retrieval(path: str | PathLike[str]) -> xr.Dataset:
    """Read a retrieval into memory, and see that it is one.

    Parameters
    ----------
    path
        A file that the command ``retrieve`` wrote.

    Returns
    -------
    xarray.Dataset
        As of `retrieve_kind`; where the code is a success, its quantities are within their limits.

    Raises
    ------
    InputError
        Where the file cannot be read or is no retrieval, or a success has values that none has.
    """
    with open_netcdf(path, advice=_ADVICE) as file:
        if "result_code" not in file:
            raise InputError(f"{path} has no result_code; {_ADVICE}.")
        require_values(file["result_code"], path)
        retrieval = load_all(file, path)
    _check_names(retrieval, path)
    success = retrieval["result_code"].values == ResultCode.SUCCESS
    for name, (lowest, highest) in _limits(retrieval, path).items():
        if name not in retrieval:
            continue
        for variable, low, high in ((name, lowest, highest), (f"{name}_sigma", 0.0, np.inf)):
            values = _image(retrieval, variable, path)[success]
            wrong = ~(np.isfinite(values) & (values >= low) & (values <= high))
            if wrong.any():
                raise InputError(
                    f"{variable} in {path} is {values[wrong][0]:g} at {np.count_nonzero(wrong)} of "
                    f"{wrong.size} pixels whose result_code is success, where {low:g} to {high:g} "
                    f"is possible; {_ADVICE}."
                )
    return retrieval


def _check_names(retrieval: xr.Dataset, path: object) -> None:
    """Refuse a file that does not say of which bands it is, or has one bound without the other."""
    bands = str(retrieval.attrs.get("bands", "")).split()
    held = retrieval["band"].values.astype(str).tolist() if "band" in retrieval.coords else bands
    if not bands or not set(bands) <= set(held):
        raise InputError(f"{path} does not tell of its bands ({' '.join(bands)}); {_ADVICE}.")
    for label in map(str, retrieval.data_vars):
        if not label.endswith("_lower_68"):
            continue
        name = label.removesuffix("_lower_68")
        for share in SHARES:
            for side in ("lower", "upper"):
                _image(retrieval, f"{name}_{side}_{share}", path)


def _image(retrieval: xr.Dataset, name: str, path: object) -> np.ndarray:
    """Values of a variable that lies where the codes do."""
    codes = retrieval["result_code"]
    if name not in retrieval:
        raise InputError(f"{path} has no {name}; {_ADVICE}.")
    array = retrieval[name]
    if array.shape != codes.shape or array.dtype.kind != "f":
        raise InputError(
            f"{name} in {path} is {array.dtype} {array.shape} where the codes have the shape "
            f"{codes.shape}; {_ADVICE}."
        )
    return array.values


def _limits(retrieval: xr.Dataset, path: object) -> dict[str, tuple[float, float]]:
    """Limits of the quantities that a retrieval of its kind may have."""
    kind = str(retrieval.attrs.get("kind", "smoke"))
    if kind not in KINDS:
        raise InputError(f"{path} is a retrieval of {kind!r}, which is none; {_ADVICE}.")
    of_plume = KINDS[kind].species is not None
    try:
        limit = float(retrieval.attrs.get("aod_limit", AOD_LIMIT))
        vector = vector_of(kind, of_plume, of_plume, limit)
    except (TypeError, ValueError) as error:
        raise InputError(f"aod_limit in {path} is no limit ({error}); {_ADVICE}.") from error
    everything = (-np.inf, np.inf)
    return {
        quantity.name: (quantity.transform.lower, quantity.transform.upper)
        if isinstance(quantity.transform, Bounded)
        else everything
        for quantity in vector.quantities
    }
