"""Mie theory (miepython) of populations of spheres: what the scripts that write tables share.

Single spheres are computed once for all size distributions of a table: each is a sum over the same
spheres with other weights. Amplitudes at many angles are matrix products of miepython's
coefficients with the angular functions, which makes 1e5 spheres at 2,800 angles a matter of
minutes on one core.

A table of phase functions holds log P at nodes of the coordinate

    u = ln((1 + cos + BACKWARD) / (1 - cos + FORWARD)),

which is smooth in the cosine, ends included, and runs evenly through the logarithm of the angle
from either end, where the diffraction peak and the glory are. The nodes of a band lie so that
cubics err alike between all of them. Sums over weakly absorbing spheres catch narrow resonances at
random, which ripple P from angle to angle; the tabulated function is therefore the spline through
these nodes that is closest to the sums, not one through sums at the nodes, and the nodes are placed
on spheres that absorb a little more.

`write` gives the files this schema (classic NetCDF; names are characters padded by spaces):

| variable | axes | meaning |
| --- | --- | --- |
| species_name, band_name | species or band, character | what the other axes stand for |
| wavelength_um | band | centroid of the band [um] |
| effective_radius_um | species, radius | equidistant in its logarithm [um] |
| refractive_index_real, refractive_index_imaginary | species, band | n and k of n - ik |
| extinction | species, band, radius | as the file's comment says |
| coalbedo | species, band, radius | 1 - single-scattering albedo |
| asymmetry | species, band, radius | mean cosine of the scattering angle |
| moments | species, band, moment, radius | Legendre moments, packed |
| coordinate | species, band, angle | u of the nodes of the phase function |
| coordinate_offset | side | BACKWARD and FORWARD |
| log_phase_function | species, band, angle, radius | log P (mean 1 over the sphere), packed |

and what each script adds. Packed are integers of 16 bits, of which each row of radii has a
`..._scale` and a `..._offset`: value = integer * scale + offset.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import miepython
import numpy as np
from scipy.interpolate import CubicSpline, make_lsq_spline
from scipy.io import netcdf_file
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from abi_operator.bands import BANDS

NUM_MOMENTS = 65  # for 64 streams
FORWARD, BACKWARD = 1e-6, 1e-6
_CHUNK = 256  # spheres at a time
_PANELS, _POINTS = 560, 5  # angles at which spheres are summed: Gauss points in panels


class Population(NamedTuple):
    """Optics of size distributions in one band.

    Parameters
    ----------
    extinction, scattering
        Sums over spheres of weight times efficiency. [of the weights]
    asymmetry
        Mean cosine of the scattering angle. [-]
    moments
        Legendre moments against (moment, size distribution). [-]
    log_phase
        log P against (angle of `angles`, size distribution). [-]
    """

    extinction: np.ndarray
    scattering: np.ndarray
    asymmetry: np.ndarray
    moments: np.ndarray
    log_phase: np.ndarray


def angles() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates u of all angles, their cosines, and weights of a mean over the sphere.

    Panels share out u and the scattering angle, where the rainbows are, in equal parts.
    """
    fine = np.linspace(*coordinate(np.array([-1.0, 1.0])), 100001)
    share = (fine - fine[0]) / np.ptp(fine) + 1 - np.arccos(cosine(fine)) / np.pi
    edges = np.interp(np.linspace(0, 2, _PANELS + 1), share, fine)
    x, w = np.polynomial.legendre.leggauss(_POINTS)
    half = np.diff(edges)[:, None] / 2
    u = (edges[:-1, None] + half * (x + 1)).ravel()
    cos = cosine(u)
    weight = (half * w).ravel() / (1 / (1 + cos + BACKWARD) + 1 / (1 - cos + FORWARD)) / 2
    return u, cos, weight


def coordinate(cos: np.ndarray) -> np.ndarray:
    """Coordinate u of a cosine."""
    return np.log((1 + cos + BACKWARD) / (1 - cos + FORWARD))


def cosine(u: np.ndarray) -> np.ndarray:
    """Cosine at a coordinate u; forward of 90 degrees formed from 1 - cos."""
    ratio = np.exp(-np.abs(u))
    ahead = 1 - (ratio * (2 + BACKWARD) - FORWARD) / (1 + ratio)
    behind = (ratio * (2 + FORWARD) - BACKWARD) / (1 + ratio) - 1
    return np.clip(np.where(u > 0, ahead, behind), -1, 1)


