"""Are the result codes of retrievals true to what happened to the measurements?

    python benchmarks/stress_retrievals.py [smoke] [ash] [fire] [cloud] [smooth]
        [--pixels 256] [--streams 4]

Random pixels of smoke (optical depth and single-scattering albedo from C01, C02 and C03), of ash
(optical depth and effective radius from the same), of fires (temperature and burning share from
C05, C06 and C07) and of cloud (optical thickness and radius of its droplets from C02 and C06), with
the imager's noise and ceilings (`stress_retrievals_pixels`); then something is wrong with them
(`stress_retrievals_cases`). And an image of smoke, ``smooth``, that is retrieved as a whole
(`stress_retrievals_image`). Where the retrieval is told all that is wrong, success must hold the
truth as often as it claims; where it is not, it should say ``poor_fit``, as far as the bands can
tell. What is printed of a case:

- shares of the result codes, and of the pixels that say success:
- held: how many hold the truth of each unknown within 1.96 posterior standard deviations;
- bias: mean departure from the truth in these, of the unknown of which it is the largest;
- largest error: of optical depth, or, in per cent of the true one, of a fire's emitted power or a
  cloud's thickness;
- beside: of neighbours of bad pixels, how many are successes, and how often these hold the truth;
- joint steps: how many an image took after its single pixels;
- not finite: how many have any number in a product of theirs that is none. There must be none, and
  the command ends with an error if there is.
"""

import argparse
import sys

import jax
import numpy as np
from stress_retrievals_cases import CASES
from stress_retrievals_image import IMAGES, Image, judged_image
from stress_retrievals_judged import Judged, judged
from stress_retrievals_pixels import KINDS, Pixels

from abi_operator.machine.speed import use_compilation_cache, use_compiler_flags
from retrievals import ResultCode


def codes_of(found: Judged) -> str:
    """Shares of the result codes, in words."""
    shares = {code.name.lower(): 100 * found.share(code) for code in ResultCode}
    return ", ".join(f"{code} {share:.1f}" for code, share in shares.items() if share)


def cells_of(found: Judged, names: tuple[str, ...]) -> list[str]:
    """What successes hold, their largest bias and their largest error; nothing without any."""
    if not found.success.any():
        return ["-"] * (len(names) + 2)
    most = int(np.argmax(np.abs(found.bias)))
    return [
        *(f"{100 * x:.1f}" for x in found.coverage),
        f"{names[most]} {found.bias[most]:+.1f}",
        f"{found.errors[found.success].max():.2g}",
    ]


def heading(title: str, columns: list[str]) -> None:
    """Print what stands above a table."""
    print(f"\n{title}:\n\n| {' | '.join(columns)} |\n|{' --- |' * len(columns)}")


def table(name: str, num_pixels: int, streams: int) -> int:
    """Print the cases of a kind; how many successes are not finite."""
    pixels = Pixels(name, num_pixels, streams)
    kind, names = pixels.kind, pixels.kind.vector.names
    unit = " [%]" if kind.relative else ""
    columns = ["what happened", "pixels", "result codes [%]", *(f"{x} held [%]" for x in names)]
    columns += ["largest bias [sigma]", f"largest error of {kind.reported}{unit}", "not finite"]
    heading(f"{name}, {', '.join(kind.bands)}", columns)
    lost = 0
    for case in CASES[name]:
        found = judged(pixels, case)
        lost += found.lost
        star = "" if found.told else " *"
        cells = [f"{case}{star}", str(num_pixels), codes_of(found), *cells_of(found, names)]
        print(f"| {' | '.join(cells)} | {found.lost} |", flush=True)
    return lost


def image_table(streams: int) -> int:
    """The same of an image that is retrieved as a whole."""
    image = Image(streams)
    names = image.kind.vector.names
    columns = ["what happened", "result codes [%]", *(f"{x} held [%]" for x in names)]
    columns += ["largest bias [sigma]", f"largest error of {image.kind.reported}"]
    columns += ["beside: success [%]", "beside: held [%]", "joint steps", "not finite"]
    bands = ", ".join(image.kind.bands)
    heading(f"smooth, {image.side} x {image.side} pixels of smoke, {bands}", columns)
    lost = 0
    for case in IMAGES:
        found = judged_image(image, case)
        lost += found.judged.lost
        star = "" if found.judged.told else " *"
        beside = ["-", "-"]
        if found.beside.any():
            beside[0] = f"{100 * found.success_beside:.1f}"
            if found.success_beside > 0:
                beside[1] = f"{100 * found.held_beside:.1f}"
        cells = [f"{case}{star}", codes_of(found.judged), *cells_of(found.judged, names)]
        cells += [*beside, str(found.steps), str(found.judged.lost)]
        print(f"| {' | '.join(cells)} |", flush=True)
    return lost


def main() -> None:
    kinds = [*KINDS, "smooth"]
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("kinds", nargs="*", default=kinds, metavar="KIND", help=str(kinds))
    parser.add_argument("--pixels", type=int, default=256)
    parser.add_argument("--streams", type=int, default=4)
    arguments = parser.parse_args()
    for name in arguments.kinds:
        if name not in kinds:
            parser.error(f"kinds are {', '.join(kinds)}; got {name!r}.")
    use_compiler_flags()
    use_compilation_cache()
    jax.config.update("jax_enable_x64", True)
    lost = 0
    for name in arguments.kinds:
        if name == "smooth":
            lost += image_table(arguments.streams)
        else:
            lost += table(name, arguments.pixels, arguments.streams)
    print("\n\\* The retrieval is told other than what is true.")
    if lost:
        sys.exit(f"{lost} successes are not finite.")


if __name__ == "__main__":
    main()
