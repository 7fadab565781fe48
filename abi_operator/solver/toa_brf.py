"""The door of the solver: reflectance of plane-parallel columns at the top of the atmosphere."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from .._batching import map_tiles, tile_size
from .azimuth import multiple_scattering
from .delta_m import delta_m as scale_delta_m
from .delta_m import unscaled
from .doublings import UNKNOWN, sufficient_doublings
from .legendre import legendre_series
from .single_scatter import cos_scattering_angle, exact_single_scattering


def toa_brf(
    tau: Float[ArrayLike, "*batch layer"],
    ssa: Float[ArrayLike, "*batch layer"],
    moments: Float[ArrayLike, "*batch layer moment"],
    albedo: Float[ArrayLike, "*batch"],
    mu0: Float[ArrayLike, "*batch"],
    mu: Float[ArrayLike, "*batch"],
    relative_azimuth: Float[ArrayLike, "*batch"],
    *,
    num_streams: int = 16,
    num_modes: int | None = None,
    delta_m: bool = True,
    single_scattering: str | None = "tms",
    phase_function: Float[ArrayLike, "*batch layer"] | None = None,
    num_doublings: int | None = None,
) -> Float[Array, "*batch"]:
    r"""Bidirectional reflectance factor :math:`\pi I/(\mu_0 F_0)` at the top of the atmosphere.

    Scalar discrete ordinates over a Lambertian ground, differentiable (forward and reverse) in
    every floating argument. Leading axes broadcast by NumPy's rules; layers are numbered from the
    top. Values are not checked, and a reflectance may be slightly negative at few streams.

    Parameters
    ----------
    tau, ssa
        Extinction optical depth and single-scattering albedo of each layer. [-]
    moments
        Legendre moments of each layer's phase function, chi_0 = 1 (not read), without the factor
        2l + 1: `num_streams` + 1 at least, `num_streams` without delta-M. [-]
    albedo
        Lambertian albedo of the ground. [-]
    mu0, mu
        Cosines of the solar and view zenith angles, both above 0. At 1, where the derivative in
        the cosine is infinite, a finite one is returned. [-]
    relative_azimuth
        Azimuth between satellite and sun: 0 on the same side (backscatter), pi in the glint. [rad]
    num_streams
        Streams in both hemispheres together, even.
    num_modes
        Azimuth modes of the multiple scattering; None for all `num_streams` of them. The exact
        single scattering is untouched by it.
    delta_m
        Whether to scale forward peaks away.
    single_scattering
        ``"tms"`` replaces light scattered once by its exact value; None leaves it to the streams.
    phase_function
        Exact phase function of each layer at the scattering angle
        (`cos_scattering_angle`), mean 1 over the sphere; None sums all the moments given, which
        must then be enough of them: 64 or more for a cloud. [-]
    num_doublings
        Doublings of each layer (see `layer.half_layer`). None chooses from the largest layer where
        the arguments are concrete, and enough for layers of 1e5 where they are traced. Too small a
        number is an error that nothing reports.

    Returns
    -------
    Reflectance, in the arguments' common floating type (float32 if x64 is disabled). [-]

    Raises
    ------
    ValueError
        If shapes do not match, there are too few moments, or an option is out of range.
    """
    arrays = [tau, ssa, moments, albedo, mu0, mu, relative_azimuth]
    if phase_function is not None:
        arrays.append(phase_function)
    arrays = _promoted(arrays)
    _check(arrays, num_streams, num_modes, delta_m, single_scattering)
    if num_doublings is not None and num_doublings < 0:
        raise ValueError(f"num_doublings must be 0 or more; got {num_doublings}.")
    if num_doublings is None:
        num_doublings = _doublings(arrays, num_streams)
    return _solve(
        *arrays,
        num_streams=num_streams,
        num_modes=num_streams if num_modes is None else num_modes,
        use_delta_m=delta_m,
        tms=single_scattering == "tms",
        num_doublings=num_doublings,
    )


def _promoted(arguments: list) -> list[Array | np.ndarray]:
    """Give all arguments their common floating type, before any JAX operation.

    Python numbers have no type of their own and follow the arrays; integers become floating.
    """
    arrays = [x if isinstance(x, jax.Array) else np.asarray(x) for x in arguments]
    types = [
        argument if isinstance(argument, int | float) else array.dtype
        for argument, array in zip(arguments, arrays, strict=True)
    ]
    dtype = jax.dtypes.canonicalize_dtype(np.result_type(np.float16, *types))
    return [x.astype(dtype) for x in arrays]


def _check(arrays, num_streams, num_modes, delta_m, single_scattering) -> None:
    tau, ssa, moments, *angles_and_albedo = arrays[:7]
    if num_streams < 2 or num_streams % 2:
        raise ValueError(f"num_streams must be even and at least 2; got {num_streams}.")
    if num_modes is not None and not 1 <= num_modes <= num_streams:
        raise ValueError(f"num_modes must be 1 to num_streams = {num_streams}; got {num_modes}.")
    if single_scattering not in ("tms", None):
        raise ValueError(f"single_scattering must be 'tms' or None; got {single_scattering!r}.")
    if tau.ndim < 1 or ssa.ndim < 1 or moments.ndim < 2:
        raise ValueError(
            "tau and ssa need a layer axis, moments a layer and a moment axis; got shapes "
            f"{tau.shape}, {ssa.shape}, {moments.shape}."
        )
    layers = {tau.shape[-1], ssa.shape[-1], moments.shape[-2]}
    layers |= {x.shape[-1] for x in arrays[7:] if x.ndim}
    if len(layers - {1}) > 1:
        raise ValueError(
            "tau, ssa, moments and phase_function must have the same number of layers; got shapes "
            f"{tau.shape}, {ssa.shape}, {moments.shape}, {[x.shape for x in arrays[7:]]}."
        )
    needed = num_streams + 1 if delta_m else num_streams
    if moments.shape[-1] < needed:
        raise ValueError(
            f"{num_streams} streams need at least {needed} moments (delta_m={delta_m}); got "
            f"{moments.shape[-1]} in moments of shape {moments.shape}. Pad Rayleigh with zeros."
        )
    leading = [tau.shape[:-1], ssa.shape[:-1], moments.shape[:-2]]
    leading += [x.shape for x in angles_and_albedo] + [x.shape[:-1] for x in arrays[7:]]
    try:
        np.broadcast_shapes(*leading)
    except ValueError:
        raise ValueError(
            "leading axes of tau, ssa, moments, albedo, mu0, mu, relative_azimuth"
            f"{' and phase_function' if arrays[7:] else ''} do not broadcast: {leading}."
        ) from None


def _doublings(arrays: list, num_streams: int) -> int:
    tau, mu0, mu = arrays[0], arrays[4], arrays[5]
    if any(isinstance(x, Tracer) for x in (tau, mu0, mu)) or tau.size == 0:
        return UNKNOWN
    min_mu = min(float(np.min(mu0)), float(np.min(mu)))
    return sufficient_doublings(float(np.max(tau)), min_mu, num_streams)


@partial(
    jax.jit, static_argnames=("num_streams", "num_modes", "use_delta_m", "tms", "num_doublings")
)
def _solve(
    tau,
    ssa,
    moments,
    albedo,
    mu0,
    mu,
    relative_azimuth,
    phase_function=None,
    *,
    num_streams: int,
    num_modes: int,
    use_delta_m: bool,
    tms: bool,
    num_doublings: int,
) -> Array:
    # Outside, batch axes lead and broadcast; inside there is one, and it comes last.
    columns = [albedo, mu0, mu, relative_azimuth]
    batch = jnp.broadcast_shapes(
        tau.shape[:-1], ssa.shape[:-1], moments.shape[:-2], *(x.shape for x in columns)
    )
    num_layers = max(tau.shape[-1], ssa.shape[-1], moments.shape[-2])

    def inward(x, *own):
        full = jnp.broadcast_to(x, batch + own)
        return jnp.moveaxis(full.reshape(-1, *own), 0, -1)

    albedo, mu0, mu, relative_azimuth = (inward(x) for x in columns)
    tau, ssa = inward(tau, num_layers), inward(ssa, num_layers)
    moments = inward(moments, num_layers, moments.shape[-1])
    moments = jnp.concatenate([jnp.ones_like(moments[:, :1]), moments[:, 1:]], axis=1)

    arrays = (tau, ssa, moments, albedo, mu0, mu, relative_azimuth)
    if tms and phase_function is not None:
        arrays += (inward(phase_function, num_layers),)

    def solve_tile(tau, ssa, moments, albedo, mu0, mu, relative_azimuth, exact=None):
        scale = scale_delta_m if use_delta_m else unscaled
        layers = scale(tau, ssa, moments, num_streams)
        brf = multiple_scattering(
            layers,
            albedo,
            mu0,
            mu,
            relative_azimuth,
            num_modes=num_modes,
            num_doublings=num_doublings,
            single_scattering=not tms,
        )
        if not tms:
            return brf
        if exact is None:
            exact = legendre_series(moments, cos_scattering_angle(mu0, mu, relative_azimuth))
        ratio = layers.scattering_ratio
        return brf + exact_single_scattering(layers.tau, ratio, exact, mu0, mu)

    return map_tiles(solve_tile, arrays, tile_size(num_streams)).reshape(batch)