def population(index: complex, x: np.ndarray, weights: np.ndarray) -> Population:
    """Optics of size distributions of spheres.

    Parameters
    ----------
    index
        Refractive index n - ik. [-]
    x
        Size parameters of the spheres, rising. [-]
    weights
        Geometric cross section of each sphere in each distribution, (distribution, sphere).
    """
    u, cos, measure = angles()
    q_ext, q_sca, _, g = miepython.efficiencies_mx(index, x)
    scattering = weights @ q_sca
    intensity = np.zeros((cos.size, len(weights)))
    plus, minus = _angular_functions(cos, miepython.core.wiscombe_terms(x[-1]))
    important = np.flatnonzero((weights / weights.max(axis=1, keepdims=True)).max(axis=0) > 1e-13)
    for start in range(0, important.size, _CHUNK):
        chosen = important[start : start + _CHUNK]
        intensity += (
            _intensity(index, x[chosen], plus, minus) @ (weights[:, chosen] / x[chosen] ** 2).T
        )
    phase = intensity / scattering
    moments = _legendre(cos, NUM_MOMENTS) @ (measure[:, None] * phase)
    asymmetry = weights @ (q_sca * g) / scattering
    error = max(np.abs(moments[0] - 1).max(), np.abs(moments[1] - asymmetry).max())
    if error > 3e-5:
        raise RuntimeError(f"angles too few: moments of 0 and 1 are off by {error:.1e}.")
    return Population(weights @ q_ext, scattering, asymmetry, moments / moments[0], np.log(phase))


def place_nodes(log_phase: np.ndarray, num: int, num_split: int = 0) -> np.ndarray:
    """Coordinates of `num` nodes for cubics through log P with the same error in all intervals.

    Nodes move towards intervals whose cubics err more, in the mean square of all distributions. The
    `num_split` intervals that are then the widest in angle are split, for ripples in P of weak
    absorbers.

    Parameters
    ----------
    log_phase
        log P against (angle of `angles`, size distribution), all of which share the nodes.
    num, num_split
        Number of nodes, both ends included, and of those added.
    """
    u, cos, _ = angles()
    ends = coordinate(np.array([-1.0, 1.0]))
    share = (u - ends[0]) / np.ptp(ends) + 1 - np.arccos(cos) / np.pi
    nodes = np.interp(np.linspace(0, 2, num), [0, *share, 2], [ends[0], *u, ends[1]])
    spline = CubicSpline(u, log_phase)
    best, least = nodes, np.inf
    for _ in range(60):
        error = CubicSpline(nodes, spline(nodes))(u) - log_phase
        error = np.sqrt(np.mean(error**2, axis=1))
        if error.max() < least:
            best, least = nodes, error.max()
        interval = np.clip(np.searchsorted(nodes, u) - 1, 0, num - 2)
        largest = np.full(num - 1, 1e-2 * error.max())
        np.maximum.at(largest, interval, error)
        largest = maximum_filter1d(largest, 3) ** 0.1
        density = uniform_filter1d(largest, 5) / np.diff(nodes)
        share = np.concatenate([[0], np.cumsum(density * np.diff(nodes))])
        nodes = np.interp(np.linspace(0, share[-1], num), share, nodes)
    for _ in range(num_split):
        widest = np.argmax(-np.diff(np.arccos(cosine(best))))
        best = np.insert(best, widest + 1, (best[widest] + best[widest + 1]) / 2)
    return best


