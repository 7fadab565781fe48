"""Phase functions of the package's Mie tables, read anew from the files.

A table is data: moments and logarithms of P in integers of 16 bits, so that what Mie theory itself
gives differs from them in the sixth digit. Here they are unpacked by SciPy and P is interpolated
in angle by its splines, at radii that are nodes of the table or between them by the cubics that
the package states.
"""

import functools
from importlib.resources import files

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.io import netcdf_file

FILES = ("aerosol_mie.nc", "droplet_mie.nc")
MANY = 400  # as many moments as the other phase functions have


@functools.cache
def _files():
    """Variables of each file by name."""
    folder = files("abi_operator.optics") / "tables"
    found = {}
    for name in FILES:
        with netcdf_file(str(folder / name), mmap=False) as file:
            found[name] = {key: variable[:].copy() for key, variable in file.variables.items()}
    return found


def _words(characters):
    return [b"".join(row).decode().strip() for row in characters]


def table(material, band):
    """Variables of a material in a band, unpacked, and the radii of its table. [um]"""
    for variables in _files().values():
        names, bands = (_words(variables[f"{x}_name"]) for x in ("species", "band"))
        if material in names:
            i, j = names.index(material), bands.index(band)
            own = {key: x[i, j] for key, x in variables.items() if x.ndim > 2}
            for key in ("moments", "log_phase_function"):
                scale, offset = (own[f"{key}_{x}"].astype(float) for x in ("scale", "offset"))
                own[key] = own[key] * scale[:, None] + offset[:, None]
            own["moments"][0], own["moments"][1] = 1.0, own["asymmetry"]
            own["coordinate_offset"] = variables["coordinate_offset"]
            return own, variables["effective_radius_um"][i]
    raise ValueError(f"no table of {material!r}.")


def _phase_function(own, log_phase):
    """Phase function of a cosine, from its logarithm at the nodes of the table."""
    spline = CubicSpline(own["coordinate"], log_phase)
    backward, forward = own["coordinate_offset"]

    def value(cosine):
        return np.exp(spline(np.log((1 + cosine + backward) / (1 - cosine + forward))))

    return value


def phase(material, node, band):
    """Moments, padded by zeros, and phase function at a radius of the table, by its number."""
    own, _ = table(material, band)
    moments = np.zeros(MANY)
    moments[: len(own["moments"])] = own["moments"][:, node]
    return moments, _phase_function(own, own["log_phase_function"][:, node])


def between(material, radius_um, band):
    """Extinction, 1 - ssa, moments and phase function at any radius inside the table.

    Cubics in the logarithm of radius, with the slopes of the quartic through five radii.
    """
    own, radii = table(material, band)
    rows = np.concatenate(
        [
            np.log([own["extinction"], own["coalbedo"]]),
            own["moments"],
            own["log_phase_function"],
        ]
    )
    step = np.log(radii[-1] / radii[0]) / (radii.size - 1)
    x = np.log(radius_um / radii[0]) / step
    if not 2 <= x <= radii.size - 3:
        raise ValueError(f"radius of {radius_um:g} um is at the ends of the table.")
    near = int(x) - 2 + np.arange(6)
    f = rows[:, near]
    slopes = (f[:, 0:2] - 8 * f[:, 1:3] + 8 * f[:, 3:5] - f[:, 4:6]) / 12
    value = CubicHermiteSpline([0, 1], f[:, 2:4], slopes, axis=1)(x - int(x))
    count = len(own["moments"])
    moments = np.zeros(MANY)
    moments[:count] = value[2 : 2 + count]
    return *np.exp(value[:2]), moments, _phase_function(own, value[2 + count :])
