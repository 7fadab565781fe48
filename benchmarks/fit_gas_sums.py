"""Fit the joint exponential sums of gases in C02, C03 and C05.

The transmittance of each gas alone is that of the 6SV2.1 band model over the response of GOES-16,
by closed forms in air mass, amount and pressure; gases together are their product. One sum is
fitted to all of them at once: weights, and a coefficient for each gas in each term. Prints what
stands in `abi_operator/optics/gas/tables.py`, and the errors that stand beside it.

Needs SciPy. Run: ``python benchmarks/fit_gas_sums.py``.
"""

import itertools
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from abi_operator.optics.gas.amounts import gases_of
from abi_operator.standard_atmospheres import standard_atmosphere

PROFILES = ("tropical", "midlatitude_summer", "midlatitude_winter", "us_standard")
NEGLIGIBLE = 1e-7  # coefficient of a gas that has none in a term
AIR_MASSES = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0)


class Samples(NamedTuple):
    """Paths: amount of each gas times air mass, transmittance, air mass, how much each counts."""

    amounts: np.ndarray
    transmittance: np.ndarray
    air_mass: np.ndarray
    importance: np.ndarray


class Sum(NamedTuple):
    """Weight of each term; coefficient of each gas in each term."""

    weight: np.ndarray
    coefficients: np.ndarray

    def __call__(self, amounts: np.ndarray) -> np.ndarray:
        return np.exp(-amounts @ self.coefficients) @ self.weight


def joint_sum(samples: Samples, terms: int, starts: int = 12, rounds: int = 12) -> Sum:
    """Fit a sum of `terms` exponentials, with the largest error about as small as can be.

    Least squares from random starts; the best is refined with weights that grow where errors are
    large (Lawson's iteration), which turns the square into the largest error.
    """
    gases = samples.amounts.shape[1]
    rng = np.random.default_rng(0)
    scale = np.median(-np.log(samples.transmittance))
    typical = np.array([np.median(column[column > 0]) for column in samples.amounts.T])

    def unpack(x):
        logits = np.append(0.0, x[: terms - 1])
        weight = np.exp(logits - logits.max())
        return Sum(weight / weight.sum(), np.exp(x[terms - 1 :]).reshape(gases, terms))

    def fit(x, importance):
        lower = np.r_[np.full(terms - 1, -12.0), np.full(gases * terms, -20.0)]
        result = least_squares(
            lambda y: importance * (unpack(y)(samples.amounts) - samples.transmittance),
            np.clip(x, lower + 1e-6, 11.9),
            jac=lambda y: importance[:, None] * slopes(unpack(y)),  # pyright: ignore[reportArgumentType]
            bounds=(lower, np.full(lower.shape, 12.0)),
            max_nfev=300,
        )
        return result.x

    def slopes(fitted):
        parts = np.exp(-samples.amounts @ fitted.coefficients) * fitted.weight
        by_logit = parts[:, 1:] - parts.sum(axis=1)[:, None] * fitted.weight[1:]
        by_log = -parts[:, None, :] * samples.amounts[:, :, None] * fitted.coefficients
        return np.hstack([by_logit, by_log.reshape(len(parts), -1)])

    def start():
        spread = np.sort(rng.normal(0, 2.5, terms)) - 1.0 if terms > 1 else np.zeros(1)
        k = np.log(scale / typical)[:, None] + spread + rng.normal(0, 0.7, (gases, terms))
        return np.r_[-np.arange(1, terms) * rng.uniform(0.5, 3.0), k.ravel()]

    def errors(x):
        return samples.importance * np.abs(unpack(x)(samples.amounts) - samples.transmittance)

    def worst(x):
        return errors(x).max()

    best = min((fit(start(), samples.importance) for _ in range(starts)), key=worst)
    x, importance = best, samples.importance
    for _ in range(rounds):
        error = errors(x)
        importance = importance * np.sqrt(0.05 + error / error.max())
        importance = importance / importance.mean()
        x = fit(x, importance)
        best = min(best, x, key=worst)
    return rounded(unpack(best))


def rounded(fitted: Sum) -> Sum:
    """Terms from the weakest, with the digits that the table has; weights still sum to 1."""
    order = np.argsort(fitted.coefficients.sum(axis=0))
    weight = np.round(fitted.weight[order], 6)
    weight[0] += 1 - weight.sum()
    four = np.vectorize(lambda k: float(f"{k:.4g}") if k > NEGLIGIBLE else 0.0)
    return Sum(np.round(weight, 6), four(fitted.coefficients[:, order]))


