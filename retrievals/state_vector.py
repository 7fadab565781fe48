r"""The retrieval's unknowns, x, and the state that they stand for.

A state vector is a list of quantities, each of which says by itself where in a `State` it belongs
(`quantities.Quantity`): a retrieval of something new is a declaration, as those of `declarations`
are, and no new code. Each element of x may take any real value.
"""

from collections import Counter
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from abi_operator import State
from abi_operator.plume_edges import moves_plume_edges

from .prior import Prior
from .quantities import Derived, Quantity, part, with_part


@dataclass(frozen=True)
class StateVector:
    """Meaning of x.

    Parameters
    ----------
    quantities
        One for each element of x. The last of them is put into a state first, so that one may
        refine what a later one has set (a shift of the single-scattering albedo that belongs to
        an effective radius).
    derived
        What is reported beside them.
    """

    quantities: tuple[Quantity, ...]
    derived: tuple[Derived, ...] = ()

    def __post_init__(self) -> None:
        if not self.quantities:
            raise ValueError("a state vector needs a quantity.")
        names = Counter(item.name for item in (*self.quantities, *self.derived))
        twice = [name for name, number in names.items() if number > 1]
        if twice:
            raise ValueError(f"quantities need names of their own; {twice} are there twice.")

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.quantities)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the elements."""
        return tuple(quantity.name for quantity in self.quantities)

    def x(self, *values: Float[ArrayLike, "*batch"]) -> Float[Array, "*batch x"]:
        """State vector of one value for each quantity, each in its unit.

        Raises
        ------
        ValueError
            Where there are too few or too many.
        """
        if len(values) != self.size:
            raise ValueError(f"x needs a value each of {', '.join(self.names)}; got {len(values)}.")
        pairs = zip(self.quantities, values, strict=True)
        elements = [quantity.transform.x(jnp.asarray(value, float)) for quantity, value in pairs]
        return jnp.stack(jnp.broadcast_arrays(*elements), axis=-1)

    def values(self, x: Float[Array, "*batch x"]) -> dict[str, Float[Array, "*batch"]]:
        """The quantities, by name."""
        return {q.name: q.transform.value(x[..., i]) for i, q in enumerate(self.quantities)}

    def slopes(self, x: Float[Array, "*batch x"]) -> Float[Array, "*batch x"]:
        """Derivative of each quantity in its own element of x."""
        columns = [q.transform.slope(x[..., i]) for i, q in enumerate(self.quantities)]
        return jnp.stack(columns, axis=-1)

    def state(self, x: Float[Array, "*batch x"], state: State) -> State:
        """Put x into a state.

        Raises
        ------
        ValueError
            Where the state has no such place.
        """
        for i, quantity in reversed(list(enumerate(self.quantities))):
            node = part(state, quantity.place)
            value = quantity.transform.value(x[..., i])
            state = with_part(state, quantity.place, quantity.put(node, value))
        return state

    def moves_plumes(self, states: State) -> bool:
        """Whether x moves the base or the top of a plume of such columns."""
        first = jax.tree.map(lambda leaf: leaf[:1], states)
        return moves_plume_edges(lambda x: self.state(x[None], first), self.size)

    def held(self, state: State, name: str) -> Array:
        """Value of a quantity that a state holds itself: the truth, or what is thought of it.

        Raises
        ------
        ValueError
            Where a state does not tell.
        """
        quantity = self.quantities[self.names.index(name)]
        if quantity.get is None:
            raise ValueError(f"a state does not tell its {name}.")
        return jnp.asarray(quantity.get(part(state, quantity.place)))

    def prior(self, states: State | None = None) -> Prior:
        """What is known of x where nobody says more, from the declarations of its elements.

        Parameters
        ----------
        states
            Where means are those of the states: the pixels, batched along one leading axis.

        Returns
        -------
        Prior
            One for all pixels; or one for each of the `states`, where a mean is theirs, which then
            is kept inside the limits of its quantity, by a ten-thousandth of their distance.

        Raises
        ------
        ValueError
            Where a mean is that of states, and there are none or they do not tell.
        """
        means, sigmas = [], []
        for quantity in self.quantities:
            mean = quantity.mean
            if mean is None:
                if states is None:
                    raise ValueError(f"the prior of {quantity.name} is that of states; give them.")
                held = jnp.asarray(self.held(states, quantity.name), float)
                mean = quantity.transform.inside(held)
            x = quantity.transform.x(jnp.asarray(mean, float))
            slope = quantity.transform.slope(x) if quantity.sigma_in_units else 1.0
            means.append(np.asarray(x))
            sigmas.append(quantity.sigma / np.asarray(slope))
        x_prior = np.stack(np.broadcast_arrays(*means), axis=-1)
        sigma = np.stack(np.broadcast_arrays(*sigmas), axis=-1).astype(x_prior.dtype)
        return Prior(x_prior, sigma[..., None] ** 2 * np.eye(self.size, dtype=sigma.dtype))

    def report(
        self, x: Float[Array, " x"], state: State, covariance: Float[Array, "x x"]
    ) -> dict[str, Array | dict[str, Array]]:
        r"""Derived quantities of one pixel, and their posterior standard deviations.

        The latter, :math:`\sqrt{g^T \hat S g}` with the gradient g of the quantity, have
        ``_sigma`` at the end of their names.
        """

        def derived(x: Float[Array, " x"]) -> dict[str, Array | dict[str, Array]]:
            found, values = self.state(x, state), self.values(x)
            return {
                item.name: item.read(
                    part(found, item.place), *(values[name] for name in item.needs)
                )
                for item in self.derived
            }

        gradients = jax.jacfwd(derived)(x)
        sigma = jax.tree.map(lambda g: jnp.sqrt(g @ covariance @ g), gradients)
        return derived(x) | {f"{name}_sigma": value for name, value in sigma.items()}
