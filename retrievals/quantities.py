"""What can be retrieved: a place in a state, what becomes of it, and its way to a number.

A `Quantity` is data. Its place is a path such as ``"atmosphere.plumes.smoke"`` or ``"albedo.C02"``,
the names of fields and the keys of dictionaries from a `State` on; it ends at a leaf or at any part
of the state. `put` makes a new part of the old one and a value: `replaced`, `scaled` and
`logit_shifted` do so with every leaf of the part, and any function of a module does, too.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from abi_operator import State

from .transforms import Transform

Put = Callable[[Any, Float[Array, "*batch"]], Any]


@dataclass(frozen=True)
class Quantity:
    """One element of a state vector.

    Parameters
    ----------
    name, units, long_name
        Of the variable that holds it in a product; units as in CF (UDUNITS).
    place
        Path to the part of the state that is changed.
    transform
        Smooth function from x to the quantity.
    put
        From the part and the quantity to the new part.
    sigma
        What is known of it where nobody says more: standard deviation of its prior, in x [-] or, if
        `sigma_in_units`, at the mean and in the unit of the quantity.
    mean
        Mean of that prior, in the unit of the quantity; None for what the state holds itself, by
        `get`, pixel by pixel.
    get
        From the part to the quantity, the inverse of `put`: by it the truth is known. None where a
        state does not tell.
    starts
        Where a scan looks for minima, in the unit of the quantity; none for `mean`.
    largest_error
        Posterior standard deviation from which a retrieval is no success, of the value, in the unit
        of the quantity; None for no limit.
    sigma_in_units
        Whether `sigma` is in the unit of the quantity: in x, it then depends on the mean.
    """

    name: str
    units: str
    long_name: str
    place: str
    transform: Transform
    put: Put
    sigma: float
    mean: float | None = None
    get: Callable[[Any], Array] | None = None
    starts: tuple[float, ...] = ()
    largest_error: Callable[[Any], Any] | None = None
    sigma_in_units: bool = False

    def __post_init__(self) -> None:
        if not self.sigma > 0:
            raise ValueError(f"sigma of {self.name} must be above 0; got {self.sigma}.")
        if self.mean is None and self.get is None:
            raise ValueError(f"{self.name} needs a mean, or a way to get one from the state.")


@dataclass(frozen=True)
class Derived:
    """What follows from a retrieved state and is reported beside the quantities.

    Parameters
    ----------
    name, units, long_name
        Of the variable in a product.
    place
        Path to a part of the state.
    read
        From that part, and the values of the quantities that it `needs`, to an array, or to a
        dictionary of arrays by band.
    needs
        Names of quantities of the state vector.
    """

    name: str
    units: str
    long_name: str
    place: str
    read: Callable[..., Array | dict[str, Array]]
    needs: tuple[str, ...] = ()


def part(state: State, place: str) -> Any:
    """The part of a state at a path.

    Raises
    ------
    ValueError
        Where the state has no such part, with what it has instead.
    """
    return reduce(lambda node, key: _inside(node, key, place), place.split("."), state)


def _inside(node: Any, key: str, place: str) -> Any:
    if isinstance(node, Mapping):
        found, names = node.get(key), list(node)
    else:
        found = getattr(node, key, None)
        names = [name for name in vars(node) if getattr(node, name) is not None]
    if found is None:
        raise ValueError(f"the state has no {place}: instead of {key!r} there is {names}.")
    return found


def with_part(state: State, place: str, new: Any) -> State:
    """A state with another part at a path."""
    return eqx.tree_at(lambda tree: part(tree, place), state, new)


def replaced(node: Any, value: Float[Array, "*batch"]) -> Any:
    """The value in place of every leaf."""
    return jax.tree.map(lambda leaf: _beside(value, leaf) + jnp.zeros_like(leaf), node)


def scaled(node: Any, value: Float[Array, "*batch"]) -> Any:
    """Every leaf times the value."""
    return jax.tree.map(lambda leaf: leaf * _beside(value, leaf), node)


def logit_shifted(node: Any, value: Float[Array, "*batch"]) -> Any:
    r"""Every leaf, a share p between 0 and 1, with a value s added to its logit.

    .. math:: \frac{1 - p'}{p'} = e^{-s}\, \frac{1 - p}{p}

    Of single-scattering albedos the ratio of absorption to scattering changes by one factor in all
    bands, and their spectrum stays.
    """

    def shifted(leaf: Array) -> Array:
        shift = _beside(value, leaf)
        share, rest = leaf * jax.nn.sigmoid(shift), (1 - leaf) * jax.nn.sigmoid(-shift)
        return share / (share + rest)

    return jax.tree.map(shifted, node)


def itself(node: Any) -> Any:
    """The part as it is: a leaf, or leaves by band."""
    return node


def _beside(value: Array, leaf: Array) -> Array:
    """A value per column beside a leaf that may have an axis of layers."""
    return jnp.reshape(value, value.shape + (1,) * (jnp.ndim(leaf) - value.ndim))
