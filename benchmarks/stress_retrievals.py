"""Are the result codes of retrievals true to what happened to the measurements?

    python benchmarks/stress_retrievals.py [smoke] [ash] [fire] [--pixels 256] [--streams 4]

Random pixels of smoke (optical depth and single-scattering albedo from C01, C02 and C03), of ash
(optical depth and effective radius from the same), and of fires (temperature and burning share from
C05, C06 and C07), with the imager's noise and ceilings (`stress_retrievals_pixels`); then something
is wrong with them (`stress_retrievals_cases`). Where the retrieval is told all that is wrong,
success must hold the truth as often as it claims; where it is not, it should say ``poor_fit``, as
far as three bands can tell. What is printed of a case:

- shares of the result codes, and of the pixels that say success:
- held: how many hold the truth of each unknown within 1.96 posterior standard deviations;
- bias: mean departure from the truth in these, of the unknown of which it is the largest;
- largest error: of optical depth, or of a fire's emitted power, in per cent of the true one;
- not finite: how many have any number in a product of theirs that is none. There must be none, and
  the command ends with an error if there is.
"""

import argparse
import sys
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array
from stress_retrievals_cases import CASES
from stress_retrievals_pixels import KINDS, Pixels

from abi_operator.machine.speed import use_compilation_cache, use_compiler_flags
from retrievals import Minimiser, ResultCode, retrieve_pixels
from retrievals.inverse import DEFAULT_MINIMISER
from retrievals.product import pixel_fields


class Judged(NamedTuple):
    """What became of the pixels of a case.

    Parameters
    ----------
    codes
        Result code of each pixel.
    departures
        Of x from the truth, in posterior standard deviations (pixel, x).
    errors
        Of what the kind has `reported`, without sign.
    finite
        Whether all numbers of a product are.
    told
        Whether the retrieval was told what is true.
    """

    codes: np.ndarray
    departures: np.ndarray
    errors: np.ndarray
    finite: np.ndarray
    told: bool

    @property
    def success(self) -> np.ndarray:
        """Which say success."""
        return self.codes == ResultCode.SUCCESS

    def share(self, code: ResultCode) -> float:
        """Share of a result code. [-]"""
        return float(np.mean(self.codes == code))

    @property
    def coverage(self) -> np.ndarray:
        """Share of successes that hold the truth within 1.96 sigma, of each element of x. [-]"""
        return np.mean(np.abs(self.departures[self.success]) <= 1.96, axis=0)

    @property
    def bias(self) -> np.ndarray:
        """Mean departure of successes, of each element of x. [-]"""
        return np.mean(self.departures[self.success], axis=0)


def judged(pixels: Pixels, name: str, minimiser: Minimiser = DEFAULT_MINIMISER) -> Judged:
    """Retrieve pixels to which a case has happened."""
    kind, given = pixels.kind, CASES[pixels.name][name](pixels)
    without = given.prior is None
    # A start at the prior there can only be with one.
    how = minimiser._replace(starts="scan") if without else minimiser
    found = retrieve_pixels(
        pixels.forward, given.observations, given.states, prior=given.prior, minimiser=how
    )
    x, covariance = np.asarray(found.inversion.x), found.inversion.covariance
    with np.errstate(invalid="ignore"):  # of pixels that say so
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        departures = (x - pixels.truth) / sigma
    true, error = (reported(pixels, values) for values in (pixels.truth, x))
    error = np.abs(error - true) / (true / 100 if kind.relative else 1)
    fields = pixel_fields(
        kind.vector, kind.bands, found, given.states, given.observations.num_values
    )
    numbers = [
        field.values.reshape(-1, len(x))
        for variable, field in fields.items()
        if not variable.endswith("_second")  # which is NaN where there is none
    ]
    finite = np.isfinite(np.concatenate(numbers)).all(axis=0)
    return Judged(found.codes, departures, error, finite, given.told)


def reported(pixels: Pixels, x: Array | np.ndarray) -> np.ndarray:
    """What the printed errors of a kind are of."""
    kind = pixels.kind
    values = kind.vector.values(jax.numpy.asarray(x))
    for item in kind.vector.derived:
        if item.name == kind.reported:
            fire = kind.vector.state(jax.numpy.asarray(x), pixels.states).fire
            return np.asarray(item.read(fire))
    return np.asarray(values[kind.reported])


def table(name: str, num_pixels: int, streams: int) -> int:
    """Print the cases of a kind; how many successes are not finite."""
    pixels = Pixels(name, num_pixels, streams)
    kind, names = pixels.kind, pixels.kind.vector.names
    held = "".join(f"{x} held [%] | " for x in names)
    unit = " [%]" if kind.relative else ""
    print(
        f"\n{name}, {', '.join(kind.bands)}:\n\n| what happened | pixels | result codes [%] | "
        f"{held}largest bias [sigma] | largest error of {kind.reported}{unit} | not finite |\n"
        f"|{' --- |' * (6 + len(names))}"
    )
    lost = 0
    for case in CASES[name]:
        found = judged(pixels, case)
        shares = {code.name.lower(): 100 * found.share(code) for code in ResultCode}
        codes = ", ".join(f"{code} {share:.1f}" for code, share in shares.items() if share)
        not_finite = int((found.success & ~found.finite).sum())
        lost += not_finite
        cells = ["-"] * (len(names) + 2)
        if found.success.any():
            most = int(np.argmax(np.abs(found.bias)))
            cells = [f"{100 * x:.1f}" for x in found.coverage]
            cells.append(f"{names[most]} {found.bias[most]:+.1f}")
            cells.append(f"{found.errors[found.success].max():.2g}")
        star = "" if found.told else " *"
        print(
            f"| {case}{star} | {num_pixels} | {codes} | {' | '.join(cells)} | {not_finite} |",
            flush=True,
        )
    return lost


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("kinds", nargs="*", default=list(KINDS), metavar="KIND", help=str([*KINDS]))
    parser.add_argument("--pixels", type=int, default=256)
    parser.add_argument("--streams", type=int, default=4)
    arguments = parser.parse_args()
    for name in arguments.kinds:
        if name not in KINDS:
            parser.error(f"kinds are {', '.join(KINDS)}; got {name!r}.")
    use_compiler_flags()
    use_compilation_cache()
    jax.config.update("jax_enable_x64", True)
    lost = sum(table(name, arguments.pixels, arguments.streams) for name in arguments.kinds)
    print("\n\\* The retrieval is told other than what is true.")
    if lost:
        sys.exit(f"{lost} successes are not finite.")


if __name__ == "__main__":
    main()
