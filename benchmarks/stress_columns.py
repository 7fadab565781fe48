"""The random columns of `stress.py`: extremes of everything a column has, and their combinations.

Every column is of one stratum, which holds one of its properties at an extreme; each of the others
is at an extreme of its own in one column of four. In the stratum "everything" all are, and every
layer draws its own. In every stratum the sun of one column in four comes through a sphere
(`slant_path_secant`). What an argument may be at all is `abi_operator.ranges.SOLVER`;
`out_of_range` gives what must be refused.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator.optics.mie_phase import MiePhase
from abi_operator.planck import in_band_radiance
from abi_operator.ranges import SOLVER
from abi_operator.satellites import solar_irradiance
from abi_operator.solver import half_range, slant_path_secant

SEED = 20261125
# Streams, layers at most and at least, whether they emit, columns of a batch, share of all columns.
# What takes longest to compile comes first.
GROUPS = (
    (64, 4, 2, False, 8, 0.0005),
    (32, 16, 5, False, 51, 0.0045),
    (16, 16, 5, False, 119, 0.0150),
    (16, 16, 5, True, 119, 0.0075),
    (16, 64, 17, False, 119, 0.0225),
    (8, 200, 65, False, 510, 0.10),
    (8, 4, 1, True, 1020, 0.10),
    (8, 16, 5, False, 1020, 0.15),
    (4, 16, 5, True, 1020, 0.15),
    (6, 4, 1, False, 1020, 0.15),
    (4, 64, 17, False, 1020, 0.10),
    (2, 16, 5, False, 1020, 0.10),
    (2, 1, 1, False, 1020, 0.10),
)
# Property and extreme that a stratum holds.
STRATA = {
    "ordinary": {},
    "thin layers": {"tau": "thin"},
    "thick layers": {"tau": "thick"},
    "thick and thin in turn": {"tau": "in turn"},
    "absorbing": {"ssa": "absorbing"},
    "conservative": {"ssa": "conservative"},
    "forward peak": {"phase": "forward"},
    "backward": {"phase": "backward"},
    "two lobes": {"phase": "two lobes"},
    "Rayleigh": {"phase": "Rayleigh"},
    "droplets": {"phase": "droplets"},
    "low sun or view": {"angles": "low"},
    "sun behind the view": {"angles": "equal"},
    "at nodes": {"angles": "nodes"},
    "vertical": {"angles": "vertical"},
    "black or white ground": {"albedo": "ends"},
    "everything": {},
}
EXTREMES = {
    "tau": ("thin", "thick", "in turn"),
    "ssa": ("absorbing", "conservative"),
    "phase": ("forward", "backward", "two lobes", "Rayleigh", "droplets"),
    "angles": ("low", "equal", "nodes", "vertical"),
    "albedo": ("ends",),
}
ELSEWHERE = 0.25  # columns of a stratum in which another property is at an extreme, too
THICKEST, LOWEST = 1e5, 1e-3
THROUGH_A_SPHERE, HIGHEST = 0.25, 1e5  # columns; level [m]
# Sizes with rainbow and glory, in a band where both are sharp. [um]
BAND, RADII_UM = "C02", np.array([2.0, 4.0, 7.0, 12.0, 20.0, 35.0])
COLDEST, HOTTEST, THERMAL_BAND = 200.0, 1500.0, "C07"


class Batch(NamedTuple):
    """Arguments of `toa_brf`, or of `toa_radiance`, by name; the stratum of each column; and the
    moments again, as many as twice the streams need."""

    columns: dict[str, np.ndarray]
    stratum: np.ndarray
    further: np.ndarray

    def single(self):
        """The same, rounded to single precision."""
        columns = {name: x.astype(np.float32) for name, x in self.columns.items()}
        return Batch(columns, self.stratum, self.further.astype(np.float32))


def draw(key, count, num_streams, num_layers, fewest, emitting):
    """A batch of columns with `fewest` to `num_layers` layers, padded with empty ones.

    `key` is a list of integers, the number of the batch last: the same gives the same columns.
    Strata go round from batch to batch. The first column has the thickest
    layer, the lowest sun and the lowest view there are, so that all batches need as many doublings.
    """
    rng = np.random.default_rng([SEED, *key])
    stratum = (np.arange(count) + count * key[-1]) % len(STRATA)
    shape = (count, num_layers)
    modes = {name: _modes(rng, name, stratum, shape) for name in EXTREMES}
    tau, ssa = _tau(rng, modes["tau"]), _ssa(rng, modes["ssa"])
    mu0, mu, azimuth = _angles(rng, modes["angles"][:, 0], num_streams)
    used = rng.integers(fewest, num_layers + 1, count)
    tau[np.arange(num_layers) < (num_layers - used)[:, None]] = 0
    tau[0, -1], mu0[0], mu[0] = THICKEST, LOWEST, LOWEST
    further, phase = _phase(rng, modes["phase"], 2 * num_streams + 1, (mu0, mu, azimuth))
    albedo = np.where(
        modes["albedo"][:, 0] == "ends", rng.choice([0.0, 1.0], count), rng.random(count)
    )
    columns = {
        "tau": tau,
        "ssa": ssa,
        "moments": further[..., : num_streams + 1],
        "albedo": albedo,
        "mu0": mu0,
        "mu": mu,
        "relative_azimuth": azimuth,
        "phase_function": phase,
        "secant": _secants(np.random.default_rng([SEED, *key, 1]), mu0, num_layers),
    }
    if emitting:
        columns |= _sources(rng, albedo, num_layers)
    return Batch(columns, stratum, further)


def columns_of(group, index, precision):
    """Batch of a group by its number; see `GROUPS`."""
    streams, layers, fewest, emitting, size, _ = group
    batch = draw([streams, layers, int(emitting), index], size, streams, layers, fewest, emitting)
    return batch if precision == "float64" else batch.single()


def _modes(rng, name, stratum, shape):
    """What a property is like in every layer: "" where ordinary."""
    every = EXTREMES[name]
    by_column = rng.choice(every, shape[0])
    drawn = np.where(rng.random(shape[0]) < ELSEWHERE, by_column, "")[:, None]
    drawn = np.repeat(drawn, shape[1], axis=1)
    names = list(STRATA)
    for k, held in enumerate(STRATA.values()):
        if name in held:
            drawn[stratum == k] = held[name]
    drawn[stratum == names.index("ordinary")] = ""
    everything = stratum == names.index("everything")
    drawn[everything] = rng.choice([*every, ""], shape)[everything]
    return drawn


def _tau(rng, mode):
    def between(low, high):
        return 10 ** rng.uniform(low, high, mode.shape)

    thin = np.where(rng.random(mode.shape) < 0.5, between(-15, -3), 0)
    thin = np.where(rng.random(mode.shape) < 0.1, 1e-15, thin)
    thick = np.where(rng.random(mode.shape) < 0.2, THICKEST, between(1, 5))
    even = np.arange(mode.shape[1]) % 2 == 0
    turn = np.where(even, thick, thin)
    return np.select(
        [mode == "thin", mode == "thick", mode == "in turn"],
        [thin, thick, turn],
        between(-3, 1),
    )


def _ssa(rng, mode):
    small = np.where(rng.random(mode.shape) < 0.4, 0, 10 ** rng.uniform(-12, 0, mode.shape))
    small = np.where(rng.random(mode.shape) < 0.1, 1e-12, small)
    near = 1 - 10 ** rng.uniform(-15, -3, mode.shape)
    near = np.where(rng.random(mode.shape) < 0.4, 1, near)
    near = np.where(rng.random(mode.shape) < 0.1, 1 - 1e-15, near)
    return np.select(
        [mode == "absorbing", mode == "conservative"],
        [small, near],
        rng.uniform(0.5, 1, mode.shape),
    )


def _angles(rng, mode, num_streams):
    """Half of those that are equal, at nodes or vertical are so, half a little less."""
    count = mode.size
    mu0, mu = rng.uniform(0.05, 1, (2, count))
    azimuth = rng.uniform(0, np.pi, count)
    special = rng.choice([0.0, np.pi], count)
    azimuth = np.where(rng.random(count) < 0.2, special, azimuth)
    way = rng.choice([-1, 0, 1], count, p=[0.05, 0.9, 0.05])  # the other way round, or a turn more
    azimuth = np.where((way > 0) & (azimuth > 0.1), 2 * np.pi - azimuth, azimuth)
    azimuth = np.where(way < 0, -azimuth, azimuth)
    beside = np.where(rng.random(count) < 0.5, 1, 1 - 10 ** rng.uniform(-12, -3, count))
    low, which = mode == "low", rng.integers(3, size=count)
    grazing = np.where(rng.random((2, count)) < 0.3, LOWEST, 10 ** rng.uniform(-3, -1, (2, count)))
    mu0 = np.where(low & (which != 1), grazing[0], mu0)
    mu = np.where(low & (which != 0), grazing[1], mu)
    nodes = half_range(num_streams)[0]
    at = mode == "nodes"
    mu0 = np.where(at & (which != 1), beside * rng.choice(nodes, count), mu0)
    mu = np.where(at & (which != 0), beside * rng.choice(nodes, count), mu)
    vertical = mode == "vertical"
    mu0 = np.where(vertical & (which != 1), beside, mu0)
    mu = np.where(vertical & (which != 0), beside, mu)
    equal = mode == "equal"
    mu = np.where(equal, beside * mu0, mu)
    azimuth = np.where(equal & (which != 0), 0, azimuth)  # exact backscatter, the glory
    return mu0, mu, azimuth


def _phase(rng, mode, num_moments, angles):
    """Moments and phase functions at the scattering angle; see `STRATA`."""
    mu0, mu, azimuth = angles
    cosine = -mu0 * mu - np.sqrt((1 - mu0**2) * (1 - mu**2)) * np.cos(azimuth)
    cosine = np.clip(cosine, -1, 1)[:, None]
    order = np.arange(num_moments)
    shape = mode.shape
    forward, backward = 1 - 10 ** rng.uniform(-3, -1, shape), rng.uniform(-0.9, 0, shape)
    g = np.select(
        [mode == "forward", mode == "backward", mode == "two lobes"],
        [np.where(rng.random(shape) < 0.2, 0.999, forward), backward, forward],
        rng.uniform(0, 0.85, shape),
    )
    g = np.where((mode == "backward") & (rng.random(shape) < 0.2), -0.9, g)
    share = np.where(mode == "two lobes", rng.uniform(0.1, 0.9, shape), 1)
    moments = share[..., None] * g[..., None] ** order
    moments += (1 - share)[..., None] * backward[..., None] ** order
    phase = share * _lobe(g, cosine) + (1 - share) * _lobe(backward, cosine)
    air = mode == "Rayleigh"
    moments[air] = np.select([order == 0, order == 2], [1.0, 0.1], 0.0)
    phase = np.where(air, 0.75 * (1 + cosine**2), phase)
    rows, columns = np.nonzero(mode == "droplets")
    if rows.size:
        size = rng.integers(RADII_UM.size, size=rows.size)
        of_size, by_size = _droplets(num_moments, cosine[:, 0])
        moments[rows, columns] = of_size[size]
        phase[rows, columns] = by_size[rows, size]
    return moments, phase


def _lobe(g, cosine):
    """Henyey and Greenstein's."""
    distance = (1 - g) ** 2 + 2 * g * (1 - cosine)
    return (1 - g) * (1 + g) / distance**1.5


