"""A plume fitted between layers that stay: those are solved once (`solver.surroundings`).

    python examples/plume_between_layers.py

Twelve layers of clear air over a thin stratus and dark ground, seen at two wavelengths; between the
fifth and the sixth lies smoke of unknown optical depth and single-scattering albedo, which
`optimistix.least_squares` finds. Each of its steps costs the two layers of the plume and no more.
"""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from abi_operator.solver import Surroundings, surroundings, toa_brf

TRUTH = np.array([0.8, 0.92])
ANGLES = 0.7, 0.8, 2.0  # mu0, mu, relative azimuth
ALBEDO = np.array([0.05, 0.08])  # at 0.47 and 0.64 um
ABOVE, LAYERS = 5, 13
MOMENTS = 65


def air() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """tau, ssa and moments of the layers that stay, ``wavelength layer``, from the top."""
    rayleigh = np.array([0.186, 0.051])[:, None] * np.diff(np.linspace(0, 1, LAYERS) ** 2)
    tau = np.concatenate([rayleigh, np.full((2, 1), 1.5)], axis=1)
    moments = np.zeros((2, LAYERS, MOMENTS))
    moments[:, :-1, [0, 2]] = 1, 0.1
    moments[:, -1] = 0.85 ** np.arange(MOMENTS)
    return tau, np.ones_like(tau), moments


def plume(x: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """The same of smoke of an optical depth (at 0.47 um) and ssa, in two layers."""
    depth = x[0] * jnp.array([1.0, 0.58])
    moments = 0.62 ** jnp.arange(MOMENTS, dtype=x.dtype)
    shape = 2, 2
    return (
        jnp.broadcast_to(depth[:, None] / 2, shape),
        jnp.broadcast_to(x[1], shape),
        jnp.broadcast_to(moments, (*shape, MOMENTS)),
    )


def study(num_streams: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Optical depth and ssa that are found, and the reflectances that they were found from."""
    around = surroundings(*air(), ALBEDO, *ANGLES, num_above=ABOVE, num_streams=num_streams)
    seen = around.brf(*plume(jnp.asarray(TRUTH)))

    def departure(x: jax.Array, known: tuple[Surroundings, jax.Array]) -> jax.Array:
        around, seen = known
        return around.brf(*plume(x)) - seen

    solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
    found = optx.least_squares(departure, solver, jnp.array([0.3, 0.85]), (around, seen))
    return np.asarray(found.value), np.asarray(seen)


def whole(x: np.ndarray, num_streams: int = 8) -> np.ndarray:
    """Reflectances of the whole columns at once."""
    layers = [
        np.insert(stays, [ABOVE] * 2, own, axis=1)
        for stays, own in zip(air(), plume(jnp.asarray(x)), strict=True)
    ]
    return np.asarray(toa_brf(*layers, ALBEDO, *ANGLES, num_streams=num_streams))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    (depth, ssa), seen = study()
    print(f"optical depth {depth:.4f}, in truth {TRUTH[0]}; ssa {ssa:.4f}, in truth {TRUTH[1]}")
    print(f"reflectances {seen[0]:.5f} and {seen[1]:.5f}; of the whole column at once ", end="")
    print("{:.5f} and {:.5f}".format(*whole(np.array([depth, ssa]))))