def fit_nodes(log_phase: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Values at the nodes of the cubic spline through them that is closest to log P."""
    u, _, _ = angles()
    knots = np.concatenate([[nodes[0]] * 4, nodes[2:-2], [nodes[-1]] * 4])
    return make_lsq_spline(u, log_phase, knots)(nodes)


def tabulate(
    bands: Sequence[Population],
    proxies: Sequence[Population],
    num_nodes: int,
    num_split: int = 0,
) -> dict[str, np.ndarray]:
    """Variables of one species, (band, ...), from its populations in every band.

    Parameters
    ----------
    bands
        Populations at all radii.
    proxies
        Populations on which nodes are placed.
    num_nodes, num_split
        Nodes of the phase function, and of those added (`place_nodes`).
    """
    nodes = [place_nodes(proxy.log_phase, num_nodes, num_split) for proxy in proxies]
    phases = [fit_nodes(b.log_phase, at) for b, at in zip(bands, nodes, strict=True)]
    return {
        "coalbedo": np.stack([1 - b.scattering / b.extinction for b in bands]),
        "asymmetry": np.stack([b.asymmetry for b in bands]),
        "coordinate": np.stack(nodes),
        **_packed("moments", np.stack([b.moments for b in bands])),
        **_packed("log_phase_function", np.stack(phases)),
    }


_AXES = {
    "coordinate": ("angle",),
    "moments": ("moment", "radius"),
    "moments_scale": ("moment",),
    "moments_offset": ("moment",),
    "log_phase_function": ("angle", "radius"),
    "log_phase_function_scale": ("angle",),
    "log_phase_function_offset": ("angle",),
}


def write(
    path: Path,
    attributes: Mapping[str, str],
    radius_um: Mapping[str, np.ndarray],
    index: Mapping[str, Mapping[str, complex]],
    tables: Mapping[str, Mapping[str, np.ndarray]],
    extra: Mapping[str, tuple[str, tuple[str, ...], object]],
) -> None:
    """Write a file.

    Parameters
    ----------
    path, attributes
        Where, and what the file says of itself.
    radius_um, index
        By species: radii [um], refractive index by band.
    tables
        By species: extinction and what `tabulate` returns.
    extra
        Further variables by name: unit, axes, values; an axis of its own is ``"mode"``.
    """
    names = list(tables)
    indices = np.array([[index[name][band] for band in BANDS] for name in names])
    numbers: dict[str, tuple[str, tuple[str, ...], object]] = {
        "wavelength_um": ("um", ("band",), [band.wavelength_um for band in BANDS.values()]),
        "effective_radius_um": ("um", ("species", "radius"), [radius_um[n] for n in names]),
        "refractive_index_real": ("1", ("species", "band"), indices.real),
        "refractive_index_imaginary": ("1", ("species", "band"), -indices.imag),
        "coordinate_offset": ("1", ("side",), [BACKWARD, FORWARD]),
        **extra,
    }
    for name in tables[names[0]]:
        axes = ("species", "band", *_AXES.get(name, ("radius",)))
        numbers[name] = ("1", axes, np.stack([tables[n][name] for n in names]))
    with netcdf_file(path, "w", version=2) as file:
        for name, text in attributes.items():
            setattr(file, name, text)
        sizes = {"character": max(map(len, (*names, *BANDS)))}
        for _, axes, values in numbers.values():
            sizes |= dict(zip(axes, np.shape(values), strict=True))
        for name, size in sizes.items():
            file.createDimension(name, size)
        for axis, words in (("species", names), ("band", BANDS)):
            characters = np.array([list(w.ljust(sizes["character"])) for w in words], "S1")
            file.createVariable(f"{axis}_name", "S1", (axis, "character"))[:] = characters
        for name, (unit, axes, values) in numbers.items():
            array = np.asarray(values)
            kind = array.dtype.str[1:] if array.dtype in (np.int16, np.float32) else "f8"
            variable = file.createVariable(name, kind, axes)
            variable[:] = array
            variable.units = unit


def _packed(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Rows of radii as integers of 16 bits with a scale and an offset each."""
    low, high = values.min(axis=-1, keepdims=True), values.max(axis=-1, keepdims=True)
    scale = np.where(high > low, (high - low) / 65000, 1).astype("f4")
    offset = ((low + high) / 2).astype("f4")
    return {
        name: np.rint((values - offset) / scale.astype(float)).astype("i2"),
        f"{name}_scale": scale[..., 0],
        f"{name}_offset": offset[..., 0],
    }


def _intensity(index: complex, x: np.ndarray, plus: np.ndarray, minus: np.ndarray) -> np.ndarray:
    """|S1|^2 + |S2|^2, half of |S1 + S2|^2 + |S1 - S2|^2, times 2: (angle, sphere)."""
    num = miepython.core.wiscombe_terms(x[-1])
    sums, differences = np.zeros((2, num, x.size), complex)
    for i, size in enumerate(x):
        a, b = miepython.coefficients(index, size)
        sums[: len(a), i], differences[: len(a), i] = a + b, a - b
    total = 0
    for functions, coefficients in ((plus, sums), (minus, differences)):
        for part in (coefficients.real, coefficients.imag):
            total = total + (functions[:, :num] @ part) ** 2
    return total


def _angular_functions(cos: np.ndarray, num: int) -> tuple[np.ndarray, np.ndarray]:
    """(2n + 1) / (n (n + 1)) times pi_n + tau_n and pi_n - tau_n, (angle, n)."""
    plus, minus = np.empty((2, num, cos.size))
    before, here = np.zeros_like(cos), np.ones_like(cos)
    for n in range(1, num + 1):
        tau = n * cos * here - (n + 1) * before
        scale = (2 * n + 1) / (n * (n + 1))
        plus[n - 1], minus[n - 1] = scale * (here + tau), scale * (here - tau)
        before, here = here, ((2 * n + 1) * cos * here - (n + 1) * before) / n
    return np.ascontiguousarray(plus.T), np.ascontiguousarray(minus.T)


def _legendre(cos: np.ndarray, num: int) -> np.ndarray:
    """Legendre polynomials, (degree, angle)."""
    return np.polynomial.legendre.legvander(cos, num - 1).T