_in_table = jax.jit(
    jax.vmap(lambda radius, cosine: MiePhase(radius, "droplets", BAND)(cosine), (None, 0))
)


def _droplets(num_moments, cosine):
    """Of the sizes `RADII_UM`, (size, moment) and (column, size)."""
    radii = jnp.asarray(RADII_UM)
    moments = MiePhase(radii, "droplets", BAND).moments(num_moments)
    return np.asarray(moments), np.asarray(_in_table(radii, cosine))


def _secants(rng, mu0, num_layers):
    """1 / mu0, or the path between random levels over a sphere; the first column's is a plane's."""
    height = -np.sort(-rng.uniform(0, HIGHEST, (mu0.size, num_layers + 1)))
    sphere = rng.random(mu0.size) < THROUGH_A_SPHERE
    sphere[0] = False
    slanting = np.asarray(slant_path_secant(jnp.asarray(height), jnp.asarray(mu0)))
    return np.where(sphere[:, None], slanting, 1 / mu0[:, None])


def black_body(temperature):
    """Of `THERMAL_BAND`. [W m-2 sr-1 um-1]"""
    return np.asarray(in_band_radiance(jnp.asarray(temperature), THERMAL_BAND))


def _sources(rng, albedo, num_layers):
    """Air of 200 to 1500 K above ground of as much, by day and by night, under a glowing top."""
    count = albedo.size
    levels = black_body(rng.uniform(COLDEST, HOTTEST, (count, num_layers + 1)))
    cold = black_body(rng.uniform(COLDEST, 320.0, (count, num_layers + 1)))
    levels = np.where(rng.random((count, 1)) < 0.5, cold, levels)
    ground = black_body(
        np.where(rng.random(count) < 0.5, HOTTEST, rng.uniform(COLDEST, 320, count))
    )
    glowing = black_body(rng.uniform(COLDEST, HOTTEST, count))
    return {
        "solar_irradiance": np.where(rng.random(count) < 0.4, 0.0, solar_irradiance(THERMAL_BAND)),
        "planck_levels": levels,
        "surface_emission": (1 - albedo) * ground,
        "isotropic_top": np.where(rng.random(count) < 0.5, 0.0, glowing),
    }


def out_of_range(columns):
    """Of each argument a batch in which one number is not allowed: argument, number, batch."""
    for name, allowed in SOLVER.items():
        if name not in columns:
            continue
        wrong = [np.nan, np.inf]
        if np.isfinite(allowed.low):
            below = np.nextafter(allowed.low, -np.inf)
            wrong.append(allowed.low if allowed.ends[0] == "(" else below)
        if np.isfinite(allowed.high):
            above = np.nextafter(allowed.high, np.inf)
            wrong.append(allowed.high if allowed.ends[1] == ")" else above)
        for number in wrong:
            values = columns[name].copy()
            number = values.dtype.type(number)
            if abs(number) < 1e-300 and allowed.ends[0] == "[":
                number = values.dtype.type(
                    -1e-30
                )  # not the smallest of all numbers, which some take for 0
            while allowed.holds(number):  # an end is rounded
                number = np.nextafter(number, values.dtype.type(np.copysign(np.inf, number)))
            place = (values.shape[0] // 2, *(size - 1 for size in values.shape[1:]))
            values[place] = number
            yield name, float(number), columns | {name: values}
