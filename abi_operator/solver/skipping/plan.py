"""What is solved of a tile of columns: its groups of layers, their doublings, and the last mode."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..method.doublings import Doublings, layer_doublings
from ..method.mode_layers import Layers, read
from . import budget
from .budget import Expected
from .depths import sums
from .grouping import Alike, Groups, Limits, grouped
from .heat import Warm
from .merging import Solved, handed_back, merged


class LayersOfModes(NamedTuple):
    """What all modes see of the layers, top first.

    Parameters
    ----------
    tau, coalbedo, sun_secants
        Scaled thickness, 1 - ssa, and the secant of the sun's beam. [-]
    moments
        :math:`\\omega(2l+1)\\chi_l` of even and of odd degrees. [-]
    """

    tau: Float[Array, "layer *batch"]
    coalbedo: Float[Array, "layer *batch"]
    sun_secants: Float[Array, "layer *batch"]
    moments: tuple[Float[Array, "layer degree *batch"], Float[Array, "layer degree *batch"]]

    def rows(self) -> Float[Array, "layer row *batch"]:
        """All but the thickness, in one array."""
        single = jnp.stack([self.coalbedo, self.sun_secants], axis=1)
        return jnp.concatenate([single, *self.moments], axis=1)

    def as_layers(self) -> Layers:
        """The same as the modes read them, one by one."""
        tau, coalbedo, sun_secants, moments = self
        return Layers(tau, coalbedo, sun_secants, jnp.concatenate(moments))

    def of_rows(self, tau: Array, rows: Float[Array, "layer row *batch"]) -> "LayersOfModes":
        """Layers, or slopes in them, from a thickness and such an array."""
        end = 2 + self.moments[0].shape[1]
        return LayersOfModes(tau, rows[:, 0], rows[:, 1], (rows[:, 2:end], rows[:, end:]))


class Plan(eqx.Module):
    """How much of a tile is solved.

    Parameters
    ----------
    layers
        What is solved: groups of the layers given, in the places of the first ones.
    doublings
        Of each group.
    given, groups
        The layers given, and which group each belongs to; None where each is solved by itself.
    known, error_budget
        Of the light beside the modes', and the relative error of it that may be made; None where
        all modes are solved.
    peaked
        1 for columns of which three modes in a row may be small by chance, else 0: their phase
        functions have forward peaks that delta-M leaves a part of, whose modes hardly decay. 2 for
        those with backward peaks, of which any number of modes may: they are all solved. None where
        all modes of all columns are solved.
    """

    layers: LayersOfModes
    doublings: Doublings
    given: LayersOfModes
    groups: Groups | None
    known: Expected | None
    error_budget: float | None = eqx.field(static=True)
    peaked: Float[Array, "batch"] | None = None

    @property
    def num_groups(self) -> Any:
        """Layers to solve: a number where it is known, else data."""
        return self.layers.tau.shape[0] if self.groups is None else self.groups.number

    def slopes(
        self, found: LayersOfModes, faces: Float[Array, "level row *batch"] | None
    ) -> LayersOfModes:
        """Slopes in the layers given from those in what is solved and at its faces."""
        if self.groups is None:
            return found
        assert faces is not None
        groups = Solved(self.layers.tau, self.layers.rows(), found.tau, found.rows(), faces)
        tau, rows = handed_back(self.groups, self.given.tau, self.given.rows(), groups)
        return found.of_rows(tau, rows)

    def beyond_the_mean(self) -> Bool[Array, "batch"]:
        """Which columns need any mode but the mean, as far as is known before."""
        assert self.known is not None and self.error_budget is not None
        return self.known.aside > budget.OF_NO_MODES * self.error_budget * self.known.least

    def share(
        self, light: Float[Array, "*view batch"], size: Float[Array, "batch"]
    ) -> Float[Array, "batch"]:
        """How much of what it may be a mode's part of the light is, from the light of the modes so
        far."""
        assert self.known is not None and self.error_budget is not None
        light = jnp.maximum(jnp.abs(light + self.known.added), self.known.dark)
        share = budget.of_modes(2 * self.layers.moments[0].shape[1])
        return jnp.max(size / (share * self.error_budget * light), axis=0)

    def share_of_slopes(
        self, square: Float[Array, "batch"], tau_slopes: Float[Array, "layer batch"]
    ) -> Float[Array, "batch"]:
        """The same of its slopes in moments, from the sum of their squares and slopes in tau."""
        assert self.known is not None
        norm = jnp.sum(tau_slopes**2, axis=0) + self.known.through**2
        return jnp.sqrt(square / norm) / budget.OF_MODES_OF_SLOPES


def everything(layers: LayersOfModes, doublings: Doublings) -> Plan:
    """All layers and all modes."""
    return Plan(layers, doublings, layers, None, None, None)


def planned(
    layers: LayersOfModes,
    view_secants: Float[Array, "view *batch"],
    known: Expected,
    error_budget: float,
    most: int | None,
    thickest: float = float("inf"),
    warm: Warm | None = None,
    merges: bool = True,
) -> Plan:
    """What an error budget asks for.

    Parameters
    ----------
    layers, view_secants
        Of a tile.
    known
        Of the light of its columns.
    error_budget
        Relative error of the reflectance that may be made (`budget`).
    most
        Doublings of a layer, at most; None for no limit.
    thickest
        Optical depth on the way down and up that no group exceeds. [-]
    warm
        What is known of columns that emit.
    merges
        Whether layers are merged into groups.
    """
    given, groups, peaked = layers, None, peaked_columns(layers)
    if known.peaked is not None:
        peaked = jnp.maximum(peaked, known.peaked)
    # Few moments of such a phase function are as much below 0 as above: light scattered once, of
    # the whole function, says nothing of the rest.
    least = jnp.where(peaked > 1, known.dark, known.least)
    if merges and layers.tau.shape[0] > 1:
        secant = 0.5 * (layers.sun_secants[0] + jnp.max(view_secants, axis=0))
        allowed = budget.OF_MERGING * error_budget * least
        # Of reflectances that are large by 1 / (mu0 + mu), where sun and view graze, as a loss is.
        grazing = 1 / layers.sun_secants[0] + 1 / jnp.max(view_secants, axis=0)
        allowed = allowed * jnp.minimum(grazing, 1)
        if warm is None:
            # A reflectance is over mu0, a loss over the cosine of which the sun's way is that of
            # flat layers: through a sphere the sun shines as if it stood higher.
            allowed = allowed * known.mu0 * layers.sun_secants[0]
        forward = layers.moments[1][:, 0] / 3
        alike = Alike(layers.tau, 1 - layers.coalbedo, forward, _middle(layers))
        alike = alike._replace(second=_second(layers), sun_secants=layers.sun_secants)
        if warm is not None:
            alike = alike._replace(planck=warm.planck, light=warm.light)
        groups = grouped(alike, Limits(secant, allowed, thickest))
        tau, rows = merged(groups, layers.tau, layers.rows())
        layers = layers.of_rows(tau, rows)
    views = jnp.broadcast_to(view_secants[:, None], (len(view_secants), *layers.tau.shape))
    secants = jnp.concatenate([layers.sun_secants[None], views])
    num_streams = 2 * layers.moments[0].shape[1]
    share = budget.OF_DOUBLINGS if warm is None else budget.OF_DOUBLINGS_WARM
    error, single = share * error_budget, budget.rounds(error_budget)
    doublings = layer_doublings(layers.tau, secants, num_streams, most, error, single)
    return Plan(layers, doublings, given, groups, known, error_budget, peaked)


def peaked_columns(layers: LayersOfModes) -> Float[Array, "*batch"]:
    """1 for columns of phase functions with forward peaks that the streams do not resolve, 2 for
    those with backward ones, of which delta-M leaves all that they are."""
    degrees = layers.moments[1]
    num_streams = 2 * degrees.shape[1]
    last = degrees[:, -1] / (2 * num_streams - 1)
    peaks = jnp.maximum(-last, 0), jnp.maximum(last, 0)
    _, scattered, backward, forward = sums(layers.tau, layers.moments[0][:, 0], *peaks)
    sharp = forward > budget.FORWARD / num_streams * scattered
    sharp = sharp | (num_streams > budget.FITTED_TO)
    return jnp.where(backward > budget.BACKWARD * scattered, 2, sharp.astype(layers.tau.dtype))


def _middle(layers: LayersOfModes) -> Float[Array, "layer *batch"] | None:
    """Omega chi_k of k half the streams, of which `moments` has the even and the odd (2k + 1)-fold;
    None where that is g or nothing."""
    k = layers.moments[0].shape[1]
    return layers.moments[k % 2][:, k // 2] / (2 * k + 1) if k > 1 else None


def _second(layers: LayersOfModes) -> Float[Array, "layer *batch"] | None:
    """Omega chi_2, where that is not the `_middle`."""
    return layers.moments[0][:, 1] / 5 if layers.moments[0].shape[1] > 2 else None


def over_layers(
    body: Callable[[Any, Any], Any], carry: Any, plan: Plan, upwards: bool = False
) -> Any:
    """``carry = body(carry, number)`` for every layer to solve; numbers are floating.

    Of one layer that is the only one the number is None, of which a kernel would make no use
    (`machine.kernels`).
    """
    tau = plan.layers.tau
    if tau.shape[0] == 1:
        return body(carry, None)
    if plan.groups is None:
        numbers = jnp.arange(tau.shape[0], dtype=tau.dtype)
        step = lambda carry, number: (body(carry, number), None)  # noqa: E731
        return jax.lax.scan(step, carry, numbers, reverse=upwards)[0]
    count = plan.groups.number.astype(jnp.int32)

    def one(k, carry):
        return body(carry, (count - 1 - k if upwards else k).astype(tau.dtype))

    return jax.lax.fori_loop(0, count, one, carry)


def over_modes(
    body: Callable[[Any, Any, Any], tuple[Any, Any, Any]],
    carry: Any,
    modes: Any,
    start: int,
    rows: Any,
    plan: Plan,
) -> tuple[Any, Any]:
    """``carry, row, share = body(carry, mode, counts)`` for the modes that count.

    Where the mean is one of them it is the first, and counts. A tile ends with the last column that
    needs a mode. In the others it counts for nothing: what a column gets does not depend on those
    that it is solved with.

    Parameters
    ----------
    body
        Of one mode; gives its row of the results, and how much of what it may be to be the last one
        its part of them is. `counts` is 1 in columns that need it, else 0.
    carry
        What goes from mode to mode.
    modes
        What differs between them, on the first axis.
    start
        The first of them.
    rows
        What the results are like, in rows of all modes: those of modes that are not solved are 0.
    plan
        Whether all are solved, or until they are small.
    """
    num_modes = jax.tree.leaves(modes)[0].shape[0]
    if plan.error_budget is None:
        rest = jax.tree.map(lambda x: x[start:], modes)
        carry, found = jax.lax.scan(lambda c, mode: body(c, mode, 1.0)[:2], carry, rest)
        return carry, found
    tau = plan.layers.tau[0]
    latest, *earlier = (budget.DECAY**i for i in range(1, budget.LOOKED_BACK + 1))
    before = (jnp.full_like(tau, jnp.inf),) * budget.LOOKED_BACK
    beyond, peaked = plan.beyond_the_mean(), plan.peaked
    assert peaked is not None
    counts = jnp.where(beyond | (start == 0), jnp.ones_like(tau), 0)

    def unsettled(state):
        m, *_, counts = state
        return (m < num_modes) & jnp.any(counts > 0)

    def one(state):
        m, carry, rows, before, counts = state
        mode = jax.tree.map(lambda x: read(x, m), modes)
        carry, row, share = body(carry, mode, counts)
        rows = jax.tree.map(
            lambda x, new: jax.lax.dynamic_update_index_in_dim(x, new, m, 0), rows, row
        )
        wanting = (share > 1) | (latest * before[0] > 1) | (peaked > 1)
        for decayed, past in zip(earlier, before[1:], strict=True):
            wanting = wanting | ((peaked > 0) & (decayed * past > 1))
        before = share, *before[:-1]
        return m + 1, carry, rows, before, jnp.where(wanting & beyond, counts, 0)

    rows = jax.tree.map(jnp.zeros_like, rows)
    _, carry, rows, _, _ = jax.lax.while_loop(
        unsettled, one, (jnp.int32(start), carry, rows, before, counts)
    )
    return carry, jax.tree.map(lambda x: x[start:], rows)