def report(
    title: str, names: list[str], fitted: Sum, samples: Samples, grey: np.ndarray | float = 1.0
) -> None:
    """Print one band: its sum, and its largest errors by gases and by air mass.

    `grey` is the transmittance by which that of the samples is to be multiplied.
    """
    print(f"{title}: weight {tuple(fitted.weight.tolist())}")
    for name, row in zip(names, fitted.coefficients, strict=True):
        print(f"  {name}: {tuple(float(k) for k in row)}")
    error = grey * np.abs(fitted(samples.amounts) - samples.transmittance)
    gases = [name.split()[0] for name in names]
    present = {
        g: np.any([c > 0 for n, c in zip(gases, samples.amounts.T, strict=True) if n == g], axis=0)
        for g in gases
    }
    number = np.sum(list(present.values()), axis=0)
    groups = {"all gases": number == len(present)}
    groups |= {f"{g} alone": here & (number == 1) for g, here in present.items()}
    for label, chosen in (("air mass to 6", samples.air_mass <= 6), ("to 12", True)):
        worst = [f"{k} {np.where(g & chosen, error, 0).max():.5f}" for k, g in groups.items()]
        print(f"  largest error, {label}: " + ", ".join(worst))


# The closed forms, fitted to 6SV2.1 (Vermote et al. 1997, doi:10.1109/36.581987; Kotchenova et al.
# 2006, doi:10.1364/AO.45.006762) run over the response of GOES-16: exp(-exp(a + b x + c x^2)), x =
# ln mU, for vapour, U in cm, and exp(-a m^b P^c X^d) for mixed gases, P = p / 1013.25 hPa and X
# relative to the reference.
VAPOUR = {
    "C02": (-6.046273, 0.994595, -0.0474989),
    "C03": (-6.685169, 1.001040, -0.0347434),
    "C05": (-7.688753, 1.045866, -0.0194371),
}
MIXED = {
    ("C02", "O2"): (0.00101579, 0.604425, 1.001446, 0.0),
    ("C05", "CO2"): (0.0206238, 0.696251, 1.001175, 0.684264),
    ("C05", "CH4"): (0.00120107, 0.916283, 1.119626, 0.908192),
    ("C06", "CH4"): (0.0378552, 0.818017, 1.041589, 0.804498),
    ("C06", "N2O"): (0.00278412, 0.896809, 0.958249, 0.885133),
}
# Power of pressure by which a unit of the gas absorbs more, fitted with each gas alone.
EXPONENTS = {
    ("C02", "O2"): 0.0,
    ("C05", "CO2"): 0.4341,
    ("C05", "CH4"): 0.2195,
    ("C06", "CH4"): 0.2708,
    ("C06", "N2O"): 0.0660,
}
# Gases, terms, and the largest air mass that is fitted. Ozone is grey by itself, and vapour in C06
# is fitted to its lines, by `fit_gas_c06.py` with the closed forms above.
BANDS = {
    "C02": (("H2O", "O2"), 1, 6.0),
    "C03": (("H2O",), 1, 6.0),
    "C05": (("CO2", "CH4", "H2O"), 3, 12.0),
}


def path(band, gas, air_mass, relative_pressure, vapour, mixing):
    """Amount on the path and its optical depth."""
    if gas == "H2O":
        amount = air_mass * vapour
        a, b, c = VAPOUR[band]
        x = np.log(amount)
        return amount, np.exp(a + b * x + c * x**2)
    a, b, c, d = MIXED[band, gas]
    amount = air_mass * mixing * relative_pressure ** (1 + EXPONENTS[band, gas])
    return amount, a * air_mass**b * relative_pressure**c * mixing**d


def samples_of(band: str, gases: tuple[str, ...]) -> Samples:
    """Each gas alone and all together, above five heights of four atmospheres."""
    rows = []
    for name in PROFILES:
        column = standard_atmosphere(name)
        above = np.cumsum(gases_of(column).vapour)
        for height in (0.0, 1e3, 2e3, 4e3, 6e3):
            level = int(np.flatnonzero(np.asarray(column.height) == height)[0])
            vapour = 0.1 * float(above[level - 1])
            relative = float(column.pressure[level]) / 101325
            for m, mixing in itertools.product(AIR_MASSES, (0.8, 1.0, 1.2)):
                paths = [path(band, g, m, relative, vapour, mixing) for g in gases]
                amounts, depths = np.array(paths).T
                chosen = [np.eye(len(gases))[i] for i in range(len(gases))]
                for mask in (*chosen, np.ones(len(gases))):
                    rows.append((*(mask * amounts), np.exp(-mask @ depths), m))
    table = np.unique(np.array(rows), axis=0)
    return Samples(table[:, :-2], table[:, -2], table[:, -1], np.ones(len(table)))


if __name__ == "__main__":
    for band, (gases, terms, largest) in BANDS.items():
        samples = samples_of(band, gases)
        inside = samples.air_mass <= largest
        fitted = joint_sum(Samples(*(column[inside] for column in samples)), terms)
        report(band, list(gases), fitted, samples)
