r"""The map on which a WRF grid is a rectangle, as CF's coordinates x and y and their grid mapping.

With R the radius of WRF's spherical earth, :math:`\lambda` the longitude less that of the map's
middle (STAND_LON), :math:`\phi` the latitude and :math:`\phi_1, \phi_2` those at which the map is
true (TRUELAT1, TRUELAT2), the maps by MAP_PROJ are [1]_

- 1, Lambert's conformal cone: :math:`x = \rho \sin n\lambda,\; y = \rho_0 - \rho \cos n\lambda`
  with :math:`\rho = R F \tan^{-n}(\pi/4 + \phi/2)`, Eqs. (15-1) to (15-3), and
  :math:`n = \sin\phi_1` where there is a single true latitude;
- 2, polar stereographic: :math:`\rho = R (1 + \sin\phi_1) \tan(\pi/4 - \phi/2)` about the north
  pole, Eqs. (21-5) and (21-6), and mirrored about the south pole;
- 3, Mercator: :math:`x = R \cos\phi_1 \lambda,\; y = R \cos\phi_1 \mathrm{artanh} \sin\phi`, Eqs.
  (7-1) and (7-2);
- 6, latitude and longitude themselves.

References
----------
.. [1] J. P. Snyder, "Map projections: a working manual", U.S. Geological Survey Professional Paper
   1395, 1987, doi:10.3133/pp1395
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

# WRF's earth is a sphere of this radius. [m] (EARTH_RADIUS_M of WPS, constants_module.F, and WRF,
# module_llxy.F; with it the columns of real files are DX apart)
_RADIUS = 6.370e6

_ATTRIBUTES = ("MAP_PROJ", "TRUELAT1", "TRUELAT2", "STAND_LON", "MOAD_CEN_LAT", "CEN_LAT")
_POLE = "POLE_LAT"
_LAMBERT, _POLAR, _MERCATOR, _DEGREES = 1, 2, 3, 6
# WRF takes true latitudes that are closer for one. [degree] (module_llxy.F, set_lc)
_ONE_TRUE_LATITUDE = 0.1
# Largest distance of a column from where a regular grid has it, in spacings: positions are float32.
_OFF_GRID = 0.05


def projection_attributes(attributes: Mapping[str, Any]) -> dict[str, float]:
    """Those global attributes of a WRF file that tell of its map."""
    return {name: float(attributes[name]) for name in (*_ATTRIBUTES, _POLE) if name in attributes}


def projected(place: xr.Dataset) -> xr.Dataset | None:
    """Coordinates on the model's map, evenly spaced, and the map itself.

    Parameters
    ----------
    place
        Positions and attributes of the file, as `wrf_coordinates` returns them.

    Returns
    -------
    xarray.Dataset or None
        Coordinates ``x`` and ``y`` [m], or of MAP_PROJ 6 [degree], and ``crs``, a number without
        meaning whose attributes are CF's grid mapping. None where the file names none of these maps
        or its latitudes and longitudes are no regular grid on it (a moved pole, a file that was
        interpolated to another grid).
    """
    known = place.attrs
    number = int(known.get("MAP_PROJ", 0))
    if number not in _MAPS or known.get(_POLE, 90.0) != 90.0:
        return None
    needed = () if number == _DEGREES else ("TRUELAT1", "STAND_LON")
    if any(name not in known for name in needed):
        return None
    project, words = _MAPS[number]
    x, y, mapping = project(place["latitude"].values, _continuous(place), known)
    axes = {"x": _axis(x), "y": _axis(y.T)}
    if any(axis is None for axis in axes.values()):
        return None
    coordinates = {
        axis: (axis, values, {"axis": axis.upper(), "long_name": _LONG_NAME, **words[axis]})
        for axis, values in axes.items()
    }
    about = {"long_name": "map of the model", **mapping, "earth_radius": _RADIUS}
    return xr.Dataset(coords=coordinates | {"crs": ((), np.int32(0), about)})


def _continuous(place: xr.Dataset) -> np.ndarray:
    """Longitudes (y, x) that do not jump at the date line, within 180 of the grid's middle."""
    longitude = place["longitude"].values
    middle = longitude[tuple(size // 2 for size in longitude.shape)]
    return middle + _wrapped(longitude - middle)


def _wrapped(degrees: Any) -> Any:
    return (degrees + 180.0) % 360.0 - 180.0


def _axis(values: np.ndarray) -> np.ndarray | None:
    """The evenly spaced values that all rows of (others, along) share, or None."""
    along = values.mean(axis=0)
    index = np.arange(along.size)
    if along.size > 1:
        slope, first = np.polyfit(index, along, 1)
        along = first + slope * index
    else:
        slope = np.inf
    regular = np.abs(values - along).max() <= _OFF_GRID * abs(slope)
    return along if regular and slope > 0 else None


def _offsets(longitude: np.ndarray, known: Mapping[str, float]) -> np.ndarray:
    """Longitudes from the map's middle, continuous. [rad]"""
    middle = longitude[tuple(size // 2 for size in longitude.shape)]
    return np.radians(longitude - middle + _wrapped(middle - known["STAND_LON"]))


def _lambert(latitude: np.ndarray, longitude: np.ndarray, known: Mapping[str, float]) -> Any:
    first, second = known["TRUELAT1"], known.get("TRUELAT2", known["TRUELAT1"])
    single = abs(first - second) <= _ONE_TRUE_LATITUDE
    origin = known.get("MOAD_CEN_LAT", known.get("CEN_LAT", first))
    cone = np.sin(np.radians(first))
    if not single:
        cosines = np.cos(np.radians([first, second]))
        cone = np.log(cosines[0] / cosines[1]) / np.log(_tangent(second) / _tangent(first))
    scale = _RADIUS * np.cos(np.radians(first)) * _tangent(first) ** cone / cone
    angle = cone * _offsets(longitude, known)
    distance = scale / _tangent(latitude) ** cone
    mapping = {
        "grid_mapping_name": "lambert_conformal_conic",
        # Of a single one PROJ takes the map's origin to be there, where it need not be.
        "standard_parallel": np.array([first, first if single else second]),
        "longitude_of_central_meridian": known["STAND_LON"],
        "latitude_of_projection_origin": origin,
    }
    height = scale / _tangent(origin) ** cone - distance * np.cos(angle)
    return distance * np.sin(angle), height, mapping | _NO_SHIFT


def _polar(latitude: np.ndarray, longitude: np.ndarray, known: Mapping[str, float]) -> Any:
    side = 1.0 if known["TRUELAT1"] >= 0 else -1.0
    scale = _RADIUS * (1 + np.sin(np.radians(abs(known["TRUELAT1"]))))
    distance, angle = scale / _tangent(side * latitude), _offsets(longitude, known)
    mapping = {
        "grid_mapping_name": "polar_stereographic",
        "standard_parallel": known["TRUELAT1"],
        "straight_vertical_longitude_from_pole": known["STAND_LON"],
        "latitude_of_projection_origin": 90.0 * side,
    }
    return distance * np.sin(angle), -side * distance * np.cos(angle), mapping | _NO_SHIFT


def _mercator(latitude: np.ndarray, longitude: np.ndarray, known: Mapping[str, float]) -> Any:
    scale = _RADIUS * np.cos(np.radians(known["TRUELAT1"]))
    mapping = {
        "grid_mapping_name": "mercator",
        "standard_parallel": known["TRUELAT1"],
        "longitude_of_projection_origin": known["STAND_LON"],
    }
    north = scale * np.arctanh(np.sin(np.radians(latitude)))
    return scale * _offsets(longitude, known), north, mapping | _NO_SHIFT


def _degrees(latitude: np.ndarray, longitude: np.ndarray, known: Mapping[str, float]) -> Any:
    return longitude, latitude, {"grid_mapping_name": "latitude_longitude"}


def _tangent(latitude: Any) -> Any:
    """tan(pi/4 + latitude/2)."""
    return np.tan(np.radians(45.0 + np.asarray(latitude, np.float64) / 2))


_NO_SHIFT = {"false_easting": 0.0, "false_northing": 0.0}
_LONG_NAME = "coordinate of the model's grid on its map"
_METRES = {
    axis: {"units": "m", "standard_name": f"projection_{axis}_coordinate"} for axis in ("x", "y")
}
# Without standard names: CF wants one longitude and one latitude, and the positions have them.
_DEGREES_EAST_NORTH = {"x": {"units": "degrees_east"}, "y": {"units": "degrees_north"}}
_MAPS = {
    _LAMBERT: (_lambert, _METRES),
    _POLAR: (_polar, _METRES),
    _MERCATOR: (_mercator, _METRES),
    _DEGREES: (_degrees, _DEGREES_EAST_NORTH),
}
