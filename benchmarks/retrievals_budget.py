"""What an error budget moves in retrievals and their Jacobians, and whether any retrieval stalls.

    python benchmarks/retrievals_budget.py [--pixels 5000] [--streams 8] [--check]

Pixels, noise and prior are those of `retrievals_pixels.py`: optical depth, ssa and effective
radius of smoke from C01 C02 C03. By budget, beside no budget at all: the relative error of the
values at the truth, that of a pixel's Jacobian (norm of the difference over the norm), 99 of 100
each; the share of pixels that converge, and of those that do so with a budget and not without, or
the other way; evaluations; and how far solutions are apart, in posterior standard deviations.
`--check` exits with 1 where values are not within the budget or slopes not within 1 %, in 99 of
100, or where a tenth of a per cent more pixels do not converge.
"""

import argparse
import sys
from dataclasses import replace
from functools import partial

import jax
import numpy as np
from retrievals_pixels import with_prior
from rounds import Bars, table

from abi_operator.machine.speed import use_compilation_cache
from abi_operator.scene import ERROR_BUDGET
from retrievals import Minimiser, retrieve_pixels
from retrievals.chunks import map_chunks
from retrievals.inverse import value_and_jacobian

NAMES = ("aod_550", "ssa_shift", "effective_radius_um")
BUDGETS = (None, 1e-4, ERROR_BUDGET)
OF_SLOPES, STALLED = 1e-2, 1e-3


def evaluated(forward, x, states):
    """Values (pixel, band) and Jacobians (pixel, band, x)."""
    run = jax.jit(jax.vmap(lambda x, state: value_and_jacobian(partial(forward, state=state), x)))
    return map_chunks(run, x, states)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pixels", type=int, default=5000)
    parser.add_argument("--streams", type=int, default=8)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    use_compilation_cache()
    jax.config.update("jax_enable_x64", True)
    whole, observation, states, prior, x = with_prior(options.pixels, options.streams, NAMES)
    bars, rows = Bars(), []
    for budget in BUDGETS:
        forward = replace(whole, error_budget=budget)
        value, jacobian = evaluated(forward, x, states)
        how = Minimiser(starts="prior")
        found = retrieve_pixels(forward, observation, states, prior=prior, minimiser=how).inversion
        if budget is None:
            exact, slopes, reference = value, jacobian, found
        wrong = np.percentile(np.abs(value / exact - 1).max(axis=1), 99)
        apart = np.linalg.norm(jacobian - slopes, axis=(1, 2))
        bent = np.percentile(apart / np.linalg.norm(slopes, axis=(1, 2)), 99)
        sigma = np.sqrt(np.diagonal(reference.covariance, axis1=1, axis2=2))
        both = found.converged & reference.converged
        moved = (np.abs(found.x - reference.x) / sigma).max(axis=1)[both]
        lost = np.mean(reference.converged & ~found.converged)
        won = np.mean(found.converged & ~reference.converged)
        middle, far = np.percentile(moved, (50, 99))
        rows.append(
            [
                "none" if budget is None else f"{budget:g}",
                *(f"{x:.1e}" for x in (wrong, bent)),
                *(f"{100 * x:.2f}" for x in (np.mean(found.converged), lost, won)),
                f"{np.mean(found.num_steps):.2f}",
                f"{middle:.4f} {far:.3f}",
            ]
        )
        if budget is not None:
            bars.judge(wrong <= budget, f"values within {budget:g}: {wrong:.1e}")
            bars.judge(bent <= OF_SLOPES, f"Jacobians within {OF_SLOPES:g}: {bent:.1e}")
            bars.judge(lost - won <= STALLED, f"stalled by {budget:g}: {lost - won:.2g}")
    heads = ("budget", "values", "Jacobians", "converged [%]", "lost [%]", "won [%]")
    print(f"{options.pixels} pixels, {options.streams} streams; 99 of 100 are within\n")
    table([*heads, "evaluations", "apart, median and 99th [sigma]"], rows)
    bars.report()
    sys.exit(1 if options.check and bars.failed else 0)


if __name__ == "__main__":
    main()
