r"""Whether a fit explains what was observed, as noise would have it: a test, in numbers and words.

At the minimum the sum of squared whitened residuals is distributed as chi-square with as many
degrees of freedom as there are measurements, less what the fit has learnt of them (the trace of the
averaging kernel) [1]_: over its degrees of freedom n it is :math:`1 \pm \sqrt{2/n}`. Noise is also
without a mean in any band, :math:`0 \pm 1/\sqrt{n_b}`, and not alike in neighbouring pixels: with m
pairs of neighbours in a row or column the mean product of their residuals is
:math:`0 \pm 1/\sqrt{m}`. Each departure is told in standard deviations, and from `LARGEST` on the
fit is a misfit: of twenty such numbers of noise alone one is as large in a thousand fits. A model
that is no number where something was observed explains nothing, and is a misfit as well.

References
----------
.. [1] C. D. Rodgers, "Inverse Methods for Atmospheric Sounding", World Scientific, 2000,
   section 12.3, doi:10.1142/3171
"""

from typing import NamedTuple

import numpy as np

LARGEST = 4.0
"""Departure from what noise has, in standard deviations, from which a fit is a misfit. [-]"""


class Tested(NamedTuple):
    """One number of the residuals, beside what noise makes of it."""

    value: float
    expected: float
    scatter: float

    @property
    def departure(self) -> float:
        """In standard deviations; 0 of what cannot be said, which `Misfit.reasons` looks at. [-]"""
        found = (self.value - self.expected) / self.scatter if self.scatter > 0 else 0.0
        return found if np.isfinite(found) else 0.0


class Misfit(NamedTuple):
    """All tests of a fit.

    Parameters
    ----------
    chi_square
        Reduced chi-square of all bands.
    by_band
        Reduced chi-square of each band, of its own number of measurements.
    mean
        Mean whitened residual of each band.
    alike
        Mean product of neighbours' residuals, of each band.
    """

    chi_square: Tested
    by_band: dict[str, Tested]
    mean: dict[str, Tested]
    alike: dict[str, Tested]

    @property
    def reasons(self) -> list[str]:
        """What speaks against the model, in words; none if nothing does."""
        found = []
        if not np.isfinite(self.chi_square.value):
            lost = [band for band, test in self.by_band.items() if not np.isfinite(test.value)]
            where = f", as residuals are none in {', '.join(lost)}" if lost else ""
            found.append(f"reduced chi-square is no finite number{where}")
        if self.chi_square.departure > LARGEST:
            found.append(
                f"reduced chi-square {self.chi_square.value:.4g} where noise has "
                f"{self.chi_square.expected:.4g} +- {self.chi_square.scatter:.2g}"
            )
        words = {
            "reduced chi-square of": (self.by_band, False),
            "mean residual, in standard deviations of noise, of": (self.mean, True),
            "mean product of neighbours' residuals in": (self.alike, False),
        }
        for name, (tests, both) in words.items():
            for band, test in tests.items():
                size = abs(test.departure) if both else test.departure
                if size > LARGEST:
                    found.append(
                        f"{name} {band} {test.value:.3g} where noise has {test.expected:.3g} +- "
                        f"{test.scatter:.2g}"
                    )
        return found

    @property
    def found(self) -> bool:
        """Whether it is a misfit."""
        return bool(self.reasons)

    @property
    def sentence(self) -> str:
        """What is to be said of it."""
        reasons = self.reasons
        if reasons:
            return (
                "MISFIT: the model does not explain what was observed, and the stated errors, "
                f"which are those of a model that does, do not hold: {'; '.join(reasons)}"
            )
        if self.chi_square.departure < -LARGEST:
            return (
                f"the fit is closer than noise allows (reduced chi-square "
                f"{self.chi_square.value:.3g} where noise has {self.chi_square.expected:.3g} +- "
                f"{self.chi_square.scatter:.2g}): the observation has less noise than is assumed"
            )
        return (
            f"no misfit found: reduced chi-square {self.chi_square.value:.4g}, noise has "
            f"{self.chi_square.expected:.4g} +- {self.chi_square.scatter:.2g}"
        )


def misfit(maps: np.ndarray, counts: np.ndarray, bands: tuple[str, ...], learnt: float) -> Misfit:
    """Test the residuals of a fit.

    Parameters
    ----------
    maps
        Whitened residuals (band, y, x), whatever where nothing counts. [-]
    counts
        Where measurements count (band, y, x).
    bands
        Their names.
    learnt
        Degrees of freedom for signal. [-]
    """
    maps = np.where(counts, maps, 0.0)
    total = int(counts.sum())
    freedom = max(total - learnt, 1.0)
    chi_square = Tested(float(np.sum(maps**2)) / freedom, 1.0, float(np.sqrt(2 / freedom)))
    by_band, mean, alike = {}, {}, {}
    for band, field, good in zip(bands, maps, counts, strict=True):
        number = int(good.sum())
        if number == 0:
            continue
        square = float(np.sum(field**2)) / number
        by_band[band] = Tested(square, 1.0, float(np.sqrt(2 / number)))
        mean[band] = Tested(float(field.sum()) / number, 0.0, float(1 / np.sqrt(number)))
        alike[band] = _alike(field, good)
    return Misfit(chi_square, by_band, mean, alike)


def _alike(field: np.ndarray, good: np.ndarray) -> Tested:
    """Mean product of neighbours' residuals, across and along."""
    across, along = (good[:, 1:] & good[:, :-1]), (good[1:] & good[:-1])
    pairs = int(across.sum() + along.sum())
    if pairs == 0:
        return Tested(0.0, 0.0, 0.0)
    with np.errstate(invalid="ignore"):  # of infinite residuals, of which chi-square tells
        products = np.sum(field[:, 1:] * field[:, :-1]) + np.sum(field[1:] * field[:-1])
    return Tested(float(products) / pairs, 0.0, float(1 / np.sqrt(pairs)))
