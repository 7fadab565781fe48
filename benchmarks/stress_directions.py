"""Along what `stress_checks.py` compares slopes: all arguments at once, and one number of one."""

import numpy as np

# Least steps of one number, where its own size is no measure of how far it may be changed.
LEAST = {
    "tau": 0.01,
    "moments": 0.01,
    "phase_function": 0.1,
    "relative_azimuth": 1.0,
    "secant": 1.0,
    "solar_irradiance": 1.0,
    "planck_levels": 0.1,
    "surface_emission": 0.1,
    "isotropic_top": 0.1,
}


def of_all(columns, key):
    """A direction in all arguments: random shares of what each of them can be changed by."""
    rng = np.random.default_rng([1, *key])
    found = {}
    for name, x in columns.items():
        share = rng.uniform(-1, 1, x.shape)
        wide = x.astype(np.float64)
        room = {"ssa": wide * (1 - wide), "albedo": wide * (1 - wide), "relative_azimuth": 1.0}
        room |= {"mu0": wide * (1 - wide), "mu": wide * (1 - wide)}
        room |= {"moments": wide * (1 - abs(wide))}
        found[name] = (share * room.get(name, wide)).astype(x.dtype)
    return found


def of_one(columns, key):
    """In each column a direction in one number of one argument: of one layer, one moment.

    It leads inward from the ends of what is allowed, so that scattering without absorption, empty
    layers and black ground are asked, too. A cosine of 1 is not: slopes in it are infinite for all
    modes but the mean.
    """
    rng = np.random.default_rng([2, *key])
    count = columns["mu"].size
    which = rng.integers(len(columns), size=count)
    depth = columns["tau"].sum(axis=1, dtype=np.float64)
    found = {}
    for k, (name, x) in enumerate(columns.items()):
        numbers = x.reshape(count, -1).astype(np.float64)
        place = rng.integers(numbers.shape[1], size=count)
        if name == "moments":  # the first is 1
            layers, moments = x.shape[1:]
            place = rng.integers(layers, size=count) * moments
            place += rng.integers(1, moments, size=count)
        at = numbers[np.arange(count), place]
        moved_one = np.zeros_like(numbers)
        moved_one[np.arange(count), place] = np.where(which == k, _step(name, at, depth), 0)
        found[name] = moved_one.reshape(x.shape)
    return found


def _step(name, at, depth):
    """How far a number may be changed, a hundred thousand times what quotients change it by.

    Light of layers that do not absorb varies with co-albedos of 1 / depth^2, and with the ground's
    absorption of 1 / depth.
    """
    inward = np.where(at > 0.5, -1, 1)
    if name == "ssa":
        return inward * np.maximum(at * (1 - at), np.minimum(0.1, 1e3 / (1 + depth**2)))
    if name == "albedo":
        return inward * np.maximum(at * (1 - at), np.minimum(0.1, 1e2 / (1 + depth)))
    if name in ("mu0", "mu"):
        return inward * at * (1 - at)
    if name == "moments":
        size = np.maximum(abs(at) * (1 - abs(at)), LEAST[name])
        return np.where(at < 0, size, -size)
    return np.maximum(at, LEAST[name])


def moved(columns, directions, step):
    """Columns a little along a direction, in range."""
    return {name: x + step * directions[name].astype(x.dtype) for name, x in columns.items()}


def along(slopes, directions):
    """Slope of every column along a direction, and the sum of its terms' sizes."""
    terms = np.concatenate(
        [
            (np.asarray(slopes[name], np.float64) * x).reshape(x.shape[0], -1)
            for name, x in directions.items()
        ],
        axis=1,
    )
    return terms.sum(axis=1), abs(terms).sum(axis=1)
