r"""Phase functions given as tables over the scattering angle.

Between the angles of a table lies a cubic in the scattering angle :math:`\Theta` that takes the
table's values and slopes there. The slopes are those of the quartic through five neighbouring
angles; beyond 0 and :math:`\pi` the table is continued as the even function that a phase function
is, so that the slope is 0 at both ends. The interpolant has a continuous slope and is linear in
the table, hence differentiable in it everywhere. It may overshoot, below 0 too, where a table is
too coarse for its phase function.

Largest relative error between the angles of an equidistant table, in float64, for
Henyey-Greenstein with g = 0.86 and for water droplets (Mie theory, 0.64 um, effective radius 10 um,
effective variance 0.1; around the glory, at 1 degree in the aureole):

======= ======== ================== ========
spacing angles   Henyey-Greenstein  droplets
======= ======== ================== ========
0.1 deg 1801     2e-9               2e-5
0.2 deg 901      3e-8               6e-4
0.5 deg 361      2e-6               4e-2
1 deg   181      3e-5               7e-1
======= ======== ================== ========

Interpolating the logarithm instead would not be linear in the table; with the same slopes it is 2
to 3 times better for Henyey-Greenstein and about 2 times worse for the droplets at the two finer
spacings.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from .._numerics import safe_divide, safe_sqrt

_STENCIL = 5  # angles that make a slope


def interpolate_phase_function(
    table: Float[Array, "*#batch component angle"],
    scattering_angles: ArrayLike,
    cos_scattering_angle: Float[Array, "..."],
    *,
    multiple_views: bool = False,
) -> Float[Array, "..."]:
    r"""Phase functions at the scattering angle of each column, from tables.

    With x from 0 to 1 between the angles :math:`\Theta_k` and :math:`\Theta_{k+1} = \Theta_k + h`,

    .. math::
       P = P_k + (P_{k+1}-P_k)\,x^2(3-2x) + h\,x(1-x)\,[(1-x)P'_k - x P'_{k+1}].

    Differentiable in the table and in the cosine. At cosines of exactly 1 and -1 the derivative in
    the cosine is 0: P is stationary there in every direction of sun and view.

    Parameters
    ----------
    table
        Phase functions of the components, all on the same angles; tables shared by all columns
        have no leading axes. [-]
    scattering_angles
        The angles, increasing from 0 to pi, both included, not necessarily equidistant: concrete
        numbers, at least 3. They are rounded to the type of the table. [rad]
    cos_scattering_angle
        Cosine of the scattering angle, ``(*batch)``, with `multiple_views` ``(*batch, view)``;
        rounding errors beyond -1 and 1 do no harm. [-]
    multiple_views
        Whether the last axis of `cos_scattering_angle` is one of views.

    Returns
    -------
    Phase functions, ``(*batch, component)`` or ``(*batch, component, view)``. [-]

    Raises
    ------
    ValueError
        If the angles do not increase from 0 to pi (in the precision of the table), or are not as
        many as the table has.
    """
    angles = _checked_angles(scattering_angles, table)
    grid = jnp.asarray(angles, table.dtype)
    width = jnp.asarray(np.diff(angles), table.dtype)

    def interpolate(table, cosine):
        # With a slope of 0, where that of arccos is infinite, at cosines of 1 and -1.
        angle = jnp.arctan2(safe_sqrt((1 - cosine) * (1 + cosine)), cosine)
        k = jnp.clip(jnp.searchsorted(grid, angle, side="right") - 1, 0, len(angles) - 2)
        h = width[k]
        x = (angle - grid[k]) / h
        slope = _slopes(table, angles)
        low, high = table[:, k], table[:, k + 1]
        bend = (1 - x) * slope[:, k] - x * slope[:, k + 1]
        return low + (high - low) * (x * x * (3 - 2 * x)) + h * x * (1 - x) * bend

    if not multiple_views:
        cos_scattering_angle = cos_scattering_angle[..., None]
    values = jnp.vectorize(interpolate, signature="(c,a),(v)->(c,v)")(table, cos_scattering_angle)
    return values if multiple_views else values[..., 0]


def mix_phase_functions(
    weights: Float[Array, "*#batch layer component"],
    values: Float[Array, "..."],
    *,
    multiple_views: bool = False,
) -> Float[Array, "..."]:
    r"""Phase function of each layer from those of its components.

    :math:`P_i = \sum_c w_{ic} P_c / \sum_c w_{ic}`; 0, with derivative 0, in a layer whose weights
    are all 0, which scatters nothing. The derivative for bringing particles into such a layer is
    that at a very small weight.

    Parameters
    ----------
    weights
        Scattering optical depth of each component in each layer, or anything proportional. [-]
    values
        Phase functions of the components at the scattering angle, ``(*batch, component)``, with
        `multiple_views` ``(*batch, component, view)``. [-]
    multiple_views
        Whether the last axis of `values` is one of views.

    Returns
    -------
    Phase functions, ``(*batch, layer)`` or ``(*batch, layer, view)``. [-]
    """
    if not multiple_views:
        values = values[..., None]
    mixed = _weighted_mean(weights, values)
    return mixed if multiple_views else mixed[..., 0]


def mix_moments(
    weights: Float[Array, "*#batch layer component"],
    moments: Float[Array, "*#batch component moment"],
) -> Float[Array, "*batch layer moment"]:
    r"""Legendre moments of each layer from those of its components.

    :math:`\chi_{il} = \sum_c w_{ic} \chi_{cl} / \sum_c w_{ic}`; 1, 0, 0, ... in a layer whose
    weights are all 0.

    Parameters
    ----------
    weights
        Scattering optical depth of each component in each layer, or anything proportional. [-]
    moments
        Legendre moments of the components, chi_0 = 1 (not read), without the factor 2l + 1. [-]
    """
    higher = _weighted_mean(weights, moments[..., 1:])
    return jnp.concatenate([jnp.ones((*higher.shape[:-1], 1), higher.dtype), higher], axis=-1)


def moments_of_table(
    table: Float[Array, "*batch angle"],
    scattering_angles: ArrayLike,
    num_moments: int,
) -> Float[Array, "*batch moment"]:
    r"""Legendre moments of the interpolated tables, without the factor 2l + 1.

    :math:`\chi_l = \frac12 \int_0^\pi P(\Theta)\, P_l(\cos\Theta) \sin\Theta\, d\Theta`, a constant
    matrix, made by NumPy in float64, times the table: exact, up to rounding, for the interpolant of
    `interpolate_phase_function`. chi_0 is 1 if the table comes from `normalise_table`.

    Parameters
    ----------
    table, scattering_angles
        Phase functions [-] and their angles [rad], as in `interpolate_phase_function`.
    num_moments
        Number of moments, chi_0 the first.

    Raises
    ------
    ValueError
        As in `interpolate_phase_function`, and if there is not at least one moment.
    """
    if num_moments < 1:
        raise ValueError(f"num_moments must be 1 or more; got {num_moments}.")
    matrix = _moment_matrix(_checked_angles(scattering_angles, table), num_moments)
    constant = jnp.asarray(matrix.T, table.dtype)
    return jnp.matmul(table, constant, precision=jax.lax.Precision.HIGHEST)


def normalise_table(
    table: Float[Array, "*batch angle"], scattering_angles: ArrayLike
) -> Float[Array, "*batch angle"]:
    """Tables divided by the mean of their interpolants over the sphere, which becomes 1.

    Differentiable in the table. Parameters and errors as in `moments_of_table`.
    """
    return table / moments_of_table(table, scattering_angles, 1)


def _weighted_mean(weights, values):
    total = jnp.einsum("...lc,...cv->...lv", weights, values, precision=jax.lax.Precision.HIGHEST)
    return safe_divide(total, jnp.sum(weights, axis=-1)[..., None])


def _checked_angles(scattering_angles: ArrayLike, table: Array) -> np.ndarray:
    """The angles as the table's type holds them, in float64."""
    given = np.asarray(scattering_angles, np.float64)
    if given.ndim != 1 or given.size < 3 or given.shape != table.shape[-1:]:
        raise ValueError(
            "scattering_angles must be 3 or more, one for each entry of the table's last axis; got "
            f"shape {given.shape} for a table of shape {table.shape}."
        )
    # pi may come from degrees or from a file in float32.
    if given[0] != 0 or abs(given[-1] - np.pi) > 1e-6:
        raise ValueError(
            f"scattering_angles must begin with 0 and end with pi; got {given[0]} and {given[-1]}."
        )
    angles = np.append(given[:-1], np.pi).astype(table.dtype).astype(np.float64)
    if not np.all(np.diff(angles) > 0):
        raise ValueError(
            f"scattering_angles must increase; in {table.dtype} those from index "
            f"{np.argmin(np.diff(angles) > 0)} on do not."
        )
    return angles


def _stencil(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights and indices of P' at angle i: sum_k weight[k, i] (P[index[k, i]] - P[i])."""
    n, half = len(angles), _STENCIL // 2
    inner = np.arange(n)
    mirrored = np.concatenate([inner[half:0:-1], inner, inner[-2 : -2 - half : -1]])
    continued = angles[mirrored]
    continued[:half] *= -1
    continued[-half:] = 2 * angles[-1] - continued[-half:]
    index = np.stack([mirrored[k : k + n] for k in range(_STENCIL)])
    offset = np.stack([continued[k : k + n] for k in range(_STENCIL)]) - angles
    weight = np.zeros((_STENCIL, n))
    for k in set(range(_STENCIL)) - {half}:
        others = [j for j in range(_STENCIL) if j not in (k, half)]
        weight[k] = np.prod([offset[j] / (offset[j] - offset[k]) for j in others], axis=0)
        weight[k] /= offset[k]
    weight[:, [0, -1]] = 0  # where the mirrored terms cancel
    return weight, index


def _slopes(
    table: Float[Array, "component angle"], angles: np.ndarray
) -> Float[Array, "component angle"]:
    weight, index = _stencil(angles)
    constant = jnp.asarray(weight, table.dtype)
    terms = (w * (table[:, i] - table) for w, i in zip(constant, index, strict=True))
    return sum(terms, jnp.zeros_like(table))


def _moment_matrix(angles: np.ndarray, num_moments: int) -> Float[np.ndarray, "moment angle"]:
    width = np.diff(angles)
    # 2q Gauss points follow P_l(cos Theta) over an interval in which it turns by far less than 2q;
    # 12 more bring the error below rounding.
    num_points = 12 + int(np.ceil(num_moments * width.max() / 2))
    x, weight = np.polynomial.legendre.leggauss(num_points)
    x, weight = (x + 1) / 2, weight / 2
    angle = angles[:-1, None] + width[:, None] * x
    measure = np.sin(angle) / 2 * weight * width[:, None]
    cosine = np.cos(angle)
    rise, bend = x * x * (3 - 2 * x), x * (1 - x)
    shapes = np.stack([1 - rise, rise, bend * (1 - x), -bend * x])

    n = len(angles)
    by_value, by_slope = np.zeros((2, num_moments, n))
    before, here = np.zeros_like(cosine), np.ones_like(cosine)
    for degree in range(num_moments):
        low, high, slope_low, slope_high = np.einsum("ip,sp->si", measure * here, shapes)
        by_value[degree, :-1] += low
        by_value[degree, 1:] += high
        by_slope[degree, :-1] += slope_low * width
        by_slope[degree, 1:] += slope_high * width
        following = ((2 * degree + 1) * cosine * here - degree * before) / (degree + 1)
        before, here = here, following

    for w, i in zip(*_stencil(angles), strict=True):
        np.add.at(by_value.T, i, (by_slope * w).T)
        by_value -= by_slope * w
    return by_value
